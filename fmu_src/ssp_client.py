"""SSP packages in fmpy: validated against the standard's schemas, and run with the sets that they are bound to."""

from __future__ import annotations

import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import fmpy.ssp
import numpy as np
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, find_components, read_ssd
from lxml import etree
from numpy.typing import NDArray

from .units import STEP_S

SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
SCHEMA_OF = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


def problems(package: Path) -> list[str]:
    """What the schemas of SSP 1.0 find in the package, and sources that are not in it."""
    found = []
    with zipfile.ZipFile(package) as archive:
        names = archive.namelist()
        for name in names:
            schema = SCHEMA_OF.get(Path(name).suffix)
            if schema is None:
                continue
            tree = etree.parse(BytesIO(archive.read(name)))
            checked = etree.XMLSchema(file=str(SCHEMAS / schema))
            checked.validate(tree)
            found += [f"{name}, line {entry.line}: {entry.message}" for entry in checked.error_log]
            sources = (element.get("source") for element in tree.iter())
            found += [
                f"{name}: no '{source}' in the package"
                for source in sources
                if source and source not in names
            ]
    return found


def bound_parameters(package: Path) -> ParameterSet:
    """All bound parameters under their names in the system: fmpy takes them so, and does not follow the bindings."""
    merged = ParameterSet(name="bound")
    for component in find_components(read_ssd(str(package)).system):
        for binding in component.parameterBindings:
            for given in binding.parameterValues:
                for parameter in given.parameters:
                    parameter.name = f"{component.name}.{parameter.name}"
                    merged.parameters.append(parameter)
    return merged


def simulate(package: Path, stop_s: float, step_s: float = STEP_S) -> NDArray[Any]:
    """Run the package in fmpy, whose master steps all units at once and then hands their outputs on.

    Returns
    -------
    structured array
        One row per step: `time` and all connectors, named `element.variable`.
    """
    result = simulate_ssp(
        str(package), stop_time=stop_s, step_size=step_s, parameter_set=bound_parameters(package)
    )
    return np.asarray(result)
