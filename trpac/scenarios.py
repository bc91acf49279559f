"""The reference plant under a torque, and whole scenarios with pictures and the unit."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from scenarios.car_and_road import Vehicle, as_road, as_vehicle
from scenarios.effects import Effect
from scenarios.files import RoadFile, Scenario, SensorNoise, VehicleFile, load_scenario
from scenarios.plant.pipeline import simulate as run_plant
from scenarios.plant.sensors import make_log
from scenarios.progress import StageProgress, silent
from trpac.extras import extras
from trpac.picture import Picture
from trpac_core.errors import TrpacError
from trpac_core.estimator_data import Method
from trpac_core.vehicle import WHEELS

if TYPE_CHECKING:
    from scenarios.brake_onset import Comparison


def simulate(
    vehicle: VehicleFile | str | Path,
    road: RoadFile | str | Path,
    *,
    torque: pd.DataFrame | ArrayLike,
    step_s: float = 0.01,
    speed: float = 0.0,
    effects: Sequence[Effect] = (),
    noise: SensorNoise | None = None,
    seed: int = 0,
) -> pd.DataFrame:
    """The log of a simulated car under wheel torques, with the columns of the log format.

    Parameters
    ----------
    vehicle, road : Vehicle and Road, or path or name of each
        The car and the road.
    torque : DataFrame, or array of shape (n, 4)
        time_s at equal steps and wheel_torque_{fl,fr,rl,rr}_nm; or the torques alone, `step_s` apart [N m].
    step_s : float
        Step of an array [s].
    speed : float
        Speed at the start [m/s].
    effects : sequence of Effect
        Effects in addition to those of the vehicle, such as `trpac.effects.TorqueLag(time_constant_s=0.05)`.
    noise, seed : SensorNoise, int
        Noise of the sensors, by default none, and its seed.

    Raises
    ------
    TrpacError
        With all problems.
    """
    if isinstance(torque, pd.DataFrame):
        names = ["time_s", *(f"wheel_torque_{wheel}_nm" for wheel in WHEELS)]
        if absent := [name for name in names if name not in torque]:
            raise TrpacError(f"torque lacks {', '.join(absent)}; expected {', '.join(names)}.")
        time_s, torque = torque["time_s"].to_numpy(dtype=float), torque[names[1:]].to_numpy(dtype=float)
        steps = np.diff(time_s)
        if len(steps) == 0 or not np.allclose(steps, steps[0], rtol=1e-6, atol=1e-9) or steps[0] <= 0.0:
            raise TrpacError("torque has times that are not equally apart; expected a uniform time_s.")
        step_s = float(steps[0])
    car = as_vehicle(vehicle)
    if effects:
        car = Vehicle(**car.model_dump(by_alias=True)).with_effects(effects)
    trajectory = run_plant(car, as_road(road), np.asarray(torque, dtype=float), step_s, speed)
    return make_log(trajectory, car, noise or SensorNoise(), seed)


@dataclass(frozen=True, repr=False)
class ScenarioRun:
    """A finished scenario.

    Attributes
    ----------
    log : DataFrame
        One row per step: the sensors, the unit's outputs, theta and segment under the wheel.
    summary : dict
        Content of summary.json: scores per stretch of road and estimator.
    """

    log: pd.DataFrame
    summary: dict[str, Any]
    _run: Any
    _scratch: tempfile.TemporaryDirectory[str]
    _comparisons: tuple[Comparison, ...] = ()

    @property
    def frames(self) -> tuple[Path, ...]:
        """Files of the camera's pictures, which exist as long as this object does."""
        return tuple(Path(path) for path in self._run.frames["path"])

    def __repr__(self) -> str:
        return (
            f"ScenarioRun of {self.summary['scenario']!r}, seed {self.summary['seed']}, {len(self.log)} steps"
        )

    def _repr_html_(self) -> str:
        from scenarios.report import score_rows

        rows = [{"estimator": name, **score} for name, score in score_rows(self.summary)]
        return pd.DataFrame(rows).to_html(index=False)

    @property
    def brake_onsets(self) -> tuple[str, ...]:
        """The result of each scenario of `compare_camera` in words."""
        return tuple(comparison.onset.sentence for comparison in self._comparisons)

    @property
    def verdict(self) -> str:
        """Results of the run in sentences, one per stretch of road."""
        from scenarios.report import verdict

        return verdict(self.summary)

    def figure17(self) -> Picture:
        """The paper's Figure 17 of this run."""
        from scenarios.figure17 import draw_figure17

        path = Path(self._scratch.name) / "figure17.png"
        draw_figure17(self._run, path)
        return Picture(path.read_bytes())

    def write(self, folder: str | Path, progress: StageProgress = silent) -> tuple[Path, ...]:
        """Write report.html, figure17.png, log.csv and summary.json; returns their paths.

        With `compare_camera` also brake_onset.png, which is the report's first picture.
        """
        from scenarios.brake_onset_figure import draw_brake_onset
        from scenarios.report import write_report
        from scenarios.runner import write_run
        from scenarios.vision_overlay import draw_overlay_sheet
        from scenarios.whole_files import written_whole

        with written_whole(Path(folder)) as made:
            overlay = None
            if len(self._run.frames):
                overlay = Path(self._scratch.name) / "overlay.jpg"
                draw_overlay_sheet(
                    self._run, overlay, lambda done, total: progress("drawing the report", done, total)
                )
            self.figure17().save(made / "figure17.png")
            onset_figure = None
            if self._comparisons:
                onset_figure = made / "brake_onset.png"
                draw_brake_onset(self._comparisons, onset_figure)
            report = made / "report.html"
            write_report(self._run, overlay, report, self._comparisons, onset_figure)
            write_run(self._run, made)
            names = sorted(path.name for path in made.iterdir())
        return tuple(Path(folder) / name for name in names)


def run(
    scenario: Scenario | str | Path,
    *,
    seed: int | None = None,
    stiffness_n: float | None = None,
    fmu: str | Path | None = None,
    kind: str = "python",
    method: str = "robust",
    compare_camera: Sequence[str | Path] = (),
    progress: StageProgress = silent,
) -> ScenarioRun:
    """Results of a scenario: plant, rendered and disturbed pictures, the unit under fmpy, scores.

    Parameters
    ----------
    scenario : path or name
        Scenario file, or a shipped one such as "paper_simulation".
    seed, stiffness_n : optional
        Replace the seed and the vehicle's C_x of all scenarios [N].
    fmu : path, optional
        The unit; by default one is built.
    kind : str
        Kind of the unit that is built: python or native (docs/guide/unit/native.md).
    method : str
        Estimator of the unit: as_printed, dife or robust (docs/theory/methods.md).
    compare_camera : sequence of paths or names
        Scenarios that brake after the road's last border, such as "cruise_onto_snow". Each is run with and without its
        camera; what TRPAC is when the brakes are applied, and the stopping distance planned from it, is added to the
        report and, as `brake_onset`, to the summary.
    progress : callable
        Called with the stage, and how many of how many of its items are done.

    Raises
    ------
    TrpacError
        With all problems.
    MissingExtraError
        Without the extra 'fmu'.
    """
    which = Method.of(method)
    chosen, *compared = (_with_changes(given, seed, stiffness_n) for given in (scenario, *compare_camera))
    scratch = tempfile.TemporaryDirectory(prefix="trpac_")
    folder = Path(scratch.name)
    with extras("run", "fmu"):
        from fmu_src.kinds import build
        from scenarios.brake_onset import compare, require_comparable
        from scenarios.fmu_client.estimator import UNIT
        from scenarios.runner import run_scenario
        from trpac.units import require_unit

        for each in compared:
            require_comparable(each)
        unit = require_unit(fmu) if fmu is not None else build(UNIT, folder, kind=kind, everywhere=False)
        finished = run_scenario(chosen, unit, folder / "frames", progress, method=which)
        comparisons = tuple(
            compare(each, unit, folder / f"frames_{number}", progress, which)
            for number, each in enumerate(compared)
        )
    if comparisons:
        onsets = [comparison.onset.summary() for comparison in comparisons]
        finished = replace(finished, summary=finished.summary | {"brake_onset": onsets})
    return ScenarioRun(finished.table, finished.summary, finished, scratch, comparisons)


def _with_changes(given: Scenario | str | Path, seed: int | None, stiffness_n: float | None) -> Scenario:
    """A scenario with another seed and C_x, where they are given."""
    chosen = given if isinstance(given, Scenario) else load_scenario(given)
    if seed is not None:
        chosen = replace(chosen, seed=seed)
    if stiffness_n is not None:
        car = chosen.vehicle.model_dump(by_alias=True)
        car["tyre"]["longitudinal_stiffness_n"] = stiffness_n
        chosen = replace(chosen, vehicle=Vehicle(**car))
    return chosen
