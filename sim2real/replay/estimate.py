"""From a log to a finished replay: what `trpac estimate` does."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.files import VehicleFile
from scenarios.known import interval, is_known, is_lower_bound
from scenarios.library import PAPER_VEHICLE, networks_folder, shipped
from sim2real.logs import Log
from sim2real.replay.camera import camera_side
from sim2real.replay.inputs import make_inputs
from sim2real.replay.run import Replay, Told, replay, silent
from sim2real.replay.score import errors, excitation
from trpac_core.estimator_data import Method, Source
from trpac_core.files import file_sha256
from trpac_core.vision.camera import Camera

TABLE_3 = shipped("vehicle")[PAPER_VEHICLE]
"""The car that is assumed where none is given."""
PACKAGES = ("trpac-fmu", "numpy", "scipy")


def estimate_log(
    read: Log,
    car: VehicleFile,
    lens: Camera | None = None,
    peers: bool = False,
    told: Told = silent,
    *,
    guessed: bool = False,
    vehicle_path: Path | None = None,
    method: Method = Method.ROBUST,
) -> tuple[Replay, dict[str, Any]]:
    """Run the estimators along a log.

    Parameters
    ----------
    read, car, lens : Log, VehicleFile, Camera or None
        The log; the car; the camera, for logs with pictures.
    peers : bool
        Whether the estimators of the literature run as well.
    told : callable
        Told the stage, and how much of how much is done.
    guessed : bool
        Whether the car is an assumption.
    vehicle_path : Path, optional
        File of the car.
    method : Method
        Of our estimator.

    Returns
    -------
    Replay, dict
        All estimates, and what summary.json holds.

    Raises
    ------
    ScenarioError
        Unusable input, with everything that is wrong with a file.
    """
    inputs = make_inputs(read, car)
    seen = camera_side(
        read, inputs, car, lens, networks_folder(), lambda done, total: told("pictures", done, total)
    )
    done = replay(inputs, seen, peers, told, method)
    apart = (f"{inputs.contradiction} The estimate cannot be trusted.",) if inputs.contradiction else ()
    assumed = (
        f"no vehicle file was given (--vehicle): the car is assumed to be {car.name} of {TABLE_3.name}.",
    )
    summary = {
        "schema": 1,
        "log": {
            "name": read.name,
            "path": str(read.path),
            "sha256": read.sha256,
            "rate_hz": read.rate_hz,
            "rows": len(read),
            "read_as": read.read_as,
        },
        "vehicle": {
            "name": car.name,
            "path": None if vehicle_path is None else str(vehicle_path),
            "sha256": None if vehicle_path is None else file_sha256(vehicle_path),
        },
        "method": method.label,
        "camera": seen.source,
        "noise": {
            "wheel_speed_rad_s": inputs.noise.wheel_speed_rad_s,
            "vehicle_speed_m_s": inputs.noise.vehicle_speed_m_s,
        },
        "excitation": excitation(done),
        "estimate": _outcome(done),
        "errors": errors(done),
        "torque_fits_car": not apart,
        "warnings": [
            *apart,
            *(assumed if guessed else ()),
            *inputs.warnings,
            *seen.warnings,
            *done.messages,
        ],
        "versions": {name: version(name) for name in PACKAGES},
    }
    return done, summary


def _outcome(done: Replay) -> dict[str, float | str | None]:
    """The car's estimate at the end, and how sure it was where the tyre was seen."""
    theta, std, peak = done.ours.of_the_car
    moving = done.inputs.moving
    seen = done.seen.any(axis=1) & moving
    of_the_car = done.of_the_car["TRPAC_low"], done.of_the_car["TRPAC_high"]
    judged = theta, *interval(done.method, theta, std, *of_the_car), done.source_of_the_car
    return {
        "TRPAC_end": float(theta[-1]),
        "TRPAC_std_end": float(std[-1]),
        "TRPAC_peak_end": float(peak[-1]),
        **{f"{name}_end": float(values[-1]) for name, values in done.of_the_car.items()},
        "TRPAC_source_end": Source(int(done.source_of_the_car[-1])).label,
        "mean_std_seen": float(std[seen].mean()) if seen.any() else None,
        "known_share": float(np.mean(is_known(*judged)[moving])),
        "lower_bound_share": float(np.mean(is_lower_bound(*judged)[moving])),
        "mean_std": float(std[moving].mean()),
    }
