"""Scores on traces whose figures are known beforehand."""

import numpy as np
import pytest

from scenarios.metrics import score_run, score_segment

STEP_S = 0.01


def test_exponential_approach_converges_at_three_time_constants():
    """5 % of the step is reached after ln 20 time constants."""
    time = np.arange(0.0, 2.0, STEP_S)
    score = score_segment(20.0, 0.3, 0.9, 0.3 + 0.6 * np.exp(-time / 0.2), np.ones(200, bool), STEP_S)
    assert score.convergence_time_s == pytest.approx(0.2 * np.log(20.0), abs=2 * STEP_S)
    assert score.max_error_after_convergence == pytest.approx(0.03, abs=2e-3)
    assert score.steady_state_error < 1e-3


def test_time_without_excitation_does_not_count_but_on_the_clock():
    estimate = np.r_[np.full(50, 0.9), np.full(50, 0.3)]
    excited = np.r_[np.zeros(40, bool), np.ones(60, bool)]
    score = score_segment(0.0, 0.3, 0.9, estimate, excited, STEP_S)
    assert score.wall_convergence_time_s == pytest.approx(0.5)
    assert score.convergence_time_s == pytest.approx(0.11)
    assert score.excited_time_s == pytest.approx(0.6)


def test_leaving_the_band_again_starts_anew():
    estimate = np.r_[np.full(50, 0.3), np.full(10, 0.5), np.full(40, 0.3)]
    score = score_segment(0.0, 0.3, 0.9, estimate, np.ones(100, bool), STEP_S)
    assert score.wall_convergence_time_s == pytest.approx(0.6)


def test_a_biased_estimate_never_converges_and_keeps_its_bias():
    score = score_segment(0.0, 0.3, 0.9, np.full(100, 0.2), np.ones(100, bool), STEP_S)
    assert score.convergence_time_s is None
    assert score.max_error_after_convergence is None
    assert score.steady_state_error == pytest.approx(0.1)


def test_without_excitation_there_is_no_steady_state():
    score = score_segment(0.0, 0.9, 0.8, np.full(10, 0.8), np.zeros(10, bool), STEP_S)
    assert score.steady_state_error is None
    assert score.excited_time_s == 0.0


def test_each_stretch_counts_its_step_from_the_one_before():
    theta = np.r_[np.full(100, 0.9), np.full(100, 0.3), np.full(100, 0.5)]
    segment = np.repeat([0, 1, 2], 100)
    estimate = theta + np.r_[np.zeros(200), np.full(100, 0.011)]
    scores = score_run(
        np.array([0.0, 20.0, 40.0]), segment, theta, 0.8, {"DE": estimate}, np.ones(300, bool), STEP_S
    )["DE"]
    assert [s["theta"] for s in scores] == [0.9, 0.3, 0.5]
    assert scores[1]["convergence_time_s"] is not None
    assert scores[2]["convergence_time_s"] is None  # 0.011 is more than 5 % of the step of 0.2
