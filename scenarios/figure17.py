"""Figure 17 of Tian et al. 2022, drawn from a run: seven panels over one time axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from scenarios.known import interval
from scenarios.metrics import estimators
from scenarios.plot_style import (
    BAND,
    BLUE,
    DASH_DOT,
    DASHED,
    GREEN,
    PLAIN,
    PURPLE,
    SHADE,
    SNOW,
    TRUTH,
    VERMILLION,
    WET,
    Style,
    estimator_styles,
)
from scenarios.plots import Figure, Panel, Series, Shade, png
from scenarios.runner import Run
from trpac_core.estimator_data import Method
from trpac_core.vehicle import WHEELS

ROAD = {"dry": SHADE, "wet": WET, "snow_ice": SNOW}
"""Ground of each surface."""
TORQUE = Style(VERMILLION, DASH_DOT, width=1.0)
SHORTEST_NAMED = 1.0 / 12.0
"""Share of the time below which a stretch is not named: there is no room [-]."""
NOT_DRIVEN = "the run ended before its first step."


def draw_figure17(run: Run, path: Path) -> None:
    """Write the figure as PNG: speed, slip, start/stop flag, visual flag, gain, estimates, errors."""
    noise = run.scenario.sensors
    title = (
        f"{run.scenario.name}, wheel {run.scenario.wheel}, seed {run.scenario.seed}, "
        f"C_x {run.scenario.vehicle.tyre.longitudinal_stiffness_n / 1e3:g} kN; noise: "
        f"{noise.vehicle_speed_noise_m_s:g} m/s, {noise.wheel_speed_noise_rad_s:g} rad/s, "
        f"{noise.wheel_torque_noise_nm:g} N m"
    )
    path.write_bytes(png(figure17(run), title, row_in=1.45))


def figure17(run: Run) -> Figure:
    """The seven panels."""
    table, method = run.table, Method.of(run.summary["method"])
    time = table["time_s"].to_numpy()
    panels = (*_motion(run, table, time), *_flags(table, time), *_estimates(table, time, method))
    return Figure(
        "Speed, slip, start/stop flag, visual flag, gain, estimates and errors over time",
        tuple(_on_the_road(panel, run, time, first=i == 0) for i, panel in enumerate(panels)),
    )


def _on_the_road(panel: Panel, run: Run, time: np.ndarray, *, first: bool) -> Panel:
    """The panel over the surfaces under the wheel; the first names surface and adhesion of each stretch."""
    shades = []
    for index, rows in run.table.groupby("segment"):
        here, surface = time[rows.index.to_numpy()], run.scenario.road.segments[int(str(index))].surface
        named = first and here[-1] - here[0] >= SHORTEST_NAMED * (time[-1] - time[0])
        text = f"{surface.replace('_', ' or ')}\n{rows['theta_true'].iloc[0]:g}" if named else ""
        shades.append(Shade(float(here[0]), float(here[-1]), ROAD[surface], text))
    ends = (float(time[0]), float(time[-1]))
    return Panel(**{**vars(panel), "shades": tuple(shades), "x_limits": ends})


def _motion(run: Run, table: pd.DataFrame, time: np.ndarray) -> tuple[Panel, Panel]:
    wheel = WHEELS.index(run.scenario.wheel)
    speed = Panel(
        "(a) speed [m/s]",
        NOT_DRIVEN,
        (
            Series("speed", time, run.trajectory.speed_m_s, PLAIN),
            Series("wheel torque", time, run.trajectory.wheel_torque_nm[:, wheel], TORQUE, right=True),
        ),
        right_label="torque [N m]",
        y_limits=(0.0, 1.5 * max(float(run.trajectory.speed_m_s.max()), 1.0)),
        height=1.1,
    )
    slip = Panel(
        "(b) slip [-]",
        NOT_DRIVEN,
        (
            Series("true", time, run.trajectory.slip[:, wheel], TRUTH),
            Series("in the unit", time, table["slip"].to_numpy(), Style(BLUE, width=1.2)),
            Series("threshold", time, table["excitation_threshold"].to_numpy(), Style(PURPLE, DASHED)),
        ),
        y_limits=(0.0, max(0.03, 1.2 * float(table["slip"].max()))),
        height=1.3,
    )
    return speed, slip


def _flags(table: pd.DataFrame, time: np.ndarray) -> tuple[Panel, Panel, Panel]:
    none, excited, flag = np.zeros(len(time)), table["excitation_flag"], table["flag"]
    q_v = table["image_confidence"].to_numpy()
    on_off = {0.0: "0", 1.0: "1"}
    start_stop = Panel(
        "(c) start/stop flag",
        "the slip stayed below the threshold: the estimator never ran.",
        (
            Series(
                "",
                time,
                np.where(excited.any(), excited.to_numpy(float), np.nan),
                Style(GREEN),
                "step",
                low=none,
            ),
        ),
        y_limits=(-0.05, 1.1),
        ticks=on_off,
        height=0.5,
    )
    seen = bool(flag.any() or q_v.any())
    visual = Panel(
        "(d) visual flag, Q_v",
        "no picture gave a class of the road under the wheel.",
        (
            Series(
                "visual flag", time, np.where(seen, flag.to_numpy(float), np.nan), Style(PURPLE), "step", none
            ),
            Series("Q_v", time, np.where(seen, q_v, np.nan), PLAIN),
        ),
        y_limits=(-0.05, 1.1),
        ticks=on_off,
        height=0.6,
    )
    gain = Panel(
        "(e) visual gain K_v",
        "the camera's class is not used, so there is no gain.",
        (Series("", time, np.where(table["K_v"].any(), table["K_v"], np.nan), PLAIN),),
        height=0.8,
    )
    return start_stop, visual, gain


def _estimates(table: pd.DataFrame, time: np.ndarray, method: Method) -> tuple[Panel, Panel]:
    columns = estimators(method)
    styles, truth = estimator_styles(list(columns)), table["theta_true"].to_numpy()
    said = (table[name].to_numpy() for name in ("TRPAC", "TRPAC_std", "TRPAC_low", "TRPAC_high"))
    low, high = interval(method, *said)
    band = "95 % interval" if method is Method.ROBUST else f"{method.title} ± 2 TRPAC_std"
    edges = np.array([time[0], time[-1]])
    estimates = Panel(
        "(f) TRPAC [-]",
        NOT_DRIVEN,
        (
            Series(band, time, high, Style(BAND), low=low),
            Series("true TRPAC", time, truth, TRUTH, "step"),
            *(Series(name, time, table[column].to_numpy(), styles[name]) for name, column in columns.items()),
        ),
        y_limits=(0.0, 1.1),
        height=2.2,
    )
    errors = Panel(
        "(g) error [-]",
        NOT_DRIVEN,
        (
            Series("± 0.02", edges, np.full(2, 0.02), Style(SHADE), low=np.full(2, -0.02)),
            *(
                Series(name, time, table[column].to_numpy() - truth, styles[name])
                for name, column in columns.items()
            ),
        ),
        y_limits=(-0.45, 0.6),
        height=1.6,
    )
    return estimates, errors
