"""modelDescription.xml of a unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from trpac_core.parameters.variables import Kind, Variable

UNITS: dict[str, dict[str, int] | None] = {
    "1": {},
    "px": {},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "1/m0.5": None,
    "m/s1.5": None,
    "m2": {"m": 2},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
}
"""Units by name, as exponents of the SI base units with factor 1; None where FMI cannot express them."""

CAPABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}

OSMP_NAMESPACE = "http://xsd.pmsf.net/OSISensorModelPackaging"
OSMP_VERSION = "1.6.0"
IMAGE_TYPE = "application/octet-stream"
"""JPEG, PNG or raw pixels; the convention asks for a valid MIME type, which image/* with its wildcard is not."""

LOG_CATEGORIES = {
    "logStatusWarning": "An unusable input: the last good estimate is held; or a car that is not as told.",
    "logStatusError": "A parameter, a call or a state that could not be used.",
}


@dataclass(frozen=True)
class UnitInfo:
    """General attributes of a unit."""

    name: str
    description: str
    version: str
    step_size_s: float
    stop_time_s: float


def model_description(
    unit: UnitInfo,
    variables: Sequence[Variable],
    guid: str,
    *,
    flat: bool = False,
    sources: Sequence[str] = (),
) -> bytes:
    """The XML text of a unit's description; the same arguments give the same bytes.

    With `flat` names consist of letters, digits and underscores, for tools that make structures of dotted names; the
    annotations of binary data are then left out. With `sources` it is a unit of these C files, which needs no Python.
    """
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": unit.name,
            "guid": guid,
            "description": unit.description,
            "author": "The TRPAC-FMU authors",
            "version": unit.version,
            "license": "MIT",
            "generationTool": f"TRPAC-FMU {unit.version}" + ("" if sources else " with PythonFMU"),
            "variableNamingConvention": "flat" if flat else "structured",
        },
    )
    needs = {"needsExecutionTool": "false"} if sources else {}
    simulation = SubElement(root, "CoSimulation", {"modelIdentifier": unit.name, **CAPABILITIES, **needs})
    if sources:
        files = SubElement(simulation, "SourceFiles")
        for name in sources:
            SubElement(files, "File", {"name": name})
    _units(SubElement(root, "UnitDefinitions"), {v.unit for v in variables if v.unit})
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": description})
    SubElement(
        root,
        "DefaultExperiment",
        {"startTime": "0", "stopTime": f"{unit.stop_time_s:g}", "stepSize": f"{unit.step_size_s:g}"},
    )
    if any(v.binary for v in variables) and not flat:
        # Without OSI messages in the buffers the annotation names no version of OSI.
        _osmp(SubElement(root, "VendorAnnotations"), "osmp", {"version": OSMP_VERSION})
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _variable(listed, reference, variable, flat)
    structure = SubElement(root, "ModelStructure")
    outputs = [index for index, v in enumerate(variables, start=1) if v.causality == "output"]
    for group in ("Outputs", "InitialUnknowns"):
        entries = SubElement(structure, group)
        # Outputs depend on inputs of earlier steps only. At the start they depend on the parameters, which is the
        # meaning of the missing attribute.
        known = {"dependencies": ""} if group == "Outputs" else {}
        for index in outputs:
            SubElement(entries, "Unknown", {"index": str(index), **known})
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, "utf-8") + b"\n"


def _units(parent: Element, names: set[str]) -> None:
    for name in sorted(names):
        unit, exponents = SubElement(parent, "Unit", {"name": name}), UNITS[name]
        if exponents is not None:
            SubElement(unit, "BaseUnit", {key: str(value) for key, value in exponents.items()})


def flat_name(name: str) -> str:
    """A variable's name in a flat unit."""
    return name.replace(".", "_")


def _variable(parent: Element, reference: int, variable: Variable, flat: bool) -> None:
    attributes = {
        "name": flat_name(variable.name) if flat else variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "output":
        attributes["initial"] = "calculated"
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    typed: dict[str, str] = {}
    if variable.kind is Kind.REAL and variable.unit:
        typed["unit"] = variable.unit
    for name, value in (
        ("min", variable.minimum),
        ("max", variable.maximum),
        ("nominal", variable.nominal),
        ("start", variable.start),
    ):
        if value is not None:
            typed[name] = _text(value)
    scalar = SubElement(parent, "ScalarVariable", attributes)
    SubElement(scalar, variable.kind.value, typed)
    if variable.binary and not flat:
        role = variable.name.removeprefix(f"{variable.binary}.")
        binary = {"name": variable.binary, "role": role, "mime-type": IMAGE_TYPE}
        _osmp(SubElement(scalar, "Annotations"), "osmp-binary-variable", binary)


def _osmp(parent: Element, element: str, attributes: dict[str, str]) -> None:
    """Add an annotation of the OSI Sensor Model Packaging, the convention for binary data over FMI 2.0."""
    tool = SubElement(parent, "Tool", {"name": "net.pmsf.osmp", "xmlns:osmp": OSMP_NAMESPACE})
    SubElement(tool, f"osmp:{element}", attributes)


def _text(value: float | bool | str) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
