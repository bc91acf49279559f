"""Places in the car's equations where a further term may stand, and what it may depend on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.torque_gain import FRONT_LESS_REAR
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, WHEEL, Drive
from sim2real.observing.observer import Prediction, Push, Simulation
from trpac_core.vehicle import WHEELS

Array = NDArray[Any]


@dataclass(frozen=True)
class Equation:
    """A place for a further term: the push of a unit term on a drive, and the names that a reader knows it by."""

    key: str
    subsystem: str
    signal: str
    unit: str
    step: float
    """Size of the term for finite differences, in `unit`."""
    push: Callable[[Simulation, Drive, Prediction, Array], Push]
    quantities: tuple[str, ...]
    channel: int | None = None
    """Of a single sensor's equation: its channel."""


def _none(drive: Drive) -> dict[str, Array]:
    n = len(drive)
    return {"torque_nm": np.zeros((n, 4)), "accel_m_s2": np.zeros(n), "offset": np.zeros((n, len(CHANNELS)))}


def _torque(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "torque_nm": np.repeat(term[:, None], 4, axis=1)}, felt=False)


def _gain(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    """A share of the torque that the wheels get besides, or lack."""
    return Push(**{**_none(drive), "torque_nm": drive.torque_nm * term[:, None]}, felt=False)


def _motor(wheel: int, model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    none = _none(drive)
    none["torque_nm"][:, wheel] = term
    return Push(**none, felt=False)


def _between_axles(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    """A torque that the front wheels have and the rear wheels lack."""
    none = _none(drive)
    none["torque_nm"][:] = term[:, None] * FRONT_LESS_REAR
    return Push(**none, felt=False)


def _creep(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    """A slip that the tyre has beside its own: the wheel turns faster or slower at the same force."""
    none = _none(drive)
    none["offset"][:, WHEEL] = (term * seen.states[:, SPEED] / model.vehicle.wheel_radius_m)[:, None]
    return Push(**none, felt=False)


def _force(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "accel_m_s2": term / model.vehicle.mass_kg}, felt=True)


def _gravity(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "accel_m_s2": term}, felt=False)


def _tyre(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    extra = seen.force_n * term[:, None]
    return Push(
        **{
            **_none(drive),
            "torque_nm": -extra * model.vehicle.wheel_radius_m,
            "accel_m_s2": extra.sum(axis=1) / model.vehicle.mass_kg,
        },
        felt=True,
    )


def _sensor(columns: slice, model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    none = _none(drive)
    none["offset"][:, columns] = term[:, None]
    return Push(**none, felt=False)


def _one(column: int) -> slice:
    return slice(column, column + 1)


TORQUE_GAIN = "torque gain"

EQUATIONS = (
    Equation("torque", "powertrain", "wheel_torque", "N m", 5.0, _torque, ("torque", "acceleration", "time")),
    Equation(TORQUE_GAIN, "powertrain", "wheel_torque", "-", 0.02, _gain, ("power", "driven speed", "time")),
    Equation("bearing", "wheel", "wheel_torque", "N m", 5.0, _torque, ("speed",)),
    Equation("force", "vehicle", "accel_x", "N", 50.0, _force, ("speed", "acceleration", "time", "position")),
    Equation("gravity", "road", "vehicle_speed", "m/s^2", 0.05, _gravity, ("time", "position")),
    Equation("tyre", "tyre", "wheel_speed", "-", 0.02, _tyre, ("speed", "torque", "slip", "time", "position")),
    Equation("creep", "tyre", "wheel_speed", "-", 0.005, _creep, ("acceleration",)),
    Equation(
        "speed sensor", "vehicle_speed_sensor", "vehicle_speed", "m/s", 0.05,
        partial(_sensor, _one(SPEED)), ("speed", "acceleration", "time"), SPEED,
    ),
    Equation(
        "accelerometer", "accelerometer", "accel_x", "m/s^2", 0.05,
        partial(_sensor, _one(ACCEL)), ("speed", "acceleration", "time"), ACCEL,
    ),
    Equation(
        "wheel sensors", "wheel_speed_sensor", "wheel_speed", "rad/s", 0.1,
        partial(_sensor, WHEEL), ("speed", "acceleration", "time"),
    ),
    *(
        Equation(
            f"wheel sensor {name}", "wheel_speed_sensor", f"wheel_speed_{name}", "rad/s", 0.1,
            partial(_sensor, _one(WHEEL.start + i)), ("speed", "acceleration"), WHEEL.start + i,
        )
        for i, name in enumerate(WHEELS)
    ),
    *(
        Equation(
            f"motor {name}", "powertrain", f"wheel_torque_{name}", "N m", 5.0, partial(_motor, i), ("torque",)
        )
        for i, name in enumerate(WHEELS)
    ),
    Equation("axles", "powertrain", "wheel_torque", "N m", 5.0, _between_axles, ("torque",)),
)  # fmt: skip
"""Every equation of the car with the quantities that a term in it may depend on."""
WHOLE_CAR = tuple(e for e in EQUATIONS if not e.key.startswith(("motor ", "wheel sensor ", "axles")))
UNLIKE = tuple(e for e in EQUATIONS if e not in WHOLE_CAR)
"""Those of a single motor or wheel sensor, or of one axle against the other."""

QUANTITIES: dict[str, tuple[str, Callable[[Drive, Prediction], Array]]] = {
    "speed": ("m/s", lambda drive, seen: seen.states[:, SPEED]),
    "torque": ("N m", lambda drive, seen: drive.torque_nm.mean(axis=1)),
    "acceleration": ("m/s^2", lambda drive, seen: seen.force_n.sum(axis=1)),
    "slip": ("-", lambda drive, seen: np.sign(seen.force_n.sum(axis=1)) * seen.slip.mean(axis=1)),
    "power": ("W", lambda drive, seen: (drive.torque_nm * seen.states[:, WHEEL]).sum(axis=1)),
    "driven speed": ("m/s", lambda drive, seen: np.sign(drive.torque_nm.sum(axis=1)) * seen.states[:, SPEED]),
    "time": ("s", lambda drive, seen: drive.time_s),
    "position": ("m", lambda drive, seen: seen.states[:, 0]),
}
"""Unit and values of what a term may depend on; acceleration is the tyres' force, scaled by the mass later, and driven
speed is negative where the torque brakes."""
PER_DRIVE = ("time", "position")
"""Quantities whose curve is another one in each drive."""
OF_THE_MOTION = ("speed", "torque", "acceleration", "slip")
TWO_SIDED = ("power", "driven speed")
"""Quantities on the two sides of 0 of which, driving and braking, a curve need not be of one piece."""
