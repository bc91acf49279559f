"""diagnosis.json and report.html: what a diagnosis says, for machines and for people."""

from __future__ import annotations

import io
import json
import math
import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.effects import EFFECTS
from scenarios.html_page import MISSING, data_address, page
from scenarios.plots import Figure
from scenarios.whole_files import written_whole
from sim2real.how_far.rating import rate
from sim2real.reporting import figures
from sim2real.result import (
    Cause,
    Diagnosis,
    Gap,
    Interval,
    NextManoeuvre,
    Trace,
    Verdict,
    added,
    needed,
)
from trpac_core.vehicle import WHEELS

TEMPLATE = Path(__file__).with_name("report.html.jinja")
JSON_NAME, REPORT_NAME = "diagnosis.json", "report.html"

LEADING_FROM = 0.02
"""Probability from which a cause gets a card of its own [-]."""
MOST_LEADING = 5
SHOWN_FROM = 0.001
"""Share of the gap from which a part of the car has a row in the heat map [-]."""
CAUSE_PATTERNS = 3
"""How many patterns the template has for causes in the budget's bar."""


def write_diagnosis(diagnosis: Diagnosis, folder: str | Path) -> tuple[Path, Path]:
    """Write diagnosis.json and report.html into a folder, which is made where it is missing.

    Both appear together, so the folder never holds half a result.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    folder = Path(folder)
    contents = {
        JSON_NAME: json.dumps(jsonable(diagnosis.to_json()), indent=1, allow_nan=False) + "\n",
        REPORT_NAME: render(diagnosis),
    }
    with written_whole(folder) as made:
        for name, text in contents.items():
            (made / name).write_text(text, encoding="utf-8")
    return folder / JSON_NAME, folder / REPORT_NAME


def rated(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis with the ISO/TS 18571 ratings of its traces, which cost seconds and decide nothing."""
    return replace(diagnosis, rating=rate(shown_traces(diagnosis)))


def jsonable(value: Any) -> Any:
    """The same with plain numbers; what is not a finite number (an undefined one) becomes null."""
    if isinstance(value, dict):
        return {str(k): jsonable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(v) for v in value]
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


@dataclass(frozen=True)
class Part:
    """A part of the gap budget, as the bar and its table show it."""

    name: str
    share: Interval
    width: float
    """In the bar [%]."""
    pattern: str
    """Its class in the template."""


def render(diagnosis: Diagnosis) -> str:
    """The report as one HTML page that needs nothing beside it."""
    filters: dict[str, Callable[..., str | bool]] = {
        "estimate": estimate,
        "is_number": math.isfinite,
        "words": figures.words,
        "unit": figures.pretty_unit,
        "label": figures.label_of,
        "quantity": figures.quantity_label,
    }
    traces = shown_traces(diagnosis)
    names = " and ".join(cause.effect for cause in added(diagnosis))
    return page(
        TEMPLATE,
        filters,
        d=diagnosis,
        zoom_s=figures.ZOOM_S,
        effects=EFFECTS,
        needed=needed(diagnosis),
        added=names,
        budget=budget_parts(diagnosis),
        leading=leading(diagnosis),
        none_of_these=max(0.0, 1.0 - sum(c.probability for c in diagnosis.causes)),
        shrink=shrink(diagnosis),
        possible=possible_shrink(diagnosis),
        command=apply_command(diagnosis),
        signals=signal_rows(diagnosis.gap),
        heat=heat_rows(diagnosis),
        regimes=list(dict.fromkeys(regime for row in diagnosis.heat_map.values() for regime in row)),
        provenance=provenance_rows(diagnosis.provenance),
        drawn=_figures(diagnosis, traces[:1], names),
        traces=[(t, figures.trace(t, names)) for t in traces],
        profile=None if diagnosis.next_manoeuvre is None else profile_csv(diagnosis.next_manoeuvre),
    )


def budget_parts(diagnosis: Diagnosis) -> list[Part]:
    """The gap budget's parts, causes first; none where nothing may be blamed.

    What makes the gap larger has a share below 0, and no width.
    """
    if diagnosis.budget is None or diagnosis.verdict is Verdict.NO_GAP:
        return []
    shares = diagnosis.budget.shares
    whole = sum(max(share.value, 0.0) for share in shares.values())
    return [
        Part(
            name.removeprefix("effect:"),
            share,
            100.0 * max(share.value, 0.0) / whole,
            f"cause{i % CAUSE_PATTERNS}" if name.startswith("effect:") else name,
        )
        for i, (name, share) in enumerate(shares.items())
    ]


def leading(diagnosis: Diagnosis) -> tuple[Cause, ...]:
    """The causes worth a closer look; none where nothing may be blamed."""
    if diagnosis.verdict is Verdict.NO_GAP:
        return ()
    return tuple(c for c in diagnosis.causes if c.probability >= LEADING_FROM)[:MOST_LEADING]


def shrink(diagnosis: Diagnosis) -> Interval:
    """How far the hold-out's gap shrinks by what the verdict adds [%]; bounds are NaN where they are not known."""
    if len(added(diagnosis)) == 1:
        return diagnosis.causes[0].shrink_percent
    gap = diagnosis.gap
    return Interval(100.0 * (1.0 - gap.after.total / gap.before.total), math.nan, math.nan, "%")


def possible_shrink(diagnosis: Diagnosis) -> float:
    """The shrink that would leave nothing but noise [%]."""
    return max(0.0, 100.0 * (1.0 - diagnosis.gap.noise_floor / diagnosis.gap.before.total))


def heat_rows(diagnosis: Diagnosis) -> dict[str, dict[str, float]]:
    """The heat map's parts that have a share worth showing, largest first."""
    sizes = {part: sum(row.values()) for part, row in diagnosis.heat_map.items()}
    shown = sorted((part for part in sizes if sizes[part] >= SHOWN_FROM), key=lambda part: -sizes[part])
    return {part: diagnosis.heat_map[part] for part in shown}


def apply_command(diagnosis: Diagnosis) -> str:
    """The command that puts the named effects into the vehicle file."""
    path = Path((diagnosis.provenance.get("vehicle") or {}).get("path") or "car.yaml")
    lines = (
        ["trpac", "gap", "apply", JSON_NAME],
        ["--vehicle", str(path)],
        ["--out", f"{path.stem}_with_effect.yaml"],
    )
    return " \\\n  ".join(shlex.join(line) for line in lines)


def signal_rows(gap: Gap) -> list[tuple[str, float, float | None, str, float | None, float | None]]:
    """Per signal and of all: its name, gap before and after [sensor noises], its unit, the same two in that unit."""
    rows: list[tuple[str, float, float | None, str, float | None, float | None]] = [
        ("all", gap.before.total, gap.after.total, "", None, None)
    ]
    for name, before in gap.before.signals.items():
        plain = next((key for key in gap.before.si if key.startswith(f"{name} [")), "")
        unit = plain[len(name) + 2 : -1]
        si = gap.before.si.get(plain), gap.after.si.get(plain)
        rows.append((name, before, gap.after.signals.get(name), unit, *si))
    return rows


def shown_traces(diagnosis: Diagnosis) -> list[Trace]:
    """Traces that have something to compare, worst first, in units of their noise.

    Where the verdict adds nothing there is no after: a candidate that was refused is not drawn as if it were taken.
    """

    def size(trace: Trace) -> float:
        return float(np.sqrt(np.nanmean((trace.measured - trace.before) ** 2)) / trace.noise)

    comparable = [t for t in diagnosis.traces if np.isfinite(t.measured - t.before).any()]
    if not added(diagnosis):
        comparable = [replace(t, after=t.before) for t in comparable]
    return sorted(comparable, key=size, reverse=True)


def profile_csv(manoeuvre: NextManoeuvre) -> str:
    """The torque profile as a data address of a CSV file with the log contract's column names."""
    names = ["time_s", *(f"wheel_torque_{w}_nm" for w in WHEELS)]
    text = io.StringIO()
    table = np.column_stack([manoeuvre.time_s, manoeuvre.wheel_torque_nm])
    np.savetxt(text, table, fmt="%.6g", delimiter=",", header=",".join(names), comments="")
    return data_address(text.getvalue().encode("ascii"), "text/csv")


def provenance_rows(value: Any, label: str = "") -> list[tuple[str, str, str]]:
    """What a diagnosis was made from, as label, value and, for a file, its SHA-256."""
    if isinstance(value, dict):
        rows = []
        if {"path", "sha256"} <= set(value):
            rows.append((label, str(value["path"] or "in memory"), str(value["sha256"] or "")))
            value = {k: v for k, v in value.items() if k not in ("path", "sha256")}
        return rows + [
            row
            for k, v in value.items()
            for row in provenance_rows(v, f"{label} {figures.words(str(k))}".strip())
        ]
    if isinstance(value, (list, tuple)):
        return [row for i, v in enumerate(value, 1) for row in provenance_rows(v, f"{label} {i}")]
    return [(label, f"{value:g}" if isinstance(value, float) else str(value), "")]


def _figures(diagnosis: Diagnosis, worst: list[Trace], names: str) -> dict[str, Figure]:
    """The plots that this diagnosis has; `worst` is the trace furthest off, if any, `names` the added effects'."""
    made = {}
    if worst and diagnosis.verdict is not Verdict.NO_GAP:
        made["largest"] = figures.largest_gap(worst[0], names)
    if diagnosis.unexplained is not None and len(diagnosis.unexplained.x):
        made["term"] = figures.missing_term(diagnosis.unexplained)
    if diagnosis.next_manoeuvre is not None:
        made["profile"] = figures.profile(diagnosis.next_manoeuvre)
    return made


def estimate(interval: Interval) -> str:
    """A value with its interval and unit, with as many digits as the interval's width makes sense of."""
    unit = "" if interval.unit in ("-", "") else f" {figures.pretty_unit(interval.unit)}"
    if not math.isfinite(interval.value):
        return MISSING
    known = math.isfinite(interval.low) and math.isfinite(interval.high)
    width = interval.high - interval.low if known else 0.0
    scale = max(width, 0.01 * abs(interval.value) if width <= 0.0 else 1e-6 * abs(interval.value))
    digits = 0 if scale == 0.0 else max(0, 1 - math.floor(math.log10(scale)))
    value = f"{interval.value:.{digits}f}"
    if not known:
        return value + unit
    return f"{value}{unit} ({interval.low:.{digits}f} to {interval.high:.{digits}f})"
