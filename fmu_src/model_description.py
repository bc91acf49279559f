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

TIME = Variable("time", Kind.REAL, "independent", "continuous", "Time of the simulation", "s")
"""The variable that FMI 3.0 has beside those of a unit."""

TYPES_3 = {Kind.REAL: "Float64", Kind.INTEGER: "Int32", Kind.BOOLEAN: "Boolean", Kind.STRING: "String"}
"""Elements of FMI 3.0."""

CAPABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}

CAPABILITIES_3 = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "canHandleVariableCommunicationStepSize": "true",
}
"""Of a unit of FMI 3.0, which needs no Python."""

OSMP_NAMESPACE = "http://xsd.pmsf.net/OSISensorModelPackaging"
OSMP_VERSION = "1.6.0"
IMAGE_TYPE = "application/octet-stream"
"""JPEG, PNG or raw pixels; the convention asks for a valid MIME type, which image/* with its wildcard is not."""

KNOWN_AT_STEPS: dict[str, str] = {"dependencies": ""}
KNOWN_AT_START: dict[str, str] = {}
"""On what outputs depend: inputs of earlier steps only; at the start on the parameters, which is the meaning of the
missing attribute."""

LOG_CATEGORIES = {
    "logStatusWarning": "An unusable input: the last good estimate is held. Or signals that contradict the parameters.",
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
    root = Element("fmiModelDescription", _general(unit, "2.0", "guid", guid, flat))
    if not sources:
        root.attrib["generationTool"] += " with PythonFMU"
    needs = {"needsExecutionTool": "false"} if sources else {}
    simulation = SubElement(root, "CoSimulation", {"modelIdentifier": unit.name, **CAPABILITIES, **needs})
    if sources:
        files = SubElement(simulation, "SourceFiles")
        for name in sources:
            SubElement(files, "File", {"name": name})
    _definitions(root, unit, variables)
    if any(v.binary for v in variables) and not flat:
        # Without OSI messages in the buffers the annotation names no version of OSI.
        _osmp(SubElement(root, "VendorAnnotations"), "osmp", {"version": OSMP_VERSION})
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _variable(listed, reference, variable, flat)
    structure = SubElement(root, "ModelStructure")
    outputs = [index for index, v in enumerate(variables, start=1) if v.causality == "output"]
    for group, known in (("Outputs", KNOWN_AT_STEPS), ("InitialUnknowns", KNOWN_AT_START)):
        entries = SubElement(structure, group)
        for index in outputs:
            SubElement(entries, "Unknown", {"index": str(index), **known})
    return _document(root)


def model_description_3(
    unit: UnitInfo, variables: Sequence[Variable], token: str, *, flat: bool = False
) -> bytes:
    """The XML text of the description of a unit of C files for FMI 3.0; the same arguments give the same bytes.

    Its variables are those of `model_description`, and `TIME`; without the annotations of binary data, which are a
    convention for FMI 2.0.
    """
    root = Element("fmiModelDescription", _general(unit, "3.0", "instantiationToken", token, flat))
    SubElement(root, "CoSimulation", {"modelIdentifier": unit.name, **CAPABILITIES_3})
    _definitions(root, unit, variables)
    listed = SubElement(root, "ModelVariables")
    for reference, v in enumerate(variables):
        attributes = _attributes(reference, v, flat) | _typed(v)
        start = {"value": attributes.pop("start")} if v.kind is Kind.STRING and v.start is not None else None
        element = SubElement(listed, TYPES_3[v.kind], attributes)
        if start:
            SubElement(element, "Start", start)
    structure = SubElement(root, "ModelStructure")
    outputs = [reference for reference, v in enumerate(variables) if v.causality == "output"]
    for name, known in (("Output", KNOWN_AT_STEPS), ("InitialUnknown", KNOWN_AT_START)):
        for reference in outputs:
            SubElement(structure, name, {"valueReference": str(reference), **known})
    return _document(root)


def build_description(name: str, sources: Sequence[str], options: Sequence[str]) -> bytes:
    """The XML text of buildDescription.xml, by which a host of FMI 3.0 compiles a unit's C files with these options."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": name})
    compiled = {"language": "C99", "compiler": "gcc", "compilerOptions": " ".join(options)}
    files = SubElement(configuration, "SourceFileSet", compiled)
    for source in sources:
        SubElement(files, "SourceFile", {"name": source})
    SubElement(configuration, "Library", {"name": "m", "external": "true"})
    return _document(root)


def _general(unit: UnitInfo, fmi: str, token: str, value: str, flat: bool) -> dict[str, str]:
    return {
        "fmiVersion": fmi,
        "modelName": unit.name,
        token: value,
        "description": unit.description,
        "author": "The TRPAC-FMU authors",
        "version": unit.version,
        "license": "MIT",
        "generationTool": f"TRPAC-FMU {unit.version}",
        "variableNamingConvention": "flat" if flat else "structured",
    }


def _definitions(root: Element, unit: UnitInfo, variables: Sequence[Variable]) -> None:
    """Add units, categories of messages and the default experiment."""
    _units(SubElement(root, "UnitDefinitions"), {v.unit for v in variables if v.unit})
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": description})
    SubElement(
        root,
        "DefaultExperiment",
        {"startTime": "0", "stopTime": f"{unit.stop_time_s:g}", "stepSize": f"{unit.step_size_s:g}"},
    )


def _document(root: Element) -> bytes:
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


def _attributes(reference: int, variable: Variable, flat: bool) -> dict[str, str]:
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
    return attributes


def _typed(variable: Variable) -> dict[str, str]:
    typed = {"unit": variable.unit} if variable.kind is Kind.REAL and variable.unit else {}
    for name, value in (
        ("min", variable.minimum),
        ("max", variable.maximum),
        ("nominal", variable.nominal),
        ("start", variable.start),
    ):
        if value is not None:
            typed[name] = _text(value)
    return typed


def _variable(parent: Element, reference: int, variable: Variable, flat: bool) -> None:
    scalar = SubElement(parent, "ScalarVariable", _attributes(reference, variable, flat))
    SubElement(scalar, variable.kind.value, _typed(variable))
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
