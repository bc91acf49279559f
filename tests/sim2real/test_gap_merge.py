"""Verdicts on data of their own, the camera's and the pulse counter's, become one with that on the car's motion."""

import json
from dataclasses import replace
from itertools import product

import made_up_diagnosis as made_up
import numpy as np
import pytest
from report_page import require_report

from scenarios.files import RoadFile, load_vehicle
from sim2real.auxiliary import AuxiliaryVerdict, camera_verdict, counter_verdict
from sim2real.demo import VEHICLE
from sim2real.merge import merge
from sim2real.observing.lattice import Lattice, Reading
from sim2real.perception.chain import DECISIVE, Oddity
from sim2real.perception.finding import CameraCandidate, PerceptionFinding
from sim2real.reporting.report import jsonable, render
from sim2real.result import Cause, Interval, Measure, Place, Unexplained, Verdict, needed

TURN = 2.0 * np.pi
MADE_ROAD = RoadFile.model_validate(
    {"schema": 1, "segments": [{"start_m": 0.0, "mu_left": 0.9, "mu_right": 0.9, "surface": "dry"}]}
)
QUIET = {"image_class": 1.0}
LOUD = {"image_class": 5.0}
CAUSE = Cause("camera_latency", 0.95, {}, 1.1, Interval(80.0, 70.0, 85.0, "%"), 10.0)
WEAK = Cause("camera_pitch", 0.02, {}, 3.0, Interval(10.0, 0.0, 20.0, "%"), 50.0)
TERM = Unexplained(
    "camera", "image_class", "place", "-", "", "", 0.3, np.array([]), np.array([]), "Classes come and go."
)
PLACE = Place("image_class", "camera", "drive, low speed", 1.0, 2.0, 0.5)


def side_of(verdict, **more):
    """A camera's verdict."""
    named = () if verdict in (Verdict.NO_GAP, Verdict.UNKNOWN) else ("camera_latency",)
    shares = (0.95, 0.02) if named else (0.02, 0.01)
    causes = tuple(replace(c, probability=p) for c, p in zip((CAUSE, WEAK), shares, strict=True))
    before = QUIET if verdict is Verdict.NO_GAP else LOUD
    after = QUIET if named else before
    term = TERM if verdict is Verdict.UNKNOWN else None
    return AuxiliaryVerdict(
        verdict,
        named,
        causes,
        before,
        after,
        places=(PLACE,),
        unexplained=term,
        sentence="It is late.",
        **more,
    )


def main_of(verdict):
    """A verdict on the car's motion."""
    found = getattr(made_up, str(verdict))()
    # the made-up causes have a camera's effect among them; the contest has none
    return replace(found, causes=tuple(c for c in found.causes if not c.effect.startswith("camera")))


# --- verdicts

EXPECTED = {
    (Verdict.NO_GAP, Verdict.NO_GAP): Verdict.NO_GAP,
    (Verdict.IDENTIFIED, Verdict.IDENTIFIED): Verdict.COMPOUND,
    (Verdict.COMPOUND, Verdict.IDENTIFIED): Verdict.COMPOUND,
    (Verdict.AMBIGUOUS, Verdict.IDENTIFIED): Verdict.COMPOUND,
    (Verdict.IDENTIFIED, Verdict.AMBIGUOUS): Verdict.COMPOUND,
    (Verdict.IDENTIFIED, Verdict.COMPOUND): Verdict.COMPOUND,
    (Verdict.PARTIAL, Verdict.IDENTIFIED): Verdict.COMPOUND,
    (Verdict.UNKNOWN, Verdict.IDENTIFIED): Verdict.PARTIAL,
    (Verdict.IDENTIFIED, Verdict.UNKNOWN): Verdict.PARTIAL,
    (Verdict.PARTIAL, Verdict.UNKNOWN): Verdict.PARTIAL,
    (Verdict.UNKNOWN, Verdict.AMBIGUOUS): Verdict.AMBIGUOUS,
    (Verdict.AMBIGUOUS, Verdict.UNKNOWN): Verdict.AMBIGUOUS,
    (Verdict.UNKNOWN, Verdict.COMPOUND): Verdict.COMPOUND,
    (Verdict.COMPOUND, Verdict.UNKNOWN): Verdict.COMPOUND,
    (Verdict.UNKNOWN, Verdict.UNKNOWN): Verdict.UNKNOWN,
}


@pytest.mark.parametrize(("main", "side"), EXPECTED)
def test_two_verdicts_make_one(main, side):
    assert merge(main_of(main), side_of(side)).verdict is EXPECTED[main, side]


@pytest.mark.parametrize("verdict", Verdict)
def test_no_gap_leaves_the_other_verdict_alone(verdict):
    assert merge(main_of(verdict), side_of(Verdict.NO_GAP)).verdict is verdict
    assert merge(main_of(Verdict.NO_GAP), side_of(verdict)).verdict is verdict


@pytest.mark.parametrize(("main", "side"), list(product(Verdict, Verdict)))
def test_whatever_is_merged_is_a_diagnosis_by_the_contract(main, side):
    found = merge(main_of(main), side_of(side))
    probabilities = [c.probability for c in found.causes]
    assert sum(probabilities) <= 1.0 + 1e-9
    assert all(p >= 0.0 for p in probabilities)
    effects = [c.effect for c in found.causes]
    assert len(effects) == len(set(effects))
    assert {c.effect for c in main_of(main).causes} | {"camera_latency", "camera_pitch"} == set(effects)
    told = main in (Verdict.UNKNOWN, Verdict.PARTIAL) or side is Verdict.UNKNOWN
    assert (found.unexplained is not None) == told
    assert (found.budget is None) == (main is side is Verdict.NO_GAP)
    if found.budget:
        assert sum(found.budget.to_json().values()) == pytest.approx(1.0)
    assert found.to_json()["verdict"] == str(found.verdict)
    if found.verdict is not Verdict.COMPOUND:
        assert probabilities == sorted(probabilities, reverse=True)


def test_a_compounds_members_come_first():
    found = merge(main_of(Verdict.IDENTIFIED), side_of(Verdict.IDENTIFIED))
    assert {c.effect for c in found.causes[:2]} == {"tyre_relaxation", "camera_latency"}
    assert all(c.probability > 0.4 for c in found.causes[:2])
    three = merge(main_of(Verdict.COMPOUND), side_of(Verdict.IDENTIFIED))
    assert {c.effect for c in three.causes[:3]} == {"tyre_relaxation", "aero_drag", "camera_latency"}


def test_a_side_without_a_gap_gets_only_what_probability_is_left():
    main = main_of(Verdict.IDENTIFIED)
    eager = side_of(Verdict.NO_GAP)
    eager = replace(eager, causes=tuple(replace(c, probability=0.5) for c in eager.causes))
    found = merge(main, eager)
    top = {c.effect: c.probability for c in found.causes}
    assert top["tyre_relaxation"] == main.causes[0].probability
    assert sum(top.values()) <= 1.0 + 1e-9


@pytest.mark.parametrize("main", [Verdict.IDENTIFIED, Verdict.PARTIAL])
def test_what_one_half_names_stands_where_the_other_is_unknown(main):
    camera = merge(main_of(Verdict.UNKNOWN), side_of(Verdict.IDENTIFIED))
    assert [c.effect for c in needed(camera)] == ["camera_latency"]
    assert "Something" not in camera.sentence
    car = merge(main_of(main), side_of(Verdict.UNKNOWN))
    assert [c.effect for c in needed(car)] == [c.effect for c in needed(main_of(main))]
    assert "In addition: Unknown cause" in car.sentence
    two = merge(main_of(Verdict.COMPOUND), side_of(Verdict.UNKNOWN))
    assert {c.effect for c in needed(two)} == set(two.together) == {"tyre_relaxation", "aero_drag"}


# --- budget


def test_each_half_has_as_much_of_the_budget_as_its_signals_make_of_the_gap():
    main = main_of(Verdict.IDENTIFIED)
    shares = merge(main, side_of(Verdict.IDENTIFIED)).budget.shares
    of_car, of_camera = (sum(g * g for g in gaps.values()) for gaps in (main.gap.before.signals, LOUD))
    whole = of_car + of_camera
    relaxed = main.budget.shares["effect:tyre_relaxation"]
    assert shares["effect:tyre_relaxation"].value == pytest.approx(relaxed.value * of_car / whole)
    assert shares["effect:camera_latency"].value == pytest.approx((of_camera - 1.0) / whole)
    assert shares["noise"].value == pytest.approx((main.budget.shares["noise"].value * of_car + 1.0) / whole)
    assert all(s.low <= s.value <= s.high for s in shares.values())
    assert [name.startswith("effect:") for name in shares] == [True, True, False, False]


def test_what_an_unknown_camera_leaves_is_structure_beyond_its_noise():
    main = main_of(Verdict.NO_GAP)
    shares = merge(main, side_of(Verdict.UNKNOWN)).budget.to_json()
    whole = sum(g * g for g in main.gap.before.signals.values()) + LOUD["image_class"] ** 2
    assert shares == pytest.approx({"noise": 1.0 - 24.0 / whole, "structure": 24.0 / whole})
    assert merge(main_of(Verdict.PARTIAL), side_of(Verdict.NO_GAP)).budget == made_up.partial().budget


# --- gap, sentence, places


def test_the_gap_is_over_the_signals_of_both():
    main = main_of(Verdict.IDENTIFIED)
    found = merge(main, side_of(Verdict.IDENTIFIED))
    assert found.gap.before.signals == {**main.gap.before.signals, **LOUD}
    assert found.gap.after.signals == {**main.gap.after.signals, **QUIET}
    squares = [v**2 for v in found.gap.before.signals.values()]
    assert found.gap.before.total == pytest.approx(np.sqrt(np.mean(squares)))
    assert found.gap.noise_floor == main.gap.noise_floor


def test_a_side_without_signals_leaves_the_gap_alone():
    main = main_of(Verdict.IDENTIFIED)
    silent = replace(side_of(Verdict.IDENTIFIED), before={}, after={})
    assert merge(main, silent).gap == main.gap


def test_the_sentence_tells_of_both():
    both = merge(main_of(Verdict.IDENTIFIED), side_of(Verdict.IDENTIFIED)).sentence
    assert both.startswith(main_of(Verdict.IDENTIFIED).sentence)
    assert "camera_latency: It is late." in both
    alone = merge(main_of(Verdict.NO_GAP), side_of(Verdict.IDENTIFIED)).sentence
    assert alone == "camera_latency: It is late."
    assert (
        merge(main_of(Verdict.IDENTIFIED), side_of(Verdict.NO_GAP)).sentence
        == main_of(Verdict.IDENTIFIED).sentence
    )
    assert "Unknown cause" in merge(main_of(Verdict.NO_GAP), side_of(Verdict.UNKNOWN)).sentence


def test_places_are_those_of_a_side_that_has_a_gap():
    main = main_of(Verdict.IDENTIFIED)
    joined = merge(main, side_of(Verdict.IDENTIFIED)).where
    assert {(p.signal, p.regime) for p in joined} == {(p.signal, p.regime) for p in (PLACE, *main.where)}
    assert sum(p.share for p in joined) <= 1.0 + 1e-9
    assert [p.share for p in joined] == sorted((p.share for p in joined), reverse=True)
    assert merge(main, side_of(Verdict.NO_GAP)).where == main.where


def test_what_both_say_is_kept():
    main = replace(main_of(Verdict.AMBIGUOUS), cannot_rule_out=("aero_drag",), warnings=("a",))
    side = side_of(
        Verdict.AMBIGUOUS,
        ambiguous_with=(("camera_latency", "camera_pitch"),),
        cannot_rule_out=("motion_blur", "aero_drag"),
        warnings=("b",),
    )
    found = merge(main, side)
    assert found.ambiguous_with == (("mass_offset", "torque_gain"), ("camera_latency", "camera_pitch"))
    assert found.cannot_rule_out == ("aero_drag", "motion_blur")
    assert found.warnings == ("a", "b")
    assert found.next_manoeuvre is main.next_manoeuvre


def test_an_effect_that_both_saw_is_one_effect():
    """A friction reference and the wheels tell of the same friction."""
    main = main_of(Verdict.IDENTIFIED)
    seen = replace(CAUSE, effect="tyre_relaxation", probability=0.9)
    side = replace(side_of(Verdict.IDENTIFIED), named=("tyre_relaxation",), causes=(seen,))
    found = merge(main, side)
    assert found.verdict is Verdict.IDENTIFIED
    assert found.causes[0].effect == "tyre_relaxation"
    assert [c.effect for c in found.causes].count("tyre_relaxation") == 1


def test_what_both_saw_is_as_probable_as_what_either_saw():
    main = main_of(Verdict.IDENTIFIED)
    seen = replace(CAUSE, effect="tyre_relaxation", probability=0.9)
    side = replace(side_of(Verdict.IDENTIFIED), named=("tyre_relaxation",), causes=(seen,))
    assert merge(main, side).causes[0].probability >= 0.9


# --- the counter's side

LATTICE = Lattice(TURN / (48 * 0.04), 0.04, 0.05, 0.008)
BEFORE = Measure(10.0, {"wheel_speed": 17.0, "vehicle_speed": 1.0, "accel_x": 1.0})
AFTER = Measure(1.0, {"wheel_speed": 1.1, "vehicle_speed": 1.0, "accel_x": 1.0})


def test_a_counter_is_identified_with_its_teeth_and_window():
    side = counter_verdict(LATTICE, BEFORE, AFTER, excluded=False)
    assert side.verdict is Verdict.IDENTIFIED
    assert side.named == ("wheel_speed_quantisation",)
    (cause,) = side.causes
    teeth, window = cause.parameters["teeth"], cause.parameters["window_s"]
    assert teeth.low < 48.0 == teeth.value < teeth.high
    assert window.low < 0.04 == window.value < window.high
    assert window.high - window.low == pytest.approx(0.008)
    assert cause.shrink_percent.value == pytest.approx(90.0)
    assert cause.shrink_percent.low <= 90.0 <= cause.shrink_percent.high <= 100.0
    assert side.before == {"wheel_speed": 17.0}
    assert side.after == {"wheel_speed": 1.1}


def test_a_window_that_the_log_is_too_slow_for_may_be_shorter():
    slow = Lattice(TURN / (100 * 0.01), 0.01, 0.05, 0.01, Reading.UNSEEN)
    (cause,) = counter_verdict(slow, BEFORE, AFTER, excluded=False).causes
    teeth, window = cause.parameters["teeth"], cause.parameters["window_s"]
    assert window.low < 0.005 < window.high
    assert teeth.low < 100.0 < 200.0 < teeth.high  # 200 teeth over 5 ms leave the same values


def test_a_counter_that_was_left_out_of_the_library_is_unknown():
    side = counter_verdict(LATTICE, BEFORE, AFTER, excluded=True)
    assert side.verdict is Verdict.UNKNOWN
    assert side.causes == ()
    assert side.unexplained is not None
    assert side.unexplained.subsystem == "wheel_speed_sensor"
    assert "multiples of 3.272 rad/s" in side.unexplained.sentence
    assert "40 ms" in side.unexplained.sentence
    found = merge(main_of(Verdict.NO_GAP), side)
    assert found.verdict is Verdict.UNKNOWN
    assert found.gap.after.signals["wheel_speed"] == 17.0


def test_a_counter_beside_another_effect_is_a_compound():
    found = merge(main_of(Verdict.IDENTIFIED), counter_verdict(LATTICE, BEFORE, AFTER, excluded=False))
    assert found.verdict is Verdict.COMPOUND
    assert {c.effect for c in found.causes[:2]} == {"tyre_relaxation", "wheel_speed_quantisation"}


def test_a_counter_alone_is_by_the_contract():
    found = merge(main_of(Verdict.NO_GAP), counter_verdict(LATTICE, BEFORE, AFTER, excluded=False))
    written = json.dumps(jsonable(found.to_json()), allow_nan=False)
    (row,) = [c for c in json.loads(written)["causes"] if c["effect"] == "wheel_speed_quantisation"]
    assert row["probability"] > 0.9
    assert row["parameters"]["teeth"]["value"] == 48.0


# --- the camera's side


def candidate(effects, score, **parameters):
    return CameraCandidate(
        effects=effects,
        signal="image_place",
        gain_fit=score,
        gain_holdout=score,
        size=len(effects),
        observations=100,
        effective=20.0,
        score=score,
        parameters=parameters,
        after=Measure(1.2, {"image_place": 1.2}),
        shrink_percent=Interval(70.0, 60.0, 80.0, "%"),
        evidence_for=("Borders come late.",),
        evidence_against=(),
        excited=True,
    )


LATE = candidate(("camera_latency",), 30.0, delay_s=Interval(0.2, 0.15, 0.25, "s"))
TILTED = candidate(("camera_pitch",), 10.0, pitch_rad=Interval(0.02, 0.0, 0.04, "rad"))
BOTH = candidate(
    ("camera_pitch", "camera_latency"), 29.0,
    delay_s=Interval(0.1, 0.0, 0.3, "s"), pitch_rad=Interval(0.01, -0.1, 0.1, "rad"),
)  # fmt: skip


def odd(sentence, signal="image_place"):
    return Oddity(signal, sentence, "weather", "late", "in tunnels")


def finding(verdict, *candidates, causes=(), **more):
    values = {
        "before": Measure(6.0, {"image_place": 6.0}),
        "after": Measure(1.2, {"image_place": 1.2}),
        "ambiguous_with": (),
        "cannot_rule_out": {},
        "places": (),
        "next_step": "",
        "odd": (),
        "warnings": (),
    }
    return PerceptionFinding(verdict=verdict, causes=causes, candidates=candidates, **{**values, **more})


def test_a_cameras_candidates_become_causes():
    side = camera_verdict(finding(Verdict.IDENTIFIED, LATE, BOTH, TILTED, causes=("camera_latency",)))
    assert [c.effect for c in side.causes] == ["camera_latency", "camera_pitch"]
    late, tilted = side.causes
    assert late.probability > 0.7 > tilted.probability
    assert late.probability + tilted.probability < 1.0
    assert late.parameters == {"delay_s": Interval(0.2, 0.15, 0.25, "s")}
    # alone, not beside a latency that does its work
    assert tilted.parameters == {"pitch_rad": Interval(0.02, 0.0, 0.04, "rad")}
    assert tilted.gap_after == TILTED.after.total
    assert side.named == ("camera_latency",)
    assert (side.before, side.after) == ({"image_place": 6.0}, {"image_place": 1.2})


def test_a_pair_that_does_not_stand_lends_its_second_effect_little():
    """As good as the one effect that stands, which it would have to beat by odds of twenty to one."""
    equal = replace(BOTH, score=LATE.score)
    side = camera_verdict(finding(Verdict.IDENTIFIED, LATE, equal, causes=("camera_latency",)))
    late, tilted = side.causes
    assert late.probability > 20.0 * tilted.probability
    stands = replace(BOTH, score=LATE.score + 2.0 * DECISIVE)
    both = camera_verdict(finding(Verdict.COMPOUND, stands, LATE, causes=BOTH.effects))
    assert min(c.probability for c in both.causes) > 0.45


def test_what_its_own_signal_does_not_stand_by_is_less_probable_than_what_is_named():
    """A blur that is traced, but too small to matter, beside class values that are asked about."""
    blur = replace(candidate(("motion_blur",), 11.4), signal="image_confidence")
    bright = replace(candidate(("exposure_shift",), 9.0), signal="image_confidence")
    values = replace(candidate(("class_friction_offset",), 2.4), signal="mu_reference")
    asked = (("class_friction_offset",),)
    found = finding(Verdict.AMBIGUOUS, blur, bright, values, causes=asked[0], ambiguous_with=asked)
    causes = camera_verdict(found).causes
    assert [c.effect for c in causes] == ["class_friction_offset", "motion_blur", "exposure_shift"]
    assert causes[0].probability > 0.7


def test_a_candidate_that_explains_no_more_than_nothing_is_not_probable():
    side = camera_verdict(finding(Verdict.NO_GAP, candidate(("motion_blur",), -4.0)))
    assert side.causes[0].probability < 0.05


def test_what_the_camera_cannot_explain_is_told():
    side = camera_verdict(finding(Verdict.UNKNOWN, TILTED, odd=(odd("Classes change in tunnels."),)))
    assert side.unexplained is not None
    assert side.unexplained.sentence == "Classes change in tunnels."
    assert side.unexplained.subsystem == "camera"
    assert "in tunnels" in render(merge(main_of(Verdict.NO_GAP), side))
    assert (side.unexplained.depends_on, side.unexplained.sign, side.unexplained.shape) == (
        "weather",
        "late",
        "in tunnels",
    )
    known = camera_verdict(
        finding(Verdict.IDENTIFIED, LATE, causes=("camera_latency",), odd=(odd("Beside it."),))
    )
    assert known.unexplained is None
    assert "Beside it." in known.warnings


def test_an_estimate_stays_within_what_a_vehicle_file_takes():
    wide = candidate(("motion_blur",), 30.0, exposure_s=Interval(0.21, 0.1, 0.5, "s"))
    side = camera_verdict(finding(Verdict.IDENTIFIED, wide, causes=("motion_blur",)))
    assert side.causes[0].parameters == {"exposure_s": Interval(0.2, 0.1, 0.2, "s")}


def test_reasons_of_what_cannot_be_ruled_out_are_kept_by_effect():
    side = camera_verdict(finding(Verdict.NO_GAP, LATE, cannot_rule_out={"motion_blur": "always slow"}))
    assert side.cannot_rule_out == ("motion_blur",)


@pytest.mark.parametrize(("signal", "first"), [("image_place", "camera"), ("image_confidence", "tyre")])
def test_a_road_out_of_place_speaks_before_the_cars_equations(signal, first):
    """It disturbs them, while a dim picture does not."""
    term = Unexplained(
        "tyre", "wheel_speed", "slip", "-", "", "", 0.5, np.array([]), np.array([]), "More slip."
    )
    main = replace(main_of(Verdict.UNKNOWN), unexplained=term, sentence="More slip.")
    pictures = finding(Verdict.UNKNOWN, TILTED, odd=(odd("Odd pictures.", signal),))
    both = merge(main, camera_verdict(pictures))
    assert both.verdict is Verdict.UNKNOWN
    assert both.unexplained is not None
    assert both.unexplained.subsystem == first
    assert both.sentence.startswith("Unknown cause: Odd pictures." if first == "camera" else "More slip.")
    assert "Odd pictures." in both.sentence
    assert "More slip." in both.sentence


def test_all_effects_of_a_compound_of_more_than_two_are_told():
    main = main_of(Verdict.COMPOUND)
    found = merge(main, side_of(Verdict.IDENTIFIED))
    named = {"camera_latency", *(c.effect for c in main.causes[:2])}
    assert set(found.together) == {c.effect for c in needed(found)} == named
    assert found.to_json()["together"] == list(found.together)
    assert len(needed(main)) == 2
    counter = merge(main, counter_verdict(LATTICE, BEFORE, AFTER, excluded=False))
    four = merge(counter, side_of(Verdict.IDENTIFIED))
    assert set(four.together) == named | {"wheel_speed_quantisation"}
    assert len(needed(four)) == 4


def test_a_quiet_camera_leaves_the_cars_gap_as_it_is_and_the_other_way_round():
    loud, quiet = main_of(Verdict.IDENTIFIED), main_of(Verdict.NO_GAP)
    found = merge(loud, side_of(Verdict.NO_GAP))
    assert (found.gap.before.total, found.gap.after.total) == pytest.approx(
        (_rms(loud.gap.before.signals), _rms(loud.gap.after.signals))
    )
    assert found.gap.before.signals == {**loud.gap.before.signals, **QUIET}
    found = merge(quiet, side_of(Verdict.IDENTIFIED))
    assert (found.gap.before.total, found.gap.after.total) == pytest.approx((5.0, 1.0))
    found = merge(loud, side_of(Verdict.IDENTIFIED))
    assert found.gap.before.total == pytest.approx(_rms({**loud.gap.before.signals, **LOUD}))


def _rms(signals):
    return np.sqrt(np.mean(np.square(list(signals.values()))))


def test_what_a_camera_cannot_tell_apart_comes_with_two_speeds_to_drive():
    found = finding(Verdict.AMBIGUOUS, LATE, TILTED, causes=("camera_latency",))
    found = replace(
        found, ambiguous_with=(("camera_latency", "camera_pitch"),), next_step="Drive 10 and 25 m/s."
    )
    told = merge(main_of(Verdict.NO_GAP), camera_verdict(found, load_vehicle(VEHICLE), MADE_ROAD))
    profile = told.to_json()["next_manoeuvre"]
    assert profile["sentence"] == "Drive 10 and 25 m/s."
    assert profile["separates"] == ["camera_latency", "camera_pitch"]
    assert np.shape(profile["wheel_torque_nm"]) == (len(profile["time_s"]), 4)
    assert jsonable(profile)["power_sigma"] is None
    assert "None" not in require_report(render(told)).text


DARK = candidate(("exposure_shift",), 1.5, stops=Interval(1.5, -4.0, 4.0, "stops"))
ASKED = finding(
    Verdict.AMBIGUOUS,
    DARK,
    causes=("exposure_shift",),
    ambiguous_with=(("exposure_shift",),),
    next_step="Record the pictures.",
)


def test_an_effect_that_may_as_well_be_none_is_asked_about():
    told = merge(main_of(Verdict.NO_GAP), camera_verdict(ASKED, load_vehicle(VEHICLE), MADE_ROAD))
    assert (told.verdict, told.causes[0].effect) == (Verdict.AMBIGUOUS, "exposure_shift")
    assert told.next_manoeuvre is None  # no drive tells
    assert told.sentence.endswith("Record the pictures.")
    assert "cannot tell exposure_shift from a car without it." in render(told)


@pytest.mark.parametrize(
    "verdict", [Verdict.IDENTIFIED, Verdict.PARTIAL, Verdict.AMBIGUOUS, Verdict.COMPOUND]
)
def test_beside_a_gap_of_the_car_a_question_is_a_warning(verdict):
    main = main_of(verdict)
    told = merge(main, camera_verdict(ASKED))
    assert told.verdict is verdict
    assert told.causes[0].effect == main.causes[0].effect
    assert told.ambiguous_with == main.ambiguous_with
    assert "exposure_shift" in told.cannot_rule_out
    assert any(text.startswith("exposure_shift? ") for text in told.warnings)


# --- alone, and where


def test_a_cause_alone_leaves_the_other_halfs_gap():
    main, side = main_of(Verdict.IDENTIFIED), side_of(Verdict.IDENTIFIED)
    of_car = list(main.gap.before.signals.values())
    found = {c.effect: c for c in merge(main, side).causes}
    late, before = found["camera_latency"], merge(main, side).gap.before.total
    expected = np.sqrt((sum(g * g for g in of_car) + CAUSE.gap_after**2) / (len(of_car) + 1))
    assert late.gap_after == pytest.approx(expected)
    assert late.shrink_percent.value == pytest.approx(100.0 * (1.0 - late.gap_after / before))
    assert late.shrink_percent.low <= late.shrink_percent.value <= late.shrink_percent.high
    relaxed = found["tyre_relaxation"]
    own = main.causes[0].gap_after
    assert relaxed.gap_after == pytest.approx(
        np.sqrt((own**2 * len(of_car) + LOUD["image_class"] ** 2) / (len(of_car) + 1))
    )


def test_what_a_quiet_half_could_have_shrinks_nothing():
    camera_alone = merge(main_of(Verdict.NO_GAP), side_of(Verdict.IDENTIFIED))
    theirs = {c.effect for c in main_of(Verdict.NO_GAP).causes}
    of_car = [c for c in camera_alone.causes if c.effect in theirs]
    assert of_car
    for cause in of_car:
        assert cause.gap_after == pytest.approx(camera_alone.gap.before.total)
        assert cause.shrink_percent.value == pytest.approx(0.0)
    car_alone = merge(main_of(Verdict.IDENTIFIED), side_of(Verdict.NO_GAP))
    of_camera = next(c for c in car_alone.causes if c.effect == "camera_latency")
    assert of_camera.gap_after == pytest.approx(car_alone.gap.before.total)


def test_the_heat_map_leaves_the_cameras_share_to_the_camera():
    main = main_of(Verdict.IDENTIFIED)
    found = merge(main, side_of(Verdict.IDENTIFIED))
    of_side = sum(p.share for p in found.where if p.subsystem == "camera") / PLACE.share
    total = sum(share for row in main.heat_map.values() for share in row.values())
    left = sum(share for row in found.heat_map.values() for share in row.values())
    assert left == pytest.approx((1.0 - of_side) * total)
    assert merge(main, side_of(Verdict.NO_GAP)).heat_map == main.heat_map


def test_an_estimate_beyond_its_bound_is_told_in_the_sentence_as_in_the_file():
    wide = candidate(("motion_blur",), 30.0, exposure_s=Interval(0.25, 0.1, 0.5, "s"))
    side = camera_verdict(finding(Verdict.IDENTIFIED, wide, causes=("motion_blur",)))
    assert "exposure_s 0.2 s" in side.sentence
    assert any("at its bound" in text for text in side.causes[0].evidence_against)


def test_class_values_are_told_apart_by_braking():
    vehicle, values = load_vehicle(VEHICLE), ("class_friction_offset", "friction_offset")
    found = finding(
        Verdict.AMBIGUOUS,
        candidate(values[:1], 10.0, dry=Interval(0.7, 0.6, 0.8)),
        candidate(values[1:], 9.0, factor=Interval(0.9, 0.8, 1.0)),
        causes=values[:1],
        ambiguous_with=(values,),
        next_step="Brake to the limit on each surface.",
    )
    planned = camera_verdict(found, vehicle, MADE_ROAD).next_manoeuvre
    assert planned.sentence.startswith("Brake to the limit")
    assert planned.wheel_torque_nm.min() < 0.5 * -planned.wheel_torque_nm.max()
