"""Times as files write them, in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sim2real.logs.resampling import median_step

Array = NDArray[np.float64]

SECONDS, ISO, CLOCK = "seconds", "iso8601", "hhmmss"
EPOCHS = {"epoch_s": 1.0, "epoch_ms": 1e-3, "epoch_us": 1e-6, "epoch_ns": 1e-9}
"""Forms of time since 1970, and their unit [s]."""
FORMS = (SECONDS, ISO, CLOCK, *EPOCHS)
"""Forms that a mapping file may state, beside a pattern of strptime."""
EPOCH_S = (9.0e8, 4.2e9)
"""Seconds since 1970 of a recording: the years 1998 to 2103 [s]."""
DAY_S = 86_400.0
_NS = 1_000_000_000
_LIKE_TIME = re.compile(
    r"(\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ,]*)?\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*(Z|[+-]\d{2}:?\d{2})?",
    re.ASCII,
)


@dataclass(frozen=True)
class Times:
    """Times of a column [s], shape (n,), NaN where a cell is no time; how they were read, empty for plain numbers."""

    time_s: Array
    note: str = ""


def times_of_texts(cells: Sequence[str], form: str = "") -> Times:
    """Seconds of texts such as "2024-05-03 12:00:00.005": since the first row, of a clock since midnight.

    Parameters
    ----------
    cells : sequence of str
        Their cells, one a row.
    form : str
        One of `FORMS`, or a pattern of strptime; empty to find it out: ISO 8601, or a clock as HH:MM:SS.
    """
    texts = pd.Series(cells, dtype=object)
    first = next((cell for cell in cells if cell), "")
    if form in ("", CLOCK) and _is_clock(first):
        clock = pd.to_timedelta(texts.where(texts.map(_is_clock)), errors="coerce")
        return Times(_over_midnight(_seconds(clock.to_numpy())), "time as a clock HH:MM:SS")
    pattern = form if "%" in form else "ISO8601"
    stamps = pd.to_datetime(texts, format=pattern, errors="coerce", utc=True).dt.tz_localize(None)
    name = pattern if "%" in form else "ISO 8601"
    return Times(_since_first(stamps.to_numpy()), f"time as {name}, from the first row on")


def times_of_stamps(stamps: NDArray[np.generic]) -> Times:
    """Seconds of datetime64 since the first of them, or of timedelta64 as they are."""
    if stamps.dtype.kind == "M":
        return Times(_since_first(stamps), "time as timestamps, from the first row on")
    return Times(_seconds(stamps), "time as durations")


def times_of_numbers(values: Array, form: str = "") -> Times:
    """Seconds of numbers in a form of `FORMS`; without one, epoch times and clocks are told by their values.

    A number of seconds stays as it is. Only what its size says without doubt is taken for milliseconds, microseconds or
    nanoseconds since 1970; HHMMSS only where it jumps from one minute to the next as such a clock does.
    """
    known = values[np.isfinite(values)]
    if form in EPOCHS:
        return Times(_from_first(values) * EPOCHS[form], f"time as {form}, from the first row on")
    if form == CLOCK:
        return Times(_over_midnight(_of_clock(values)), "time as a clock HHMMSS")
    if form or len(known) < 2:
        return Times(values)
    for name, unit_s in list(EPOCHS.items())[1:]:
        if EPOCH_S[0] <= known.min() * unit_s and known.max() * unit_s <= EPOCH_S[1]:
            return Times(_from_first(values) * unit_s, f"time as {name}, from the first row on")
    if _jumps_like_a_clock(known):
        return Times(_over_midnight(_of_clock(values)), "time as a clock HHMMSS")
    return Times(values)


def whole_nanoseconds(values: NDArray[np.int64]) -> Times | None:
    """Seconds since the first of whole numbers of nanoseconds since 1970, which no float64 holds; None of others."""
    if len(values) == 0 or not EPOCH_S[0] * _NS <= values.min() <= values.max() <= EPOCH_S[1] * _NS:
        return None
    return Times((values - values[0]) / _NS, "time as epoch_ns, from the first row on")


def _jumps_like_a_clock(values: Array) -> bool:
    """Whether numbers are times HHMMSS over at least one full minute."""
    if values.min() < 0.0 or values.max() >= 240_000.0 or len(values) < 3:
        return False
    if np.any(values % 100.0 >= 60.0) or np.any(values // 100.0 % 100.0 >= 60.0):
        return False
    step = median_step(values)
    step_up = np.diff(values)
    jumps = np.flatnonzero((step_up > 40.0) | (step_up < -235_000.0))
    if len(jumps) == 0 or np.any(step_up[step_up < 0.0] > -235_000.0) or not 0.0 < step < 1.0:
        return False
    over = np.diff(_over_midnight(_of_clock(values)))
    return bool(np.all(over[jumps] < 1.0) and np.all(values[jumps] % 100.0 >= 59.0))


def _of_clock(values: Array) -> Array:
    hours, minutes, seconds = values // 1e4, values // 1e2 % 1e2, values % 1e2
    wrong = (hours >= 24) | (minutes >= 60) | (seconds >= 60) | (values < 0)
    return np.where(wrong, np.nan, 3600.0 * hours + 60.0 * minutes + seconds)


def _over_midnight(time_s: Array) -> Array:
    """Times of a clock that go on where it starts again at 0."""
    back = np.diff(time_s, prepend=time_s[:1]) < -0.5 * DAY_S
    return time_s + DAY_S * np.cumsum(back)


def is_time(cell: str) -> bool:
    """Whether a cell is a date with a time, or a clock HH:MM:SS, whatever its exact form."""
    return _LIKE_TIME.fullmatch(cell) is not None


def _is_clock(text: object) -> bool:
    hours, *rest = str(text).split(":")
    return len(rest) in (1, 2) and hours.strip().isdigit() and len(hours.strip()) <= 2


def _since_first(stamps: NDArray[np.generic]) -> Array:
    there = stamps[~np.isnat(stamps)]
    return _seconds(stamps - there[0]) if len(there) else np.full(len(stamps), np.nan)


def _from_first(time_s: Array) -> Array:
    there = time_s[np.isfinite(time_s)]
    return time_s - there[0] if len(there) else time_s


def _seconds(durations: NDArray[np.generic]) -> Array:
    whole = durations.astype("timedelta64[ns]")
    return np.where(np.isnat(whole), np.nan, whole.astype(np.int64) / _NS)
