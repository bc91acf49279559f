"""Wrong frames per 100 and what the flag is worth, with 95 % intervals that know that neighbouring frames are alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trpac_core.vision.classes import Surface

from .judge import NO_ROAD

BLOCK = 20
"""Frames of a real drive that count as one observation: 2 s at 10 frames per second."""
LEAST_BLOCKS = 5
DRAWS = 2000
Z = 1.96


@dataclass(frozen=True)
class Share:
    """A share in per cent with its 95 % interval, of so many frames in so many blocks."""

    value: float
    low: float
    high: float
    frames: int
    blocks: int

    def __str__(self) -> str:
        if not self.frames:
            return "-"
        return f"{self.value:.1f} [{self.low:.1f}, {self.high:.1f}]"


def blocks_of(table: pd.DataFrame) -> NDArray[np.int64]:
    """Number of the block that each row's frame belongs to: a whole rendered drive, `BLOCK` frames of a real one."""
    real = table["part"].to_numpy() != ""
    part = np.where(real, table["frame"].to_numpy() // BLOCK, 0)
    codes, _ = pd.factorize(table["sequence"].astype(str) + "#" + part.astype(str))
    return codes.astype(np.int64)


def share(hit: NDArray[np.bool_], block: NDArray[np.int64], seed: int = 0) -> Share:
    """Share of hits [%] with a bootstrap over blocks.

    Where every frame is a hit, or none, or blocks are few, draws are alike and the bootstrap says nothing: there the
    interval is Wilson's with each block as one observation, which is wide on purpose.
    """
    if not len(hit):
        return Share(float("nan"), float("nan"), float("nan"), 0, 0)
    _, inverse = np.unique(block, return_inverse=True)
    hits, sizes = np.bincount(inverse, hit), np.bincount(inverse)
    value, n = float(hit.mean()), len(sizes)
    if value in (0.0, 1.0) or n < LEAST_BLOCKS:
        low, high = wilson(value, n)
    else:
        drawn = np.random.default_rng(seed).integers(0, n, (DRAWS, n))
        low, high = np.percentile(hits[drawn].sum(axis=1) / sizes[drawn].sum(axis=1), [2.5, 97.5])
    return Share(100.0 * value, 100.0 * float(low), 100.0 * float(high), len(hit), n)


def wilson(value: float, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share of n observations [-]."""
    centre, spread = value + Z * Z / (2 * n), Z * np.sqrt(value * (1 - value) / n + Z * Z / (4 * n * n))
    low, high = (centre - spread) / (1 + Z * Z / n), (centre + spread) / (1 + Z * Z / n)
    return max(0.0, float(low)), min(1.0, float(high))


def n_w(table: pd.DataFrame) -> Share:
    """Wrong frames per 100, flags not excluded."""
    return share((table["found"] != table["truth"]).to_numpy(), blocks_of(table))


def method_of(table: pd.DataFrame, method: str) -> pd.DataFrame:
    """The rows of one method."""
    return table[table["method"] == method]


def gate(table: pd.DataFrame) -> dict[str, Share]:
    """What the flag holds back of wrong and of right frames, and what is wrong among those that it lets through [%]."""
    wrong = (table["found"] != table["truth"]).to_numpy()
    down, block = ~table["flag"].to_numpy(np.bool_), blocks_of(table)
    return {
        "n_w, all frames": share(wrong, block),
        "n_w, flag 1": share(wrong[~down], block[~down]),
        "wrong frames with flag 0": share(down[wrong], block[wrong]),
        "right frames with flag 0": share(down[~wrong], block[~wrong]),
    }


def confusion(table: pd.DataFrame) -> NDArray[np.int64]:
    """Frames by true class (rows) and class found; the last column is votes without road."""
    counts = np.zeros((len(Surface), len(Surface) + 1), np.int64)
    np.add.at(counts, (table["truth"].to_numpy(np.int64), table["found"].to_numpy(np.int64)), 1)
    return counts


assert NO_ROAD == -1, "index -1 is the last column"


def recalls(table: pd.DataFrame) -> dict[str, Share]:
    """Share of each true class that is found [%]."""
    found = {}
    for surface in Surface:
        own = table[table["truth"] == int(surface)]
        found[surface.label] = share((own["found"] == own["truth"]).to_numpy(), blocks_of(own))
    return found
