"""What is said of an effect's parameters: their intervals, and whether the logs say anything of them at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim2real.hypotheses.contest import Entry
from sim2real.hypotheses.fitting import Fit
from sim2real.observing.evidence import Evidence
from sim2real.observing.robust import robust_weight
from sim2real.result import NORMAL_95, Interval

Array = NDArray[np.float64]

EXCITED_SHARE = 4.0 / 3.0
"""An effect is seen when the half width of its first parameter is below this many noticeable changes of it, or leaves
its absence out [-]."""
INTERVAL_FACTOR = 5.0
"""Intervals are wider than the sandwich by this, since forms differ: with 3, 140 of 166 withheld parameters lay within,
with 4 76 of 98 of harder forms."""
SCORE_BLOCK_S = 5.0
"""Blocks of the sandwich: what a form leaves goes with speed or torque, and so on for whole pieces of driving [s]."""
FORM_SHARE = 0.05
"""Nor narrower than this share of how far the parameter is from its effect's absence: by so much the forms that one
effect may have read the same parameter apart [-]."""
LEAST_SLOPE = 1e-6
"""Norm of the residuals' answer to a noticeable change below which there is none [standard deviations]."""
LEAST_HALF_WIDTH = 0.01
"""No interval is narrower than this share of a noticeable change to either side: grids and integrators differ [-]."""


def intervals(found: Fit, evidence: Evidence) -> list[tuple[float, float, float]]:
    """Estimates with 95 % intervals: a sandwich over blocks, which coloured residuals do not make too narrow.

    Returns
    -------
    list
        Value, low, high per parameter, within its bounds.

    References
    ----------
    .. [1] Liang, Zeger (1986), Biometrika 73, 13-22, for the estimator over clusters.
    """
    weight = robust_weight(found.z)
    jacobian = found.jacobian
    scale = found.candidate.scale
    scaled = jacobian * scale
    bread = _inverse(scaled, weight)
    meat = np.zeros_like(bread)
    for part, drive in zip(evidence.parts, evidence.drives, strict=True):
        channels = drive.measured.shape[1]
        length = drive.rows_in(SCORE_BLOCK_S) * channels
        for at in range(part.start, part.stop, length):
            cut = slice(at, min(at + length, part.stop))
            score = scaled[cut].T @ (weight[cut] * found.z[cut])
            meat += np.outer(score, score)
    sandwich = bread @ meat @ bread
    variance = np.maximum(np.diag(sandwich), np.diag(bread))
    half = np.hypot(NORMAL_95 * INTERVAL_FACTOR * np.sqrt(variance), LEAST_HALF_WIDTH) * scale
    half[_without_slope(scaled)] = np.inf
    half = np.hypot(half, FORM_SHARE * (found.x - found.candidate.neutral))
    half = np.hypot(half, found.candidate.open_share * found.x)
    low, high = found.candidate.bounds
    return [
        (float(x), float(max(x - h, a)), float(min(x + h, b)))
        for x, h, a, b in zip(found.x, half, low, high, strict=True)
    ]


def joint(entry: Entry, fit_to: Evidence) -> dict[tuple[str, str], Interval]:
    """Effect id and parameter to its interval."""
    triples = intervals(entry.fitted, fit_to)
    return {
        (key, p.name): Interval(*triple, unit=p.unit)
        for (key, p), triple in zip(entry.fitted.candidate.parameters, triples, strict=True)
    }


def is_excited(entry: Entry, stands: Entry) -> bool:
    """Whether the logs could have shown an effect: by its own slopes, and what the account that stands leaves.

    What it alone leaves would not do: a gap that is another's makes anything uncertain.
    """
    found = entry.fitted
    first = int(np.flatnonzero(np.isfinite(found.candidate.open_share))[0])
    scaled = found.jacobian * found.candidate.scale
    if _without_slope(scaled)[first]:
        return False
    weight = robust_weight(stands.z_fit)
    bread = _inverse(scaled, weight)
    left = max(stands.loss_fit / max(int(np.count_nonzero(stands.z_fit)), 1), 1.0)
    half = float(NORMAL_95 * INTERVAL_FACTOR * np.sqrt(bread[first, first] * left))
    off = float(abs(found.x[first] - found.candidate.neutral[first]) / found.candidate.scale[first])
    return half < EXCITED_SHARE or off > half


def _inverse(scaled: Array, weight: Array) -> Array:
    """Inverse of the information, parameters of unlike slopes brought to one size first."""
    size = np.maximum(np.sqrt((scaled**2).sum(axis=0)), LEAST_SLOPE)
    even = scaled / size
    return np.asarray(np.linalg.pinv(even.T @ (even * weight[:, None]), rcond=1e-10) / np.outer(size, size))


def _without_slope(scaled: Array) -> NDArray[np.bool_]:
    """Parameters whose noticeable changes the logs do not answer to at all."""
    return np.sqrt((scaled**2).sum(axis=0)) < LEAST_SLOPE
