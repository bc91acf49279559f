"""What a friction reference says of the classes' values."""

from __future__ import annotations

import numpy as np
import pytest
from camera_drives import (
    BARE,
    BLIND,
    CAR,
    NAMES,
    Camera,
    candidate,
    car_with,
    changed,
    diagnose,
    drive,
    log_of,
    road,
)

from scenarios.effects import make_effect
from scenarios.plant import make_log, simulate
from sim2real.perception.diagnose import diagnose_perception
from sim2real.result import Verdict


@pytest.mark.parametrize("follows", ["road", "peak"])
def test_a_reference_that_follows_road_yaml_says_that_the_classes_values_are_wrong_for_it(follows):
    """The contract: with a camera the simulation predicts the class's value, whatever friction road.yaml has."""
    finding = diagnose(Camera(), reference=follows, mu=(0.9, 0.5, 0.3))
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
    estimate = candidate(finding, "class_friction_offset").parameters
    off = np.array([0.1, -0.1, 0.1]) + (0.04 * np.array([0.9, 0.5, 0.3]) if follows == "peak" else 0.0)
    assert [estimate[name].value for name in NAMES] == pytest.approx(off, abs=0.01)


def test_without_a_camera_a_reference_that_follows_road_yaml_is_no_gap_whatever_the_classes_say():
    for follows in ("road", "peak"):
        finding = diagnose(
            Camera(), reference=follows, mu=(0.9, 0.5, 0.3), damage=lambda log: changed(log, **BLIND)
        )
        assert finding.verdict is Verdict.NO_GAP
        assert candidate(finding, "class_friction_offset").score < 0.0


def test_class_offsets_are_found_per_class():
    for seed, offset in enumerate(
        [(0.0, -0.2, 0.0), (-0.15, 0.0, 0.2), (-0.3, 0.1, 0.1), (0.15, -0.15, 0.0)]
    ):
        finding = diagnose(Camera(offset=offset), seed)
        assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
        estimate = candidate(finding, "class_friction_offset").parameters
        for name, truth in zip(NAMES, offset, strict=True):
            assert estimate[name].low <= truth <= estimate[name].high
            assert estimate[name].value == pytest.approx(truth, abs=0.02)


def test_a_class_that_was_not_driven_on_is_left_open():
    dry = road(5000.0)
    logs = [drive(dry, Camera(offset=(-0.2, 0.0, 0.0)), seed=i) for i in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [dry] * 3, BARE)
    estimate = candidate(finding, "class_friction_offset").parameters
    assert (estimate["wet"].low, estimate["wet"].high) == (-0.5, 0.7)
    assert estimate["dry"].low <= -0.2 <= estimate["dry"].high


def test_one_factor_on_the_roads_friction_is_the_dynamics_own():
    """The reference follows road.yaml times 0.7: one parameter does what three offsets would."""
    roads = [road(seed=i, mu=(0.9, 0.5, 0.3)) for i in range(3)]
    logs = [drive(r, Camera(), seed=i, reference="road") for i, r in enumerate(roads)]
    logs = [changed(log, mu_reference=0.7 * log.signals["mu_reference"]) for log in logs]
    finding = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert finding.causes == ("friction_offset",)
    assert candidate(finding, "friction_offset").parameters["factor"].value == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(
    ("effect", "values"),
    [("friction_offset", {"factor": 0.7}), ("mu_split", {"left_factor": 0.5, "right_factor": 1.0})],
)
def test_a_reference_that_agrees_with_what_the_dynamics_show_is_no_gap_of_the_camera(effect, values):
    roads = [road(seed=i, mu=(0.9, 0.5, 0.3)) for i in range(3)]
    torque = np.full((2001, 4), 40.0)
    logs = []
    for i, r in enumerate(roads):
        trajectory = simulate(car_with(**{effect: values}), r, torque, 0.01, 8.0)
        table = make_log(trajectory, CAR, seed=i)
        signals = {n: table[n].to_numpy() for n in ("vehicle_speed_m_s", "position_m", "mu_reference")}
        logs.append(log_of(trajectory.time_s, signals, f"drive{i}.csv"))
    alone = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert alone.verdict is not Verdict.NO_GAP
    shown = make_effect(effect, values, BARE.to_core())
    assert diagnose_perception(logs[:2], logs[2], roads, BARE, found=[shown]).verdict is Verdict.NO_GAP
