"""Rows whose time is not after the one above, and tables that hold one row per message."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.checks import Row, rows_text
from sim2real.logs.contract import TIME
from sim2real.logs.rasters import Channel, table_of
from sim2real.logs.table import Array, Finding, Table, Wanted

MOST_OUT_OF_ORDER = 0.01
"""Share of rows without a time of their own up to which they are left out [-]."""
MESSAGES = 20
"""Samples from which on a column counts as a message of its own."""


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
    """The table on the wheel speeds' times, where each of its rows holds the cells of one message; else None."""
    filled = {
        name: np.isfinite(values) & np.isfinite(time_s)
        for name, values in table.numbers.items()
        if name != wanted.time
    }
    base = next((name for name in wanted.base if name in filled), None)
    if base is None or np.count_nonzero(filled[base]) < MESSAGES:
        return None
    shared = {
        name: (np.count_nonzero(there), np.count_nonzero(there & filled[base]))
        for name, there in filled.items()
    }
    if not any(own >= MESSAGES and both <= MOST_OUT_OF_ORDER * own for own, both in shared.values()):
        return None
    channels, findings = {}, list(table.findings)
    for name, there in filled.items():
        at = np.flatnonzero(there)
        kept, said = in_order(time_s[at], partial(_row, table.rows[at]))
        findings += said
        at = at[kept]
        channels[name] = Channel(time_s[at], table.numbers[name][at])
    for name, texts in table.text.items():
        at = np.flatnonzero(texts != "")
        channels[name] = Channel(time_s[at], texts[at])
    made = table_of(path, table.names, (), channels, wanted)
    rows = table.rows[np.flatnonzero(filled[base])][: len(made.rows)]
    return replace(
        made,
        numbers={**made.numbers, wanted.time: channels[base].time_s},
        rows=rows if len(rows) == len(made.rows) else made.rows,
        findings=(*findings, *made.findings),
        units=table.units | {wanted.time: "s"},
        notes=(*table.notes, "one row per message"),
    )
