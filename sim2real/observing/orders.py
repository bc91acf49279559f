"""What repeats with each turn of a wheel: tyres out of round, tone wheels off centre, torque that ripples.

Over time such an oscillation has no fixed frequency and looks like noise. Over the wheel's angle it is a line in the
spectrum: an order, a number of oscillations per turn. No effect of the library has one. Electrical interference is a
line over time and remains noise.

References
----------
.. [1] Fyfe, Munck (1997), Mechanical Systems and Signal Processing 11, 187-205: order tracking by resampling over the
   shaft's angle.
.. [2] Welch (1967), IEEE Transactions on Audio and Electroacoustics 15, 70-73: averaging over overlapping windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sim2real.observing.drive import ACCEL, CHANNELS, WHEEL, Drive
from sim2real.observing.noise import Noise
from sim2real.result import Unexplained

Array = NDArray[np.float64]

TURNS = 8
"""Turns in a window: orders an eighth apart are told from each other."""
PER_TURN = 32
"""Samples per turn on the grid of angles."""
ZOOM = 2
"""Places per resolved order at which the spectrum is read."""
ORDERS = (0.75, 14.0)
BESIDE = (0.375, 1.25)
"""Distance of the orders on either side that a line has to stand out from [-]."""
LEAST_RATIO = 6.0
"""How far the line's power stands above both sides, in every log; logs without such a swing reach 9 in one of three
and 1.5 in all of them [-]."""
FEWEST_WINDOWS = 6
RESOLVED = 2.2
"""Samples of the log per swing."""
FULL = 0.9
"""Share of a window's samples that have to be there [-]."""
LEAST_SHARE = 0.5
"""A swing counts from this many standard deviations of a channel's noise on: what is less is no gap [-]."""
FOLLOWS_TORQUE = 0.5
"""Correlation of the swing's size with the torque's from which on it is the torque that swings [-]."""
CURVE = 24
"""Places of a swing at which its mean curve is told."""


@dataclass(frozen=True)
class Order:
    """A swing that repeats with the wheels' angle.

    Attributes
    ----------
    per_turn : float
        Swings per turn of a wheel [-].
    ratio : float
        Its power over that of the orders beside it, least of the logs [-].
    by_torque : float
        Correlation of its size in the wheel speeds with the torque's [-].
    moves_car : bool
        Whether the acceleration swings with it.
    """

    per_turn: float
    ratio: float
    by_torque: float
    moves_car: bool

    @property
    def subsystem(self) -> str:
        """Whose equation lacks it: a swing of the torque grows with it, one of a sensor alone does not move the car."""
        if self.by_torque > FOLLOWS_TORQUE:
            return "powertrain"
        return "wheel" if self.moves_car else "wheel_speed_sensor"


def read_order(drives: Sequence[Drive], rests: Sequence[Array]) -> Order | None:
    """The order that stands out most in all logs, or None.

    Parameters
    ----------
    drives : sequence of Drive
        The logs.
    rests : sequence of arrays, shape (n, 7)
        What the model leaves of each; NaN where nothing counts.
    """
    logs = list(zip(drives, rests, strict=True))
    ratios = _in_all(logs, WHEEL)
    best = int(np.argmax(ratios))
    if ratios[best] < max(LEAST_RATIO, _over_time(logs)):
        return None
    per_turn = float(_orders()[best])
    moves_car = bool(_in_all(logs, slice(ACCEL, ACCEL + 1))[best] >= LEAST_RATIO)
    return Order(per_turn, float(ratios[best]), _by_torque(logs, best), moves_car)


def _in_all(logs: Sequence[tuple[Drive, Array]], channels: slice) -> Array:
    """How far each order stands out in the log where it does least, 0 where a log cannot tell [-]."""
    found = [_ratios(_spectrum(drive, rest, channels)) for drive, rest in logs]
    return np.asarray(np.nan_to_num(np.min(found, axis=0)))


def _over_time(logs: Sequence[tuple[Drive, Array]]) -> float:
    """How far a line over time stands out in the log where it does least; each has its own scale of orders [-]."""
    found = [_ratios(_spectrum(drive, rest, WHEEL, by_time=True)) for drive, rest in logs]
    return min(float(np.nan_to_num(ratios).max()) for ratios in found)


def without_swing(drive: Drive, rest: Array, order: Order) -> Drive:
    """The log without what swings at the order in what a model leaves of it; `Drive.swing` keeps that."""
    part = np.column_stack([_part(drive, rest[:, i], i, order.per_turn) for i in range(len(CHANNELS))])
    return replace(drive, measured=drive.measured - part, swing=part)


def counts(drives: Sequence[Drive], noises: Sequence[Noise]) -> bool:
    """Whether the swing is large enough beside the noise of the wheels or the acceleration to be a gap."""
    shares = []
    for drive, noise in zip(drives, noises, strict=True):
        assert drive.swing is not None
        shares.append(np.sqrt(np.mean(drive.swing[drive.moving] ** 2, axis=0)) / noise.sigma)
    return bool(np.mean(shares, axis=0)[WHEEL.start :].max() >= LEAST_SHARE)


def characterise(order: Order, drives: Sequence[Drive], share: float) -> Unexplained:
    """The swing in the form of a result: the mean curve over the wheel's angle in one swing [rad].

    Parameters
    ----------
    order : Order
        What was found.
    drives : sequence of Drive
        Logs with their `swing`.
    share : float
        What of the misfit it takes [-].
    """
    sizes = np.mean([np.mean(d.swing[:, WHEEL] ** 2, axis=0) for d in drives if d.swing is not None], axis=0)
    wheel = WHEEL.start + int(np.argmax(sizes))
    longest = max(drives, key=len)
    assert longest.swing is not None
    turn = (order.per_turn * _turns(longest, wheel)) % 1.0
    place = np.minimum((turn * CURVE).astype(int), CURVE - 1)
    count = np.maximum(np.bincount(place, minlength=CURVE), 1)
    curve = np.bincount(place, weights=longest.swing[:, wheel], minlength=CURVE) / count
    grows = "grows with the torque" if order.subsystem == "powertrain" else "does not depend on the torque"
    moves = "also moves the car" if order.moves_car else "is in the sensors only"
    size = np.sqrt(2.0 * sizes.max())
    often = "once" if order.per_turn == 1.0 else f"{order.per_turn:.4g} times"
    sentence = (
        f"The wheel speed oscillates {often} per turn of the wheel, with an amplitude of {size:.3g} rad/s; the "
        f"oscillation {grows} and {moves}. It explains {100.0 * share:.0f} % of the misfit: check the "
        f"{order.subsystem.replace('_', ' ')}."
    )
    at = (np.arange(CURVE) + 0.5) / CURVE * 2.0 * np.pi / order.per_turn
    shape = f"repeats {often} per turn"
    return Unexplained(
        order.subsystem,
        "wheel_speed",
        "wheel angle",
        "rad/s",
        "changes sign",
        shape,
        share,
        at,
        curve,
        sentence,
    )


def _orders() -> Array:
    """Orders at which a spectrum is read [-]."""
    return np.fft.rfftfreq(TURNS * PER_TURN * ZOOM, 1.0 / PER_TURN).astype(np.float64)


def _turns(drive: Drive, channel: int) -> Array:
    """Turns that the wheel of a channel has made; those of the front left one for the car's own channels."""
    speed = drive.measured[:, channel if WHEEL.start <= channel < WHEEL.stop else WHEEL.start]
    seen = np.isfinite(speed)
    filled = np.interp(drive.time_s, drive.time_s[seen], speed[seen]) if seen.any() else np.zeros(len(drive))
    return np.asarray(np.cumsum(np.maximum(filled, 1e-6)) * drive.step_s / (2.0 * np.pi))


def _windows(
    drive: Drive, rest: Array, channel: int, by_time: bool = False
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Windows over a wheel's angle: residuals there (m, samples), highest order that each resolves, their rows.

    `by_time` takes the angle of a wheel that turns evenly, the same for all.
    """
    turns, used = _turns(drive, WHEEL.start if by_time else channel), np.isfinite(rest[:, channel])
    if by_time:
        turns = np.linspace(turns[0], turns[-1], len(turns))
    rows_used = np.flatnonzero(used)
    if not len(rows_used):
        return np.empty((0, TURNS * PER_TURN)), np.empty(0), np.empty((0, TURNS * PER_TURN), dtype=np.int64)
    values = np.interp(np.arange(len(drive)), rows_used, rest[used, channel])
    begins = np.arange(0.0, max(turns[-1] - TURNS, 0.0), TURNS / 2.0)
    places = begins[:, None] + np.arange(TURNS * PER_TURN) / PER_TURN
    rows = np.clip(np.searchsorted(turns, places), 0, len(drive) - 1)
    whole = used[rows].mean(axis=1) >= FULL
    per_turn = TURNS / np.maximum((rows[:, -1] - rows[:, 0]).astype(np.float64), 1.0)
    return np.interp(places, turns, values)[whole], (1.0 / (RESOLVED * per_turn))[whole], rows[whole]


def _spectrum(drive: Drive, rest: Array, channels: slice, by_time: bool = False) -> Array:
    """Mean power over the angle of each channel's wheel, NaN at orders that too few windows resolve."""
    sums, count = np.zeros(len(_orders())), np.zeros(len(_orders()))
    for channel in range(channels.start, channels.stop):
        values, highest, _ = _windows(drive, rest, channel, by_time)
        if not len(values):
            continue
        power = np.abs(_transformed(values)) ** 2
        resolved = _orders()[None, :] <= highest[:, None]
        sums += np.where(resolved, power, 0.0).sum(axis=0)
        count += resolved.sum(axis=0)
    enough = count >= FEWEST_WINDOWS * (channels.stop - channels.start)
    return np.where(enough, sums / np.maximum(count, 1.0), np.nan)


def _transformed(values: Array) -> NDArray[np.complex128]:
    """Spectra of windows without their slow course, shape (m, orders)."""
    x = np.linspace(-1.0, 1.0, values.shape[1])
    basis = np.linalg.qr(np.vander(x, 4))[0]
    level = values - (values @ basis) @ basis.T
    return np.asarray(np.fft.rfft(level * np.hanning(values.shape[1]), n=ZOOM * values.shape[1], axis=1))


def _ratios(power: Array) -> Array:
    """Power of each order over the larger one of its two sides' medians [-]."""
    orders = _orders()
    apart = np.abs(orders[:, None] - orders[None, :])
    near = (apart > BESIDE[0]) & (apart < BESIDE[1]) & np.isfinite(power)[None, :] & (orders >= 0.25)[None, :]
    out = np.full(len(orders), np.nan)
    for i in np.flatnonzero(np.isfinite(power) & (orders >= ORDERS[0]) & (orders <= ORDERS[1])):
        sides = [power[near[i] & (orders < orders[i])], power[near[i] & (orders > orders[i])]]
        found = [float(np.median(side)) for side in sides if len(side) > 1]
        if found and max(found) > 0.0:
            out[i] = power[i] / max(found)
    return out


def _by_torque(logs: Sequence[tuple[Drive, Array]], at: int) -> float:
    """Correlation, over windows, of an order's size in the wheel speeds with that of the torque [-]."""
    size, torque = [], []
    for drive, rest in logs:
        for channel in range(WHEEL.start, WHEEL.stop):
            values, _, rows = _windows(drive, rest, channel)
            size.append(np.abs(_transformed(values)[:, at]))
            torque.append(np.abs(drive.torque_nm[:, channel - WHEEL.start])[rows].mean(axis=1))
    a, b = np.concatenate(size), np.concatenate(torque)
    return float(np.corrcoef(a, b)[0, 1]) if a.std() > 0.0 and b.std() > 0.0 else 0.0


def _part(drive: Drive, rest: Array, channel: int, per_turn: float) -> Array:
    """What of a residual swings at the order, its size and phase those of a turn or two around; 0 where none counts."""
    used = np.isfinite(rest)
    if not used.any() or channel < WHEEL.start:
        return np.zeros(len(rest))
    turns = _turns(drive, channel)
    wave = np.exp(2j * np.pi * per_turn * turns)
    level = np.where(used, rest, 0.0)
    span = _rows_per(turns)
    level = level - _mean(level, used, span)
    mean = _mean(level * wave.conj(), used, span)
    return np.asarray(np.where(used, 2.0 * (mean * wave).real, 0.0))


def _rows_per(turns: Array) -> int:
    """Rows of two turns at the log's usual speed, an odd number."""
    per_row = float(np.median(np.diff(turns)))
    return 2 * max(round(1.0 / max(per_row, 1e-9)), 1) + 1 if per_row > 1e-6 else len(turns) // 2 * 2 + 1


def _mean(values: NDArray, used: NDArray[np.bool_], span: int) -> NDArray:
    """Running mean over the rows that count."""
    weight = np.maximum(uniform_filter1d(used.astype(np.float64), span), 1e-9)
    kept = np.where(used, values, 0.0)
    if np.iscomplexobj(kept):
        return (uniform_filter1d(kept.real, span) + 1j * uniform_filter1d(kept.imag, span)) / weight
    return uniform_filter1d(kept, span) / weight
