"""The car of foreign_car.c as a unit for FMI 2.0, its signals file, and logs of it."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pandas as pd
import pytest

from sim2real.own_model.runs import OwnModel, Run
from trpac_core.vehicle import WHEELS

NAME = "ForeignCar"
STARTS = {
    "m": 1343.8,
    "R": 0.29,
    "I_w": 1.2,
    "CdA": 0.65,
    "cr": 0.0065,
    "kx": 15.0,
    "mu": 0.9,
    "sigma": 0.25,
    "h": 0.54,
    "gain": 1.0,
    "v0_kmh": 0.0,
    "x0": 0.0,
    "fail_at": 1e9,
    "nan_at": 1e9,
    "hang_at": 1e9,
}
"""Parameters and their start values."""
OUTPUTS = ("v_kmh", *(f"rpm_{w}" for w in WHEELS), "ax_g", "x_m")
SIGMA = {"wheel_speed": 0.05, "vehicle_speed": 0.02, "accel": 0.05, "position": 0.02}
"""Noise of its sensors, in the log format's units."""

SIGNALS = {
    "schema": 1,
    "inputs": {f"T_{w}": {"signal": f"wheel_torque_{w}_nm"} for w in WHEELS},
    "outputs": {
        "vehicle_speed_m_s": {"column": "v_kmh", "unit": "km/h"},
        "accel_x_m_s2": {"column": "ax_g", "unit": "g"},
        "position_m": "x_m",
        **{f"wheel_speed_{w}_rad_s": {"column": f"rpm_{w}", "unit": "rpm"} for w in WHEELS},
    },
    "initial": {
        "v0_kmh": {"signal": "vehicle_speed_m_s", "unit": "km/h"},
        "x0": {"signal": "position_m"},
    },
    "parameters": {
        "m": {"unit": "kg", "low": 1000.0, "high": 1900.0, "effect": "mass_offset.mass_kg"},
        "CdA": {"unit": "m2", "low": 0.0, "high": 2.0, "effect": "aero_drag.drag_area_m2"},
        "h": {"unit": "m", "low": 0.1, "high": 1.2},
    },
}
"""Its signals file."""


def foreign_unit(folder: Path) -> Path:
    """The unit, compiled into a folder; skips where there is no C compiler on Linux."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs a C compiler on Linux")
    library, source = folder / f"{NAME}.so", Path(__file__).with_name("foreign_car.c")
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        [compiler, "-O2", "-shared", "-fPIC", "-I", headers, "-o", library, source, "-lm"], check=True
    )
    target = folder / f"{NAME}.fmu"
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("modelDescription.xml", _description())
        archive.write(library, f"binaries/linux64/{NAME}.so")
    return target


def _description() -> str:
    lines = []
    for number, (name, causality) in enumerate(
        [
            *((f"T_{w}", "input") for w in WHEELS),
            *((n, "output") for n in OUTPUTS),
            *((n, "parameter") for n in STARTS),
        ]
    ):
        start = "" if causality == "output" else f' start="{STARTS.get(name, 0.0)}"'
        kind = "tunable" if causality == "parameter" else "continuous"
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{number}" causality="{causality}" variability="{kind}">'
            f"<Real{start}/></ScalarVariable>"
        )
    outputs = "".join(f'<Unknown index="{5 + i}"/>' for i in range(len(OUTPUTS)))
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="{NAME}" guid="foreign">'
        f'<CoSimulation modelIdentifier="{NAME}" canHandleVariableCommunicationStepSize="true"/>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables>"
        f"<ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{outputs}</InitialUnknowns></ModelStructure>"
        "</fmiModelDescription>"
    )


def torques(seconds: float, scale: float = 1.0, rate_hz: float = 100.0) -> np.ndarray:
    """Drive, coast and brake in turn, the same at all wheels, shape (n,) [N m]."""
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    points = (
        (0.0, 0),
        (0.5, 0),
        (0.7, 220),
        (1.9, 220),
        (2.1, 0),
        (2.7, 0),
        (2.9, -200),
        (4.0, -200),
        (4.2, 0),
    )
    at, value = zip(*points, strict=True)
    return scale * np.interp(time_s % 4.5, at, value)


def command(seconds: float, speed_m_s: float, scale: float = 1.0, rate_hz: float = 100.0) -> pd.DataFrame:
    """A log that holds a torque and a beginning, for the unit to be run over."""
    torque = torques(seconds, scale, rate_hz)
    time_s = np.arange(len(torque)) / rate_hz
    columns = {"time_s": time_s, **{f"wheel_torque_{w}_nm": torque for w in WHEELS}}
    columns |= {f"wheel_speed_{w}_rad_s": np.full(len(torque), speed_m_s / 0.29) for w in WHEELS}
    columns |= {"vehicle_speed_m_s": np.full(len(torque), speed_m_s), "accel_x_m_s2": np.zeros(len(torque))}
    return pd.DataFrame(columns | {"position_m": speed_m_s * time_s})


def recorded(own: OwnModel, run: Run, seed: int) -> pd.DataFrame:
    """What the car's sensors read of a run, with noise, at the rows of the run's log."""
    ((part, *more),) = own.simulate([run])
    assert not more, "logs are recorded in one go: take `initial` out of the signals file"
    made, rng = part.log, np.random.default_rng(seed)
    columns = {"time_s": run.log.time_s}
    for name, values in made.signals.items():
        plain = np.interp(run.log.time_s, made.time_s, values)
        sigma = next((s for part, s in SIGMA.items() if name.startswith(part)), 0.0)
        columns[name] = plain + sigma * rng.standard_normal(len(plain))
    return pd.DataFrame(columns)
