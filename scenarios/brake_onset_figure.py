"""The figure of brake onsets: TRPAC with and without the camera along the road, and the planned stopping distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from scenarios import plot_style
from scenarios.brake_onset import Comparison, Onset, Plan

FROM_M, TOP = -15.0, 1.3
"""Where the figure begins, from the border [m], and the end of the axis of TRPAC [-]."""
LONGEST_M = 100.0
"""End of the axis of stopping distances; longer intervals end in an arrow [m]."""
TRUTH, GREY = plot_style.INK.light, plot_style.GREY.light


@dataclass(frozen=True)
class Series:
    """How a run is drawn; the colours are those of Okabe and Ito."""

    run: str
    label: str
    colour: str
    dashes: str
    hatch: str


SERIES = (
    Series("with_camera", "with camera", plot_style.BLUE.light, "-", ""),
    Series("without_camera", "without camera", plot_style.VERMILLION.light, "--", "//"),
)


def draw_brake_onset(comparisons: Sequence[Comparison], path: Path) -> None:
    """Write the figure, a column per drive."""
    with plt.rc_context({"font.size": 13, "axes.grid": True, "grid.alpha": 0.3, "axes.axisbelow": True}):
        figure, axes = plt.subplots(
            2,
            len(comparisons),
            figsize=(6.0 * len(comparisons), 7.4),
            height_ratios=[2.1, 1.0],
            sharey="row",
            squeeze=False,
        )
        for (above, below), compared in zip(axes.T, comparisons, strict=True):
            _along_the_road(above, compared)
            _planned_stops(below, compared.onset)
        axes[0, 0].set_ylabel("TRPAC [-]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        columns = min(2 * len(comparisons), len(labels))
        figure.legend(handles, labels, loc="upper center", ncols=columns, frameon=False, fontsize=12)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.95 if columns == len(labels) else 0.91))
        figure.savefig(path, dpi=100)
        plt.close(figure)


def _along_the_road(axis: Axes, compared: Comparison) -> None:
    table, onset = compared.table, compared.onset
    table = table[table["after_border_m"] >= FROM_M]
    position_m = table["after_border_m"]
    for series in SERIES:
        low, high = (table[f"TRPAC_{end}_{series.run}"] for end in ("low", "high"))
        axis.fill_between(position_m, low, high, color=series.colour, alpha=0.09, lw=0)
        for edge in (low, high):
            axis.plot(position_m, edge, color=series.colour, ls=series.dashes, lw=0.9, alpha=0.8)
        axis.plot(
            position_m,
            table[f"TRPAC_{series.run}"],
            color=series.colour,
            ls=series.dashes,
            lw=2.6,
            label=series.label,
        )
    axis.plot(position_m, table["theta_true"], color=TRUTH, lw=2.0, ls=":", label="true peak friction")
    for x, text in ((0.0, "border"), (onset.after_border_m, "brake onset")):
        axis.axvline(x, color=GREY, lw=1.2)
        axis.text(x - 0.3, 0.97 * TOP, text, rotation=90, ha="right", va="top", color=GREY, fontsize=12)
    axis.fill_between([], [], [], color=GREY, alpha=0.25, label="95 % interval (thin lines)")
    axis.set_xlim(float(position_m.iloc[0]), float(position_m.iloc[-1]))
    axis.set_ylim(0.0, TOP)
    axis.set_xlabel("front wheel after the border [m]")
    axis.set_title(f"Dry road onto {onset.road}")


def _planned_stops(axis: Axes, onset: Onset) -> None:
    rows = [(s.label, getattr(onset, s.run), s) for s in SERIES]
    for y, (_, plan, series) in enumerate(rows):
        stop_m = LONGEST_M if plan.planned_stop_m is None else plan.planned_stop_m
        axis.barh(y, stop_m, color=series.colour, alpha=0.75, hatch=series.hatch, edgecolor="white")
        _interval(axis, y, plan)
    axis.barh(len(rows), onset.shortest_stop_m, color=plot_style.GREY.light, alpha=0.6)
    axis.text(
        LONGEST_M - 1, len(rows), f"{onset.shortest_stop_m:.0f} m", ha="right", va="center", fontsize=12
    )
    axis.set_yticks(range(len(rows) + 1), [*(label for label, _, _ in rows), "road allows"])
    axis.set_ylim(len(rows) + 0.5, -0.5)
    axis.set_xlim(0.0, LONGEST_M)
    axis.set_xlabel(f"stopping distance from {onset.speed_m_s:.0f} m/s [m]")


def _interval(axis: Axes, y: int, plan: Plan) -> None:
    """The interval's two planned distances beside a bar, with an arrow where one lies beyond the axis."""
    start = 0.0 if plan.planned_stop_of_high_m is None else plan.planned_stop_of_high_m
    beyond = plan.planned_stop_of_low_m is None or plan.planned_stop_of_low_m > LONGEST_M
    end = LONGEST_M if beyond else float(plan.planned_stop_of_low_m or 0.0)
    axis.plot(
        [start, end], [y + 0.28] * 2, color=TRUTH, lw=1.4, marker="|", markevery=[0] if beyond else None
    )
    if beyond:
        axis.plot([LONGEST_M - 0.8], [y + 0.28], color=TRUTH, marker=">", ms=6)
    far = "no stop" if plan.planned_stop_of_low_m is None else f"{plan.planned_stop_of_low_m:.0f} m"
    text = f"{plan.stop_text} ({start:.0f} to {far})"
    axis.text(LONGEST_M - 1, y - 0.1, text, ha="right", va="center", fontsize=12)
