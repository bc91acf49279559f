"""What became of the runs of a sweep: those that never converged, could not be judged, or failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from scenarios.sweep.execute import Failure
from scenarios.sweep.summary import ENOUGH_SHOWN_S, shown_enough, slippery

MAIN = ("robust", "DIFE")
"""The estimator that the first sentence is about: the first of these that ran, else the last of the sweep."""


@dataclass(frozen=True)
class Unconverged:
    """A run with a stretch on which the estimate never converged, though the tyre showed its friction long enough."""

    run: int
    level: str
    seed: int
    road: str
    why: str


@dataclass(frozen=True)
class Outcome:
    """The runs of a sweep by what became of them.

    Attributes
    ----------
    runs : int
        All of them.
    estimator : str
        The estimator that is judged.
    unconverged : tuple of Unconverged
        Runs that never converged on a stretch.
    unjudged : tuple of int
        Runs on whose slippery stretches the tyre showed its friction too briefly.
    failures : tuple of Failure
        Runs that ended with an error.
    """

    runs: int
    estimator: str
    unconverged: tuple[Unconverged, ...]
    unjudged: tuple[int, ...]
    failures: tuple[Failure, ...]

    @property
    def sentence(self) -> str:
        """The counts."""
        parts = [f"{len(self.unconverged):,} never converged ({self.estimator})"]
        if self.unjudged:
            parts.append(f"{len(self.unjudged):,} could not be judged")
        parts.append(f"{len(self.failures):,} failed with an error" if self.failures else "none failed")
        return f"Of {self.runs:,} runs: {', '.join(parts)}."


def outcome(table: pd.DataFrame, failures: list[Failure]) -> Outcome:
    """What became of the runs, those with a result in a table."""
    names = list(table["estimator"].unique())
    estimator = next((name for name in MAIN if name in names), names[-1])
    mine = table[table["estimator"] == estimator]
    judged = shown_enough(slippery(mine))
    never = judged[judged["convergence_time_s"].isna()]
    found = [_unconverged(rows, never) for _, rows in mine[mine["run"].isin(never["run"])].groupby("run")]
    unjudged = sorted(set(table["run"]) - set(judged["run"]))
    return Outcome(
        table["run"].nunique() + len(failures), estimator, tuple(found), tuple(unjudged), tuple(failures)
    )


def _unconverged(rows: pd.DataFrame, never: pd.DataFrame) -> Unconverged:
    """A run of its rows, one per stretch, and those of them on which it never converged."""
    first, missed = rows.iloc[0], rows.index.isin(never.index)
    level = f"{first['parameter']} = {first['level']:g}" if first["parameter"] else "not varied"
    road = [
        f"{row.surface.replace('_', ' or ')} {row.theta:.2f}{' (not reached)' if miss else ''}"
        for row, miss in zip(rows.itertuples(), missed, strict=True)
    ]
    why = "; ".join(_why(row) for row in rows[missed].itertuples())
    return Unconverged(int(first["run"]), level, int(first["seed"]), ", ".join(road), why)


def _why(row: Any) -> str:
    """Why an estimate did not converge on a stretch, as far as its row says."""
    if row.excited_time_s == 0.0:
        return "the slip stayed below the estimator's threshold"
    side = "above" if row.error_end > 0.0 else "below"
    text = f"cause not known: excited for {row.excited_time_s:.2f} s, {abs(row.error_end):.3f} {side} the true value at the end"
    if row.covered_end == row.covered_end:  # an estimator without a standard deviation has NaN
        text += f", {'within' if row.covered_end else 'outside'} 2 TRPAC_std"
    return text
