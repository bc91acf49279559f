"""A diagnosis' logs with the user's own model in the nominal model's place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import ScenarioError
from sim2real.hypotheses.contest import Progress
from sim2real.observing.drive import Drive, awake
from sim2real.observing.observer import Simulation
from sim2real.observing.reference import held_against_stretches
from sim2real.own_model.runs import OwnModel, Run, Stretch
from sim2real.own_model.signals import load_signals
from sim2real.own_model.study import Study
from sim2real.own_model.unit import opened_unit
from sim2real.sources import Pairing, Sources, drive_of, on_grid, with_reference


def require_alone(model: object, signals: object, pairing: Pairing | None) -> None:
    """Raise ScenarioError where a model comes without its signals file, or beside reference logs."""
    if (model is None) != (signals is None):
        raise ScenarioError(
            "model and signals belong together; expected a unit (.fmu) and the file that says which of its variables "
            "is which signal (.yaml), see docs/guide/gap_own_model.md."
        )
    if model is not None and pairing is not None:
        raise ScenarioError(
            f"model and {pairing.option} are both given; expected one of them: a log has one reference. Leave one out."
        )


@contextmanager
def studied(
    sources: Sources, model: Path, signals: Path, jobs: int, progress: Progress
) -> Iterator[tuple[Sources, Study]]:
    """The logs held against the unit's runs over them, and what its parameters do; the unit is closed at the end.

    Parameters
    ----------
    sources : Sources
        The logs as they were read.
    model, signals : Path
        The unit, and its signals file.
    jobs : int
        Processes at a time.
    progress : callable
        Told how many of how many runs are done.

    Raises
    ------
    ScenarioError
        The signals file is wrong, or a run fails.
    """
    nominal, told = Simulation(sources.vehicle), load_signals(signals)
    with opened_unit(model, told) as unit:
        own = OwnModel(unit, told, jobs, progress)

        def held(number: int, run: Sequence[Stretch]) -> Drive:
            source = sources.all[number]
            drives = [
                (part.from_s, awake(drive_of(part.log, source.road, on_grid(part.log)))) for part in run
            ]
            return held_against_stretches(nominal, source.drive, drives)

        def follow(number: int, run: Sequence[Stretch]) -> NDArray[np.float64]:
            reference = held(number, run).reference
            assert reference is not None
            return reference

        study = Study(own, [s.log for s in sources.all], follow)
        made = own.simulate([Run(s.log) for s in sources.all])  # known by now
        paired = [
            with_reference(s, held(i, run), run[0].log)
            for i, (s, run) in enumerate(zip(sources.all, made, strict=True))
        ]
        yield replace(sources, fit=tuple(paired[:-1]), holdout=paired[-1]), study
