"""The withheld cases of the camera: forms, what parameters mean, and the cases' files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from camera_stand_ins import PLAIN, blaming, rolled
from long import beyond
from numpy.testing import assert_allclose

from benchmarks.gap.withheld import runner
from benchmarks.gap.withheld.generator import camera_case, camera_gap
from benchmarks.gap.withheld.generator.camera_chain import results
from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS, draw_forms_of
from benchmarks.gap.withheld.generator.camera_library import CAMERA_LIBRARY, Scene
from benchmarks.gap.withheld.generator.camera_outside import camera_outside_by
from benchmarks.gap.withheld.generator.camera_reference import reference
from benchmarks.gap.withheld.generator.camera_road import (
    CLASS_FRICTION,
    SURFACES,
    CameraRoad,
    Passage,
    draw_camera_road,
)
from benchmarks.gap.withheld.generator.camera_system import Chain, Fault, draw_chain
from benchmarks.gap.withheld.generator.camera_telling import columns
from benchmarks.gap.withheld.generator.forms import Edition
from benchmarks.gap.withheld.generator.making import make_case
from benchmarks.gap.withheld.generator.table import Group, table
from benchmarks.gap.withheld.scorer import score_run
from benchmarks.gap.withheld.show import draw_confusion

EARLY = Edition(10, 1)
CAMERA_EFFECTS = CAMERA_LIBRARY | camera_outside_by(1)
FORMS = {
    a: {f: what for f, (since, what) in forms.items() if since == 1} for a, forms in CAMERA_FORMS.items()
}
CASES = {spec.name: spec for size in ("camera", "camera_small") for spec in table(size)}
ROAD = CameraRoad(
    (0.0, *(45.0 + 31.7 * np.arange(30))),
    tuple(CLASS_FRICTION[i % 3] for i in range(31)),
    tuple(i % 3 for i in range(31)),
)
"""Dry, wet and snow in turn."""


def chain_of(seed: int = 0, **forms: str) -> Chain:
    """Drawn, with forms of one's own, and neither errors nor noise."""
    rng = np.random.default_rng(seed)
    chain = draw_chain(rng, {**draw_forms_of(1, rng), **PLAIN, **forms})
    return replace(
        chain, rate_hz=50.0, work_s=0.03, dropped=0.0, errors=0.0, none=0.0, spread=0.0, border_dip=0.0
    )


def steady(speed_m_s: float, seconds: float = 30.0) -> Passage:
    clock = np.arange(round(1000 * seconds) + 1) * 1e-3
    return Passage(2.0 + speed_m_s * clock, np.full(clock.size, speed_m_s))


def uneven() -> Passage:
    clock = np.arange(30_001) * 1e-3
    speed = 12.0 + 6.0 * np.sin(0.4 * clock)
    return Passage(2.0 + np.cumsum(speed) * 1e-3, speed)


ROWS = np.arange(0.01, 30.0, 0.01)


def shown(chain: Chain, passage: Passage, fault: Fault) -> pd.DataFrame:
    return columns(chain, results(chain, passage, ROAD, fault, "fit_1"), ROWS)


# --- neutral values


@pytest.mark.parametrize("seed", range(12))
def test_the_nominal_chain_is_the_roads(seed):
    rng = np.random.default_rng(seed)
    chain = draw_chain(rng, draw_forms_of(1, rng))
    said = results(chain, uneven(), ROAD, Fault(), "fit_1")
    assert_allclose(said.shift_m, 0.0, atol=1e-12)
    assert np.all(said.kept == 1.0)
    assert not said.mistaken.any()


NEUTRAL = {
    "camera_latency": {"delay_s": 0.0},
    "camera_pitch": {"pitch_rad": 0.0},
    "exposure_shift": {"stops": 0.0},
    "motion_blur": {"exposure_s": 0.0},
    "class_friction_offset": {"dry": 0.8, "wet": 0.6, "snow_ice": 0.2},
    "odometer_drift": {"share": 0.0},
    "map_borders_off": {"spread_m": 0.0},
    "sun_glare": {"share": 0.0},
    "stretch_confused": {"length_m": 0.0, "from_m": 0.0},
    "camera_clock_fast": {"share": 0.0},
    "camera_freezes": {"hold_s": 0.0},
}
TINY = {
    "camera_latency": {"delay_s": 1e-9},
    "camera_pitch": {"pitch_rad": 1e-9},
    "exposure_shift": {"stops": 1e-9},
    "motion_blur": {"exposure_s": 1e-12},
}


@pytest.mark.parametrize("effect", CAMERA_EFFECTS)
def test_a_neutral_value_leaves_the_nominal_columns(effect):
    fault = CAMERA_EFFECTS[effect].apply(Fault(), NEUTRAL[effect])
    assert fault == Fault()


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("effect", TINY)
def test_no_effect_draws_anew_what_is_not_its_own(effect, seed):
    """A vanishing deviation takes the way of a real one, and all that is random stays."""
    rng = np.random.default_rng(seed)
    chain = draw_chain(rng, {**draw_forms_of(1, rng), "lateness": "constant"})
    nominal, tiny = (
        results(chain, uneven(), ROAD, fault, "fit_1")
        for fault in (Fault(), CAMERA_EFFECTS[effect].apply(Fault(), TINY[effect]))
    )
    for name in ("ready_s", "number", "surface", "from_m", "to_m"):
        assert np.array_equal(getattr(nominal, name), getattr(tiny, name)), name
    assert_allclose(tiny.confidence, nominal.confidence, atol=1e-6)


# --- what the parameters mean


def moved_m(chain: Chain, passage: Passage, fault: Fault) -> np.ndarray:
    """By how much classes change later along the road than the road does."""
    said = results(chain, passage, ROAD, fault, "fit_1")
    middle = 0.5 * (said.from_m + said.to_m)
    changes = np.flatnonzero(np.diff(said.surface))
    there = 0.5 * (middle[changes] + middle[changes + 1])
    return there - ROAD.borders[np.argmin(np.abs(ROAD.borders - there[:, None]), axis=1)]


@pytest.mark.parametrize("lateness", FORMS["lateness"])
@pytest.mark.parametrize("speed", [8.0, 24.0])
def test_latency_moves_class_changes_by_speed_times_delay(lateness, speed):
    chain = chain_of(lateness=lateness)
    constant = lateness == "constant"
    mean = results(chain, steady(speed, 60.0), ROAD, Fault(delay_s=0.15), "fit_1").shift_m.mean()
    assert mean == pytest.approx(0.15 * speed, rel=1e-9 if constant else 0.03)
    moved = moved_m(chain, steady(speed), Fault(delay_s=0.15))
    assert_allclose(moved, 0.15 * speed, atol=speed / 50.0 * (0.51 if constant else 3.0))


@pytest.mark.parametrize("speed", [8.0, 24.0])
@pytest.mark.parametrize("pitch", [0.04, -0.03])
def test_pitch_moves_class_changes_by_the_geometry_whatever_the_speed(speed, pitch):
    chain = replace(chain_of(), preview_m=6.0, window_m=1.0)
    distance = 0.4 + 6.0 + 0.5
    expected = distance - 1.4 / np.tan(np.arctan(1.4 / distance) + pitch)
    assert expected * pitch > 0.0
    assert_allclose(moved_m(chain, steady(speed), Fault(pitch_rad=pitch)), expected, atol=speed / 50.0 * 0.51)
    shaking = replace(chain, forms={**chain.forms, "mounting": "shaking"})
    mean = results(shaking, steady(speed), ROAD, Fault(pitch_rad=pitch), "fit_1").shift_m.mean()
    assert mean == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize("law", FORMS["blur_law"])
def test_blur_goes_with_speed_times_exposure_and_exposure_not_with_speed(law):
    chain = chain_of(blur_law=law, exposure_law=law)

    def kept(speed: float, fault: Fault) -> float:
        return float(np.unique(results(chain, steady(speed), ROAD, fault, "fit_1").kept).mean())

    slow, fast, faster = (kept(v, Fault(exposure_s=0.004)) for v in (5.0, 10.0, 25.0))
    assert 1.0 > slow > fast > faster > 0.0
    assert fast == pytest.approx(kept(5.0, Fault(exposure_s=0.008)), rel=1e-9)
    assert kept(5.0, Fault(stops=1.0)) == pytest.approx(kept(25.0, Fault(stops=1.0)), rel=1e-12)
    assert kept(9.0, Fault(stops=2.0)) < kept(9.0, Fault(stops=1.0)) < 1.0
    assert kept(9.0, Fault(stops=-2.0)) < kept(9.0, Fault(stops=-1.0)) < 1.0


def test_an_exponential_loss_is_proportional_to_speed():
    chain = replace(chain_of(blur_law="exponential"), blur_m=0.2)
    speed = np.array([5.0, 10.0, 20.0])
    lost = [1.0 - results(chain, steady(v), ROAD, Fault(exposure_s=1e-5), "fit_1").kept[0] for v in speed]
    assert_allclose(np.array(lost) / speed, lost[0] / speed[0], rtol=2e-3)


@pytest.mark.parametrize("kind", FORMS["reference"])
def test_class_friction_is_what_the_reference_reads_and_the_place_stays(kind):
    chain = replace(chain_of(reference=kind), reference_noise=0.01)
    fault = Fault(friction=(0.7, 0.6, 0.3))
    under = ROAD.class_at(uneven().at(ROWS))
    usual, measured = (reference(chain, uneven(), ROAD, f, ROWS, "fit_1") for f in (Fault(), fault))
    for surface in range(3):
        there = under == surface
        assert usual[there].mean() == pytest.approx(CLASS_FRICTION[surface], abs=0.007)
        assert measured[there].mean() == pytest.approx(fault.friction[surface], abs=0.007)
    pd.testing.assert_frame_equal(shown(chain, uneven(), Fault()), shown(chain, uneven(), fault))


@pytest.mark.parametrize("errors", FORMS["errors"])
def test_errors_have_their_share(errors):
    odds = np.full(200_000, 0.08)
    wrong = FORMS["errors"][errors](odds, np.random.default_rng(0))
    assert wrong.mean() == pytest.approx(0.08, rel=0.05)


@pytest.mark.parametrize("aspect", ["confidence", "reference"])
def test_noise_has_its_size(aspect):
    for name, noise in FORMS[aspect].items():
        values = noise(200_000, 0.02, np.random.default_rng(0))
        assert values.mean() == pytest.approx(0.0, abs=0.03), name
        assert values.std() == pytest.approx(1.0, rel=0.03), name


@pytest.mark.parametrize("aspect", ["captures", "work"])
def test_pictures_come_at_their_rate(aspect):
    for name, draw in FORMS[aspect].items():
        assert draw(0.04, 100_000, np.random.default_rng(0)).mean() == pytest.approx(0.04, rel=0.02), name


# --- how large a deviation is


def test_gap_is_none_without_a_deviation_and_grows_with_it():
    stage = camera_gap.Stage(replace(chain_of(), reference_noise=0.02), uneven(), ROAD, "holdout")
    assert camera_gap.gap_of(stage, Fault()).total == 1.0
    for effect, entry in CAMERA_EFFECTS.items():
        if effect == "map_borders_off":
            continue  # the road's, not the chain's
        parameters = entry.at(Scene(stage.chain, (0, 1, 2)), np.random.default_rng(1))
        small, large = (
            camera_gap.gap_of(stage, entry.apply(Fault(), parameters(s))).total for s in (0.2, 0.9)
        )
        assert 1.0 <= small < large, effect


def test_gap_of_a_delay_is_its_way_over_the_spread_of_a_border():
    chain = replace(chain_of(), preview_m=2.5)
    gap = camera_gap.gap_of(camera_gap.Stage(chain, steady(20.0), ROAD, "x"), Fault(delay_s=0.1))
    spread = np.hypot(20.0 / 50.0 / np.sqrt(12.0), camera_gap.PLACE_M)
    assert gap.signals["place"] == pytest.approx(2.0 / spread, rel=1e-3)


# --- cases


@pytest.mark.parametrize("name", beyond(2, [spec.name for spec in table("camera_small")]))
def test_files_keep_the_contract_and_the_secret(name, tmp_path, monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    made = make_case(CASES[name], 1, EARLY)
    made.write(tmp_path)
    seal = json.loads(json.dumps(made.seal()))
    assert list(seal["effects"]) == list(CASES[name].effects)
    assert "camera" in seal["subsystems"] or not seal["effects"]
    check_log(pd.read_csv(tmp_path / "fit_1.csv"))
    check_road(tmp_path, seal)
    for path in tmp_path.iterdir():
        assert not [e for e in CAMERA_EFFECTS if e in path.read_text(encoding="utf-8")]


def check_log(log: pd.DataFrame) -> None:
    assert np.all(np.diff(log["time_s"]) > 0.0)
    assert set(log["image_class"]) <= {-1, 0, 1, 2}
    there = log[log["image_class"] >= 0]
    assert len(there) > 0.9 * len(log)
    assert there["image_confidence"].between(0.0, 1.0).all()
    assert (there["image_to_m"] > there["image_from_m"]).all()
    step = np.diff(log["frame_id"])
    assert (step >= 0).all()
    seen = log.filter(like="image")
    before, after = (part[step == 0].reset_index(drop=True) for part in (seen.iloc[:-1], seen.iloc[1:]))
    pd.testing.assert_frame_equal(before, after)


def check_road(folder: Path, seal: dict[str, Any]) -> None:
    """With a reference, road.yaml has the friction that it reads; it is the class's, but where that is hidden."""
    road = yaml.safe_load((folder / "road.yaml").read_text(encoding="utf-8"))
    friction = dict(zip(SURFACES, CLASS_FRICTION, strict=True))
    friction |= seal["effects"].get("class_friction_offset", {})
    measured = "mu_reference" in pd.read_csv(folder / "fit_1.csv", nrows=1)
    assert measured or "class_friction_offset" not in seal["effects"]
    for segment in road["segments"]:
        assert segment["mu_left"] == segment["mu_right"]
        assert not measured or segment["mu_left"] == friction[segment["surface"]]


@pytest.mark.long
def test_a_rich_case_has_borders_at_many_speeds_and_its_gap():
    drawn = make_case(CASES["rich-camera_latency-0"], 1, EARLY)
    assert drawn.truth.gap.total == pytest.approx(drawn.spec.target, rel=0.15)
    for name, log in drawn.logs.items():
        place = log["position_m"].to_numpy()
        crossed = np.array([b for b in drawn.roads[name].borders if np.nanmin(place) < b < np.nanmax(place)])
        assert crossed.size >= 8
        speed = np.interp(crossed, place, log["vehicle_speed_m_s"].interpolate(limit_direction="both"))
        assert speed.max() > 1.4 * speed.min()


def test_a_case_repeats_and_a_removed_one_has_the_same_logs(monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    rich = CASES["rich-camera_latency-0"]
    first, again, other = (make_case(rich, seed, EARLY) for seed in (1, 1, 2))
    removed = make_case(replace(rich, name="removed", group=Group.REMOVED), 1, EARLY)
    for name, log in first.logs.items():
        pd.testing.assert_frame_equal(log, again.logs[name])
        pd.testing.assert_frame_equal(log, removed.logs[name])
    assert first.seal() == again.seal() != other.seal()
    assert removed.spec.exclude == ("camera_latency",)


def test_table_has_the_stated_counts():
    groups = [spec.group for spec in table("camera")]
    assert {group: groups.count(group) for group in Group} == {
        Group.RICH: 30,
        Group.TYRE: 0,
        Group.MILD: 15,
        Group.NO_GAP: 25,
        Group.PAIR: 10,
        Group.OUTSIDE: 12,
        Group.REMOVED: 10,
        Group.TIMING: 0,
    }
    assert all(spec.camera for spec in table("camera"))
    assert len(table("camera_small")) == 10


def test_roads_have_every_surface_and_uneven_borders():
    road = draw_camera_road(np.random.default_rng(0), "usual")
    assert set(road.surface) == {0, 1, 2}
    assert all(a != b for a, b in zip(road.surface, road.surface[1:], strict=False))
    steps = np.diff(road.start_m)
    assert steps.min() >= 12.0
    assert steps.std() > 8.0


def test_a_run_is_made_and_scored_with_the_cameras_effects_as_candidates(tmp_path, monkeypatch):
    blaming(monkeypatch)
    monkeypatch.setattr(camera_case, "drive", rolled)
    runner.seal_run(tmp_path, "camera_small", 1, EARLY)
    for name in ("rich-camera_latency-0", "no_gap-0-rich"):
        runner.run_case(CASES[name], 1, EARLY, tmp_path, keep=False)
    scores = score_run(tmp_path)
    assert len(scores.pending) == 8
    hits = {line.name: (line.hits, line.n) for line in scores.lines}
    assert hits["right_first"] == hits["false_alarm"] == (1, 1)
    assert scores.baselines["random"]["first"] == pytest.approx(1 / 27)
    assert scores.baselines["closure only"]["first"] == scores.baselines["in-sample BIC"]["first"] == 1.0
    assert scores.baselines["cosine"]["n"] == 0
    assert scores.confusion["camera_latency"] == {"camera_latency": 1}
    draw_confusion(scores, tmp_path / "confusion.png")
