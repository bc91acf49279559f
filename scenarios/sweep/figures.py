"""Figures of a sweep: distributions of error and convergence time, coverage, degradation curves."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.sweep.summary import COVERAGE_SPAN, ENOUGH_SHOWN_S, quantile, shown_enough, slippery
from trpac_core.files import quoted

COLOURS = {"IFE": "#d08a00", "DE": "#4c8fd0", "DIFE": "#c0272d"}
OTHERS = ("#2c9c5a", "#7a4fb5", "#777777", "#b06d3a")
ERROR_GOALS, TIME_GOALS = (0.01, 0.02), (0.3, 0.5)
"""Required median and 95th percentile: steady-state error [-], excited convergence time [s]."""
STYLE: Any = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.35, "axes.axisbelow": True}
THETA_BIN = 0.1
"""Width of the bins of true friction [-]."""
ERROR_SPAN, TIME_SPAN = (1e-4, 1.0), (0.0, 1.5)


def colour(name: str, names: list[str]) -> str:
    """An estimator's colour."""
    others = [n for n in names if n not in COLOURS]
    return COLOURS.get(name) or OTHERS[others.index(name) % len(OTHERS)]


def plain(name: object) -> str:
    """A name for matplotlib, with dollar signs escaped."""
    return quoted(name).replace("$", r"\$")


def png(figure: Figure) -> bytes:
    """A figure as PNG, without matplotlib's metadata; closes the figure."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=120, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def distributions(table: pd.DataFrame) -> bytes:
    """Cumulative distributions of error and both convergence times on slippery stretches with enough excitation."""
    rows = shown_enough(slippery(table))
    names = list(table["estimator"].unique())
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 3, figsize=(12.5, 4.2), sharey=True)
        panels = (
            (axes[0], "steady_state_error", "steady-state error [-]", ERROR_GOALS),
            (axes[1], "convergence_time_s", "excited time until within 5 % of the step [s]", TIME_GOALS),
            (axes[2], "band_time_s", "excited time until within 0.02 [s]", TIME_GOALS),
        )
        for axis, column, label, goals in panels:
            for name in names:
                _cumulative(axis, rows[rows["estimator"] == name][column], plain(name), colour(name, names))
            for goal, share in zip(goals, (0.5, 0.95), strict=True):
                axis.plot([goal], [share], marker="x", color="#222222", ms=8, mew=2, ls="none")
            axis.set_xlabel(label)
        axes[0].set_xscale("log")
        axes[0].set_xlim(*ERROR_SPAN)
        for axis in axes[1:]:
            axis.set_xlim(*TIME_SPAN)
        axes[0].set_ylabel("share of stretches")
        axes[0].legend(loc="upper left", fontsize=8)
        figure.tight_layout()
        return png(figure)


def _cumulative(axis: Axes, values: pd.Series, name: str, shade: str) -> None:
    """Draw a cumulative distribution, in which missing values are infinite."""
    if not len(values):
        return
    found = np.sort(values.dropna().to_numpy(dtype=np.float64))
    axis.step(
        found, np.arange(1, len(found) + 1) / len(values), where="post", color=shade, label=name, lw=1.6
    )


def errors_by_friction(table: pd.DataFrame) -> bytes:
    """Steady-state error of each stretch over its true friction, one panel per estimator."""
    names = [n for n in table["estimator"].unique() if n != "IFE"]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            1, len(names), figsize=(4.6 * len(names), 3.8), sharey=True, squeeze=False
        )
        for axis, name in zip(axes[0], names, strict=True):
            rows = table[table["estimator"] == name]
            enough = rows["shown_s"] >= ENOUGH_SHOWN_S
            for mask, mark, label in (
                (~enough, "#bbbbbb", "tyre showed it too briefly"),
                (enough, colour(name, names), "tyre showed it"),
            ):
                axis.plot(
                    rows["theta"][mask],
                    rows["steady_state_error"][mask].clip(ERROR_SPAN[0]),
                    ".",
                    ms=3,
                    color=mark,
                    label=label,
                )
            axis.set_yscale("log")
            axis.set_ylim(*ERROR_SPAN)
            axis.axhline(ERROR_GOALS[1], color="#222222", lw=0.8, ls="--")
            axis.set_title(plain(name))
            axis.set_xlabel("true TRPAC [-]")
            axis.legend(loc="lower right", fontsize=7)
        axes[0][0].set_ylabel("steady-state error [-]")
        figure.tight_layout()
        return png(figure)


def coverage_figure(table: pd.DataFrame) -> bytes | None:
    """Share of time within 2 TRPAC_std over true friction, of all time and of the excited time; None without any."""
    rows = table[table["covered_share"].notna()]
    if rows.empty:
        return None
    names = list(rows["estimator"].unique())
    kinds = (
        ("covered_share", "time_s", "o-", "all time"),
        ("covered_share_shown", "shown_s", "s--", "while the tyre shows it"),
    )
    with plt.rc_context(STYLE):
        figure, axis = plt.subplots(figsize=(8.0, 3.8))
        axis.axhspan(*COVERAGE_SPAN, color="#2c9c5a", alpha=0.15, lw=0, label="asked for")
        for name in names:
            for column, weight, style, caption in kinds:
                mine = rows[(rows["estimator"] == name) & rows[column].notna()]
                groups = list(mine.groupby(np.floor(mine["theta"] / THETA_BIN).astype(int)))
                centres = [
                    THETA_BIN * (float(part["theta"].iloc[0]) // THETA_BIN + 0.5) for _, part in groups
                ]
                shares = [np.average(part[column], weights=part[weight]) for _, part in groups]
                axis.plot(
                    centres, shares, style, color=colour(name, names), label=f"{plain(name)}, {caption}"
                )
        axis.set_ylim(0.0, 1.02)
        axis.set_xlabel("true TRPAC [-]")
        axis.set_ylabel("share within 2 TRPAC_std")
        axis.legend(fontsize=8, loc="lower right")
        figure.tight_layout()
        return png(figure)


def degradations(table: pd.DataFrame) -> Iterator[tuple[str, bytes]]:
    """Name and figure of each varied quantity: error and convergence time over its levels."""
    names = list(table["estimator"].unique())
    for parameter, part in table[table["parameter"] != ""].groupby("parameter", sort=False):
        with plt.rc_context(STYLE):
            figure, axes = plt.subplots(1, 3, figsize=(12.5, 3.6))
            _degradation(axes, part, names)
            for axis in axes:
                axis.set_xlabel(plain(parameter))
            axes[0].legend(fontsize=8)
            figure.tight_layout()
            yield str(parameter), png(figure)


def _degradation(axes: np.ndarray, part: pd.DataFrame, names: list[str]) -> None:
    """Draw median and 95th percentile of error and of time to 0.02, and the mean error of all time."""
    levels = sorted(part["level"].unique())
    slick = slippery(part)
    for name in names:
        mine, shade = slick[slick["estimator"] == name], colour(name, names)
        judged = shown_enough(mine)
        for share, style in ((0.5, "o-"), (0.95, "^:")):
            label = plain(name) if share == 0.5 else None
            error = [quantile(judged[judged["level"] == x]["steady_state_error"], share) for x in levels]
            axes[0].plot(levels, _plain(error), style, color=shade, label=label)
            if name != "IFE":
                time = [
                    quantile(judged[judged["level"] == x]["band_time_s"], share, never=True) for x in levels
                ]
                axes[1].plot(levels, _plain(time), style, color=shade)
        mean = [mine[mine["level"] == x] for x in levels]
        axes[2].plot(
            levels, [np.average(m["error_mean"], weights=m["time_s"]) for m in mean], "o-", color=shade
        )
    axes[0].set_ylabel("steady-state error [-]\nmedian (line), 95th percentile (dots)")
    axes[0].set_yscale("log")
    axes[0].axhline(ERROR_GOALS[1], color="#222222", lw=0.8, ls="--")
    axes[1].set_ylabel("excited time until within 0.02 [s]")
    axes[2].set_ylabel("mean error over all the time [-]")


def _plain(values: list[float | None]) -> list[float]:
    return [np.nan if v is None else v for v in values]
