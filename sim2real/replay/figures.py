"""The pictures of a replay, each as the bytes of a PNG file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from sim2real.replay.run import DYNAMICS, Replay
from sim2real.reporting.figures import AFTER, BEFORE, DPI, FLOOR, MEASURED, STYLE, WIDTH_IN
from trpac_core.estimator_data import Method
from trpac_core.tyre import INITIAL_SLOPE
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

WHEEL_COLOURS = (AFTER, "#7a5195", BEFORE, "#7f8c3a")
PEER_COLOURS = ("#7f8c3a", "#7a5195", BEFORE)
BAND = "#bfdde3"
TOP_THETA = 1.25
"""Upper end of the axes of theta [-]."""


@contextmanager
def _sheet(rows: int, height_in: float, ratios: tuple[float, ...]) -> Iterator[tuple[list[Axes], BytesIO]]:
    """Panels over one time axis, and the buffer that holds their PNG afterwards."""
    buffer = BytesIO()
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            rows,
            1,
            figsize=(WIDTH_IN, height_in),
            squeeze=False,
            sharex=True,
            layout="constrained",
            height_ratios=ratios,
        )
        try:
            yield list(axes[:, 0]), buffer
            axes[-1, 0].set_xlabel("time [s]")
            figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
        finally:
            plt.close(figure)


def estimate(done: Replay) -> bytes:
    """The car's estimate with its band and reference, the flags, and what the drive was like."""
    time_s = done.inputs.time_s
    theta, std, peak = done.ours.of_the_car
    share = peak / theta
    if done.method is Method.ROBUST:
        low, high, band = done.of_the_car["TRPAC_low"], done.of_the_car["TRPAC_high"], "95 % interval"
    else:
        low, high, band = theta - 2 * std, theta + 2 * std, "within 2 TRPAC_std"
    with _sheet(4, 6.6, (2.6, 0.5, 1.0, 1.0)) as (axes, buffer):
        top, flags, speed, torque = axes
        top.fill_between(
            time_s,
            share * low,
            share * high,
            color=BAND,
            lw=0,
            label=band,
        )
        top.plot(time_s, peak, color=AFTER, lw=1.6, label=f"TRPAC_peak ({done.method.title})")
        if done.camera.left or done.camera.right:
            top.plot(
                time_s,
                done.traces[DYNAMICS].of_the_car[2],
                color=BEFORE,
                lw=1.0,
                label="without camera (DE)",
            )
        if done.inputs.mu_reference is not None:
            top.plot(
                time_s, done.inputs.mu_reference, color=MEASURED, lw=1.2, ls=(0, (4, 3)), label="mu_reference"
            )
        top.set_ylim(0.0, TOP_THETA)
        top.set_ylabel("peak friction [-]")
        top.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8)
        _flags(flags, done)
        speed.plot(time_s, done.inputs.speed_m_s, color=MEASURED, lw=1.2)
        speed.set_ylabel("speed [m/s]")
        for i, wheel in enumerate(WHEELS):
            torque.plot(
                time_s, done.inputs.wheel_torque_nm[:, i], color=WHEEL_COLOURS[i], lw=0.9, label=wheel
            )
        torque.set_ylabel("torque [N m]")
        torque.legend(loc="upper right", fontsize=8, ncols=4)
        top.set_xlim(time_s[0], time_s[-1])
    return buffer.getvalue()


def _flags(axis: Axes, done: Replay) -> None:
    """Strips: slip above the threshold, tyre seen, camera used."""
    strips = (
        ("camera used", done.flag.any(axis=1), BEFORE),
        ("tyre seen", done.seen.any(axis=1), AFTER),
        ("excited", done.ours.excited.any(axis=1), FLOOR),
    )
    for height, (_, rows, colour) in enumerate(strips):
        axis.fill_between(
            done.inputs.time_s,
            height + 0.15,
            height + 0.85,
            where=rows.tolist(),
            color=colour,
            lw=0,
            step="post",
        )
    axis.set_yticks([0.5, 1.5, 2.5], [name for name, _, _ in strips])
    axis.set_ylim(0.0, 3.0)
    axis.grid(visible=False)
    axis.tick_params(axis="y", length=0)


def wheels(done: Replay) -> bytes:
    """Estimates, slip and used friction wheel by wheel."""
    time_s = done.inputs.time_s
    with _sheet(3, 5.6, (1.4, 1.0, 1.0)) as (axes, buffer):
        panels = (
            (axes[0], done.ours.peak, "TRPAC_peak [-]", (0.0, TOP_THETA)),
            (axes[1], done.slip, "slip [-]", (0.0, _largest(done.slip))),
            (axes[2], done.used_friction, "used friction [-]", (0.0, min(_largest(done.used_friction), 1.5))),
        )
        for axis, values, label, limits in panels:
            for i, wheel in enumerate(WHEELS):
                shown = np.where(done.usable[:, i], values[:, i], np.nan)
                axis.plot(time_s, shown, color=WHEEL_COLOURS[i], lw=0.9, label=wheel)
            axis.set_ylabel(label)
            axis.set_ylim(*limits)
        if done.inputs.mu_reference is not None:
            axes[0].plot(
                time_s, done.inputs.mu_reference, color=MEASURED, lw=1.2, ls=(0, (4, 3)), label="mu_reference"
            )
        axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=8)
        axes[0].set_xlim(time_s[0], time_s[-1])
    return buffer.getvalue()


def curve(done: Replay) -> bytes:
    """Used friction over slip where the car drove: the tyre as the log shows it."""
    buffer = BytesIO()
    rows = done.usable & done.inputs.moving[:, None]
    with plt.rc_context(STYLE):
        figure, axis = plt.subplots(figsize=(WIDTH_IN * 0.6, 3.2), layout="constrained")
        for i, wheel in enumerate(WHEELS):
            axis.plot(
                done.slip[rows[:, i], i],
                done.used_friction[rows[:, i], i],
                ".",
                ms=1.5,
                color=WHEEL_COLOURS[i],
                alpha=0.5,
                label=wheel,
            )
        most_slip, most_friction = _largest(done.slip[rows]), min(_largest(done.used_friction[rows]), 1.5)
        # The load is the wheels' mean: the line is to be held beside the points, not through them.
        load_n = float(np.nanmean(done.ours.load_n[rows]))
        told = INITIAL_SLOPE * done.inputs.vehicle.longitudinal_stiffness_n / load_n
        end = min(most_slip, most_friction / told)
        axis.plot(
            [0.0, end], [0.0, told * end], color=MEASURED, lw=1.0, ls=(0, (4, 3)), label="1.27 C_x / F_z"
        )
        axis.set_xlim(0.0, most_slip)
        axis.set_ylim(0.0, most_friction)
        axis.set_xlabel("slip [-]")
        axis.set_ylabel("used friction [-]")
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, ncols=5, markerscale=6)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
        plt.close(figure)
    return buffer.getvalue()


def compared(done: Replay) -> bytes:
    """The car's estimate beside those of the peers."""
    time_s = done.inputs.time_s
    others = [name for name in done.traces if name not in (done.method.title, DYNAMICS)]
    with _sheet(1, 3.2, (1.0,)) as (axes, buffer):
        axis = axes[0]
        for name, colour in zip(others, PEER_COLOURS, strict=True):
            axis.plot(time_s, done.traces[name].of_the_car[2], color=colour, lw=0.9, label=name)
        axis.plot(time_s, done.traces[DYNAMICS].of_the_car[2], color=FLOOR, lw=1.0, label=DYNAMICS)
        axis.plot(time_s, done.ours.of_the_car[2], color=AFTER, lw=1.6, label=done.method.title)
        if done.inputs.mu_reference is not None:
            axis.plot(
                time_s, done.inputs.mu_reference, color=MEASURED, lw=1.2, ls=(0, (4, 3)), label="mu_reference"
            )
        axis.set_ylim(0.0, TOP_THETA)
        axis.set_xlim(time_s[0], time_s[-1])
        axis.set_ylabel("TRPAC_peak [-]")
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=6, fontsize=8)
    return buffer.getvalue()


def _largest(values: Array) -> float:
    """Upper end of an axis: all but the largest half per cent, with some room."""
    known = values[np.isfinite(values)]
    return max(1.1 * float(np.quantile(known, 0.995)), 1e-3) if len(known) else 1.0
