"""Predicted tracks of the front wheels: kinematic bicycle, its covariance and the ellipses, Eqs. (1) to (4).

All positions are in the axes of `camera.py`: x forward, y left, origin below the centre of the front axle at
the moment of the picture. The path is followed by distance, not by time, so that the road ahead is also
looked at from standstill: with the steering held, the path itself does not depend on the speed, only its
uncertainty does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CHI_SQUARE_95_2DOF = 5.991
"""95 % quantile of the chi-square distribution with two degrees of freedom [-]."""

FLOOR_SPEED_M_S = 5.0
"""Speed below which the road ahead is judged as if driven at this speed [m/s].

The recursion's time step is the distance step over the speed, so the ellipses would grow without bound
towards standstill; and a yaw rate does not give the path of a standing car.
"""

STEEPEST_CURVATURE_1_M = 0.4
"""Curvature that no passenger car exceeds; a yaw rate over speed beyond it is noise [1/m]."""


@dataclass(frozen=True)
class Motion:
    """Motion of the car when the picture is taken.

    `yaw_rate_rad_s` (positive to the left) takes the place of the steering angle (front wheels, positive to
    the left) where it is given and the car is faster than the floor speed. `way_m` is the distance driven by the front
    wheels since any start [m]; without it no road is recognised from frame to frame.
    """

    speed_m_s: float
    longitudinal_acceleration_m_s2: float = 0.0
    steering_angle_rad: float = 0.0
    yaw_rate_rad_s: float | None = None
    way_m: float | None = None

    def __post_init__(self) -> None:
        """Refuse impossible motions; raises ValueError."""
        values = (
            self.speed_m_s,
            self.longitudinal_acceleration_m_s2,
            self.steering_angle_rad,
            self.yaw_rate_rad_s or 0.0,
            self.way_m or 0.0,
        )
        if not all(np.isfinite(values)):
            raise ValueError(f"Motion {values}: every value must be finite.")
        if abs(self.steering_angle_rad) >= np.pi / 2:
            raise ValueError(
                f"Steering angle {self.steering_angle_rad:g} rad: expected the angle of the front wheels, "
                "within +-pi/2 rad. Is it the hand wheel's, or in degrees?"
            )


@dataclass(frozen=True)
class Ellipses:
    """Confidence ellipses along one wheel's track.

    Attributes
    ----------
    distance_m : array, shape (n,)
        Way of the rear axle to each centre [m].
    centre_m : array, shape (n, 2)
        x and y [m].
    covariance_m2 : array, shape (n, 2, 2)
        Covariance of the position [m^2].
    """

    distance_m: NDArray[np.float64]
    centre_m: NDArray[np.float64]
    covariance_m2: NDArray[np.float64]

    def within(self, from_m: float, to_m: float) -> Ellipses:
        """The ellipses whose centres lie in [from, to) along the path [m]."""
        chosen = (self.distance_m >= from_m) & (self.distance_m < to_m)
        return Ellipses(self.distance_m[chosen], self.centre_m[chosen], self.covariance_m2[chosen])

    def way_m(self, points_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Way to the place on the track that is beside each point, and how far that is from it, shapes (n,) [m]."""
        beside = points_m[:, None] - self.centre_m
        nearest = np.argmin((beside**2).sum(axis=2), axis=1)
        along = np.gradient(self.centre_m, self.distance_m, axis=0)[nearest]
        off = beside[np.arange(len(points_m)), nearest]
        further = (off * along).sum(axis=1) / (along**2).sum(axis=1)
        return self.distance_m[nearest] + further, np.hypot(*(off - further[:, None] * along).T)

    def outlines_m(self, corners: int = 32) -> NDArray[np.float64]:
        """Points on the 95 % outlines, shape (n, corners, 2) [m]."""
        angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
        circle = np.sqrt(CHI_SQUARE_95_2DOF) * np.stack((np.cos(angle), np.sin(angle)))
        factors = np.linalg.cholesky(self.covariance_m2)
        return self.centre_m[:, None, :] + np.swapaxes(factors @ circle, 1, 2)


def path_curvature(motion: Motion, wheelbase_m: float) -> float:
    """Curvature of the rear axle's path, positive to the left. [1/m]. Kinematic bicycle, Figure 5."""
    if motion.yaw_rate_rad_s is not None and motion.speed_m_s > FLOOR_SPEED_M_S:
        measured = motion.yaw_rate_rad_s / motion.speed_m_s
        return float(np.clip(measured, -STEEPEST_CURVATURE_1_M, STEEPEST_CURVATURE_1_M))
    return float(np.tan(motion.steering_angle_rad) / wheelbase_m)


def wheel_track(
    distance_m: NDArray[np.float64], curvature_1_m: float, wheelbase_m: float, lateral_m: float
) -> NDArray[np.float64]:
    """Positions of a front wheel after each distance driven, Eq. (1).

    Eq. (1) carries the wheels from the centre of gravity; the rear axle is the same rigid body's point
    without side slip, on which a held steering angle gives an exact arc.

    Parameters
    ----------
    distance_m : array, shape (n,)
        Way of the rear axle, the integral of the speed [m].
    curvature_1_m : float
        Curvature of the rear axle's path [1/m].
    wheelbase_m, lateral_m : float
        The wheel's place ahead and to the left of the rear axle's centre [m].

    Returns
    -------
    array, shape (n, 2)
        x and y in vehicle axes at the start [m].
    """
    heading = curvature_1_m * distance_m
    # np.sinc is sin(pi z) / (pi z): the chord of an arc, also on a straight.
    chord = distance_m * np.sinc(heading / (2.0 * np.pi))
    rear_x = chord * np.cos(heading / 2.0) - wheelbase_m
    rear_y = chord * np.sin(heading / 2.0)
    return np.column_stack(
        (
            rear_x + wheelbase_m * np.cos(heading) - lateral_m * np.sin(heading),
            rear_y + wheelbase_m * np.sin(heading) + lateral_m * np.cos(heading),
        )
    )


def speed_along(distance_m: NDArray[np.float64], motion: Motion) -> NDArray[np.float64]:
    """Speed after each distance under constant acceleration, not below the floor speed. [m/s]."""
    squared = motion.speed_m_s**2 + 2.0 * motion.longitudinal_acceleration_m_s2 * distance_m
    return np.sqrt(np.maximum(squared, FLOOR_SPEED_M_S**2))


def position_covariance(
    speed_m_s: NDArray[np.float64], step_m: float, k1: float, k2: float, start_deviation_m: float
) -> NDArray[np.float64]:
    """Covariance of the reckoned position, P(k+1) = F P(k) F' + Q, Eqs. (3) and (4).

    The time step of F is the distance step over the speed. Q is as printed: sigma_x^2 = k1 v and sigma_y^2 =
    k2 v on the velocities, once per step. P(0), for which the paper gives no value, is the width of the tyre's
    print and of the mounting's error.

    Parameters
    ----------
    speed_m_s : array, shape (n,)
        Speed at each step; all above 0 [m/s].
    step_m : float
        Distance between steps [m].
    k1, k2 : float
        Growth of the longitudinal and the lateral uncertainty [m/s].
    start_deviation_m : float
        Standard deviation of the position at the start, both ways [m].

    Returns
    -------
    array, shape (n, 2, 2)
        Covariance of (x, y) at each step; the first is P(0) [m^2].
    """
    P = np.diag([start_deviation_m**2, start_deviation_m**2, 0.0, 0.0])
    covariances = np.empty((len(speed_m_s), 2, 2))
    F = np.eye(4)
    for k, v in enumerate(speed_m_s):
        covariances[k] = P[:2, :2]
        F[0, 2] = F[1, 3] = step_m / v
        P = F @ P @ F.T + np.diag([0.0, 0.0, k1 * v, k2 * v])
    return covariances


def way_beside(tracks: Sequence[Ellipses], points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Way at which the wheels reach each point, by the track that leads past it closest, shape (n,) [m]."""
    ways, off = (np.stack(told) for told in zip(*(track.way_m(points_m) for track in tracks), strict=True))
    return ways[off.argmin(axis=0), np.arange(len(points_m))]


def reckon(
    motion: Motion,
    *,
    wheelbase_m: float,
    lateral_m: float,
    horizon_m: float,
    step_m: float,
    k1: float,
    k2: float,
    start_deviation_m: float,
) -> Ellipses:
    """Confidence ellipses of one front wheel up to the horizon, one per distance step (section 3.2)."""
    distance_m = np.arange(0.0, max(horizon_m, step_m) + step_m / 2.0, step_m)
    centre_m = wheel_track(distance_m, path_curvature(motion, wheelbase_m), wheelbase_m, lateral_m)
    covariance_m2 = position_covariance(speed_along(distance_m, motion), step_m, k1, k2, start_deviation_m)
    return Ellipses(distance_m, centre_m, covariance_m2)
