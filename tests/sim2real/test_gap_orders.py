"""What repeats with each turn of a wheel: found over the angle, told from hums and noise, said in words."""

import numpy as np
import pytest
from gap_drives import DRY, MODEL, SIGMA, STEP_S, clean, noisy, pulses, remeasured
from scipy.integrate import cumulative_trapezoid

from scenarios.plant.pipeline import simulate
from sim2real.diagnose import diagnose, without_order
from sim2real.hypotheses.contest import Contest, Entry, silent
from sim2real.hypotheses.goodness import fitness
from sim2real.hypotheses.selection import Decision
from sim2real.observing import orders
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, WHEEL, make_drive
from sim2real.observing.evidence import gather, residuals
from sim2real.observing.orders import read_order
from sim2real.reporting.findings import Findings, describe
from sim2real.result import Verdict

DURATION_S = 24.0
AMPLITUDE = 0.15
"""Of a swing of the wheel speeds, three times their noise [rad/s]."""


@pytest.fixture(scope="module")
def nominal():
    """Two drives by different speeds, without noise."""
    return [clean(pulses(DURATION_S), speed) for speed in (8.0, 12.0)]


def angles(drive):
    """Angle of each wheel, shape (n, 4) [rad]."""
    return cumulative_trapezoid(drive.measured[:, WHEEL], drive.time_s, axis=0, initial=0.0)


def swinging(drive, seed, wave):
    """The drive with noise and a wave on its wheel speeds; `wave` of angles and times."""
    made = noisy(drive, seed)
    measured = made.measured.copy()
    measured[:, WHEEL] += wave(angles(drive), drive.time_s[:, None])
    return remeasured(made, measured)


def at_order(per_turn):
    return lambda angle, time_s: AMPLITUDE * np.cos(per_turn * angle + 0.4)


def found_in(drives):
    return read_order(drives, [residuals(MODEL, drive) for drive in drives])


@pytest.mark.parametrize("per_turn", [1.0, 2.0, 2.5, 5.0])
def test_a_swing_is_found_at_its_order(nominal, per_turn):
    order = found_in([swinging(d, i, at_order(per_turn)) for i, d in enumerate(nominal)])
    assert order is not None
    assert order.per_turn == pytest.approx(per_turn, abs=1.0 / orders.TURNS)
    assert (order.moves_car, order.subsystem) == (False, "wheel_speed_sensor")


@pytest.mark.parametrize("seed", range(6))
def test_noise_has_no_order(nominal, seed):
    assert found_in([noisy(d, seed + 10 * i) for i, d in enumerate(nominal)]) is None


@pytest.mark.parametrize("frequency_hz", [6.0, 8.0, 11.3, 16.7, 25.0])
def test_a_hum_of_the_electrics_is_no_order_however_loud(nominal, frequency_hz):
    def hum(angle, time_s):
        return 5.0 * AMPLITUDE * np.cos(2.0 * np.pi * frequency_hz * time_s) + 0.0 * angle

    assert found_in([swinging(d, i, hum) for i, d in enumerate(nominal)]) is None


def test_a_swing_in_one_of_the_logs_alone_is_not_the_cars(nominal):
    assert found_in([swinging(nominal[0], 0, at_order(1.0)), noisy(nominal[1], 1)]) is None


def test_lost_samples_do_not_hide_a_swing(nominal):
    made = []
    for i, drive in enumerate(nominal):
        measured = swinging(drive, i, at_order(2.0)).measured.copy()
        lost = np.random.default_rng(i).random(len(drive)) < 0.05
        measured[lost, WHEEL.start] = np.nan
        made.append(remeasured(drive, measured))
    order = found_in(made)
    assert order is not None
    assert order.per_turn == pytest.approx(2.0, abs=0.07)


def test_taking_the_swing_off_leaves_the_log_without_it(nominal):
    made = [swinging(d, i, at_order(1.0)) for i, d in enumerate(nominal)]
    order, calm = without_order(MODEL, made)
    assert order is not None
    for drive, (i, clear) in zip(calm, enumerate(nominal), strict=True):
        rest = (drive.measured - noisy(clear, i).measured)[drive.moving][:, WHEEL]
        # a fifth of its energy at most is left: the wave's size is that of two turns around
        assert np.mean(rest**2) < 0.2 * AMPLITUDE**2 / 2.0
        np.testing.assert_array_equal(drive.swing[:, : WHEEL.start], 0.0)


def test_a_swing_that_drowns_in_the_noise_is_no_gap(nominal):
    quiet = [
        swinging(d, i, lambda angle, time_s: 0.2 * AMPLITUDE * np.cos(angle)) for i, d in enumerate(nominal)
    ]
    assert found_in(quiet) is not None
    order, same = without_order(MODEL, quiet)
    assert order is None
    assert all(a is b for a, b in zip(same, quiet, strict=True))


def rippling(speed_m_s, seed, share):
    """A car whose motors ripple five times per turn by a share of their torque; the log tells of the smooth one."""
    smooth = pulses(DURATION_S)
    torque = smooth.copy()
    for _ in range(3):  # the wheels' angle follows from the torque, hardly changed by the ripple
        run = simulate(MODEL.vehicle, DRY, torque, STEP_S, speed_m_s, 0.0)
        angle = cumulative_trapezoid(run.wheel_speed_rad_s, run.time_s, axis=0, initial=0.0)
        torque = smooth * (1.0 + share * np.cos(5.0 * angle))
    columns = dict(
        zip(
            CHANNELS, (run.position_m, run.speed_m_s, *run.wheel_speed_rad_s.T, run.accel_x_m_s2), strict=True
        )
    )
    columns |= {f"wheel_torque_{w}_nm": smooth[:, i] for i, w in enumerate(("fl", "fr", "rl", "rr"))}
    return noisy(make_drive("rippling", DRY, run.time_s, columns), seed, 0.3 * SIGMA)


def test_ripple_of_the_torque_is_the_powertrains_and_moves_the_car():
    order = found_in([rippling(8.0, 0, 0.3), rippling(6.0, 1, 0.3)])
    assert order is not None
    assert order.per_turn == pytest.approx(5.0, abs=0.07)
    assert (order.moves_car, order.subsystem) == (True, "powertrain")


def told_of_unknown(logs):
    """What is said of logs whose gap no effect explains, without holding the contest."""
    order, calm = without_order(MODEL, logs)
    fit_to, held = gather(MODEL, calm[:-1]), gather(MODEL, calm[-1:])
    null = Entry((), None, fit_to.whitened(fit_to.residuals(MODEL)), held.whitened(held.residuals(MODEL)))
    contest = Contest(null, ())
    fit = fitness(null, fit_to, held)
    decision = Decision(Verdict.UNKNOWN, null, (), {}, fit, fit)
    found = Findings(MODEL, fit_to, held, contest, decision, None, order)
    return describe(found, seed=0, jobs=2, progress=silent).unexplained


@pytest.mark.long
def test_what_takes_more_of_an_unknown_gap_is_told(nominal):
    """A swing beside a small fault of the speed sensor, and the same beside a great one."""
    logs = [swinging(d, i, at_order(1.0)) for i, d in enumerate(nominal)]

    def with_speed_off_by(share):
        off = []
        for drive in logs:
            measured = drive.measured.copy()
            measured[:, SPEED] *= 1.0 + share
            off.append(remeasured(drive, measured))
        return told_of_unknown(off)

    assert with_speed_off_by(0.0002).depends_on == "wheel angle"
    assert with_speed_off_by(0.05).subsystem == "vehicle_speed_sensor"


@pytest.mark.long
def test_a_tone_wheel_off_its_centre_is_unknown_and_named(nominal):
    logs = [swinging(d, i, at_order(1.0)) for i, d in enumerate((*nominal, nominal[0]))]
    said = diagnose(MODEL, logs[:2], logs[2], jobs=2)
    assert said.verdict is Verdict.UNKNOWN
    assert said.unexplained is not None
    assert (said.unexplained.subsystem, said.unexplained.depends_on) == ("wheel_speed_sensor", "wheel angle")
    assert "once per turn" in said.sentence
    assert said.gap.before.total > 1.5 * said.gap.noise_floor
    curve = said.unexplained.y
    expected = AMPLITUDE * np.cos(said.unexplained.x + 0.4)
    np.testing.assert_allclose(np.abs(np.fft.rfft(curve))[1], np.abs(np.fft.rfft(expected))[1], rtol=0.15)


def test_the_acceleration_counts_as_moving_only_where_it_swings(nominal):
    made = []
    for i, drive in enumerate(nominal):
        measured = swinging(drive, i, at_order(1.0)).measured.copy()
        measured[:, ACCEL] += 0.2 * np.cos(angles(drive)[:, 0])
        made.append(remeasured(drive, measured))
    order = found_in(made)
    assert order is not None
    assert (order.moves_car, order.subsystem) == (True, "wheel")
