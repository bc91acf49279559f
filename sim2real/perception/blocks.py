"""The camera's confidence, averaged over blocks of a second of one class: neighbouring pictures show the same road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.effects.exposure_shift import TOLERATED_STOPS
from scenarios.effects.motion_blur import TOLERATED_SMEAR_M
from sim2real.perception.frames import Results

Array = NDArray[np.float64]

BLOCK_S = 1.0
LEAST_CONFIDENCE = 0.01
"""A confidence below it counts as this much: its logarithm would run away [-]."""


@dataclass(frozen=True)
class Blocks:
    """Confidence in blocks of a second and a class.

    Attributes
    ----------
    log : array of str, shape (n,)
        Where.
    time_s, speed_m_s, accel_m_s2 : array, shape (n,)
        Mean time and speed, and how the speed changes meanwhile [s], [m/s], [m/s²].
    loss : array, shape (n,)
        Minus the mean logarithm of Q_v [-].
    classes : array of int, shape (n,)
        Class.
    """

    log: NDArray[np.str_]
    time_s: Array
    speed_m_s: Array
    accel_m_s2: Array
    loss: Array
    classes: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.time_s)

    def less(self, exposure_s: float, stops: float) -> Blocks:
        """The blocks without the loss that the simulation models already."""
        modelled = self.speed_m_s * exposure_s / TOLERATED_SMEAR_M + (stops / TOLERATED_STOPS) ** 2
        return replace(self, loss=self.loss - modelled)

    def raised(self, by: float) -> Blocks:
        """The blocks with a confidence whose logarithm is more by so much."""
        return replace(self, loss=self.loss - by)


def make_blocks(results: Sequence[Results]) -> Blocks:
    """Blocks of the results of some drives."""
    parts = [pd.DataFrame(columns=["log", "time_s", "speed", "accel", "loss", "class"]).astype({"log": str})]
    for one in results:
        table = pd.DataFrame(
            {
                "block": np.floor((one.time_s - one.time_s[0]) / BLOCK_S),
                "class": one.classes,
                "time_s": one.time_s,
                "speed": one.speed_m_s,
                "loss": -np.log(np.maximum(one.confidence, LEAST_CONFIDENCE)),
            }
        ).dropna()
        if table.empty:
            continue
        # a block's lone pictures of another class are mistakes, and borders
        main = table.groupby("block")["class"].transform(lambda c: c.mode().iloc[0])
        grouped = table[table["class"] == main].groupby("block")
        accel = grouped[["time_s", "speed"]].apply(_slope)
        parts.append(grouped.mean().assign(accel=accel, log=one.log))
    every = pd.concat([p for p in parts if len(p)] or parts, ignore_index=True)
    numbers = every[["time_s", "speed", "accel", "loss"]].to_numpy(dtype=np.float64)
    names, classes = every["log"].to_numpy().astype(np.str_), every["class"].to_numpy().astype(np.intp)
    return Blocks(names, numbers[:, 0], numbers[:, 1], numbers[:, 2], numbers[:, 3], classes)


def _slope(rows: pd.DataFrame) -> float:
    """By which the speed changes; 0 where one result does not tell [m/s²]."""
    columns = rows.to_numpy(dtype=np.float64)
    time_s, speed = columns[:, 0] - columns[:, 0].mean(), columns[:, 1]
    square = float(time_s @ time_s)
    return float(time_s @ speed) / square if square > 0.0 else 0.0
