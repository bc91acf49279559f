"""What an effect is: a deviation from the nominal plant that vehicle.yaml may switch on by its id.

An effect is a frozen dataclass in a file of its own. Its fields are its parameters, made with `parameter`; it
overrides the hooks of the stages that it acts in. With neutral values every hook reproduces the plant without the
effect bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scenarios.plant.dynamics import DynamicsParameters
    from trpac_core.vehicle import Vehicle

Neutral = float | Callable[["Vehicle"], float]
"""A neutral value: a number, or what it is for a given vehicle."""


@dataclass(frozen=True)
class Parameter:
    """What is known of one effect parameter beside its value."""

    name: str
    unit: str
    meaning: str
    neutral: Neutral
    low: float
    high: float

    def neutral_value(self, vehicle: Vehicle) -> float:
        """The value at which the effect vanishes on this vehicle, in `unit`."""
        return self.neutral(vehicle) if callable(self.neutral) else self.neutral


def parameter(unit: str, meaning: str, *, neutral: Neutral, low: float, high: float) -> Any:
    """Declare one effect parameter; values outside [low, high] are refused."""
    return field(metadata={"unit": unit, "meaning": meaning, "neutral": neutral, "low": low, "high": high})


@dataclass(frozen=True)
class Effect:
    """Base of all effects: describes itself and leaves every stage as it is."""

    id: ClassVar[str]
    equation: ClassVar[str]
    source: ClassVar[str]
    excited_by: ClassVar[str]
    look_alikes: ClassVar[tuple[str, ...]]

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The effect's parameters, in the order of its fields."""
        return tuple(Parameter(f.name, **f.metadata) for f in fields(cls))

    @classmethod
    def neutral(cls, vehicle: Vehicle) -> Effect:
        """The effect with all parameters at their neutral values for this vehicle."""
        return cls(**{p.name: p.neutral_value(vehicle) for p in cls.parameters()})

    def actuate(self, time_s: NDArray[np.float64], torque_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Actuators: the torque at the wheels for a commanded one, both shape (n, 4) [N m]."""
        return torque_nm

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Dynamics: the compiled step's parameters with this effect in them."""
        return parameters

    def sense(
        self, time_s: NDArray[np.float64], signals: dict[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Sensors: the log's columns, shape (n,) each, as the sensor reports them."""
        return signals
