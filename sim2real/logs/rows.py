"""Rows whose time is not after the one above, and tables that hold one row per message."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.checks import Row, rows_text
from sim2real.logs.contract import TIME
from sim2real.logs.rasters import Channel, table_of
from sim2real.logs.table import MOST_OUT_OF_ORDER, Array, Finding, Table, Wanted

MESSAGES = 20
"""Samples from which on a column counts as a message of its own."""
LONGEST_PAUSE = 4.0
"""Pause between the changes of a signal, over the usual one, up to which each of its messages changes it [-]."""


def in_order(time_s: Array, row: Row) -> tuple[NDArray[np.bool_], list[Finding]]:
    """Which rows have a time after all that are kept above, and a finding on the others: too many are refused."""
    known = np.isfinite(time_s)
    late = np.zeros(len(time_s), dtype=bool)
    early = late.copy()
    t = time_s[known]
    late[known] = np.concatenate(([False], t[1:] <= np.maximum.accumulate(t)[:-1]))
    early[known] = (
        np.concatenate((t[:-1] >= np.minimum.accumulate(t[::-1])[::-1][1:], [False])) if len(t) else []
    )
    out = late if np.count_nonzero(late) <= np.count_nonzero(early) else early
    drop = out | ~known
    at = np.flatnonzero(drop)
    if len(at) == 0:
        return ~drop, []
    i = int(at[0])
    if not known[i]:
        what, said = "has no time", ""
    else:
        above = time_s[:i][known[:i]]
        what = (
            "repeats the time above"
            if len(above) and above[-1] == time_s[i]
            else "has a time that is out of order"
        )
        said = f" ({time_s[i]:.9g} after {above[-1]:.9g})" if len(above) else f" ({time_s[i]:.9g})"
    text = f"column {TIME}: {rows_text(at, row)} {what}{said}"
    if len(at) > MOST_OUT_OF_ORDER * len(time_s):
        return ~drop, [
            Finding(
                f"{text}; expected ascending times, written with enough digits, in all but {MOST_OUT_OF_ORDER:.0%} of "
                "the rows."
            )
        ]
    return ~drop, [Finding(f"{text}; left out.", fatal=False)]


def _row(rows: NDArray[np.int64], i: int) -> str:
    return f"row {rows[i]}"


def one_per_message(path: Path, table: Table, time_s: Array, wanted: Wanted) -> Table | None:
    """The table on the wheel speeds' times, where each of its rows holds one message; else None.

    The cells of other messages are empty in such a row, or carried forward from the rows above.
    """
    known = np.isfinite(time_s)
    filled = {name: np.isfinite(x) & known for name, x in table.numbers.items() if name != wanted.time}
    wheels = [name for name in wanted.base if name in filled]
    if not wheels:
        return None
    new, note = filled, "one row per message"
    if not _apart(new, filled[wheels[0]]):
        new = {name: filled[name] & _changed(table.numbers[name]) for name in filled}
        carried = np.logical_or.reduce([new[name] for name in wheels])
        if not _apart(new, carried):
            return None
        # What seldom changes is as good as its message's rows where the wheels' message is.
        new = {
            n: carried if n in wheels or not _is_steady(time_s[there]) else there for n, there in new.items()
        }
        note = "one row per message, other cells carried forward"
    channels, findings = {}, list(table.findings)
    for name, there in new.items():
        at = np.flatnonzero(there)
        kept, said = in_order(time_s[at], partial(_row, table.rows[at]))
        findings += said
        at = at[kept]
        channels[name] = Channel(time_s[at], table.numbers[name][at])
    for name, texts in table.text.items():
        at = np.flatnonzero(texts != "")
        channels[name] = Channel(time_s[at], texts[at])
    made = table_of(path, table.names, (), {n: c for n, c in channels.items() if len(c.samples) > 1}, wanted)
    lost = {name: np.full(len(made.rows), np.nan) for name in new if len(channels[name].samples) < 2}
    at = np.flatnonzero(np.isin(time_s, channels[wheels[0]].time_s) & new[wheels[0]])
    return replace(
        made,
        numbers={**made.numbers, **lost, wanted.time: channels[wheels[0]].time_s},
        rows=table.rows[at] if len(at) == len(made.rows) else made.rows,
        findings=(*findings, *made.findings),
        units=table.units | {wanted.time: "s"},
        notes=(*table.notes, note),
    )


def _apart(new: Mapping[str, NDArray[np.bool_]], base: NDArray[np.bool_]) -> bool:
    """Whether some signal has new cells between the base's, in other rows, and both have enough of them."""
    if np.count_nonzero(base) < MESSAGES:
        return False
    first, last = np.flatnonzero(base)[[0, -1]]
    between = slice(first, last + 1)
    counts = [
        (np.count_nonzero(x[between]), np.count_nonzero(x[between] & base[between])) for x in new.values()
    ]
    return any(own >= MESSAGES and both <= MOST_OUT_OF_ORDER * own for own, both in counts)


def _changed(values: Array) -> NDArray[np.bool_]:
    """Rows whose cell is another than the one above; the first row's message is not known."""
    return np.concatenate((np.zeros(min(len(values), 1), dtype=bool), values[1:] != values[:-1]))


def _is_steady(time_s: Array) -> bool:
    """Whether a signal's changes come at a pace of their own, none left out for long."""
    return len(time_s) >= MESSAGES and bool(
        np.diff(time_s).max() < LONGEST_PAUSE * np.median(np.diff(time_s))
    )
