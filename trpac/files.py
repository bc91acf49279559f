"""Cars, roads and logs: from Python, from files, and those that come with the package by their names."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Self

import pandas as pd

from scenarios.effects import FORMS, Effect
from scenarios.files import RoadFile, SensorNoise, VehicleFile, load_scenario
from scenarios.library import located, shipped
from scenarios.strict import load_strict, made
from sim2real.logs import Log, load_mapping, log_of_frame
from sim2real.logs import read_log as _read_log
from sim2real.logs.mapping import Mapping
from trpac.extras import extras

__all__ = [
    "Log",
    "Road",
    "SensorNoise",
    "Vehicle",
    "list_effects",
    "list_roads",
    "list_scenarios",
    "list_vehicles",
    "read_log",
]


class Vehicle(VehicleFile):
    """A car, with the keys of vehicle.yaml; `longitudinal_stiffness_n` stands for a tyre section [N].

    Examples
    --------
    >>> import trpac
    >>> trpac.Vehicle.builtin("four_in_wheel_motor_ev").mass_kg
    1343.8

    Raises
    ------
    TrpacError
        With all that is wrong.
    """

    def __init__(self, **values: Any) -> None:
        if "longitudinal_stiffness_n" in values:
            stiffness_n = values.pop("longitudinal_stiffness_n")
            values["tyre"] = {"model": "modified_dugoff", "longitudinal_stiffness_n": stiffness_n}
        made(
            partial(super().__init__, **dict[str, Any](schema=1, name="car") | values), VehicleFile, "Vehicle"
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The car of a vehicle.yaml; raises TrpacError."""
        return load_strict(path, cls)

    @classmethod
    def builtin(cls, name: str) -> Self:
        """The car of this name that comes with the package; raises TrpacError."""
        return load_strict(located("vehicle", name), cls)

    def with_effects(self, effects: Sequence[Effect] | MappingOf[str, MappingOf[str, float]]) -> Vehicle:
        """The car with further effects, or with other parameters of those that it has."""
        values = self.model_dump(by_alias=True)
        if not isinstance(effects, MappingOf):
            values["forms"] |= {e.id: e.form for e in effects if len(FORMS[e.id]) > 1}
            effects = {e.id: {p.name: float(getattr(e, p.name)) for p in e.parameters()} for e in effects}
        values["effects"] |= {name: dict(parameters) for name, parameters in effects.items()}
        return Vehicle(**values)


class Road(RoadFile):
    """A road, with the keys of road.yaml.

    Raises
    ------
    TrpacError
        With all that is wrong.
    """

    def __init__(self, **values: Any) -> None:
        made(partial(super().__init__, **dict[str, Any](schema=1) | values), RoadFile, "Road")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The road of a road.yaml; raises TrpacError."""
        return load_strict(path, cls)

    @classmethod
    def builtin(cls, name: str) -> Self:
        """The road of this name that comes with the package; raises TrpacError."""
        return load_strict(located("road", name), cls)

    @classmethod
    def uniform(cls, mu: float, surface: str = "dry") -> Self:
        """A road of one friction [-] and one surface: dry, wet or snow_ice."""
        return cls(segments=[{"start_m": 0.0, "mu_left": mu, "mu_right": mu, "surface": surface}])


def the_vehicle(given: VehicleFile | str | Path) -> VehicleFile:
    """The car that is meant: itself, that of a file, or a shipped one by its name."""
    return given if isinstance(given, VehicleFile) else load_strict(located("vehicle", given), Vehicle)


def the_road(given: RoadFile | str | Path) -> RoadFile:
    """The road that is meant: itself, that of a file, or a shipped one by its name."""
    return given if isinstance(given, RoadFile) else load_strict(located("road", given), Road)


def read_log(log: Log | pd.DataFrame | str | Path, *, mapping: Mapping | str | Path | None = None) -> Log:
    """The log of a file (CSV, Parquet, MDF) or of a table in memory, in the names and units of the log format.

    Parameters
    ----------
    log : path or DataFrame
        A log that has been read is given back as it is.
    mapping : path, optional
        How its columns become those of the log format.

    Raises
    ------
    TrpacError
        With all that is wrong.
    """
    if isinstance(log, Log):
        return log
    columns = mapping if mapping is None or isinstance(mapping, Mapping) else load_mapping(mapping)
    with extras("read_log"):
        return log_of_frame(log, columns) if isinstance(log, pd.DataFrame) else _read_log(log, columns)


def list_effects() -> pd.DataFrame:
    """All effects that the plant models and a diagnosis may name, one row per form and parameter."""
    rows = [
        (effect_id, kind.form, kind.stage, kind.subsystem, p.name, p.unit, p.meaning, kind.equation)
        for effect_id, forms in FORMS.items()
        for kind in forms
        for p in kind.parameters()
    ]
    columns = ["effect", "form", "stage", "subsystem", "parameter", "unit", "meaning", "equation"]
    return pd.DataFrame(rows, columns=columns)


def list_scenarios() -> pd.DataFrame:
    """The scenarios that come with the package: name, title, description, and what each is made of."""
    found = {name: load_scenario(path) for name, path in shipped("scenario").items()}
    rows = [
        (name, s.name, s.description, s.vehicle.name, s.manoeuvre.name, s.end.time_s)
        for name, s in found.items()
    ]
    return pd.DataFrame(rows, columns=["name", "title", "description", "vehicle", "manoeuvre", "end_s"])


def list_vehicles() -> pd.DataFrame:
    """The cars that come with the package, one row each."""
    cars = {name: load_strict(path, VehicleFile) for name, path in shipped("vehicle").items()}
    rows = [(name, car.name, car.mass_kg, car.wheelbase_m, car.wheel_radius_m) for name, car in cars.items()]
    return pd.DataFrame(rows, columns=["name", "title", "mass_kg", "wheelbase_m", "wheel_radius_m"])


def list_roads() -> pd.DataFrame:
    """The roads that come with the package, one row per stretch."""
    rows = [
        (name, s.start_m, s.mu_left, s.mu_right, s.surface)
        for name, path in shipped("road").items()
        for s in load_strict(path, RoadFile).segments
    ]
    return pd.DataFrame(rows, columns=["name", "start_m", "mu_left", "mu_right", "surface"])
