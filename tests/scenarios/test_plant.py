import os
import subprocess
import sys
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long import beyond
from plant_drives import CAR, EVERYTHING, SCENARIOS, constant, make_road, profile, with_effects
from plant_oracle import reference
from scipy.optimize import brentq

from scenarios.effects.driveline_compliance import DrivelineComplianceOfAxles, DrivelineComplianceOfWheels
from scenarios.effects.rolling_resistance import RollingResistanceForce
from scenarios.effects.tyre_relaxation import TyreRelaxationOfSlip, TyreRelaxationWhileItAdheres
from scenarios.errors import ScenarioError
from scenarios.files import SensorNoise, load_scenario
from scenarios.plant import dynamics
from scenarios.plant.dynamics import FLOOR_SPEED_M_S, tyre_force
from scenarios.plant.parameters import (
    FORCE,
    MOTOR,
    PER_WHEEL,
    POSITION,
    SPEED,
    TWIST,
    VALUES,
    WHEEL,
    DynamicsParameters,
)
from scenarios.plant.pipeline import advance, drive, initial_state, make_setup, simulate
from scenarios.plant.sensors import make_log, write_log
from trpac_core import tyre

NOMINAL = CAR.model_copy(update={"effects": {}})
TO_FRONT_M, TO_REAR_M = 2.305 - 1.193, 1.193


DRY = make_road((0.0, 0.9, 0.9))
ICE = make_road((0.0, 0.3, 0.3))


@settings(deadline=None)
@given(
    theta=st.floats(0.05, 1.2),
    slip=st.floats(0.0, 0.98),
    load_n=st.floats(200.0, 8000.0),
    stiffness_n=st.floats(2e4, 1e5),
)
def test_compiled_tyre_is_the_estimators_tyre(theta, slip, load_n, stiffness_n):
    force, by_slip, by_load = tyre_force(theta, slip, load_n, stiffness_n)
    assert force == pytest.approx(tyre.force(theta, slip, load_n, stiffness_n, 1.0), rel=1e-12, abs=1e-9)
    if slip > 1e-3:
        d = 1e-7
        by_slip_numeric = (tyre_force(theta, slip + d, load_n, stiffness_n)[0] - force) / d
        by_load_numeric = (tyre_force(theta, slip, load_n * (1.0 + d), stiffness_n)[0] - force) / (load_n * d)
        assert by_slip == pytest.approx(by_slip_numeric, rel=1e-3, abs=5e-3 * load_n)
        assert by_load == pytest.approx(by_load_numeric, abs=2e-4)


CURVES = {
    "modified Dugoff": {},
    "reshaped": {"knee": 0.3, "crest": -0.2, "sliding": 0.25},
    "magic formula": {"formula_share": 1.0, "formula_shape": 1.5, "formula_curvature": -0.5},
    "half of each": {"knee": -0.2, "crest": 0.1, "formula_share": 0.5},
}


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("theta", [0.2, 0.9])
def test_the_slopes_of_each_tyre_curve_are_those_of_its_force(curve, theta):
    p = make_setup(NOMINAL, DRY).parameters._replace(**CURVES[curve])
    stiffness_n = p.longitudinal_stiffness_n[0]

    def force(slip, load_n):
        return dynamics.steady_tyre(theta, slip, load_n, stiffness_n, p)[0]

    for slip in np.linspace(0.002, 0.9, 60):
        for load_n in (1500.0, 4000.0):
            _, by_slip, by_load = dynamics.steady_tyre(theta, slip, load_n, stiffness_n, p)
            rise_n = (force(slip + 1e-6, load_n) - force(slip - 1e-6, load_n)) / 2e-6
            assert by_slip == pytest.approx(rise_n, rel=1e-4, abs=1e-3 * theta * load_n)
            more = (force(slip, load_n + 0.1) - force(slip, load_n - 0.1)) / 0.2
            assert by_load == pytest.approx(more, abs=2e-3 * theta)


@pytest.mark.parametrize("theta", [0.3, 0.9])
@pytest.mark.parametrize(
    ("field", "shares"),
    [
        ("knee", {0.3: 0.64, 0.6: 1.0, 1.2: 0.64}),  # 4 u^2 / (1 + u^2)^2 at half, once and twice its place
        ("crest", {1.2: 0.64, 2.4: 1.0, 4.8: 0.64}),
        ("sliding", {0.5: 1.0 / 101.0, 5.0: 0.5, 10.0: 0.8}),
    ],
)
def test_a_reshaped_tyre_deviates_at_the_stretch_that_is_said_whatever_grip_and_stiffness(
    theta, field, shares
):
    p = make_setup(NOMINAL, DRY).parameters._replace(**{field: 0.2})
    stiffness_n, load_n = p.longitudinal_stiffness_n[0], 3000.0
    for stretch, share in shares.items():
        slip = stretch * theta * load_n / stiffness_n
        plain = tyre_force(theta, slip, load_n, stiffness_n)[0]
        assert dynamics.steady_tyre(theta, slip, load_n, stiffness_n, p)[0] / plain == pytest.approx(
            1.0 + 0.2 * share
        )


@pytest.mark.parametrize("speed_rad_s", [-3.0, -0.015, -0.001, 0.0, 0.004, 0.019, 0.5])
def test_a_brake_on_a_motor_opposes_its_motion_and_fades_evenly_through_rest(speed_rad_s):
    fade = dynamics.BRAKE_FADE_RAD_S
    braked, fall = dynamics._motor_torque(speed_rad_s, -50.0)
    assert braked == pytest.approx(np.interp(speed_rad_s, [-fade, fade], [50.0, -50.0]))
    assert fall == pytest.approx(50.0 / fade if abs(speed_rad_s) < fade else 0.0)
    assert dynamics._motor_torque(speed_rad_s, 50.0) == (50.0, 0.0)


STATES_OF_THE_STEP = {
    "tyres alone": {},
    "drag": {"drag_kg_m": 40.0},
    "lagging forces": {"relaxation_m": (0.3, 0.25, 0.2, 0.35)},
    "lagging slips": {"relaxation_m": (0.3, 0.25, 0.2, 0.35), "slip_lags": 1.0},
    "shafts": {"motor_inertia_kg_m2": 0.4, "shaft_damping_nm_s_rad": 12.0},
    "shafts and lagging forces": {
        "motor_inertia_kg_m2": 0.4, "shaft_damping_nm_s_rad": 12.0, "relaxation_m": (0.3, 0.25, 0.2, 0.35)
    },
    "shafts and lagging slips": {
        "motor_inertia_kg_m2": 0.4, "relaxation_m": (0.3, 0.25, 0.2, 0.35), "slip_lags": 1.0
    },
}  # fmt: skip


@pytest.mark.parametrize("case", STATES_OF_THE_STEP)
@pytest.mark.parametrize("torque_nm", [250.0, -250.0])
def test_the_steps_equations_are_solved_with_the_exact_jacobian(case, torque_nm):
    """Elimination by wheel against a dense solution with a Jacobian of differences.

    Speeds differ from wheel to wheel, and lags have settled, since the Jacobian leaves out how their rate changes.
    """
    p = make_setup(NOMINAL, DRY).parameters._replace(
        lever_m=(0.29, 0.3, 0.28, 0.27),
        wheel_inertia_kg_m2=(0.9, 1.0, 1.1, 1.2),
        shaft_stiffness_nm_rad=(9e3, 1e4, 1.1e4, 1.2e4),
        **STATES_OF_THE_STEP[case],
    )
    road, torque, h = make_setup(NOMINAL, DRY).road, np.full(4, torque_nm), 2e-3
    wheels, _ = dynamics.new_wheels()
    y = dynamics.initial_y(12.0, 5.0, p)
    y[WHEEL:FORCE] *= 1.0 + np.sign(torque_nm) * np.array([0.004, 0.006, 0.008, 0.01])
    y[MOTOR:] = y[WHEEL:FORCE]
    dynamics.refresh(y, 0.0, p, road, wheels)
    y[FORCE:TWIST] = wheels.work[0]  # the steady value
    y[TWIST:MOTOR] = 0.01

    def rates(state):
        accel = dynamics.refresh(state, 0.0, p, road, wheels)
        dynamics._fill_rates(state, torque, torque, 0.0, p, wheels)
        return np.array([accel - p.slope_m_s2, *wheels.rates])

    lags, shafts = p.relaxation_m[0] > 0.0, p.motor_inertia_kg_m2 > 0.0
    used = [
        *range(SPEED, FORCE),
        *(range(FORCE, TWIST) if lags else ()),
        *(range(TWIST, 18) if shafts else ()),
    ]
    columns = np.array(used) - SPEED
    steps = 1e-6 * np.maximum(np.abs(y), 1.0)
    jacobian = np.column_stack(
        [(rates(y + step) - rates(y - step))[columns] / (2.0 * step.sum()) for step in np.diag(steps)[used]]
    )
    given = np.random.default_rng(1).normal(size=17)
    gamma = 1.0 - np.sqrt(0.5)
    expected = np.linalg.solve(np.eye(len(used)) - gamma * h * jacobian, given[columns])
    rates(y)
    k = given[1:].copy()
    pivot = dynamics._factor(y[SPEED], h, p, wheels)
    speed = dynamics._solve(given[0], pivot, h, p, wheels, k)
    assert np.array([speed, *k])[columns] == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_locked_wheel_keeps_the_sliding_share_of_the_grip():
    assert tyre_force(0.5, 1.0, 3000.0, 5e4)[0] == pytest.approx(0.79 * 0.5 * 3000.0)
    assert tyre_force(0.5, 0.0, 3000.0, 5e4)[0] == 0.0


DRIVE_COAST_BRAKE = [
    (0.0, 0.0), (0.05, 300.0), (0.5, 300.0), (0.55, -200.0), (0.9, -200.0), (0.95, 100.0), (1.6, 100.0)
]  # fmt: skip
CASES = {
    "standing start over two borders": (
        {},
        [(0.0, 0.0), (0.1, 300.0), (1.2, 300.0), (1.25, 0.0), (1.4, 220.0), (1.6, 220.0)],
        [(0.0, 0.9, 0.9), (1.0, 0.35, 0.3), (3.0, 0.5, 0.5)],
        0.0,
        -TO_FRONT_M,
    ),
    "standing start with load transfer and drag": (
        {"load_transfer": {"cog_height_m": 0.54}, "aero_drag": {"drag_area_m2": 2.0}},
        [(0.0, 0.0), (0.1, 270.0), (0.8, 270.0), (0.85, 0.0), (1.6, 0.0)],
        [(0.0, 0.3, 0.3)],
        0.0,
        -TO_FRONT_M,
    ),
    "rolling, all effects, braking to a lock": (
        {
            "load_transfer": {"cog_height_m": 0.54},
            "aero_drag": {"drag_area_m2": 0.65},
            "rolling_resistance": {"coefficient": 0.02},
        },
        [(0.0, 0.0), (0.2, 320.0), (0.6, 320.0), (0.8, -260.0), (1.6, -260.0)],
        [(0.0, 0.5, 0.5), (4.0, 0.9, 0.8), (9.0, 0.4, 0.4)],
        6.0,
        0.0,
    ),
    "lagging forces over a border": (
        {"tyre_relaxation": {"length_m": 0.3}},
        DRIVE_COAST_BRAKE,
        [(0.0, 0.9, 0.9), (8.0, 0.3, 0.4)],
        6.0,
        0.0,
    ),
    "forces that hardly lag": (
        {"tyre_relaxation": {"length_m": 0.01}},
        [(0.0, 0.0), (0.05, 300.0), (0.5, 300.0), (0.55, 0.0), (1.6, 0.0)],
        [(0.0, 0.9, 0.9)],
        1.5,
        0.0,
    ),
    "standing start on soft shafts": (
        {
            "driveline_compliance": {
                "stiffness_nm_rad": 1e3,
                "damping_nm_s_rad": 5.0,
                "motor_inertia_kg_m2": 0.9,
            }
        },
        [(0.0, 0.0), (0.1, 300.0), (0.8, 300.0), (0.85, 0.0), (1.6, 0.0)],
        [(0.0, 0.9, 0.9)],
        0.0,
        0.0,
    ),
    "stiff shafts and light motors": (
        {
            "driveline_compliance": {
                "stiffness_nm_rad": 1e5,
                "damping_nm_s_rad": 20.0,
                "motor_inertia_kg_m2": 0.05,
            }
        },
        DRIVE_COAST_BRAKE,
        [(0.0, 0.9, 0.9)],
        10.0,
        0.0,
    ),
    "stiffness with load, and load transfer": (
        {"load_transfer": {"cog_height_m": 0.54}, "tyre_load_stiffness": {"exponent": 0.9}},
        DRIVE_COAST_BRAKE,
        [(0.0, 0.9, 0.9), (8.0, 0.3, 0.4)],
        7.0,
        0.0,
    ),
    "everything at once": (
        EVERYTHING,
        DRIVE_COAST_BRAKE,
        [(0.0, 0.9, 0.9), (8.0, 0.3, 0.4)],
        7.0,
        0.0,
    ),
}


def oracle_car(effects):
    """The effects in the oracle's own words."""

    def value(effect, name, neutral=0.0):
        return effects.get(effect, {}).get(name, neutral)

    return {
        "m": CAR.mass_kg, "l_f": TO_FRONT_M, "l_r": TO_REAR_M,
        "radius": CAR.wheel_radius_m, "inertia": CAR.wheel_inertia_kg_m2,
        "stiffness": CAR.tyre.longitudinal_stiffness_n,
        "h": value("load_transfer", "cog_height_m"),
        "k": 0.5 * 1.225 * value("aero_drag", "drag_area_m2"),
        "c": value("rolling_resistance", "coefficient"),
        "drag_torque": value("brake_drag", "torque_nm"),
        "grade": value("road_grade", "grade"),
        "falloff": value("friction_falloff", "falloff_s_m"),
        "falloff_floor": value("friction_falloff", "floor", 1.0),
        "relaxation": value("tyre_relaxation", "length_m"),
        "stiffness_exponent": value("tyre_load_stiffness", "exponent"),
        "shaft_stiffness": value("driveline_compliance", "stiffness_nm_rad"),
        "shaft_damping": value("driveline_compliance", "damping_nm_s_rad"),
        "motor_inertia": value("driveline_compliance", "motor_inertia_kg_m2"),
    }  # fmt: skip


@pytest.mark.parametrize("case", beyond(3, [*list(CASES)[-1:], *list(CASES)[:-1]]))
def test_agrees_with_an_independent_stiff_solver(case):
    effects, knots, segments, speed, position = CASES[case]
    times, torques = zip(*knots, strict=True)

    def torque_at(t):
        return np.interp(t, times, torques) * np.ones(4)

    time_s = np.arange(1601) * 1e-3
    truth = reference(
        oracle_car(effects), segments, torque_at, times, time_s, speed, position, FLOOR_SPEED_M_S
    )
    for rows in (1, 5):  # output steps of 1 and 5 ms
        step_s, expected = rows * 1e-3, truth[::rows]
        setup = make_setup(with_effects(**effects), make_road(*segments))
        start = dynamics.initial_y(speed, position, setup.parameters)
        y = dynamics.run(start, profile(knots, 1.6, step_s), step_s, setup.parameters, setup.road)[0]
        error = np.abs(y - expected[:, : y.shape[1]]).max(axis=0)
        assert error[SPEED] < 1e-4
        assert error[WHEEL:FORCE].max() < 6e-3
        # Sub-millisecond: where the plant is at a given time differs by less than it drives in 0.1 ms.
        assert error[POSITION] < 1e-4 * expected[:, SPEED].max()
        assert (error[FORCE:TWIST] < 10.0).all()
        assert (error[TWIST:MOTOR] < 1e-3).all()
        assert (error[MOTOR:] < 2e-2).all()


@pytest.mark.parametrize("by_slope", beyond(1, [False, True]))
@pytest.mark.parametrize("load_transfer_m", beyond(1, [0.54, 0.0]))
def test_other_forms_agree_with_the_independent_solver(load_transfer_m, by_slope):
    """A slip that lags, and rolling resistance on the body, over a border to ice where the wheels spin."""
    knots = ((0.0, 100.0), (0.4, 280.0), (0.9, 280.0), (1.0, 0.0), (1.2, -150.0), (1.6, -150.0))
    segments = [(0.0, 0.9, 0.9), (4.0, 0.2, 0.25)]
    car = with_effects(**({"load_transfer": {"cog_height_m": load_transfer_m}} if load_transfer_m else {}))
    setup = make_setup(car, make_road(*segments))
    relaxing = (TyreRelaxationWhileItAdheres if by_slope else TyreRelaxationOfSlip)(0.3)
    p = relaxing.dynamics(RollingResistanceForce(0.02).dynamics(setup.parameters))
    times, torques = zip(*knots, strict=True)
    time_s = np.arange(1601) * 1e-3
    truth = reference(
        {
            **oracle_car({}), "h": load_transfer_m, "c_hub": 0.02, "relaxation": 0.3, "slip_lags": True,
            "relaxation_by_slope": by_slope,
        },
        segments, lambda t: np.interp(t, times, torques) * np.ones(4), times, time_s, 7.0, 0.0, FLOOR_SPEED_M_S,
    )  # fmt: skip
    start = dynamics.initial_y(7.0, 0.0, p)
    y = dynamics.run(start, profile(knots, 1.6, 1e-3), 1e-3, p, setup.road)[0]
    assert np.abs(truth[:, FORCE:TWIST]).max() > 0.1  # the drive does reach the limit
    error = np.abs(y - truth[:, : y.shape[1]]).max(axis=0)
    assert error[SPEED] < 1e-4
    # A wheel that begins to spin speeds up by 150 rad/s^2: less than 0.2 ms of it.
    assert error[WHEEL:FORCE].max() < 2.5e-2
    # Where a relaxation is down to a tenth of its length, the slip follows ten times as fast.
    assert error[FORCE:TWIST].max() < (2.5e-3 if by_slope else 1e-3)


@pytest.mark.parametrize(
    ("effect", "shares"),
    beyond(
        1,
        [
            (DrivelineComplianceOfWheels(4000.0, 5.0, 0.5, 0.2, -0.3, 0.1), [0.9, 1.5, 0.9, 0.7]),
            (DrivelineComplianceOfAxles(4000.0, 5.0, 0.5, 0.4), [1.4, 1.4, 0.6, 0.6]),
        ],
    ),
)
def test_shafts_that_are_unlike_agree_with_the_independent_solver(effect, shares):
    knots = ((0.0, 0.0), (0.05, 250.0), (0.6, 250.0), (0.65, -150.0), (1.2, -150.0), (1.25, 0.0), (1.6, 0.0))
    segments = [(0.0, 0.9, 0.9), (8.0, 0.4, 0.4)]
    setup = make_setup(NOMINAL, make_road(*segments))
    p = effect.dynamics(setup.parameters)
    times, torques = zip(*knots, strict=True)
    time_s = np.arange(1601) * 1e-3
    shafts = {"shaft_stiffness": 4000.0 * np.array(shares), "shaft_damping": 5.0}
    truth = reference(
        {**oracle_car({}), **shafts, "motor_inertia": 0.5},
        segments, lambda t: np.interp(t, times, torques) * np.ones(4), times, time_s, 6.0, 0.0, FLOOR_SPEED_M_S,
    )  # fmt: skip
    y = dynamics.run(dynamics.initial_y(6.0, 0.0, p), profile(knots, 1.6, 1e-3), 1e-3, p, setup.road)[0]
    error = np.abs(y - truth[:, : y.shape[1]]).max(axis=0)
    assert error[SPEED] < 1e-4
    assert error[WHEEL:FORCE].max() < 6e-3
    assert error[TWIST:MOTOR].max() < 1e-3
    assert error[MOTOR:].max() < 2e-2


PER_WHEEL_FIELDS = DynamicsParameters._fields[:PER_WHEEL]


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize(
    "field", [name for name in PER_WHEEL_FIELDS if not name.startswith(("relax", "shaft"))]
)
def test_a_value_of_one_wheel_acts_on_that_wheel(field, wheel):
    setup = make_setup(NOMINAL, DRY)
    values = list(getattr(setup.parameters, field))
    values[wheel] = 1.3 * values[wheel] if values[wheel] else {"drag_torque_nm": 40.0}.get(field, 0.04)
    runs = []
    for p in (setup.parameters, setup.parameters._replace(**{field: tuple(values)})):
        y = dynamics.initial_y(5.0, 0.0, setup.parameters)
        runs.append(dynamics.run(y, constant(100.0, 0.05), 1e-3, p, setup.road)[2])
    apart = np.abs(runs[1] - runs[0]).max(axis=0)
    assert apart[wheel] > 10.0 * np.delete(apart, wheel).max()


def test_a_car_between_two_is_between_them_in_every_value_of_every_wheel():
    p = make_setup(with_effects(**EVERYTHING), DRY).parameters
    rows = np.array([p.as_row(), np.arange(float(VALUES))])
    assert dynamics._car_between(rows, np.array([0.0])) == p
    other = dynamics._car_between(rows, np.array([1.0]))
    assert other.as_row() == pytest.approx(np.arange(VALUES), abs=1e-9)
    assert other.longitudinal_stiffness_n == pytest.approx((12.0, 13.0, 14.0, 15.0))
    assert p.as_compiled() == p


def test_standing_start_follows_the_closed_form():
    """At constant torque from rest slip is constant: v = a t, omega R = b t solve the equations exactly."""
    torque, mass, inertia, radius = 200.0, CAR.mass_kg, CAR.wheel_inertia_kg_m2, CAR.wheel_radius_m

    def excess(slip):
        force = tyre_force(0.9, slip, 3300.0, 5e4)[0]
        return (torque - force * radius) / inertia * radius * (1.0 - slip) - 4.0 * force / mass

    slip = brentq(excess, 1e-5, 0.05)
    accel = 4.0 * tyre_force(0.9, slip, 3300.0, 5e4)[0] / mass
    run = simulate(NOMINAL, DRY, constant(torque, 1.0), 1e-3)
    assert run.speed_m_s[0] == 0.0
    assert run.speed_m_s[-1] == pytest.approx(accel, rel=2e-3)
    moving = run.time_s > 0.05
    assert np.abs(run.slip[moving] / slip - 1.0).max() < 0.02
    assert (np.diff(run.speed_m_s) > 0.0).all()
    assert np.abs(np.diff(run.accel_x_m_s2[moving])).max() < 0.01  # no chatter


@pytest.mark.parametrize("torque", [0.0, -5.0, -1500.0])
def test_rest_without_drive_is_exact(torque):
    run = simulate(CAR, ICE, constant(torque, 0.5), 1e-3)
    for name in ("position_m", "speed_m_s", "accel_x_m_s2", "wheel_speed_rad_s", "slip", "tyre_force_n"):
        assert not getattr(run, name).any(), name


def test_rolling_resistance_holds_against_a_small_torque():
    car = with_effects(rolling_resistance={"coefficient": 0.02})
    holds_nm = 0.02 * 3179.0 * CAR.wheel_radius_m  # at the less loaded rear wheels
    assert not simulate(car, DRY, constant(0.99 * holds_nm, 0.5), 1e-3).speed_m_s.any()
    assert simulate(car, DRY, constant(1.2 * holds_nm, 0.5), 1e-3).speed_m_s[-1] > 0.0


@pytest.mark.parametrize(("torque", "locks"), [(-60.0, False), (-900.0, True)])
@pytest.mark.parametrize("car", [NOMINAL, CAR], ids=["nominal", "effects"])
def test_braking_ends_at_rest_and_stays_there(car, torque, locks):
    run = simulate(car, ICE, profile([(0.0, 0.0), (0.1, torque), (9.0, torque)], 9.0), 1e-3, 3.0)
    assert (run.speed_m_s >= 0.0).all()
    assert (run.wheel_speed_rad_s >= 0.0).all()
    assert (np.diff(run.speed_m_s) <= 1e-12).all()
    stopped = int(np.argmax(run.speed_m_s == 0.0))
    assert stopped > 0
    assert not run.speed_m_s[stopped:].any()
    assert not run.tyre_force_n[stopped + 1 :].any()
    assert np.ptp(run.position_m[stopped:]) == 0.0
    assert (run.tyre_force_n[200:stopped] < 0.0).all()  # no sign chatter on the way
    slides = (run.wheel_speed_rad_s[stopped // 2] == 0.0).all()
    assert slides == locks
    if locks:
        decel = 0.79 * 0.3 * 9.81
        drag = 0.0 if car is NOMINAL else 0.01
        assert run.accel_x_m_s2[stopped // 2] == pytest.approx(-decel, abs=1e-9 + drag)


@settings(max_examples=30, deadline=None)
@given(
    torques=st.lists(st.lists(st.floats(-2000.0, 2000.0), min_size=4, max_size=4), min_size=2, max_size=8),
    speed=st.floats(0.0, 20.0),
    theta=st.floats(0.1, 1.0),
    step_s=st.sampled_from([5e-4, 1e-3, 5e-3]),
    length_m=st.sampled_from([0.0, 0.003, 0.3, 3.0]),
    stiffness=st.floats(1e2, 1e6),
    motor_inertia=st.sampled_from([0.0, 0.05, 0.9]),
)
def test_stays_bounded_whatever_the_torque(torques, speed, theta, step_s, length_m, stiffness, motor_inertia):
    torque = np.repeat(np.array(torques), 40, axis=0)
    shaft = {"stiffness_nm_rad": stiffness, "damping_nm_s_rad": 5.0, "motor_inertia_kg_m2": motor_inertia}
    car = with_effects(**CAR.effects, tyre_relaxation={"length_m": length_m}, driveline_compliance=shaft)
    run = simulate(car, make_road((0.0, theta, theta), (5.0, 0.2, 0.9)), torque, step_s, speed)
    for field in fields(run):
        assert np.isfinite(getattr(run, field.name)).all()
    assert (run.speed_m_s >= 0.0).all()
    assert (run.wheel_speed_rad_s >= 0.0).all()
    assert (run.slip <= 1.0).all()
    # A lagging force may still be what the load and the road of a moment ago allowed.
    grip_n = run.theta.max() * run.vertical_load_n.max() if length_m else run.theta * run.vertical_load_n
    assert (np.abs(run.tyre_force_n) <= 1.28 * grip_n + 1e-9).all()
    assert (np.diff(run.position_m) >= 0.0).all()


@settings(max_examples=15, deadline=None)
@given(
    knots=st.lists(st.floats(-250.0, 320.0), min_size=3, max_size=8),
    theta=st.floats(0.2, 1.0),
    speed=st.floats(3.0, 12.0),
)
def test_energy_is_conserved(knots, theta, speed):
    """Work of the motors = kinetic energy gained + slip losses + rolling losses + drag losses."""
    duration_s = 1.0
    times = np.linspace(0.0, duration_s, len(knots))
    car = with_effects(
        load_transfer={"cog_height_m": 0.5},
        rolling_resistance={"coefficient": 0.03},
        aero_drag={"drag_area_m2": 2.0},
    )
    run = simulate(
        car, make_road((0.0, theta, theta)), profile(list(zip(times, knots, strict=True)), 1.0), 1e-3, speed
    )
    radius, inertia = CAR.wheel_radius_m, CAR.wheel_inertia_kg_m2
    omega, v = run.wheel_speed_rad_s, run.speed_m_s
    power = (run.wheel_torque_nm * omega).sum(1)
    losses = (run.tyre_force_n * (omega * radius - v[:, None])).sum(1)
    losses += (0.03 * run.vertical_load_n * radius * omega).sum(1) + 0.5 * 1.225 * 2.0 * v**3
    kinetic = 0.5 * CAR.mass_kg * v**2 + 0.5 * inertia * (omega**2).sum(1)
    scale = np.trapezoid(np.abs(power) + np.abs(losses), run.time_s) + 1.0
    gained = kinetic[-1] - kinetic[0]
    assert gained == pytest.approx(np.trapezoid(power - losses, run.time_s), abs=5e-3 * scale)


@pytest.mark.parametrize("rows", [1, 2, 7, 200])
@pytest.mark.parametrize("effects", [{}, EVERYTHING], ids=["as it is", "everything"])
def test_a_run_leaves_the_state_at_its_last_row(effects, rows):
    """Drivers go on from there: what looks ahead pulse by pulse, and the rig's car block by block."""
    setup = make_setup(with_effects(**effects), DRY)
    y = dynamics.initial_y(5.0, 0.0, setup.parameters)
    states = dynamics.run(y, constant(200.0, (rows - 1) * 1e-3), 1e-3, setup.parameters, setup.road)[0]
    assert len(states) == rows
    np.testing.assert_array_equal(y[: states.shape[1]], states[-1])


@pytest.mark.parametrize("car", [CAR, with_effects(**EVERYTHING)], ids=["as it is", "everything"])
def test_step_by_step_is_the_same_motion_bit_for_bit(car):
    road = make_road((0.0, 0.9, 0.9), (0.5, 0.3, 0.5))
    torque = profile([(0.0, 0.0), (0.1, 300.0), (0.6, 300.0), (0.7, -500.0), (1.0, -500.0)], 1.0)
    torque[:, 1] *= 0.9
    whole = simulate(car, road, torque, 1e-3, initial_position_m=-TO_FRONT_M)
    state = initial_state(car, road, initial_position_m=-TO_FRONT_M)
    for k in range(1, len(torque)):
        state = advance(state, torque[k], 1e-3)
        assert state.time_s == pytest.approx(whole.time_s[k])
        assert state.position_m == whole.position_m[k]
        assert state.speed_m_s == whole.speed_m_s[k]
        assert state.accel_x_m_s2 == whole.accel_x_m_s2[k]
        assert state.wheel_speed_rad_s == tuple(whole.wheel_speed_rad_s[k])
        assert (state.wheels.force_n == whole.tyre_force_n[k]).all()


PLAIN_PYTHON = """
import numpy as np
from plant_drives import EVERYTHING, make_road, profile, with_effects
from scenarios.plant.pipeline import simulate
torque = profile([(0.0, 0.0), (0.02, 300.0), (0.05, -500.0)], 0.08)
run = simulate(with_effects(**EVERYTHING), make_road((0.0, 0.9, 0.9), (1.3, 0.3, 0.5)), torque, 1e-3, 1.0)
np.save("run.npy", np.column_stack([run.speed_m_s, run.wheel_speed_rad_s, run.tyre_force_n]))
"""


def test_compiled_code_does_what_it_says_in_plain_python(tmp_path):
    """Plain Python checks every index; compiled code reads what lies beyond an array's end."""
    results = []
    for disabled in ("0", "1"):
        paths = os.pathsep.join([str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])])
        env = {**os.environ, "NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": paths}
        subprocess.run([sys.executable, "-c", PLAIN_PYTHON], check=True, cwd=tmp_path, env=env)
        results.append(np.load(tmp_path / "run.npy"))
    assert results[0].shape == (81, 9)
    assert results[0] == pytest.approx(results[1], rel=1e-9, abs=1e-9)


def test_theta_is_that_of_each_wheels_own_contact():
    road = make_road((0.0, 0.9, 0.8), (2.0, 0.3, 0.4))
    run = simulate(NOMINAL, road, constant(0.0, 1.0), 1e-3, 5.0, -1.0)
    front, rear = run.position_m + TO_FRONT_M, run.position_m - TO_REAR_M
    edge = np.minimum(np.abs(front - 2.0), np.abs(rear - 2.0)) < 1e-6
    assert (run.theta[~edge, 0] == np.where(front < 2.0, 0.9, 0.3)[~edge]).all()
    assert (run.theta[~edge, 1] == np.where(front < 2.0, 0.8, 0.4)[~edge]).all()
    assert (run.theta[~edge, 2] == np.where(rear < 2.0, 0.9, 0.3)[~edge]).all()
    assert (run.theta[~edge, 3] == np.where(rear < 2.0, 0.8, 0.4)[~edge]).all()
    assert len(np.unique(run.theta[:, 0])) == len(np.unique(run.theta[:, 2])) == 2


@pytest.mark.parametrize("torque", [250.0, -250.0])
def test_each_tyre_pulls_as_the_road_at_its_own_contact_lets_it(torque):
    """The rear axle comes onto the slippery road a wheelbase after the front one, and each side has its own."""
    run = simulate(
        NOMINAL, make_road((0.0, 0.9, 0.8), (2.0, 0.25, 0.35)), constant(torque, 0.6), 1e-3, 8.0, -1.0
    )
    contact = run.position_m[:, None] + [TO_FRONT_M, TO_FRONT_M, -TO_REAR_M, -TO_REAR_M]
    theta = np.where(contact < 2.0, [0.9, 0.8, 0.9, 0.8], [0.25, 0.35, 0.25, 0.35])
    sliding = np.maximum(run.wheel_speed_rad_s * CAR.wheel_radius_m / run.speed_m_s[:, None], 1e-9)
    slip = np.abs(sliding - 1.0) / np.maximum(sliding, 1.0)
    load = CAR.mass_kg * 9.81 * np.array([TO_REAR_M] * 2 + [TO_FRONT_M] * 2) / (2.0 * 2.305)
    expected = [
        [
            tyre.force(*at, CAR.tyre.longitudinal_stiffness_n, np.sign(torque))
            for at in zip(*row, load, strict=True)
        ]
        for row in zip(theta, slip, strict=True)
    ]
    apart = np.abs(contact - 2.0).min(axis=1) > 1e-3
    assert run.tyre_force_n[apart][1:] == pytest.approx(np.array(expected)[apart][1:], abs=0.5)
    assert len(np.unique(theta[apart], axis=0)) == 3, "both axles cross the border, one after the other"


def test_accelerometer_reads_the_change_of_speed_on_a_flat_road():
    run = simulate(CAR, DRY, profile([(0.0, 0.0), (0.3, 200.0), (1.0, -100.0)], 1.0), 1e-3, 5.0)
    assert np.gradient(run.speed_m_s, run.time_s)[5:-5] == pytest.approx(run.accel_x_m_s2[5:-5], abs=2e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"wheel_torque_nm": np.zeros((10, 3))}, r"shape \(10, 3\)"),
        ({"wheel_torque_nm": np.full((10, 4), np.nan)}, "not finite at row 0"),
        ({"step_s": 0.0}, "step_s is 0.0"),
        ({"initial_speed_m_s": -1.0}, "initial_speed_m_s is -1.0"),
    ],
)
def test_bad_input_is_named(changes, message):
    arguments = {"wheel_torque_nm": np.zeros((10, 4)), "step_s": 1e-3, **changes}
    with pytest.raises(ScenarioError, match=message):
        simulate(CAR, DRY, **arguments)


@pytest.fixture(scope="module")
def paper():
    scenario = load_scenario(SCENARIOS / "paper_simulation.yaml")
    return scenario, drive(scenario)


def test_paper_scenario_meets_the_papers_events(paper):
    scenario, run = paper
    front = run.position_m + TO_FRONT_M
    assert run.speed_m_s[0] == 0.0
    assert front[0] == pytest.approx(0.0)
    assert front[-2] < scenario.end.position_m <= front[-1]
    low_s, middle_s = run.time_s[np.argmax(front >= 20.0)], run.time_s[np.argmax(front >= 40.0)]
    assert low_s == pytest.approx(5.14, abs=0.15)
    assert middle_s == pytest.approx(7.85, abs=0.15)
    coasting = run.wheel_torque_nm[(run.time_s >= middle_s) & (run.time_s < 8.14)]
    assert not coasting.any()
    assert run.wheel_torque_nm[(run.time_s > 8.16) & (run.time_s < 8.5)].all()


def test_paper_scenario_excites_the_slippery_parts_only(paper):
    _, run = paper
    front = run.position_m + TO_FRONT_M
    used = np.abs(run.tyre_force_n[:, 0]) / run.vertical_load_n[:, 0] / run.theta[:, 0]
    high, low, middle = front < 20.0, (front >= 20.0) & (front < 40.0), front >= 40.0
    assert used[high].max() < 0.45
    assert (used[low] > 0.75).sum() * 1e-3 > 1.2
    # The motors' peak leaves no more than this on 0.5; theta shows from 0.62 theta of used friction on.
    assert (used[middle] > 0.68).sum() * 1e-3 > 1.2
    assert run.slip[:, :2].max() < 0.15
    excited = np.flatnonzero(np.diff((used > 0.68).astype(int)))
    lengths = [b - a for a, b in pairwise(excited)][::2]
    assert all(200 <= n <= 500 for n in lengths)


def test_log_has_the_contracts_columns_and_the_curves_maximum(paper):
    _, run = paper
    log = make_log(run, CAR)
    wheels = ("fl", "fr", "rl", "rr")
    assert list(log.columns) == [
        "time_s", *(f"wheel_torque_{w}_nm" for w in wheels), *(f"wheel_speed_{w}_rad_s" for w in wheels),
        "vehicle_speed_m_s", "accel_x_m_s2", "position_m", "mu_reference",
    ]  # fmt: skip
    assert (log["vehicle_speed_m_s"] == run.speed_m_s).all()
    slips = np.linspace(1e-4, 0.6, 20_000)
    for theta in (0.9, 0.3, 0.5):
        peak = max(tyre_force(theta, s, 3411.48, 5e4)[0] for s in slips) / 3411.48
        found = log["mu_reference"][run.theta[:, 0] == theta]
        assert found.to_numpy() == pytest.approx(peak, abs=1e-4)
        assert peak > 1.02 * theta


def test_reference_on_split_friction_is_the_mean_of_the_front_wheels_maxima():
    run = simulate(NOMINAL, make_road((0.0, 0.3, 0.9), (2.0, 0.5, 0.5)), constant(0.0, 0.5), 1e-3, 5.0, -1.0)
    left, right, both = (tyre.peak_friction(theta, 3411.48, 5e4) for theta in (0.3, 0.9, 0.5))
    front = run.position_m + TO_FRONT_M
    expected = np.where(front < 2.0, 0.5 * (left + right), both)
    assert make_log(run, NOMINAL)["mu_reference"].to_numpy() == pytest.approx(expected, abs=1e-4)


def test_noise_has_the_stated_size_and_repeats_with_its_seed(paper):
    _, run = paper
    noise = SensorNoise(
        wheel_speed_noise_rad_s=0.03,
        wheel_torque_noise_nm=3.2,
        vehicle_speed_noise_m_s=0.014,
        accel_x_noise_m_s2=0.05,
    )
    ideal, noisy = make_log(run, CAR), make_log(run, CAR, noise, seed=7)
    residual = (noisy - ideal).std()
    assert residual["wheel_speed_rl_rad_s"] == pytest.approx(0.03, rel=0.03)
    assert residual["wheel_torque_fr_nm"] == pytest.approx(3.2, rel=0.03)
    assert residual["vehicle_speed_m_s"] == pytest.approx(0.014, rel=0.03)
    assert residual["accel_x_m_s2"] == pytest.approx(0.05, rel=0.03)
    assert residual[["time_s", "position_m", "mu_reference"]].eq(0.0).all()
    independent = (noisy - ideal)[["wheel_speed_fl_rad_s", "wheel_speed_fr_rad_s"]].corr().iloc[0, 1]
    assert abs(independent) < 0.05
    pd.testing.assert_frame_equal(noisy, make_log(run, CAR, noise, seed=7))
    assert not noisy.equals(make_log(run, CAR, noise, seed=8))


def test_written_log_reads_back_unchanged(paper, tmp_path):
    _, run = paper
    log = make_log(run.rows(50), CAR, SensorNoise(accel_x_noise_m_s2=0.05), seed=1)
    write_log(log, tmp_path / "new" / "log.csv")
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "new" / "log.csv"), log, check_exact=False, rtol=1e-15
    )


def test_peak_torque_uses_seven_tenths_of_the_grip_on_the_middle_friction():
    """The balance by hand: rotating parts and load transfer included, at a constant 320 N m."""
    car = with_effects(load_transfer={"cog_height_m": 0.54})
    run = simulate(car, make_road((0.0, 0.5, 0.5)), constant(320.0, 0.5), 1e-3, 8.0)
    accel = 4.0 * 320.0 / 0.29 / (1343.8 + 4.0 * 1.2 / 0.29**2)
    force = 1343.8 * accel / 4.0
    load = 1343.8 * (9.81 * 1.193 - accel * 0.54) / (2.0 * 2.305)
    used = abs(run.tyre_force_n[-1, 0]) / run.vertical_load_n[-1, 0]
    assert used == pytest.approx(force / load, rel=0.01)
    assert used / 0.5 == pytest.approx(0.725, abs=0.01)  # in the scenario also drag and rolling: 0.71


@pytest.mark.parametrize("height_m", [0.0, 0.54])
def test_the_tyres_forces_alone_change_the_momentum_even_with_locked_wheels(height_m):
    """A standing car's flag was once read beyond its array's end, and locked wheels lost half their force."""
    effects = {"load_transfer": {"cog_height_m": height_m}} if height_m else {}
    knots = [(0.0, 0.0), (0.2, 0.0), (0.4, -1000.0), (1.2, -1000.0)]
    run = simulate(with_effects(**effects), ICE, profile(knots, 1.2), 1e-3, 15.0, 0.0)
    assert run.wheel_speed_rad_s[-1].max() == 0.0, "the manoeuvre must lock the wheels"
    impulse = np.trapezoid(run.tyre_force_n.sum(axis=1), dx=1e-3)
    assert CAR.mass_kg * (run.speed_m_s[-1] - run.speed_m_s[0]) == pytest.approx(impulse, rel=2e-3)
