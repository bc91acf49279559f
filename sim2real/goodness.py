"""How well an entry of the contest does by itself: its misfit, its worst moments, the memory of what it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.contest import Entry
from sim2real.drift import block_sums
from sim2real.drive import BLOCK_S, GROUPS
from sim2real.evidence import Evidence
from sim2real.fitting import robust

Array = NDArray[np.float64]

LONG_BLOCK_S = 1.0
"""Blocks over which the residuals' sums are taken to see how correlated they are [s]."""
GROSS = 8.0
"""A block's sum beyond this many standard deviations is no noise [-]."""


@dataclass(frozen=True)
class Fitness:
    """How well an entry does, absolutely.

    Attributes
    ----------
    misfit : float
        Root mean square over the signals of the blocks' means in units of what noise gives: 1 for the true model.
    signals : dict
        The same per signal.
    """

    misfit: float
    signals: dict[str, float]


def fitness(entry: Entry, fit_to: Evidence, holdout: Evidence) -> Fitness:
    """Absolute goodness of fit of an entry on all logs."""
    sums = _blocks(entry, fit_to, holdout)
    signals = {
        name: float(np.sqrt(np.mean(found**2)))
        for name, channels in GROUPS.items()
        if len(found := sums[:, channels][sums[:, channels] != 0.0])
    }
    return Fitness(float(np.sqrt(np.mean(np.square(list(signals.values()))))), signals)


def gross_share(entry: Entry, fit_to: Evidence, holdout: Evidence) -> float:
    """Share of the blocks in which some signal is far beyond noise [-]."""
    return float(np.mean((np.abs(_blocks(entry, fit_to, holdout)) > GROSS).any(axis=1)))


def _blocks(entry: Entry, fit_to: Evidence, holdout: Evidence) -> Array:
    """Sums over blocks of what an entry leaves on all logs, shape (blocks, 7), in units of what noise gives."""
    sums = []
    for z, evidence in ((entry.z_fit, fit_to), (entry.z_hold, holdout)):
        for part, drive, noise in zip(evidence.parts, evidence.drives, evidence.noises, strict=True):
            rows = z[part].reshape(-1, drive.measured.shape[1])
            sums.append(block_sums(rows, drive.rows_in(BLOCK_S)) / np.sqrt(1.0 + noise.slow))
    return np.concatenate(sums)


def inflation(entry: Entry, fit_to: Evidence, holdout: Evidence) -> float:
    """By how much the entry's residuals carry less information than white unit noise: their size times their memory."""
    losses, counts, sums = 0.0, 0, []
    for z, evidence in ((entry.z_fit, fit_to), (entry.z_hold, holdout)):
        losses += float(np.sum(robust(z)))
        counts += int(np.count_nonzero(z))
        for part, drive in zip(evidence.parts, evidence.drives, strict=True):
            rows = np.clip(z[part].reshape(-1, drive.measured.shape[1]), -5.0, 5.0)
            sums.append(block_sums(rows, drive.rows_in(LONG_BLOCK_S)).ravel())
    size = max(losses / max(counts, 1), 1.0)
    every = np.concatenate(sums)
    memory = max(float(np.mean(every[every != 0.0] ** 2)) / size, 1.0) if np.any(every) else 1.0
    return size * memory


def loss_beyond_noise(entry: Entry) -> float:
    """What an entry leaves of the loss beyond that of unit noise [-]."""
    return entry.loss - float(np.count_nonzero(entry.z_fit) + np.count_nonzero(entry.z_hold))
