"""The withheld cases of the camera: the nominal chain, what parameters mean, and the cases' files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from camera_stand_ins import PLAIN, ROAD, blaming, check_log, rolled, steady
from long import beyond
from numpy.testing import assert_allclose

from benchmarks.gap.withheld import runner
from benchmarks.gap.withheld.generator import camera_case, camera_gap
from benchmarks.gap.withheld.generator.camera_case import make_case
from benchmarks.gap.withheld.generator.camera_chain import results
from benchmarks.gap.withheld.generator.camera_faults import NOD_M
from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS
from benchmarks.gap.withheld.generator.camera_gap import Stage, gap_of
from benchmarks.gap.withheld.generator.camera_layouts import LAYOUTS, draw_laid_road
from benchmarks.gap.withheld.generator.camera_library import CAMERA_LIBRARY, Scene
from benchmarks.gap.withheld.generator.camera_outside import ALL_EFFECTS, CAMERA_OUTSIDE
from benchmarks.gap.withheld.generator.camera_reference import friction_of, friction_under, reference
from benchmarks.gap.withheld.generator.camera_road import (
    CLASS_FRICTION,
    ROAD_M,
    SURFACES,
    Passage,
    draw_camera_road,
)
from benchmarks.gap.withheld.generator.camera_system import Chain, Fault, Results, draw_chain
from benchmarks.gap.withheld.generator.camera_telling import MISTAKEN, columns, voted
from benchmarks.gap.withheld.generator.camera_timing import timing
from benchmarks.gap.withheld.generator.cases import SHOWS
from benchmarks.gap.withheld.generator.forms import draw_forms
from benchmarks.gap.withheld.generator.table import Group, table
from benchmarks.gap.withheld.scorer import score_run

CASES = {spec.name: spec for spec in table("camera")}
ROWS = np.arange(0.01, 60.0, 0.01)
OF_CHAIN = [
    pytest.param(aspect, name, id=f"{aspect}-{i}", marks=() if i == 1 else pytest.mark.long)
    for aspect, forms in CAMERA_FORMS.items()
    for i, name in enumerate(forms)
    if aspect not in ("layout", "speeds", "position", "friction_off")
]


def chain_of(seed: int = 0, **forms: str) -> Chain:
    """Drawn, with forms of one's own, and neither errors nor noise."""
    chain = draw_chain(np.random.default_rng(seed), {**PLAIN, **forms})
    none = {"dropped": 0.0, "errors": 0.0, "none": 0.0, "spread": 0.0, "border_dip": 0.0}
    return replace(chain, rate_hz=50.0, work_s=0.03, preview_m=5.0, window_m=0.8, **none)


def uneven(seconds: float = 60.0) -> Passage:
    clock = np.arange(round(1000 * seconds) + 1) * 1e-3
    speed = 14.0 + 5.0 * np.sin(0.4 * clock)
    return Passage(2.0 + np.cumsum(speed) * 1e-3, speed)


def said(chain: Chain, fault: Fault, passage: Passage | None = None) -> Results:
    return results(chain, passage or uneven(), ROAD, fault, "fit_1")


def moved_m(told: Results) -> np.ndarray:
    """By how much classes change later along the road than the road does, where results come one after the other."""
    middle = 0.5 * (told.from_m + told.to_m)
    changes = np.flatnonzero((np.diff(told.surface) != 0) & (np.diff(middle) < 1.2))
    there = 0.5 * (middle[changes] + middle[changes + 1])
    return there - ROAD.borders[np.argmin(np.abs(ROAD.borders - there[:, None]), axis=1)]


# --- the nominal chain


@pytest.mark.parametrize(("aspect", "name"), OF_CHAIN)
def test_the_nominal_chain_tells_the_road_in_every_form(aspect, name):
    """Classes change where the road's do, in the mean to less than the way of a cycle; nothing is lost or wrong."""
    plain = said(chain_of(**{aspect: name}), Fault())
    assert_allclose(plain.shift_m, 0.0, atol=NOD_M + 0.02)
    assert abs(plain.shift_m.mean()) < 0.02
    assert np.all(plain.kept == 1.0)
    assert not plain.mistaken.any()
    assert plain.confidence.min() > 0.7
    assert np.all(np.diff(plain.ready_s) >= 0.0)
    sided = 0.14 if name in ("near", "far") else 0.0  # by what is stamped of a stretch
    assert abs(moved_m(plain).mean()) < 0.12 + sided


TINY = {
    "camera_latency": {"delay_s": 1e-9},
    "camera_pitch": {"pitch_rad": 1e-9},
    "exposure_shift": {"stops": 1e-9},
    "motion_blur": {"exposure_s": 1e-12},
}


@pytest.mark.parametrize("seed", range(12))
def test_no_effect_draws_anew_what_is_not_its_own(seed):
    """A vanishing deviation takes the way of a real one, and all that is random stays."""
    rng = np.random.default_rng(seed)
    own = {"lateness": "constant", "told_confidence": "as_is"}
    chain = draw_chain(rng, draw_forms(rng, CAMERA_FORMS) | own)
    nominal = said(chain, Fault(), uneven(30.0))
    for effect, given in TINY.items():
        tiny = said(chain, ALL_EFFECTS[effect].apply(Fault(), given), uneven(30.0))
        for column in ("ready_s", "number", "surface", "from_m", "to_m"):
            assert np.array_equal(getattr(nominal, column), getattr(tiny, column)), (effect, column)
        assert_allclose(tiny.confidence, nominal.confidence, atol=1e-6)


STAGE = Stage(replace(chain_of(), reference_noise=0.02), uneven(), ROAD, "holdout")


def gap_at(effect: str, severity: float) -> float:
    entry = ALL_EFFECTS[effect]
    given = entry.at(Scene(STAGE.chain, (0, 1, 2)), np.random.default_rng(1))(severity)
    fault = entry.apply(Fault(), given)
    return gap_of(STAGE, fault, camera_case._told(STAGE.chain, ROAD, fault)).total


@pytest.mark.parametrize("effect", beyond(8, ALL_EFFECTS))
def test_every_deviation_grows_and_shows(effect):
    assert 1.0 <= gap_at(effect, 0.1) < gap_at(effect, 1.0)
    assert gap_at(effect, 1.0) > SHOWS


def test_gap_is_none_without_a_deviation_and_that_of_a_delay_is_its_way_over_a_borders_spread():
    assert gap_of(STAGE, Fault()).total == 1.0
    chain = replace(chain_of(), preview_m=2.5)
    gap = gap_of(Stage(chain, steady(20.0, 30.0), ROAD, "x"), Fault(delay_s=0.1))
    spread = np.hypot(20.0 / 50.0 / np.sqrt(12.0), camera_gap.PLACE_M)
    assert gap.signals["place"] == pytest.approx(2.0 / spread, rel=1e-3)


# --- what the parameters mean


@pytest.mark.parametrize("lateness", CAMERA_FORMS["lateness"])
def test_latency_is_the_mean_delay_and_moves_class_changes_by_its_way(lateness):
    for passage in (steady(8.0), steady(24.0)):
        told, way = (
            said(chain_of(lateness=lateness), Fault(delay_s=0.15), passage),
            0.15 * passage.speed_m_s[0],
        )
        assert told.shift_m.mean() == pytest.approx(way, rel=0.04)
        assert told.shift_m.std() < 0.7 * told.shift_m.mean()
        assert (
            lateness != "constant" or np.abs(moved_m(told) - way).max() < passage.speed_m_s[0] / 50.0 * 0.51
        )


@pytest.mark.parametrize("mounting", CAMERA_FORMS["mounting"])
@pytest.mark.parametrize("pitch", [0.04, -0.03])
def test_pitch_is_the_mean_angle_whatever_the_speed(mounting, pitch):
    distance = 0.4 + 5.0 + 0.4
    expected = distance - 1.4 / np.tan(np.arctan(1.4 / distance) + pitch)
    for passage in (steady(8.0), steady(24.0), uneven()):
        shift = said(chain_of(mounting=mounting), Fault(pitch_rad=pitch), passage).shift_m
        assert shift.mean() == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("law", CAMERA_FORMS["blur_law"])
def test_laws_fall_from_all_to_little_with_speed_times_exposure_or_with_the_stops(law):
    kept = CAMERA_FORMS["blur_law"][law](np.linspace(0.0, 6.0, 200))
    assert kept[0] == 1.0
    assert np.all(np.diff(kept) <= 0.0)
    assert 0.0 < kept[-1] < 0.35
    chain = chain_of(blur_law=law, exposure_law=law)

    def left(speed: float, fault: Fault) -> float:
        return float(said(chain, fault, steady(speed, 10.0)).kept.mean())

    assert 1.0 > left(5.0, Fault(exposure_s=0.004)) > left(25.0, Fault(exposure_s=0.004))
    assert left(10.0, Fault(exposure_s=0.004)) == pytest.approx(left(5.0, Fault(exposure_s=0.008)), rel=1e-9)
    assert left(5.0, Fault(stops=1.0)) == pytest.approx(left(25.0, Fault(stops=1.0)), rel=1e-12)


@pytest.mark.parametrize("course", CAMERA_FORMS["exposure_course"])
def test_stops_and_milliseconds_are_means_about_which_a_course_varies(course):
    """With a law that is straight about here, what is lost tells the amount; three classes that last alike."""
    laws = {"exposure_law": "linear", "blur_law": "linear"}
    chain = chain_of(exposure_course=course, **laws)
    for stops in (1.0, -1.0):
        amount = abs(stops) / chain.stops * (chain.over if stops > 0.0 else 1.0)
        lost = 1.0 - said(chain, Fault(stops=stops)).kept
        assert lost.mean() == pytest.approx(0.98 * 0.3 * amount, rel=0.06)
    chain = chain_of(blur_course=course, **laws)
    for speed in (8.0, 16.0):
        lost = 1.0 - said(chain, Fault(exposure_s=0.01), steady(speed, 60.0)).kept
        assert lost.mean() == pytest.approx(0.98 * 0.3 * speed * 0.01 / chain.blur_m, rel=0.07)


@pytest.mark.parametrize("aspect", [a for a in CAMERA_FORMS if a.startswith("reference")] + ["friction_off"])
def test_class_friction_is_what_the_reference_reads(aspect):
    for name in CAMERA_FORMS[aspect]:
        chain = replace(chain_of(**{aspect: name}), reference_noise=0.01)
        under = ROAD.class_at(uneven().at(ROWS))
        for friction in (CLASS_FRICTION, (0.7, 0.6, 0.3)):
            measured = reference(chain, uneven(), ROAD, Fault(friction=friction), ROWS, "fit_1")
            assert np.isfinite(measured).mean() > 0.03
            for surface in range(3):
                atol = 0.02 if name in ("each_stretch", "fiftieths") else 0.01
                there = np.nanmedian(measured[under == surface])
                assert there == pytest.approx(friction[surface], abs=atol), name


def test_stretches_of_their_own_have_the_class_value_in_the_mean():
    chain, fault = chain_of(friction_off="each_stretch"), Fault(friction=(0.7, 0.6, 0.3))
    assert tuple(friction_of(chain, ROAD, Fault())) == ROAD.mu
    own, surface = friction_of(chain, ROAD, fault), np.array(ROAD.surface)
    for s, expected in enumerate(fault.friction):
        assert own[surface == s].mean() == pytest.approx(expected, abs=0.002)
    assert np.unique(own[surface == 0]).size == 2


@pytest.mark.parametrize("kind", ["mean", "middle", "rate_limited"])
def test_a_filtered_reference_follows_and_never_leads(kind):
    chain, passage = replace(chain_of(reference_filter=kind), reference_s=0.1), steady(10.0)
    read = friction_under(chain, passage, ROAD, Fault(), ROWS)
    crossed = np.flatnonzero(np.diff(ROAD.class_at(passage.at(ROWS))))[1]
    assert (read[crossed - 3], read[crossed + 25]) == pytest.approx((0.6, 0.2), abs=1e-6)
    assert 0.02 < np.flatnonzero(read[crossed:] < 0.4)[0] * 0.01 < 0.2


# --- sizes of what varies anyway


@pytest.mark.parametrize("aspect", ["captures", "work"])
def test_pictures_come_at_their_rate(aspect):
    for name, draw in CAMERA_FORMS[aspect].items():
        if draw is not None:
            assert draw(0.04, 100_000, np.random.default_rng(0)).mean() == pytest.approx(0.04, rel=0.03), name
    taken, _ = timing(chain_of(captures="by_way"), uneven(), "x")
    apart = np.diff(uneven().at(taken))[60:]
    assert taken.size / 61.0 == pytest.approx(50.0, rel=0.03)
    assert apart.std() < 0.01 * apart.mean()


@pytest.mark.parametrize("aspect", ["confidence", "reference"])
def test_noise_has_its_size(aspect):
    for name, noise in CAMERA_FORMS[aspect].items():
        if noise is not None:
            values = noise(400_000, 0.02, np.random.default_rng(0))
            assert values.mean() == pytest.approx(0.0, abs=0.03), name
            assert values.std() == pytest.approx(1.0, rel=0.03), name


@pytest.mark.parametrize("kind", CAMERA_FORMS["error_odds"])
def test_errors_have_their_share_in_the_mean(kind):
    shares = []
    for seed in range(12):
        chain = replace(chain_of(seed, error_odds=kind), errors=0.04, more_at_border=1.0)
        shares.append(said(chain, Fault()).odds.mean())
    assert np.mean(shares) == pytest.approx(0.04, rel=0.15)
    for draw in CAMERA_FORMS["errors"].values():
        assert draw(np.full(200_000, 0.08), np.random.default_rng(0)).mean() == pytest.approx(0.08, rel=0.05)
    for taken_for in MISTAKEN.values():
        assert_allclose(taken_for.sum(axis=1), 1.0)
        assert_allclose(np.diag(taken_for), 0.0)


@pytest.mark.parametrize(
    ("kind", "later", "surface", "expected"),
    [
        ("of_three", 1, [0, 0, 1, 0, 0, 2, 2, 2, 1, 2], [0, 0, 0, 0, 0, 2, 2, 2, 2, 2]),
        ("confirmed", 1, [0, 0, 1, 0, 0, 2, 2, 2, 1, 2], [0, 0, 0, 0, 0, 2, 2, 2, 2, 2]),
        ("of_five", 2, [0, 0, 1, 1, 0, 0, 0, 2, 2, 2, 1, 2, 2], [0, 0, 0, 0, 0, 0, 0, 2, 2, 2, 2, 2, 2]),
    ],
)
def test_neighbours_outvote_an_error_and_keep_the_place(kind, later, surface, expected):
    ready = np.arange(float(len(surface)))
    told, when = voted(chain_of(voted=kind), np.array(surface), ready)
    assert told.tolist() == expected
    assert np.all(when[:-later] == ready[later:])


@pytest.mark.parametrize("numbering", CAMERA_FORMS["numbering"])
def test_each_result_has_another_number_than_the_one_before(numbering):
    number = said(chain_of(numbering=numbering), Fault()).number
    assert np.all(np.diff(number) != 0)
    assert np.all(np.diff(number) > 0) or numbering in ("wraps", "four_bits")


def test_rows_on_arrival_have_each_result_once():
    chain = chain_of(rows="on_arrival")
    seen = columns(chain, said(chain, Fault()), np.arange(0.0, 59.0, 0.005)).dropna()
    assert np.all(np.diff(seen["frame_id"]) == 1.0)
    assert len(seen) == pytest.approx(59 * 50, abs=3)


# --- roads


@pytest.mark.parametrize("layout", ["usual", *LAYOUTS])
def test_a_road_is_long_and_changes_at_every_border(layout):
    rng = np.random.default_rng(5)
    road = draw_camera_road(rng, "usual") if layout == "usual" else draw_laid_road(rng, layout)
    assert road.start_m[-1] >= ROAD_M
    assert all(a != b for a, b in zip(road.surface, road.surface[1:], strict=False))
    assert np.diff(road.start_m).min() > 6.5
    assert len(set(road.surface)) == (2 if layout == "two_classes" else 3)


def test_old_labels_leave_the_borders_and_the_friction_that_is_there():
    told = camera_case._told(chain_of(), ROAD, Fault(relabelled=0.3))
    assert (told.start_m, told.mu) == (ROAD.start_m, ROAD.mu)
    assert 8 <= sum(a != b for a, b in zip(told.surface, ROAD.surface, strict=True)) <= 28


# --- cases

NAMES = [
    "rich-camera_latency-0",
    "rich-class_friction_offset-1",
    "no_gap-2-calm",
    "pair-motion_blur-class_friction_offset-0",
    "outside-stamp_extrapolated-0",
    "mild-class_friction_offset-1",
    "rich-camera_pitch-3",
    "rich-exposure_shift-1",
    "rich-motion_blur-3",
    "no_gap-6-rich",
]


@pytest.fixture
def rolling(monkeypatch):
    """Drives without forces, in no time."""
    monkeypatch.setattr(camera_case, "drive", rolled)


@pytest.mark.usefixtures("rolling")
@pytest.mark.parametrize("name", beyond(4, NAMES))
def test_files_keep_the_contract_and_the_secret(name, tmp_path):
    made = make_case(CASES[name], 1)
    made.write(tmp_path)
    seal = json.loads(json.dumps(made.seal()))
    assert set(CAMERA_FORMS) <= set(seal["forms"])
    assert list(seal["effects"]) == list(seal["camera"]["hidden"]) == list(CASES[name].effects)
    if made.spec.group is Group.NO_GAP:
        assert made.truth.gap.total == 1.0
        assert not seal["subsystems"]
    else:
        assert made.truth.gap.total >= SHOWS or made.spec.group is Group.MILD
        assert set(seal["subsystems"]) <= {"camera", "road"}
    for log in ("fit_1", "holdout"):
        check_log(pd.read_csv(tmp_path / f"{log}.csv"))
    check_road(tmp_path, seal)
    for path in tmp_path.iterdir():
        assert not [e for e in ALL_EFFECTS if e in path.read_text(encoding="utf-8")]


def check_road(folder: Path, seal: dict[str, Any]) -> None:
    """With a reference, road.yaml has the friction that is there, in the mean of each class over its stretches."""
    if "mu_reference" not in pd.read_csv(folder / "fit_1.csv", nrows=1):
        return
    segments = yaml.safe_load((folder / "road.yaml").read_text(encoding="utf-8"))["segments"]
    friction = dict(zip(SURFACES, CLASS_FRICTION, strict=True))
    friction |= seal["effects"].get("class_friction_offset", {})
    for surface in {segment["surface"] for segment in segments}:
        values = [s["mu_left"] for s in segments if s["surface"] == surface]
        assert np.mean(values) == pytest.approx(friction[surface], abs=0.02)


@pytest.mark.usefixtures("rolling")
def test_a_case_repeats_and_a_removed_one_has_the_same_logs():
    rich = CASES["rich-camera_latency-1"]
    first, again, other = (make_case(rich, seed) for seed in (1, 1, 2))
    removed = make_case(CASES["removed-camera_latency-1"], 1)
    for name, log in first.logs.items():
        pd.testing.assert_frame_equal(log, again.logs[name])
        pd.testing.assert_frame_equal(log, removed.logs[name])
    assert first.seal() == again.seal() != other.seal()
    assert removed.spec.exclude == ("camera_latency",)


def test_table_has_every_effect_pair_and_deviation():
    groups = [spec.group for spec in table("camera")]
    counts = {group: groups.count(group) for group in set(groups)}
    assert counts == {
        Group.RICH: 6 * len(CAMERA_LIBRARY),
        Group.MILD: 15,
        Group.NO_GAP: 25,
        Group.PAIR: 20,
        Group.OUTSIDE: 2 * len(CAMERA_OUTSIDE),
        Group.REMOVED: 10,
    }
    assert all(spec.camera for spec in table("camera"))


@pytest.mark.usefixtures("rolling")
def test_a_run_is_made_and_scored(tmp_path, monkeypatch):
    blaming(monkeypatch)
    runner.seal_run(tmp_path, "camera", 1)
    for name in ("rich-camera_latency-0", "no_gap-0-rich"):
        runner.run_case(CASES[name], 1, tmp_path, keep=False)
    scores = score_run(tmp_path)
    assert len(scores.pending) == len(table("camera")) - 2
    hits = {line.name: (line.hits, line.n) for line in scores.lines}
    assert hits["right_first"] == hits["false_alarm"] == (1, 1)
