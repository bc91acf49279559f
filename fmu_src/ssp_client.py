"""SSP packages in fmpy: validated against the standard's schemas, and simulated with their bound parameter sets."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import fmpy.ssp
import numpy as np
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, find_components, read_ssd
from lxml import etree
from numpy.typing import NDArray

from scenarios.fmu_client.archives import UnitFileError, opened_archive
from scenarios.fmu_client.unpacking import require_whole
from trpac_core.files import quoted

from .units import STEP_S

SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
EXPECTED = "an SSP package, which is a zip archive"
SCHEMA_OF = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


def problems(package: Path) -> list[str]:
    """Problems of the package by the schemas of SSP 1.0, and sources that are missing in it; raises UnitFileError."""
    found = []
    with opened_archive(package, EXPECTED) as archive:
        names = archive.names
        for name in names:
            schema = SCHEMA_OF.get(Path(name).suffix)
            if schema is None:
                continue
            parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False, load_dtd=False)
            try:
                tree = etree.fromstring(archive.read(name), parser)
            except etree.XMLSyntaxError as error:
                found.append(f"{quoted(name)}: {quoted(error)}")
                continue
            checked = etree.XMLSchema(file=str(SCHEMAS / schema))
            checked.validate(tree)
            found += [f"{quoted(name)}, line {e.line}: {quoted(e.message)}" for e in checked.error_log]
            sources = (element.get("source") for element in tree.iter())
            found += [
                f"{quoted(name)}: no '{quoted(source)}' in the package"
                for source in sources
                if source and source not in names
            ]
    return found


def require_package(package: Path) -> None:
    """Check a package and the units in it; raises UnitFileError where one must not be unpacked."""
    with (
        opened_archive(package, EXPECTED) as archive,
        tempfile.TemporaryDirectory(prefix="trpac_ssp_") as made,
    ):
        if "SystemStructure.ssd" not in archive.names:
            raise UnitFileError(f"{archive.name}: holds no SystemStructure.ssd, expected {EXPECTED}.")
        archive.unpack(Path(made))
        for unit in Path(made).rglob("*.fmu"):
            require_whole(unit)


def bound_parameters(package: Path) -> ParameterSet:
    """All bound parameters under their names in the system, as fmpy expects them, which does not follow the bindings.

    Raises UnitFileError where the package or a unit in it must not be unpacked.
    """
    require_package(package)
    merged = ParameterSet(name="bound")
    for component in find_components(read_ssd(str(package)).system):
        for binding in component.parameterBindings:
            for given in binding.parameterValues:
                for parameter in given.parameters:
                    parameter.name = f"{component.name}.{parameter.name}"
                    merged.parameters.append(parameter)
    return merged


def simulate(package: Path, stop_s: float, step_s: float = STEP_S) -> NDArray[Any]:
    """Results of the package in fmpy, whose master steps all units in parallel and then transfers their outputs.

    Returns
    -------
    structured array
        One row per step: `time` and all connectors, named `element.variable`.

    Raises
    ------
    UnitFileError
        If the package or a unit in it must not be unpacked.
    """
    result = simulate_ssp(
        str(package), stop_time=stop_s, step_size=step_s, parameter_set=bound_parameters(package)
    )
    return np.asarray(result)
