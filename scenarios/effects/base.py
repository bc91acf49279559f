"""Base of the effects: deviations from the nominal plant that vehicle.yaml switches on by their ids.

An effect is a frozen dataclass in a file of its own. Its fields are its parameters, made with `parameter`; it
overrides the hooks of the stages that it acts in. With neutral values every hook reproduces the plant without the
effect bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.frames import Frames
from scenarios.plant.parameters import DynamicsParameters, PerWheel, RoadTable
from trpac_core.vehicle import Vehicle

Array = NDArray[np.float64]
Signals = dict[str, Array]

Stage = Literal["actuators", "dynamics", "road", "sensors", "perception"]
Subsystem = Literal[
    "powertrain",
    "wheel",
    "tyre",
    "vehicle",
    "road",
    "wheel_speed_sensor",
    "vehicle_speed_sensor",
    "accelerometer",
    "camera",
]

Value = float | Callable[["Vehicle"], float]
"""A number, or a function of the vehicle."""

Values = tuple[float, ...] | Callable[["Vehicle"], tuple[float, ...]]
"""Numbers, or a function of the vehicle."""

SHARE_OF_MEAN = "relative deviation from the mean"
"""Meaning of the parameters that give each axle or wheel its own value."""

LEAST_OFF = 0.25
"""Least offset of each wheel over the mean offset of the four, for `all_are_off` [-]."""


@dataclass(frozen=True)
class Parameter:
    """The description of an effect's parameter."""

    name: str
    unit: str
    meaning: str
    neutral: Value
    low: Value
    high: Value
    starts: Values
    open_share: float = 0.0

    def neutral_value(self, vehicle: Vehicle) -> float:
        """The value at which the effect vanishes on this vehicle, in `unit`."""
        return _on(vehicle, self.neutral)

    def bounds(self, vehicle: Vehicle) -> tuple[float, float]:
        """The least and the greatest value that is accepted on this vehicle, in `unit`."""
        return _on(vehicle, self.low), _on(vehicle, self.high)

    def start_values(self, vehicle: Vehicle) -> tuple[float, ...]:
        """Start values of a fit, in `unit`, which cover the plausible range of real cars."""
        return self.starts(vehicle) if callable(self.starts) else self.starts


def _on(vehicle: Vehicle, value: Value) -> float:
    return value(vehicle) if callable(value) else value


def parameter(
    unit: str,
    meaning: str,
    *,
    neutral: Value,
    low: Value,
    high: Value,
    starts: Values = (),
    open_share: float = 0.0,
) -> Any:
    """Declare one effect parameter; values outside [low, high] are refused, fits begin at `starts`.

    `open_share` is the relative error that no log can show, because only the product of the value with an assumed
    constant is identifiable [-]; infinite: only the bounds are known.
    """
    about = {"unit": unit, "meaning": meaning, "neutral": neutral, "low": low, "high": high, "starts": starts}
    return field(metadata=about | {"open_share": open_share})


def share_of_axles(start: float, most: float) -> Any:
    """Declare the parameter `unlike` of `of_each_wheel`, beside a parameter that is the mean of all wheels."""
    return _share_of_mean("front axle more, rear axle less", start, most)


def share_of_sides(axle: str, start: float, most: float) -> Any:
    """Declare the parameter `front_sides` or `rear_sides` of `of_each_wheel`, for the axle "front" or "rear"."""
    return _share_of_mean(f"{axle} left wheel more, {axle} right wheel less", start, most)


def of_each_wheel(
    mean: float, unlike: float = 0.0, front_sides: float = 0.0, rear_sides: float = 0.0
) -> PerWheel:
    """The values of the wheels fl, fr, rl, rr, in the unit of their mean.

    Parameters
    ----------
    mean : float
        Mean of the four wheels.
    unlike : float
        Share of the mean that the front wheels have more and the rear wheels less [-].
    front_sides, rear_sides : float
        Share of the mean that the left wheel of an axle has more and the right one less [-].
    """
    front, rear = mean + mean * unlike, mean - mean * unlike
    front_side, rear_side = mean * front_sides, mean * rear_sides
    return front + front_side, front - front_side, rear + rear_side, rear - rear_side


def mean_of_wheels(values: PerWheel) -> float:
    """Mean of the four wheels in the unit of `values`; summed in pairs, it is exact where all wheels are alike."""
    fl, fr, rl, rr = values
    return 0.25 * ((fl + fr) + (rl + rr))


def all_are_off(values: PerWheel, nominal: float) -> bool:
    """Whether each wheel is off in the direction of the mean offset, by `LEAST_OFF` of it or more."""
    off = np.array(values) - nominal
    return bool(np.all(off * np.sign(off.mean()) >= LEAST_OFF * abs(off.mean())))


def _share_of_mean(what: str, start: float, most: float) -> Any:
    return parameter(
        "-", f"{SHARE_OF_MEAN}: {what}", neutral=0.0, low=-most, high=most, starts=(-start, start)
    )


@dataclass(frozen=True)
class Effect:
    """Base of all effects: describes itself and leaves every stage as it is."""

    id: ClassVar[str]
    form: ClassVar[str] = ""
    """Which of several forms of the effect this is; empty where there is one."""
    structural: ClassVar[bool] = False
    """Whether it is a difference between models and no fault or setting: a diagnosis never names it as a cause."""
    of_wheels: ClassVar[bool] = False
    """Whether each wheel has its own value: the mean, `share_of_axles`, and `share_of_sides` of both axles."""
    stage: ClassVar[Stage]
    subsystem: ClassVar[Subsystem]
    equation: ClassVar[str]
    source: ClassVar[str]
    excited_by: ClassVar[str]
    confounders: ClassVar[tuple[str, ...]]

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The effect's parameters, in the order of its fields."""
        return tuple(Parameter(f.name, **f.metadata) for f in fields(cls))

    @classmethod
    def neutral(cls, vehicle: Vehicle) -> Effect:
        """The effect with all parameters at their neutral values for this vehicle."""
        return cls(**{p.name: p.neutral_value(vehicle) for p in cls.parameters()})

    def per_wheel(self, mean: float) -> PerWheel:
        """Values of the wheels fl, fr, rl, rr, by those shares of `of_each_wheel` that this form has as parameters."""
        shares = {"unlike", "front_sides", "rear_sides"} & {f.name for f in fields(self)}
        return of_each_wheel(mean, **{name: getattr(self, name) for name in shares})

    def is_itself(self, vehicle: Vehicle) -> bool:
        """Whether these values differ from those of an effect with fewer parameters."""
        return True

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Actuators: the torque at the wheels for a commanded one, both shape (n, 4), at uniform times [N m]."""
        return torque_nm

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Dynamics: the compiled step's parameters with this effect in them."""
        return parameters

    def road(self, table: RoadTable) -> RoadTable:
        """Road: the friction under the left and right wheels with this effect in it."""
        return table

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """Sensors: the log's columns, shape (n,) each, as the sensor reports them."""
        return signals

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """Inverse of `sense`: readings of an ideal sensor; NaN where they are not known."""
        return signals

    def perceive(self, frames: Frames) -> Frames:
        """Perception: the frames of the camera chain with this effect in them."""
        return frames
