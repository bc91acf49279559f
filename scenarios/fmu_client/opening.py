"""An unpacked unit instantiated in this process, through fmpy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

from scenarios.fmu_client.archives import UnitFileError
from trpac_core.files import quoted


def opened_unit(archive: Path, folder: Path, expected: Sequence[str], instance: str) -> tuple[FMU2Slave, Any]:
    """A unit as a host gets it, before its experiment is set up.

    Parameters
    ----------
    archive, folder : Path
        The unit, for messages, and where `unpack_unit` put it.
    expected : sequence of str
        Units that will do.
    instance : str
        What to call the instance.

    Returns
    -------
    FMU2Slave, ModelDescription
        The instance, and fmpy's reading of its description.

    Raises
    ------
    UnitFileError
        If the description cannot be read, tells of another unit, or the unit cannot be instantiated here.
    """
    try:
        description = read_model_description(str(folder))
        name = description.coSimulation.modelIdentifier
    except (OSError, ValueError, AttributeError, ParseError) as error:
        raise UnitFileError(f"{quoted(archive)}: not a co-simulation unit ({quoted(error)}).") from error
    if name not in expected:
        raise UnitFileError(f"{quoted(archive)}: is {quoted(name)}; expected {' or '.join(expected)}.")
    unit = FMU2Slave(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier=name, instanceName=instance
    )
    try:
        unit.instantiate()
    except Exception as error:  # fmpy raises a bare Exception here
        raise UnitFileError(f"{quoted(archive)}: cannot be instantiated ({quoted(error)}).") from error
    return unit, description
