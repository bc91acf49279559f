"""A unit of any maker, opened: its archive unpacked, its variables known, the signals file held against them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from scenarios.errors import ScenarioError, suggestion
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.unpacking import unpack_unit
from sim2real.own_model.signals import Signals
from trpac_core.files import file_sha256, quoted

NUMBERS = ("Real", "Integer", "Boolean", "Float64", "Float32", "Int64", "Int32", "Int16", "Int8")
"""Types of variables, of FMI 2.0 and 3.0, that a signal can be read from."""
REALS = ("Real", "Float64", "Float32")
"""Types of variables that a signal can be written to."""
MOST_NAMES = 40
"""Names of variables that a message lists at most."""


@dataclass(frozen=True)
class OpenedUnit:
    """A co-simulation unit that lies unpacked.

    Attributes
    ----------
    path, folder : Path
        Its archive, and where it is unpacked.
    sha256 : str
        Of the archive.
    variables : dict
        Name to fmpy's description of each variable.
    """

    path: Path
    folder: Path
    sha256: str
    variables: dict[str, Any]

    def start_of(self, name: str) -> float:
        """Start value of a numeric parameter by the unit's description; raises ScenarioError where it has none."""
        start = self.variables[name].start
        try:
            return float(start)
        except (TypeError, ValueError):
            raise ScenarioError(
                f"{quoted(self.path)}: {quoted(name)} has the start value {quoted(start)}; expected a number. Say "
                "`nominal:` in the signals file."
            ) from None


@contextmanager
def opened_unit(path: Path, signals: Signals) -> Iterator[OpenedUnit]:
    """The unit unpacked to a temporary folder, which is removed at the end.

    Raises
    ------
    ScenarioError
        It is no unit for co-simulation, or lacks what the signals file names; with all problems.
    """
    from fmpy import read_model_description

    try:
        folder = unpack_unit(path)
    except UnitFileError as error:
        raise ScenarioError(str(error)) from error
    try:
        try:
            description = read_model_description(str(folder))
        except (OSError, ValueError, AttributeError, ParseError) as error:
            raise ScenarioError(
                f"{quoted(path)}: modelDescription.xml cannot be read ({quoted(error)})."
            ) from error
        if description.coSimulation is None:
            raise ScenarioError(
                f"{quoted(path)}: is for model exchange alone; expected co-simulation. Export it so from your tool."
            )
        unit = OpenedUnit(path, folder, file_sha256(path), {v.name: v for v in description.modelVariables})
        if problems := _problems(unit, signals):
            raise ScenarioError("\n".join(f"{quoted(signals.path)}: {text}" for text in problems))
        yield unit
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _problems(unit: OpenedUnit, signals: Signals) -> list[str]:
    """What the signals file names that the unit does not have, or not so."""
    wanted = [
        *(("inputs", name, REALS, ("input",)) for name in signals.inputs),
        *(("outputs", name, NUMBERS, None) for name in signals.read),
        *(
            ("initial", name, REALS, ("parameter", "structuralParameter", "input", "local", "output"))
            for name in signals.initial
        ),
        *(
            ("start", name, None, ("parameter", "structuralParameter", "input", "local", "output"))
            for name in signals.start
        ),
        *(("parameters", name, REALS, ("parameter", "structuralParameter")) for name in signals.parameters),
    ]
    problems = []
    for part, name, types, causalities in wanted:
        variable = unit.variables.get(name)
        if variable is None:
            like = [n for n, v in unit.variables.items() if causalities is None or v.causality in causalities]
            problems.append(
                f"{part}: the unit has no variable {name!r}; {suggestion(name, like[:MOST_NAMES])}"
            )
        elif types is not None and variable.type not in types:
            problems.append(
                f"{part}: {name!r} is {variable.type}; expected {' or '.join(dict.fromkeys(types))}."
            )
        elif causalities is not None and variable.causality not in causalities:
            problems.append(f"{part}: {name!r} is {variable.causality}; expected {causalities[0]}.")
    for name, tunable in signals.parameters.items():
        if name in unit.variables and name in signals.start and tunable.nominal is None:
            continue
        if name in unit.variables and tunable.nominal is None:
            try:
                nominal = unit.start_of(name)
            except ScenarioError as error:
                problems.append(str(error))
                continue
            if not tunable.low <= nominal <= tunable.high:
                problems.append(
                    f"parameters: {name!r} starts at {nominal:g} in the unit; expected low {tunable.low:g} to high "
                    f"{tunable.high:g} to hold it, or `nominal:`."
                )
    return problems
