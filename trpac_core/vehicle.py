"""Description of the car: geometry, inertia and the loads on its wheels."""

from __future__ import annotations

from dataclasses import dataclass

GRAVITY_M_S2 = 9.81
"""Standard gravity as the reference plant uses it [m/s^2]."""
WHEELS = ("fl", "fr", "rl", "rr")
"""Order of all fours, in arrays and files: front left, front right, rear left, rear right."""


@dataclass(frozen=True)
class Vehicle:
    """A two-axle vehicle; the defaults are Table 3 of Tian et al. 2022 [1]_.

    The wheel's inertia and the tyre's longitudinal stiffness are not in the paper: they are typical of a car of
    this mass with in-wheel motors.

    References
    ----------
    .. [1] Tian et al. (2022), Remote Sensing 14, 5583, doi:10.3390/rs14215583.
    """

    mass_kg: float = 1343.8
    wheelbase_m: float = 2.305
    track_m: float = 1.356
    cog_height_m: float = 0.54
    cog_to_rear_axle_m: float = 1.193
    wheel_radius_m: float = 0.29
    wheel_inertia_kg_m2: float = 1.2
    motor_peak_torque_nm: float = 320.0
    longitudinal_stiffness_n: float = 50_000.0
    rolling_resistance: float = 0.0
    """Coefficient of the moment against the wheel's rotation, c F_z R; 0 is Eq. (12) as printed [-]."""

    def __post_init__(self) -> None:
        """Refuse a centre of gravity that does not lie between the axles; raises ValueError."""
        if not 0.0 < self.cog_to_rear_axle_m < self.wheelbase_m:
            raise ValueError(
                f"cog_to_rear_axle_m is {self.cog_to_rear_axle_m:g}; expected less than wheelbase_m "
                f"({self.wheelbase_m:g}) and more than 0: the centre of gravity lies between the axles."
            )

    @property
    def cog_to_front_axle_m(self) -> float:
        """Distance from the centre of gravity to the front axle [m]."""
        return self.wheelbase_m - self.cog_to_rear_axle_m

    def wheel_load(self, front: bool, longitudinal_acceleration_m_s2: float = 0.0) -> float:
        """Vertical load of one wheel under quasi-static longitudinal load transfer. [N]."""
        lever_m = self.cog_to_rear_axle_m if front else self.wheelbase_m - self.cog_to_rear_axle_m
        transfer = longitudinal_acceleration_m_s2 * self.cog_height_m * (-1.0 if front else 1.0)
        return self.mass_kg * (GRAVITY_M_S2 * lever_m + transfer) / (2.0 * self.wheelbase_m)


@dataclass(frozen=True)
class CarTolerance:
    """Tolerances of the description of the car.

    Parameters
    ----------
    speed_bias_m_s : float
        Standard deviation of a constant error of the sliding speed: an INS drifts by 0.05 km/h [m/s].
    ratio : float
        Standard deviation of the rolling radius as a share of it, over load and temperature [-].
    compliance : float
        Standard deviation of ln(described stiffness / stiffness) of the tyre [-].
    """

    speed_bias_m_s: float = 0.014
    ratio: float = 0.003
    compliance: float = 0.05


EXACT_CAR = CarTolerance(0.0, 0.0, 0.0)
"""The car agrees with its description."""
