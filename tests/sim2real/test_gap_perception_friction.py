"""What a friction reference says of the classes' values."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
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
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log
from sim2real.perception.diagnose import diagnose_perception
from sim2real.perception.friction import USUAL
from sim2real.result import Verdict
from trpac_core.tyre import peak_friction


@pytest.mark.parametrize("follows", ["road", "peak"])
def test_a_reference_that_follows_road_yaml_says_that_the_classes_values_are_wrong_for_it(follows):
    """The contract: with a camera the simulation predicts the class's value, whatever friction road.yaml has."""
    finding = diagnose(Camera(), reference=follows, mu=(0.9, 0.5, 0.3))
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
    estimate = candidate(finding, "class_friction_offset").parameters
    value = np.array([0.9, 0.5, 0.3]) * (1.04 if follows == "peak" else 1.0)
    assert [estimate[name].value for name in NAMES] == pytest.approx(value, abs=0.01)


def test_without_a_camera_a_reference_that_follows_road_yaml_is_no_gap_whatever_the_classes_say():
    for follows in ("road", "peak"):
        finding = diagnose(
            Camera(), reference=follows, mu=(0.9, 0.5, 0.3), damage=lambda log: changed(log, **BLIND)
        )
        assert finding.verdict is Verdict.NO_GAP
        assert all("class_friction_offset" not in c.effects for c in finding.candidates)


def test_class_values_are_found_per_class():
    for seed, offset in enumerate(
        [(0.0, -0.2, 0.0), (-0.15, 0.0, 0.2), (-0.3, 0.1, 0.1), (0.15, -0.15, 0.0)]
    ):
        finding = diagnose(Camera(offset=offset), seed)
        assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
        estimate = candidate(finding, "class_friction_offset").parameters
        for name, truth in zip(NAMES, np.array(offset) + USUAL, strict=True):
            assert estimate[name].low <= truth <= estimate[name].high
            assert estimate[name].value == pytest.approx(truth, abs=0.02)


STIFF = BARE.model_copy(update={"tyre": BARE.tyre.model_copy(update={"longitudinal_stiffness_n": 75_000.0})})
"""Its tyre's curve rises up to a sixth above theta."""


def as_peak(log):
    """The log of a tester that tells the maximum of the tyre's curve in place of theta."""
    core = STIFF.to_core()
    load, stiffness = core.wheel_load(front=True), core.longitudinal_stiffness_n
    peaks = [peak_friction(theta, load, stiffness) for theta in log.signals["mu_reference"]]
    return changed(log, mu_reference=np.array(peaks))


def test_a_reference_that_tells_the_tyres_peak_at_the_class_values_is_no_gap():
    for seed in range(3):
        finding = diagnose(Camera(), seed, STIFF, damage=as_peak)
        assert finding.verdict is Verdict.NO_GAP
        assert candidate(finding, "class_friction_offset").score < 0.0


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.12), (0.0, -0.18, 0.1), (0.0, -0.2, 0.0)])
def test_class_values_are_found_where_the_reference_tells_the_tyres_peak(offset):
    """The classes that are as usual say that it is the peak."""
    finding = diagnose(Camera(offset=offset), 0, STIFF, damage=as_peak)
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
    estimate = candidate(finding, "class_friction_offset").parameters
    for name, truth in zip(NAMES, np.array(offset) + USUAL, strict=True):
        assert estimate[name].low <= truth <= estimate[name].high
        assert estimate[name].value == pytest.approx(truth, abs=0.02)


def test_a_few_stretches_off_on_the_fit_logs_are_nothing_where_the_hold_out_has_no_gap():
    """What the hold-out shows lies at its floor: nothing may be blamed."""
    roads = [road(seed=i, mu=(0.8, 0.6, 0.2)) for i in range(3)]
    logs = [
        drive(r, Camera(offset=(0.0, -0.1, 0.0) if i < 2 else (0.0, 0.0, 0.0)), seed=i)
        for i, r in enumerate(roads)
    ]
    assert diagnose_perception(logs[:2], logs[2], roads, BARE).causes == ()


@pytest.mark.parametrize("off", [0.1, 0.11])
def test_one_class_that_is_off_by_little_more_than_references_are_is_asked_about(off):
    """No unknown cause is needed where the class's value accounts for it, if only just."""
    finding = diagnose(Camera(offset=(off, 0.0, 0.0)), duration_s=60.0)
    assert (finding.verdict, finding.causes) == (Verdict.AMBIGUOUS, ("class_friction_offset",))
    estimate = candidate(finding, "class_friction_offset").parameters["dry"]
    assert estimate.low <= USUAL[0] + off <= estimate.high


def slow(log):
    """The log of a friction sensor that filters, 0.35 s, and tells four times a second."""
    share = 1.0 - np.exp(-0.01 / 0.35)
    values = log.signals["mu_reference"]
    filtered = scipy.signal.lfilter([share], [1.0, share - 1.0], values, zi=[(1.0 - share) * values[0]])[0]
    return changed(log, mu_reference=filtered[np.arange(len(filtered)) // 25 * 25])


@pytest.mark.parametrize("seed", range(3))
def test_a_reference_that_settles_slowly_is_no_gap_on_short_stretches(seed):
    """On 14 m at 8 to 14 m/s a part of them ends before it has settled; those tell nothing."""
    patches = {"spacing_m": 14.0, "speeds": (8.0, 14.0), "damage": slow}
    assert diagnose(Camera(), seed, **patches).verdict is Verdict.NO_GAP
    finding = diagnose(Camera(offset=(0.0, -0.2, 0.0)), seed, **patches)
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
    assert candidate(finding, "class_friction_offset").parameters["wet"].value == pytest.approx(0.4, abs=0.03)


def test_a_class_that_was_not_driven_on_is_left_open():
    dry = road(5000.0)
    logs = [drive(dry, Camera(offset=(-0.2, 0.0, 0.0)), seed=i) for i in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [dry] * 3, BARE)
    estimate = candidate(finding, "class_friction_offset").parameters
    assert (estimate["wet"].low, estimate["wet"].high) == (0.1, 1.3)
    assert estimate["dry"].low <= 0.6 <= estimate["dry"].high


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
