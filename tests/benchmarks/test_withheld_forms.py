"""Forms of the withheld cases: drawn as they were, they keep the nominal car and what parameters mean."""

from __future__ import annotations

import json
import zlib
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from long import beyond, long
from numpy.testing import assert_allclose
from withheld_cars import (
    by_further,
    driven,
    forms_of,
    numbered,
    pulled,
    reading,
    with_form,
)
from withheld_plant import CAR, NEUTRAL, QUIET, LimitDrive, carried, roll

from benchmarks.gap.withheld.generator import kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.cases import make_case
from benchmarks.gap.withheld.generator.details import FLOOR_M_S, ROLL_M_S
from benchmarks.gap.withheld.generator.driver import drive
from benchmarks.gap.withheld.generator.effects import EFFECT_FORMS
from benchmarks.gap.withheld.generator.falling import fallen
from benchmarks.gap.withheld.generator.foreign import FOREIGN
from benchmarks.gap.withheld.generator.forms import (
    ASPECTS,
    DIGITS,
    NEWEST,
    NOISES,
    PLAIN,
    RATES_HZ,
    STYLES,
    Edition,
    draw_forms,
    effect_in,
    names_by,
)
from benchmarks.gap.withheld.generator.kernel import N, V, W
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.outside import OUTSIDE, OUTSIDE_SINCE
from benchmarks.gap.withheld.generator.sensor_set import Sensors
from benchmarks.gap.withheld.generator.sensors import Noise, make_log
from benchmarks.gap.withheld.generator.table import PAIRS, Group, table
from benchmarks.gap.withheld.generator.tyre import dugoff
from benchmarks.gap.withheld.generator.world import nominal

CASES = {spec.name: spec for spec in table("full", NEWEST)}


def few(chosen):
    """Aspects with their forms; but for the first and the last of each they are long."""
    always = {
        (aspect, form) for aspect, forms in ASPECTS.items() for form in (next(iter(forms)), list(forms)[-1])
    }
    return [
        pytest.param(item, id=str(i), marks=() if item in always else long) for i, item in enumerate(chosen)
    ]


# --- editions


DRAWS = [464962544, 2607503357, 2724598211, 2904162615, 609898683, 2586606653, 1195626187, 3538627478]
"""Checksums of what the editions from 2 to 9 draw."""


def test_editions_draw_the_forms_that_they_drew():
    for edition, draws in enumerate(DRAWS, start=2):
        drawn = [draw_forms(edition, np.random.default_rng(seed)) for seed in range(40)]
        assert zlib.crc32(json.dumps(drawn, sort_keys=True).encode()) == draws


def test_the_plain_edition_has_one_form_of_everything():
    assert all(len(forms) == 1 for forms in names_by(PLAIN.car).values())


def test_the_newest_edition_draws_every_form():
    drawn = [draw_forms(NEWEST.car, np.random.default_rng(seed)) for seed in range(250)]
    assert {a: {forms[a] for forms in drawn} for a in ASPECTS} == {a: set(f) for a, f in ASPECTS.items()}


def test_editions_add_at_the_end_and_say_so():
    for forms in (*ASPECTS.values(), OUTSIDE_SINCE):
        since = [edition for edition, _ in forms.values()]
        assert since == sorted(since)
        assert 1 <= since[0] <= since[-1] <= NEWEST.car
    for less, more in pairwise(Edition(car, 1) for car in RATES_HZ):
        assert {s.name for s in table("full", less)} <= {s.name for s in table("full", more)}
        rates = RATES_HZ[more.car]
        assert sum(rates.values()) == pytest.approx(1.0)
        assert all(rate % 50.0 == 0.0 and 50.0 <= rate <= 2000.0 for rate in rates)
    every = [set(pair) for pairs in PAIRS.values() for pair in pairs]
    assert all(pair < set(LIBRARY) and every.count(pair) == 1 for pair in every)


def test_forms_begin_with_the_librarys():
    assert all(
        next(iter(forms.values()))[1] is LIBRARY[effect].apply for effect, forms in EFFECT_FORMS.items()
    )


@pytest.mark.long
def test_forms_change_no_other_draw(tmp_path):
    first, *others = (
        make_case(CASES["no_gap-0-rich"], 4, edition) for edition in (PLAIN, Edition(2, 1), NEWEST)
    )
    first.write(tmp_path / "first")
    for i, other in enumerate(others):
        assert (first.car, first.roads, first.noise) == (other.car, other.roads, other.noise)
        other.write(tmp_path / str(i))
        for name in ("vehicle.yaml", "road.yaml", "road_holdout.yaml"):
            assert (tmp_path / str(i) / name).read_bytes() == (tmp_path / "first" / name).read_bytes()
        assert other.truth.gap.total < 1.05


@pytest.mark.parametrize("edition", beyond(1, [NEWEST, Edition(2, 1)]))
def test_the_seal_tells_the_forms(edition):
    case = make_case(CASES["no_gap-2-calm"], 3, edition)
    seal = json.loads(json.dumps(case.seal()))
    known = names_by(edition.car)
    assert set(seal["forms"]) == set(known)
    assert all(seal["forms"][aspect] in forms for aspect, forms in known.items())


@pytest.mark.long
def test_removed_cases_show_the_forms_and_logs_of_their_twins():
    removed = next(s for s in CASES.values() if s.group is Group.REMOVED)
    assert removed.exclude == CASES[removed.data].effects
    shown, told = make_case(removed, 5, NEWEST), make_case(CASES[removed.data], 5, NEWEST)
    assert shown.forms == told.forms
    assert shown.logs["holdout"].equals(told.logs["holdout"])


@pytest.fixture(scope="module")
def limit():
    return LimitDrive()


# --- effects: each form is the nominal car where the effect is none, and keeps its known limit


@pytest.mark.parametrize(
    "chosen", few((effect, form) for effect, forms in EFFECT_FORMS.items() for form in forms)
)
@long
def test_a_neutral_effect_is_the_nominal_car_in_every_form(chosen, limit):
    effect, form = chosen
    neutral = effect_in({effect: form}, effect).apply(limit.world, NEUTRAL[effect])
    assert limit.is_nominal(neutral)


@pytest.mark.parametrize(
    "chosen", few((effect, form) for effect, forms in EFFECT_FORMS.items() for form in forms)
)
@long
def test_the_severest_effect_shows_in_every_form(chosen, limit):
    effect = effect_in(dict([chosen]), chosen[0])
    given = effect.at(CAR, np.random.default_rng(0))(1.0)
    assert limit.shows(effect.apply(limit.world, given))


@pytest.mark.parametrize("chosen", forms_of("rolling_resistance", but=("coarse_stretches", "warming")))
def test_resistance_is_the_coefficient_times_the_weight(chosen):
    lost = 5.0 * 0.015 * CAR.mass_kg * 9.81 / carried(CAR)
    path = roll(with_form(*chosen, coefficient=0.015), ROLL_M_S + 0.5 * lost, 5.0)
    assert path[-1, V] == pytest.approx(ROLL_M_S - 0.5 * lost, rel=1e-4)


@pytest.mark.parametrize("chosen", forms_of("mass_offset"))
@long
def test_payload_adds_to_the_mass_and_keeps_the_wheelbase(chosen):
    world = with_form(*chosen, mass_kg=300.0)
    gained = [roll(w, 10.0, 4.0, 150.0)[-1, V] - 10.0 for w in (world, nominal(CAR, Road()))]
    assert gained[0] / gained[1] == pytest.approx(carried(CAR) / (carried(CAR) + 300.0), rel=2e-3)
    assert world.physics.front_arm + world.physics.rear_arm == pytest.approx(CAR.wheelbase_m)
    assert world.physics.rear_arm > 0.5 * CAR.cog_to_rear_axle_m


@pytest.mark.parametrize("chosen", forms_of("load_transfer"))
def test_loads_settle_at_the_moment_of_the_inertia(chosen):
    """Slip in steady acceleration goes with force over stiffness, and the rear can bear more before it spins."""
    path = roll(with_form(*chosen, road=Road((0.0,), (0.3,)), cog_height_m=0.6), 10.0, 2.0, 180.0)
    first = roll(
        with_form("load_transfer", "at_once", road=Road((0.0,), (0.3,)), cog_height_m=0.6), 10.0, 2.0, 180.0
    )
    assert_allclose(path[-1, [W, W + 2, V, N]], first[-1, [W, W + 2, V, N]], rtol=2e-3)
    assert path[-1, kernel.PITCH] == pytest.approx(path[-1, N], rel=1e-2)


@pytest.mark.parametrize(
    "chosen", forms_of("tyre_relaxation", but=("unlike_axles", "each_its_own", "partly_at_once", "warming"))
)
def test_relaxation_rings_over_the_travelled_length(chosen):
    """w' and the lagged force are a damped oscillator of 1.27 C R^2 / (I L), damping v / (2 L), in every form."""
    length, speed, heavy = 0.5, 20.0, replace(CAR, mass_kg=1e5)
    path = roll(with_form(*chosen, heavy, length_m=length), speed, 0.5, 20.0)
    ringing = path[1:, N] - path[-1, N]
    crossings = np.flatnonzero(np.diff(np.sign(ringing[:250])) != 0)
    natural = 1.27 * 50_000.0 * 0.29**2 / (1.2 * length)
    expected = np.pi / np.sqrt(natural - (speed / length / 2.0) ** 2)
    assert 1e-3 * np.mean(np.diff(crossings)) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("curve", range(10))
def test_friction_starts_with_its_slope_and_ends_at_its_floor(curve):
    assert fallen(curve, 0.0, 0.4) == pytest.approx(1.0)
    assert (fallen(curve, 1e-6, 0.4) - 1.0) / 1e-6 == pytest.approx(-0.6, rel=1e-4)
    assert fallen(curve, 1e9, 0.4) == pytest.approx(0.4)
    steps = np.diff([fallen(curve, x, 0.4) for x in np.linspace(0.0, 5.0, 50)])
    assert np.all(steps <= 0.0)
    assert np.all(steps[:9] < 0.0)


@pytest.mark.parametrize("chosen", forms_of("friction_falloff"))
def test_locked_wheels_slide_at_what_is_left(chosen):
    world = with_form(*chosen, falloff_s_m=0.1, floor=0.5)
    at = roll(world, 20.0, 1.0, -2000.0)[400:]
    left = [fallen(world.physics.falloff_curve, 0.1 * speed, 0.5) for speed in at[:, V]]
    # Friction that follows late is that of a moment ago, when the car was faster: 0.25 % less.
    assert_allclose(at[:, N], -0.79 * 0.9 * np.array(left) * 9.81, rtol=4e-3)


@pytest.mark.parametrize(
    "chosen", forms_of("torque_delay", but=("longer_in_braking", "queue", "older_when_slow", "ever_later"))
)
def test_torque_comes_late_by_the_delay(chosen):
    """A ramp that comes late ends where the ramp begun later by the delay ends."""
    ramp = np.maximum(np.arange(301) - 100.0, 0.0)[:, None] * np.ones(4)
    later = np.vstack([np.zeros((10, 4)), ramp[:-10]])
    late = driven(with_form(*chosen, delay_s=0.1), ramp)
    assert late[-1, V] - 10.0 == pytest.approx(driven(nominal(CAR, Road()), later)[-1, V] - 10.0, rel=2e-3)
    assert_allclose(late[1:1090, V], 10.0, rtol=1e-12)


@pytest.mark.parametrize(
    "chosen", forms_of("wheel_speed_delay", "vehicle_speed_delay", but=("older_when_slow", "queue"))
)
@pytest.mark.parametrize("delay", [0.004, 0.05])
def test_sensors_are_late_by_the_delay_on_average(chosen, delay):
    sensors = with_form(*chosen, delay_s=delay).sensors
    at, true, late = reading(pulled(), sensors)
    columns = slice(0, 4) if chosen[0] == "wheel_speed_delay" else slice(4, 5)
    rate = np.gradient(true[:, columns], at, axis=0)
    ages = (true - late)[:, columns] / rate
    assert np.mean(ages) == pytest.approx(delay, rel=0.02)
    assert ages.min() > -1e-3


@pytest.mark.parametrize("chosen", forms_of("wheel_speed_quantisation"))
@long
def test_counts_are_whole_and_keep_the_mean_speed(chosen):
    path = roll(nominal(CAR, Road()), 20.3, 20.0)
    world = with_form(*chosen, teeth=96.0, window_s=0.02)
    _, true, counted = reading(path, world.sensors)
    pulses = counted[:, 0] * 96.0 * 0.02 / (2.0 * np.pi)
    assert_allclose(pulses, np.round(pulses), atol=1e-6)
    assert counted[:, 0].mean() == pytest.approx(true[:, 0].mean(), rel=3e-3)


# --- tyres, noise, logger, drivers


@pytest.mark.parametrize("foreign", numbered([foreign for _, foreign in FOREIGN.values()]))
@long
def test_foreign_tyres_have_the_slope_and_the_peak(foreign):
    own = foreign.draw(np.random.default_rng(0))
    world = nominal(CAR, Road())
    p = foreign.apply(world, share=1.0, **own).physics
    load = p.mass * 9.81 / 4.0
    for theta in (0.3, 0.9):
        slips = np.linspace(0.0, 1.0, 2001)
        force = np.array([kernel.tyre_force(p, s, 0.0, theta, load, 0.0) for s in slips])
        expected = np.array([dugoff(s, CAR.stiffness_n, theta, load) for s in slips])
        assert kernel.tyre_force(p, 1e-5, 0.0, theta, load, 0.0) == pytest.approx(1.27 * 0.5, rel=2e-3)
        assert force.max() == pytest.approx(expected.max(), rel=2e-3)
        assert np.all(np.diff(force[: int(np.argmax(force > (1.0 - 1e-9) * force.max()))]) > 0.0)
        assert force[-1] > 0.5 * expected[-1]


@pytest.mark.parametrize("foreign", numbered([foreign for _, foreign in FOREIGN.values()]))
@long
def test_a_foreign_share_of_nothing_is_the_nominal_tyre(foreign, limit):
    none = foreign.apply(limit.world, share=0.0, **foreign.draw(np.random.default_rng(0)))
    assert limit.is_nominal(none)


@pytest.mark.parametrize("noisy", beyond(9, [noise for _, noise in NOISES.values()]), ids=range(len(NOISES)))
@long
def test_noise_of_every_kind_has_its_size(noisy):
    noise = Noise(0.05, 0.02, 0.1, 0.0, 0.4, 0.01, 0.0, 0.0)
    values = noisy(noise, np.arange(400_000) * 2e-3, np.random.default_rng(0))
    assert_allclose(values.std(axis=0), noise.sigmas, rtol=0.02)
    assert np.all(np.abs(values.mean(axis=0)) < 0.05 * noise.sigmas)


@pytest.mark.parametrize(
    "digits",
    numbered(
        form
        for name, (_, form) in DIGITS.items()
        if name not in ("repeating", "losing_runs", "overrunning", "slow_receiver", "in_ticks")
        and name
        not in ("losing_frames", "slow_accelerometer", "in_turns", "waking", "filled_in", "by_the_clock")
        and name not in ("slow_place", "triggered", "slow_wheels", "own_clock")
    ),
)
def test_digits_take_no_more_than_the_noise(digits):
    path = roll(nominal(CAR, Road()), 10.0, 6.0, 150.0)
    log = make_log(path, np.full((601, 4), 150.0), Sensors(), QUIET, 200.0, np.random.default_rng(0))
    log.loc[7, "vehicle_speed_m_s"] = np.nan
    off = (digits(log) - log).std()
    assert list(digits(log)) == list(log)
    assert digits(log).isna().equals(log.isna())
    assert off["time_s"] == 0.0
    assert np.all(off[["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]] < QUIET.sigmas[3:] / 2.0)


@pytest.mark.parametrize("rich", [True, False])
@pytest.mark.parametrize("chosen", few(("driver", name) for name in STYLES))
@long
def test_every_driver_stays_within_the_car_and_excites_what_he_should(chosen, rich):
    world = nominal(CAR, Road((0.0, 60.0, 120.0), (0.9, 0.3, 0.9)) if rich else Road())
    done = drive(CAR, world, rich, 30.0, np.random.default_rng(6), STYLES[chosen[1]][1])
    speed, wheels = done.path[:, V], done.path[:, W : W + 4]
    slides = np.any(np.abs(wheels * CAR.wheel_radius_m - speed[:, None]) > 0.15 * speed[:, None], axis=1)
    assert speed.min() > FLOOR_M_S
    assert speed.max() < 45.0
    assert done.command.max() <= CAR.motor_peak_torque_nm
    assert np.any(slides) == rich


# --- deviations outside the library


SHOWN_ELSEWHERE = ("slip_controller", "regeneration_fades", "road_borders_blurred")
"""They act where a driven wheel slips, in slow braking and where a border is passed at the limit, not on this drive."""


@pytest.mark.parametrize("name", numbered(name for name in OUTSIDE if name not in SHOWN_ELSEWHERE))
@long
def test_further_deviations_show(name, limit):
    entry = OUTSIDE[name]
    assert limit.shows(entry.apply(limit.world, entry.at(CAR, np.random.default_rng(0))(1.0)))


def test_further_deviation_of_the_powertrain():
    """100 N m, told in 10 ms, take 0.1 s at 1000 N m/s: half of the difference is lost, and the follower's time."""
    command = np.zeros((301, 4))
    command[101:] = 100.0
    free = driven(nominal(CAR, Road()), command)[:, V]
    limited = driven(by_further("torque_slew", nm_s=1000.0), command)[:, V]
    lost = 0.5 * (0.1 - 0.01) + kernel.LEAST_LAG_S
    assert free[-1] - limited[-1] == pytest.approx((free[-1] - free[2000]) * lost, rel=0.05)


def test_further_deviation_of_the_wheel_speed_sensors():
    path = roll(nominal(CAR, Road()), 20.0, 10.0)
    _, true, off = reading(path, by_further("tone_wheel_runout", share=0.01).sensors)
    shares = off[:, :4] / true[:, :4] - 1.0
    assert_allclose(np.abs(shares).max(axis=0), 0.01, rtol=1e-2)
    assert_allclose(shares.mean(axis=0), 0.0, atol=5e-4)


def test_further_deviation_of_the_vehicle_speed_sensor():
    path = roll(nominal(CAR, Road()), 10.0, 20.0, 50.0)
    at, true, off = reading(path, by_further("speed_clock_drift", share=0.01).sensors)
    late = (true - off)[:, 4] / np.gradient(true[:, 4], at)
    assert_allclose(late, 0.01 * at, rtol=0.02)
