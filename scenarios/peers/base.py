"""The common part of the peers: interface, settings and treatment of the sensors.

A peer is a friction estimator from the literature on the same inputs as ours, step for step. It has no camera, so its
counterpart is the dynamics estimator DE.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

from trpac_core.sensors import GREATEST_ACCELERATION_M_S2, Sensors, filter_share, unusable
from trpac_core.vehicle import Vehicle

UNKNOWN = 0.33
"""Standard deviation of an unknown theta: anywhere between 0.05 and 1.2 [-]."""
ROAD_CHANGE = 0.05
"""Random walk of theta per root of distance without excitation [1/sqrt(m)]."""


@dataclass(frozen=True, slots=True)
class PeerEstimate:
    """The estimate of a peer at a step.

    Attributes
    ----------
    TRPAC, TRPAC_std : float
        Estimate of theta and its standard deviation [-].
    excited : bool
        Whether the peer takes theta to be identifiable now.
    """

    TRPAC: float
    TRPAC_std: float
    excited: bool


@runtime_checkable
class Peer(Protocol):
    """An estimator of the literature, on one wheel."""

    @property
    def name(self) -> str:
        """Name in tables."""

    def reset(self) -> None:
        """Reset the state."""

    def step(self, step_s: float, sensors: Sensors) -> PeerEstimate:
        """The estimate after one step with the readings at its start; unusable readings hold it."""


@dataclass(frozen=True)
class PeerSetup:
    """Settings of a peer on a wheel, equal to those of our estimator.

    Attributes
    ----------
    vehicle : Vehicle
        The car.
    front_axle : bool
        Whether the wheel is a front wheel.
    wheel_speed_noise_rad_s, vehicle_speed_noise_m_s, wheel_torque_noise_nm : float
        Standard deviations of the sensors' white noise per sample; the defaults are the paper simulation's.
    theta_initial : float
        Estimate at the start [-].
    floor_m_s : float
        Speed below which slip is not used [m/s].
    """

    vehicle: Vehicle = field(default_factory=Vehicle)
    front_axle: bool = True
    wheel_speed_noise_rad_s: float = 0.01
    vehicle_speed_noise_m_s: float = 0.003
    wheel_torque_noise_nm: float = 3.2
    theta_initial: float = 0.8
    floor_m_s: float = 1.0


class Taken(NamedTuple):
    """Usable readings of a rolling wheel."""

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    """Wheel torque less rolling resistance [N m]."""
    speed_m_s: float
    acceleration_m_s2: float
    load_n: float


class SensorFront:
    """Treatment of the sensors as in our estimator: checks, load and acceleration."""

    ACCELERATION_FILTER_S = 0.010
    """Time constant of the filter of measured acceleration [s]."""
    DIFFERENTIATION_S = 0.05
    """Time constant of the differentiation of speed [s]."""

    def __init__(self, setup: PeerSetup) -> None:
        self._setup = setup
        self.reset()

    def reset(self) -> None:
        """Reset the filters."""
        self._acceleration: float | None = None
        self._lagged_speed: float | None = None

    def take(self, step_s: float, sensors: Sensors) -> Taken | None:
        """Usable readings, or None where they are unusable or the car stands."""
        setup = self._setup
        radius_m = setup.vehicle.wheel_radius_m
        if unusable(step_s, sensors, radius_m, setup.floor_m_s):
            self.reset()
            return None
        acceleration = self._accelerated(step_s, sensors)
        load_n = sensors.vertical_load_n
        if load_n is None:
            load_n = setup.vehicle.wheel_load(setup.front_axle, acceleration)
        load_n = max(load_n, 0.05 * setup.vehicle.wheel_load(setup.front_axle))
        rim_m_s = sensors.wheel_speed_rad_s * radius_m
        if max(rim_m_s, sensors.vehicle_speed_m_s) < setup.floor_m_s:
            return None
        rolling_nm = 0.0
        if rim_m_s >= setup.floor_m_s:
            rolling_nm = setup.vehicle.rolling_resistance * load_n * radius_m
        return Taken(
            sensors.wheel_speed_rad_s,
            sensors.wheel_torque_nm - rolling_nm,
            sensors.vehicle_speed_m_s,
            acceleration,
            load_n,
        )

    def _accelerated(self, step_s: float, sensors: Sensors) -> float:
        """Filtered acceleration, measured or else differentiated from speed [m/s^2]."""
        measured, speed = sensors.longitudinal_acceleration_m_s2, sensors.vehicle_speed_m_s
        if measured is None:
            lagged = speed if self._lagged_speed is None else self._lagged_speed
            slope = (speed - lagged) / self.DIFFERENTIATION_S
            self._lagged_speed = lagged + filter_share(step_s, self.DIFFERENTIATION_S) * (speed - lagged)
            return min(max(slope, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
        before = measured if self._acceleration is None else self._acceleration
        self._acceleration = before + filter_share(step_s, self.ACCELERATION_FILTER_S) * (measured - before)
        return self._acceleration


def way(step_s: float, sensors: Sensors) -> float:
    """Distance driven over a step, 0 for unusable readings [m]."""
    passed = sensors.vehicle_speed_m_s * step_s
    return abs(passed) if math.isfinite(passed) else 0.0
