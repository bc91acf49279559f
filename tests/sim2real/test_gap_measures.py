"""How large the gap is, where it lies, how far it shrinks, and how well its parameters are known."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, SIGMA, clean, noisy, pulses, random_drives, rms, road_of, trace

from scenarios.effects import EFFECTS
from scenarios.effects.accelerometer_bias import AccelerometerBias
from scenarios.effects.mass_offset import MassOffset
from scenarios.effects.torque_gain import TorqueGain
from scenarios.effects.vehicle_speed_scale import VehicleSpeedScale
from sim2real.diagnose import diagnose
from sim2real.how_far import gap
from sim2real.how_far.budget import budget
from sim2real.hypotheses.contest import as_it_is, enter
from sim2real.hypotheses.fitting import Candidate, fit
from sim2real.observing.drive import ACCEL, CHANNELS, GROUPS, SPEED, WHEEL
from sim2real.observing.evidence import Evidence, gather, residuals
from sim2real.observing.noise import Noise
from sim2real.reporting import estimates
from sim2real.reporting.estimates import intervals, is_excited
from sim2real.result import Interval
from sim2real.where import localise
from sim2real.where.localise import REGIMES, Blocks, blocks, equation_shares, heat_map, places, regimes


def known(*drives):
    """Evidence whose noise is what was put on the drives."""
    noises = [Noise(SIGMA, np.zeros(7), np.ones((len(d), 7))) for d in drives]
    return Evidence(tuple(drives), tuple(noises))


@pytest.fixture(scope="module")
def tame():
    """A drive below the grip limit with noise."""
    return noisy(clean(pulses(8.0), 14.0), 3)


# --- size


def test_a_measure_is_the_rms_in_noise_floors_and_in_si(tame):
    held = known(tame)
    rest = np.zeros((len(tame), 7))
    rest[:, WHEEL] = 2.0 * SIGMA[WHEEL]
    rest[:, SPEED] = -3.0 * SIGMA[SPEED]
    rest[:, ACCEL] = 6.0 * SIGMA[ACCEL]
    found = gap.measure(held, [rest])
    assert found.signals == pytest.approx({"wheel_speed": 2.0, "vehicle_speed": 3.0, "accel_x": 6.0})
    assert found.total == pytest.approx(np.sqrt((4.0 + 9.0 + 36.0) / 3.0))
    assert found.si == pytest.approx(
        {"wheel_speed [rad/s]": 0.1, "vehicle_speed [m/s]": 0.06, "accel_x [m/s^2]": 0.48}
    )


def test_a_signal_that_is_not_measured_is_no_part_of_the_measure(tame):
    rest = np.ones((len(tame), 7)) * SIGMA
    rest[:, ACCEL] = np.nan
    rest[:100] = np.nan
    found = gap.measure(known(tame), [rest])
    assert found.signals == pytest.approx({"wheel_speed": 1.0, "vehicle_speed": 1.0})
    assert found.total == pytest.approx(1.0)


def test_logs_are_measured_as_one(tame):
    ones = np.ones((len(tame), 7)) * SIGMA
    found = gap.measure(known(tame, tame), [ones, 3.0 * ones])
    assert found.total == pytest.approx(np.sqrt(5.0))


def test_the_true_model_leaves_the_noise_floor(tame):
    held = gather(MODEL, [tame])
    left = gap.measure(held, held.residuals(MODEL)).total
    floor = gap.noise_floor(MODEL, held, 0)
    assert left == pytest.approx(1.0, abs=0.1)
    assert floor == pytest.approx(1.0, abs=0.1)
    assert left == pytest.approx(floor, abs=0.1)


def test_the_noise_floor_is_the_seeds(tame):
    held = gather(MODEL, [tame])
    assert gap.noise_floor(MODEL, held, 4) == gap.noise_floor(MODEL, held, 4)
    assert gap.noise_floor(MODEL, held, 4) != gap.noise_floor(MODEL, held, 5)


# --- shrink


def test_a_shrink_is_what_is_less():
    drive = noisy(clean(pulses(20.0), 14.0))
    held = known(drive)
    before = 4.0 * np.random.default_rng(0).standard_normal((len(drive), 7)) * SIGMA
    found = gap.shrink(held, [before], [0.25 * before], seed=1)
    assert found.value == pytest.approx(75.0)
    assert (found.low, found.high) == pytest.approx((75.0, 75.0))
    assert found.unit == "%"


def test_what_grows_shrinks_by_less_than_nothing(tame):
    ones = np.ones((len(tame), 7)) * SIGMA
    assert gap.shrink(known(tame), [ones], [2.0 * ones], seed=1).value == pytest.approx(-100.0)


def test_a_shrink_agrees_with_the_measures(tame):
    held = known(tame)
    before, after = held.residuals(MODEL.with_effects(MassOffset(150.0))), held.residuals(MODEL)
    found = gap.shrink(held, before, after, seed=0)
    old, new = gap.measure(held, before).total, gap.measure(held, after).total
    assert found.value == pytest.approx(100.0 * (1.0 - new / old), abs=0.1)
    assert found.low < found.value < found.high


def test_the_shrinks_interval_holds_the_true_shrink(tame):
    """A gap whose size changes from second to second, over noise that is left: the mean of many seconds is known."""
    held = known(*[tame] * 4)
    expected_square = 9.0 * np.exp(2.0 * 0.5**2)  # of three noise floors, lognormal
    true = 100.0 * (1.0 - 1.0 / np.sqrt(1.0 + expected_square))
    inside = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        before, after = [], []
        for drive in held.drives:
            second = ((drive.time_s - drive.time_s[0]) // gap.BLOCK_S).astype(int)
            size = 3.0 * rng.lognormal(0.0, 0.5, second[-1] + 1)[second]
            noise = rng.standard_normal((len(drive), 7))
            before.append((noise + size[:, None] * rng.choice([-1, 1])) * SIGMA)
            after.append(noise * SIGMA)
        found = gap.shrink(held, before, after, seed)
        inside += found.low <= true <= found.high
    assert inside >= 25


@pytest.mark.filterwarnings("error")
def test_seconds_in_which_nothing_counts_are_not_resampled(tame):
    """A hold-out that is mostly standing: with its empty blocks, some resamplings would have no gap at all."""
    held = known(tame)
    before = np.ones((len(tame), 7)) * SIGMA
    before[150:] = np.nan
    found = gap.shrink(held, [2.0 * before], [before], seed=0)
    assert (found.value, found.low, found.high) == pytest.approx((50.0, 50.0, 50.0))
    assert len(gap.block_squares(held, [before])[1]) < 8.0 / gap.BLOCK_S
    nothing = gap.shrink(held, [np.nan * before], [np.nan * before], seed=0)
    assert np.isnan([nothing.value, nothing.low, nothing.high]).all()


@pytest.mark.filterwarnings("error")
def test_a_budget_of_a_hold_out_that_mostly_stands_has_shares(tame):
    moving = tame.moving & (tame.time_s < tame.time_s[0] + 1.5)
    held = known(replace(tame, moving=moving))
    shares = budget(held, [MassOffset(150.0)], MODEL, 1.0, seed=0).shares
    assert sum(share.value for share in shares.values()) == pytest.approx(1.0)
    assert all(np.isfinite([share.low, share.high]).all() for share in shares.values())


def test_the_interval_of_a_shrink_is_the_seeds(tame):
    held = known(tame)
    before, after = held.residuals(MODEL.with_effects(MassOffset(150.0))), held.residuals(MODEL)
    assert gap.shrink(held, before, after, seed=3) == gap.shrink(held, before, after, seed=3)
    assert gap.shrink(held, before, after, seed=3) != gap.shrink(held, before, after, seed=4)


# --- budget


BIAS, SCALE = AccelerometerBias(0.3), VehicleSpeedScale(1.01)


@pytest.fixture(scope="module")
def two_sensors():
    """A log of a biased accelerometer and a speed that reads too much: neither touches the other's signals."""
    effects = {"accelerometer_bias": {"bias_m_s2": 0.3}, "vehicle_speed_scale": {"factor": 1.01}}
    return known(noisy(clean(pulses(8.0), 14.0, effects=effects), 3))


def shares_of(held, *effects, floor=1.0, seed=0):
    found = budget(held, effects, MODEL, floor, seed).shares
    assert sum(share.value for share in found.values()) == pytest.approx(1.0)
    assert all(share.low <= share.value <= share.high for share in found.values())
    return found


def test_two_effects_that_act_alone_have_the_shares_of_their_own_signals(two_sensors):
    found = shares_of(two_sensors, BIAS, SCALE)
    assert list(found) == ["effect:accelerometer_bias", "effect:vehicle_speed_scale", "structure", "noise"]
    signals = gap.measure(two_sensors, two_sensors.residuals(MODEL)).signals
    whole = sum(size**2 for size in signals.values())
    biased = (signals["accel_x"] ** 2 - 1.0) / whole
    assert found["effect:accelerometer_bias"].value == pytest.approx(biased, rel=0.05)
    assert found["effect:vehicle_speed_scale"].value == pytest.approx(1.0 - biased - 3.0 / whole, rel=0.05)
    assert found["noise"].value == pytest.approx(3.0 / whole)
    assert found["structure"].value == pytest.approx(0.0, abs=0.01)


def test_effects_share_alike_in_whatever_order_they_are_named(two_sensors):
    """Mass and gain take from each other what the first of them would take."""
    pair = MassOffset(150.0), TorqueGain(0.9)
    assert shares_of(two_sensors, *pair) == shares_of(two_sensors, *pair[::-1])
    assert shares_of(two_sensors, *pair) != shares_of(two_sensors, *pair, seed=1)


def test_what_no_effect_takes_is_structure(two_sensors):
    found = shares_of(two_sensors, SCALE)
    both = shares_of(two_sensors, BIAS, SCALE)
    assert found["structure"].value == pytest.approx(both["effect:accelerometer_bias"].value, abs=0.01)
    assert shares_of(two_sensors)["structure"].value == pytest.approx(1.0 - found["noise"].value)


def test_noise_alone_is_all_of_a_budget(tame):
    held = known(tame)
    found = shares_of(held, floor=gap.noise_floor(MODEL, held, 0))
    assert found["noise"].value == pytest.approx(1.0, abs=0.05)
    assert shares_of(held, floor=1.1) == {
        "structure": Interval(0.0, 0.0, 0.0),
        "noise": Interval(1.0, 1.0, 1.0),
    }


# --- intervals


def covering(drive, true, seeds, colour=0.0):
    """Share of the intervals of the accelerometer's bias that hold it, and their mean half width."""
    inside, widths = [], []
    for seed in seeds:
        noise = Noise(SIGMA, np.full(7, colour), np.ones((len(drive), 7)))
        drawn = noise.draw(len(drive), np.random.default_rng(seed))
        held = Evidence((replace(drive, measured=drive.measured + drawn),), (noise,))
        found = fit(Candidate(MODEL, ("accelerometer_bias",)), held, np.array([0.1]))
        ((_, low, high),) = estimates.intervals(found, held)
        inside.append(low <= true <= high)
        widths.append(0.5 * (high - low))
    return np.mean(inside), np.mean(widths)


@pytest.mark.parametrize("colour", [0.0, 0.7])
def test_intervals_cover_and_are_no_wider_than_said(colour):
    """The bias is a mean of n readings, correlated by the colour: its standard error is known."""
    drive = clean(pulses(6.0), 14.0, effects={"accelerometer_bias": {"bias_m_s2": 0.2}})
    share, width = covering(drive, 0.2, range(40), colour)
    rows = int((drive.time_s >= 0.3).sum())
    error = SIGMA[ACCEL] * np.sqrt((1.0 + colour) / (1.0 - colour) / rows)
    assert share >= 0.95
    # the least half width is a hundredth of a noticeable change, and a share of the bias
    least = estimates.LEAST_HALF_WIDTH * Candidate(MODEL, ("accelerometer_bias",)).scale[0]
    form = estimates.FORM_SHARE * 0.2
    assert width == pytest.approx(
        np.hypot(1.96 * estimates.INTERVAL_FACTOR * error, np.hypot(least, form)), rel=0.25
    )


def entered(key, drive, start):
    """An effect alone, fitted to a drive and held to it."""
    logs = known(drive)
    return enter(Candidate(MODEL, (key,), (0,)), logs, logs, np.array([start]), 4)


def test_what_the_logs_exclude_sharply_was_excited_whatever_else_is_wrong():
    """A heavy car leaves a gap in which anything is uncertain alone; beside the mass it is not."""
    heavy = noisy(clean(pulses(8.0), 14.0, effects={"mass_offset": {"mass_kg": 300.0}}))
    mass = entered("mass_offset", heavy, 250.0)
    bias = entered("accelerometer_bias", heavy, 0.1)
    assert is_excited(mass, mass) is True
    assert is_excited(bias, mass) is True


def test_what_never_shows_was_not_excited():
    standstill = noisy(clean(0.0 * pulses(6.0), 20.0))
    logs = known(standstill)
    null = as_it_is(MODEL, logs, logs)
    assert not is_excited(entered("torque_gain", standstill, 1.1), null)
    assert is_excited(entered("accelerometer_bias", standstill, 0.1), null)


def test_a_parameter_of_little_slope_beside_one_of_much_is_as_wide_as_alone():
    drive = noisy(clean(pulses(6.0), 14.0))
    found = entered("torque_gain", drive, 1.1).fitted
    weight = np.ones(len(found.z))
    little = 1e-6 * np.random.default_rng(0).standard_normal((len(found.z), 1))
    much = 1e3 * np.random.default_rng(1).standard_normal((len(found.z), 1))
    alone = estimates._inverse(little, weight)[0, 0]
    assert estimates._inverse(np.hstack([little, much]), weight)[0, 0] == pytest.approx(alone, rel=0.05)


def test_a_parameter_without_any_slope_may_be_anything():
    drive = noisy(clean(pulses(6.0), 14.0))
    found = entered("torque_gain", drive, 1.1).fitted
    blind = replace(found, jacobian=0.0 * found.jacobian)
    ((_, low, high),) = intervals(blind, known(drive))
    assert (low, high) == tuple(float(bound[0]) for bound in found.candidate.bounds)


def places_of(drive, part, subsystem):
    return places(drive, part, {subsystem: part})


def test_intervals_stay_within_the_bounds(tame):
    held = known(tame)
    for effect in ("brake_drag", "torque_lag", "rolling_resistance"):
        found = fit(Candidate(MODEL, (effect,)), held)
        low, high = found.candidate.bounds
        ((value, a, b),) = estimates.intervals(found, held)
        assert low[0] <= a <= value <= b <= high[0]


def test_a_parameter_that_nothing_shows_has_a_wide_interval():
    """Friction on a calm drive, against friction on one to the limit."""
    calm = known(noisy(clean(trace((0, 30), duration_s=6.0), 14.0)))
    hard = known(noisy(clean(3.0 * pulses(6.0), 14.0, road_of(0.4))))
    widths = []
    for held in (calm, hard):
        found = fit(Candidate(MODEL, ("friction_offset",)), held, np.array([1.0]))
        ((_, low, high),) = estimates.intervals(found, held)
        widths.append(high - low)
    assert widths[0] > 20.0 * widths[1]


# --- where: regimes and blocks


@pytest.fixture(scope="module")
def tour():
    """Every regime in turn: slow drive, fast drive, coast, brake, an icy stretch, the limit on it, standstill."""
    points = [
        (0, 150),
        (4, 150),
        (4.1, 0),
        (5.5, 0),
        (5.6, -100),
        (7, -100),
        (7.1, 0),
        (9, 0),
        (9.1, -280),
        (14, -280),
    ]
    return clean(trace(*points, duration_s=16.0), 4.0, road_of(0.9, 0.9, 0.25, length_m=36.0))


def test_the_regimes_are_what_was_driven(tour):
    seen = MODEL.predict(tour)
    found = regimes(tour, seen)
    assert set(found) <= set(REGIMES)

    def at(t):
        return found[np.searchsorted(tour.time_s, t)]

    assert at(0.5) == "drive, low speed"
    assert at(3.9) == "drive, high speed"
    assert at(5.0) == "coast"
    assert at(6.5) == "brake"
    assert (found[~tour.moving] == "standstill").all()
    assert "standstill" in found
    assert "near the limit" in found
    change = int(np.flatnonzero(np.diff(seen.theta[:, 0]))[0])
    assert found[change + 10] == "surface change"


def test_a_locked_wheel_is_near_the_limit():
    drive = clean(trace((0, 0), (1, 0), (1.1, -400), (3, -400), duration_s=3.0), 16.0, road_of(0.3))
    seen = MODEL.predict(drive)
    locked = (seen.slip > 0.95).all(axis=1) & drive.moving
    assert locked.sum() > 50
    assert (regimes(drive, seen)[locked] == "near the limit").all()


def test_blocks_of_noise_have_unit_means(tame):
    noise = known(tame).noises[0]
    drawn = noise.draw(len(tame), np.random.default_rng(2))
    part = blocks(tame, noise, MODEL.predict(tame), drawn)
    assert rms(part.z, axis=None) == pytest.approx(1.0, abs=0.1)
    assert part.z.shape == (len(part.from_s), 7)
    np.testing.assert_allclose(part.to_s[:-1], part.from_s[1:])
    np.testing.assert_allclose(np.diff(part.from_s), localise.BLOCK_S)


def test_blocks_without_samples_count_nothing(tame):
    noise = known(tame).noises[0]
    rest = np.full((len(tame), 7), np.nan)
    assert (blocks(tame, noise, MODEL.predict(tame), rest).z == 0.0).all()


# --- where: places and shares


def parted(**off):
    """Ten blocks of 0.2 s in which signals are off at some blocks."""
    z = np.zeros((10, len(CHANNELS)))
    for signal, (rows, size) in off.items():
        z[rows, GROUPS[signal]] = size
    begin = 0.2 * np.arange(10)
    return Blocks(begin, begin + 0.2, z, np.array(["coast"] * 5 + ["brake"] * 5))


def test_a_place_is_a_signal_a_regime_and_a_window(tame):
    (found,) = places_of(tame, parted(accel_x=([1, 2, 3], 10.0)), "accelerometer")
    assert (found.signal, found.subsystem, found.regime) == ("accel_x", "accelerometer", "coast")
    assert (found.from_s, found.to_s) == (0.2, 0.8)
    assert found.share == 1.0
    assert found.log == tame.name


def test_places_end_where_the_regime_does_and_where_it_is_good_again(tame):
    found = places_of(tame, parted(vehicle_speed=([1, 3, 4, 5, 6, 9], 8.0)), "vehicle")
    spans = sorted((p.from_s, p.to_s) for p in found)
    assert spans == [(0.2, 1.0), (1.0, 1.4), (1.8, 2.0)] or spans == [
        (0.2, 0.4),
        (0.6, 1.0),
        (1.0, 1.4),
        (1.8, 2.0),
    ]
    assert sum(p.share for p in found) == pytest.approx(1.0, abs=1e-3)


def test_places_are_ranked_by_their_share(tame):
    found = places_of(tame, parted(accel_x=([1], 5.0), wheel_speed=([7], 20.0)), "tyre")
    assert [p.signal for p in found] == ["wheel_speed", "accel_x"]
    assert found[0].share > 0.9


def test_noise_is_no_place(tame):
    noise = known(tame).noises[0]
    drawn = noise.draw(len(tame), np.random.default_rng(2))
    found = places_of(tame, blocks(tame, noise, MODEL.predict(tame), drawn), "tyre")
    assert sum(p.to_s - p.from_s for p in found) < 0.1 * tame.time_s[-1]


def test_a_biased_accelerometer_is_placed_there_all_the_time(tame):
    rest = residuals(MODEL.with_effects(AccelerometerBias(0.4)), tame)
    noise = known(tame).noises[0]
    found = places_of(tame, blocks(tame, noise, MODEL.predict(tame), rest), "accelerometer")
    assert {p.signal for p in found if p.share > 0.02} == {"accel_x"}


def test_the_heat_map_holds_the_whole_gap_once():
    part = parted(accel_x=([1, 2], 10.0), wheel_speed=([7], 10.0))
    found = heat_map([part], {"tyre": 0.75, "vehicle": 0.25})
    assert sum(sum(row.values()) for row in found.values()) == pytest.approx(1.0)
    assert sum(found["tyre"].values()) == pytest.approx(0.75)
    assert found["tyre"]["brake"] / found["tyre"]["coast"] == pytest.approx(
        2.0
    )  # four wheels, two blocks of one
    assert set(found["vehicle"]) == set(part.regime), "a regime that was not driven has no share"


def test_the_equation_that_takes_most_has_the_greatest_share():
    found = equation_shares([("tyre", 100.0), ("vehicle", 50.0), ("tyre", 20.0), ("road", -1.0)])
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["tyre"] > 0.9
    assert found["vehicle"] == pytest.approx(found["tyre"] / 16.0)
    assert found["road"] == 0.0
    assert equation_shares([("tyre", 0.0)]) == {}
    assert equation_shares([]) == {}


def test_an_estimate_at_a_bound_is_told_unless_it_means_no_effect(tame):
    found = fit(Candidate(MODEL, ("aero_drag",)), known(tame), np.array([0.1]), 1)
    low, high = found.candidate.bounds
    assert found.candidate.at_bound(high) == ["drag_area_m2"]
    assert found.candidate.at_bound(0.5 * (low + high)) == []
    assert found.candidate.at_bound(low) == []  # no drag at all is the neutral value


def test_the_part_of_the_car_that_the_cause_lies_in_has_the_most_of_the_heat_map():
    """A lag of the torque is no function of torque or speed, so that no free term of the powertrain shows it."""
    logs = random_drives({"torque_lag": {"time_constant_s": 0.08}}, count=2, seed=4, duration_s=6.0)
    exclude = set(EFFECTS) - {"torque_lag", "mass_offset"}
    said = diagnose(MODEL, logs[:1], logs[1], exclude=exclude)
    shares = {part: sum(row.values()) for part, row in said.heat_map.items()}
    assert max(shares, key=lambda part: shares[part]) == "powertrain"


def test_a_place_is_of_the_part_that_is_missed_there_most(tame):
    both = parted(accel_x=([1, 2], 10.0), wheel_speed=([6, 7], 10.0))
    without = {
        "accelerometer": parted(accel_x=([1, 2], 9.0), wheel_speed=([6], 2.0)),
        "wheel_speed_sensor": parted(accel_x=([1], 3.0), wheel_speed=([6, 7], 9.0)),
    }
    found = {place.signal: place.subsystem for place in places(tame, both, without)}
    assert found == {"accel_x": "accelerometer", "wheel_speed": "wheel_speed_sensor"}
