"""Which mass the flag asks for: shares by hand, and the choice."""

from __future__ import annotations

import pandas as pd
import pytest

from benchmarks.vision import flag_gate
from benchmarks.vision.table4.judge import COLUMNS
from trpac_core.vision.ife_config import IfeConfig


def verdicts(source: str, wrong: list[float], right: list[float], Q_v: float = 0.9) -> pd.DataFrame:
    """Frames of true class 0 in both scenarios, with these masses m_0."""
    rows = [
        (source, source, "", n, scenario, "IFE", 0, 1.0, found, True, Q_v, m_0)
        for scenario in ("normal", "w/ interference")
        for n, (found, m_0) in enumerate([(1, m) for m in wrong] + [(0, m) for m in right])
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def row(shares: pd.DataFrame, least_mass: float) -> pd.Series:
    return shares[(shares["least_mass"] == least_mass) & (shares["scenario"] == "normal")].iloc[0]


def test_shares_are_those_counted_by_hand():
    shares = flag_gate.shares_by_mass(verdicts("rendered", [0.55, 0.65, 0.75, 0.95], [0.6, 0.9, 0.9, 0.9]))
    at = row(shares, 0.7)
    assert at[flag_gate.HELD_BACK] == pytest.approx(50.0)
    assert at[flag_gate.COST] == pytest.approx(25.0)
    assert at[flag_gate.LEFT] == pytest.approx(40.0), "two wrong and three right ones are left"


def test_the_choice_is_the_least_that_holds_back_most_in_the_hardest_set():
    easy = verdicts("rendered, any weather", [0.51, 0.51, 0.95], [0.9])
    hard = verdicts("a clip", [0.51, 0.74, 0.95], [0.9])
    assert flag_gate.chosen(flag_gate.shares_by_mass(easy)) == 0.525
    assert flag_gate.chosen(flag_gate.shares_by_mass(pd.concat([easy, hard]))) == 0.75
    sure = verdicts("rendered", [0.99], [0.9])
    assert flag_gate.chosen(flag_gate.shares_by_mass(sure)) is None


def test_frames_that_the_visual_confidence_holds_back_stay_so():
    dark = verdicts("rendered", [0.9], [0.9], Q_v=IfeConfig().flag_threshold)
    assert not flag_gate.flags(dark, 0.5).any()


def test_table_and_figure_tell_every_mass_and_set(tmp_path):
    both = pd.concat([verdicts("rendered", [0.6], [0.9]), verdicts("a clip", [0.7], [0.8, 0.9])])
    shares = flag_gate.shares_by_mass(both)
    lines = flag_gate.as_markdown(shares).splitlines()
    assert len(lines) == 2 + len(flag_gate.MASSES)
    assert all(line.count("|") == 6 for line in lines)
    flag_gate.draw(shares, tmp_path / "gate.png")
    assert (tmp_path / "gate.png").stat().st_size > 5_000
