"""Forms of the withheld cases' effects and tyres: they keep the nominal car and what a parameter means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    DRY,
    SLIDING,
    WET,
    driven,
    forms_of,
    numbered,
    pulled,
    reading,
    slopes,
    slowing,
    with_form,
)
from withheld_plant import CAR, NEUTRAL, LimitDrive, carried, roll

from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import HUNT_S, ROLL_M_S, TEXTURE_M, USUAL_M_S, USUAL_RAD_S
from benchmarks.gap.withheld.generator.effects import EFFECT_FORMS, FOREIGN
from benchmarks.gap.withheld.generator.forms import effect_in
from benchmarks.gap.withheld.generator.kernel import BODY, MOTOR, TWIST, N, V, W
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.tyre import dugoff
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long
EVERY_FORM = forms_of(*EFFECT_FORMS)
SHAFT = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 0.0, "motor_inertia_kg_m2": 0.6}


@pytest.fixture(scope="module")
def limit():
    return LimitDrive()


def test_forms_begin_with_the_librarys():
    assert all(next(iter(forms.values())) is LIBRARY[effect].apply for effect, forms in EFFECT_FORMS.items())


@pytest.mark.parametrize("chosen", EVERY_FORM)
def test_a_neutral_effect_is_the_nominal_car_in_every_form(chosen, limit):
    effect, form = chosen
    assert limit.is_nominal(effect_in({effect: form}, effect).apply(limit.world, NEUTRAL[effect]))


@pytest.mark.parametrize("chosen", EVERY_FORM)
def test_the_severest_effect_shows_in_every_form(chosen, limit):
    effect = effect_in(dict([chosen]), chosen[0])
    assert limit.shows(effect.apply(limit.world, effect.at(CAR, np.random.default_rng(0))(1.0)))


# --- air, road, mass and loads


@pytest.mark.parametrize("chosen", forms_of("aero_drag"))
def test_drag_coasts_down_by_the_hyperbola_and_loads_change_by_the_lift(chosen):
    world = with_form(*chosen, drag_area_m2=0.8)
    path = roll(world, 30.0, 20.0)
    rate = 0.5 * 1.225 * 0.8 * 30.0 / carried(CAR)
    assert path[-1, V] == pytest.approx(30.0 / (1.0 + rate * 20.0), rel=1e-3)
    path = roll(world, 30.0, 1.0, -2000.0)[500:]
    air = path[:, V] ** 2 / CAR.mass_kg
    lift = SLIDING * DRY / 9.81 * world.physics.lift * air
    assert_allclose(path[:, N], -SLIDING * DRY + lift - world.physics.drag * air, rtol=1e-3)
    assert world.physics.lift <= 0.5 * world.physics.drag


def test_lift_at_the_front_leaves_the_rear():
    p = with_form("aero_drag", "front_lift", drag_area_m2=0.8).physics
    moment = 0.5 * p.drag * p.drag_height / CAR.wheelbase_m
    assert 0.25 * p.lift - moment == pytest.approx(0.0)
    assert 2.0 * (0.25 * p.lift + moment) == pytest.approx(0.15 * 0.5 * 1.225 * 0.8)


@pytest.mark.parametrize("at_s", [1.0, details.WARM_S * np.log(2.0), 25.0])
def test_a_warming_tyre_resists_by_its_coefficient_half_way(at_s):
    warmth = 1.0 - 2.0 * np.exp(-at_s / details.WARM_S)
    told = 0.012 * CAR.mass_kg * 9.81 * (1.0 - 0.15 * warmth) / carried(CAR)
    world = with_form("rolling_resistance", "warming", coefficient=0.012)
    assert slowing(world, 22.0, at_s) == pytest.approx(told, rel=3e-3)


@pytest.mark.parametrize("share", [0.6, 1.0, 1.5])
def test_a_tyre_on_the_drum_resists_by_speed(share):
    factor = (1.0 + 0.05 * (share - 1.0)) * (1.0 + 0.06 * (share**2 - 1.0))
    told = factor * 0.02 * 9.81 * CAR.mass_kg / carried(CAR)
    world = with_form("rolling_resistance", "as_on_the_drum", coefficient=0.02)
    assert slowing(world, share * ROLL_M_S, 0.25) == pytest.approx(told, rel=0.01)


@pytest.mark.parametrize("chosen", forms_of("mass_offset"))
def test_payload_adds_to_the_mass_and_keeps_the_wheelbase(chosen):
    world = with_form(*chosen, mass_kg=300.0)
    gained = [roll(w, 10.0, 4.0, 150.0)[-1, V] - 10.0 for w in (world, nominal(CAR, Road()))]
    assert gained[0] / gained[1] == pytest.approx(carried(CAR) / (carried(CAR) + 300.0), rel=2e-3)
    assert world.physics.front_arm + world.physics.rear_arm == pytest.approx(CAR.wheelbase_m)
    assert world.physics.rear_arm > 0.5 * CAR.cog_to_rear_axle_m


def test_a_load_on_one_side_presses_that_side_s_tyres():
    world = with_form("mass_offset", "on_one_side", mass_kg=300.0)
    assert world.physics.load_side * world.physics.mass * 0.75 == pytest.approx(300.0 * 0.4)
    assert_allclose(roll(world, 25.0, 1.0, -3000.0)[500:, N], -SLIDING * DRY, rtol=1e-3)
    spins = roll(world, 10.0, 0.5, 900.0)[-1, W : W + 4]
    assert np.all(spins[[1, 3]] > spins[[0, 2]])


def test_loads_settle_at_the_moment_of_the_inertia():
    """Slip in steady acceleration goes with force over stiffness, and the rear can bear more before it spins."""
    path, first = (
        roll(with_form(*chosen, road=Road((0.0,), (0.3,)), cog_height_m=0.6), 10.0, 2.0, 180.0)
        for chosen in (("load_transfer", "links_and_springs"), ("load_transfer", "plain"))
    )
    assert_allclose(path[-1, [W, W + 2, V, N]], first[-1, [W, W + 2, V, N]], rtol=2e-3)


def test_links_carry_their_share_at_once_and_the_springs_the_rest_later():
    path = roll(with_form("load_transfer", "links_and_springs", cog_height_m=0.6), 10.0, 2.0, 100.0)
    left = path[200:400, BODY] / path[200:400, N]
    assert_allclose(1.0 - left, np.exp(-np.arange(200, 400) * 1e-3 / 0.06), atol=0.02)


# --- wheels, tyres and friction


def test_a_belt_that_stretches_has_its_radius_at_the_usual_speed():
    world = with_form("wheel_radius_offset", "less_at_speed", radius_m=0.30)
    for speed in (USUAL_M_S, 28.0):
        end = roll(world, speed, 1.0)[-1]
        told = 0.30 - 0.08 * 0.01 * ((end[V] / USUAL_M_S) ** 2 - 1.0)
        assert end[V] / end[W] == pytest.approx(told, rel=1e-5)


@pytest.mark.parametrize("inertia", [0.8, 1.8])
def test_a_rotor_turns_up_with_its_wheel(inertia):
    airborne = Road((0.0,), (1e-9,))
    world = with_form("wheel_inertia_offset", "rotor_on_shaft", road=airborne, inertia_kg_m2=inertia)
    path, p = roll(world, 10.0, 1.0, 20.0), world.physics
    assert_allclose(path[-1, [W, MOTOR]] - path[0, [W, MOTOR]], 20.0 / inertia, rtol=2e-3)
    series = p.motor_inertia * (inertia - p.motor_inertia) / inertia
    assert np.sqrt(p.shaft_stiffness / series) / (2.0 * np.pi) == pytest.approx(55.0)


@pytest.mark.parametrize("chosen", forms_of("tyre_relaxation"))
def test_relaxation_rings_over_the_travelled_length(chosen):
    """w' and the lagged force are a damped oscillator of 1.27 C R^2 / (I L), damping v / (2 L), in every form."""
    length, speed, heavy = 0.5, 20.0, replace(CAR, mass_kg=1e5)
    path = roll(with_form(*chosen, heavy, length_m=length), speed, 0.5, 20.0)
    ringing = path[1:, N] - path[-1, N]
    crossings = np.flatnonzero(np.diff(np.sign(ringing[:250])) != 0)
    natural = 1.27 * 50_000.0 * 0.29**2 / (1.2 * length)
    expected = np.pi / np.sqrt(natural - (speed / length / 2.0) ** 2)
    assert 1e-3 * np.mean(np.diff(crossings)) == pytest.approx(expected, rel=0.03)


def test_tyres_are_stiffer_on_coarse_stretches_and_as_told_on_the_whole():
    places = np.linspace(0.0, TEXTURE_M, 3000, endpoint=False)
    assert np.mean([details.coarse(at) for at in places]) == pytest.approx(0.0, abs=1e-9)
    p = with_form("tyre_stiffness_offset", "on_coarse_stretches", stiffness_n=30_000.0).physics
    for place in (0.25 * TEXTURE_M, 0.6 * TEXTURE_M):
        force = slopes(p, slip=0.001, place=place)[1] * CAR.mass_kg
        ends = [details.coarse(place + arm) for arm in (p.front_arm, -p.rear_arm)]
        told = 30_000.0 - 0.2 * 20_000.0 * np.mean(ends)
        assert force == pytest.approx(4.0 * 1.27 * told * 0.001, rel=0.01)


@pytest.mark.parametrize(
    ("form", "mu", "left"),
    [
        ("plain", DRY, lambda x: np.exp(-x)),
        ("logarithmic", DRY, lambda x: 1.0 - np.minimum(np.log1p(x), 1.0)),
        ("sooner_when_wet", DRY, lambda x: np.exp(-x)),
        ("sooner_when_wet", WET, lambda x: np.exp(-1.3 * x)),
    ],
)
def test_locked_wheels_slide_at_what_is_left(form, mu, left):
    world = with_form("friction_falloff", form, road=Road((0.0,), (mu,)), falloff_s_m=0.1, floor=0.5)
    at = roll(world, 20.0, 1.0, -2000.0)[400:]
    assert_allclose(at[:, N], -SLIDING * mu * (0.5 + 0.5 * left(0.1 * at[:, V])), rtol=4e-3)


def test_a_friction_deviates_by_its_factor_in_the_mean_of_driving_and_braking():
    world = with_form("friction_offset", "more_in_braking", factor=0.8)
    braking, driving = -roll(world, 25.0, 1.0, -2000.0)[900, N], roll(world, 6.0, 0.6, 3000.0)[500, N]
    assert braking == pytest.approx(SLIDING * DRY * (1.0 - 0.2 * 1.15), rel=2e-3)
    plain = roll(with_form("friction_offset", "plain", factor=1.0 - 0.2 * 0.85), 6.0, 0.6, 3000.0)[500, N]
    assert driving == pytest.approx(plain, rel=2e-3)


def test_repairs_have_the_factor_in_the_mean():
    p = with_form("mu_split", "repairs", left_factor=0.5, right_factor=1.0).physics
    places = np.arange(0.0, 330.0, 0.5) - p.front_arm
    left, right = (np.array([details.friction(p, w, at, 20.0) for at in places]) for w in (0, 1))
    assert left.mean() == pytest.approx(0.5 * DRY, rel=0.01)
    assert np.ptp(left) > 0.2 * DRY
    assert_allclose(right, DRY)


@pytest.mark.parametrize("foreign", numbered(FOREIGN.values()))
def test_foreign_tyres_have_the_slope_and_the_peak_and_none_of_them_is_the_nominal_one(foreign, limit):
    own = foreign.draw(np.random.default_rng(0))
    p = foreign.apply(nominal(CAR, Road()), share=1.0, **own).physics
    load = p.mass * 9.81 / 4.0
    for theta in (0.3, 0.9):
        slips = np.linspace(0.0, 1.0, 2001)
        force = np.array([kernel.tyre_force(p, s, 0.0, theta, load, 0.0) for s in slips])
        expected = np.array([dugoff(s, CAR.stiffness_n, theta, load) for s in slips])
        assert kernel.tyre_force(p, 1e-5, 0.0, theta, load, 0.0) == pytest.approx(1.27 * 0.5, rel=2e-3)
        assert force.max() == pytest.approx(expected.max(), rel=2e-3)
        assert np.all(np.diff(force[: int(np.argmax(force > (1.0 - 1e-9) * force.max()))]) > 0.0)
        assert force[-1] > 0.5 * expected[-1]
    assert limit.is_nominal(foreign.apply(limit.world, share=0.0, **own))


# --- motors, brakes and shafts


@pytest.mark.parametrize("chosen", forms_of("torque_lag"))
def test_lag_shifts_the_speed_by_its_time(chosen):
    times = []
    for torque in (100.0, -100.0):
        command = np.zeros((301, 4))
        command[101:] = torque
        free = driven(nominal(CAR, Road()), command)[:, V]
        late = driven(with_form(*chosen, time_constant_s=0.1), command)[:, V]
        times.append((free[-1] - late[-1]) / (free[-1] - free[2000]))
    assert np.mean(times) == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("chosen", forms_of("torque_delay"))
def test_torque_comes_late_by_the_delay(chosen):
    """A ramp that comes late ends where the ramp begun later by the delay ends."""
    ramp = np.maximum(np.arange(301) - 100.0, 0.0)[:, None] * np.ones(4)
    later = np.vstack([np.zeros((10, 4)), ramp[:-10]])
    late = driven(with_form(*chosen, delay_s=0.1), ramp)
    assert late[-1, V] - 10.0 == pytest.approx(driven(nominal(CAR, Road()), later)[-1, V] - 10.0, rel=2e-3)
    assert_allclose(late[1:1090, V], 10.0, rtol=1e-12)


@pytest.mark.parametrize("chosen", forms_of("torque_gain"))
def test_gain_scales_the_acceleration(chosen):
    worlds, gains = (with_form(*chosen, factor=0.9), nominal(CAR, Road())), []
    for sign in (1.0, -1.0):
        start = USUAL_RAD_S * CAR.wheel_radius_m - sign * 3.0
        changes = [roll(world, start, 4.0, sign * 150.0)[-1, V] - start for world in worlds]
        gains.append(changes[0] / changes[1])
    assert np.mean(gains) == pytest.approx(0.9, rel=2e-3)


def test_a_hunting_gain_has_its_mean_and_one_with_power_its_value_at_the_usual_power():
    p = with_form("torque_gain", "hunting", factor=0.8).physics
    clock, command = np.linspace(0.0, HUNT_S, 400, endpoint=False), np.full((900, 4), -100.0)
    gains = np.array([kernel.motor_torque(p, command, 1, t, 0.0, 30.0) for t in clock]) / -100.0
    assert_allclose([gains.mean(), gains.min(), gains.max()], [0.8, 0.77, 0.83], rtol=1e-6)
    p = with_form("torque_gain", "with_power", factor=0.8).physics
    for torque, turning, share in ((150.0, 65.0, 1.0), (-75.0, 65.0, 0.925), (300.0, 90.0, 1.15)):
        given = kernel.motor_torque(p, np.full((5, 4), torque), 1, 0.02, 0.0, turning)
        assert given / torque == pytest.approx(1.0 - 0.2 * share)


@pytest.mark.parametrize("chosen", forms_of("brake_drag"))
def test_drag_at_the_wheels_slows_by_its_mean(chosen):
    path = roll(with_form(*chosen, torque_nm=15.0), 20.0, 5.0)
    assert 20.0 - path[-1, V] == pytest.approx(5.0 * 4.0 * 15.0 / 0.29 / carried(CAR), rel=5e-3)


@pytest.mark.parametrize(("wheel", "share"), [(0, 1.15), (3, 0.85)])
def test_unlike_drivelines_ring_at_their_own_frequency(wheel, share):
    car = replace(CAR, stiffness_n=1.0)
    world = with_form("driveline_compliance", "unlike_axles", car, **SHAFT)
    y = roll(world, 20.0, 0.01)[0, :N]
    y[TWIST : TWIST + 4] = 0.01
    path = np.zeros((1001, N + 1))
    kernel.integrate(world.physics, y, 0, 1000, 5, np.zeros((101, 4)), path)
    crossings = np.flatnonzero(np.diff(np.sign(path[1:, TWIST + wheel])) != 0)
    expected = 2.0 * np.pi / np.sqrt(share * 9000.0 * (1.0 / 0.6 + 1.0 / 0.6))
    assert 2e-3 * np.mean(np.diff(crossings)) == pytest.approx(expected, rel=0.02)


# --- sensors


@pytest.mark.parametrize("chosen", forms_of("wheel_speed_delay", "vehicle_speed_delay"))
@pytest.mark.parametrize("delay", [0.004, 0.05])
def test_sensors_are_late_by_the_delay_on_average(chosen, delay):
    at, true, late = reading(pulled(), with_form(*chosen, delay_s=delay).sensors)
    columns = slice(0, 4) if chosen[0] == "wheel_speed_delay" else slice(4, 5)
    ages = (true - late)[:, columns] / np.gradient(true[:, columns], at, axis=0)
    assert np.mean(ages) == pytest.approx(delay, rel=0.02)
    assert ages.min() > -1e-3


@pytest.mark.parametrize("chosen", forms_of("wheel_speed_quantisation"))
def test_counts_are_whole_and_keep_the_mean_speed(chosen):
    path = roll(nominal(CAR, Road()), 20.3, 20.0)
    _, true, counted = reading(path, with_form(*chosen, teeth=96.0, window_s=0.02).sensors)
    pulses = counted[:, 0] * 96.0 * 0.02 / (2.0 * np.pi)
    assert_allclose(pulses, np.round(pulses), atol=1e-6)
    assert counted[:, 0].mean() == pytest.approx(true[:, 0].mean(), rel=3e-3)


def test_a_scale_with_pitch_is_as_told_at_even_speed_and_more_in_acceleration():
    sensors = with_form("vehicle_speed_scale", "with_pitch", factor=1.05).sensors
    path = np.zeros((4001, N + 1))
    path[:, V], path[2000:, N] = 20.0, 3.0
    told = read(path, sensors, np.array([1.9, 3.9]))[:, 4] / 20.0 - 1.0
    assert_allclose(told, [0.05, 0.05 * (1.0 + 0.04 * 3.0)], rtol=1e-3)


def test_a_bias_remembers_where_the_sensor_was_bent_to():
    sensors = with_form("accelerometer_bias", "remembering", bias_m_s2=0.4).sensors
    path = np.zeros((24001, N + 1))
    path[:8000, N], path[8000:16000, N] = 3.0, -3.0
    told = read(path, sensors, np.array([7.99, 15.99, 23.99]))[:, 5]
    assert_allclose(told, [3.0 + 0.4 * 1.2, -3.0 + 0.4 * 0.8, 0.4], rtol=3e-3)
