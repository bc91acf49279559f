"""Loggers: what becomes of values, rows and stamps on their way into the file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

DECIMALS = {"torque": 1, "wheel_speed": 2, "vehicle_speed": 2, "accel": 2, "position": 2}
"""Of a tool that writes tables."""
REPEATED, RUN_ROWS, RUNS = 0.005, (3, 12), 12
"""Share of samples that a late row repeats; rows of a run of lost ones, and how many runs a log has."""
MEASURED = ("wheel_speed", "vehicle_speed", "accel")
BUS_STEPS = {
    "torque": 0.5,
    "wheel_speed": 1 / 32,
    "vehicle_speed": 1 / 64,
    "accel": 1 / 32,
    "position": 1 / 32,
}
"""Of signals on a vehicle's bus, each below the noise of a production car's sensor [N m, rad/s, m/s, m/s^2, m]."""
STEPS_DOWN = {
    "torque": 0.05,
    "wheel_speed": 1 / 128,
    "vehicle_speed": 1 / 256,
    "accel": 1 / 128,
    "position": 1 / 200,
}
"""Of a bus that drops what is below a step; half a step is at most a fifth of the best sensor's noise."""
UNITS = {
    "torque": 0.1,
    "wheel_speed": 0.1 * 2.0 * np.pi / 60.0,
    "vehicle_speed": 0.01 / 3.6,
    "accel": 0.001 * 9.80665,
    "position": 0.01,
}
"""Last digits of a log in rpm, km/h and g, in this one's units."""
OVERRUNS, OVERRUN_S = 4, (0.02, 0.15)
"""How often a logger cannot keep up, and how long."""
CONVERTER_STEPS = {
    "torque": 4000.0 / 2**14,
    "wheel_speed": 250.0 / 2**14,
    "vehicle_speed": 80.0 / 2**14,
    "accel": 60.0 / 2**14,
}
"""Of a converter with 14 bits; half a step is at most four tenths of the best sensor's noise."""
CHANGES = {"wheel_speed": 0.01, "vehicle_speed": 0.005, "accel": 0.015, "position": 0.005}
"""Less than which a recorder does not write anew: half of the best sensor's noise."""
TICK_S = 1e-4
"""Of a logger's clock."""
FRAME_LOST = 0.004
"""Messages on the bus, each with its readings; share of them that is lost."""
WAKES_S = (0.1, 1.2)
"""Senders that are awake only a while after the logger is."""
GAPS, GAP_ROWS = 12, (2, 9)
"""How often a log has lost a few rows of a signal, and how many, before a tool has filled them in."""
BEFORE_S = (2.0, 9.0)
"""What a triggered recorder keeps of the time before its trigger, which is its zero."""
CLOCK_OFF = 2e-4
"""By which a logger's clock may be fast or slow, over the true time."""
DIGITS_KEPT = {"torque": 4, "wheel_speed": 4, "vehicle_speed": 4, "accel": 3, "position": 5}
"""Of a log that keeps so many figures."""


Logger = Callable[[pd.DataFrame], pd.DataFrame]


def stepped(steps: dict[str, float], whole: Callable[[Any], Any] = np.round) -> Logger:
    """Values in steps, by what their names hold; `whole` makes whole steps of them."""

    def log_in_steps(log: pd.DataFrame) -> pd.DataFrame:
        own = {str(c): step for c in log for name, step in steps.items() if name in str(c)}
        return log.assign(**{column: whole(log[column] / step) * step for column, step in own.items()})

    return log_in_steps


def every_second(*names: str) -> Logger:
    """Columns whose names begin so in every second row; the log has no value between."""

    def thin(log: pd.DataFrame) -> pd.DataFrame:
        between = np.arange(len(log)) % 2 != 0
        return log.assign(**{str(c): log[c].mask(between) for c in log if str(c).startswith(names)})

    return thin


def decimals(log: pd.DataFrame) -> pd.DataFrame:
    """Values with few decimals."""
    return log.round({str(c): n for c in log for name, n in DECIMALS.items() if name in str(c)})


def _measured(log: pd.DataFrame) -> list[str]:
    return [str(c) for c in log if str(c).startswith(MEASURED)]


def repeating(log: pd.DataFrame) -> pd.DataFrame:
    """A lost sample is the one before; now and then another is too."""
    columns = _measured(log)
    late = np.random.default_rng(len(log)).random((len(log), len(columns))) < REPEATED
    return log.assign(**log[columns].mask(late).ffill().bfill())


def losing_runs(log: pd.DataFrame) -> pd.DataFrame:
    """A signal at a time is lost for a few rows on end."""
    rng, columns, kept = np.random.default_rng(len(log)), _measured(log), log.copy()
    for start in rng.integers(0, len(log), RUNS):
        rows = slice(int(start), int(start + rng.integers(*RUN_ROWS)))
        kept.loc[kept.index[rows], rng.choice(columns)] = np.nan
    return kept


def overrunning(log: pd.DataFrame) -> pd.DataFrame:
    """Now and then all that is measured is lost at once, for some hundredths of a second."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    measured, clock = _measured(log), log["time_s"].to_numpy()
    for start in rng.choice(clock, OVERRUNS):
        kept.loc[(clock >= start) & (clock < start + rng.uniform(*OVERRUN_S)), measured] = np.nan
    return kept


def on_change(log: pd.DataFrame) -> pd.DataFrame:
    """Values that stand until they have changed by as much as `CHANGES`."""
    steps = {str(c): least for c in log for name, least in CHANGES.items() if str(c).startswith(name)}
    return log.assign(**{c: _standing(log[c].to_numpy(), least) for c, least in steps.items()})


def _standing(values: Array, least: float) -> Array:
    kept, last = values.copy(), np.inf
    for i, value in enumerate(values.tolist()):
        if abs(value - last) >= least:
            last = value
        elif value == value:
            kept[i] = last
    return kept


def in_ticks(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped by a clock with coarse ticks."""
    return log.assign(time_s=np.round(np.round(log["time_s"] / TICK_S) * TICK_S, 7))


def significant_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values with as many figures as `DIGITS_KEPT`."""
    kept = {str(c): n for c in log for name, n in DIGITS_KEPT.items() if name in str(c)}
    return log.assign(**{c: _figures(log[c].to_numpy(), n) for c, n in kept.items()})


def _figures(values: Array, digits: int) -> Array:
    size = np.where(np.isfinite(values) & (values != 0.0), np.abs(values), 1.0)
    step = 10.0 ** (np.floor(np.log10(size)) - digits + 1)
    return np.asarray(np.round(values / step) * step)


def losing_frames(log: pd.DataFrame) -> pd.DataFrame:
    """Now and then a message is lost, with all readings that it carries."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    for frame in MEASURED:
        columns = [str(c) for c in log if str(c).startswith(frame)]
        kept.loc[rng.random(len(log)) < FRAME_LOST, columns] = np.nan
    return kept


def waking(log: pd.DataFrame) -> pd.DataFrame:
    """What a sender measures is not there until it is awake."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    clock = log["time_s"].to_numpy()
    for sender in MEASURED:
        columns = [str(c) for c in log if str(c).startswith(sender)]
        kept.loc[clock < clock[0] + rng.uniform(*WAKES_S), columns] = np.nan
    return kept


def filled_in(log: pd.DataFrame) -> pd.DataFrame:
    """What was lost, and now and then a few rows of a signal on end, is a straight line."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    measured = _measured(log)
    for start in rng.integers(1, len(log), GAPS):
        kept.loc[kept.index[start : start + rng.integers(*GAP_ROWS)], rng.choice(measured)] = np.nan
    lines = kept.set_index("time_s")[measured].interpolate(method="index", limit_direction="both")
    return kept.assign(**{column: lines[column].to_numpy() for column in measured})


def triggered(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped from a trigger on, some of them before it."""
    before = np.round(np.random.default_rng(len(log)).uniform(*BEFORE_S), 3)
    return log.assign(time_s=np.round(log["time_s"] - before, 7))


def own_clock(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped by a clock that is a little fast or slow."""
    rate = 1.0 + np.random.default_rng(len(log)).uniform(-CLOCK_OFF, CLOCK_OFF)
    return log.assign(time_s=np.round(rate * log["time_s"], 7))


DIGITS: dict[str, Logger] = {
    "all": lambda log: log,
    "bus": stepped(BUS_STEPS),
    "decimals": decimals,
    "repeating": repeating,
    "losing_runs": losing_runs,
    "truncating": stepped(STEPS_DOWN, np.floor),
    "converted": stepped(UNITS),
    "overrunning": overrunning,
    "converted_in_bits": stepped(CONVERTER_STEPS),
    "on_change": on_change,
    "slow_receiver": every_second("vehicle_speed"),
    "in_ticks": in_ticks,
    "significant_digits": significant_digits,
    "losing_frames": losing_frames,
    "slow_accelerometer": every_second("accel"),
    "waking": waking,
    "filled_in": filled_in,
    "slow_place": every_second("position"),
    "triggered": triggered,
    "slow_wheels": every_second("wheel_speed"),
    "own_clock": own_clock,
}
