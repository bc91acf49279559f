"""A pulse counter whose steps noise hides: its trace is found where it is, its age is told from a delay's."""

from dataclasses import replace

import numpy as np
import pytest
from counters import TURN, count, counted_wheels, driving
from gap_drives import MODEL, random_drives
from hypothesis import given, settings
from hypothesis import strategies as st
from long import beyond
from random_gap_drives import Levels

from scenarios.effects import EFFECTS
from sim2real.diagnose import diagnose, find
from sim2real.observing.drive import WHEEL
from sim2real.observing.lattice import find_lattice
from sim2real.observing.lattice_trace import Trace, common_trace, find_trace
from sim2real.result import Verdict
from sim2real.which.faint_counter import FINEST_TEETH, HIDDEN

COUNTER, DELAY = "wheel_speed_quantisation", "wheel_speed_delay"
TAKEN_OUT = set(EFFECTS) - {COUNTER, DELAY, "torque_lag"}


# --- a trace


@pytest.mark.parametrize(("teeth", "window_s"), [(2104, 0.02), (4096, 0.01), (500, 0.04), (48, 0.05)])
def test_a_trace_is_found_where_noise_hides_the_steps(teeth, window_s):
    time_s, wheels = counted_wheels(teeth, window_s, noise_quanta=0.25)
    quantum = TURN / (teeth * window_s)
    found = find_trace(time_s, wheels)
    assert find_lattice(time_s, wheels) is None
    assert found is not None
    assert found.quantum_rad_s == pytest.approx(
        quantum, rel=0.1 * quantum / 50.0
    )  # a tenth of one at 50 rad/s
    assert found.sigma_rad_s == pytest.approx(0.25 * quantum, rel=0.1)


@given(seed=st.integers(0, 10_000), sigma=st.floats(0.01, 0.5), swing=st.floats(0.0, 1.0))
@settings(max_examples=30, deadline=None)
def test_noise_leaves_no_trace_however_steady_the_speed(seed, sigma, swing):
    time_s, speed = driving(seed=seed)
    rng = np.random.default_rng(seed)
    wheels = [50.0 + swing * (speed - 50.0) + sigma * rng.standard_normal(len(time_s)) for _ in range(4)]
    assert find_trace(time_s, wheels) is None


@pytest.mark.parametrize("digit", [0.1, 0.05, 2.0**-4])
def test_the_last_digit_of_a_file_is_no_counter(digit):
    time_s, speed = driving()
    rng = np.random.default_rng(0)
    wheels = [
        digit * np.round(speed / digit) + 0.2 * digit * rng.standard_normal(len(speed)) for _ in range(4)
    ]
    assert find_trace(time_s, wheels) is None


def test_a_few_samples_are_no_evidence():
    time_s, wheels = counted_wheels(2104, 0.02, noise_quanta=0.25, duration_s=0.9)
    assert find_trace(time_s, wheels) is None


def test_a_log_without_wheel_noise_or_rounding_has_no_trace():
    time_s = np.arange(1000) / 500.0
    assert find_trace(time_s, [np.full(1000, 40.0)] * 4) is None


@pytest.mark.parametrize("noise_rad_s", [1e-12, 1e-6])
def test_next_to_ideal_sensors_and_a_value_out_of_all_bounds_cost_no_memory(noise_rad_s):
    time_s, speed = driving()
    noise = np.random.default_rng(0).standard_normal(len(speed))
    steady = np.full(len(speed), 40.0) + noise_rad_s * noise
    assert find_trace(time_s, [steady, steady, steady, speed]) is None
    speed[100] = 1e9
    assert find_trace(time_s, [speed + 0.05 * noise] * 4) is None


def test_logs_that_disagree_share_no_trace():
    a, near, far = (Trace(q, 0.03, 0.002) for q in (0.15, 0.1502, 0.19))
    assert common_trace([a, near, None]) == near
    assert common_trace([a, far]) is None
    assert common_trace([a, None, None]) is None
    assert common_trace([a]) is None  # one log alone may be chance


# --- its age


def counted_logs(teeth, window_s, noise_rad_s, seed=2, **effects):
    effects = effects or {COUNTER: {"teeth": teeth, "window_s": window_s}}
    return random_drives(effects, 3, seed, 20.0, levels=Levels(wheel=noise_rad_s))


def test_late_wheels_with_a_trace_are_a_counters():
    teeth, window_s = 2104.0, 0.02
    drives = counted_logs(teeth, window_s, 0.25 * TURN / (teeth * window_s))
    assert all(d.lattice is None and d.trace for d in drives)
    said = diagnose(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert said.verdict is Verdict.IDENTIFIED
    assert said.causes[0].effect == COUNTER
    for name, truth in (("teeth", teeth), ("window_s", window_s)):
        estimate = said.causes[0].parameters[name]
        assert estimate.low < truth < estimate.high
    assert "nearer than chance to multiples of 0.1493 rad/s" in said.sentence


def test_a_trace_of_a_counter_that_was_left_out_is_unknown():
    teeth, window_s = 2104.0, 0.02
    drives = counted_logs(teeth, window_s, 0.25 * TURN / (teeth * window_s))
    said = diagnose(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT | {COUNTER})
    assert said.verdict is Verdict.UNKNOWN
    assert said.unexplained.subsystem == "wheel_speed_sensor"


def averaged(drive, window_s, noise_rad_s, seed):
    """The wheel speeds as the mean of the last `window_s`, with new noise."""
    rng = np.random.default_rng(seed)
    rows = round(window_s / drive.step_s)
    measured = drive.measured.copy()
    for row in range(len(measured)):
        measured[row, WHEEL] = drive.measured[max(row - rows + 1, 0) : row + 1, WHEEL].mean(axis=0)
    measured[:, WHEEL] += noise_rad_s * rng.standard_normal(measured[:, WHEEL].shape)
    return replace(drive, measured=measured)


@pytest.mark.long
def test_wheel_speeds_that_are_late_by_averaging_are_a_delays_first():
    """Though a running counter averages alike: what is smooth may be a filter or a queue as well."""
    clean = random_drives({}, 3, 2, 20.0, levels=Levels(wheel=1e-4))
    drives = [averaged(drive, 0.08, 0.03, seed) for seed, drive in enumerate(clean)]
    said = diagnose(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert said.ambiguous_with == ((DELAY, COUNTER),)
    assert [c.effect for c in said.causes[:2]] == [DELAY, COUNTER]
    late_rows = (0.08 / drives[0].step_s - 1.0) / 2.0
    assert said.causes[0].parameters["delay_s"].value == pytest.approx(
        late_rows * drives[0].step_s, abs=0.002
    )


def test_without_a_trace_it_stands_beside_a_delay():
    teeth, window_s = 4096.0, 0.04
    drives = counted_logs(teeth, window_s, 0.6 * TURN / (teeth * window_s))
    assert not any(d.lattice or d.trace for d in drives)
    said = diagnose(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert said.verdict is Verdict.AMBIGUOUS
    assert said.ambiguous_with == ((DELAY, COUNTER),)
    assert [c.effect for c in said.causes[:2]] == [DELAY, COUNTER]
    counter = said.causes[1]
    for name, truth in (("teeth", teeth), ("window_s", window_s)):
        assert counter.parameters[name].low < truth < counter.parameters[name].high
    assert COUNTER not in said.cannot_rule_out  # its window shows, if not its teeth
    assert sum(c.probability for c in said.causes) <= 1.0
    assert said.next_manoeuvre is not None


@pytest.mark.long
def test_it_stands_beside_a_delay_on_other_tyres():
    teeth, window_s = 4096.0, 0.04
    tyres = {"tyre_shape": {"knee": 0.1, "crest": 0.03, "sliding": 0.0}}
    car = {COUNTER: {"teeth": teeth, "window_s": window_s}, **tyres}
    drives = counted_logs(teeth, window_s, 0.6 * TURN / (teeth * window_s), **car)
    found = find(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT - set(tyres))
    assert found.decision.winner.ids == (DELAY, "tyre_shape")
    assert found.decision.verdict is Verdict.AMBIGUOUS
    assert COUNTER in [e.ids[0] for e in found.decision.rivals]


@pytest.mark.parametrize("delay_s", beyond(1, [0.015, 0.04]))
def test_a_delay_stays_one_though_a_counter_could_be_hidden(delay_s):
    drives = counted_logs(0, 0.0, 0.05, **{DELAY: {"delay_s": delay_s}})
    found = find(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert found.decision.winner.ids == (DELAY,)


@pytest.mark.long
def test_a_counter_that_was_left_out_is_no_rival():
    drives = counted_logs(0, 0.0, 0.05, **{DELAY: {"delay_s": 0.04}})
    found = find(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT | {COUNTER})
    assert [e.ids[0] for e in found.contest.singles] == [DELAY, "torque_lag"]


def test_no_counter_is_as_fine_as_it_would_have_to_be():
    drives = counted_logs(0, 0.0, 0.01, **{DELAY: {"delay_s": 0.01}})
    found = find(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert TURN / (HIDDEN * 0.01 * 0.01) > FINEST_TEETH
    assert COUNTER not in [e.ids[0] for e in found.contest.singles]


def test_steps_are_hidden_by_the_noise_of_the_rows_as_logged():
    """Four rows are averaged on the grid of the diagnosis, noise and all."""
    teeth, window_s = 4096.0, 0.01
    step = TURN / (teeth * window_s)
    drives = counted_logs(teeth, window_s, 0.4 * step)
    found = find(MODEL, drives[:-1], drives[-1], exclude=TAKEN_OUT)
    assert not any(d.lattice or d.trace for d in drives)
    assert all(0.4 * step < d.spread_rad_s < 2.0 * step for d in drives)
    assert COUNTER in [e.ids[0] for e in found.contest.singles]


def test_what_counts_over_a_window_is_a_mean_of_it():
    """The oracle of these tests against the angle itself: the mean speed of a full window, to one tooth."""
    time_s, speed = driving()
    read = count(time_s, speed, 4096, 0.04)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time_s) * (speed[1:] + speed[:-1]))])
    end = 0.04 * np.floor(time_s / 0.04 + 1e-9)
    mean = (np.interp(end, time_s, turned) - np.interp(end - 0.04, time_s, turned)) / 0.04
    later = time_s > 0.1
    assert np.abs(read - mean)[later].max() < TURN / (4096 * 0.04)
