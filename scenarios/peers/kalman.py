"""Extended and unscented Kalman filters on the modified Dugoff tyre.

State (omega, v, theta) as in `scenarios.peers.wheel_model`; measured are omega and v; torque, acceleration and load go
in. Adhesion as a state with a random walk, beside wheel and vehicle speed: Ray (1997), Automatica 33(10), 1819-1833,
for the extended filter; the unscented one follows Wan and van der Merwe (2000), IEEE AS-SPCC, 153-158. The filters
themselves are those of bayesian-filters, FilterPy's successor.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from bayesian_filters.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from scenarios.peers.base import UNKNOWN, PeerEstimate, PeerSetup, SensorFront, Taken, way
from scenarios.peers.wheel_model import WheelState, advanced
from trpac_core.dife import LEAST_SENSITIVITY
from trpac_core.sensors import Sensors
from trpac_core.slip import wheel_slip
from trpac_core.tyre import GREATEST_THETA, LEAST_THETA, friction_by_theta

Array = NDArray[np.float64]

MEASURED = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Measurement matrix: omega and v are measured."""
THETA = 2
"""Index of theta in the state."""


@dataclass(frozen=True)
class KalmanTuning:
    """Noise of a filter; found by `benchmarks/accuracy/tune_peers.py`.

    Attributes
    ----------
    torque_share : float
        Process noise of the wheel's equation, as a multiple of the torque sensor's noise [-].
    acceleration_noise_m_s2 : float
        Process noise of the acceleration, per root of time [m/s^2 sqrt(s)].
    theta_walk : float
        Random walk of theta per root of distance [1/sqrt(m)].
    measurement_share : float
        Noise of omega and v as a multiple of their sensors' [-].
    spread : float
        Of the sigma points, alpha of Wan and van der Merwe; the unscented filter only [-].
    """

    torque_share: float = 1.0
    acceleration_noise_m_s2: float = 0.05
    theta_walk: float = 0.05
    measurement_share: float = 1.0
    spread: float = 1.0


class KalmanPeer(ABC):
    """The common part of the two filters: start and stop, noise and output."""

    name: str

    def __init__(self, setup: PeerSetup, tuning: KalmanTuning) -> None:
        self._setup, self._tuning = setup, tuning
        self._front = SensorFront(setup)
        noise = np.array([setup.wheel_speed_noise_rad_s, setup.vehicle_speed_noise_m_s])
        self._R = np.diag((tuning.measurement_share * noise) ** 2)
        self.reset()

    def reset(self) -> None:
        """Reset the state."""
        self._front.reset()
        self._theta, self._variance = self._setup.theta_initial, UNKNOWN**2
        self._running = False

    def step(self, step_s: float, sensors: Sensors) -> PeerEstimate:
        """The estimate after one step, see `Peer`."""
        taken = self._front.take(step_s, sensors)
        if taken is None:
            self._running = False
            walked = self._tuning.theta_walk**2 * way(step_s, sensors)
            self._variance = min(self._variance + walked, UNKNOWN**2)
            return PeerEstimate(self._theta, math.sqrt(self._variance), excited=False)
        if not self._running:
            state = np.array([taken.wheel_speed_rad_s, taken.speed_m_s, self._theta])
            self._begin(state, np.diag([*np.diag(self._R), self._variance]))
            self._running = True
        else:
            self._correct(np.array([taken.wheel_speed_rad_s, taken.speed_m_s]))
            self._bound()
        x, P = self._state()
        self._theta, self._variance = float(x[THETA]), float(P[THETA, THETA])
        estimate = PeerEstimate(self._theta, math.sqrt(self._variance), self._excited(x, taken))
        if step_s > 0.0:
            self._predict(taken, step_s, self._process_noise(taken, step_s))
        return estimate

    def _process_noise(self, taken: Taken, step_s: float) -> Array:
        """Covariance Q of the process noise of a step, shape (3, 3)."""
        car, tuning = self._setup.vehicle, self._tuning
        spin = tuning.torque_share * self._setup.wheel_torque_noise_nm * step_s / car.wheel_inertia_kg_m2
        speed = tuning.acceleration_noise_m_s2 * math.sqrt(step_s)
        theta = tuning.theta_walk * math.sqrt(abs(taken.speed_m_s) * step_s)
        return np.diag([spin**2, speed**2, theta**2])

    def _bound(self) -> None:
        """Limit theta to its domain, and its standard deviation to `UNKNOWN`."""
        x, P = self._state()
        x[THETA] = min(max(x[THETA], LEAST_THETA), GREATEST_THETA)
        if P[THETA, THETA] > UNKNOWN**2:
            share = UNKNOWN / math.sqrt(P[THETA, THETA])
            P[THETA, :] *= share
            P[:, THETA] *= share

    def _excited(self, x: Array, taken: Taken) -> bool:
        """Whether the tyre's force depends on theta at the estimate, by our estimator's limit."""
        car = self._setup.vehicle
        slip = wheel_slip(x[0], x[1], car.wheel_radius_m, self._setup.floor_m_s).size
        if slip == 0.0:
            return False
        sensitivity = friction_by_theta(x[THETA], slip, taken.load_n, car.longitudinal_stiffness_n)
        return bool(sensitivity >= LEAST_SENSITIVITY)

    def _ahead(self, x: Array, taken: Taken, step_s: float) -> tuple[Array, Array]:
        """State one step later, and the transition's Jacobian, shapes (3,) and (3, 3)."""
        moved = advanced(
            WheelState(*x.tolist()),
            taken.wheel_torque_nm,
            taken.acceleration_m_s2,
            taken.load_n,
            self._setup.vehicle,
            step_s,
            self._setup.floor_m_s,
        )
        F = np.eye(3)
        F[0] = moved.by_wheel_speed, moved.by_speed, moved.by_theta
        return np.array(moved.state), F

    @abstractmethod
    def _begin(self, x: Array, P: Array) -> None: ...

    @abstractmethod
    def _state(self) -> tuple[Array, Array]: ...

    @abstractmethod
    def _correct(self, z: Array) -> None: ...

    @abstractmethod
    def _predict(self, taken: Taken, step_s: float, Q: Array) -> None: ...


class _Ekf(ExtendedKalmanFilter):
    """The library's filter with a nonlinear prediction, through its hook `predict_x`."""

    ahead: Array

    def predict_x(self, u: object = 0) -> None:
        self.x = self.ahead


class EkfPeer(KalmanPeer):
    """Extended Kalman filter."""

    name = "EKF"

    def _begin(self, x: Array, P: Array) -> None:
        self._filter = _Ekf(dim_x=3, dim_z=2)
        self._filter.x, self._filter.P, self._filter.R = x, P, self._R

    def _state(self) -> tuple[Array, Array]:
        return self._filter.x, self._filter.P

    def _correct(self, z: Array) -> None:
        self._filter.update(z, HJacobian=lambda x: MEASURED, Hx=lambda x: x[:THETA])

    def _predict(self, taken: Taken, step_s: float, Q: Array) -> None:
        self._filter.ahead, self._filter.F = self._ahead(self._filter.x, taken, step_s)
        self._filter.Q = Q
        self._filter.predict()


class UkfPeer(KalmanPeer):
    """Unscented Kalman filter with scaled sigma points."""

    name = "UKF"

    def _begin(self, x: Array, P: Array) -> None:
        points = MerweScaledSigmaPoints(3, alpha=self._tuning.spread, beta=2.0, kappa=0.0)
        self._filter = UnscentedKalmanFilter(
            dim_x=3, dim_z=2, dt=0.0, hx=lambda x: x[:THETA], fx=self._one_ahead, points=points
        )
        self._filter.x, self._filter.P, self._filter.R = x, P, self._R

    def _one_ahead(self, x: Array, dt: float, taken: Taken) -> Array:
        return self._ahead(x, taken, dt)[0]

    def _state(self) -> tuple[Array, Array]:
        return self._filter.x, self._filter.P

    def _correct(self, z: Array) -> None:
        self._filter.update(z)

    def _predict(self, taken: Taken, step_s: float, Q: Array) -> None:
        self._filter.Q = Q
        self._filter.predict(dt=step_s, taken=taken)
