"""How a log was understood, for a person: columns, what was mended, what is missing, and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenarios.whole_files import write_whole
from sim2real.logs.contract import COLUMNS, POSITION, REQUIRED, TIME, WHEEL_SPEEDS
from sim2real.logs.mapping import Spec
from sim2real.logs.read import Understood
from sim2real.logs.resampling import BROKEN, median_step
from sim2real.logs.table import Array, read_as
from trpac_core.vehicle import WHEELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 4_000
"""Points of a curve in the picture; of longer logs, stretches between show their least and greatest value."""
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7")
"""Okabe and Ito's, which colour-blind people tell apart; the wheels differ by their lines, too."""
LINES = ("-", "--", "-.", ":")
LOST_COLOUR, MOST_SHADED = "#d55e00", 50
"""Shade behind stretches without a sample, and how many of a signal are shaded."""


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
    from matplotlib.figure import Figure  # takes a second to load

    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    _curves(panels[0], log, {"vehicle_speed_m_s": "vehicle"}, "speed [m/s]")
    _curves(panels[1], log, dict(zip(WHEEL_SPEEDS, WHEELS, strict=True)), "wheel speed [rad/s]")
    _curves(panels[2], log, {f"wheel_torque_{w}_nm": w for w in WHEELS}, "wheel torque [N m]")
    _curves(panels[3], log, {"accel_x_m_s2": "a_x", "accel_y_m_s2": "a_y"}, "acceleration [m/s²]")
    panels[-1].set_xlabel("time [s]")
    panels[0].set_title(f"{log.path.name}: {read_as(log.table.notes)}", fontsize=10, loc="left")
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    write_whole(path, picture.getvalue())


def _curves(axes: Axes, log: Understood, labels: Mapping[str, str], name: str) -> None:
    axes.set_ylabel(name)
    axes.grid(alpha=0.3)
    there = [key for key in labels if key in log.signals and np.isfinite(log.signals[key]).any()]
    for k, key in enumerate(there):
        at, values = _thinned(log.time_s, log.signals[key])
        axes.plot(at, values, LINES[k], color=COLOURS[k], lw=1.1, label=labels[key])
        for start, end in _lost(log.time_s, log.signals[key]):
            axes.axvspan(start, end, color=LOST_COLOUR, alpha=0.25, lw=0)
    if there:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(there), fontsize=8, frameon=False
        )
    else:
        axes.text(0.5, 0.5, "not in this log", transform=axes.transAxes, ha="center", color="0.4")


def _lost(time_s: Array, values: Array) -> list[tuple[float, float]]:
    """The longest stretches without a sample, by a signal's own rate."""
    t = time_s[np.isfinite(values)]
    step = np.diff(t)
    at = np.flatnonzero(step > BROKEN * np.median(step)) if len(step) else np.zeros(0, dtype=np.intp)
    longest = at[np.argsort(-step[at], kind="stable")[:MOST_SHADED]]
    return [(float(t[i]), float(t[i + 1])) for i in longest]


def _thinned(time_s: Array, values: Array) -> tuple[Array, Array]:
    """A curve of at most `MOST_POINTS` points with the least and the greatest value of each stretch."""
    known = np.isfinite(values)
    t, x = time_s[known], values[known]
    every = -(-2 * len(t) // MOST_POINTS)
    if every < 2:
        return t, x
    whole = len(t) // every * every
    stretches = x[:whole].reshape(-1, every)
    ends = np.stack((stretches.min(axis=1), stretches.max(axis=1)), axis=1).ravel()
    return np.repeat(t[:whole:every], 2), ends


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
