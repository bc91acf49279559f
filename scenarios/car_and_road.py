"""Cars and roads from keyword arguments, from files, and those of the package by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Self

from scenarios.effects import FORMS, Effect
from scenarios.files import RoadFile, VehicleFile
from scenarios.library import located
from scenarios.strict import load_strict, made


class Vehicle(VehicleFile):
    """A car, with the keys of vehicle.yaml; `longitudinal_stiffness_n` [N] may replace the section `tyre`.

    Examples
    --------
    >>> import trpac
    >>> trpac.Vehicle.builtin("four_in_wheel_motor_ev").mass_kg
    1343.8

    Raises
    ------
    TrpacError
        With all problems.
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
        """The shipped car of this name; raises TrpacError."""
        return load_strict(located("vehicle", name), cls)

    def with_effects(self, effects: Sequence[Effect] | Mapping[str, Mapping[str, float]]) -> Vehicle:
        """The car with these effects added, or their parameters replaced."""
        values = self.model_dump(by_alias=True)
        if not isinstance(effects, Mapping):
            values["forms"] |= {e.id: e.form for e in effects if len(FORMS[e.id]) > 1}
            effects = {e.id: {p.name: float(getattr(e, p.name)) for p in e.parameters()} for e in effects}
        values["effects"] |= {name: dict(parameters) for name, parameters in effects.items()}
        return Vehicle(**values)


class Road(RoadFile):
    """A road, with the keys of road.yaml.

    Raises
    ------
    TrpacError
        With all problems.
    """

    def __init__(self, **values: Any) -> None:
        made(partial(super().__init__, **dict[str, Any](schema=1) | values), RoadFile, "Road")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The road of a road.yaml; raises TrpacError."""
        return load_strict(path, cls)

    @classmethod
    def builtin(cls, name: str) -> Self:
        """The shipped road of this name; raises TrpacError."""
        return load_strict(located("road", name), cls)

    @classmethod
    def uniform(cls, mu: float, surface: str = "dry") -> Self:
        """A road of one friction [-] and one surface: dry, wet or snow_ice."""
        return cls(segments=[{"start_m": 0.0, "mu_left": mu, "mu_right": mu, "surface": surface}])


def as_vehicle(given: VehicleFile | str | Path) -> VehicleFile:
    """The car: as given, of a file, or the shipped one of a name."""
    return given if isinstance(given, VehicleFile) else load_strict(located("vehicle", given), Vehicle)


def as_road(given: RoadFile | str | Path) -> RoadFile:
    """The road: as given, of a file, or the shipped one of a name."""
    return given if isinstance(given, RoadFile) else load_strict(located("road", given), Road)
