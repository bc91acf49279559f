"""What must hold for a log before anything may be concluded from it; each check gives findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.contract import POSITION, REQUIRED, TIME
from sim2real.logs.resampling import BROKEN, lost_share, median_step
from sim2real.logs.table import SHOWN, Array, Finding, and_more
from sim2real.logs.units import factor

RATE_HZ = (20.0, 2000.0)
"""Rates that can be used: slower than this no wheel dynamics are left."""
CONTRACT_RATE_HZ = (50.0, 2000.0)
"""Rates that the log format asks for; outside there is a warning."""
RATE_TOLERANCE = 0.02
"""Clocks are not exact."""
MIN_DURATION_S = 2.0
"""Vehicle speed forgets its past within about 1 s; a log must be longer than that."""
GAP_S = 0.25
"""Longer pieces without rows are gaps; shorter ones are lost samples."""
IRREGULAR_SHARE = 0.05
"""Share of steps off by more than half a step from which on a log has no rate any more."""
WHOLE = 0.25
"""A step this close to a whole number of them, two or more, has rows of an even clock left out [steps]."""
LOST_SHARE = 0.5
"""Share of lost samples from which on a required column is refused."""
LOST_WARNING = 0.05
"""Share of lost samples worth a warning."""

FEWEST_STEPS = 50
"""Changes of value from which on a signal may be called held."""
EARLY_SHARE = 0.02
"""Share of the changes that may come earlier than a held signal's."""

Row = Callable[[int], str]


@dataclass(frozen=True)
class Clock:
    """What is odd about the times of a log, and its gaps as (from, to) [s]."""

    findings: tuple[Finding, ...] = ()
    gaps: tuple[tuple[float, float], ...] = ()

    @property
    def usable(self) -> bool:
        """Whether anything can be reckoned over these times."""
        return not any(finding.fatal for finding in self.findings)


def check_time(time_s: Array, row: Row) -> Clock:
    """Whether ascending times come at a usable rate; the gaps in them."""
    step = np.diff(time_s)
    duration = float(time_s[-1] - time_s[0]) if len(time_s) else 0.0
    rate = 1.0 / median_step(time_s) if len(step) else RATE_HZ[0]
    if not RATE_HZ[0] / (1.0 + RATE_TOLERANCE) <= rate <= RATE_HZ[1] * (1.0 + RATE_TOLERANCE):
        return _unusable(
            f"comes at {rate:.4g} Hz; expected {span(CONTRACT_RATE_HZ)} Hz.{_time_unit_hint(rate)}"
        )
    if duration < MIN_DURATION_S:
        return _unusable(f"is {duration:.3g} s long; expected at least {MIN_DURATION_S:g} s.")
    at = np.flatnonzero(step > GAP_S)
    gaps = tuple((float(time_s[i]), float(time_s[i + 1])) for i in at)
    return Clock((*_rate_findings(rate), *_step_findings(step, row), *_gap_findings(gaps)), gaps)


def _unusable(text: str) -> Clock:
    return Clock((Finding(text),))


def _rate_findings(rate_hz: float) -> Iterator[Finding]:
    if rate_hz < CONTRACT_RATE_HZ[0] / (1.0 + RATE_TOLERANCE):
        text = f"comes at {rate_hz:.4g} Hz, less than the {CONTRACT_RATE_HZ[0]:g} Hz expected."
        yield Finding(text, fatal=False)


def _step_findings(step: Array, row: Row) -> Iterator[Finding]:
    median = float(np.median(step))
    irregular = np.flatnonzero(np.abs(step - median) > (BROKEN - 1.0) * median * (1.0 + 1e-6)) + 1
    if len(irregular) == 0:
        return
    steps = step[irregular - 1] / median
    left_out = (steps > BROKEN) & (np.abs(steps - np.round(steps)) <= WHOLE)
    fatal = bool(np.count_nonzero(~left_out) > IRREGULAR_SHARE * len(step))
    yield Finding(
        f"column {TIME}: {rows_text(irregular, row)} is more than half a step ({median * 500:.3g} ms) off its time "
        f"after the row above{'; expected a constant or slightly jittered rate.' if fatal else '.'}",
        fatal,
    )


def _gap_findings(gaps: tuple[tuple[float, float], ...]) -> Iterator[Finding]:
    if gaps:
        listed = ", ".join(f"from {start:.6g} to {end:.6g} s" for start, end in gaps[:SHOWN])
        yield Finding(f"has no rows {listed}{and_more(len(gaps))}.", fatal=False)


def check_values(time_s: Array | None, signals: Mapping[str, Array], row: Row) -> Iterator[Finding]:
    """Infinite and lost values, and values that a column cannot have; `time_s` where the clock can be used."""
    for name, values in signals.items():
        infinite = np.flatnonzero(np.isinf(values))
        if len(infinite):
            yield Finding(
                f"column {name}: {rows_text(infinite, row)} is infinite; expected a number or an empty cell."
            )
        share = float(np.mean(np.isnan(values)))
        if share == 1.0:
            tail = "expected measured values." if name in REQUIRED else "it is taken as not measured."
            yield Finding(f"column {name} has no value at all; {tail}", fatal=name in REQUIRED)
            continue
        share = share if time_s is None else lost_share(values, median_step(time_s))
        if name in (*REQUIRED, POSITION) and share > LOST_WARNING:
            fatal = share > LOST_SHARE
            tail = f"; expected at most {LOST_SHARE:.0%}." if fatal else "."
            yield Finding(f"column {name}: {share:.0%} of its samples are lost{tail}", fatal)
    yield from _check_range(signals, "image_class", lambda x: np.isin(x, (-1, 0, 1, 2)), "0, 1, 2 or -1", row)
    yield from _check_range(
        signals, "image_confidence", lambda x: (x >= 0) & (x <= 1), "0 to 1 (unit: '%'?)", row
    )
    yield from _check_range(
        signals, "mu_reference", lambda x: (x >= 0) & (x <= 2), "0 to 2 (unit: '%'?)", row
    )


def check_held(time_s: Array, signals: Mapping[str, Array]) -> Iterator[Finding]:
    """Signals whose values stand for several rows each: such a signal is late, by half of that on average."""
    rows = {name: _rows_held(signals[name]) for name in REQUIRED if name in signals}
    step_ms = 1e3 * median_step(time_s)
    for count in sorted(set(rows.values()) - {1.0}):
        yield Finding(
            f"{', '.join(name for name in rows if rows[name] == count)}: every value stands for {count:.3g} rows, "
            f"{count * step_ms:.3g} ms, as a recorder holds a message until the next one, or a counter shows its "
            "window. "
            f"On average it is {0.5 * (count - 1.0) * step_ms:.3g} ms old, which a diagnosis may report as a "
            "delay. If the recorder repeated values, leave the repeated cells empty.",
            fatal=False,
        )


def _rows_held(values: Array) -> float:
    """How many rows a signal's values stand for, where they change at an even pace; else 1."""
    gaps = np.diff(np.flatnonzero(np.diff(values[np.isfinite(values)])))
    if len(gaps) < FEWEST_STEPS:
        return 1.0
    early = int(np.quantile(gaps, EARLY_SHARE))
    if early < 2 or np.median(gaps) > early + 1:
        return 1.0
    return float(np.mean(gaps[(gaps >= early) & (gaps <= early + 1)]).round(1))


def _check_range(
    signals: Mapping[str, Array],
    name: str,
    allowed: Callable[[Array], NDArray[np.bool_]],
    expected: str,
    row: Row,
) -> Iterator[Finding]:
    if name not in signals:
        return
    values = signals[name]
    bad = np.flatnonzero(~allowed(values) & np.isfinite(values))
    if len(bad):
        yield Finding(f"column {name}: {rows_text(bad, row)} is {values[bad[0]]:g}; expected {expected}.")


def rows_text(indices: NDArray[np.intp], row: Row) -> str:
    """The first few rows of a list, and how many more."""
    return ", ".join(row(int(i)) for i in indices[:SHOWN]) + and_more(len(indices))


def _time_unit_hint(rate: float) -> str:
    """Which unit of time would make this a log's rate."""
    for unit in ("ms", "us", "ns", "min", "h"):
        if RATE_HZ[0] <= rate / factor(unit, "s") <= RATE_HZ[1]:
            return (
                f" Is the time in {unit}? A mapping file says so: `time_s: {{column: NAME, unit: {unit}}}`."
            )
    return ""


def span(bounds: tuple[float, float]) -> str:
    """Two bounds as text."""
    return f"{bounds[0]:g} to {bounds[1]:g}"
