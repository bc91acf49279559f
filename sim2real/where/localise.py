"""Where the gap lies: in which subsystem's equation, in which regime of driving, at what time.

The regimes are read off the drive. The subsystems come from the free terms of `sim2real.where.unknown`: each equation
of the car is given one in turn, and what its best term takes off the misfit is that subsystem's share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.observing.drive import GROUPS, SPEED, Drive
from sim2real.observing.noise import Noise
from sim2real.observing.observer import Prediction
from sim2real.result import Place

Array = NDArray[np.float64]

BLOCK_S = 0.2
"""Residuals are averaged over this time, so that noise counts little [s]."""
SURFACE_CHANGE_S = 0.5
"""Time after an axle came onto another surface that counts as the change [s]."""
DRIVE_NM = 15.0
"""Torque per wheel from which on the car drives or brakes, below it coasts [N m]."""
NEAR_LIMIT = 0.8
"""Used share of theta from which on a tyre is near its limit [-]."""
SLIDING = 0.2
"""Slip from which on a tyre is beyond its peak, whatever it still holds [-]."""
LOW_SPEED_M_S = 8.0
"""Border between low and high speed [m/s]."""
NOTABLE = 3.0
"""Block means count as gap from this many standard deviations on [-]."""
MOST_PLACES = 8
REGIMES = (
    "surface change",
    "near the limit",
    "drive, low speed",
    "drive, high speed",
    "brake",
    "coast",
    "standstill",
)


@dataclass(frozen=True)
class Blocks:
    """Block means of one drive.

    Attributes
    ----------
    from_s, to_s : array, shape (m,)
        The blocks' time windows [s].
    z : array, shape (m, 7)
        Mean residual per channel in standard deviations of the mean.
    regime : array of str, shape (m,)
        What was driven.
    """

    from_s: Array
    to_s: Array
    z: Array
    regime: NDArray[np.str_]


def regimes(drive: Drive, seen: Prediction) -> NDArray[np.str_]:
    """Regime of each row, shape (n,)."""
    torque = drive.torque_nm.mean(axis=1)
    fast = seen.states[:, SPEED] > LOW_SPEED_M_S
    out = np.where(
        torque > DRIVE_NM,
        np.where(fast, "drive, high speed", "drive, low speed"),
        np.where(torque < -DRIVE_NM, "brake", "coast"),
    ).astype("<U20")
    used = np.abs(seen.force_n) / np.maximum(seen.load_n * seen.theta, 1.0)
    out[((used > NEAR_LIMIT) | (seen.slip > SLIDING)).any(axis=1)] = "near the limit"
    changed = np.flatnonzero((np.diff(seen.theta, axis=0) != 0.0).any(axis=1))
    for k in changed:
        out[k : k + max(round(SURFACE_CHANGE_S / drive.step_s), 1)] = "surface change"
    out[~drive.moving] = "standstill"
    return out


def blocks(drive: Drive, noise: Noise, seen: Prediction, residuals: Array) -> Blocks:
    """Averages of a model's residuals."""
    length = drive.rows_in(BLOCK_S)
    count = len(drive) // length
    z = noise.whitened(residuals)[: count * length].reshape(count, length, -1)
    used = np.isfinite(z).sum(axis=1)
    means = np.nansum(z, axis=1) / np.sqrt(np.maximum(used, 1))
    regime = regimes(drive, seen)[: count * length].reshape(count, length)
    middle = regime[:, length // 2]
    begin = drive.time_s[: count * length : length]
    return Blocks(begin, begin + length * drive.step_s, means, middle)


def heat_map(found: Sequence[Blocks], shares: dict[str, float]) -> dict[str, dict[str, float]]:
    """Share of the gap per subsystem and regime: the subsystems' shares times the regimes' of the signals.

    Parameters
    ----------
    found : sequence of Blocks
        Of all drives.
    shares : dict
        Share of the gap that each subsystem's equation takes [-].
    """
    energy = {name: 0.0 for name in REGIMES if any((part.regime == name).any() for part in found)}
    for part in found:
        excess = np.maximum(part.z**2 - 1.0, 0.0).sum(axis=1)
        for name in energy:
            energy[name] += float(excess[part.regime == name].sum())
    total = max(sum(energy.values()), 1e-12)
    return {sub: {name: share * e / total for name, e in energy.items()} for sub, share in shares.items()}


def places(drive: Drive, part: Blocks, without: Mapping[str, Blocks]) -> tuple[Place, ...]:
    """Windows in which a signal is off, those with the most of the gap first.

    Parameters
    ----------
    drive, part : Drive, Blocks
        The drive, and what the model as it is leaves of it.
    without : mapping
        Subsystem to what the verdict leaves of the drive without its effect there: a window is of the one that is
        missed most. One subsystem alone has them all.
    """
    excess = np.maximum(part.z**2 - 1.0, 0.0)
    missed = {subsystem: np.maximum(left.z**2 - 1.0, 0.0) for subsystem, left in without.items()}
    total = max(float(excess.sum()), 1e-12)
    out = []
    for name, channels in GROUPS.items():
        if name == "position":
            continue
        per_block = excess[:, channels].sum(axis=1)
        off = np.abs(part.z[:, channels]).max(axis=1) > NOTABLE
        for begin, end in _runs(off, part.regime):
            share = float(per_block[begin:end].sum() / total)
            window = (slice(begin, end), channels)
            out.append(
                Place(
                    name,
                    max(missed, key=lambda subsystem: float(missed[subsystem][window].sum())),
                    str(part.regime[begin]),
                    round(float(part.from_s[begin]), 3),
                    round(float(part.to_s[end - 1]), 3),
                    round(share, 4),
                    drive.name,
                )
            )
    return tuple(sorted(out, key=lambda p: -p.share)[:MOST_PLACES])


def _runs(off: NDArray[np.bool_], regime: NDArray[np.str_]) -> list[tuple[int, int]]:
    """Stretches of blocks that are off in one regime; a single good block does not end one."""
    runs: list[tuple[int, int]] = []
    for k in np.flatnonzero(off):
        if runs and k - runs[-1][1] <= 1 and regime[k] == regime[runs[-1][0]]:
            runs[-1] = (runs[-1][0], int(k) + 1)
        else:
            runs.append((int(k), int(k) + 1))
    return runs


def equation_shares(terms: Sequence[tuple[str, float]]) -> dict[str, float]:
    """Share of each subsystem from the loss that its best free term takes away [-].

    Parameters
    ----------
    terms : sequence of (str, float)
        Subsystem and loss taken, one or more per subsystem.
    """
    best: dict[str, float] = {}
    for subsystem, taken in terms:
        best[subsystem] = max(best.get(subsystem, 0.0), taken)
    top = max(best.values(), default=0.0)
    if top <= 0.0:
        return {}
    # what the best term leaves to another is what the other explains beyond chance; sharpened, since terms overlap
    weight = {key: (value / top) ** 4 for key, value in best.items()}
    total = sum(weight.values())
    return {key: value / total for key, value in weight.items()}
