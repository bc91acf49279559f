"""The figure of a drive on split friction: estimates of each wheel and of the car."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from scenarios.plot_style import BLUE, ESTIMATOR_STYLES, LINE, MATPLOTLIB, PLAIN, TRUTH

PANELS = (("fl", "front left"), ("fr", "front right"), ("rl", "rear left"), ("rr", "rear right"))


def draw_split(table: pd.DataFrame, path: Path) -> None:
    """Write the figure: a panel per wheel, then the car, then the speed."""
    time = table["time_s"].to_numpy()
    with plt.rc_context(MATPLOTLIB):
        figure, axes = plt.subplot_mosaic(
            [["fl", "fr"], ["rl", "rr"], ["vehicle", "vehicle"], ["speed", "speed"]],
            figsize=(10.0, 9.5),
            height_ratios=[2.0, 2.0, 2.0, 0.9],
            sharex=True,
        )
        for wheel, title in PANELS:
            _estimates(axes[wheel], table, time, wheel)
            axes[wheel].set_title(title)
        _estimates(axes["vehicle"], table, time, "vehicle")
        axes["vehicle"].set_title("car: what braking can use")
        handles, labels = axes["fl"].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", ncols=len(labels), frameon=False)
        axes["speed"].plot(time, table["speed_m_s"], **PLAIN.matplotlib)
        axes["speed"].set_ylabel("speed [m/s]")
        axes["speed"].set_xlabel("time [s]")
        axes["speed"].set_xlim(time[0], time[-1])
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.97))
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=120)
        plt.close(figure)


def _estimates(axis: Axes, table: pd.DataFrame, time: np.ndarray, suffix: str) -> None:
    theta, deviation = table[f"TRPAC.{suffix}"].to_numpy(), table[f"TRPAC_std.{suffix}"].to_numpy()
    if f"excitation_flag.{suffix}" in table:
        excited = table[f"excitation_flag.{suffix}"].to_numpy() > 0.5
        axis.fill_between(
            time, 0.0, 1.2, where=excited, color=LINE.light, linewidth=0.0, label="tyre excited", step="mid"
        )
        seen = np.where(table[f"flag.{suffix}"] > 0.5, table[f"TRPAC_image.{suffix}"], np.nan)
        axis.plot(time, seen, **ESTIMATOR_STYLES["IFE"].matplotlib, label="camera's class")
    axis.fill_between(
        time,
        theta - 2.0 * deviation,
        theta + 2.0 * deviation,
        color=BLUE.light,
        alpha=0.15,
        linewidth=0.0,
        label="±2 TRPAC_std",
    )
    axis.plot(time, table[f"theta.{suffix}"], **TRUTH.matplotlib, label="true")
    axis.plot(time, theta, **ESTIMATOR_STYLES["robust"].matplotlib, label="TRPAC")
    axis.set_ylim(0.0, 1.2)
    axis.set_ylabel("theta [-]")
