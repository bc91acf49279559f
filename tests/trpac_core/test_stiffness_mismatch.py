"""A tyre whose theta follows its slip is told from one that slides as told."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from trpac_core.stiffness_mismatch import StiffnessMismatch, updated_mismatch

from trpac_core import tyre
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.sensors import Sensors
from trpac_core.vehicle import Vehicle

CAR = Vehicle()
LOAD_N = CAR.wheel_load(True)
SLIPS = 0.02 + 0.01 * np.sin(0.05 * np.arange(800))


def slope_of(exponent, noise, seed=1):
    """The slope after 400 readings of theta ~ X^exponent, with relative noise that the filter is told."""
    rng, state = np.random.default_rng(seed), StiffnessMismatch()
    for slip in SLIPS[:400]:
        adhering = slip / (1.0 - slip) * CAR.longitudinal_stiffness_n / LOAD_N
        theta = 0.3 * (adhering / 0.3) ** exponent * math.exp(noise * rng.standard_normal())
        state = updated_mismatch(state, adhering, theta, noise, 0.01)
    return state


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0])
def test_the_slope_is_found_through_noise(exponent):
    found = slope_of(exponent, noise=0.05)
    assert found.slope == pytest.approx(exponent, abs=0.1)
    assert abs(found.slope - exponent) < 3.0 * math.sqrt(found.variance)


def test_what_noise_alone_may_make_of_it_is_no_mismatch():
    shares = [slope_of(0.0, noise=0.1, seed=seed).share() for seed in range(20)]
    assert sum(share > 0.0 for share in shares) <= 2
    assert max(shares) < 0.2


def test_an_even_pedal_tells_nothing_of_the_slope():
    state = StiffnessMismatch()
    for _ in range(500):
        state = updated_mismatch(state, 0.3, 0.3, 0.02, 0.01)
    assert state.share() == 0.0
    assert state.variance == 1.0


def test_what_was_learned_of_the_slope_is_forgotten_with_time():
    known = slope_of(0.0, noise=0.05)
    here = (math.exp(known.log_adhering), math.exp(known.log_theta))
    assert updated_mismatch(known, *here, 0.05, 10.0).variance == pytest.approx(known.variance + 0.1)
    assert updated_mismatch(known, *here, 0.05, 1e4).variance == 1.0


def test_a_reading_far_beyond_noise_teaches_nothing_of_the_slope():
    known = slope_of(0.0, noise=0.02)
    after = updated_mismatch(
        known, 1.5 * math.exp(known.log_adhering), 3.0 * math.exp(known.log_theta), 0.02, 0.01
    )
    assert after.slope == known.slope


def pulsed(believed_n, theta, slips=SLIPS):
    """The estimate after pulses on a road, by an estimator that takes the tyre's stiffness for another one."""
    estimator = TrpacEstimator(EstimatorConfig(vehicle=replace(CAR, longitudinal_stiffness_n=believed_n)))
    for slip in slips.repeat(5).tolist():
        force = tyre.force(theta, slip, LOAD_N, CAR.longitudinal_stiffness_n, 1.0)
        omega = 10.0 / CAR.wheel_radius_m / (1.0 - slip)
        said = estimator.step(0.001, Sensors(omega, force * CAR.wheel_radius_m, 10.0, LOAD_N))
    return estimator, said, StiffnessMismatch(**estimator.state()["state"]["mismatch"]).share()


def test_an_elastic_tyre_taken_for_a_stiffer_one_is_not_taken_for_ice():
    """On 1.0 at half the stiffness that is believed, each point of the elastic line looks like a sliding tyre."""
    _, said, share = pulsed(2.0 * CAR.longitudinal_stiffness_n, 1.0)
    assert share > 0.5
    assert said.TRPAC < 0.6
    assert abs(said.TRPAC - 1.0) < 2.0 * said.TRPAC_std


def test_a_tyre_that_slides_as_told_stays_sure():
    _, said, share = pulsed(CAR.longitudinal_stiffness_n, 0.2)
    assert share == 0.0
    assert said.TRPAC == pytest.approx(0.2, abs=0.005)
    assert said.TRPAC_std < 0.05


def test_the_slope_survives_json():
    estimator, _, _ = pulsed(2.0 * CAR.longitudinal_stiffness_n, 1.0, SLIPS[:100])
    other = TrpacEstimator(estimator.config)
    other.restore(json.loads(json.dumps(estimator.state())))
    assert other.state() == estimator.state()
    assert other.state()["state"]["mismatch"] != StiffnessMismatch()._asdict()
