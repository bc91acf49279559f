"""What all peers share: one shape, and what each is told of the car and reads from its sensors.

A peer is a friction estimator from the literature on the same inputs as ours, step for step. It has no camera, so its
counterpart is the dynamics estimator DE.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

from trpac_core.confidence import ConfidenceModel
from trpac_core.readings import GREATEST_ACCELERATION_M_S2, Sensors, filter_share, unusable
from trpac_core.vehicle import Vehicle

UNKNOWN = ConfidenceModel.unknown
"""Standard deviation where nothing is known, as our estimator's [-]."""
ROAD_CHANGE = ConfidenceModel.road_change
"""How far friction may wander per root of a metre driven unseen, as our estimator's [1/sqrt(m)]."""


@dataclass(frozen=True, slots=True)
class PeerEstimate:
    """What a peer says at a step.

    Attributes
    ----------
    TRPAC, TRPAC_std : float
        Estimate of theta and its standard deviation [-].
    excited : bool
        Whether the peer takes the tyre to show the road's friction now.
    """

    TRPAC: float
    TRPAC_std: float
    excited: bool


@runtime_checkable
class Peer(Protocol):
    """An estimator of the literature, on one wheel."""

    @property
    def name(self) -> str:
        """How tables call it."""

    def reset(self) -> None:
        """Forget everything."""

    def step(self, step_s: float, sensors: Sensors) -> PeerEstimate:
        """One step; readings are those at its start. Unusable readings hold the estimate."""


@dataclass(frozen=True)
class PeerSetup:
    """What a peer is told of its wheel, the same that our estimator is told.

    Attributes
    ----------
    vehicle : Vehicle
        The car.
    front_axle : bool
        Whether the wheel is a front wheel.
    wheel_speed_noise_rad_s, vehicle_speed_noise_m_s, wheel_torque_noise_nm : float
        Standard deviations of the sensors' white noise per sample; the defaults are the paper simulation's.
    theta_initial : float
        Estimate before anything is known [-].
    floor_m_s : float
        Speed below which slip says nothing [m/s].
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
    """Without the rolling resistance [N m]."""
    speed_m_s: float
    acceleration_m_s2: float
    load_n: float


class SensorFront:
    """Reads the sensors for a peer as our estimator reads them: the same checks, load and acceleration."""

    ACCELERATION_FILTER_S = 0.010
    DIFFERENTIATION_S = 0.05

    def __init__(self, setup: PeerSetup) -> None:
        self._setup = setup
        self.reset()

    def reset(self) -> None:
        """Forget the car's motion."""
        self._acceleration: float | None = None
        self._lagged_speed: float | None = None

    def take(self, step_s: float, sensors: Sensors) -> Taken | None:
        """The readings, or None where they are unusable or the car stands."""
        setup = self._setup
        radius_m = setup.vehicle.wheel_radius_m
        if unusable(step_s, sensors, radius_m, setup.floor_m_s) is not None:
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
        """Measured acceleration, filtered; differentiated from speed where it is not measured [m/s^2]."""
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
    """Way driven over a step, 0 where the readings do not say [m]."""
    passed = sensors.vehicle_speed_m_s * step_s
    return abs(passed) if math.isfinite(passed) else 0.0
