"""Scores of the surface classifier by picture and by source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.networks import calibrated_probabilities

from .patches import PatchSet

Z_95 = 1.959964
"""Two-sided 95 % quantile of the normal distribution [-]."""


@dataclass(frozen=True)
class ClassScore:
    """Confusion of pictures or patches: rows are the true class, columns the one found."""

    confusion: NDArray[np.int64]

    @classmethod
    def of(cls, true: NDArray[np.int64], found: NDArray[np.int64]) -> ClassScore:
        """From class indices."""
        counts = np.zeros((3, 3), np.int64)
        np.add.at(counts, (true, found), 1)
        return cls(counts)

    @property
    def count(self) -> int:
        """Judged items."""
        return int(self.confusion.sum())

    @property
    def right(self) -> int:
        """Items classified right."""
        return int(np.trace(self.confusion))

    @property
    def accuracy(self) -> float:
        """Share classified right [-]; NaN without items."""
        return self.right / self.count if self.count else float("nan")

    def recall(self, label: int) -> float:
        """Share of a class that is found [-]; NaN without items of it."""
        row = self.confusion[label]
        return float(row[label] / row.sum()) if row.sum() else float("nan")


def wilson_interval(right: int, count: int) -> tuple[float, float]:
    """95 % interval of a share by Wilson's formula (1927) [-]; (0, 1) without items."""
    if not count:
        return 0.0, 1.0
    share = right / count
    centre = share + Z_95**2 / (2 * count)
    spread = Z_95 * np.sqrt(share * (1 - share) / count + Z_95**2 / (4 * count**2))
    scale = 1 + Z_95**2 / count
    return float(max(0.0, (centre - spread) / scale)), float(min(1.0, (centre + spread) / scale))


def by_patch(logits: NDArray[np.float64], patches: PatchSet) -> ClassScore:
    """Confusion over single patches."""
    return ClassScore.of(patches.labels, logits.argmax(axis=1))


def by_picture(logits: NDArray[np.float64], patches: PatchSet, temperature: float) -> ClassScore:
    """Confusion over pictures."""
    return ClassScore.of(*picture_verdicts(logits, patches, temperature))


def picture_verdicts(
    logits: NDArray[np.float64], patches: PatchSet, temperature: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """True class of each picture, and the one found: of the largest mean log probability of its patches."""
    logs = np.log(np.maximum(calibrated_probabilities(logits, temperature), 1e-12))
    numbers, first, index = np.unique(patches.pictures, return_index=True, return_inverse=True)
    summed = np.zeros((len(numbers), logits.shape[1]))
    np.add.at(summed, index, logs)
    return patches.labels[first], summed.argmax(axis=1)
