"""How well an entry of the contest does by itself: its misfit, its worst moments, the memory of what it leaves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.hypotheses.contest import Entry
from sim2real.observing.drift import block_sums
from sim2real.observing.drive import BLOCK_S, GROUPS, WHEEL, Drive
from sim2real.observing.evidence import Evidence
from sim2real.observing.noise import Noise

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
    """Share of the blocks in which some signal is far beyond noise [-].

    Wheel speeds that a counter rounds are left out: at a flank it is off by whole teeth, however small the noise.
    """
    far = []
    for sums, drive in _sums(entry, fit_to, holdout):
        gross = np.abs(sums) > GROSS
        if drive.lattice is not None:
            gross[:, WHEEL] = False
        far.append(gross.any(axis=1))
    return float(np.mean(np.concatenate(far)))


def _blocks(entry: Entry, fit_to: Evidence, holdout: Evidence) -> Array:
    """Sums over blocks of what an entry leaves on all logs, shape (blocks, 7), in units of what noise gives."""
    return np.concatenate([sums for sums, _ in _sums(entry, fit_to, holdout)])


def _sums(entry: Entry, fit_to: Evidence, holdout: Evidence) -> Iterator[tuple[Array, Drive]]:
    """The same log by log, each with its drive."""
    for rows, drive, noise in _logs(entry, fit_to, holdout):
        yield block_sums(rows, drive.rows_in(BLOCK_S)) / np.sqrt(1.0 + noise.slow), drive


def _logs(entry: Entry, fit_to: Evidence, holdout: Evidence) -> Iterator[tuple[Array, Drive, Noise]]:
    """Whitened residuals of each log, shape (n, 7), with its drive and noise."""
    for z, evidence in ((entry.z_fit, fit_to), (entry.z_hold, holdout)):
        for part, drive, noise in zip(evidence.parts, evidence.drives, evidence.noises, strict=True):
            yield z[part].reshape(-1, drive.measured.shape[1]), drive, noise


def inflation(entry: Entry, fit_to: Evidence, holdout: Evidence) -> float:
    """By how much the entry's residuals carry less information than white unit noise: their size times their memory."""
    every = np.concatenate(
        [
            block_sums(np.clip(rows, -5.0, 5.0), drive.rows_in(LONG_BLOCK_S)).ravel()
            for rows, drive, _ in _logs(entry, fit_to, holdout)
        ]
    )
    size = max(entry.loss / max(_count(entry), 1), 1.0)
    memory = max(float(np.mean(every[every != 0.0] ** 2)) / size, 1.0) if np.any(every) else 1.0
    return size * memory


def loss_beyond_noise(entry: Entry) -> float:
    """What an entry leaves of the loss beyond that of unit noise [-]."""
    return entry.loss - _count(entry)


def _count(entry: Entry) -> int:
    """Residuals that count."""
    return int(np.count_nonzero(entry.z_fit) + np.count_nonzero(entry.z_hold))
