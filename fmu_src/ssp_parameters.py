"""Parameter sets of an SSP 1.0 package, bound to systems and components, as values of the variables of its units."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import fmpy.ssp
from fmpy.model_description import BaseUnit, ModelDescription
from lxml import etree

from scenarios.fmu_client.archives import UnitFileError
from trpac_core.files import quoted

from .ssp import SSC, SSD, SSV

SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
STRUCTURE = "SystemStructure.ssd"
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
SCHEMA_OF = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
    ".ssb": "SystemStructureSignalDictionary.xsd",
}
"""Schemas of SSP 1.0 in fmpy by the endings of a package's files."""
UNIT_TYPE = "application/x-fmu-sharedlibrary"
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Base units of SSP 1.0 and FMI 2.0."""
TYPES = {"Real": ("Real", "Integer"), "Enumeration": ("Enumeration", "Integer")}
"""Types in a set by the type of the variable that takes them, where they are not the same."""
TRANSFORMATIONS = {
    "LinearTransformation": ("Real",),
    "BooleanMappingTransformation": ("Boolean",),
    "IntegerMappingTransformation": ("Integer", "Enumeration"),
    "EnumerationMappingTransformation": ("Enumeration",),
}
"""Types in a set that a transformation takes."""

Element = Any
"""An element of lxml, which has no types."""
Value = float | int | bool | str
Read = Callable[[str], bytes]


@dataclass(frozen=True)
class Given:
    """A parameter of a set: its type and value there, the base unit it is in, and where it stands, for messages."""

    kind: str
    value: Value
    origin: str
    unit: str | None = None
    base: BaseUnit | None = None
    numbers: Mapping[str, int] | None = None
    """Numbers of the items of its enumeration, where the set states them."""
    keep_unit: bool = False
    """Whether the mapping suppresses the conversion of units."""
    transformation: Element = None


@dataclass(frozen=True)
class Node:
    """A system or component: its path in the package, what it holds, and of a component the unit's description."""

    element: Element
    path: tuple[str, ...]
    nodes: Mapping[str, Node]
    description: ModelDescription | None = None

    @property
    def origin(self) -> str:
        """The element as messages name it."""
        return f"{STRUCTURE}, element '{quoted('.'.join(self.path) or self.element.get('name'))}'"


def xml_of(data: bytes, name: str) -> Element:
    """The root element of an XML text; raises UnitFileError. No entities, no files of others, no network."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False, load_dtd=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise UnitFileError(f"{quoted(name)}: {quoted(error)}. Write it anew.") from error
    if root.getroottree().docinfo.doctype:
        raise UnitFileError(f"{quoted(name)}: declares a document type, expected plain XML. Write it anew.")
    return root


@cache
def _schema(ending: str) -> Any:
    return etree.XMLSchema(file=str(SCHEMAS / SCHEMA_OF[ending]))


def schema_problems(element: Element, ending: str, name: str) -> list[str]:
    """Problems of an element by the schema of files with this ending."""
    schema = _schema(ending)
    schema.validate(element)
    return [f"{quoted(name)}, line {e.line}: {quoted(e.message)}" for e in schema.error_log]


def require_connected(structure: Element) -> None:
    """Raise UnitFileError where fmpy's master would drop a connection's transformation, or wire an input wrongly."""
    for system in structure.iter(f"{{{SSD}}}System"):
        ends = set()
        for connection in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
            start, end = (
                tuple(connection.get(f"{side}{part}") for part in ("Element", "Connector"))
                for side in ("start", "end")
            )
            ends |= {start, end}
            if any(e.tag in {f"{{{SSC}}}{name}" for name in TRANSFORMATIONS} for e in connection):
                raise UnitFileError(
                    f"{STRUCTURE}, connection of '{quoted(start[1])}' to '{quoted(end[1])}': has a transformation, "
                    "which fmpy's master does not apply. Put it into a unit between them."
                )
        for element in system.iterfind(f"{{{SSD}}}Elements/*"):
            for connector in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector"):
                name = connector.get("name")
                if connector.get("kind") == "input" and (element.get("name"), name) not in ends:
                    raise UnitFileError(
                        f"{STRUCTURE}, element '{quoted(element.get('name'))}': its input '{quoted(name)}' is not "
                        "connected. Connect it, or leave its connector out."
                    )


def bound_values(
    structure: Element, read: Read, describe: Callable[[str], ModelDescription]
) -> dict[tuple[tuple[str, ...], str], Value]:
    """Values by the component's path and its variable's name, in the units and types of the variables.

    Bindings of a system win over those of its elements, and later ones of an element over earlier ones. A name that
    no variable has is ignored with a warning, as SSP 1.0 has it.

    Parameters
    ----------
    structure : element
        SystemStructure.ssd, which keeps its schema.
    read : callable
        Content of a file of the package; KeyError where there is none.
    describe : callable
        The description of a unit by the source that a component states.

    Raises
    ------
    UnitFileError
        If a binding, set or mapping cannot be followed; the text names the file and the element.
    """
    bindings = _Bindings(structure, read)
    top = _node(structure.find(f"{{{SSD}}}System"), (), describe)
    values = dict(bindings.of(top))
    if bindings.ignored:
        warnings.warn(
            f"SSP parameters that no variable takes are ignored: {quoted('; '.join(bindings.ignored))}.",
            stacklevel=2,
        )
    return values


def _node(element: Element, path: tuple[str, ...], describe: Callable[[str], ModelDescription]) -> Node:
    nodes: dict[str, Node] = {}
    origin = Node(element, path, nodes).origin
    for child in element.iterfind(f"{{{SSD}}}Elements/*"):
        name = child.get("name")
        if child.tag not in (f"{{{SSD}}}System", f"{{{SSD}}}Component"):
            if child.find(f"{{{SSD}}}ParameterBindings") is not None:
                raise UnitFileError(
                    f"{origin}: its element '{quoted(name)}' has no parameters. Leave out its bindings."
                )
            continue
        if name in nodes:
            raise UnitFileError(f"{origin}: has two elements '{quoted(name)}'. Name each once.")
        nodes[name] = _node(child, (*path, name), describe)
    if element.tag == f"{{{SSD}}}System":
        return Node(element, path, nodes)
    if (kind := element.get("type", UNIT_TYPE)) != UNIT_TYPE:
        raise UnitFileError(
            f"{origin}: is of type {quoted(kind)}; expected {UNIT_TYPE}. Put the units of that package into this one."
        )
    return Node(element, path, nodes, describe(element.get("source")))


class _Bindings:
    """Follows the bindings of one package; `ignored` collects the names that no variable has."""

    def __init__(self, structure: Element, read: Read) -> None:
        self._structure, self._read = structure, read
        self.ignored: list[str] = []

    def of(self, node: Node) -> Iterator[tuple[tuple[tuple[str, ...], str], Value]]:
        """Keys and values in ascending priority: those of the elements below, then the element's own."""
        for below in node.nodes.values():
            yield from self.of(below)
        for number, binding in enumerate(node.element.findall(f"{{{SSD}}}ParameterBindings/*"), 1):
            origin = f"{node.origin}, ParameterBinding {number}"
            for target, given, must in self._mapped(binding, origin):
                found = _targets(node, target, given.origin)
                if not found and must:
                    raise UnitFileError(
                        f"{given.origin}: its target '{quoted(target)}' is no variable of {node.origin}. Name a "
                        "variable of a unit, after the names of the elements around it."
                    )
                if not found:
                    self.ignored.append(f"{given.origin}: '{target}'")
                for owner, name in found:
                    yield (owner.path, name), _converted(given, owner, name)

    def _mapped(self, binding: Element, origin: str) -> Iterator[tuple[str, Given, bool]]:
        """Targets and what is given to them, and whether the target is the mapping's own word."""
        prefix = binding.get("prefix", "")
        root, file = self._content(binding, binding.find(f"{{{SSD}}}ParameterValues"), ".ssv", origin)
        units = [root] if binding.get("source") else [root, self._structure]
        given: dict[str, Given] = {}
        for parameter in root.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
            name = prefix + parameter.get("name")
            where = f"{file}, parameter '{quoted(parameter.get('name'))}'"
            if name in given:
                raise UnitFileError(f"{where}: stands twice in its set. Leave one.")
            given[name] = _given(parameter, units, where)
        mapping = binding.find(f"{{{SSD}}}ParameterMapping")
        if mapping is None:
            yield from ((name, one, False) for name, one in given.items())
            return
        root, file = self._content(mapping, mapping, ".ssm", f"{origin}, ParameterMapping")
        left, targets = dict(given), set()
        for entry in root.iterfind(f"{{{SSM}}}MappingEntry"):
            source, target = entry.get("source"), entry.get("target")
            where = f"{file}, mapping of '{quoted(source)}' to '{quoted(target)}'"
            if target in targets:
                raise UnitFileError(f"{where}: the target stands twice. Leave one entry.")
            targets.add(target)
            if source not in given:
                self.ignored.append(f"{where}: no such source")
                continue
            left.pop(source, None)
            changes = [e for e in entry if e.tag in {f"{{{SSC}}}{name}" for name in TRANSFORMATIONS}]
            keep = entry.get("suppressUnitConversion") in ("true", "1")
            change = changes[0] if changes else None
            yield target, replace(given[source], origin=where, keep_unit=keep, transformation=change), True
        self.ignored += [f"{one.origin}: no entry in the mapping" for one in left.values()]

    def _content(self, element: Element, inline: Element, ending: str, origin: str) -> tuple[Element, str]:
        """The root of a set or mapping, of a file or inline, and how messages name where it is."""
        what, tag = {
            ".ssv": ("set", f"{{{SSV}}}ParameterSet"),
            ".ssm": ("mapping", f"{{{SSM}}}ParameterMapping"),
        }[ending]
        expected = f"application/x-ssp-parameter-{what}"
        if element.get("type", expected) != expected:
            raise UnitFileError(f"{origin}: is of type {quoted(element.get('type'))}; expected {expected}.")
        if element.get("sourceBase", "SSD") != "SSD":
            raise UnitFileError(
                f"{origin}: its sourceBase is a component; expected SSD. Put the file into the package."
            )
        source = element.get("source")
        inside = [] if inline is None else [e for e in inline if isinstance(e.tag, str)]
        if (source is None) != bool(inside):
            stated = "has no source and no" if source is None else "states a source and a"
            raise UnitFileError(f"{origin}: {stated} {what} inline; expected one of both.")
        if source is None:
            root, file = inside[0], origin
        else:
            try:
                root, file = xml_of(self._read(source), source), quoted(source)
            except KeyError:
                raise UnitFileError(
                    f"{origin}: no file '{quoted(source)}' in the package; expected one by its path there."
                ) from None
        problems = schema_problems(root, ending, file)
        if root.tag != tag or len(inside) > 1:
            problems = [f"{file}: holds no {what} of SSP 1.0 alone"]
        if problems:
            raise UnitFileError(f"{problems[0].rstrip('.')}. Expected a {what} by the schema of SSP 1.0.")
        return root, file


def _given(parameter: Element, units: Sequence[Element], origin: str) -> Given:
    """A parameter of a set that keeps the schema; `units` are the elements whose unit definitions count."""
    stated = next(e for e in parameter if isinstance(e.tag, str))
    kind, text = etree.QName(stated).localname, stated.get("value")
    if kind == "Binary":
        raise UnitFileError(f"{origin}: is binary, which no unit of FMI 2.0 takes. Leave it out.")
    value: Value = text
    if kind == "Real":
        value = float(text)
    elif kind == "Integer":
        value = int(text)
    elif kind == "Boolean":
        value = text.strip() in ("true", "1")
    unit, enumeration = stated.get("unit"), stated.get("name")
    return Given(
        kind,
        value,
        origin,
        unit,
        _base(unit, units),
        _numbers(enumeration, units, origin) if enumeration else None,
    )


def _named(units: Sequence[Element], of: str, name: str) -> Element:
    """The definition of a unit or an enumeration; None where there is none."""
    found = (e for root in units for e in root.iterfind(f"{{*}}{of}s/{{{SSC}}}{of}") if e.get("name") == name)
    return next(found, None)


def _base(unit: str | None, units: Sequence[Element]) -> BaseUnit | None:
    definition = _named(units, "Unit", unit) if unit else None
    if definition is None:
        return None
    stated = definition.find(f"{{{SSC}}}BaseUnit").attrib
    exponents = {name: int(stated.get(name, 0)) for name in EXPONENTS}
    return BaseUnit(**exponents, factor=float(stated.get("factor", 1)), offset=float(stated.get("offset", 0)))


def _numbers(name: str, units: Sequence[Element], origin: str) -> dict[str, int]:
    definition = _named(units, "Enumeration", name)
    if definition is None:
        raise UnitFileError(f"{origin}: no enumeration '{quoted(name)}' in its file. Define it there.")
    return {item.get("name"): int(item.get("value")) for item in definition.iterfind(f"{{{SSC}}}Item")}


def _targets(node: Node, name: str, origin: str) -> list[tuple[Node, str]]:
    """Components and variables that a hierarchical name within an element means; none where no variable has it."""
    if node.description is not None:
        known = any(v.name == name for v in node.description.modelVariables)
        return [(node, name)] if known else []
    for connector in node.element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector"):
        if connector.get("name") == name:
            return _behind(node, connector, origin)
    # Names of elements may have dots, so that there may be several ways to split one.
    ways = [
        found
        for element, below in node.nodes.items()
        if name.startswith(f"{element}.") and (found := _targets(below, name[len(element) + 1 :], origin))
    ]
    if len(ways) > 1:
        raise UnitFileError(
            f"{origin}: '{quoted(name)}' means variables of two elements. Name the elements otherwise."
        )
    return ways[0] if ways else []


def _behind(node: Node, connector: Element, origin: str) -> list[tuple[Node, str]]:
    """The variables that a system's connector hands its value to."""
    name = connector.get("name")
    if connector.get("kind") != "parameter":
        raise UnitFileError(
            f"{origin}: sets the connector '{quoted(name)}' of {node.origin}, which is of kind "
            f"{quoted(connector.get('kind'))}; expected a parameter. Set the variable of the element behind it."
        )
    found: list[tuple[Node, str]] = []
    for connection in node.element.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
        if connection.get("startElement") is None and connection.get("startConnector") == name:
            end = node.nodes.get(connection.get("endElement"))
            if end is not None:
                found += _targets(end, connection.get("endConnector"), origin)
    return found


def _converted(given: Given, owner: Node, name: str) -> Value:
    """A value for a variable: its unit converted, then the mapping's transformation; raises UnitFileError."""
    assert owner.description is not None
    variable = next(v for v in owner.description.modelVariables if v.name == name)
    at = f"{given.origin}: for '{quoted(name)}' of {owner.origin}"
    settable = variable.causality in ("parameter", "input") or variable.initial in ("exact", "approx")
    if not settable or variable.variability == "constant":
        raise UnitFileError(
            f"{at}: is {variable.causality} and no value that can be set. Set a parameter or an input."
        )
    if given.kind not in TYPES.get(variable.type, (variable.type,)):
        raise UnitFileError(f"{at}: is of type {given.kind}; expected {variable.type}.")
    if variable.type == "String":
        raise UnitFileError(
            f"{at}: is a text, which fmpy's master does not set. Set it in the unit, or leave it out."
        )
    value = given.value
    if given.unit is not None and not given.keep_unit:
        value = _in_unit(given, variable, owner.description, at)
    if given.transformation is not None:
        value = _transformed(value, given, at)
    if isinstance(value, float) and not math.isfinite(value):
        raise UnitFileError(f"{at}: is {value}; expected a finite number.")
    return _number(value, given, variable, at) if variable.type == "Enumeration" else value


def _in_unit(given: Given, variable: Any, description: ModelDescription, at: str) -> float:
    """A number in the unit of the variable."""
    value = float(given.value)
    declared = variable.declaredType
    unit = variable.unit or (declared.unit if declared is not None else None)
    mend = "Define both units, or state suppressUnitConversion in a mapping."
    if unit is None:
        raise UnitFileError(f"{at}: is in '{quoted(given.unit)}', but the variable has no unit. {mend}")
    base = next((u.baseUnit for u in description.unitDefinitions if u.name == unit), None)
    if given.base is None or base is None:
        if given.unit == unit:
            return value
        which = (
            f"'{quoted(given.unit)}' in the set" if given.base is None else f"'{quoted(unit)}' in the unit"
        )
        raise UnitFileError(f"{at}: no definition of {which}. {mend}")
    if any(getattr(given.base, n) != getattr(base, n) for n in EXPONENTS):
        raise UnitFileError(
            f"{at}: '{quoted(given.unit)}' cannot be converted to '{quoted(unit)}': other dimensions."
        )
    if not (given.base.factor and base.factor):
        raise UnitFileError(f"{at}: '{quoted(given.unit)}' or '{quoted(unit)}' has the factor 0.")
    scales = given.base.factor, base.factor
    offsets = (0.0, 0.0) if variable.relativeQuantity else (given.base.offset, base.offset)
    if scales[0] == scales[1] and offsets[0] == offsets[1]:
        return value
    return (scales[0] * value + offsets[0] - offsets[1]) / scales[1]


def _transformed(value: Value, given: Given, at: str) -> Value:
    transformation = given.transformation
    kind = etree.QName(transformation).localname
    if given.kind not in TRANSFORMATIONS[kind]:
        raise UnitFileError(
            f"{at}: {kind} is for {' and '.join(TRANSFORMATIONS[kind])}, not for {given.kind}."
        )
    if kind == "LinearTransformation":
        return float(transformation.get("factor", 1.0)) * float(value) + float(
            transformation.get("offset", 0.0)
        )
    whole = kind == "IntegerMappingTransformation"
    table = {_entry(kind, e.get("source")): _entry(kind, e.get("target")) for e in transformation}
    if whole and isinstance(value, str):
        value = (given.numbers or {}).get(value, value)
    if value not in table:
        raise UnitFileError(f"{at}: {kind} has no entry for {quoted(value)}. Add one.")
    return table[value]


def _entry(kind: str, text: str) -> Value:
    if kind == "EnumerationMappingTransformation":
        return text
    return int(text) if kind.startswith("Integer") else text.strip() in ("true", "1")


def _number(value: Value, given: Given, variable: Any, at: str) -> int:
    """The number of an enumeration's item in the unit."""
    items = variable.declaredType.items if variable.declaredType is not None else []
    numbers = {item.name: int(item.value) for item in items}
    number = numbers.get(value) if isinstance(value, str) else int(value)
    if number is None or number not in numbers.values():
        known = ", ".join(numbers)
        raise UnitFileError(f"{at}: has no item {quoted(value)}. Known: {quoted(known)}.")
    return number
