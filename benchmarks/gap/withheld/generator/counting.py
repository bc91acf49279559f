"""Wheel speeds as they are counted from pulses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .details import USUAL_RAD_S
from .kernel import RECORD_STEP_S

if TYPE_CHECKING:
    from .sensor_set import Sensors

Array = NDArray[np.floating[Any]]

SHAKE_HZ = 12.7
"""Of a wheel that hops on its tyre."""


def count(
    record: Array, angle: Array, sensors: Sensors, time_s: Array, rng: Generator, shared: float
) -> Array:
    """Speed from the pulses of each finished window [rad/s]; a wheel that was rolling before the record began."""
    teeth, window = sensors.wheel_teeth, sensors.wheel_window_s
    phase, first = rng.uniform(0.0, 1.0), rng.uniform(0.0, window)
    if sensors.wheel_window_shared:
        first = shared * window
    every = window / sensors.wheel_window_parts
    ends = time_s if sensors.wheel_window_runs else np.floor((time_s - first) / every) * every + first
    begins = ends - window
    if sensors.wheel_window_jitter > 0.0:
        sooner = -sensors.wheel_window_jitter * window * rng.uniform(size=int(record[-1] / window) + 4)
        number = np.round((ends - first) / window).astype(int) + 2
        begins, ends = begins + sooner[number - 1], ends + sooner[number]
    scatter = sensors.wheel_scatter * rng.standard_normal(int(teeth)) if sensors.wheel_scatter > 0.0 else None
    before = np.gradient(angle[:3], RECORD_STEP_S)[0]

    def pulses(at: Array) -> Array:
        turned = np.interp(at, record, angle) + before * np.minimum(at, 0.0)
        passed = turned * teeth / (2.0 * np.pi) + phase
        if sensors.wheel_uneven > 0.0:
            passed = passed + sensors.wheel_uneven * np.sin(turned + 2.0 * np.pi * phase)
        if sensors.wheel_shakes > 0.0:
            passed = passed + sensors.wheel_shakes * np.sin(2.0 * np.pi * (SHAKE_HZ * at + phase))
        if sensors.wheel_flanks > 0.0:
            return np.floor(0.5 * passed) + np.floor(0.5 * (passed - 1.0 - sensors.wheel_flanks)) + 1.0
        if scatter is not None:
            tooth = np.floor(passed)
            return tooth + (passed - tooth > 0.5 + scatter[tooth.astype(int) % scatter.size])
        return np.floor(passed)

    counted = pulses(ends) - pulses(begins)
    if sensors.wheel_window_slow > 0.0:
        least = sensors.wheel_window_slow * USUAL_RAD_S * teeth * window / (2.0 * np.pi)
        counted = np.where(counted < least, 0.5 * (pulses(ends) - pulses(begins - window)), counted)
    if sensors.wheel_halves_rad_s > 0.0:
        most = sensors.wheel_halves_rad_s * teeth * window / (2.0 * np.pi)
        halves = np.floor(0.5 * pulses(ends)) - np.floor(0.5 * pulses(begins))
        counted = np.where(counted > most, 2.0 * halves, counted)
    return counted * 2.0 * np.pi / (teeth * window)
