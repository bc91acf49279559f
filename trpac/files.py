"""Logs from files and tables, and tables of what is shipped with the package."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from scenarios.effects import FORMS
from scenarios.files import RoadFile, VehicleFile, load_scenario
from scenarios.library import shipped
from scenarios.strict import load_strict
from sim2real.logs import Log, load_mapping, log_of_frame
from sim2real.logs import read_log as _read_log
from sim2real.logs.mapping import Mapping
from sim2real.logs.read import DbcFiles
from trpac.extras import extras


def read_log(
    log: Log | pd.DataFrame | str | Path,
    *,
    mapping: Mapping | str | Path | None = None,
    dbc: DbcFiles = None,
) -> Log:
    """The log of a file or of a table in memory, in the names and units of the log format.

    Parameters
    ----------
    log : path or DataFrame
        A Log is returned unchanged.
    mapping : path, optional
        Its columns in the log format.
    dbc : path or sequence of paths, optional
        DBC files that say what the frames of a bus mean.

    Raises
    ------
    TrpacError
        With all problems.
    """
    if isinstance(log, Log):
        return log
    columns = mapping if mapping is None or isinstance(mapping, Mapping) else load_mapping(mapping)
    with extras("read_log"):
        return log_of_frame(log, columns) if isinstance(log, pd.DataFrame) else _read_log(log, columns, dbc)


def list_effects() -> pd.DataFrame:
    """A table of all effects of the plant and the diagnosis, one row per form and parameter."""
    rows = [
        (effect_id, kind.form, kind.stage, kind.subsystem, p.name, p.unit, p.meaning, kind.equation)
        for effect_id, forms in FORMS.items()
        for kind in forms
        for p in kind.parameters()
    ]
    columns = ["effect", "form", "stage", "subsystem", "parameter", "unit", "meaning", "equation"]
    return pd.DataFrame(rows, columns=columns)


def list_scenarios() -> pd.DataFrame:
    """A table of the shipped scenarios: name, title, description, vehicle, manoeuvre and end."""
    found = {name: load_scenario(path) for name, path in shipped("scenario").items()}
    rows = [
        (name, s.name, s.description, s.vehicle.name, s.manoeuvre.name, s.end.time_s)
        for name, s in found.items()
    ]
    return pd.DataFrame(rows, columns=["name", "title", "description", "vehicle", "manoeuvre", "end_s"])


def list_vehicles() -> pd.DataFrame:
    """A table of the shipped cars."""
    cars = {name: load_strict(path, VehicleFile) for name, path in shipped("vehicle").items()}
    rows = [(name, car.name, car.mass_kg, car.wheelbase_m, car.wheel_radius_m) for name, car in cars.items()]
    return pd.DataFrame(rows, columns=["name", "title", "mass_kg", "wheelbase_m", "wheel_radius_m"])


def list_roads() -> pd.DataFrame:
    """A table of the shipped roads, one row per stretch."""
    rows = [
        (name, s.start_m, s.mu_left, s.mu_right, s.surface)
        for name, path in shipped("road").items()
        for s in load_strict(path, RoadFile).segments
    ]
    return pd.DataFrame(rows, columns=["name", "start_m", "mu_left", "mu_right", "surface"])
