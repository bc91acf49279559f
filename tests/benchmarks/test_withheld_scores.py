"""Scoring of withheld cases on made-up answers with known scores, and the run's seal."""

from __future__ import annotations

import json
import math
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import yaml
from long import long

from benchmarks.gap.withheld import runner
from benchmarks.gap.withheld.command import watch
from benchmarks.gap.withheld.generator.driver import UndrivableError
from benchmarks.gap.withheld.generator.table import Group, Spec, table
from benchmarks.gap.withheld.outcome import ResultError, outcome_of, read_outcomes
from benchmarks.gap.withheld.scorer import Scores, load_thresholds, score, score_run
from benchmarks.gap.withheld.statistics import calibration_error, reliability, wilson

LIMITS = yaml.safe_load(runner.THRESHOLDS.read_text(encoding="utf-8"))


def cause(effect: str, probability: float, **parameters: tuple[float, float]) -> dict[str, Any]:
    return {
        "effect": effect,
        "probability": probability,
        "parameters": {
            name: {"value": sum(i) / 2, "low": i[0], "high": i[1]} for name, i in parameters.items()
        },
        "shrink_percent": {"value": 90.0, "low": 88.0, "high": 92.0},
    }


def answer(
    verdict: str, *causes: dict[str, Any], groups: Any = (), subsystem: str | None = None
) -> dict[str, Any]:
    return {
        "verdict": verdict,
        "causes": list(causes),
        "ambiguous_with": [list(g) for g in groups],
        "unexplained": {"subsystem": subsystem} if subsystem else None,
    }


def result(
    group: str, effects: dict[str, Any], said: dict[str, Any] | None, *, gap: float = 10.0, **more: Any
) -> dict[str, Any]:
    seal = {"group": group, "effects": effects, "subsystems": ["tyre", "road"], "gap": gap}
    error = None if said else "ValueError: lost"
    known = {"case": f"{group}-made-up", "seal": seal, "diagnosis": said, "error": error}
    return known | {"achieved_shrink_percent": 85.0} | more


LAG = {"torque_lag": {"time_constant_s": 0.1}}
RIGHT = answer(
    "identified", cause("torque_lag", 0.96, time_constant_s=(0.09, 0.11)), cause("torque_delay", 0.02)
)
SECOND = answer(
    "ambiguous", cause("torque_delay", 0.6), cause("torque_lag", 0.4), groups=[("torque_delay", "torque_lag")]
)
SHY = answer("unknown", cause("torque_lag", 0.1), subsystem="tyre")
QUIET = answer("no_gap")


def scored(*results: dict[str, Any]) -> Scores:
    return score([outcome_of(r) for r in results], LIMITS)


def line(scores: Scores, name: str):
    return next(found for found in scores.lines if found.name == name)


def counted(scores: Scores, name: str) -> tuple[int | None, int]:
    return line(scores, name).hits, line(scores, name).n


def test_a_perfect_diagnosis_keeps_every_threshold():
    pair = answer("compound", cause("mass_offset", 0.99), cause("torque_lag", 0.99))
    usage = {"seconds": 30.0, "peak_bytes": 2**29}
    nearly = answer("identified", cause("torque_lag", 0.99, time_constant_s=(0.11, 0.12)))
    scores = scored(
        *[result("rich", LAG, RIGHT)] * 9,
        result("rich", LAG, nearly),
        result("mild", LAG, SECOND),
        result("no_gap", {}, QUIET, gap=1.0),
        result("outside", {"tyre_heating": {}}, answer("unknown", subsystem="tyre")),
        result("removed", LAG, answer("unknown", subsystem="road")),
        result("pair", {"torque_lag": {}, "mass_offset": {}}, pair),
        result("timing", LAG, RIGHT, usage=usage),
    )
    assert [found.name for found in scores.lines if not found.holds] == []
    assert {found.name for found in scores.lines} == set(LIMITS) - {"gap"}
    assert counted(scores, "parameter_in_interval") == (9, 10)
    assert line(scores, "shrink_difference_points").value == pytest.approx(5.0)


def test_a_useless_diagnosis_keeps_none():
    wrong = answer("identified", cause("aero_drag", 0.99, drag_area_m2=(0.0, 1.0)), cause("road_grade", 0.0))
    scores = scored(
        *[
            result(group, LAG, wrong, achieved_shrink_percent=10.0)
            for group in ("rich", "mild", "outside", "removed", "pair")
        ],
        result("no_gap", {}, wrong, gap=1.0),
        result("timing", LAG, wrong, usage={"seconds": 90.0, "peak_bytes": 2**31}),
    )
    assert [found.name for found in scores.lines if found.holds] == []
    assert line(scores, "calibration_error").value == pytest.approx(0.99)


def test_nothing_counted_holds_nothing():
    scores = scored(result("no_gap", {}, QUIET, gap=1.0))
    assert [found.name for found in scores.lines if found.holds] == ["false_alarm", "calibration_error"]
    assert math.isnan(line(scores, "right_first").value)


def test_only_a_blamed_effect_is_right():
    scores = scored(*(result("rich", LAG, said) for said in (RIGHT, SECOND, SHY, None)))
    assert counted(scores, "right_first") == (1, 4)
    assert counted(scores, "right_in_first_two") == (2, 4)
    ranked = {a.text: a.hits for a in scores.asides}
    assert ranked["rich: ranked first, whatever the verdict"] == 2
    assert list(scores.errors.values()) == ["ValueError: lost"]
    assert scores.verdicts["rich"] == {"identified": 1, "ambiguous": 1, "unknown": 1, "error": 1}


def test_small_gaps_do_not_count():
    scores = scored(result("rich", LAG, RIGHT), result("rich", LAG, SHY, gap=4.9))
    assert counted(scores, "right_first") == (1, 1)


def test_mild_flag_must_hold_the_truth():
    other = answer(
        "ambiguous", cause("aero_drag", 0.5), cause("road_grade", 0.5), groups=[("aero_drag", "road_grade")]
    )
    scores = scored(*(result("mild", LAG, said) for said in (RIGHT, SECOND, other)))
    assert counted(scores, "mild_right_or_flagged") == (2, 3)


def test_any_verdict_but_no_gap_is_a_false_alarm():
    scores = scored(*(result("no_gap", {}, said, gap=1.0) for said in (QUIET, RIGHT, SHY, None)))
    assert counted(scores, "false_alarm") == (3, 4)


def test_subsystem_counts_whatever_the_truth_accepts():
    outside = {"tyre_heating": {}}
    scores = scored(
        *(result("outside", outside, answer("unknown", subsystem=s)) for s in ("tyre", "road", "vehicle")),
        result("outside", outside, RIGHT),
    )
    assert counted(scores, "outside_unknown") == (3, 4)
    assert counted(scores, "outside_subsystem") == (2, 4)


def test_removed_wants_unknown_or_a_set():
    single = answer("ambiguous", cause("aero_drag", 1.0), groups=[("aero_drag",)])
    scores = scored(*(result("removed", LAG, said) for said in (SHY, SECOND, RIGHT, single)))
    assert counted(scores, "removed_unknown_or_wider") == (2, 4)


def test_pairs_want_both_and_no_other():
    truth = {"mass_offset": {}, "torque_lag": {}}
    both, one = cause("torque_lag", 0.9), cause("aero_drag", 0.9)
    joint = answer("compound", cause("mass_offset + torque_lag", 0.9))
    scores = scored(
        result("pair", truth, answer("compound", both, cause("mass_offset", 0.9))),
        result("pair", truth, joint),
        result("pair", truth, answer("compound", both, one, cause("mass_offset", 0.1))),
        result("pair", truth, answer("identified", both, cause("mass_offset", 0.1))),
    )
    assert counted(scores, "pair_both_named") == (2, 4)


def test_none_of_these_is_an_answer_with_a_probability():
    shy = outcome_of(result("outside", {"tyre_heating": {}}, SHY))
    assert shy.most_probable == ("none of these", pytest.approx(0.9))
    assert shy.believed_right
    assert not outcome_of(result("rich", LAG, SHY)).believed_right
    assert outcome_of(result("rich", LAG, RIGHT)).believed_right


@pytest.mark.parametrize(
    ("hits", "n", "expected"),
    [(8, 10, (0.4902, 0.9433)), (0, 75, (0.0, 0.0487)), (10, 10, (0.7225, 1.0)), (0, 0, (0.0, 1.0))],
)
def test_wilson_interval(hits, n, expected):
    assert wilson(hits, n) == pytest.approx(expected, abs=1e-4)


def test_calibration_error():
    believed, right = [0.95] * 10 + [0.35] * 10, [True] * 9 + [False] + [True] * 3 + [False] * 7
    bins = reliability(believed, right)
    assert [(b.n, b.right) for b in bins] == [(10, pytest.approx(0.3)), (10, pytest.approx(0.9))]
    assert calibration_error(bins) == pytest.approx(0.05)
    assert reliability([1.0], [True])[0].low == 0.9


# --- the run


def test_a_folder_keeps_one_run(tmp_path):
    runner.seal_run(tmp_path, "small", 7)
    runner.seal_run(tmp_path, "small", 7)
    with pytest.raises(runner.RunError, match="seed: 7 there, 8 now"):
        runner.seal_run(tmp_path, "small", 8)
    with pytest.raises(runner.RunError, match="size: small there, full now"):
        runner.seal_run(tmp_path, "full", 7)
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["seed"] == 7


def test_thresholds_are_frozen_with_the_run(tmp_path, monkeypatch):
    runner.seal_run(tmp_path, "small", 7)
    assert load_thresholds(tmp_path) == LIMITS
    easier = tmp_path / "thresholds.yaml"
    easier.write_text(runner.THRESHOLDS.read_text(encoding="utf-8").replace("0.85", "0.50"), encoding="utf-8")
    monkeypatch.setattr("benchmarks.gap.withheld.scorer.THRESHOLDS", easier)
    with pytest.raises(ResultError, match="sealed with"):
        load_thresholds(tmp_path)


def test_results_that_are_none_are_named(tmp_path):
    with pytest.raises(ResultError, match="no results"):
        read_outcomes(tmp_path)
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "odd.json").write_text('{"case": "odd"}', encoding="utf-8")
    with pytest.raises(ResultError, match=r"odd\.json: KeyError"):
        read_outcomes(tmp_path)


class FakeDiagnosis:
    """What a diagnosis module hands back."""

    def to_json(self) -> dict[str, Any]:
        return RIGHT


@pytest.fixture
def fake_diagnose(monkeypatch):
    """A diagnosis module that notes what it was shown; its behaviour can be set."""
    module = types.ModuleType("sim2real.diagnose")
    module.calls = []
    module.problem = None

    def diagnose_files(
        vehicle: Path, road: Path, fit: list[str], holdout: str, **options: Any
    ) -> FakeDiagnosis:
        names = [*map(Path, fit), *map(Path, holdout.split("@")), vehicle, road]
        assert all(path.is_file() for path in names)
        module.calls.append((names, options))
        if module.problem:
            raise module.problem
        return FakeDiagnosis()

    module.diagnose_files = diagnose_files
    module.shrink_on = lambda diagnosis, log, road: 87.5 if log.is_file() and road.is_file() else None
    monkeypatch.setitem(sys.modules, "sim2real.diagnose", module)
    return module


BIAS = Spec(
    "removed-accelerometer_bias-1", Group.REMOVED, ("accelerometer_bias",), 10.0, "rich-accelerometer_bias-1"
)


def test_the_diagnosis_sees_files_and_no_truth(tmp_path, fake_diagnose):
    runner.run_case(BIAS, 1, tmp_path, keep=False)
    (names, options), *_ = fake_diagnose.calls
    assert options["exclude"] == ("accelerometer_bias",)
    assert not any("bias" in str(path.relative_to(tmp_path)) or path.stem == "fresh" for path in names)
    result = json.loads(runner.result_path(tmp_path, BIAS).read_text(encoding="utf-8"))
    assert result["achieved_shrink_percent"] == 87.5
    assert list(result["seal"]["effects"]) == ["accelerometer_bias"]
    assert not list((tmp_path / "cases").iterdir())
    (outcome,) = read_outcomes(tmp_path)
    assert outcome.group is Group.REMOVED
    assert outcome.seconds > 0.0


def test_a_diagnosis_that_fails_is_counted_and_not_repeated(tmp_path, fake_diagnose):
    fake_diagnose.problem = ValueError("no such column")
    waiting, total = runner.pending(tmp_path, "small")
    spec = next(s for s in waiting if s.group is Group.NO_GAP)
    assert runner.run_case(spec, 1, tmp_path, keep=True)["error"] == "ValueError: no such column"
    assert runner.pending(tmp_path, "small")[0] == [s for s in waiting if s != spec]
    assert len(waiting) == total
    assert counted(score(read_outcomes(tmp_path), LIMITS), "false_alarm") == (1, 1)


def test_a_case_that_cannot_be_made_stays_pending_and_stops_no_run(tmp_path, monkeypatch):
    def nothing_shows(*what):
        raise UndrivableError("nothing in the drive shows the deviation")

    monkeypatch.setattr(runner, "make_case", nothing_shows)
    assert "not made: nothing in the drive" in runner.run_case(BIAS, 1, tmp_path, keep=False)["error"]
    assert not list(tmp_path.iterdir())


@long
def test_scores_tell_what_is_pending(tmp_path, fake_diagnose):
    runner.seal_run(tmp_path, "small", 1)
    runner.run_case(next(s for s in table("small") if s.group is Group.NO_GAP), 1, tmp_path, keep=False)
    scores = score_run(tmp_path)
    assert len(scores.pending) == len(table("small")) - 1
    assert json.loads(json.dumps(scores.to_json()))["lines"][3]["holds"] is False


def test_a_watched_command_tells_memory_of_all_its_processes():
    hold = "b = bytearray(b'x') * 150_000_000"
    child = f"{hold}; print('held', flush=True); input()"
    both = (  # the child may be long in coming on a busy machine
        "import subprocess as sp, sys, time; "
        f"c = sp.Popen([sys.executable, '-c', {child!r}], stdin=sp.PIPE, stdout=sp.PIPE, text=True); "
        f"{hold}; c.stdout.readline(); time.sleep(1.0); c.communicate('done\\n')"
    )
    usage = watch([sys.executable, "-c", both])
    assert usage.code == 0
    assert 3e8 < usage.peak_bytes < 4e8
    assert usage.seconds > 1.0
    failed = watch([sys.executable, "-c", "import sys; sys.exit('column missing')"])
    assert (failed.code, failed.errors) == (1, "column missing")
