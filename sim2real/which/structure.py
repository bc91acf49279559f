"""The gap between two models that is nobody's fault: tyres of another formula beside an effect.

A real tyre's curve is not the simulation's, whatever formula that has. Where an effect alone does not explain all, it
is fitted once more beside a free shape of the curve, so that what the shape leaves is not held against the effect.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

import numpy as np

from scenarios.effects import EFFECTS
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.which.contest import Contest, Entry, Progress, enter, is_proper, run_all, silent
from sim2real.which.fitting import FULL_STEPS, Candidate

TRIED = 3
"""Best single effects that a structural one is tried beside."""
STRUCTURAL = tuple(key for key, effect in EFFECTS.items() if effect.structural)
"""Effects that are differences between models."""


def add_structure(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with its best single effects fitted once more, each beside the structural one that leaves least."""
    wanted = [key for key in STRUCTURAL if key not in exclude and not model.has(key)]
    work = [
        partial(_beside, entry, key, model, fit_to, holdout)
        for entry in contest.singles[:TRIED]
        for key in wanted
    ]
    found = [entry for entry in run_all(work, jobs, progress, "structure") if is_proper(entry)]
    best = {entry.ids[0]: entry for entry in sorted(found, key=lambda e: -e.loss)}
    return replace(contest, structured=tuple(sorted(best.values(), key=lambda e: e.loss)))


def _beside(entry: Entry, key: str, model: Simulation, fit_to: Evidence, holdout: Evidence) -> Entry:
    effect = entry.fitted
    both = Candidate(model, (*entry.ids, key), (*effect.candidate.forms, 0))
    alone = Candidate(model, (key,))
    starts = np.array([np.concatenate([effect.x, x]) for x in (alone.neutral, *alone.starts)])
    return enter(both, fit_to, holdout, starts, FULL_STEPS)
