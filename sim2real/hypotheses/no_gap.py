"""Whether the model as it is leaves nothing but noise: neither blocks nor any effect say otherwise."""

from __future__ import annotations

import numpy as np

from sim2real.hypotheses.contest import Contest, Entry
from sim2real.hypotheses.goodness import fitness, gross_share
from sim2real.observing.drive import BLOCK_S
from sim2real.observing.evidence import Evidence

NO_GAP_MISFIT = 1.4
"""Up to this misfit of the model as it is, what is left is noise [-]."""
NO_GAP_GAIN = 0.03
"""As long as no effect takes more than this share off the loss [-]."""
NOISE_MISFIT, NOISE_GAIN = 1.0, 0.12
"""And four times as much where the misfit is no more than noise alone gives: noise that was read too large, as of a
signal that is held, or of sensors that are next to ideal, leaves room for small ages, and for air of another density
[-]."""
NEGLIGIBLE = 0.02
"""An effect of no more than this share of a noticeable change is none, whatever it takes: no interval is much narrower
[-]."""
DRIFT_GAIN = 0.2
"""And of the share of the loss that drifting sensors cause, an effect may take this, too [-]."""
GROSS_BLOCKS = 0.01
"""Nor where more than this share of the blocks is far beyond noise: what happens rarely, as a wheel locks, hardly moves
the misfit [-]."""


def is_noise(contest: Contest, fit_to: Evidence, holdout: Evidence) -> bool:
    """Whether the model as it is leaves nothing but noise: neither its blocks nor any effect say otherwise."""
    null = contest.null
    misfit = fitness(null, fit_to, holdout).misfit
    if misfit > NO_GAP_MISFIT or gross_share(null, fit_to, holdout) > GROSS_BLOCKS:
        return False
    most = (NOISE_GAIN if misfit <= NOISE_MISFIT else NO_GAP_GAIN) + DRIFT_GAIN * _drifting(fit_to, holdout)
    return all(e.loss >= (1.0 - most) * null.loss for e in _not_negligible(contest))


def _not_negligible(contest: Contest) -> list[Entry]:
    return [e for e in contest.singles if not _negligible(e)]


def _negligible(entry: Entry) -> bool:
    """Whether an effect is next to none at its best."""
    candidate = entry.fitted.candidate
    off = np.abs(entry.fitted.x - candidate.neutral) / candidate.scale
    return bool(np.all(off < NEGLIGIBLE))


def _drifting(*evidence: Evidence) -> float:
    """Share of the residuals' variance that is the sensors' drift [-]."""
    parts = [
        noise.slow / drive.rows_in(BLOCK_S)
        for each in evidence
        for drive, noise in zip(each.drives, each.noises, strict=True)
    ]
    return float(np.mean(parts))
