"""Shares with their intervals, and how far probabilities can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Z_95 = 1.959964


def wilson(hits: int, n: int) -> tuple[float, float]:
    """95 % score interval of a share (Wilson 1927, J. Am. Stat. Assoc. 22, 209); nothing known for n = 0."""
    if n == 0:
        return 0.0, 1.0
    share, z2 = hits / n, Z_95**2
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = Z_95 / (1 + z2 / n) * np.sqrt(share * (1 - share) / n + z2 / (4 * n**2))
    return float(max(centre - half, 0.0)), float(min(centre + half, 1.0))


@dataclass(frozen=True)
class Bin:
    """Cases whose answer had about this probability: their number, mean probability and share that was right."""

    low: float
    high: float
    n: int
    believed: float
    right: float


def reliability(believed: Sequence[float], right: Sequence[bool], bins: int = 10) -> list[Bin]:
    """Cases in equal bins of probability, empty ones left out."""
    p, hit = np.asarray(believed, dtype=float), np.asarray(right, dtype=float)
    place = np.clip((p * bins).astype(int), 0, bins - 1)
    return [
        Bin(k / bins, (k + 1) / bins, int(inside.sum()), float(p[inside].mean()), float(hit[inside].mean()))
        for k in range(bins)
        if (inside := place == k).any()
    ]


def calibration_error(bins: Sequence[Bin]) -> float:
    """Expected calibration error: mean distance of believed and right over the cases (Guo et al. 2017, Eq. 3)."""
    n = sum(b.n for b in bins)
    return float("nan") if n == 0 else sum(b.n * abs(b.believed - b.right) for b in bins) / n
