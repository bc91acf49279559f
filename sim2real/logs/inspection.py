"""How a log was understood, for a person: columns, what was mended, what is missing, and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.plot_style import LOST, WHEEL_STYLES
from scenarios.plots import Figure, Panel, Series, Shade, png, thin
from scenarios.whole_files import write_whole
from sim2real.logs.contract import COLUMNS, POSITION, REQUIRED, TIME, WHEEL_SPEEDS
from sim2real.logs.mapping import Spec
from sim2real.logs.read import Understood
from sim2real.logs.resampling import BROKEN, median_step
from sim2real.logs.table import Array, read_as
from trpac_core.vehicle import WHEELS

MOST_SHADED = 50
"""Stretches without a sample that are shaded for a signal."""


@dataclass(frozen=True)
class ColumnReport:
    """One column of the log format as it was made.

    Attributes
    ----------
    name, source, unit : str
        What it is called, what it was made of, and the unit of that source; "" where none is stated.
    factor : float
        What the source's values were multiplied with; NaN where there are several.
    rate_hz, lost, low, high : float
        Samples per second, share of lost samples at that rate, least and greatest value in the log format's unit.
    """

    name: str
    source: str
    unit: str
    factor: float
    rate_hz: float
    lost: float
    low: float
    high: float


def column_reports(log: Understood) -> list[ColumnReport]:
    """One report per column of the log format that could be made, in its order."""
    reports = []
    every: dict[str, Array] = {TIME: log.time_s, **log.signals}
    for name in COLUMNS:
        if name not in every or len(every[name]) == 0:
            continue
        spec = log.mapping.spec(name)
        if spec.column is not None:
            source, unit, factor = _plain(log, name, spec)
        else:
            source = " + ".join(log.mapping.sources(name)) or "computed"
            unit, factor = "", np.nan
        reports.append(ColumnReport(name, source, unit, factor, *_samples(log.time_s, every[name])))
    return reports


def missing_for_estimate(log: Understood) -> list[str]:
    """Required columns that could not be made."""
    return [name for name in REQUIRED if name != TIME and name not in log.signals] + [TIME] * (
        len(log.time_s) == 0
    )


def missing_for_diagnosis(log: Understood) -> list[str]:
    """What a diagnosis lacks beyond what an estimate needs, in a few words each."""
    missing = []
    if POSITION not in log.signals or POSITION in log.derived:
        missing.append("usable on a road of one stretch, since no position is measured")
    for name, what in (("vehicle_speed_m_s", "speed"), ("wheel_torque_fl_nm", "torque")):
        values = log.signals.get(name)
        if values is not None and np.nanstd(values) == 0.0:
            missing.append(f"the {what} never changes: causes cannot be distinguished")
    return missing


def draw(log: Understood, path: Path) -> None:
    """Write a picture of the signals as PNG: speeds, torques, accelerations, each over time, lost samples shaded."""
    panels = (
        _panel(log, {"vehicle_speed_m_s": "vehicle"}, "speed [m/s]"),
        _panel(log, dict(zip(WHEEL_SPEEDS, WHEELS, strict=True)), "wheel speed [rad/s]"),
        _panel(log, {f"wheel_torque_{w}_nm": w for w in WHEELS}, "wheel torque [N m]"),
        _panel(log, {"accel_x_m_s2": "a_x", "accel_y_m_s2": "a_y"}, "acceleration [m/s²]"),
    )
    title = f"{log.path.name}: {read_as(log.table.notes)}"
    write_whole(path, png(Figure("signals over time", panels), title, row_in=2.1))


def _panel(log: Understood, labels: Mapping[str, str], name: str) -> Panel:
    there = [key for key in labels if key in log.signals and np.isfinite(log.signals[key]).any()]
    series, shades = [], []
    for key, style in zip(there, WHEEL_STYLES.values(), strict=False):
        known = np.isfinite(log.signals[key])
        time_s, values = log.time_s[known], log.signals[key][known]
        shown = thin(values)
        series.append(Series(labels[key], time_s[shown], values[shown], style))
        shades += [Shade(start, end, LOST) for start, end in _lost(time_s)]
    return Panel(name, "not in this log", tuple(series), shades=tuple(shades))


def _lost(t: Array) -> list[tuple[float, float]]:
    """The longest stretches without a sample, by a signal's own rate; its samples' times are given."""
    step = np.diff(t)
    at = np.flatnonzero(step > BROKEN * np.median(step)) if len(step) else np.zeros(0, dtype=np.intp)
    longest = at[np.argsort(-step[at], kind="stable")[:MOST_SHADED]]
    return [(float(t[i]), float(t[i + 1])) for i in longest]


def _plain(log: Understood, name: str, spec: Spec) -> tuple[str, str, float]:
    column = spec.column or name
    unit = spec.unit or log.table.units.get(column, "")
    by = (
        spec.model_copy(update={"unit": unit or None}).factor(COLUMNS[name].unit)
        if COLUMNS[name].unit != "-"
        else 1.0
    )
    return column, unit, spec.sign * spec.scale * by


def _samples(time_s: Array, values: Array) -> tuple[float, float, float, float]:
    """Rate [Hz], share of lost samples at it, least and greatest value."""
    known = np.isfinite(values)
    count = int(np.count_nonzero(known))
    if count < 2 or len(time_s) != len(values):
        return np.nan, 1.0, np.nan, np.nan
    step = median_step(time_s[known])
    length = float(time_s[-1] - time_s[0])
    lost = max(0.0, 1.0 - count / (round(length / step) + 1)) if step > 0.0 else np.nan
    return 1.0 / step if step > 0.0 else np.nan, lost, float(np.nanmin(values)), float(np.nanmax(values))
