"""Signals onto another time base, without delay, aliasing, or bridging of lost samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.contract import COLUMNS
from sim2real.logs.log import Log

Array = NDArray[np.float64]

DECIMATION = 1.5
"""From this ratio of the steps on a signal is averaged; below it is interpolated, which is all that jitter needs."""

BROKEN = 1.5
"""Samples further apart than this many steps have lost ones between them: jitter may move a sample by half a step."""

SLOWEST_S = 0.1
"""A signal whose samples come further apart than this is lost between them: a line no longer tells what it did [s]."""

SAME = 1e-6
"""Fraction of a step within which two times are the same: times in files are rounded."""


def resample(log: Log, step_s: float) -> tuple[Array, dict[str, Array]]:
    """The signals of a log on a uniform grid.

    Parameters
    ----------
    log : Log
        The log; its own rate may be jittered.
    step_s : float
        Step of the grid, which starts at the log's first row [s].

    Returns
    -------
    time_s, signals : array of shape (n,), dict of arrays of shape (n,)
        The grid [s] and every signal on it: where the grid is the coarser one the mean over a step that is centred on
        the grid's time, linear interpolation otherwise; classes and frame numbers hold their last value. A value that
        needs what is lost, or lies between rows that are missing, is NaN; of what comes faster than the grid, what is
        lost for less than a step of it is bridged.

    Raises
    ------
    ValueError
        The step is not positive or longer than the log.
    """
    start, end = float(log.time_s[0]), float(log.time_s[-1])
    if not 0.0 < step_s <= end - start:
        raise ValueError(
            f"step_s is {step_s:g}; expected more than 0 and at most the log's {end - start:g} s."
        )
    count = int((end - start) / step_s + SAME) + 1
    grid = start + step_s * np.arange(count, dtype=np.float64)
    return grid, {
        name: hold(log.time_s, values, grid) if COLUMNS[name].held else onto(log.time_s, values, grid, step_s)
        for name, values in log.signals.items()
    }


def median_step(time_s: Array) -> float:
    """Median distance of samples [s]; robust against gaps and jitter."""
    return float(np.median(np.diff(time_s)))


def hold(time_s: Array, values: Array, at_s: Array) -> Array:
    """The last value at or before each time; NaN before the first."""
    index = last_index(time_s, at_s)
    return np.where(index >= 0, values[np.maximum(index, 0)], np.nan)


def last_index(time_s: Array, at_s: Array) -> NDArray[np.intp]:
    """Index of the last sample at or before each time, -1 before the first."""
    slack = SAME * median_step(time_s) if len(time_s) > 1 else 0.0
    return np.searchsorted(time_s, at_s + slack, side="right") - 1


def onto(time_s: Array, values: Array, at_s: Array, step_s: float) -> Array:
    """A continuous signal at other times.

    Parameters
    ----------
    time_s, values : array, shape (n,)
        Its samples, times ascending [s].
    at_s : array, shape (k,)
        Where it is wanted [s].
    step_s : float
        Their distance: the signal is averaged over as much where it comes faster [s].

    Returns
    -------
    array, shape (k,)
        NaN outside the samples' times and wherever what is lost would be needed, see `resample`.
    """
    time_s, values = of_its_own(time_s, values)
    if len(time_s) < 2:
        return np.full(len(at_s), np.nan)
    own = median_step(time_s)
    point = _interpolate(time_s, values, at_s, own)
    if step_s < DECIMATION * own:
        return point
    # The mean of the line through the samples over a centred window: no delay at any ratio of the steps, jitter or not.
    # At both ends the window shrinks so that it stays centred.
    half = np.minimum(0.5 * step_s, np.minimum(at_s - time_s[0], time_s[-1] - at_s))
    inside = half > SAME * own
    low, high = at_s[inside] - half[inside], at_s[inside] + half[inside]
    mean = (_area(time_s, values, high) - _area(time_s, values, low)) / (high - low)
    # What is lost for less than a step of the grid is bridged, as it would be between samples of the grid's own rate.
    lost = _lost_time(time_s, values, max(BROKEN * own, step_s))
    mean[np.interp(high, time_s, lost) - np.interp(low, time_s, lost) > SAME * own] = np.nan
    point[inside] = mean
    return point


def of_its_own(time_s: Array, values: Array) -> tuple[Array, Array]:
    """A signal's own samples: one that comes slower than the log's rows has its own rate, and none lost between."""
    there = np.isfinite(values)
    if np.count_nonzero(there) < 2 or median_step(time_s[there]) > SLOWEST_S:
        return time_s, values
    return time_s[there], values[there]


def lost_share(values: Array, step_s: float) -> float:
    """Share of a signal's samples that are lost in the rows of a log with this step, at its own rate [-]."""
    rows = np.flatnonzero(np.isfinite(values))
    every = round(float(np.median(np.diff(rows)))) if len(rows) > 1 else 1
    if every * step_s > SLOWEST_S:
        every = 1
    return max(1.0 - len(rows) * every / len(values), 0.0)


def _interpolate(time_s: Array, values: Array, at_s: Array, own_s: float) -> Array:
    i = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2)
    step = time_s[i + 1] - time_s[i]
    share = (at_s - time_s[i]) / step
    slack = SAME * own_s / step
    line = values[i] + share * (values[i + 1] - values[i])
    line[(step > BROKEN * own_s) | (share < -slack) | (share > 1.0 + slack)] = np.nan
    line = np.where(np.abs(share) <= slack, values[i], line)
    return np.where(np.abs(share - 1.0) <= slack, values[i + 1], line)


def _area(time_s: Array, values: Array, at_s: Array) -> Array:
    """Integral of the line through the samples from the first one to each time; lost samples count as 0."""
    y = np.nan_to_num(values)
    before = np.concatenate(([0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(time_s))))
    i = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2)
    since = at_s - time_s[i]
    slope = (y[i + 1] - y[i]) / (time_s[i + 1] - time_s[i])
    return before[i] + since * (y[i] + 0.5 * slope * since)


def _lost_time(time_s: Array, values: Array, longest_s: float) -> Array:
    """Time up to each sample over which the signal is not known: its samples are further apart than this [s]."""
    step = np.diff(time_s)
    known = np.isfinite(values[1:]) & np.isfinite(values[:-1]) & (step <= longest_s * (1.0 + SAME))
    return np.concatenate(([0.0], np.cumsum(np.where(known, 0.0, step))))
