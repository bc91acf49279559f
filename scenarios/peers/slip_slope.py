"""Slip-slope: friction from the slope of used friction over slip, by recursive least squares.

Below the limit rho = K lambda, rho = abs(F_x) / F_z; the slope K is estimated by recursive least squares with
forgetting (Gustafsson 1997, Automatica 33(6), 1087-1099), here with padasip's filter. That the slope depends on the
peak is a hypothesis from measurements (Mueller, Uchanski, Hedrick 2003, doi:10.1115/1.1636773); the map is calibrated
on drives on known roads: theta = intercept + gain * K. Where slip is so large that the tyre slides as a whole, used
friction is the peak friction, and a first-order filter over it is the estimate.

On the modified Dugoff tyre the slope at slip 0 is 1.27 C_x / F_z on every road, so that the estimated slope depends on
theta only through the curvature below the limit. The method is implemented as published.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from padasip.filters import FilterRLS

from scenarios.peers.base import ROAD_CHANGE, UNKNOWN, PeerEstimate, PeerSetup, SensorFront, Taken, way
from trpac_core.sensors import Sensors, filter_share
from trpac_core.slip import wheel_slip
from trpac_core.tyre import GREATEST_THETA, LEAST_THETA, correction


@dataclass(frozen=True)
class SlipSlopeTuning:
    """Settings; found by `benchmarks/accuracy/tune_peers.py`.

    Attributes
    ----------
    filter_s : float
        Time constant of the filter on wheel speed, torque and vehicle speed, which also gives the wheel's angular
        acceleration [s].
    memory_s : float
        Time constant of the forgetting [s].
    least_slip : float
        Slip below which a sample is not used [-].
    sliding_slip : float
        Slip above which the tyre slides as a whole [-].
    intercept, gain : float
        The map from slope to theta [-].
    map_deviation : float
        Residual standard deviation of theta on the drives of the calibration [-].
    """

    filter_s: float = 0.02
    memory_s: float = 0.1
    least_slip: float = 0.008
    sliding_slip: float = 0.05
    intercept: float = -0.1
    gain: float = 0.04
    map_deviation: float = 0.1


class SlipSlopePeer:
    """Slip-slope by recursive least squares, on one wheel."""

    name = "slip-slope"

    def __init__(self, setup: PeerSetup, tuning: SlipSlopeTuning) -> None:
        self._setup, self._tuning = setup, tuning
        self._front = SensorFront(setup)
        self.reset()

    def reset(self) -> None:
        """Reset the state."""
        self._front.reset()
        self._theta, self._variance = self._setup.theta_initial, UNKNOWN**2
        self._filtered: Taken | None = None
        self._sliding: float | None = None
        car = self._setup.vehicle
        initial_slope = (
            correction(0.0, 0.0) * car.longitudinal_stiffness_n / car.wheel_load(self._setup.front_axle)
        )
        self._regression = FilterRLS(1, mu=1.0, eps=1e-3, w=np.array([initial_slope]))

    @property
    def slope(self) -> float | None:
        """Slope of used friction over slip [-]; None while the tyre slides as a whole."""
        return float(self._regression.w[0]) if self._sliding is None else None

    def step(self, step_s: float, sensors: Sensors) -> PeerEstimate:
        """The estimate after one step, see `Peer`."""
        taken = self._front.take(step_s, sensors)
        self._variance = min(self._variance + ROAD_CHANGE**2 * way(step_s, sensors), UNKNOWN**2)
        excited = False
        if taken is None:
            self._filtered = self._sliding = None
        else:
            friction, slip = self._used(taken, step_s)
            excited = slip > self._tuning.least_slip and friction > 0.0
            if excited:
                theta = self._judged(friction, slip, step_s)
                self._theta = min(max(theta, LEAST_THETA), GREATEST_THETA)
                self._variance = min(self._tuning.map_deviation, UNKNOWN) ** 2
            else:
                self._sliding = None
        return PeerEstimate(self._theta, math.sqrt(self._variance), excited)

    def _used(self, taken: Taken, step_s: float) -> tuple[float, float]:
        """Used friction and slip of the readings, both through the same filter [-]."""
        before = self._filtered or taken
        share = filter_share(step_s, self._tuning.filter_s)
        now = Taken(*(b + share * (t - b) for b, t in zip(before, taken, strict=True)))
        self._filtered = now
        car = self._setup.vehicle
        spin = (taken.wheel_speed_rad_s - now.wheel_speed_rad_s) / self._tuning.filter_s
        force_n = (now.wheel_torque_nm - car.wheel_inertia_kg_m2 * spin) / car.wheel_radius_m
        slip = wheel_slip(now.wheel_speed_rad_s, now.speed_m_s, car.wheel_radius_m, self._setup.floor_m_s)
        return force_n * slip.direction / now.load_n, slip.size

    def _judged(self, friction: float, slip: float, step_s: float) -> float:
        """Theta from an excited sample [-]."""
        tuning = self._tuning
        if slip > tuning.sliding_slip:
            share = filter_share(step_s, tuning.memory_s)
            before = friction if self._sliding is None else self._sliding
            self._sliding = before + share * (friction - before)
            return self._sliding
        self._sliding = None
        self._regression.mu = math.exp(-step_s / tuning.memory_s)
        self._regression.adapt(friction, np.array([slip]))
        return tuning.intercept + tuning.gain * float(self._regression.w[0])
