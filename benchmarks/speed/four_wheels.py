"""Time of a step of four wheels in Python, and of four single estimators beside it.

Both take turns, so that a busy machine slows both alike.
CPU time of this process, median over rounds [us].
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.four_wheels import CarSensors, FourWheels, FourWheelsConfig, SideClasses
from trpac_core.readings import Sensors
from trpac_core.vehicle import WHEELS
from trpac_core.vision.classes import Surface

STEP_S, STEPS, ROUNDS = 0.001, 2000, 9
FRAME_STEPS = 50
"""A class comes at 20 Hz, as from a camera."""
ICE, DRY = RoadClass(Surface.SNOW_ICE, 0.9), RoadClass(Surface.DRY, 0.9)
SPEED_M_S, RADIUS_M = 10.0, 0.29
ROLLING = SPEED_M_S / RADIUS_M
SITUATIONS = {
    "cruising": ((ROLLING,) * 4, (20.0,) * 4, 0.1),
    "sliding": ((ROLLING / 0.97,) * 4, (270.0,) * 4, 2.5),
    "split": ((ROLLING / 0.95, ROLLING / 0.99) * 2, (150.0, 270.0) * 2, 2.0),
}


def four_wheels(name: str) -> Callable[[], None]:
    """Steps of the four-wheel estimator."""
    omega, torque, accel = SITUATIONS[name]
    estimator, frame = FourWheels(FourWheelsConfig()), SideClasses(ICE, DRY)

    def work() -> None:
        for index in range(STEPS):
            sensors = CarSensors(omega, torque, SPEED_M_S, longitudinal_acceleration_m_s2=accel)
            estimator.step(STEP_S, sensors, frame if index % FRAME_STEPS == 0 else None)

    return work


def four_single(name: str) -> Callable[[], None]:
    """The same steps of four estimators that know nothing of each other."""
    omega, torque, accel = SITUATIONS[name]
    config = FourWheelsConfig(wheel=EstimatorConfig())
    wheels = [TrpacEstimator(config.of_wheel(wheel)) for wheel in WHEELS]

    def work() -> None:
        for index in range(STEPS):
            for i, wheel in enumerate(wheels):
                sensors = Sensors(omega[i], torque[i], SPEED_M_S, longitudinal_acceleration_m_s2=accel)
                wheel.step(STEP_S, sensors, (ICE, DRY)[i % 2] if index % FRAME_STEPS == 0 else None)

    return work


def medians_us(works: dict[str, Callable[[], None]]) -> dict[str, float]:
    """Median CPU time of a step of each [us]."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(ROUNDS + 1):
        for name, work in works.items():
            started = time.process_time()
            work()
            if turn:
                times[name].append((time.process_time() - started) / STEPS * 1e6)
    return {name: round(statistics.median(values), 1) for name, values in times.items()}


def measure() -> dict[str, Any]:
    """Cost of a step in all situations, and over that of four single ones."""
    cost = medians_us(
        {f"{name}_{work.__name__}": work(name) for name in SITUATIONS for work in (four_wheels, four_single)}
    )
    return {
        "what": "CPU time of a step of four wheels, classes at 20 Hz; medians over rounds [us]",
        "cost_us": cost,
        "over_four_single_steps": {
            name: round(cost[f"{name}_four_wheels"] / cost[f"{name}_four_single"], 2) for name in SITUATIONS
        },
    }
