"""What became of the runs of a sweep: those that never converged, could not be judged, or failed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pandas as pd

from scenarios.sweep.execute import Failure
from scenarios.sweep.summary import shown_enough, slippery

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
        parts = []
        if self.unconverged:
            parts.append(f"{len(self.unconverged):,} never converged ({self.estimator})")
        elif self.runs > len(self.unjudged) + len(self.failures):
            parts.append(f"every judged run converged ({self.estimator})")
        if self.unjudged:
            parts.append(f"{len(self.unjudged):,} could not be judged")
        parts.append(f"{len(self.failures):,} failed with an error" if self.failures else "none failed")
        return f"Of {self.runs:,} run{'s' if self.runs > 1 else ''}: {', '.join(parts)}."


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
    stretches: list[dict[str, Any]] = [
        {str(key): value for key, value in row.items()} for row in rows.to_dict("records")
    ]
    missed = [row for row, index in zip(stretches, rows.index, strict=True) if index in never.index]
    first = stretches[0]
    road = []
    for row, index in zip(stretches, rows.index, strict=True):
        reached = "" if index not in never.index else " (not reached)"
        road.append(f"{row['surface'].replace('_', ' or ')} {row['theta']:.2f}{reached}")
    return Unconverged(
        run=first["run"],
        level=f"{first['parameter']} = {first['level']:g}" if first["parameter"] else "not varied",
        seed=first["seed"],
        road=", ".join(road),
        why="; ".join(map(_why, missed)),
    )


def _why(row: dict[str, Any]) -> str:
    """Why an estimate did not converge on a stretch, as far as its row says."""
    if row["excited_time_s"] == 0.0:
        return "the slip stayed below the estimator's threshold"
    off = row["error_end"]
    text = f"cause not known: excited for {row['excited_time_s']:.2f} s, {abs(off):.3f} "
    text += f"{'above' if off > 0.0 else 'below'} the true value at the end"
    if not math.isnan(row["covered_end"]):  # NaN without a standard deviation
        text += f", {'within' if row['covered_end'] else 'outside'} 2 TRPAC_std"
    return text
