"""Plots of a sweep: distributions of error and convergence time, coverage, degradation curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from scenarios.plot_style import DASHED, GREY, INK, SHADE, Style, estimator_styles
from scenarios.plots import Figure, Panel, Series
from scenarios.sweep.summary import COVERAGE_SPAN, ENOUGH_SHOWN_S, quantile, shown_enough, slippery

ERROR_GOALS, TIME_GOALS = (0.01, 0.02), (0.3, 0.5)
"""Required median and 95th percentile: steady-state error [-], excited convergence time [s]."""
SHARES = {"median": 0.5, "95th percentile": 0.95}
THETA_BIN = 0.1
"""Width of the bins of true friction [-]."""
ERROR_SPAN, TIME_SPAN = (1e-4, 1.0), (0.0, 1.5)
THETA_SPAN = (0.0, 1.2)
REQUIRED = Style(INK, marker="x")
NOT_SHOWN = f"no slippery stretch on which the tyre showed its friction for {ENOUGH_SHOWN_S:g} s."
"""Why a plot of judged stretches may be empty."""


def distributions(table: pd.DataFrame) -> Figure:
    """Cumulative distributions of error and both convergence times on slippery stretches with enough excitation."""
    rows = shown_enough(slippery(table))
    styles = estimator_styles(list(table["estimator"].unique()))
    columns = (
        ("steady_state_error", "steady-state error [-]", ERROR_GOALS, ERROR_SPAN),
        ("convergence_time_s", "excited time until within 5 % of the step [s]", TIME_GOALS, TIME_SPAN),
        ("band_time_s", "excited time until within 0.02 [s]", TIME_GOALS, TIME_SPAN),
    )
    panels = tuple(
        Panel(
            f"share of stretches over {label.partition(' [')[0]}",
            f"{NOT_SHOWN} Or no estimator converged on one.",
            tuple(
                _cumulative(name, rows[rows["estimator"] == name][column], style)
                for name, style in styles.items()
            )
            + (Series("required", np.array(goals), np.array([0.5, 0.95]), REQUIRED, "points"),)
            * bool(len(rows)),
            x_label=label,
            x_limits=span,
            x_log=column == "steady_state_error",
            y_limits=(0.0, 1.02),
        )
        for column, label, goals, span in columns
    )
    return Figure("Cumulative distributions of error and convergence times", panels, linked=False)


def _cumulative(name: str, values: pd.Series, style: Style) -> Series:
    """A cumulative distribution, in which missing values are infinite."""
    found = np.sort(values.dropna().to_numpy(dtype=np.float64))
    return Series(name, found, np.arange(1, len(found) + 1) / max(len(values), 1), style, "step")


def errors_by_friction(table: pd.DataFrame) -> Figure:
    """Steady-state error of each stretch over its true friction, one panel per estimator."""
    names = [n for n in table["estimator"].unique() if n != "IFE"]
    panels = []
    for name, style in estimator_styles(names).items():
        rows = table[table["estimator"] == name]
        enough = rows["shown_s"] >= ENOUGH_SHOWN_S
        series = [
            _errors("shown too briefly", rows[~enough], Style(GREY, marker="x")),
            _errors("shown", rows[enough], Style(style.colour)),
        ]
        goal = Series(
            "required of 95 %", np.array(THETA_SPAN), np.full(2, ERROR_GOALS[1]), Style(INK, DASHED)
        )
        panels.append(
            Panel(
                f"{name}: steady-state error [-]",
                "no stretch has excited time, so there is no steady-state error.",
                (*series, goal) if any(np.isfinite(s.y).any() for s in series) else (),
                x_label="true TRPAC [-]",
                x_limits=THETA_SPAN,
                y_limits=ERROR_SPAN,
                y_log=True,
            )
        )
    return Figure("Steady-state error of each stretch over its true friction", tuple(panels))


def _errors(name: str, rows: pd.DataFrame, style: Style) -> Series:
    error = rows["steady_state_error"].clip(ERROR_SPAN[0])
    return Series(name, rows["theta"].to_numpy(), error.to_numpy(), style, "points")


def coverage(table: pd.DataFrame) -> Figure:
    """Share of time within 2 TRPAC_std over true friction, of all time and of the time in which the tyre shows it."""
    rows = table[table["covered_share"].notna()]
    styles = estimator_styles(list(rows["estimator"].unique()))
    kinds = (
        ("covered_share", "time_s", "all time"),
        ("covered_share_shown", "shown_s", "while the tyre shows it"),
    )
    edge = np.array(THETA_SPAN)
    required = Series(
        "required", edge, np.full(2, COVERAGE_SPAN[1]), Style(SHADE), low=np.full(2, COVERAGE_SPAN[0])
    )
    panels = []
    for column, weight, caption in kinds:
        series = [
            _shares(name, rows[rows["estimator"] == name], column, weight, s) for name, s in styles.items()
        ]
        panels.append(
            Panel(
                f"share within 2 TRPAC_std, {caption}",
                "no estimator of this sweep has a standard deviation in such time.",
                (required, *series) if any(len(s.x) for s in series) else (),
                x_label="true TRPAC [-]",
                x_limits=THETA_SPAN,
                y_limits=(0.0, 1.02),
            )
        )
    return Figure("Share of time with the true value within 2 TRPAC_std", tuple(panels))


def _shares(name: str, rows: pd.DataFrame, column: str, weight: str, style: Style) -> Series:
    mine = rows[rows[column].notna()]
    groups = list(mine.groupby(np.floor(mine["theta"] / THETA_BIN).astype(int)))
    centres = [THETA_BIN * (float(part["theta"].iloc[0]) // THETA_BIN + 0.5) for _, part in groups]
    shares = [np.average(part[column], weights=part[weight]) for _, part in groups]
    return Series(name, np.array(centres), np.array(shares), style, "marked")


def degradations(table: pd.DataFrame) -> Iterator[tuple[str, Figure]]:
    """Name and figure of each varied quantity: error and time to 0.02 over its levels, and the error of all time."""
    names = list(table["estimator"].unique())
    for parameter, part in table[table["parameter"] != ""].groupby("parameter", sort=False):
        slick = slippery(part)
        judged = shown_enough(slick)
        panels = [
            _over_levels(
                str(parameter), f"steady-state error, {word} [-]", judged, names, _quantile(share), y_log=True
            )
            for word, share in SHARES.items()
        ]
        others = [name for name in names if name != "IFE"]
        panels += [
            _over_levels(
                str(parameter),
                f"excited time until within 0.02, {word} [s]",
                judged,
                others,
                _quantile(share, "band_time_s", never=True),
            )
            for word, share in SHARES.items()
        ]
        panels.append(_over_levels(str(parameter), "mean error over all the time [-]", slick, names, _mean))
        yield str(parameter), Figure(f"Error and convergence time over {parameter}", tuple(panels))


Value = Callable[[pd.DataFrame], float | None]


def _quantile(share: float, column: str = "steady_state_error", *, never: bool = False) -> Value:
    return lambda rows: quantile(rows[column], share, never)


def _mean(rows: pd.DataFrame) -> float | None:
    return float(np.average(rows["error_mean"], weights=rows["time_s"])) if len(rows) else None


def _over_levels(
    parameter: str,
    label: str,
    part: pd.DataFrame,
    names: list[str],
    value: Value,
    *,
    y_log: bool = False,
) -> Panel:
    """A value of each estimator over the levels of a quantity."""
    levels = sorted(part["level"].unique())
    series = []
    for name, style in estimator_styles(names).items():
        mine = part[part["estimator"] == name]
        found = [value(mine[mine["level"] == level]) for level in levels]
        y = np.array([np.nan if v is None else v for v in found])
        series.append(Series(name, np.array(levels), y, style, "marked"))
    empty = f"{NOT_SHOWN} Or this share of the stretches never gets there."
    return Panel(label, empty, tuple(series), x_label=parameter, y_log=y_log, height=0.8)
