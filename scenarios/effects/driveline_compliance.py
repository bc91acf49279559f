"""Torsion between motor and wheel."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import (
    Effect,
    mean_of_wheels,
    parameter,
    share_of_axles,
    share_of_sides,
)
from scenarios.plant.parameters import DynamicsParameters

LARGEST_MOTOR_SHARE = 0.8
"""Of a wheel's inertia, the lighter axle's, that may be the motor's: the wheel itself keeps the rest [-]."""
LEAST_MOTOR_SHARE = 0.02
"""A motor with less of the wheel's inertia counts as rigid: it would only make the equations stiff [-]."""


@dataclass(frozen=True)
class DrivelineCompliance(Effect):
    """Motor and wheel are connected by a torsional spring; driving and braking torque act at the motor.

    The motor inertia J is a part of the wheel inertia I. Below 2 % of I the driveline is rigid.
    """

    id = "driveline_compliance"
    form = "all shafts alike"
    stage = "dynamics"
    subsystem = "powertrain"
    equation = (
        "T_s = k twist + d (omega_m - omega), twist' = omega_m - omega, J omega_m' = T - T_s, "
        "(I - J) omega' = T_s - F_x R; J at most 0.8 I"
    )
    source = "Kiencke and Nielsen (2005), Automotive Control Systems, drive-shaft model"
    excited_by = "tip-in and tip-out: wheel-speed oscillation after a step of torque"
    confounders = ("torque_lag", "torque_delay", "tyre_relaxation", "wheel_inertia_offset")

    stiffness_nm_rad: float = parameter(
        "N m/rad",
        "torsional stiffness of one shaft",
        neutral=1e4,
        low=100.0,
        high=1e6,
        starts=(2e3, 8e3, 3e4),
    )
    damping_nm_s_rad: float = parameter(
        "N m s/rad", "torsional damping of one shaft", neutral=0.0, low=0.0, high=1e3, starts=(3.0, 20.0)
    )
    motor_inertia_kg_m2: float = parameter(
        "kg m^2",
        "part of the wheel inertia on the motor's end of the shaft; 0 is rigid",
        neutral=0.0,
        low=0.0,
        high=lambda car: LARGEST_MOTOR_SHARE * car.wheel_inertia_kg_m2,
        starts=lambda car: (0.2 * car.wheel_inertia_kg_m2, 0.5 * car.wheel_inertia_kg_m2),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Motor speed and twist become states of each wheel."""
        inertias = parameters.wheel_inertia_kg_m2
        motor = min(self.motor_inertia_kg_m2, LARGEST_MOTOR_SHARE * min(inertias))
        rigid = motor < LEAST_MOTOR_SHARE * mean_of_wheels(inertias)
        return parameters._replace(
            shaft_stiffness_nm_rad=self.per_wheel(self.stiffness_nm_rad),
            shaft_damping_nm_s_rad=self.damping_nm_s_rad,
            motor_inertia_kg_m2=0.0 if rigid else motor,
        )


@dataclass(frozen=True)
class DrivelineComplianceOfAxles(DrivelineCompliance):
    """The shafts of the two axles differ; `stiffness_nm_rad` is the mean."""

    form = "axles unlike"
    equation = "k (1 + unlike) in front, k (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.2, most=0.6)


@dataclass(frozen=True)
class DrivelineComplianceOfWheels(DrivelineComplianceOfAxles):
    """Each shaft has its own stiffness, for example by its length; `stiffness_nm_rad` is the mean."""

    form = "each wheel its own"
    of_wheels = True
    equation = (
        "k (1 + unlike +- front_sides) in front, k (1 - unlike +- rear_sides) in the rear, + on the left"
    )

    front_sides: float = share_of_sides("front", start=0.15, most=0.35)
    rear_sides: float = share_of_sides("rear", start=0.15, most=0.35)
