"""The first sentence of each report: the verdict in plain words, failures included."""

import re

import numpy as np
import pandas as pd
import pytest

from scenarios import known
from scenarios.report import sentences, verdict
from scenarios.runner import _at_the_end
from scenarios.sweep.execute import Failure
from scenarios.sweep.outcome import outcome
from sim2real.replay import report as replay
from trpac_core.estimator_data import Method, Source
from trpac_core.robust.belief import MOST_SLIP

SCORE = {
    "start_m": 0.0,
    "theta": 0.9,
    "convergence_time_s": 0.12,
    "steady_state_error": 0.01,
    "excited_time_s": 1.0,
}
END = {
    "TRPAC": 0.69,
    "TRPAC_std": 0.3,
    "TRPAC_low": 0.1,
    "TRPAC_high": 1.2,
    "shown_s": 0.5,
    "camera": False,
    "spun": False,
}


def summary(*stretches):
    """What a run's summary says of stretches: changes of score and of the end."""
    return {
        "method": "robust",
        "estimators": {"robust": [SCORE | score for score, _ in stretches]},
        "at_the_end": [END | end for _, end in stretches],
    }


class TestRun:
    @pytest.mark.parametrize(
        ("score", "end", "said"),
        [
            (
                {},
                {"shown_s": 0.0},
                "0.9 stretch from 0 m: not known, the wheel torque was too small to show it (TRPAC at its end: 0.69).",
            ),
            (
                {},
                {"shown_s": 0.0, "camera": True},
                "0.9 stretch from 0 m: not known, the wheel torque was too small to show it "
                "(TRPAC at its end from the camera: 0.69).",
            ),
            (
                {},
                {"shown_s": 0.0, "spun": True},
                "0.9 stretch from 0 m: not known, the wheel spun or locked (TRPAC at its end: 0.69).",
            ),
            (
                {"convergence_time_s": None},
                {},
                "0.9 stretch from 0 m: true value not reached, TRPAC at its end is 0.69.",
            ),
            ({}, {}, "0.9 stretch from 0 m: 0.69 at its end, converged within 0.12 s of excited time."),
        ],
    )
    def test_a_stretch(self, score, end, said):
        assert verdict(summary((score, end))) == said

    def test_failures_come_first(self):
        said = sentences(
            summary(
                ({"theta": 0.3}, {}), ({"theta": 0.5, "convergence_time_s": None}, {}), ({}, {"shown_s": 0.0})
            )
        )
        assert [text.split()[0] for text in said] == ["0.9", "0.5", "0.3"]

    def test_the_tyre_must_have_shown_this_stretch_itself(self):
        """The source keeps its bit from the stretch before, where no camera says that the road is another one."""
        rows = pd.DataFrame(
            {
                **dict.fromkeys(("TRPAC", "TRPAC_std", "TRPAC_low", "TRPAC_high"), 0.5),
                "TRPAC_source": [Source.TYRE, Source.BOTH, Source.CAMERA],
                "excitation_flag": [False, True, True],
                "slip": [0.0, 0.02, 0.03],
            }
        )
        end = _at_the_end(rows, 0.01)
        assert (end["shown_s"], end["camera"], end["spun"]) == (pytest.approx(0.01), True, False)
        assert _at_the_end(rows.assign(excitation_flag=False), 0.01)["shown_s"] == 0.0
        assert _at_the_end(rows.assign(slip=MOST_SLIP + 0.1), 0.01)["spun"]


class TestEstimate:
    @staticmethod
    def said(method="robust", errors=None, excitation=None, **end):
        values = {"TRPAC_end": 0.34, "TRPAC_std_end": 0.40, "TRPAC_low_end": 0.1, "TRPAC_high_end": 1.2}
        shown = {"driven_s": 9.6, "seen_share": 0.17, "excited_share": 0.4, "camera_share": 0.0}
        return replay.sentences(
            {
                "method": method,
                "estimate": values
                | {"known_share": 0.05, "lower_bound_share": 0.0, "TRPAC_source_end": "tyre"}
                | end,
                "excitation": shown | (excitation or {}),
                "errors": errors,
            }
        )

    def test_a_wide_interval_is_not_known(self):
        first, why, driven = self.said()
        assert first == "At the end: 0.34, with standard deviation 0.40: not known."
        assert "0.10 to 1.20, wider than the 0.6 between dry road (0.8) and snow or ice (0.2)" in why
        assert driven.endswith("the tyres showed the road for 17 % of it. TRPAC was known for 5 % of it.")

    def test_a_narrow_interval_is_known(self):
        first, *_ = self.said(TRPAC_std_end=0.05, TRPAC_low_end=0.26, TRPAC_high_end=0.45)
        assert first == "At the end: 0.34, with standard deviation 0.05 and 95 % interval 0.26 to 0.45."

    def test_at_the_end_of_the_range_only_the_lower_bound_is_known(self):
        first, why, driven = self.said(
            TRPAC_end=1.2, TRPAC_low_end=1.01, TRPAC_high_end=1.27, lower_bound_share=0.9
        )
        assert first == "At the end: at least 1.01, from the friction in use."
        assert why == "No upper bound is known: the estimate reaches the end of its range, a TRPAC of 1.2."
        assert driven.endswith("TRPAC was known for 5 % of it; only a lower bound was known for 90 %.")

    def test_an_interval_without_an_upper_end_is_a_lower_bound(self):
        end = {"TRPAC_end": 1.0, "TRPAC_low_end": 0.75, "TRPAC_high_end": 1.272}
        for source, what in known.BY_SOURCE.items():
            first, *_ = self.said(**end, TRPAC_source_end=source.label)
            assert first == f"At the end: at least 0.75, from {what}."

    def test_without_a_source_an_interval_past_the_range_is_a_lower_bound(self):
        end = {"TRPAC_end": 1.0, "TRPAC_low_end": 0.75, "TRPAC_high_end": 1.21}
        assert "at least 0.75" in self.said(**end, TRPAC_source_end="none")[0]
        assert self.said(**end)[0].endswith("95 % interval 0.75 to 1.21.")

    def test_other_methods_have_two_deviations_to_either_side(self):
        first, *_ = self.said(method="dife", TRPAC_std_end=0.05)
        assert first.endswith("95 % interval 0.24 to 0.44.")

    def test_a_drive_without_excitation_says_what_to_do(self):
        text = " ".join(self.said(excitation={"seen_share": 0.0, "excited_share": 0.0}))
        assert "0 % of it, since no tyre slipped above its threshold: brake or accelerate harder" in text

    def test_the_error_against_a_reference(self):
        text = " ".join(self.said(errors={"robust": {"seen": {"mean_abs": 0.058, "within_2_std": 0.98}}}))
        assert "mean absolute error of TRPAC_peak against the reference is 0.058" in text
        assert "98 % of these rows" in text


def test_known_is_what_tells_dry_road_from_snow():
    assert known.WIDEST == pytest.approx(0.6)
    assert known.is_known(0.5, 0.2, 0.79, Source.NONE)
    assert not known.is_known(0.5, 0.2, 0.81, Source.TYRE)
    low, high = known.interval(Method.DIFE, np.array([0.5]), np.array([0.1]), None, None)
    assert (low[0], high[0]) == pytest.approx((0.3, 0.7))


class TestSweep:
    @staticmethod
    def table(**changes):
        """Three runs on wet road, then snow, by DE and robust."""
        rows = [
            {
                "run": run,
                "parameter": "",
                "level": np.nan,
                "seed": 100 + run,
                "stretch": stretch,
                "surface": surface,
                "theta": theta,
                "estimator": estimator,
                "shown_s": 1.0,
                "excited_time_s": 1.2,
                "convergence_time_s": 0.2,
                "error_end": 0.004,
                "covered_end": 1.0,
            }
            for run in range(3)
            for stretch, (surface, theta) in enumerate([("wet", 0.55), ("snow_ice", 0.21)])
            for estimator in ("DE", "robust")
        ]
        return pd.DataFrame(rows).assign(**changes)

    def test_all_converge(self):
        became = outcome(self.table(), [])
        assert became.sentence == "Of 3 runs: every judged run converged (robust), none failed."
        assert became.unconverged == ()

    def test_one_stretch_that_never_converges_lists_its_run(self):
        table = self.table()
        missed = (table["run"] == 1) & (table["stretch"] == 1) & (table["estimator"] == "robust")
        table.loc[missed, ["convergence_time_s", "error_end", "covered_end"]] = np.nan, -0.08, 0.0
        (found,) = outcome(table, []).unconverged
        assert (found.run, found.seed, found.level) == (1, 101, "not varied")
        assert found.road == "wet 0.55, snow or ice 0.21 (not reached)"
        assert found.why == (
            "cause not known: excited for 1.20 s, 0.080 below the true value at the end, outside 2 TRPAC_std"
        )
        table.loc[missed, "excited_time_s"] = 0.0
        assert outcome(table, []).unconverged[0].why == "the slip stayed below the estimator's threshold"

    def test_another_estimator_s_failure_is_not_the_run_s(self):
        table = self.table()
        table.loc[table["estimator"] == "DE", "convergence_time_s"] = np.nan
        assert outcome(table, []).unconverged == ()
        alone = table[table["estimator"] == "DE"]
        assert outcome(alone, []).sentence.startswith("Of 3 runs: 3 never converged (DE)")

    def test_a_tyre_that_showed_too_little_is_not_judged(self):
        table = self.table(shown_s=0.1, convergence_time_s=np.nan)
        became = outcome(table, [])
        assert became.unjudged == (0, 1, 2)
        assert became.sentence == "Of 3 runs: 3 could not be judged, none failed."

    def test_runs_that_failed_count(self):
        became = outcome(self.table(), [Failure(3, "ValueError: x"), Failure(4, "MemoryError: y")])
        assert became.sentence == "Of 5 runs: every judged run converged (robust), 2 failed with an error."

    def test_large_numbers_are_readable(self):
        failures = [Failure(i, "x") for i in range(1234)]
        assert re.match("Of 1,237 runs: .* 1,234 failed", outcome(self.table(), failures).sentence)

    def test_a_level_is_told(self):
        table = self.table(parameter="believed.mass_factor", level=0.9, convergence_time_s=np.nan)
        assert {run.level for run in outcome(table, []).unconverged} == {"believed.mass_factor = 0.9"}
