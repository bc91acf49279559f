"""Each effect of actuators, dynamics and road against an oracle of its own: closed forms, SciPy, linear algebra."""

from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.signal import StateSpace, lsim

from scenarios.effects import form_of
from scenarios.effects.rolling_resistance import RollingResistanceForce
from scenarios.files import RoadFile, VehicleFile, load_vehicle
from scenarios.plant import dynamics
from scenarios.plant.parameters import MOTOR, POSITION, SPEED, TWIST, WHEEL
from scenarios.plant.pipeline import actual_torque, make_setup, simulate
from trpac_core.tyre import force as tyre_force

CAR = load_vehicle(
    Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml"
).model_copy(update={"effects": {}})
MASS, RADIUS, INERTIA = CAR.mass_kg, CAR.wheel_radius_m, CAR.wheel_inertia_kg_m2
STIFFNESS = CAR.tyre.longitudinal_stiffness_n
ROLLING_MASS = MASS + 4.0 * INERTIA / RADIUS**2
"""What coasting decelerates: the car and its turning wheels [kg]."""
G = 9.81
LOCKED = 0.79
"""Share of theta that a locked modified Dugoff tyre keeps: its shape function at slip 1."""


def car_with(forms=MappingProxyType({}), **effects):
    return VehicleFile.model_validate(
        {**CAR.model_dump(by_alias=True), "effects": effects, "forms": dict(forms)}
    )


def make_road(theta):
    row = {"start_m": 0.0, "mu_left": theta, "mu_right": theta, "surface": "dry"}
    return RoadFile.model_validate({"schema": 1, "segments": [row]})


DRY, ICE = make_road(0.9), make_road(0.3)


def drive(car, torque_nm, duration_s, speed=0.0, road=DRY, step_s=1e-3):
    """Constant torque, or torque through (time, torque) knots, at all wheels."""
    time_s = np.arange(round(duration_s / step_s) + 1) * step_s
    knots = torque_nm if isinstance(torque_nm, list) else [(0.0, torque_nm)]
    times, torques = zip(*knots, strict=True)
    torque = np.repeat(np.interp(time_s, times, torques)[:, None], 4, axis=1)
    return simulate(car, road, torque, step_s, speed)


def settled_acceleration(run):
    """Mean acceleration once the slip has settled [m/s^2]."""
    after = run.time_s > 0.3
    return np.polyfit(run.time_s[after], run.speed_m_s[after], 1)[0]


class TestGrade:
    UP = 0.08
    ALONG = G * 0.08 / np.hypot(1.0, 0.08)

    def test_coasting_uphill_slows_linearly_then_rests(self):
        run = drive(car_with(road_grade={"grade": self.UP}), 0.0, 6.0, 3.0)
        decel = MASS * self.ALONG / ROLLING_MASS
        stop_s = 3.0 / decel
        moving = run.time_s < stop_s - 0.05
        assert run.speed_m_s[moving] == pytest.approx(3.0 - decel * run.time_s[moving], abs=3e-3)
        resting = run.time_s > stop_s + 0.05
        assert resting.sum() > 1000
        assert not run.speed_m_s[resting].any()
        assert np.ptp(run.position_m[resting]) == 0.0
        # Held by the ground, an accelerometer reads gravity's part along the road.
        assert run.accel_x_m_s2[resting] == pytest.approx(self.ALONG, rel=1e-12)

    @pytest.mark.parametrize("grade", [-0.15, 0.15])
    def test_accelerometer_reads_the_change_of_speed_and_gravitys_part(self, grade):
        run = drive(car_with(road_grade={"grade": grade}), [(0.0, 0.0), (0.3, 150.0), (1.0, 50.0)], 1.0, 10.0)
        along = G * np.sin(np.arctan(grade))
        change = np.gradient(run.speed_m_s, run.time_s)
        assert run.accel_x_m_s2[5:-5] == pytest.approx(change[5:-5] + along, abs=2e-3)
        assert run.vertical_load_n.sum(1) == pytest.approx(MASS * G * np.cos(np.arctan(grade)), rel=1e-12)

    def test_a_parked_car_rolls_downhill_only(self):
        assert drive(car_with(road_grade={"grade": -0.05}), 0.0, 1.0).speed_m_s[-1] > 0.3
        assert not drive(car_with(road_grade={"grade": 0.05}), 0.0, 1.0).speed_m_s.any()

    def test_brakes_hold_it_downhill(self):
        run = drive(car_with(road_grade={"grade": -0.05}), -300.0, 3.0)
        assert run.speed_m_s[-1] < 1e-3  # what is left is the tyre's creep at its floor speed
        assert run.position_m[-1] < 1e-3
        assert run.accel_x_m_s2[-1] == pytest.approx(G * np.sin(np.arctan(-0.05)), rel=1e-3)

    def test_torque_below_the_slopes_pull_does_not_start_the_car(self):
        pull_nm = MASS * self.ALONG * RADIUS / 4.0
        car = car_with(road_grade={"grade": self.UP})
        assert drive(car, 0.98 * pull_nm, 2.0).position_m[-1] < 1e-6
        assert drive(car, 1.05 * pull_nm, 2.0).speed_m_s[-1] > 0.01


@pytest.mark.parametrize("payload_kg", [-250.0, 400.0])
def test_payload_counts_as_mass_and_load(payload_kg):
    run = drive(car_with(mass_offset={"mass_kg": payload_kg}), 100.0, 1.5, 15.0)
    mass = MASS + payload_kg
    expected = 4.0 * 100.0 / RADIUS / (mass + 4.0 * INERTIA / RADIUS**2)
    assert settled_acceleration(run) == pytest.approx(expected, rel=2e-3)
    assert run.vertical_load_n.sum(1) == pytest.approx(mass * G, rel=1e-12)


@pytest.mark.parametrize("radius_m", [0.27, 0.31])
def test_true_radius_sets_free_rolling_and_lever(radius_m):
    car = car_with(wheel_radius_offset={"radius_m": radius_m})
    rolling = drive(car, 0.0, 0.5, 20.0)
    assert rolling.speed_m_s[-1] / rolling.wheel_speed_rad_s[-1] == pytest.approx(radius_m, rel=1e-6)
    expected = 400.0 / radius_m / (MASS + 4.0 * INERTIA / radius_m**2)
    assert settled_acceleration(drive(car, 100.0, 1.5, 15.0)) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("behind_m", [-0.5, 0.9])
def test_a_payload_that_lies_somewhere_loads_the_axles_by_its_moments(behind_m):
    placed = {"mass_offset": {"mass_kg": 300.0, "behind_m": behind_m}}
    run = drive(car_with({"mass_offset": "where it lies"}, **placed), 0.0, 0.2, 10.0)
    core = CAR.to_core()
    base_m = core.wheelbase_m
    rear_n = (MASS * core.cog_to_front_axle_m + 300.0 * (core.cog_to_front_axle_m + behind_m)) * G / base_m
    assert run.vertical_load_n[0, 2:].sum() == pytest.approx(rear_n, rel=1e-9)
    assert run.vertical_load_n[0].sum() == pytest.approx((MASS + 300.0) * G, rel=1e-12)


def test_tyres_that_resist_more_in_front_hold_the_car_by_each_axles_load():
    values = {"rolling_resistance": {"coefficient": 0.02, "unlike": 0.5}}
    run = drive(car_with({"rolling_resistance": "axles unlike"}, **values), 0.0, 1.5, 15.0)
    load_n = run.vertical_load_n[-1]
    resisting_n = np.array([0.03, 0.03, 0.01, 0.01]) * load_n
    expected = -resisting_n.sum() / (MASS + 4.0 * INERTIA / RADIUS**2)
    assert settled_acceleration(run) == pytest.approx(expected, rel=2e-3)


def settled_slips(run):
    """Of the front and the rear left wheel at the end, signed [-]."""
    rim = run.wheel_speed_rad_s[-1, [0, 2]] * RADIUS
    return rim / run.speed_m_s[-1] - 1.0


def test_brakes_that_drag_more_in_front_slow_the_front_wheels_more():
    values = {"brake_drag": {"torque_nm": 40.0, "unlike": 0.5}}
    run = drive(car_with({"brake_drag": "axles unlike"}, **values), 0.0, 1.5, 25.0)
    front, rear = settled_slips(run)
    spun_nm = -INERTIA * settled_acceleration(run) / RADIUS
    assert front < rear < 0.0
    assert front / rear == pytest.approx((60.0 - spun_nm) / (20.0 - spun_nm), rel=0.02)


def test_front_wheels_of_more_inertia_take_more_of_their_torque_for_themselves():
    values = {"wheel_inertia_offset": {"inertia_kg_m2": 2.0, "unlike": 0.5}}
    run = drive(car_with({"wheel_inertia_offset": "axles unlike"}, **values), 200.0, 1.5, 10.0)
    spin_up = settled_acceleration(run) / RADIUS
    front, rear = settled_slips(run)
    assert front / rear == pytest.approx((200.0 - 3.0 * spin_up) / (200.0 - 1.0 * spin_up), rel=0.02)


def test_a_tyre_that_softens_with_its_load_never_pushes():
    """Hard braking on much load transfer takes the rear wheels' load: their stiffness goes, and stays one."""
    car = car_with(
        {"tyre_stiffness_offset": "with load"},
        tyre_stiffness_offset={"stiffness_n": 50_000.0, "by_load": 1.5},
        load_transfer={"cog_height_m": 0.9},
    )
    run = drive(car, -1500.0, 1.0, 25.0)
    assert np.diff(run.speed_m_s).min() > -1.3 * G * np.diff(run.time_s).max()
    assert (run.vertical_load_n >= 0.0).all()


def test_axles_of_unlike_radius_roll_at_unlike_speeds():
    values = {"wheel_radius_offset": {"radius_m": 0.3, "unlike": 0.01}}
    run = drive(car_with({"wheel_radius_offset": "axles unlike"}, **values), 0.0, 1.0, 20.0)
    speeds = run.wheel_speed_rad_s[-1]
    assert speeds[0] == speeds[1]
    assert speeds[2] == speeds[3]
    slips = 1.0 - run.speed_m_s[-1] / (speeds[[0, 2]] * [0.303, 0.297])
    assert slips == pytest.approx(0.0, abs=1e-4)


def test_each_wheel_rolls_with_its_own_radius():
    values = {"radius_m": 0.3, "unlike": 0.01, "front_sides": 0.004, "rear_sides": -0.002}
    form = "each wheel its own"
    car = car_with({"wheel_radius_offset": form}, wheel_radius_offset=values)
    levers = np.array([0.3042, 0.3018, 0.2964, 0.2976])
    run = drive(car, 0.0, 1.0, 20.0)
    slips = 1.0 - run.speed_m_s[-1] / (run.wheel_speed_rad_s[-1] * levers)
    assert slips == pytest.approx(0.0, abs=1e-4)
    expected = (100.0 / levers).sum() / (MASS + (INERTIA / levers**2).sum())
    assert settled_acceleration(drive(car, 100.0, 1.5, 15.0)) == pytest.approx(expected, rel=2e-3)


def test_one_wrong_wheel_is_no_car_on_other_wheels():
    def of(fl, fr, rl, rr):
        mean = (fl + fr + rl + rr) / 4.0
        values = (fl + fr - rl - rr, 2.0 * (fl - fr), 2.0 * (rl - rr))
        return form_of("wheel_radius_offset", "each wheel its own")(
            RADIUS * (1.0 + mean), *(v / (4.0 * (1.0 + mean)) for v in values)
        )

    car = CAR.to_core()
    unlike = of(0.01, 0.02, 0.015, 0.005)
    assert unlike.per_wheel(unlike.radius_m) == pytest.approx(RADIUS * np.array([1.01, 1.02, 1.015, 1.005]))
    assert unlike.is_itself(car)
    assert of(-0.01, -0.02, -0.015, -0.005).is_itself(car)
    assert not of(0.0, 0.0, 0.02, 0.0).is_itself(car)
    assert not of(0.02, 0.02, 0.0, 0.0).is_itself(car)
    assert not of(0.02, 0.02, 0.02, -0.01).is_itself(car)


def test_what_rolls_alone_leaves_the_lever():
    car = car_with({"wheel_radius_offset": "rolling alone"}, wheel_radius_offset={"radius_m": 0.31})
    rolling = drive(car, 0.0, 0.5, 20.0)
    assert rolling.speed_m_s[-1] / rolling.wheel_speed_rad_s[-1] == pytest.approx(0.31, rel=1e-6)
    expected = 400.0 / RADIUS / (MASS + 4.0 * INERTIA / RADIUS / 0.31)
    assert settled_acceleration(drive(car, 100.0, 1.5, 15.0)) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("by_load", [0.5, 1.0])
def test_stiffness_goes_with_each_wheels_load(by_load):
    values = {
        "tyre_stiffness_offset": {"stiffness_n": 50_000.0, "by_load": by_load},
        "load_transfer": {"cog_height_m": 0.6},
    }
    run = drive(car_with({"tyre_stiffness_offset": "with load"}, **values), 150.0, 0.5, 10.0)
    for wheel in (0, 3):
        slip, load = run.slip[-1, wheel], run.vertical_load_n[-1, wheel]
        stiffness_n = 50_000.0 * (1.0 + by_load * (load / (0.25 * MASS * G) - 1.0))
        assert run.tyre_force_n[-1, wheel] == pytest.approx(
            tyre_force(0.9, slip, load, stiffness_n, 1.0), rel=1e-9
        )


@pytest.mark.parametrize("exponent", [0.8, 1.0])
def test_stiffness_goes_with_a_power_of_each_wheels_load(exponent):
    """A payload loads the tyres beyond F_z0, the mean static load of the car in the file; load transfer shifts it."""
    values = {
        "mass_offset": {"mass_kg": 300.0},
        "load_transfer": {"cog_height_m": 0.6},
        "tyre_load_stiffness": {"exponent": exponent},
    }
    run = drive(car_with(**values), 150.0, 0.5, 10.0)
    for wheel in (0, 3):
        slip, load = run.slip[-1, wheel], run.vertical_load_n[-1, wheel]
        assert load > 1.05 * 0.25 * MASS * G
        stiffness_n = STIFFNESS * (load / (0.25 * MASS * G)) ** exponent
        assert run.tyre_force_n[-1, wheel] == pytest.approx(
            tyre_force(0.9, slip, load, stiffness_n, 1.0), rel=1e-9
        )


def test_stiffness_that_goes_with_the_load_makes_the_slip_of_a_payload_that_of_the_empty_car():
    """With an exponent of 1 a force in proportion to the load takes the same slip, whatever the load."""
    payload, by_load = {"mass_kg": 400.0}, {"exponent": 1.0}
    torque_nm = 150.0 * (MASS + 400.0) / MASS
    empty = drive(car_with(tyre_load_stiffness=by_load), 150.0, 0.5, 10.0)
    loaded = drive(car_with(tyre_load_stiffness=by_load, mass_offset=payload), torque_nm, 0.5, 10.0)
    constant = drive(car_with(mass_offset=payload), torque_nm, 0.5, 10.0)
    assert loaded.slip[-1] == pytest.approx(empty.slip[-1], rel=0.02)
    assert constant.slip[-1, 0] > 1.2 * empty.slip[-1, 0]


def test_a_wheel_that_load_leaves_keeps_a_finite_stiffness():
    values = {"load_transfer": {"cog_height_m": 1.5}, "tyre_load_stiffness": {"exponent": 1.5}}
    run = drive(car_with(**values), -1200.0, 1.0, 15.0)
    assert run.vertical_load_n[:, 3].min() < 0.12 * 0.25 * MASS * G
    assert all(np.isfinite(getattr(run, name)).all() for name in ("tyre_force_n", "speed_m_s", "slip"))
    assert (np.abs(run.tyre_force_n) <= 1.28 * 0.9 * run.vertical_load_n + 1e-9).all()


def test_each_tyre_has_a_stiffness_of_its_own():
    values = {"stiffness_n": 50_000.0, "unlike": 0.1, "front_sides": 0.2, "rear_sides": -0.3}
    form = {"tyre_stiffness_offset": "each wheel its own"}
    run = drive(car_with(form, tyre_stiffness_offset=values), 150.0, 0.5, 10.0)
    for wheel, share in enumerate((1.3, 0.9, 0.6, 1.2)):
        slip, load = run.slip[-1, wheel], run.vertical_load_n[-1, wheel]
        force_n = tyre_force(0.9, slip, load, share * 50_000.0, 1.0)
        assert run.tyre_force_n[-1, wheel] == pytest.approx(force_n, rel=1e-9)


@pytest.mark.parametrize("inertia", [0.6, 3.0])
def test_true_inertia_sets_how_a_wheel_spins_up(inertia):
    """A spinning wheel: I omega' = T - F R with the force that the log holds."""
    run = drive(car_with(wheel_inertia_offset={"inertia_kg_m2": inertia}), 600.0, 0.6, 5.0, ICE)
    rate = np.gradient(run.wheel_speed_rad_s[:, 0], run.time_s)[20:-20]
    balance = (600.0 - run.tyre_force_n[20:-20, 0] * RADIUS) / rate
    assert run.slip[-1, 0] > 0.5
    assert np.median(balance) == pytest.approx(inertia, rel=1e-3)


@pytest.mark.parametrize("stiffness_n", [20_000.0, 90_000.0])
def test_true_stiffness_sets_slip_per_force(stiffness_n):
    run = drive(car_with(tyre_stiffness_offset={"stiffness_n": stiffness_n}), 150.0, 0.5, 10.0)
    for wheel in (0, 3):
        slip, load = run.slip[-1, wheel], run.vertical_load_n[-1, wheel]
        assert run.tyre_force_n[-1, wheel] == pytest.approx(
            tyre_force(0.9, slip, load, stiffness_n, 1.0), rel=1e-9
        )
    assert run.slip[-1, 0] * stiffness_n == pytest.approx(run.tyre_force_n[-1, 0] / 1.27, rel=0.03)


def test_friction_offset_scales_what_a_locked_wheel_keeps():
    run = drive(car_with(friction_offset={"factor": 0.6}), -2000.0, 0.6, 15.0)
    assert not run.wheel_speed_rad_s[-1].any()
    assert run.accel_x_m_s2[-1] == pytest.approx(-LOCKED * 0.6 * 0.9 * G, rel=1e-6)


def test_mu_split_gives_each_side_its_own_friction():
    run = drive(car_with(mu_split={"left_factor": 0.4, "right_factor": 1.1}), -2500.0, 0.8, 15.0, ICE)
    used = run.tyre_force_n[-1] / run.vertical_load_n[-1]
    assert not run.wheel_speed_rad_s[-1].any()
    assert used[[0, 2]] == pytest.approx(-LOCKED * 0.4 * 0.3, rel=1e-6)
    assert used[[1, 3]] == pytest.approx(-LOCKED * 1.1 * 0.3, rel=1e-6)


@pytest.mark.parametrize(
    ("form", "share"),
    [("exponential", lambda fallen: np.exp(-fallen)), ("hyperbolic", lambda fallen: 1.0 / (1.0 + fallen))],
)
def test_friction_falls_with_sliding_speed_along_a_locked_stop(form, share):
    car = car_with({"friction_falloff": form}, friction_falloff={"falloff_s_m": 0.1, "floor": 0.4})
    run = drive(car, -2500.0, 6.0, 20.0)
    locked = (run.wheel_speed_rad_s == 0.0).all(axis=1) & (run.speed_m_s > 0.1)
    theta = 0.9 * (0.4 + 0.6 * share(0.1 * run.speed_m_s[locked]))
    assert locked.sum() > 1500
    assert run.accel_x_m_s2[locked] == pytest.approx(-LOCKED * theta * G, rel=1e-6)
    assert np.ptp(theta) > 0.15


def test_brake_drag_slows_linearly_then_holds():
    drag_nm = 40.0
    run = drive(car_with(brake_drag={"torque_nm": drag_nm}), 0.0, 6.0, 2.0)
    decel = 4.0 * drag_nm / RADIUS / ROLLING_MASS
    stop_s = 2.0 / decel
    moving = run.time_s < stop_s - 0.05
    assert run.speed_m_s[moving] == pytest.approx(2.0 - decel * run.time_s[moving], abs=2e-3)
    assert not run.speed_m_s[run.time_s > stop_s + 0.05].any()
    car = car_with(brake_drag={"torque_nm": drag_nm})
    assert not drive(car, 0.99 * drag_nm, 0.5).speed_m_s.any()
    assert drive(car, 1.2 * drag_nm, 0.5).speed_m_s[-1] > 0.0


class TestActuators:
    STEP_S = 2e-3
    TIME = np.arange(800) * 2e-3

    @pytest.fixture
    def command(self):
        knots = np.random.default_rng(3).uniform(-300.0, 300.0, (17, 4))
        return np.column_stack([np.interp(self.TIME, np.linspace(0.0, 1.6, 17), k) for k in knots.T])

    def actuate(self, command, **effects):
        return actual_torque(car_with(**effects), self.TIME, command)

    def test_gain(self, command):
        assert (self.actuate(command, torque_gain={"factor": 0.8}) == 0.8 * command).all()

    def test_gain_of_driving_and_of_braking(self, command):
        values = {"torque_gain": {"factor": 0.9, "apart": 0.05}}
        made = self.actuate(command, forms={"torque_gain": "driving and braking unlike"}, **values)
        assert made == pytest.approx(np.where(command > 0.0, 0.95, 0.85) * command, rel=1e-12)

    @pytest.mark.parametrize("time_constant_s", [1e-4, 0.02, 0.3, 2.0])
    def test_lag_agrees_with_scipys_linear_simulation(self, command, time_constant_s):
        lagged = self.actuate(command, torque_lag={"time_constant_s": time_constant_s})
        rate = 1.0 / time_constant_s
        system = StateSpace([[-rate]], [[rate]], [[1.0]], [[0.0]])
        for wheel in range(4):
            _, expected, _ = lsim(system, command[:, wheel], self.TIME, X0=[command[0, wheel]], interp=True)
            assert lagged[:, wheel] == pytest.approx(expected, abs=1e-6)

    def test_lag_holds_a_constant_command(self):
        still = np.full((800, 4), -123.0)
        lagged = self.actuate(still, torque_lag={"time_constant_s": 0.1})
        assert lagged == pytest.approx(still, rel=1e-12)

    @pytest.mark.parametrize("apart", [-0.6, 0.3])
    def test_a_lag_of_rise_and_fall_agrees_with_the_differential_equation(self, command, apart):
        values = {"torque_lag": {"time_constant_s": 0.05, "apart": apart}}
        lagged = self.actuate(command, forms={"torque_lag": "rising and falling unlike"}, **values)

        def slope(t, y):
            told = np.array([np.interp(t, self.TIME, wheel) for wheel in command.T])
            return (told - y) / (0.05 * (1.0 + apart * np.where(y * (told - y) >= 0.0, 1.0, -1.0)))

        exact = solve_ivp(slope, (0.0, self.TIME[-1]), command[0], t_eval=self.TIME, max_step=self.STEP_S)
        # Falling turns to rising within a part of a row, 0.5 ms, in which 200 N m of lag go by 5 N m at 0.02 s.
        assert lagged == pytest.approx(exact.y.T, abs=5.0)
        assert np.sqrt(np.mean((lagged - exact.y.T) ** 2)) < 0.5

    def test_a_lag_of_rise_and_fall_is_the_plain_one_where_both_are_alike_or_only_one_happens(self):
        growing = np.repeat(np.linspace(0.0, -300.0, 800)[:, None], 4, axis=1)
        form = {"torque_lag": "rising and falling unlike"}
        rise, fall, plain = (
            self.actuate(torque, forms=kind, torque_lag={"time_constant_s": tau, **more})
            for torque, kind, tau, more in (
                (growing, form, 0.08, {"apart": 0.25}),
                (growing[::-1], form, 0.08, {"apart": 0.25}),
                (growing, {}, 0.1, {}),
            )
        )
        assert rise == pytest.approx(plain, abs=1e-9)
        alone = self.actuate(growing[::-1], torque_lag={"time_constant_s": 0.06})
        assert fall == pytest.approx(alone, abs=1e-9)

    def test_delay_of_whole_steps_shifts_the_rows(self, command):
        late = self.actuate(command, torque_delay={"delay_s": 25 * self.STEP_S})
        assert late[25:] == pytest.approx(command[:-25], abs=1e-9)
        assert (late[:25] == command[0]).all()

    def test_delay_of_half_a_step_lies_between_the_rows(self, command):
        late = self.actuate(command, torque_delay={"delay_s": 0.5 * self.STEP_S})
        assert late[1:] == pytest.approx(0.5 * (command[1:] + command[:-1]), abs=1e-9)

    def test_the_car_gets_what_the_actuators_make(self, command):
        effects = {"torque_gain": {"factor": 0.9}, "torque_lag": {"time_constant_s": 0.05}}
        run = simulate(car_with(**effects), DRY, command, self.STEP_S, 20.0)
        direct = simulate(CAR, DRY, self.actuate(command, **effects), self.STEP_S, 20.0)
        assert (run.speed_m_s == direct.speed_m_s).all()
        assert (run.wheel_torque_nm == command).all()


class TestRelaxation:
    def test_a_short_length_is_the_plant_without_it(self):
        knots = [(0.0, 0.0), (0.1, 250.0), (0.6, -200.0), (1.0, -200.0)]
        base, run = (
            drive(car_with(**e), knots, 1.0, 15.0) for e in ({}, {"tyre_relaxation": {"length_m": 1e-3}})
        )
        assert run.speed_m_s == pytest.approx(base.speed_m_s, abs=1e-3)
        assert run.tyre_force_n == pytest.approx(base.tyre_force_n, abs=30.0)

    @pytest.mark.parametrize("speed", [5.0, 20.0])
    def test_force_follows_the_linear_model(self, speed):
        """Wheel, lagging force and a quarter of the car, at so little slip that the tyre is linear."""
        length, stiffness = 0.5, 1.27 * STIFFNESS
        run = drive(car_with(tyre_relaxation={"length_m": length}), [(0.0, 0.0), (1e-3, 20.0)], 0.5, speed)
        system = StateSpace(
            [
                [0.0, -RADIUS / INERTIA, 0.0],
                [stiffness * RADIUS / length, -speed / length, -stiffness / length],
                [0.0, 4.0 / MASS, 0.0],
            ],
            [[1.0 / INERTIA], [0.0], [0.0]],
            np.eye(3),
            np.zeros((3, 1)),
        )
        _, expected, _ = lsim(system, run.wheel_torque_nm[:, 0], run.time_s, interp=True)
        peak_n = expected[:, 1].max()
        assert peak_n > 1.2 * 20.0 / RADIUS  # it rings
        assert run.tyre_force_n[:, 0] == pytest.approx(expected[:, 1], abs=0.01 * peak_n)

    @pytest.mark.parametrize(
        ("form", "more", "shares"),
        [
            ("longer with load", {}, None),
            ("axles unlike", {"unlike": -0.3}, [0.7, 0.7, 1.3, 1.3]),
            (
                "each wheel its own",
                {"unlike": 0.1, "front_sides": 0.2, "rear_sides": -0.3},
                [1.3, 0.9, 0.6, 1.2],
            ),
        ],
    )
    def test_each_wheel_has_the_length_that_its_load_or_its_tyre_gives(self, form, more, shares):
        """The wheels, their lagging slips and the car, at so little slip that the tyres are linear."""
        length, speed, stiffness = 0.5, 10.0, 1.27 * STIFFNESS
        car = car_with({"tyre_relaxation": form}, tyre_relaxation={"length_m": length, **more})
        run = drive(car, [(0.0, 0.0), (1e-3, 20.0)], 0.5, speed)
        lengths_m = length * (
            run.vertical_load_n[0] / (0.25 * MASS * G) if shares is None else np.array(shares)
        )
        assert np.ptp(lengths_m) > 0.02
        rates, push = np.zeros((9, 9)), stiffness / MASS
        for wheel, length_m in enumerate(lengths_m):
            spin, slip = 2 * wheel, 2 * wheel + 1
            rates[spin, slip] = -RADIUS * stiffness / INERTIA
            rates[slip, [spin, slip, 8]] = RADIUS / length_m, -speed / length_m, -1.0 / length_m
            rates[8, slip] = push
        torque = np.array([[1.0 / INERTIA, 0.0] * 4 + [0.0]]).T
        system = StateSpace(rates, torque, np.eye(9), np.zeros((9, 1)))
        _, expected, _ = lsim(system, run.wheel_torque_nm[:, 0], run.time_s, interp=True)
        forces = stiffness * expected[:, 1:8:2]
        assert run.tyre_force_n == pytest.approx(forces, abs=0.01 * forces.max())

    def test_a_stop_ends_at_rest_and_what_is_wound_up_does_not_push_the_car(self):
        knots = [(0.0, 0.0), (0.1, -200.0), (2.0, -200.0), (2.1, 0.0), (6.0, 0.0)]
        run = drive(car_with(tyre_relaxation={"length_m": 0.5}), knots, 6.0, 3.0)
        assert (run.speed_m_s >= 0.0).all()
        stopped = int(np.argmax(run.speed_m_s == 0.0))
        assert 0 < stopped < 2000
        assert run.accel_x_m_s2[stopped:2000].max() <= 1e-9
        assert run.speed_m_s[-1000:].max() < 0.1


class TestDriveline:
    K, D, J = 6000.0, 4.0, 0.5
    SHAFT = MappingProxyType(
        {"driveline_compliance": {"stiffness_nm_rad": K, "damping_nm_s_rad": D, "motor_inertia_kg_m2": J}}
    )

    def states(self, torque_nm, speed, duration_s, effects=None):
        setup = make_setup(car_with(**(effects or self.SHAFT)), DRY)
        torque = np.full((round(duration_s / 1e-3) + 1, 4), torque_nm)
        start = dynamics.initial_y(speed, 0.0, setup.parameters)
        return dynamics.run(start, torque, 1e-3, setup.parameters, setup.road)[0]

    def test_rings_at_its_natural_frequency(self):
        """Eigenvalues of the linear model of twist, motor, wheel and a quarter car on the tyre's slip stiffness."""
        speed = 8.0
        tyre = 1.27 * STIFFNESS / speed
        quarter, wheel = MASS / 4.0, INERTIA - self.J
        a = np.array(
            [
                [0.0, 1.0, -1.0, 0.0],
                [-self.K / self.J, -self.D / self.J, self.D / self.J, 0.0],
                [self.K / wheel, self.D / wheel, -(self.D + tyre * RADIUS**2) / wheel, tyre * RADIUS / wheel],
                [0.0, 0.0, tyre * RADIUS / quarter, -tyre / quarter],
            ]
        )  # fmt: skip
        modes = np.linalg.eigvals(a)
        mode = modes[np.argmax(modes.imag)]
        twist = self.states(20.0, speed, 0.6)[:, TWIST]
        swing = twist - np.mean(twist[-100:])
        crossing = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
        exact = crossing + swing[crossing] / (swing[crossing] - swing[crossing + 1])
        period_s = np.diff(exact)[:5].mean() * 1e-3
        assert 2.0 * np.pi / period_s == pytest.approx(mode.imag, rel=0.01)
        peaks = [swing[i:j].max() for i, j in pairwise(crossing[:6])]
        decay = -np.polyfit(np.arange(5) * period_s, np.log(peaks), 1)[0]
        assert decay == pytest.approx(-mode.real, rel=0.05)

    def test_settles_at_the_torque_that_it_passes_on(self):
        y = self.states(100.0, 8.0, 2.0)[-1]
        accel = 400.0 / RADIUS / ROLLING_MASS
        assert self.K * y[TWIST] == pytest.approx(100.0 - self.J * accel / RADIUS, rel=3e-3)
        assert y[MOTOR] == pytest.approx(y[WHEEL], rel=1e-6)

    @pytest.mark.parametrize("share", [0.1, 0.7])
    def test_a_stiff_shaft_is_the_plant_without_it(self, share):
        stiff = {"stiffness_nm_rad": 1e6, "damping_nm_s_rad": 500.0, "motor_inertia_kg_m2": share * INERTIA}
        knots = [(0.0, 0.0), (0.1, 250.0), (0.6, -200.0), (1.0, -200.0)]
        base, run = (drive(car_with(**e), knots, 1.0, 5.0) for e in ({}, {"driveline_compliance": stiff}))
        assert run.speed_m_s == pytest.approx(base.speed_m_s, abs=1e-4)
        assert run.wheel_speed_rad_s == pytest.approx(base.wheel_speed_rad_s, abs=5e-3)

    def test_energy_only_falls_once_the_torque_is_gone(self):
        setup = make_setup(car_with(**self.SHAFT), DRY)
        torque = np.zeros((1500, 4))
        torque[:200] = 250.0
        y = dynamics.run(
            dynamics.initial_y(6.0, 0.0, setup.parameters), torque, 1e-3, setup.parameters, setup.road
        )[0]
        energy = 0.5 * MASS * y[:, SPEED] ** 2
        energy += 0.5 * (INERTIA - self.J) * (y[:, WHEEL : WHEEL + 4] ** 2).sum(1)
        energy += 0.5 * self.J * (y[:, MOTOR : MOTOR + 4] ** 2).sum(1) + 0.5 * self.K * (
            y[:, TWIST : TWIST + 4] ** 2
        ).sum(1)
        fall = np.diff(energy[201:])
        assert fall.max() < 1e-4
        assert fall.sum() < -5.0

    @pytest.mark.parametrize("torque_nm", [-60.0, -900.0])
    def test_brakes_to_rest_and_stays_there(self, torque_nm):
        run = drive(car_with(**self.SHAFT), [(0.0, 0.0), (0.1, torque_nm)], 9.0, 3.0, ICE)
        assert (run.wheel_speed_rad_s >= 0.0).all()
        stopped = int(np.argmax(run.speed_m_s < 0.01))
        assert 0 < stopped < 8000
        assert run.speed_m_s[stopped + 300 :].max() < 1e-4
        assert run.wheel_speed_rad_s[stopped + 300 :].max() < 1e-3
        assert np.ptp(run.position_m[stopped:]) < 0.01

    def test_motor_follows_its_torque(self):
        """J omega_m' = T - k twist - d (omega_m - omega), integrated over the states that came out."""
        y = self.states(150.0, 8.0, 0.3)
        shaft = self.K * y[:, TWIST] + self.D * (y[:, MOTOR] - y[:, WHEEL])
        time_s = np.arange(len(y)) * 1e-3
        expected = y[0, MOTOR] + cumulative_trapezoid((150.0 - shaft) / self.J, time_s, initial=0.0)
        assert y[:, MOTOR] == pytest.approx(expected, abs=0.02)


class TestRollingResistanceAsAForce:
    """The body form against its closed forms; the wheel form is held above."""

    C = 0.02

    def run(self, torque_nm, duration_s, speed, coefficient=C):
        setup = make_setup(CAR, DRY)
        p = RollingResistanceForce(coefficient).dynamics(setup.parameters)
        time_s = np.arange(round(duration_s / 1e-3) + 1) * 1e-3
        torque = np.full((len(time_s), 4), float(torque_nm))
        y = dynamics.initial_y(speed, 0.0, p)
        return time_s, *dynamics.run(y, torque, 1e-3, p, setup.road)

    def test_coasting_slows_linearly_then_rests(self):
        time_s, states, accel, *_ = self.run(0.0, 6.0, 1.0)
        decel = MASS * self.C * G / ROLLING_MASS
        stop_s = 1.0 / decel
        moving = time_s < stop_s - 0.05
        assert states[moving, SPEED] == pytest.approx(1.0 - decel * time_s[moving], abs=3e-3)
        resting = time_s > stop_s + 0.05
        assert resting.sum() > 500
        assert not states[resting, SPEED].any()
        assert not accel[resting].any()

    def test_the_accelerometer_feels_it(self):
        _, states, accel, _, force_n, *_ = self.run(100.0, 1.0, 10.0)
        assert accel == pytest.approx(force_n.sum(axis=1) / MASS - self.C * G, rel=1e-9)
        assert np.gradient(states[:, SPEED], 1e-3)[100:-5] == pytest.approx(accel[100:-5], abs=2e-3)

    def test_it_holds_a_standing_car_against_less_than_itself(self):
        least_nm = self.C * MASS * G * RADIUS / 4.0
        assert self.run(0.98 * least_nm, 2.0, 0.0)[1][-1, POSITION] < 1e-4
        assert self.run(1.05 * least_nm, 2.0, 0.0)[1][-1, SPEED] > 0.01

    def test_without_a_coefficient_nothing_changes(self):
        plain = drive(CAR, 100.0, 1.0, 10.0)
        assert np.array_equal(self.run(100.0, 1.0, 10.0, 0.0)[1][:, SPEED], plain.speed_m_s)


@pytest.mark.parametrize("unlike", [-0.5, 0.5])
def test_a_motor_leaves_the_lighter_axles_wheels_an_inertia(unlike):
    """Else a wheel would turn against its torque, and the steps that follow it would never end."""
    car = car_with(
        {"wheel_inertia_offset": "axles unlike"},
        wheel_inertia_offset={"inertia_kg_m2": 0.7, "unlike": unlike},
        driveline_compliance={"stiffness_nm_rad": 1.4e5, "damping_nm_s_rad": 0.3, "motor_inertia_kg_m2": 0.9},
    )
    assert make_setup(car, DRY).parameters.motor_inertia_kg_m2 == pytest.approx(0.8 * 0.5 * 0.7)
