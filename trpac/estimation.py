"""The estimator over a recorded drive."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.camera.files import load_camera
from scenarios.car_and_road import as_vehicle
from scenarios.files import VehicleFile
from scenarios.library import located
from scenarios.progress import StageProgress, silent
from sim2real.logs import Log
from sim2real.logs.mapping import Mapping
from sim2real.logs.read import DbcFiles
from sim2real.replay.estimate import TABLE_3, estimate_log
from sim2real.replay.run import Replay
from trpac.extras import extras
from trpac.files import read_log
from trpac.picture import Picture
from trpac_core.estimator_data import Method


@dataclass(frozen=True, repr=False)
class Estimates:
    """Estimates along a drive.

    Attributes
    ----------
    frame : DataFrame
        time_s [s]; TRPAC, TRPAC_std and TRPAC_peak of the car [-], TRPAC and TRPAC_std of each wheel [-]; flag, K_v,
        excitation_flag; TRPAC_low, TRPAC_high, TRPAC_source of the car and of each wheel; TRPAC_expected and its
        deviation of the car [-].
    summary : dict
        Content of summary.json of `trpac estimate`.
    """

    frame: pd.DataFrame
    summary: dict[str, Any]
    _replay: Replay

    def __repr__(self) -> str:
        return f"Estimates over {len(self.frame)} rows: {self.verdict}"

    def _repr_html_(self) -> str:
        return self.frame.describe().loc[["mean", "min", "max"]].to_html()

    @property
    def verdict(self) -> str:
        """Results of the drive in sentences."""
        from sim2real.replay.report import verdict

        return verdict(self.summary)

    @property
    def warnings(self) -> list[str]:
        """Warnings about the log in sentences."""
        return list(self.summary["warnings"])

    def plot(self) -> Picture:
        """A figure of the car's estimate with its deviation or interval, the flags and the drive."""
        from scenarios.plots import png
        from sim2real.replay.figures import estimate

        return Picture(png(estimate(self._replay)))

    def to_html(self, path: str | Path) -> Path:
        """Write the report; returns its path."""
        from sim2real.replay.report import render

        Path(path).write_text(render(self._replay, self.summary), encoding="utf-8")
        return Path(path)

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write report.html, estimates.csv and summary.json; returns their paths."""
        from sim2real.replay.report import write_replay

        return write_replay(self._replay, self.summary, Path(folder))


def estimate(
    log: Log | pd.DataFrame | str | Path,
    vehicle: VehicleFile | str | Path | None = None,
    *,
    mapping: Mapping | str | Path | None = None,
    dbc: DbcFiles = None,
    camera: str | Path | None = None,
    peers: bool = False,
    method: str = "robust",
    progress: StageProgress = silent,
) -> Estimates:
    """Estimates of the road's adhesion along a recorded drive.

    Parameters
    ----------
    log : DataFrame or path
        Columns of the log format (docs/guide/logs.md), or those that the mapping names.
    vehicle : Vehicle, path or name, optional
        The car; by default that of the paper (Table 3), with a warning.
    mapping, camera : path, optional
        Columns of the log in the log format; the camera of the pictures in column image_path.
    dbc : path or sequence of paths, optional
        DBC files that say what the frames of a bus mean.
    peers : bool
        Whether to run estimators of the literature as well.
    method : str
        Estimator: as_printed, dife or robust (docs/theory/methods.md).
    progress : callable
        Called with the stage, and how many of how many of its items are done.

    Raises
    ------
    TrpacError
        With all problems.
    MissingExtraError
        Without the extra of the log's format or of the peers.
    """
    from sim2real.replay.report import estimates_table

    chosen = Method.of(method)
    progress("reading", 0, 1)
    origin = TABLE_3 if vehicle is None else vehicle
    car, lens = as_vehicle(origin), None if camera is None else load_camera(camera)
    read = read_log(log, mapping=mapping, dbc=dbc)
    progress("reading", 1, 1)
    with extras("estimate"):
        replay, summary = estimate_log(
            read,
            car,
            lens,
            peers,
            progress,
            guessed=vehicle is None,
            vehicle_path=None if isinstance(origin, VehicleFile) else located("vehicle", origin),
            method=chosen,
        )
    for text in summary["warnings"]:
        logging.getLogger("trpac").warning("%s: %s", read.name, text)
    return Estimates(estimates_table(replay), summary, replay)
