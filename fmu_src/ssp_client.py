"""SSP packages in fmpy: validated against the standard's schemas, and simulated with their bound parameter sets."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.model_description import ModelDescription, read_model_description
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet
from numpy.typing import NDArray

from scenarios.fmu_client.archives import Archive, UnitFileError, opened_archive
from scenarios.fmu_client.unpacking import require_whole
from trpac_core.files import quoted

from .ssp import SSD
from .ssp_parameters import SCHEMA_OF, STRUCTURE, bound_values, require_connected, schema_problems, xml_of
from .units import STEP_S

EXPECTED = "an SSP package, which is a zip archive"


class _Name(str):
    """A parameter's name by whose beginning fmpy finds its element, also beside one of a longer name."""

    __slots__ = ()

    def startswith(self, path: str, *_: Any) -> bool:  # type: ignore[override]
        return super().startswith(f"{path}.")


def problems(package: Path) -> list[str]:
    """Problems of the package by the schemas of SSP 1.0, and sources that are missing in it; raises UnitFileError."""
    with opened_archive(package, EXPECTED) as archive:
        return _problems(archive)


def _problems(archive: Archive) -> list[str]:
    found = []
    for name in archive.names:
        ending = Path(name).suffix
        if ending not in SCHEMA_OF:
            continue
        try:
            tree = xml_of(archive.read(name), name)
        except UnitFileError as error:
            found.append(str(error))
            continue
        found += schema_problems(tree, ending, name)
        sources = (element.get("source") for element in tree.iter(f"{{{SSD}}}*"))
        found += [
            f"{quoted(name)}: no '{quoted(source)}' in the package"
            for source in sources
            if source and source not in archive.names
        ]
    return found


def bound_parameters(package: Path) -> ParameterSet:
    """All bound parameters under their names in the system, as fmpy expects them, which does not follow the bindings.

    Their values have the units and types of their variables (`fmu_src.ssp_parameters`).

    Raises
    ------
    UnitFileError
        If the package or a unit in it must not be unpacked, does not keep the schemas of SSP 1.0, or has a binding,
        set, mapping or connection that cannot be followed.
    """
    with (
        opened_archive(package, EXPECTED) as archive,
        tempfile.TemporaryDirectory(prefix="trpac_ssp_") as made,
    ):
        if STRUCTURE not in archive.names:
            raise UnitFileError(f"{archive.name}: holds no {STRUCTURE}, expected {EXPECTED}.")
        folder = Path(made)
        archive.unpack(folder)
        for unit in folder.rglob("*.fmu"):
            require_whole(unit)
        if found := _problems(archive):
            raise UnitFileError(f"{archive.name}: {found[0].rstrip('.')}. Expected a package of SSP 1.0.")
        structure = xml_of(archive.read(STRUCTURE), STRUCTURE)
        try:
            require_connected(structure)
            values = bound_values(structure, archive.read, lambda source: _description(folder, source))
        except UnitFileError as error:
            raise UnitFileError(f"{archive.name}: {error}") from error
    return ParameterSet(
        name="bound",
        parameters=[
            Parameter(name=_Name(".".join([*path, variable])), value=value)
            for (path, variable), value in values.items()
        ],
    )


def _description(folder: Path, source: str) -> ModelDescription:
    """The description of a unit in an unpacked package; raises UnitFileError."""
    require_whole(folder / source)
    try:
        description = read_model_description(str(folder / source), validate=False)
    except Exception as error:  # fmpy raises a bare Exception here
        raise UnitFileError(
            f"{quoted(source)}: its modelDescription.xml cannot be read ({quoted(error)}). Build the unit again."
        ) from error
    with opened_archive(folder / source) as archive:
        stated = xml_of(archive.read("modelDescription.xml"), source)
    relative = {
        v.get("name")
        for v in stated.iterfind("ModelVariables/ScalarVariable[Real]")
        if v.find("Real").get("relativeQuantity") in ("true", "1")
    }
    for variable in description.modelVariables:
        variable.relativeQuantity = variable.name in relative  # fmpy drops it
    if not description.fmiVersion.startswith("2."):
        raise UnitFileError(
            f"{quoted(source)}: is for FMI {quoted(description.fmiVersion)}; expected 2.0, as in SSP 1.0."
        )
    return description


def simulate(package: Path, stop_s: float, step_s: float = STEP_S) -> NDArray[Any]:
    """Results of the package in fmpy, whose master steps all units in parallel and then transfers their outputs.

    Returns
    -------
    structured array
        One row per step: `time` and all connectors, named `element.variable`.

    Raises
    ------
    UnitFileError
        As from `bound_parameters`.
    """
    result = simulate_ssp(
        str(package), stop_time=stop_s, step_size=step_s, parameter_set=bound_parameters(package)
    )
    return np.asarray(result)
