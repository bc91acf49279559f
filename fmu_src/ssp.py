"""Systems of units as SSP 1.0 packages: connections and parameter sets."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from trpac_core.parameters.variables import Kind, Variable
from trpac_core.vehicle import WHEELS

from .interface_4w import TRPAC_ESTIMATOR_4W
from .interface_plant import REFERENCE_PLANT
from .kinds import NATIVE, PYTHON, build, known_units
from .packaging import BuildError, write_archive
from .units import STEP_S, UNITS

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OSP_ANNOTATION = "com.opensimulationplatform"
"""Annotation from which Open Simulation Platform's tools read the step size."""
SSP_VERSION = "1.0"
STOP_S = 10.0
"""End of the simulation, when the car has crossed both borders of the paper's road [s]."""

PLANT, ESTIMATOR, DRIVER = "plant", "estimator", "driver"

SHOWN = ("TRPAC", "TRPAC_std", "flag", "K_v", "tyre_force")
"""Outputs of the estimator that a tool records."""

Value = float | int | bool | str


@dataclass(frozen=True)
class Wiring:
    """One system of units.

    Parameters
    ----------
    name : str
        Of the system, and of the package's file.
    description : str
        One sentence.
    elements : mapping
        Units by their names in the system, in the order of their steps.
    connections : tuple
        (element, output, element, input).
    shown : tuple
        (element, output) that are not connected and that a tool records.
    sets : mapping
        Parameter sets by name, each with the elements that it is bound to and its values.
    """

    name: str
    description: str
    elements: Mapping[str, str]
    connections: tuple[tuple[str, str, str, str], ...]
    shown: tuple[tuple[str, str], ...] = ()
    sets: Mapping[str, tuple[tuple[str, ...], Mapping[str, Value]]] = field(default_factory=dict)


def _starts(variables: tuple[Variable, ...], names: list[str]) -> dict[str, Value]:
    starts = {v.name: v.start for v in variables}
    return {name: start for name in names if (start := starts[name]) is not None}


def _parameter_names(variables: tuple[Variable, ...]) -> list[str]:
    return [v.name for v in variables if v.causality == "parameter" and v.kind is not Kind.STRING]


def _sets() -> dict[str, tuple[tuple[str, ...], Mapping[str, Value]]]:
    """Parameter sets: the car of plant and estimator, the start of the plant, the road, and the driver.

    All values are start values of the plant, and except for the rolling resistance those of the estimator, so that
    tools that read no parameter sets simulate the same car on the same road.
    """
    plant, known = _parameter_names(REFERENCE_PLANT), set(_parameter_names(TRPAC_ESTIMATOR_4W))
    car = [name for name in plant if name in known and name.split(".")[0] in ("vehicle", "tyre")]
    road = [name for name in plant if name.startswith("road.")]
    pulses = tuple(UNITS["TorquePulses"].variables)
    return {
        "car": ((PLANT, ESTIMATOR), _starts(REFERENCE_PLANT, car)),
        "plant": ((PLANT,), _starts(REFERENCE_PLANT, [name for name in plant if name not in (*car, *road)])),
        "road": ((PLANT,), _starts(REFERENCE_PLANT, road)),
        "drive": ((DRIVER,), _starts(pulses, _parameter_names(pulses))),
    }


def _four_wheels() -> Wiring:
    per_wheel = [f"{name}.{wheel}" for name in ("wheel_speed", "vertical_load") for wheel in WHEELS]
    per_side = [
        f"{name}.{side}" for name in ("road_class", "road_class_confidence") for side in ("left", "right")
    ]
    torques = [f"wheel_torque.{wheel}" for wheel in WHEELS]
    return Wiring(
        "trpac_four_wheels",
        "A car that is pushed and braked by the clock over a road of known friction, and its estimator at four wheels",
        {DRIVER: "TorquePulses", PLANT: "ReferencePlant", ESTIMATOR: "TrpacEstimator4W"},
        (
            *((DRIVER, name, PLANT, name) for name in torques),
            *((DRIVER, name, ESTIMATOR, name) for name in torques),
            *(
                (PLANT, name, ESTIMATOR, name)
                for name in (*per_wheel, "vehicle_speed", "longitudinal_acceleration", *per_side)
            ),
        ),
        (
            (PLANT, "position"),
            *((PLANT, f"theta.{wheel}") for wheel in WHEELS),
            *((ESTIMATOR, f"{name}.{wheel}") for name in SHOWN for wheel in WHEELS),
            (ESTIMATOR, "TRPAC.vehicle"),
        ),
        _sets(),
    )


def _one_wheel() -> Wiring:
    names = {
        "wheel_speed.fl": "wheel_speed",
        "vertical_load.fl": "vertical_load",
        "vehicle_speed": "vehicle_speed",
        "longitudinal_acceleration": "longitudinal_acceleration",
        "road_class.left": "road_class",
        "road_class_confidence.left": "road_class_confidence",
    }
    return Wiring(
        "trpac_one_wheel",
        "The same car, and the estimator of its front left wheel",
        {DRIVER: "TorquePulses", PLANT: "ReferencePlant", ESTIMATOR: "TrpacEstimator"},
        (
            *((DRIVER, f"wheel_torque.{wheel}", PLANT, f"wheel_torque.{wheel}") for wheel in WHEELS),
            (DRIVER, "wheel_torque.fl", ESTIMATOR, "wheel_torque"),
            *((PLANT, output, ESTIMATOR, given) for output, given in names.items()),
        ),
        ((PLANT, "position"), (PLANT, "theta.fl"), *((ESTIMATOR, name) for name in SHOWN)),
        _sets(),
    )


SYSTEMS = {"four_wheels": _four_wheels(), "one_wheel": _one_wheel()}
"""Systems by the name that `build_ssp.py --system` takes."""


def build_system(name: str, folder: str | Path, kind: str = PYTHON) -> Path:
    """Build a system's units and its package; returns the package's path.

    Parameters
    ----------
    name : str
        One of `SYSTEMS`.
    folder : path
        Made where it is missing.
    kind : str
        Kind of the estimator; the others need Python. With native the file is NAME_native.ssp.

    Raises
    ------
    BuildError
        If there is no such system or kind, or a unit cannot be built.
    OSError
        If the archive cannot be written.

    Examples
    --------
    >>> build_system("four_wheels", "dist")  # doctest: +SKIP
    PosixPath('dist/trpac_four_wheels.ssp')
    """
    if name not in SYSTEMS:
        raise BuildError(f"{name!r} is not a system. Known: {', '.join(SYSTEMS)}.")
    wiring, of_kind = SYSTEMS[name], known_units(kind)
    with tempfile.TemporaryDirectory(prefix="trpac_ssp_") as scratch:
        units = {
            unit: build(unit, Path(scratch), kind=kind if unit in of_kind else PYTHON)
            for unit in wiring.elements.values()
        }
        ending = "_native" if kind == NATIVE else ""
        return build_package(wiring, units, Path(folder) / f"{wiring.name}{ending}.ssp")


def build_package(wiring: Wiring, units: Mapping[str, Path], target: Path) -> Path:
    """Write a system's package; the same units give the same bytes.

    Raises
    ------
    BuildError
        If a unit is missing.
    """
    missing = [name for name in wiring.elements.values() if name not in units or not units[name].is_file()]
    if missing:
        raise BuildError(f"The system {wiring.name} needs units that are not built: {', '.join(missing)}.")
    content = {"SystemStructure.ssd": system_structure(wiring)}
    for name, (_, values) in wiring.sets.items():
        content[f"resources/{name}.ssv"] = parameter_set(name, values)
    for unit in wiring.elements.values():
        content[f"resources/{unit}.fmu"] = units[unit].read_bytes()
    return write_archive(target, content)


def system_structure(wiring: Wiring) -> bytes:
    """SystemStructure.ssd of a system; ValueError where a connection does not fit its variables."""
    root = Element(
        f"{{{SSD}}}SystemStructureDescription",
        {"version": SSP_VERSION, "name": wiring.name, "description": wiring.description, "license": "MIT"},
    )
    system = SubElement(root, f"{{{SSD}}}System", {"name": wiring.name})
    elements = SubElement(system, f"{{{SSD}}}Elements")
    for name, unit in wiring.elements.items():
        _component(elements, wiring, name, unit)
    connections = SubElement(system, f"{{{SSD}}}Connections")
    for start, output, end, given in wiring.connections:
        _check(wiring, start, output, end, given)
        attributes = {
            "startElement": start,
            "startConnector": output,
            "endElement": end,
            "endConnector": given,
        }
        SubElement(connections, f"{{{SSD}}}Connection", attributes)
    experiment = SubElement(
        root, f"{{{SSD}}}DefaultExperiment", {"startTime": "0.0", "stopTime": f"{STOP_S:g}"}
    )
    annotations = SubElement(experiment, f"{{{SSD}}}Annotations")
    annotation = SubElement(annotations, f"{{{SSC}}}Annotation", {"type": OSP_ANNOTATION})
    algorithm = SubElement(annotation, f"{{{OSP}}}Algorithm")
    SubElement(algorithm, f"{{{OSP}}}FixedStepAlgorithm", {"baseStepSize": f"{STEP_S:g}"})
    return _xml(root)


def _component(parent: Element, wiring: Wiring, name: str, unit: str) -> None:
    variables = {v.name: v for v in UNITS[unit].variables}
    source = {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{unit}.fmu"}
    component = SubElement(parent, f"{{{SSD}}}Component", {**source, "implementation": "CoSimulation"})
    used = {(start, output) for start, output, _, _ in wiring.connections}
    used |= {(end, given) for _, _, end, given in wiring.connections} | set(wiring.shown)
    connectors = SubElement(component, f"{{{SSD}}}Connectors")
    for variable in variables.values():
        if (name, variable.name) in used:
            kind = {"name": variable.name, "kind": variable.causality}
            connector = SubElement(connectors, f"{{{SSD}}}Connector", kind)
            SubElement(connector, f"{{{SSC}}}{variable.kind.value}")
    bound = [given for given, (elements, _) in wiring.sets.items() if name in elements]
    if bound:
        bindings = SubElement(component, f"{{{SSD}}}ParameterBindings")
        for given in bound:
            SubElement(bindings, f"{{{SSD}}}ParameterBinding", {"source": f"resources/{given}.ssv"})


def _check(wiring: Wiring, start: str, output: str, end: str, given: str) -> None:
    kinds = []
    for element, name, causality in ((start, output, "output"), (end, given, "input")):
        variables = {v.name: v for v in UNITS[wiring.elements[element]].variables}
        if name not in variables or variables[name].causality != causality:
            raise ValueError(f"{wiring.name}: {element} has no {causality} '{name}'.")
        kinds.append(variables[name].kind)
    if kinds[0] is not kinds[1]:
        raise ValueError(f"{wiring.name}: {start}.{output} and {end}.{given} are of different types.")


def parameter_set(name: str, values: Mapping[str, Value]) -> bytes:
    """An SSV file that holds these values."""
    root = Element(f"{{{SSV}}}ParameterSet", {"version": SSP_VERSION, "name": name})
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for parameter, value in values.items():
        entry = SubElement(parameters, f"{{{SSV}}}Parameter", {"name": parameter})
        kind = {bool: "Boolean", int: "Integer", float: "Real", str: "String"}[type(value)]
        text = str(value).lower() if isinstance(value, bool) else str(value)
        SubElement(entry, f"{{{SSV}}}{kind}", {"value": text})
    return _xml(root)


def _xml(root: Element) -> bytes:
    for prefix, namespace in (("ssd", SSD), ("ssc", SSC), ("ssv", SSV), ("osp", OSP)):
        register_namespace(prefix, namespace)
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, "utf-8") + b"\n"
