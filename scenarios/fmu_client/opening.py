"""Units instantiated in this process through fmpy."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.files import quoted


def opened_unit(archive: Path, folder: Path, expected: Sequence[str], instance: str) -> tuple[FMU2Slave, Any]:
    """An instance of an unpacked unit before its experiment is set up, and its description.

    Returns
    -------
    FMU2Slave, ModelDescription
        The instance, and its description by fmpy.

    Raises
    ------
    UnitFileError
        If the description cannot be read or is of another unit or of FMI 3.0, or the unit cannot be instantiated here.
    """
    try:
        description = read_model_description(str(folder))
        name = description.coSimulation.modelIdentifier
    except (OSError, ValueError, AttributeError, ParseError) as error:
        raise UnitFileError(f"{quoted(archive)}: not a co-simulation unit ({quoted(error)}).") from error
    if name not in expected:
        raise UnitFileError(f"{quoted(archive)}: is {quoted(name)}; expected {' or '.join(expected)}.")
    if description.fmiVersion != "2.0":
        raise UnitFileError(
            f"{quoted(archive)}: is for FMI {quoted(description.fmiVersion)}; expected a unit for FMI 2.0."
        )
    unit = FMU2Slave(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier=name, instanceName=instance
    )
    try:
        unit.instantiate()
    except Exception as error:  # fmpy raises a bare Exception here
        raise UnitFileError(f"{quoted(archive)}: cannot be instantiated ({quoted(error)}).") from error
    return unit, description


class Instance:
    """An initialised instance of a unit, with variables by name.

    `native` tells whether it is a unit in C: it needs no other tool, and has no networks for pictures.
    """

    def __init__(self, slave: FMU2Slave, description: Any, parameters: Mapping[str, float | str]) -> None:
        self.slave, self.variables = slave, description.modelVariables
        self.native = not description.coSimulation.needsExecutionTool
        self._variables = {v.name: (v.valueReference, v.type) for v in self.variables}
        slave.setupExperiment(startTime=0.0)
        self.set(parameters)
        slave.enterInitializationMode()
        slave.exitInitializationMode()

    def references(self, names: Iterable[str]) -> list[int]:
        """Value references of variables."""
        return [self._variables[name][0] for name in names]

    def set(self, values: Mapping[str, float | str]) -> None:
        """Set variables of any type."""
        for name, value in values.items():
            reference, kind = self._variables[name]
            getattr(self.slave, f"set{kind}")([reference], [value])

    def get(self, name: str) -> float:
        """Value of a numeric variable."""
        reference, kind = self._variables[name]
        return float(getattr(self.slave, f"get{kind}")([reference])[0])


@contextmanager
def opened(archive: Path, unit: str, parameters: Mapping[str, float | str]) -> Iterator[Instance]:
    """An instance of a unit from its file, freed at the end of the context; raises UnitFileError."""
    folder = unpack_unit(archive)
    try:
        slave, description = opened_unit(archive, folder, [unit], unit)
        try:
            yield Instance(slave, description, parameters)
        finally:
            slave.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
