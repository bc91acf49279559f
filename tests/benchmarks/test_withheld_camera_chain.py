"""A camera's chain in its forms up to edition 2: it tells the road, and parameters mean what they should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_stand_ins import PLAIN, ROAD, steady
from numpy.testing import assert_allclose

from benchmarks.gap.withheld.generator import camera_case
from benchmarks.gap.withheld.generator.camera_chain import results
from benchmarks.gap.withheld.generator.camera_faults import NOD_M
from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS, draw_forms_of
from benchmarks.gap.withheld.generator.camera_gap import Stage, gap_of
from benchmarks.gap.withheld.generator.camera_layouts import LAYOUTS, draw_laid_road
from benchmarks.gap.withheld.generator.camera_library import Scene
from benchmarks.gap.withheld.generator.camera_outside import ALL_EFFECTS, CAMERA_OUTSIDE
from benchmarks.gap.withheld.generator.camera_reference import friction_of, friction_under, reference
from benchmarks.gap.withheld.generator.camera_road import CLASS_FRICTION, ROAD_M, Passage
from benchmarks.gap.withheld.generator.camera_system import Chain, Fault, Results, draw_chain
from benchmarks.gap.withheld.generator.camera_telling import MISTAKEN, voted
from benchmarks.gap.withheld.generator.camera_timing import timing
from benchmarks.gap.withheld.generator.cases import SHOWS

pytestmark = pytest.mark.long


ROWS = np.arange(0.01, 60.0, 0.01)
KNOWN = {
    aspect: {name: what for name, (since, what) in forms.items() if since <= 2}
    for aspect, forms in CAMERA_FORMS.items()
}
ONLY = {
    aspect: next(iter(forms)) for aspect, forms in CAMERA_FORMS.items() if next(iter(forms.values()))[0] == 2
}
FURTHER_OUTSIDE = {name: effect for name, (since, effect) in CAMERA_OUTSIDE.items() if since == 2}
FORMS = [(aspect, name) for aspect, forms in KNOWN.items() for name in forms]
OF_CHAIN = [
    (aspect, name) for aspect, name in FORMS if aspect not in ("layout", "speeds", "position", "friction_off")
]
QUIET = {"none_says": "zero", "begins": "before", **PLAIN, **ONLY}


def chain_of(seed: int = 0, **forms: str) -> Chain:
    """Drawn, with forms of one's own, and neither errors nor noise."""
    rng = np.random.default_rng(seed)
    chain = draw_chain(rng, {**draw_forms_of(1, rng), **QUIET, **forms})
    none = {"dropped": 0.0, "errors": 0.0, "none": 0.0, "spread": 0.0, "border_dip": 0.0}
    return replace(chain, rate_hz=50.0, work_s=0.03, preview_m=5.0, window_m=0.8, **none)


def uneven(seconds: float = 60.0) -> Passage:
    clock = np.arange(round(1000 * seconds) + 1) * 1e-3
    speed = 14.0 + 5.0 * np.sin(0.4 * clock)
    return Passage(2.0 + np.cumsum(speed) * 1e-3, speed)


def said(chain: Chain, fault: Fault, passage: Passage | None = None) -> Results:
    return results(chain, passage or uneven(), ROAD, fault, "fit_1")


# --- which forms there are


# --- the nominal chain


@pytest.mark.parametrize(("aspect", "name"), OF_CHAIN)
def test_the_nominal_chain_tells_the_road_in_every_form(aspect, name):
    """Classes change where the road's do, in the mean to less than the way of a cycle; nothing is lost or wrong."""
    chain = chain_of(**{aspect: name})
    plain = said(chain, Fault())
    assert_allclose(plain.shift_m, 0.0, atol=NOD_M + 0.02)
    assert abs(plain.shift_m.mean()) < 0.02
    assert np.all(plain.kept == 1.0)
    assert not plain.mistaken.any()
    assert plain.confidence.min() > 0.7
    assert np.all(np.diff(plain.ready_s) >= 0.0)
    sided = {"near": 0.14, "far": 0.14, "most_slippery": 0.12}.get(
        name, 0.0
    )  # by what is stamped of a stretch
    assert abs(moved_m(plain).mean()) < 0.12 + sided


def moved_m(plain: Results) -> np.ndarray:
    """By how much classes change later along the road than the road does, where results come one after the other."""
    middle = 0.5 * (plain.from_m + plain.to_m)
    changes = np.flatnonzero((np.diff(plain.surface) != 0) & (np.diff(middle) < 1.2))
    there = 0.5 * (middle[changes] + middle[changes + 1])
    return there - ROAD.borders[np.argmin(np.abs(ROAD.borders - there[:, None]), axis=1)]


TINY = {
    "camera_latency": {"delay_s": 1e-9},
    "camera_pitch": {"pitch_rad": 1e-9},
    "exposure_shift": {"stops": 1e-9},
    "motion_blur": {"exposure_s": 1e-12},
}


@pytest.mark.parametrize(("aspect", "name"), OF_CHAIN)
def test_no_effect_draws_anew_what_is_not_its_own(aspect, name):
    """A vanishing deviation takes the way of a real one, and all that is random stays."""
    lateness = {} if aspect == "lateness" else {"lateness": "constant"}
    rng = np.random.default_rng(4)
    forms = {**draw_forms_of(2, rng), **lateness, "told_confidence": "as_is", aspect: name}
    chain = draw_chain(rng, forms)
    nominal = said(chain, Fault(), uneven(30.0))
    for effect, given in TINY.items():
        if aspect == "lateness" and name == "in_frames":
            continue  # whole frames, or none
        tiny = said(chain, ALL_EFFECTS[effect].apply(Fault(), given), uneven(30.0))
        for column in ("ready_s", "number", "surface", "from_m", "to_m"):
            assert np.array_equal(getattr(nominal, column), getattr(tiny, column)), (effect, column)
        assert_allclose(tiny.confidence, nominal.confidence, atol=1e-6)


NEUTRAL = {
    "wet_told_as_snow": {"share": 0.0},
    "lens_fogs": {"share": 0.0},
    "position_jumps": {"jump_m": 0.0},
    "map_labels_old": {"share": 0.0},
    "slippery_told_on": {"hold_s": 0.0},
    "bracket_loose": {"share": 0.0},
    "wet_dazzles": {"share": 0.0},
    "reference_late": {"delay_s": 0.0},
    "reference_with_speed": {"share": 0.0},
}


@pytest.mark.parametrize("name", FURTHER_OUTSIDE)
def test_a_further_deviation_is_none_at_its_neutral_value_and_grows(name):
    entry = FURTHER_OUTSIDE[name]
    assert entry.apply(Fault(), NEUTRAL[name]) == Fault()
    stage = Stage(replace(chain_of(), reference_noise=0.01), uneven(), ROAD, "holdout")
    parameters = entry.at(Scene(stage.chain, (0, 1, 2)), np.random.default_rng(1))
    small, large = (
        gap_of(stage, fault, camera_case._told(stage.chain, ROAD, fault)).total
        for fault in (entry.apply(Fault(), parameters(severity)) for severity in (0.1, 1.0))
    )
    assert 1.0 <= small < large
    assert large > SHOWS


# --- what the parameters mean


@pytest.mark.parametrize("lateness", KNOWN["lateness"])
def test_latency_is_the_mean_delay(lateness):
    for passage in (steady(8.0), steady(24.0)):
        shift = said(chain_of(lateness=lateness), Fault(delay_s=0.15), passage).shift_m
        assert shift.mean() == pytest.approx(0.15 * passage.speed_m_s[0], rel=0.04)
        assert shift.std() < 0.7 * shift.mean()


@pytest.mark.parametrize("mounting", KNOWN["mounting"])
def test_pitch_is_the_mean_angle_whatever_the_speed(mounting):
    distance = 0.4 + 5.0 + 0.4
    for pitch in (0.04, -0.03):
        expected = distance - 1.4 / np.tan(np.arctan(1.4 / distance) + pitch)
        for passage in (steady(8.0), steady(24.0), uneven()):
            shift = said(chain_of(mounting=mounting), Fault(pitch_rad=pitch), passage).shift_m
            assert shift.mean() == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("law", KNOWN["blur_law"])
def test_laws_fall_from_all_to_little(law):
    amount = np.linspace(0.0, 6.0, 200)
    kept = KNOWN["blur_law"][law](amount)
    assert kept[0] == 1.0
    assert np.all(np.diff(kept) <= 0.0)
    assert np.all(kept > 0.0)
    assert kept[-1] < 0.35


@pytest.mark.parametrize("course", KNOWN["exposure_course"])
def test_stops_and_milliseconds_are_means_about_which_a_course_varies(course):
    """With a law that is straight about here, what is lost tells the amount; three classes that last alike."""
    chain = chain_of(exposure_course=course, exposure_law="linear", blur_law="linear")
    for stops in (1.0, -1.0):
        amount = abs(stops) / chain.stops * (chain.over if stops > 0.0 else 1.0)
        lost = 1.0 - said(chain, Fault(stops=stops)).kept
        assert lost.mean() == pytest.approx(0.98 * 0.3 * amount, rel=0.05)
    if course in KNOWN["blur_course"]:
        chain = chain_of(blur_course=course, exposure_law="linear", blur_law="linear")
        for speed in (8.0, 16.0):
            lost = 1.0 - said(chain, Fault(exposure_s=0.01), steady(speed)).kept
            expected = 0.98 * 0.3 * speed * 0.01 / chain.blur_m
            assert lost.mean() == pytest.approx(expected, rel=0.07)


REFERENCE = ("reference", "reference_filter", "reference_rate", "reference_when", "reference_steps")


@pytest.mark.parametrize("aspect", [*REFERENCE, "friction_off"])
def test_class_friction_is_what_the_reference_reads(aspect):
    fault = Fault(friction=(0.7, 0.6, 0.3))
    for name in KNOWN[aspect]:
        chain = replace(chain_of(**{"reference": "white", aspect: name}), reference_noise=0.01)
        under = ROAD.class_at(uneven().at(ROWS))
        for of, expected in ((Fault(), CLASS_FRICTION), (fault, fault.friction)):
            measured = reference(chain, uneven(), ROAD, of, ROWS, "fit_1")
            assert np.isfinite(measured).mean() > 0.03
            for surface in range(3):
                there = np.nanmedian(measured[under == surface])
                atol = 0.02 if name in ("each_stretch", "fiftieths") else 0.01
                assert there == pytest.approx(expected[surface], abs=atol), name


def test_stretches_of_their_own_have_the_class_value_in_the_mean():
    chain, fault = chain_of(friction_off="each_stretch"), Fault(friction=(0.7, 0.6, 0.3))
    assert tuple(friction_of(chain, ROAD, Fault())) == ROAD.mu
    own, surface = friction_of(chain, ROAD, fault), np.array(ROAD.surface)
    for s, expected in enumerate(fault.friction):
        assert own[surface == s].mean() == pytest.approx(expected, abs=0.002)
    assert np.unique(own[surface == 0]).size == 2
    assert np.all(own[surface == 1] == 0.6)


@pytest.mark.parametrize("kind", ["mean", "middle"])
def test_a_filtered_reference_follows_and_never_leads(kind):
    chain, passage = replace(chain_of(reference_filter=kind), reference_s=0.1), steady(10.0)
    read = friction_under(chain, passage, ROAD, Fault(), ROWS)
    crossed = np.flatnonzero(np.diff(ROAD.class_at(passage.at(ROWS))))[0]
    before, after = read[crossed - 3], read[crossed + 25]
    assert (before, after) == pytest.approx((0.8, 0.6), abs=1e-6)
    reached = np.flatnonzero(read[crossed:] < 0.7)[0] * 0.01
    assert 0.02 < reached < 0.2


# --- sizes of what varies anyway


@pytest.mark.parametrize("aspect", ["captures", "work"])
def test_pictures_come_at_their_rate(aspect):
    for name, draw in KNOWN[aspect].items():
        if draw is not None:
            mean = draw(0.04, 100_000, np.random.default_rng(0)).mean()
            assert mean == pytest.approx(0.04, rel=0.03), name


def test_pictures_by_way_come_with_the_way_and_at_the_rate_in_the_mean():
    chain = chain_of(captures="by_way")
    taken, _ = timing(chain, uneven(), "x")
    apart = np.diff(uneven().at(taken))[60:]
    assert taken.size / 61.0 == pytest.approx(50.0, rel=0.03)
    assert apart.std() < 0.01 * apart.mean()


@pytest.mark.parametrize("aspect", ["confidence", "reference"])
def test_noise_has_its_size(aspect):
    for name, noise in KNOWN[aspect].items():
        values = noise(400_000, 0.02, np.random.default_rng(0))
        assert values.mean() == pytest.approx(0.0, abs=0.03), name
        assert values.std() == pytest.approx(1.0, rel=0.03), name


@pytest.mark.parametrize("kind", KNOWN["error_odds"])
def test_errors_have_their_share_in_the_mean(kind):
    shares = []
    for seed in range(12):
        chain = replace(chain_of(seed, error_odds=kind), errors=0.04, more_at_border=1.0)
        shares.append(said(chain, Fault()).odds.mean())
    assert np.mean(shares) == pytest.approx(0.04, rel=0.15)


@pytest.mark.parametrize("kind", KNOWN["mistaken_for"])
def test_a_wrong_class_is_another_one(kind):
    assert_allclose(MISTAKEN[kind].sum(axis=1), 1.0)
    assert_allclose(np.diag(MISTAKEN[kind]), 0.0)


def test_neighbours_outvote_an_error_and_keep_the_place():
    surface = np.array([0, 0, 1, 0, 0, 2, 2, 2, 1, 2])
    ready = np.arange(10.0)
    for kind, expected in (
        ("of_three", [0, 0, 0, 0, 0, 2, 2, 2, 2, 2]),
        ("confirmed", [0, 0, 0, 0, 0, 2, 2, 2, 2, 2]),
    ):
        told, later = voted(chain_of(voted=kind), surface, ready)
        assert told.tolist() == expected
        assert np.all(later[:-1] == ready[1:])


@pytest.mark.parametrize("numbering", KNOWN["numbering"])
def test_each_result_has_a_number_of_its_own(numbering):
    number = said(chain_of(numbering=numbering), Fault()).number
    assert np.all(np.diff(number) != 0)
    assert np.all(np.diff(number) > 0) or numbering == "wraps"


# --- roads and drivers


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_laid_road_is_long_and_changes_at_every_border(layout):
    road = draw_laid_road(np.random.default_rng(5), layout)
    assert road.start_m[-1] >= ROAD_M
    assert len(road.start_m) == len(road.surface) == len(road.mu)
    assert all(a != b for a, b in zip(road.surface, road.surface[1:], strict=False))
    assert np.diff(road.start_m).min() > 6.5
    assert len(set(road.surface)) == (2 if layout == "two_classes" else 3)


def test_old_labels_leave_the_borders_and_the_friction_that_is_there():
    told = camera_case._told(chain_of(), ROAD, Fault(relabelled=0.3))
    assert told.start_m == ROAD.start_m
    assert told.mu == ROAD.mu
    assert 8 <= sum(a != b for a, b in zip(told.surface, ROAD.surface, strict=True)) <= 28
