"""What gentle driving teaches of radius, speed signal and stiffness, on a wheel whose errors are known."""

import numpy as np
import pytest
from trpac_core.slip_calibration import CORRELATED, EXACT_CAR, SETTLING, CarTolerance, calibrated

from trpac_core.tyre import INITIAL_SLOPE, used_friction

LOAD_N, C_X = 3400.0, 50_000.0
MODEL = CarTolerance()
RNG_SEED = 5


def taught(model=MODEL, bias=0.0, ratio=0.0, compliance=0.0, gentle=0.05, seconds=4.0, noise=2e-4, speed=8.0):
    """Coasting and gentle pulses in turn, read every 10 ms, at a speed that rises."""
    rng, line = np.random.default_rng(RNG_SEED), model.prior
    rows = round(seconds / 0.01)
    for row in range(rows):
        force_n = gentle * LOAD_N if row // 30 % 2 else 0.0
        v = speed * (0.7 + 0.6 * row / rows)
        slip = (
            bias / v
            + ratio
            + (1.0 + compliance) * force_n / (INITIAL_SLOPE * C_X)
            + noise * rng.standard_normal()
        )
        line = calibrated(line.drifted(model, 0.01), model, slip, v, force_n, LOAD_N, C_X, noise, 0.0)
    return line, v


def test_a_car_that_is_as_told_is_left_as_it_is():
    line, v = taught()
    assert line.offset(v) == 0.0
    assert line.compliance() == 0.0
    assert line.offset_variance(v) < 1e-8


@pytest.mark.parametrize(("bias", "ratio"), [(0.03, 0.0), (0.0, 0.01), (0.0, -0.05), (0.0, 0.1)])
def test_slip_that_a_coasting_wheel_reads_is_taken_off(bias, ratio):
    line, v = taught(bias=bias, ratio=ratio)
    assert line.offset(v) == pytest.approx(bias / v + ratio, abs=3e-4)


@pytest.mark.parametrize("compliance", [-0.1, 0.1, 0.2])
def test_a_tyre_of_another_stiffness_is_told_within_its_deviation(compliance):
    line, _ = taught(compliance=compliance)
    assert line.c == pytest.approx(compliance, abs=3.0 * line.cc**0.5)
    assert 0.0 < abs(line.compliance()) <= abs(line.c)
    assert line.cc**0.5 < 0.5 * MODEL.compliance


def test_a_tyre_that_may_slide_teaches_nothing():
    line = MODEL.prior
    for used in (0.061, 0.3):
        assert calibrated(line, MODEL, 0.03, 8.0, used * LOAD_N, LOAD_N, C_X, 1e-4, 0.0) is line


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("used", [0.0601, 0.065, 0.1, 0.5])
def test_above_gentle_driving_not_even_slip_on_the_elastic_line_is_learned_from(used, direction):
    """A tyre that slides a little on a slippery road would pass for one that is softer than told."""
    line, force_n = MODEL.prior, direction * used * LOAD_N
    for more in (0.0, 1.0, 1.2):
        slip = more * force_n / (INITIAL_SLOPE * C_X)
        assert calibrated(line, MODEL, slip, 8.0, force_n, LOAD_N, C_X, 1e-4, 0.0) is line


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_gentle_driving_teaches_on_a_car_that_drives_or_brakes(direction):
    force_n = direction * 0.0599 * LOAD_N
    taught_by = calibrated(
        MODEL.prior, MODEL, force_n / (INITIAL_SLOPE * C_X), 8.0, force_n, LOAD_N, C_X, 1e-4, 0.0
    )
    assert taught_by.cc < MODEL.prior.cc


def test_what_counts_as_gentle_lets_no_tyre_slide_on_a_tenth():
    """A tyre just slides, L = 1, where its elastic force X is half of theta F_z."""
    stretch = 0.5 * 0.1 * LOAD_N / C_X
    just_sliding = used_friction(0.1, stretch / (1.0 + stretch), LOAD_N, C_X)
    assert 0.9 * just_sliding < MODEL.gentle < just_sliding


def test_what_contradicts_all_that_is_known_counts_only_on_a_coasting_wheel():
    line, _ = taught()
    assert calibrated(line, MODEL, 0.02, 8.0, 0.05 * LOAD_N, LOAD_N, C_X, 1e-4, 0.0) is line
    assert calibrated(line, MODEL, 0.02, 8.0, 0.0, LOAD_N, C_X, 1e-4, 0.0).offset_variance(
        8.0
    ) > line.offset_variance(8.0)


def test_told_to_learn_nothing_it_learns_nothing():
    line, v = taught(EXACT_CAR, ratio=0.02, compliance=0.1)
    assert line == EXACT_CAR.prior
    assert line.offset(v) == line.compliance() == 0.0


def test_a_reading_is_taken_as_by_kalmans_formula():
    line, v = taught(seconds=0.5)
    force_n, slip, deviation, change = 0.03 * LOAD_N, 0.004, 1e-4, 2e-4
    P = np.array([[line.bb, line.br, line.bc], [line.br, line.rr, line.rc], [line.bc, line.rc, line.cc]])
    elastic = force_n / (1.27 * C_X)
    H = np.array([1.0 / v, 1.0, elastic])
    noise = CORRELATED * deviation**2 + (MODEL.force_doubt_n / (1.27 * C_X)) ** 2 + (SETTLING * change) ** 2
    total = H @ P @ H + noise
    gain = P @ H / total
    off = slip - (line.b / v + line.r + (1.0 + line.c) * elastic)
    after = calibrated(line, MODEL, slip, v, force_n, LOAD_N, C_X, deviation, change)
    assert abs(off) < 3.0 * np.sqrt(total)
    assert after[:3] == pytest.approx(np.array(line[:3]) + gain * off)
    expected = P - np.outer(gain, H @ P)
    assert after[3:] == pytest.approx(expected[np.triu_indices(3)])


@pytest.mark.parametrize("slip", [0.001, 0.02, -0.02])
@pytest.mark.parametrize("off", [{"ratio": 0.002, "compliance": 0.02}, {"bias": 0.03, "compliance": -0.1}])
def test_error_of_the_line_is_its_covariance_and_what_was_learned_and_not_used(slip, off):
    line, v = taught(**off)
    P = np.array([[line.bb, line.br, line.bc], [line.br, line.rr, line.rc], [line.bc, line.rc, line.cc]])
    H = np.array([1.0 / v, 1.0, slip])
    unused = H @ line[:3] - (line.offset(v) + slip * line.compliance())
    assert unused != 0.0
    assert line.slip_variance(slip, v) == pytest.approx(H @ P @ H + unused**2, rel=1e-9)


@pytest.mark.parametrize(("compliance", "bound"), [(4.0, 1.0), (-0.8, -0.5)])
def test_no_tyre_is_taken_for_more_than_twice_as_soft_or_as_stiff(compliance, bound):
    line, _ = taught(CarTolerance(compliance=3.0), compliance=compliance)
    assert line.c == pytest.approx(bound, abs=0.02)


def test_speed_signals_that_drift_are_known_less_from_second_to_second():
    line, _ = taught()
    later = line.drifted(MODEL, 30.0)
    assert later.bb == pytest.approx(line.bb + 30.0 * MODEL.speed_drift_m_s**2)
    assert later._replace(bb=line.bb) == line
    assert line.drifted(MODEL, 1e9).bb == pytest.approx(max(line.bb, MODEL.speed_bias_m_s**2))


def test_covariance_stays_one():
    line, _ = taught(seconds=60.0)
    matrix = np.array([[line.bb, line.br, line.bc], [line.br, line.rr, line.rc], [line.bc, line.rc, line.cc]])
    assert np.linalg.eigvalsh(matrix).min() > -1e-12
