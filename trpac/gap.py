"""The diagnosis of the gap between a simulation and recorded logs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from scenarios.car_and_road import Vehicle, as_road, as_vehicle
from scenarios.files import RoadFile, VehicleFile
from scenarios.progress import StageProgress, silent
from sim2real.logs import Log
from sim2real.logs.mapping import Mapping
from sim2real.logs.read import DbcFiles
from sim2real.result import Budget, Cause, Gap, Place, Verdict, needed
from sim2real.result import Diagnosis as Result
from trpac.extras import extras
from trpac.files import read_log

AnyLog = Log | pd.DataFrame | str | Path


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """The outcome of a diagnosis; `result` has all details."""

    result: Result

    def __repr__(self) -> str:
        return f"Diagnosis {self.verdict}: {self.result.sentence}"

    def _repr_html_(self) -> str:
        rows = [(c.effect, c.probability, c.gap_after, c.shrink_percent.value) for c in self.causes]
        return pd.DataFrame(rows, columns=["effect", "probability", "gap after", "shrink [%]"]).to_html(
            index=False
        )

    @property
    def verdict(self) -> Verdict:
        """The outcome: identified, partial, ambiguous, compound, unknown or no_gap."""
        return self.result.verdict

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The candidate causes, most probable first."""
        return self.result.causes

    @property
    def gap(self) -> Gap:
        """The gap on the hold-out log before and after, in units of the sensor noise."""
        return self.result.gap

    @property
    def budget(self) -> Budget | None:
        """Shares of the squared gap by cause, structure and noise; None without a gap."""
        return self.result.budget

    @property
    def where(self) -> tuple[Place, ...]:
        """Location of the gap: signal, subsystem, regime and time."""
        return self.result.where

    def apply_to(self, vehicle: VehicleFile, effect: str | None = None) -> Vehicle:
        """The car with the effects that the verdict names, for `simulate`; unchanged where it names none.

        Parameters
        ----------
        vehicle : Vehicle
            The car that was diagnosed.
        effect : str, optional
            The one effect to add; an ambiguous verdict needs it, its effects are in `result.ambiguous_with`.

        Raises
        ------
        TrpacError
            An effect that the diagnosis does not name.
        """
        from sim2real.apply import chosen, with_causes

        causes = needed(self.result) if effect is None else chosen(self.result, effect)
        return with_causes(vehicle, causes)

    def to_json(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        return self.result.to_json()

    def to_html(self, path: str | Path) -> Path:
        """Write the report; returns its path."""
        with extras("to_html", "gap"):
            from sim2real.reporting.report import rated, render

            Path(path).write_text(render(rated(self.result)), encoding="utf-8")
        return Path(path)

    def write(self, folder: str | Path) -> tuple[Path, Path]:
        """Write diagnosis.json and report.html; returns their paths."""
        with extras("write", "gap"):
            from sim2real.reporting.report import rated, write_diagnosis

            return write_diagnosis(rated(self.result), folder)


def diagnose(
    vehicle: VehicleFile | str | Path,
    road: RoadFile | str | Path,
    *,
    fit: Sequence[AnyLog],
    holdout: AnyLog,
    mapping: Mapping | str | Path | None = None,
    dbc: DbcFiles = None,
    baseline: Sequence[AnyLog] = (),
    paired: Sequence[AnyLog] = (),
    simulated: Sequence[AnyLog] = (),
    by: Literal["time", "position"] = "time",
    model: str | Path | None = None,
    signals: str | Path | None = None,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: StageProgress = silent,
) -> Diagnosis:
    """The diagnosis of recorded logs against the simulation of a car on one road.

    Parameters
    ----------
    vehicle, road : Vehicle and Road, or path or name of each
        Car and road of the simulation.
    fit, holdout : sequence of logs, log
        Paths, DataFrames or Logs: the logs to which parameters are fitted, and the one on which the gap is measured.
        Windows of one log (`read_log(path).window(from_s, to_s)`) may be used for both.
    mapping : path, optional
        Columns of the logs in the log format.
    dbc : path or sequence of paths, optional
        DBC files with the meaning of bus frames.
    baseline : sequence of logs
        Logs of the same car without the fault, of any manoeuvre.
    paired : sequence of logs
        The same manoeuvres without the fault, one for each fit log and, last, the hold-out's. The model error that a
        log has in common with its pair does not count as gap.
    simulated : sequence of logs
        Logs of your own simulation over each log's inputs, in place of `paired`.
    by : "time" or "position"
        The quantity by which the rows of a log and its reference are matched.
    model, signals : path, optional
        Your own vehicle model as a co-simulation FMU, and the file with its variables and signals, in place of
        `simulated`.
    seed : int
        Seed of the resampling for the intervals.
    exclude : collection of str
        Excluded effects.
    jobs : int
        Number of threads.
    progress : callable
        Called with the stage, the number of finished items and the number of all.

    Raises
    ------
    TrpacError
        With all problems.
    MissingExtraError
        Without the extra 'gap'.
    """
    car, course = as_vehicle(vehicle), as_road(road)
    logs = [read_log(log, mapping=mapping, dbc=dbc) for log in (*fit, holdout)]
    with extras("diagnose", "gap"):
        from sim2real.diagnose import diagnose_sources
        from sim2real.own_sources import require_alone, studied
        from sim2real.sources import make_source, pairing_of, put_together

        pairing = pairing_of(paired, simulated, by)
        require_alone(model, signals, pairing)
        if pairing:
            pairing.require(len(logs))
        references = [read_log(log, mapping=mapping, dbc=dbc) for log in pairing.logs] if pairing else []
        faultless = [make_source(read_log(log, mapping=mapping, dbc=dbc), course) for log in baseline]
        sources = put_together(
            car,
            None,
            [make_source(log, course) for log in logs],
            [make_source(log, course) for log in references],
            by,
        )
        sources = replace(sources, baseline=tuple(faultless))
        asked = partial(diagnose_sources, seed=seed, exclude=exclude, jobs=jobs, progress=progress)
        if model is None or signals is None:
            return Diagnosis(asked(sources))
        with studied(sources, Path(model), Path(signals), jobs, progress) as (held, own):
            return Diagnosis(asked(held, own=own))
