"""The report of a diagnosis, its JSON, its pictures and the ISO rating, on diagnoses made up by hand."""

import csv
import io
import json
import math
import shlex
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import made_up_diagnosis as made_up
import numpy as np
import pytest
from gap_drives import MODEL
from hypothesis import given
from hypothesis import strategies as st
from report_page import Page, require_report

from scenarios.effects import EFFECTS
from scenarios.html_page import percent
from sim2real.how_far.rating import LEAST_SAMPLES, MOST_SAMPLES, rating
from sim2real.hypotheses.contest import Contest, Entry
from sim2real.hypotheses.fitting import Candidate, Fit
from sim2real.hypotheses.goodness import Fitness
from sim2real.hypotheses.selection import Decision
from sim2real.observing.robust import loss
from sim2real.reporting import figures, report, sentences
from sim2real.reporting.advice import TRIES, advice
from sim2real.reporting.report import estimate, jsonable, render, write_diagnosis
from sim2real.result import Interval, Measure, Trace, Verdict

DIAGNOSES = {name: make() for name, make in made_up.ALL.items()}
BRIEF = {name: replace(diagnosis, traces=()) for name, diagnosis in DIAGNOSES.items()}
"""Without the pictures that take longest."""


@pytest.fixture(scope="module")
def pages():
    """One with all its curves; the other verdicts' differ in nothing else but these, with two."""
    first, *others = DIAGNOSES
    drawn = {first: DIAGNOSES[first]} | {
        name: replace(DIAGNOSES[name], traces=DIAGNOSES[name].traces[:2]) for name in others
    }
    return {name: require_report(render(diagnosis)) for name, diagnosis in drawn.items()}


def test_text_of_files_is_text():
    diagnosis = next(iter(BRIEF.values()))
    said = replace(
        diagnosis, warnings=("log <i>a</i>.csv: $x$",), provenance={"vehicle": {"path": "<i>", "sha256": "0"}}
    )
    page = render(said)
    assert page.count("&lt;i&gt;") >= 2
    assert "<i>" not in page


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        (["torque_gain"], "mass_offset or equally by torque_gain: these"),
        (["mass_offset+aero_drag"], "mass_offset, possibly together with aero_drag: these"),
        (
            ["torque_gain+road_grade", *(f"mass_offset+{key}" for key in "abcde")],
            "mass_offset or equally by torque_gain with road_grade, possibly together with a or b or c or 2 others",
        ),
    ],
)
def test_a_sentence_lists_a_few_rivals_and_counts_the_others(rivals, said):
    best, *others = (
        Entry(tuple(name.split("+")), None, np.zeros(0), np.zeros(0)) for name in ("mass_offset", *rivals)
    )
    fitness = Fitness(1.0, {})
    decision = Decision(Verdict.AMBIGUOUS, best, tuple(others), {}, fitness, fitness)
    diagnosis = BRIEF["ambiguous"]
    told = sentences.verdict(decision, diagnosis.gap, diagnosis.causes)
    assert said in told
    assert f"a gap of {diagnosis.gap.before.total:.1f} times the sensor noise" in told.replace(
        "The gap", "a gap"
    )


class TestWhatComesNearest:
    """Of a gap that no effect is named for."""

    def contest(self, left, ids=("torque_gain",), x=(0.4012,)):
        """One entry that leaves so much of each residual, of 100 in the model as it is."""
        candidate, z = Candidate(MODEL, ids), np.full(1000, 100.0)
        found = Fit(candidate, np.array(x), left * z, loss(left * z), np.zeros((0, 0)), 0)
        entry = Entry(ids, found, left * z, np.zeros(0))
        contest = Contest(Entry((), None, z, np.zeros(0)), (entry,))
        decision = Decision(Verdict.UNKNOWN, entry, (), {}, Fitness(90.0, {}), Fitness(1.0, {}))
        return decision, contest

    def test_it_says_what_to_try(self):
        said = advice(*self.contest(0.05, ("torque_gain", "torque_lag"), (0.4012, 0.3173)))
        assert said == (
            "Multiply the wheel torque by about 0.4 in the mapping file (scale), or check the torque's unit, the gear "
            "and mass_kg. Check whether the logged torque is a demand that the actuators follow with a time constant "
            "of about 0.32 s. Then diagnose again."
        )
        page = render(replace(BRIEF["unknown"], advice=said))
        assert "Multiply the wheel torque by about 0.4 in the mapping file (scale)" in page
        assert json.loads(json.dumps(replace(BRIEF["unknown"], advice=said).to_json()["advice"])) == said

    def test_not_where_it_leaves_more_than_a_tenth_or_is_named(self):
        decision, contest = self.contest(0.15)
        assert sentences.closest(decision, contest) is not None
        assert advice(decision, contest) == ""
        decision, contest = self.contest(0.05)
        assert advice(replace(decision, verdict=Verdict.IDENTIFIED), contest) == ""

    def test_every_effect_that_can_be_nearest_has_its_sentence(self):
        nearest = {key: effect for key, effect in EFFECTS.items() if effect.stage != "perception"}
        assert set(TRIES) == {key for key, effect in nearest.items() if not effect.structural} | {
            "tyre_load_stiffness"
        }
        for key, text in TRIES.items():
            values = {p.name: "1.5" for p in nearest[key].parameters()}
            assert "1.5" in text.format(**values)
            assert not text.endswith(".")

    @pytest.mark.parametrize(
        ("misfit", "count", "said"),
        [
            (52.6, 1, "what it leaves is not noise (52.6 times what noise gives)"),
            (1.2, 1, "another fault explains the gap better"),
            (1.2, 2, "one of its effects alone explains nearly as much, or the two only cancel each other"),
            (1.45, 2, "what it leaves is not noise (1.4 times what noise gives)"),
        ],
    )
    def test_it_says_why_it_is_not_named(self, misfit, count, said):
        assert sentences.why_not(misfit, 30.0, count) == said


@pytest.mark.parametrize("name", DIAGNOSES)
class TestEveryVerdict:
    def test_every_plot_has_what_it_shows(self, pages, name):
        assert len(pages[name].specs) >= 4
        for spec in pages[name].specs:
            assert spec["data"]
            assert spec["layout"]["xaxis"]["title"]["text"]

    def test_the_verdict_comes_first(self, pages, name):
        diagnosis = DIAGNOSES[name]
        assert pages[name].verdict == diagnosis.sentence.partition(". ")[0].rstrip(".") + "."
        before, found, _ = pages[name].text.partition(diagnosis.sentence)
        assert found
        assert "Where the gap lies" not in before

    def test_every_candidate_and_what_cannot_be_ruled_out_is_listed(self, pages, name):
        for effect in [c.effect for c in DIAGNOSES[name].causes] + list(DIAGNOSES[name].cannot_rule_out):
            assert effect in pages[name].text

    def test_the_json_is_the_contract_s(self, name):
        said = json.loads(json.dumps(jsonable(DIAGNOSES[name].to_json()), allow_nan=False))
        assert said["schema"] == 1
        assert said["verdict"] == name
        assert {"total", "signals"} <= set(said["gap"]["before"])
        assert sum(c["probability"] for c in said["causes"]) <= 1.0
        assert all({"value", "low", "high"} <= set(c["shrink_percent"]) for c in said["causes"])


def test_a_cause_shows_its_estimate_shrink_and_reasons(pages):
    text = pages["identified"].text
    assert "length_m 0.30 m (0.25 to 0.36)" in text
    assert "73.0 % (69.0 to 76.0)" in text
    assert all(reason in text for reason in DIAGNOSES["identified"].causes[1].evidence_against)


def test_a_regime_that_was_never_driven_is_not_shown_as_zero():
    shares = {"tyre": {"brake": 0.5}, "vehicle": {"brake": 0.3, "coast": 0.2}, "wheel": {"coast": 1e-5}}
    text = Page(render(replace(BRIEF["identified"], heat_map=shares))).text
    assert "brake coast tyre 50 % not driven vehicle 30 % 20 %" in text


def test_the_gap_of_each_signal_is_told_with_its_unit(pages):
    assert "wheel speed 6.80 1.20 0.340 not measured rad/s vehicle speed" in pages["identified"].text
    assert (
        "signal gap root mean square residual unit all 4.10 wheel speed 6.80 0.340 rad/s"
        in pages["unknown"].text
    )


def test_where_and_warnings_and_provenance_are_told(pages):
    text = pages["identified"].text
    assert "wheel_speed_fl tyre drive, low speed fit_1.csv 1.20 1.90 31 %" in text
    assert DIAGNOSES["identified"].warnings[0] in text
    assert f"fit 1 fit_1.csv SHA-256 {'77de' * 16}" in text
    assert f"fit 1 road road.yaml SHA-256 {'01ab' * 16}" in text
    assert "fit 1 rate hz 1000" in text
    assert "versions numpy 2.4.6" in text


def test_only_what_the_verdict_names_is_marked(pages):
    marked = {name: sum(c == "cause needed" for c in page.classes) for name, page in pages.items()}
    assert marked == {"identified": 1, "partial": 1, "compound": 2, "ambiguous": 0, "unknown": 0, "no_gap": 0}


def test_without_a_gap_nothing_is_blamed(pages):
    assert "Nothing may be blamed" in pages["no_gap"].text
    assert not any(c.startswith("cause") for c in pages["no_gap"].classes)


def test_ambiguous_says_what_to_drive(pages):
    proposal = DIAGNOSES["ambiguous"].next_manoeuvre
    assert proposal.sentence in pages["ambiguous"].text
    assert "cannot tell mass_offset and torque_gain apart" in pages["ambiguous"].text
    address = next(a for a in pages["ambiguous"].addresses if a.startswith("data:text/csv"))
    rows = list(csv.DictReader(io.StringIO(b64decode(address.split(",", 1)[1]).decode())))
    np.testing.assert_allclose([float(r["time_s"]) for r in rows], proposal.time_s, rtol=1e-5)
    read = [float(r["wheel_torque_rl_nm"]) for r in rows]
    np.testing.assert_allclose(read, proposal.wheel_torque_nm[:, 2], rtol=1e-5, atol=1e-4)


def test_unknown_describes_the_missing_term(pages):
    text = pages["unknown"].text
    assert DIAGNOSES["unknown"].unexplained.sentence in text
    assert "vehicle speed [m/s]" in text
    assert "opposes motion; grows in proportion" in text


def test_text_from_files_cannot_become_markup():
    page = Page(render(replace(DIAGNOSES["no_gap"], warnings=("<img src=http://x/y.png> & co",), traces=())))
    assert "<img src=http://x/y.png> & co" in page.text
    assert all(a.startswith("data:") for a in page.addresses)


def test_a_signal_without_a_common_sample_is_left_out_of_the_traces():
    first, second, *_ = DIAGNOSES["identified"].traces
    lost = replace(first, measured=np.full_like(first.measured, np.nan))
    assert report.shown_traces(replace(DIAGNOSES["identified"], traces=(lost, second))) == [second]


def test_a_refused_candidate_is_not_drawn_as_if_it_were_taken(pages):
    refused = replace(DIAGNOSES["unknown"], traces=made_up.traces(0.9, 0.97))
    assert all(np.array_equal(t.before, t.after) for t in report.shown_traces(refused))
    assert not any(np.array_equal(t.before, t.after) for t in report.shown_traces(DIAGNOSES["compound"])[:-1])
    assert "before after" in pages["identified"].text
    assert "before after" not in pages["unknown"].text


def test_traces_come_worst_first():
    shown = report.shown_traces(DIAGNOSES["identified"])
    assert shown[0].signal.startswith("wheel_speed")
    assert shown[-1].signal == "position_m"


class TestFirstScreen:
    @staticmethod
    def first(pages, name):
        return pages[name].text.partition("Where the gap lies")[0]

    @pytest.mark.parametrize("name", DIAGNOSES)
    def test_the_budget_s_bar_is_whole(self, pages, name):
        widths = pages[name].budget
        assert sum(widths) == pytest.approx(0.0 if name == "no_gap" else 100.0, abs=0.01)
        assert len(widths) == (0 if name == "no_gap" else len(DIAGNOSES[name].budget.shares))

    def test_the_budget_s_table_has_shares_and_intervals(self, pages):
        text = self.first(pages, "partial")
        assert "mass_offset 62 % 56 % to 68 %" in text
        assert "structure: what no effect of the library takes 34 % 31 % to 38 %" in text
        assert "noise of the sensors 4 % 3 % to 4 %" in text

    def test_each_part_has_its_own_pattern(self):
        parts = report.budget_parts(DIAGNOSES["compound"])
        assert [part.pattern for part in parts] == ["cause0", "cause1", "structure", "noise"]
        page = render(BRIEF["compound"])
        assert all(f".{part.pattern} {{ background: " in page for part in parts)

    def test_an_effect_that_makes_the_gap_larger_has_no_width(self):
        worse = replace(BRIEF["partial"], budget=made_up.budget(mass_offset=-0.1))
        widths = [part.width for part in report.budget_parts(worse)]
        assert widths == pytest.approx([0.0, 90.0, 10.0])
        assert "mass_offset -10 %" in Page(render(worse)).text

    @pytest.mark.parametrize(
        ("name", "step"),
        [
            ("identified", "A gap of 1.10 is left then."),
            ("partial", "A gap of 2.50 is left then; “What is left beside mass_offset” below"),
            ("compound", "Put tyre_relaxation and aero_drag into the vehicle file"),
            ("ambiguous", "Add that log with --fit"),
            (
                "unknown",
                "Look at the vehicle: what is left shows most in accel x and depends on vehicle speed [m/s].",
            ),
            ("no_gap", "Nothing: what is left is noise."),
        ],
    )
    def test_the_next_step(self, pages, name, step):
        text = self.first(pages, name)
        assert step in text
        assert ("trpac gap apply" in text) == (name in ("identified", "partial", "compound"))
        assert ("--paired" in text) == (name == "unknown")

    def test_the_command_names_the_vehicle_file(self):
        hostile = {"vehicle": {"path": "my cars/<b>.yaml", "sha256": "0"}}
        command = report.apply_command(replace(DIAGNOSES["partial"], provenance=hostile))
        assert shlex.split(command.replace("\\\n", "")) == [
            *("trpac", "gap", "apply", "diagnosis.json"),
            *("--vehicle", "my cars/<b>.yaml", "--out", "<b>_with_effect.yaml"),
        ]
        assert "--vehicle car.yaml" in report.apply_command(replace(DIAGNOSES["partial"], provenance={}))

    def test_without_a_signal_a_sentence_stands_for_the_plot(self):
        assert "No signal of the hold-out has a sample" in Page(render(BRIEF["partial"])).text


class TestRemainder:
    def test_of_a_partial_verdict_it_is_told_beside_the_effect(self, pages):
        _, _, told = pages["partial"].text.rpartition("What is left beside mass_offset")
        assert told.strip().startswith(DIAGNOSES["partial"].unexplained.sentence)
        assert "depends on acceleration [m/s²] sign and shape changes sign; is a straight line" in told
        assert "share of the remainder 50 %" in told

    @pytest.mark.parametrize("name", ["partial", "unknown"])
    def test_without_a_form_it_is_a_sentence(self, name):
        assert "It has no form" in Page(render(replace(BRIEF[name], unexplained=None))).text

    def test_without_a_curve_nothing_is_drawn(self):
        none = np.array([])
        term = replace(DIAGNOSES["partial"].unexplained, x=none, y=none, share=math.nan)
        page = Page(render(replace(BRIEF["partial"], unexplained=term)))
        assert page.specs == []
        assert "share of the remainder" not in page.text

    def test_hostile_words_are_text(self):
        term = replace(DIAGNOSES["partial"].unexplained, sentence="<script>x</script>", depends_on="<b>")
        page = Page(render(replace(BRIEF["partial"], unexplained=term, sentence="<i>a</i>. <u>b</u>"))).source
        assert not any(tag in page for tag in ("<script>x", "<b>&", "<i>a", "<u>"))
        assert "&lt;script&gt;x" in page


class TestWriting:
    def test_into_a_new_folder_and_again_into_the_same(self, tmp_path):
        folder = tmp_path / "deep" / "out"
        first = write_diagnosis(BRIEF["unknown"], folder)
        (folder / "notes.txt").write_text("mine")
        assert write_diagnosis(BRIEF["no_gap"], folder) == first
        assert sorted(p.name for p in folder.iterdir()) == ["diagnosis.json", "notes.txt", "report.html"]
        assert json.loads(first[0].read_text())["verdict"] == "no_gap"
        assert [p.name for p in folder.parent.iterdir()] == ["out"]

    def test_a_failure_leaves_nothing(self, tmp_path, monkeypatch):
        monkeypatch.setattr(figures, "missing_term", lambda term: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            write_diagnosis(BRIEF["unknown"], tmp_path / "out")
        assert list(tmp_path.iterdir()) == []

    def test_a_full_disk_leaves_the_old_result(self, tmp_path, monkeypatch):
        written = write_diagnosis(BRIEF["no_gap"], tmp_path / "out")
        before = [p.read_bytes() for p in written]
        original = type(tmp_path).write_text

        def fail(self, text, **options):
            if self.name == report.REPORT_NAME:
                raise OSError(28, "No space left on device")
            return original(self, text, **options)

        monkeypatch.setattr(type(tmp_path), "write_text", fail)
        with pytest.raises(OSError, match="No space"):
            write_diagnosis(BRIEF["identified"], tmp_path / "out")
        assert [p.read_bytes() for p in written] == before
        assert [p.name for p in tmp_path.iterdir()] == ["out"]

    def test_undefined_numbers_become_null(self):
        value = {
            "a": math.nan,
            "b": (np.float64(1.5), np.int64(2)),
            "c": np.array([1.0, math.inf]),
            "d": Verdict.UNKNOWN,
        }
        assert json.loads(json.dumps(jsonable(value), allow_nan=False)) == {
            "a": None,
            "b": [1.5, 2],
            "c": [1.0, None],
            "d": "unknown",
        }


class TestNumbers:
    @pytest.mark.parametrize(
        ("interval", "text"),
        [
            (Interval(0.3, 0.25, 0.36, "m"), "0.30 m (0.25 to 0.36)"),
            (Interval(48123.4, 46010.0, 50230.0, "N"), "48123 N (46010 to 50230)"),
            (Interval(0.65, 0.6498, 0.6512, "m^2"), "0.6500 m² (0.6498 to 0.6512)"),
            (Interval(1.0, 1.0, 1.0), "1.000 (1.000 to 1.000)"),
            (Interval(0.0, 0.0, 0.0, "s"), "0 s (0 to 0)"),
            (Interval(73.0, math.nan, math.nan, "%"), "73.00 %"),
            (Interval(math.nan, 0.0, 1.0, "m"), "not known"),
            (Interval(-0.021, -0.03, -0.012, "rad"), "-0.021 rad (-0.030 to -0.012)"),
        ],
    )
    def test_estimates_show_the_digits_that_their_interval_bears(self, interval, text):
        assert estimate(interval) == text

    @given(
        st.floats(-1e6, 1e6, allow_subnormal=False),
        st.floats(0.0, 1e6, allow_subnormal=False),
        st.floats(0.0, 1e6, allow_subnormal=False),
    )
    def test_what_is_shown_is_within_a_tenth_of_the_interval(self, value, below, above):
        interval = Interval(value, value - below, value + above)
        shown = estimate(interval).replace("(", "").replace(")", "").replace("to ", "").split()
        allowed = 0.051 * max(interval.high - interval.low, 0.01 * abs(value))
        for text, true in zip(shown, (value, interval.low, interval.high), strict=True):
            assert abs(float(text) - true) <= allowed

    @pytest.mark.parametrize(
        ("share", "text"),
        [
            (0.0, "0 %"),
            (0.0001, "< 0.1 %"),
            (0.004, "0.4 %"),
            (0.3149, "31 %"),
            (0.994, "99.4 %"),
            (0.9997, "> 99.9 %"),
            (1.0, "100 %"),
            (math.nan, "not known"),
            (None, "not known"),
        ],
    )
    def test_shares_keep_a_digit_near_none_and_all(self, share, text):
        assert percent(share) == text

    def test_shrink_follows_from_the_gap_where_no_single_cause_has_it(self):
        gap = replace(DIAGNOSES["compound"].gap, before=Measure(5.0), after=Measure(1.5))
        assert report.shrink(replace(DIAGNOSES["compound"], gap=gap)).value == pytest.approx(70.0)
        assert report.shrink(DIAGNOSES["identified"]).low == pytest.approx(69.0)
        assert report.possible_shrink(replace(DIAGNOSES["compound"], gap=gap)) == pytest.approx(80.0)


class TestFigures:
    def test_the_worst_window_is_where_the_simulation_is_furthest_off(self):
        time = np.arange(0.0, 30.0, 0.01)
        measured = np.where((time >= 12.0) & (time < 13.0), 5.0, 0.0)
        measured[2000:2010] = np.nan
        start, end = figures.worst_window(Trace("s", "-", time, measured, 0.0 * time, 0.0 * time, 0.1))
        assert start <= 12.0
        assert end >= 12.99
        assert end - start == pytest.approx(figures.ZOOM_S, abs=0.02)

    def test_a_short_log_is_its_own_window(self):
        time = np.arange(0.0, 1.0, 0.01)
        start, end = figures.worst_window(Trace("s", "-", time, time, time, time, 0.1))
        assert (start, end) == (time[0], time[-1])

    @pytest.mark.parametrize(
        ("name", "label"),
        [
            ("vehicle_speed_m_s", "vehicle speed [m/s]"),
            ("accel_x_m_s2", "accel x [m/s²]"),
            ("wheel_speed_fl_rad_s", "wheel speed fl [rad/s]"),
            ("position_m", "position [m]"),
            ("slip", "slip"),
        ],
    )
    def test_names_become_labels(self, name, label):
        assert figures.label_of(name) == label


class TestRating:
    time = np.arange(0.0, 20.0, 0.02)
    curve = 10.0 + 5.0 * np.sin(time)

    def test_the_same_curve_is_rated_one(self):
        assert rating(self.time, self.curve, self.curve) == pytest.approx(1.0)

    def test_its_compiled_code_is_kept_for_the_next_process(self):
        from dtwalign.backtrack import _backtrack_jit
        from dtwalign.cost import _calc_cumsum_matrix_jit

        rating(self.time, self.curve, self.curve + 0.1)
        for function in (_backtrack_jit, _calc_cumsum_matrix_jit):
            found = function.stats
            assert sum(found.cache_hits.values()) + sum(found.cache_misses.values()) == 1
            assert any(Path(found.cache_path).glob(f"*{function.__name__}*.nbi"))

    def test_it_falls_with_the_deviation(self):
        values = [
            rating(self.time, self.curve, self.curve + a * np.sin(7.0 * self.time)) for a in (0.1, 1.0, 4.0)
        ]
        assert 1.0 > values[0] > values[1] > values[2] > 0.0

    def test_it_is_the_weighted_mean_that_the_standard_prescribes(self):
        """Off by more than half the peak: no corridor (0.4), no magnitude (0.2), but phase and slope (0.2 each)."""
        flat = 10.0 + 0.5 * np.sin(self.time)
        assert rating(self.time, flat, flat + 6.3) == pytest.approx(0.4)

    def test_a_delay_costs_the_phase(self):
        """A tenth of the length is half of the largest shift: half of the phase's 0.2 is lost."""
        pulse = np.exp(-((self.time - 9.0) ** 2))
        late = np.exp(-((self.time - 11.0) ** 2))
        assert rating(self.time, pulse, late) < 0.9

    def test_the_step_counts(self):
        """Slope is relative, so the same samples on a slower clock rate the same."""
        other = self.curve + np.sin(7.0 * self.time)
        assert rating(self.time, self.curve, other) == pytest.approx(
            rating(3.0 * self.time, self.curve, other)
        )

    @pytest.mark.parametrize("reference", [np.zeros(1000), np.full(1000, 4.0), np.full(1000, np.nan)])
    def test_undefined_is_none(self, reference):
        assert rating(self.time, reference, self.curve) is None
        assert rating(self.time, self.curve, reference) is None

    def test_too_short_is_none(self):
        few = LEAST_SAMPLES - 1
        assert rating(self.time[:few], self.curve[:few], self.curve[:few]) is None

    def test_unequal_lengths_are_refused(self):
        with pytest.raises(ValueError, match="1000, 999 and 1000"):
            rating(self.time, self.curve[:-1], self.curve)

    def test_lost_samples_are_bridged_in_both(self):
        lost = self.curve.copy()
        lost[200:260] = np.nan
        assert rating(self.time, lost, self.curve) == pytest.approx(1.0, abs=1e-9)

    def test_long_logs_are_thinned(self):
        time = np.arange(0.0, 60.0, 0.005)
        curve = np.sin(time)
        assert len(time) > 5 * MOST_SAMPLES
        assert rating(time, curve, curve) == pytest.approx(1.0)

    def test_a_diagnosis_gets_the_ratings_of_its_traces(self):
        shown = DIAGNOSES["identified"].traces[1:3]
        rated = report.rated(replace(DIAGNOSES["identified"], traces=shown))
        assert set(rated.rating) == {t.signal for t in shown}
        assert all(after > before for before, after in rated.rating.values())
