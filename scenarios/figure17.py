"""Figure 17 of Tian et al. 2022, drawn from a run: seven panels over one time axis."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from scenarios.metrics import ESTIMATORS
from scenarios.runner import Run
from trpac_core.vehicle import WHEELS

COLOURS = {"IFE": "#d08a00", "DE": "#7fb2e5", "DIFE": "#c0272d"}
WIDTHS = {"IFE": 1.1, "DE": 3.0, "DIFE": 1.3}
"""Line widths; DE is a band under DIFE, so that both are visible where they agree."""
TRUTH = "#222222"
ROAD = {"dry": "#eeeeea", "wet": "#d3e0ec", "snow_ice": "#f2f6fb"}


def draw_figure17(run: Run, path: Path) -> None:
    """Write the figure: speed, slip, start/stop flag, visual flag, gain, estimates, errors."""
    table = run.table
    time = table["time_s"].to_numpy()
    with plt.rc_context({"font.size": 9, "axes.grid": True, "grid.alpha": 0.35, "axes.axisbelow": True}):
        figure, axes = plt.subplots(
            7, 1, figsize=(9.5, 14.0), sharex=True, height_ratios=[1.2, 1.5, 0.6, 0.6, 1.0, 2.6, 1.8]
        )
        for axis in axes:
            _shade_road(axis, run, time)
        _motion(axes[0], axes[1], run, table, time)
        _flags(axes[2], axes[3], axes[4], table, time)
        _estimates(axes[5], table, time)
        _errors(axes[6], table, time)
        axes[6].set_xlabel("time [s]")
        axes[0].set_xlim(time[0], time[-1])
        noise = run.scenario.sensors
        axes[0].set_title(
            f"{run.scenario.name}, wheel {run.scenario.wheel}, seed {run.scenario.seed}, "
            f"C_x {run.scenario.vehicle.tyre.longitudinal_stiffness_n / 1e3:g} kN; noise: "
            f"{noise.vehicle_speed_noise_m_s:g} m/s, {noise.wheel_speed_noise_rad_s:g} rad/s, "
            f"{noise.wheel_torque_noise_nm:g} N m",
            fontsize=9,
            parse_math=False,  # the name is the file's, and a $ in it is a $
        )
        figure.align_ylabels(axes)
        figure.tight_layout(h_pad=0.4)
        figure.savefig(path, dpi=130)
        plt.close(figure)


def _shade_road(axis: Axes, run: Run, time: np.ndarray) -> None:
    """Colour the background by the surface under the wheel."""
    segment = run.table["segment"].to_numpy()
    for index in np.unique(segment):
        here = time[segment == index]
        surface = run.scenario.road.segments[index].surface
        axis.axvspan(here[0], here[-1], color=ROAD[surface], lw=0, zorder=-10)


def _motion(speed: Axes, slip: Axes, run: Run, table: pd.DataFrame, time: np.ndarray) -> None:
    speed.plot(time, run.trajectory.speed_m_s, color=TRUTH, lw=1.4)
    speed.set_ylabel("(a) speed\n[m/s]")
    torque = speed.twinx()
    wheel = WHEELS.index(run.scenario.wheel)
    torque.plot(time, run.trajectory.wheel_torque_nm[:, wheel], color="#999999", lw=0.8)
    torque.set_ylabel("torque [N m]", color="#777777")
    torque.grid(visible=False)
    slip.plot(time, run.trajectory.slip[:, wheel], color="#999999", lw=1.2, label="true")
    slip.plot(time, table["slip"], color=TRUTH, lw=0.8, label="in the unit")
    slip.plot(time, table["excitation_threshold"], color="#2c9c5a", lw=1.0, ls="--", label="threshold")
    slip.set_ylim(0.0, max(0.03, 1.2 * float(table["slip"].max())))
    slip.set_ylabel("(b) slip [-]")
    slip.legend(loc="upper left", ncols=3, fontsize=8)


def _flags(start_stop: Axes, visual: Axes, gain: Axes, table: pd.DataFrame, time: np.ndarray) -> None:
    start_stop.fill_between(time, table["excitation_flag"].astype(float), step="post", color="#2c9c5a", lw=0)
    start_stop.set_ylabel("(c) start/\nstop")
    visual.fill_between(time, table["flag"].astype(float), step="post", color=COLOURS["IFE"], lw=0)
    visual.plot(time, table["image_confidence"], color=TRUTH, lw=0.7)
    visual.set_ylabel("(d) visual\nflag, Q_v")
    for axis in (start_stop, visual):
        axis.set_ylim(-0.05, 1.1)
        axis.set_yticks([0, 1])
    gain.plot(time, table["K_v"], color=COLOURS["DIFE"], lw=1.2)
    gain.set_ylim(bottom=-0.05)
    gain.set_ylabel("(e) gain\n$K_v$")


def _estimates(axis: Axes, table: pd.DataFrame, time: np.ndarray) -> None:
    axis.plot(time, table["theta_true"], color=TRUTH, lw=2.2, label="true TRPAC")
    for name, column in ESTIMATORS.items():
        axis.plot(time, table[column], color=COLOURS[name], lw=WIDTHS[name], label=name)
    two_std = 2.0 * table["TRPAC_std"]
    axis.fill_between(
        time,
        table["TRPAC"] - two_std,
        table["TRPAC"] + two_std,
        color=COLOURS["DIFE"],
        alpha=0.10,
        lw=0,
        label="DIFE ± 2 TRPAC_std",
    )
    axis.set_ylim(0.0, 1.1)
    axis.set_ylabel("(f) TRPAC [-]")
    axis.legend(loc="lower left", ncols=5, fontsize=8)
    for start, end, text in _stretches(table, time):
        axis.text(0.5 * (start + end), 1.03, text, ha="center", va="bottom", fontsize=8)


def _stretches(table: pd.DataFrame, time: np.ndarray) -> list[tuple[float, float, str]]:
    """Begin, end and true adhesion of each stretch of road."""
    stretches = []
    for _, rows in table.groupby("segment"):
        here = time[rows.index.to_numpy()]
        stretches.append((float(here[0]), float(here[-1]), f"{rows['theta_true'].iloc[0]:g}"))
    return stretches


def _errors(axis: Axes, table: pd.DataFrame, time: np.ndarray) -> None:
    for name, column in ESTIMATORS.items():
        error = table[column] - table["theta_true"]
        axis.plot(time, error, color=COLOURS[name], lw=WIDTHS[name], label=name)
    axis.axhspan(-0.02, 0.02, color=TRUTH, alpha=0.12, lw=0, label="± 0.02")
    axis.set_ylim(-0.45, 0.6)
    axis.set_ylabel("(g) error [-]")
    axis.legend(loc="upper left", ncols=4, fontsize=8)
