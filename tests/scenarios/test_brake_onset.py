"""TRPAC at the onset of braking: the planned distance, the cruise scenarios, sentence and figure."""

import json
import math
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.brake_onset import (
    Comparison,
    Onset,
    Plan,
    onset_row,
    require_comparable,
    simulated_stop,
    stopping_distance_m,
)
from scenarios.brake_onset_figure import draw_brake_onset
from scenarios.errors import ScenarioError
from scenarios.files import Scenario, load_scenario
from scenarios.fmu_client.estimator import parameters
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from scenarios.runner import wheel_position_m
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.sensors import Sensors

CRUISES = ("cruise_onto_snow", "cruise_onto_wet")
SPEEDS, FRICTIONS = st.floats(0.1, 100.0), st.floats(0.01, 1.5)
NEAR_M = 3.5
"""Where ahead of the front wheel a picture's class comes from."""


@given(SPEEDS, FRICTIONS)
def test_the_work_of_friction_is_the_kinetic_energy(speed_m_s, friction):
    stop_m = stopping_distance_m(speed_m_s, friction)
    assert friction * 9.81 * stop_m == pytest.approx(0.5 * speed_m_s**2)


@given(SPEEDS, FRICTIONS, st.floats(1.01, 3.0))
def test_a_faster_car_and_a_slipperier_road_need_more(speed_m_s, friction, factor):
    stop_m = stopping_distance_m(speed_m_s, friction)
    assert stopping_distance_m(factor * speed_m_s, friction) == pytest.approx(factor**2 * stop_m)
    assert stopping_distance_m(speed_m_s, friction / factor) == pytest.approx(factor * stop_m)


def test_limits_of_the_planned_distance():
    assert stopping_distance_m(0.0, 0.0) == 0.0
    assert stopping_distance_m(0.0, 0.5) == 0.0
    assert stopping_distance_m(1.0, 0.0) == math.inf
    for speed_m_s, friction in ((-1.0, 0.5), (1.0, -0.5), (math.nan, 0.5), (1.0, math.nan)):
        with pytest.raises(ValueError, match="expected 0 or more"):
            stopping_distance_m(speed_m_s, friction)


@pytest.mark.parametrize("name", CRUISES)
def test_the_car_cruises_unexcited_onto_the_other_road_and_brakes_15_m_after_its_border(name):
    scenario = load_scenario(name)
    require_comparable(scenario)
    trajectory = drive(scenario)
    row, position_m = onset_row(scenario, trajectory), wheel_position_m(scenario, trajectory)
    border_m = scenario.road.segments[1].start_m
    assert position_m[row] - border_m == pytest.approx(15.0, abs=0.5)
    cruise = slice(int(np.searchsorted(position_m, border_m - 10.0)), row + 1)
    assert trajectory.speed_m_s[cruise] == pytest.approx(15.0, abs=0.05)
    used = np.abs(trajectory.tyre_force_n[cruise] / trajectory.vertical_load_n[cruise])
    assert used.max() < 0.01
    other = scenario.road.segments[1].model_copy(update={"mu_left": 0.35, "mu_right": 0.35})
    road = scenario.road.model_copy(update={"segments": [scenario.road.segments[0], other]})
    elsewhere = drive(replace(scenario, road=road))
    for part in ("speed_m_s", "wheel_speed_rad_s"):
        np.testing.assert_allclose(getattr(elsewhere, part)[:row], getattr(trajectory, part)[:row], rtol=1e-6)


def test_without_its_camera_a_drive_has_the_same_sensor_noise():
    scenario = load_scenario("cruise_onto_snow")
    trajectory = drive(scenario)
    blind = replace(scenario, camera_path=None)
    pd.testing.assert_frame_equal(
        make_scenario_log(scenario, trajectory), make_scenario_log(blind, drive(blind))
    )


@pytest.mark.parametrize("name", CRUISES)
def test_the_simulated_car_stops_a_little_later_than_the_road_allows(name):
    scenario = load_scenario(name)
    row = onset_row(scenario, drive(scenario))
    stop_m, stop_s = simulated_stop(scenario, row)
    friction = scenario.road.segments[1].mu_left
    assert 1.0 < stop_m / stopping_distance_m(15.0, friction) < 1.15
    assert stop_s == pytest.approx(2.0 * stop_m / 15.0, rel=0.02)


@lru_cache
def at_onset(name: str, camera: bool) -> Plan:
    """The estimator's output at the onset of braking, the right class every 50 ms or no camera."""
    scenario = load_scenario(name)
    trajectory = drive(scenario)
    row = onset_row(scenario, trajectory)
    log = make_scenario_log(scenario, trajectory).iloc[: row + 1]
    position_m, told = wheel_position_m(scenario, trajectory), parameters(scenario)
    config = EstimatorConfig(
        vehicle=scenario.vehicle.to_core(),
        torque_noise_nm=told["estimator.torque_noise"],
        sliding_speed_noise_m_s=told["estimator.sliding_speed_noise"],
    )
    estimator = TrpacEstimator(config)
    columns = ["wheel_speed_fl_rad_s", "wheel_torque_fl_nm", "vehicle_speed_m_s", "accel_x_m_s2"]
    for i, (omega, torque, speed, acceleration) in enumerate(log[columns].to_numpy().tolist()):
        frame = None
        if camera and i % 50 == 0:
            frame = RoadClass(scenario.road.segment_at(position_m[i] + NEAR_M).surface_class, 0.9)
        sensors = Sensors(omega, torque, max(speed, 0.0), longitudinal_acceleration_m_s2=acceleration)
        estimate = estimator.step(scenario.step_s, sensors, frame)
    values = {key: getattr(estimate, key) for key in ("TRPAC", "TRPAC_low", "TRPAC_high")}
    return Plan.of(pd.Series(values), 15.0)


@pytest.mark.parametrize(("name", "most"), [("cruise_onto_snow", 0.35), ("cruise_onto_wet", 0.65)])
def test_with_the_right_class_trpac_is_nearer_to_the_road_before_the_tyre_shows_it(name, most):
    friction = load_scenario(name).road.segments[1].mu_left
    seen, blind = at_onset(name, True), at_onset(name, False)
    assert friction < seen.TRPAC < most < blind.TRPAC - 0.05
    assert blind.planned_stop_m < seen.planned_stop_m < stopping_distance_m(15.0, friction)
    for plan in (seen, blind):
        assert plan.TRPAC_low <= friction <= plan.TRPAC_high


def with_borders(scenario: Scenario, *starts_m: float) -> Scenario:
    """The scenario with its road's stretches beginning elsewhere, or without the last of them."""
    parts = zip(scenario.road.segments, starts_m, strict=False)
    segments = [segment.model_copy(update={"start_m": start_m}) for segment, start_m in parts]
    return replace(scenario, road=scenario.road.model_copy(update={"segments": segments}))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda s: replace(s, camera_path=None), "camera: missing"),
        (lambda s: replace(s, end=s.end.model_copy(update={"time_s": 7.0})), "no onset of braking"),
        (lambda s: with_borders(s, 0.0, 80.0), "brakes before"),
        (lambda s: with_borders(s, 0.0), "one stretch"),
    ],
)
def test_a_drive_that_cannot_be_compared_is_refused(change, word):
    with pytest.raises(ScenarioError, match=word):
        require_comparable(change(load_scenario("cruise_onto_snow")))


def plan(friction: float, low: float, high: float) -> Plan:
    return Plan.of(pd.Series({"TRPAC": friction, "TRPAC_low": low, "TRPAC_high": high}), 15.0)


ONSET = Onset(
    scenario="cruise",
    seed=1,
    surface="snow_ice",
    true_friction=0.2,
    speed_m_s=15.0,
    after_border_m=15.0,
    with_camera=plan(0.3, 0.02, 1.1),
    without_camera=plan(0.7, 0.0, 1.2),
    shortest_stop_m=stopping_distance_m(15.0, 0.2),
    simulated_stop_m=60.4,
    simulated_stop_s=8.06,
)


def test_the_sentence_holds_both_runs_the_truth_and_the_plans():
    assert ONSET.sentence == (
        "At brake onset on snow or ice (true peak friction 0.20) TRPAC is 0.30 (95 % interval 0.02 to 1.10) with the "
        "camera and 0.70 (95 % interval 0.00 to 1.20) without it. At 15.0 m/s a controller plans a stop in 38 m with "
        "the camera and 16 m without it; the road allows 57 m at best. The simulated car stops in 60 m."
    )


def test_the_summary_is_json_without_infinity():
    text = json.dumps(ONSET.summary(), allow_nan=False)
    assert json.loads(text)["without_camera"]["planned_stop_of_low_m"] is None


def test_the_figure_is_1200_pixels_wide_for_two_drives(tmp_path):
    position_m = np.linspace(-20.0, 30.0, 101)
    table = pd.DataFrame({"after_border_m": position_m, "theta_true": np.where(position_m < 0.0, 0.9, 0.2)})
    for run in ("with_camera", "without_camera"):
        table[f"TRPAC_{run}"], table[f"TRPAC_low_{run}"], table[f"TRPAC_high_{run}"] = 0.5, 0.1, 1.0
    path = tmp_path / "figure.png"
    draw_brake_onset([Comparison(table, ONSET)] * 2, path)
    picture = cv2.imread(str(path))
    assert picture.shape[1] == 1200
    assert picture.std() > 10.0
