"""Parameters, road and working arrays of the plant's compiled step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trpac_core.vehicle import GRAVITY_M_S2

POSITION, SPEED, WHEEL, FORCE, TWIST, MOTOR, STATES = 0, 1, 2, 6, 10, 14, 18
"""Indices of the state vector y: position [m], vehicle speed [m/s], and four each of wheel speed [rad/s], tyre
force [N] or lagging slip [-] (with relaxation), shaft twist [rad] and motor speed [rad/s] (with a driveline); unused
ones do not change."""

PerWheel = tuple[float, float, float, float]
"""One value per wheel in the order of `trpac_core.vehicle.WHEELS`: fl, fr, rl, rr. Tuples and not arrays: the
compiled step counts references of each array that it passes, which took half of all time."""

PER_WHEEL = 8
"""How many fields of `DynamicsParameters`, the first ones, hold one value per wheel."""


class DynamicsParameters(NamedTuple):
    """Parameters of the dynamics stage; effects replace fields."""

    wheel_radius_m: PerWheel
    """Rolling radius: vehicle speed over wheel speed of a wheel that rolls without slip [m]."""
    lever_m: PerWheel
    """Lever of the tyre force about the wheel's axle [m]."""
    wheel_inertia_kg_m2: PerWheel
    """Moment of inertia of the wheel and its motor about the axle [kg m^2]."""
    longitudinal_stiffness_n: PerWheel
    """Longitudinal stiffness C_x of the tyre under the mean static load of all wheels [N]."""
    rolling_coefficient: PerWheel
    """Rolling resistance as a moment over load and lever, positive against the rotation [-]."""
    drag_torque_nm: PerWheel
    """Constant torque, positive against the rotation [N m]."""
    relaxation_m: PerWheel
    """Distance rolled until the tyre force has made 63 % of a step; 0 on all wheels: it follows at once [m]."""
    shaft_stiffness_nm_rad: PerWheel
    """Torsional stiffness of the shaft between motor and wheel [N m/rad]."""
    mass_kg: float
    """Mass of the vehicle [kg]."""
    cog_to_front_axle_m: float
    """Distance from the centre of gravity forward to the front axle [m]."""
    cog_to_rear_axle_m: float
    """Distance from the centre of gravity back to the rear axle [m]."""
    reference_load_n: float
    """Load F_z0 for which the vehicle file's stiffness holds: the mean static one of its car, without payload [N]."""
    transfer_height_m: float = 0.0
    """Height through which acceleration moves load between the axles; 0: static loads [m]."""
    drag_kg_m: float = 0.0
    """Air drag force over squared speed, 0.5 rho C_d A [kg/m]."""
    hub_resistance: float = 0.0
    """Rolling resistance as a force on the body over the load, positive against the motion [-]."""
    slope_m_s2: float = 0.0
    """Part of gravity along the road, positive uphill [m/s^2]."""
    gravity_m_s2: float = GRAVITY_M_S2
    """Part of gravity across the road, which loads the wheels [m/s^2]."""
    falloff_s_m: float = 0.0
    """Rate at which adhesion falls with sliding speed; 0: it does not [s/m]."""
    falloff_floor: float = 1.0
    """Share of the adhesion at high sliding speed [-]."""
    falloff_hyperbolic: float = 0.0
    """1: adhesion falls as a hyperbola of the sliding speed; 0: exponentially [-]."""
    knee: float = 0.0
    """Relative deviation of the tyre force where the contact patch begins to slide [-]."""
    crest: float = 0.0
    """Relative deviation of the tyre force near its maximum [-]."""
    sliding: float = 0.0
    """Relative deviation of the tyre force where the whole contact patch slides [-]."""
    formula_share: float = 0.0
    """Weight of a magic formula of the same initial slope and peak; 0: the modified Dugoff tyre alone [-]."""
    formula_shape: float = 1.4
    """Shape factor C of the magic formula [-]."""
    formula_curvature: float = 0.0
    """Curvature factor E of the magic formula [-]."""
    relaxation_by_load: float = 0.0
    """Relative growth of the relaxation length per relative excess of the load over the mean static load [-]."""
    relaxation_by_slope: float = 0.0
    """Share of the relaxation length that shrinks as the slope of the force by slip does; 1: all of it [-]."""
    slip_lags: float = 0.0
    """1: relaxation delays the slip, and the force is the steady one of that slip; 0: it delays the force [-]."""
    shaft_damping_nm_s_rad: float = 0.0
    """Torsional damping of each shaft [N m s/rad]."""
    stiffness_by_load: float = 0.0
    """Relative growth of the tyre stiffness per relative excess of the load over the mean static load [-]."""
    stiffness_exponent: float = 0.0
    """Power of the load over `reference_load_n` that the tyre stiffness goes with [-]."""
    motor_inertia_kg_m2: float = 0.0
    """Part of wheel_inertia_kg_m2 that turns with the motor, behind the shaft; 0: no shaft [kg m^2]."""

    def as_compiled(self) -> DynamicsParameters:
        """The same values as the types that the step is compiled for: floats, and tuples of four floats."""
        values: list[Any] = [
            tuple(map(float, value)) if isinstance(value, tuple) else float(value) for value in self
        ]
        return DynamicsParameters(*values)

    def as_row(self) -> NDArray[np.float64]:
        """All values in the order of the fields, four of each field that is per wheel, shape (VALUES,)."""
        return np.hstack(self)


OF_VEHICLE = len(DynamicsParameters._fields) - PER_WHEEL
"""How many fields of `DynamicsParameters`, the last ones, hold one number."""
VALUES = 4 * PER_WHEEL + OF_VEHICLE
"""How many numbers `DynamicsParameters` holds."""


class RoadTable(NamedTuple):
    """The road in the compiled step; the first segment also holds before its start."""

    start_m: NDArray[np.float64]
    """Where each segment begins, shape (segments,) [m]."""
    theta: NDArray[np.float64]
    """Adhesion under the left and the right wheels, shape (segments, 2) [-]."""


class Wheels(NamedTuple):
    """Working arrays of one evaluation, shape (4,) each unless said; theta is input, the others are filled."""

    theta: NDArray[np.float64]
    """Adhesion of the road at each contact [-]."""
    force_n: NDArray[np.float64]
    """Longitudinal tyre force F_x, positive forward; with relaxation it lags behind its steady value [N]."""
    load_n: NDArray[np.float64]
    """Vertical load F_z [N]."""
    slip: NDArray[np.float64]
    """Unsigned slip lambda [-]."""
    rates: NDArray[np.float64]
    """Time derivatives of y from the wheel speeds on, shape (16,), in units of y per second."""
    free: NDArray[np.float64]
    """0 for what is held at rest, else 1: four wheels and the vehicle, shape (5,) [-]."""
    work: NDArray[np.float64]
    """Working array of the step, shape (12, 4); dynamics.py names the rows."""
