"""A camera's chain in its forms since edition 3: what parameters mean, and deviations that no effect is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_stand_ins import ROAD, steady
from numpy.testing import assert_allclose

from benchmarks.gap.withheld.generator import camera_case
from benchmarks.gap.withheld.generator.camera_chain import results
from benchmarks.gap.withheld.generator.camera_faults import NOD_M
from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS, draw_forms_of
from benchmarks.gap.withheld.generator.camera_gap import Stage, gap_of
from benchmarks.gap.withheld.generator.camera_layouts import draw_laid_road
from benchmarks.gap.withheld.generator.camera_library import CAMERA_LIBRARY, Scene
from benchmarks.gap.withheld.generator.camera_outside import ALL_EFFECTS, CAMERA_OUTSIDE
from benchmarks.gap.withheld.generator.camera_reference import friction_of, friction_under, reference
from benchmarks.gap.withheld.generator.camera_road import CLASS_FRICTION, ROAD_M, Passage
from benchmarks.gap.withheld.generator.camera_system import Chain, Fault, Results, draw_chain
from benchmarks.gap.withheld.generator.camera_telling import columns, voted
from benchmarks.gap.withheld.generator.cases import SHOWS
from benchmarks.gap.withheld.generator.severity import find_severity
from benchmarks.gap.withheld.generator.table import TARGETS

ROWS = np.arange(0.01, 60.0, 0.01)
LATER = {
    aspect: {name: what for name, (since, what) in forms.items() if since == 3}
    for aspect, forms in CAMERA_FORMS.items()
}
LATER_OUTSIDE = {name: effect for name, (since, effect) in CAMERA_OUTSIDE.items() if since == 3}
FORMS = [(aspect, name) for aspect, forms in LATER.items() for name in forms]
OF_CASE = ("layout", "speeds", "position", "friction_off")
OF_CHAIN = [(aspect, name) for aspect, name in FORMS if aspect not in OF_CASE]
USUAL = {aspect: next(iter(forms)) for aspect, forms in CAMERA_FORMS.items()} | {
    "begins": "before",
    "stamp": "window",
}
"""The first of most aspects' forms, with pictures from before the record and one length of what is stamped."""


def chain_of(seed: int = 0, **forms: str) -> Chain:
    """Drawn, with forms of one's own, and neither errors nor noise."""
    chain = draw_chain(np.random.default_rng(seed), {**USUAL, **forms})
    none = {"dropped": 0.0, "errors": 0.0, "none": 0.0, "spread": 0.0, "border_dip": 0.0}
    return replace(chain, rate_hz=50.0, work_s=0.03, preview_m=5.0, window_m=0.8, **none)


def uneven(seconds: float = 60.0) -> Passage:
    clock = np.arange(round(1000 * seconds) + 1) * 1e-3
    speed = 13.0 + 7.0 * np.sin(0.4 * clock)
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
    assert abs(moved_m(plain).mean()) < 0.12


def moved_m(plain: Results) -> np.ndarray:
    """By how much classes change later along the road than the road does, where results come one after the other."""
    middle = 0.5 * (plain.from_m + plain.to_m)
    changes = np.flatnonzero((np.diff(plain.surface) != 0) & (np.diff(middle) < 1.2))
    there = 0.5 * (middle[changes] + middle[changes + 1])
    return there - ROAD.borders[np.argmin(np.abs(ROAD.borders - there[:, None]), axis=1)]


NEUTRAL = {
    "camera_latency": {"delay_s": 0.0},
    "camera_pitch": {"pitch_rad": 0.0},
    "exposure_shift": {"stops": 0.0},
    "motion_blur": {"exposure_s": 0.0},
    "class_friction_offset": dict(zip(("dry", "wet", "snow_ice"), CLASS_FRICTION, strict=True)),
    "stamp_extrapolated": {"age_s": 0.0},
    "rain_told_as_wet": {"share": 0.0},
    "clock_set_anew": {"step_s": 0.0},
    "spray_of_others": {"share": 0.0},
    "stretches_shrunk": {"by_m": 0.0},
    "position_wanders": {"amplitude_m": 0.0},
    "unsure_when_slow": {"share": 0.0},
    "reference_with_push": {"share": 0.0},
}
TINY = {
    "camera_latency": {"delay_s": 1e-9},
    "camera_pitch": {"pitch_rad": 1e-9},
    "exposure_shift": {"stops": 1e-9},
    "motion_blur": {"exposure_s": 1e-12},
    "stamp_extrapolated": {"age_s": 1e-9},
    "rain_told_as_wet": {"share": 1e-12},
    "clock_set_anew": {"step_s": 1e-9},
    "spray_of_others": {"share": 1e-9},
    "position_wanders": {"amplitude_m": 1e-9},
    "unsure_when_slow": {"share": 1e-9},
}


@pytest.mark.parametrize("effect", NEUTRAL)
def test_a_neutral_value_is_the_nominal_chain(effect):
    assert ALL_EFFECTS[effect].apply(Fault(), NEUTRAL[effect]) == Fault()
    assert set(NEUTRAL) == {*CAMERA_LIBRARY, *LATER_OUTSIDE}


@pytest.mark.parametrize(("aspect", "name"), OF_CHAIN)
def test_no_deviation_draws_anew_what_is_not_its_own(aspect, name):
    """A vanishing deviation takes the way of a real one, and all that is random stays."""
    rng = np.random.default_rng(4)
    forms = {**draw_forms_of(3, rng), "lateness": "constant", "told_confidence": "as_is"}
    chain = draw_chain(rng, {**forms, aspect: name})
    nominal = said(chain, Fault(), uneven(30.0))
    for effect, given in TINY.items():
        tiny = said(chain, ALL_EFFECTS[effect].apply(Fault(), given), uneven(30.0))
        for column in ("ready_s", "number", "surface"):
            assert np.array_equal(getattr(nominal, column), getattr(tiny, column)), (effect, column)
        for column in ("from_m", "to_m", "confidence"):
            assert_allclose(getattr(tiny, column), getattr(nominal, column), atol=1e-6)


# --- what the parameters mean


@pytest.mark.parametrize("lateness", LATER["lateness"])
def test_latency_is_the_mean_delay(lateness):
    for passage in (steady(8.0), steady(24.0)):
        shift = said(chain_of(lateness=lateness), Fault(delay_s=0.15), passage).shift_m
        assert shift.mean() == pytest.approx(0.15 * passage.speed_m_s[0], rel=0.04)
        assert shift.std() < 0.7 * shift.mean()


@pytest.mark.parametrize("mounting", LATER["mounting"])
def test_pitch_is_the_mean_angle_whatever_the_speed(mounting):
    distance = 0.4 + 5.0 + 0.4
    for pitch in (0.04, -0.03):
        expected = distance - 1.4 / np.tan(np.arctan(1.4 / distance) + pitch)
        for passage in (steady(8.0), steady(24.0), uneven()):
            shift = said(chain_of(mounting=mounting), Fault(pitch_rad=pitch), passage).shift_m
            assert shift.mean() == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("law", LATER["blur_law"])
def test_laws_fall_from_all_to_little(law):
    amount = np.linspace(0.0, 6.0, 200)
    kept = LATER["blur_law"][law](amount)
    assert kept[0] == 1.0
    assert np.all(np.diff(kept) <= 0.0)
    assert np.all(kept > 0.0)
    assert kept[-1] < 0.35
    assert 0.25 < LATER["exposure_law"][law](np.array([1.0]))[0] < 0.8


def test_stops_and_milliseconds_are_means_about_which_a_course_varies():
    """With a law that is straight about here, what is lost tells the amount."""
    laws = {"exposure_law": "linear", "blur_law": "linear"}
    for course in LATER["exposure_course"]:
        chain = chain_of(exposure_course=course, **laws)
        for stops in (1.0, -1.0):
            amount = abs(stops) / chain.stops * (chain.over if stops > 0.0 else 1.0)
            lost = 1.0 - said(chain, Fault(stops=stops)).kept
            assert lost.mean() == pytest.approx(0.98 * 0.3 * amount, rel=0.06)
    for course in LATER["blur_course"]:
        chain = chain_of(blur_course=course, **laws)
        for speed in (8.0, 16.0):
            lost = 1.0 - said(chain, Fault(exposure_s=0.01), steady(speed, 60.0)).kept
            assert lost.mean() == pytest.approx(0.98 * 0.3 * speed * 0.01 / chain.blur_m, rel=0.06)


REFERENCE = ("reference", "reference_filter", "reference_lost", "reference_when", "friction_off")


@pytest.mark.parametrize(("aspect", "name"), [form for form in FORMS if form[0] in REFERENCE])
def test_class_friction_is_what_the_reference_reads(aspect, name):
    chain = replace(chain_of(**{"reference": "white", aspect: name}), reference_noise=0.01)
    under = ROAD.class_at(uneven().at(ROWS))
    for friction in (CLASS_FRICTION, (0.7, 0.6, 0.3)):
        measured = reference(chain, uneven(), ROAD, Fault(friction=friction), ROWS, "fit_1")
        assert np.isfinite(measured).mean() > 0.6
        for surface in range(3):
            there = np.nanmedian(measured[under == surface])
            assert there == pytest.approx(friction[surface], abs=0.01), name


def test_uneven_stretches_have_the_class_value_in_the_mean():
    chain, fault = chain_of(friction_off="uneven_stretches"), Fault(friction=(0.7, 0.6, 0.3))
    assert tuple(friction_of(chain, ROAD, Fault())) == ROAD.mu
    own, surface = friction_of(chain, ROAD, fault), np.array(ROAD.surface)
    for s, expected in enumerate(fault.friction):
        assert own[surface == s].mean() == pytest.approx(expected, abs=0.002)
    assert np.unique(own[surface == 2]).size == 3
    assert np.all(own[surface == 1] == 0.6)


def test_where_only_slippery_classes_are_off_the_dry_one_is_as_told():
    entry, chain = CAMERA_LIBRARY["class_friction_offset"], chain_of(friction_off="slippery_only")
    for seed in range(5):
        given = entry.at(Scene(chain, (0, 1, 2)), np.random.default_rng(seed))(0.8)
        assert given["dry"] == CLASS_FRICTION[0]
        assert given["wet"] != CLASS_FRICTION[1]
        assert given["snow_ice"] != CLASS_FRICTION[2]


def test_a_rate_limited_reference_follows_and_never_leads():
    chain, passage = replace(chain_of(reference_filter="rate_limited"), reference_s=0.1), steady(10.0)
    read = friction_under(chain, passage, ROAD, Fault(), ROWS)
    crossed = np.flatnonzero(np.diff(ROAD.class_at(passage.at(ROWS))))[1]
    assert (read[crossed - 3], read[crossed + 25]) == pytest.approx((0.6, 0.2), abs=1e-6)
    reached = np.flatnonzero(read[crossed:] < 0.4)[0] * 0.01
    assert 0.03 < reached < 0.2


def test_a_surveyed_stretch_has_its_error_in_every_drive():
    chain = replace(chain_of(reference="by_stretch"), reference_noise=0.04)
    under = np.searchsorted(ROAD.borders, uneven().at(ROWS))
    errors = []
    for log in ("fit_1", "holdout"):
        off = reference(chain, uneven(), ROAD, Fault(), ROWS, log) - np.array(ROAD.mu)[under]
        errors.append([off[under == stretch].mean() for stretch in range(2, 20)])
    assert np.corrcoef(errors)[0, 1] > 0.9
    assert np.std(errors) == pytest.approx(0.3 * 0.04, rel=0.5)


# --- sizes of what varies anyway


@pytest.mark.parametrize("aspect", ["captures", "work"])
def test_pictures_come_at_their_rate(aspect):
    for name, draw in LATER[aspect].items():
        mean = draw(0.04, 100_000, np.random.default_rng(0)).mean()
        assert mean == pytest.approx(0.04, rel=0.01), name


def test_noise_has_its_size():
    for aspect in ("confidence", "reference"):
        for noise in filter(None, LATER[aspect].values()):
            values = noise(400_000, 0.02, np.random.default_rng(0))
            assert values.mean() == pytest.approx(0.0, abs=0.03)
            assert values.std() == pytest.approx(1.0, rel=0.03)


def test_errors_have_their_share_in_the_mean():
    shares = []
    for seed in range(12):
        chain = replace(chain_of(seed, error_odds="in_shadows"), errors=0.04, more_at_border=1.0)
        shares.append(said(chain, Fault()).odds.mean())
    assert np.mean(shares) == pytest.approx(0.04, rel=0.15)


def test_most_of_five_outvote_two_errors_and_keep_the_place():
    surface = np.array([0, 0, 1, 1, 0, 0, 0, 2, 2, 2, 1, 2, 2])
    told, later = voted(chain_of(voted="of_five"), surface, np.arange(13.0))
    assert told.tolist() == [0, 0, 0, 0, 0, 0, 0, 2, 2, 2, 2, 2, 2]
    assert np.all(later[:-2] == np.arange(2.0, 13.0))


def test_a_count_of_four_bits_tells_each_result_from_the_one_before():
    chain = replace(chain_of(numbering="four_bits", lost="in_runs", pauses="some"), dropped=0.2)
    number = said(chain, Fault()).number
    assert set(number) == set(range(16))
    assert np.all(np.diff(number) % 16 == 1)


def test_rows_on_arrival_have_each_result_once():
    chain = chain_of(rows="on_arrival")
    seen = columns(chain, said(chain, Fault()), np.arange(0.0, 59.0, 0.005)).dropna()
    assert np.all(np.diff(seen["frame_id"]) == 1.0)
    assert len(seen) == pytest.approx(59 * 50, abs=3)


def test_a_system_that_waits_for_speed_says_nothing_below_it():
    clock = np.arange(30_001) * 1e-3
    speed = 10.0 + 10.0 * np.sin(0.4 * clock)
    passage = Passage(2.0 + np.cumsum(speed) * 1e-3, speed)
    chain = chain_of(pauses="when_slow")
    slowest = passage.speed(said(chain, Fault(), passage).ready_s - chain.work_s).min()
    assert 1.5 < slowest < 4.1
    assert said(chain, Fault(), steady(0.5)).number.size > 1900


# --- roads


@pytest.mark.parametrize("layout", LATER["layout"])
def test_a_laid_road_is_long_and_changes_at_every_border(layout):
    road = draw_laid_road(np.random.default_rng(5), layout)
    assert road.start_m[-1] >= ROAD_M
    pairs = list(zip(road.surface, road.surface[1:], strict=False))
    assert all(a != b for a, b in pairs)
    assert np.diff(road.start_m).min() > 7.5
    assert set(road.surface) == {0, 1, 2}
    assert layout != "through_wet" or all(abs(a - b) == 1 for a, b in pairs)


# --- deviations outside the library


STAGE = Stage(replace(chain_of(), reference_noise=0.01), uneven(), ROAD, "holdout")


def fault_at(name: str, severity: float) -> Fault:
    entry = LATER_OUTSIDE[name]
    parameters = entry.at(Scene(STAGE.chain, (0, 1, 2)), np.random.default_rng(1))
    return entry.apply(Fault(), parameters(severity))


def gap_at(name: str, severity: float) -> float:
    fault = fault_at(name, severity)
    return gap_of(STAGE, fault, camera_case._told(STAGE.chain, ROAD, fault)).total


@pytest.mark.parametrize("name", LATER_OUTSIDE)
def test_a_further_deviation_grows_and_shows(name):
    assert 1.0 <= gap_at(name, 0.1) < gap_at(name, 1.0)
    assert gap_at(name, 1.0) > SHOWS


def left_over(shown: np.ndarray, *known: np.ndarray) -> float:
    """Share of what is shown that no sum of the known ones explains [-]."""
    base = np.stack(known, axis=1)
    rest = shown - base @ np.linalg.lstsq(base, shown, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2) / np.mean(shown**2)))


@pytest.mark.parametrize("name", LATER_OUTSIDE)
def test_a_further_deviation_is_no_effect_with_another_name(name):
    """Most of it is left where a delay and an angle, an exposure and a blur, and other class values take their best."""
    fault = fault_at(name, find_severity(lambda severity: gap_at(name, severity), TARGETS[1]))
    chain, passage = STAGE.chain, STAGE.passage
    plain, seen = (results(chain, passage, ROAD, f, "holdout") for f in (Fault(), fault))
    speed, one = passage.speed(plain.ready_s - chain.work_s), np.ones(plain.ready_s.size)
    shift, lost = seen.shift_m - plain.shift_m, -np.log(seen.kept)
    told = camera_case._told(chain, ROAD, fault)
    if told != ROAD:
        off = told.borders - ROAD.borders
        assert left_over(off, np.ones(off.size)) > 0.7
    if np.ptp(shift) > 0.0:
        assert left_over(shift, one, speed) > 0.7
    if np.ptp(lost) > 0.0:
        slope = np.polyfit(speed, lost, 1)[0]
        assert left_over(lost, one, *([speed] if slope > 0.0 else [])) > 0.5
    if fault.measured_push > 0.0:
        under = ROAD.class_at(passage.at(ROWS))
        read, usual = (friction_under(chain, passage, ROAD, f, ROWS) for f in (fault, Fault()))
        assert left_over(read - usual, *(1.0 * (under == surface) for surface in range(3))) > 0.7
    if seen.mistaken.any():
        assert 0.1 < seen.mistaken.mean() < 0.6
        assert np.array_equal(seen.shift_m, plain.shift_m)
