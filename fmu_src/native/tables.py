"""The variables of a unit in C: their table, their start values, and the settings that the parameters make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trpac_core.parameters.variables import Kind, Variable

from .translator.types import BOOL, DOUBLE, INT, Type, literal, safe

STRING_SIZE = 1024
"""Bytes of a text in the unit."""
KINDS = tuple(Kind)
STARTS = {
    Kind.REAL: ("double", DOUBLE, 0.0),
    Kind.INTEGER: ("int", INT, 0),
    Kind.BOOLEAN: ("bool", BOOL, False),
}
"""Type in C, and start value of outputs."""
TIME = "unit->memory.time_s"
"""The independent variable in C."""


def header(unit: str, guid: str, variables: Sequence[Variable], constants: dict[str, str]) -> str:
    """Names and numbers of a unit's variables, and other constants."""
    references = [
        f"AT_{c_name(v.name)} = {index}" for v, index in zip(variables, indices(variables), strict=True)
    ]
    counts = {kind: sum(v.kind is kind for v in variables) for kind in KINDS}
    lines = [
        "/* Made of the unit's variables: change those. */",
        "#ifndef TABLES_H",
        "#define TABLES_H",
        "",
        "#include <stdbool.h>",
        "",
        f'#define MODEL "{unit}"',
        f'#define GUID "{guid}"',
        *(f"#define {name} {value}" for name, value in constants.items()),
        f"enum {{ COUNT = {len(variables)}, STRING_SIZE = {STRING_SIZE} }};",
        f"enum {{ {', '.join(f'{kind.name}S = {count}' for kind, count in counts.items())} }};",
        "typedef enum { REAL, INTEGER, BOOLEAN, STRING, KINDS } Kind;",
        "typedef enum { INPUT, OUTPUT, PARAMETER, INDEPENDENT } Causality;",
        "typedef struct {",
        "    const char *name;",
        "    Kind kind;",
        "    Causality causality;",
        "    int index; /* among those of its kind */",
        "    double minimum, maximum;",
        "    const char *unit;",
        "} Variable;",
        "",
        "/* Value references. */",
        f"enum {{ {', '.join(f'VR_{c_name(v.name)} = {vr}' for vr, v in enumerate(variables))} }};",
        "/* Places among the values of a kind. */",
        f"enum {{ {', '.join(references)} }};",
        "",
        "extern const Variable VARIABLES[COUNT];",
        *(f"extern const {STARTS[kind][0]} {kind.name}_STARTS[{max(counts[kind], 1)}];" for kind in STARTS),
        "",
        "#endif",
        "",
    ]  # fmt: skip
    return "\n".join(lines)


def code(variables: Sequence[Variable]) -> str:
    """The table, and the start values."""
    lines = [
        "/* Made of the unit's variables: change those. */",
        '#include "tables.h"',
        "",
        "#include <math.h>",
        "",
    ]
    lines.append("const Variable VARIABLES[COUNT] = {")
    for v, index in zip(variables, indices(variables), strict=True):
        low = "-INFINITY" if v.minimum is None else repr(float(v.minimum))
        high = "INFINITY" if v.maximum is None else repr(float(v.maximum))
        unit = v.unit if v.unit not in (None, "1") else ""
        lines.append(
            f'    {{"{v.name}", {v.kind.name}, {v.causality.upper()}, {index}, {low}, {high}, "{unit}"}},'
        )
    lines.append("};")
    for kind, (c, kind_in_c, neutral) in STARTS.items():
        values = [neutral if v.start is None else v.start for v in variables if v.kind is kind] or [neutral]
        listed = ", ".join(literal(value, kind_in_c, "a start value") for value in values)
        lines.append(f"const {c} {kind.name}_STARTS[{len(values)}] = {{{listed}}};")
    return "\n".join([*lines, ""])


def settings_code(name: str, settings: Type, variables: Sequence[Variable]) -> str:
    """The function that makes a record of settings of the parameters' values.

    Parameters
    ----------
    name : str
        Of the function.
    settings : Type
        The record.
    variables : sequence of Variable
        Of the unit; a parameter whose source is no field of the record is left out.
    """
    lines = [f"void {name}(const Memory *memory, {settings.c} *settings)", "{"]
    for v, index in zip(variables, indices(variables), strict=True):
        member = member_of(settings, v.source) if v.source else None
        if member is None:
            continue
        text, kind = member
        value = f"memory->{v.kind.value.lower()}[{index}]"
        value = f"({kind.c}){value}" if kind.kind == "enum" else value
        lines.append(f"    settings->{text} = {value};")
    return "\n".join([*lines, "}", ""])


def member_of(kind: Type, path: str) -> tuple[str, Type] | None:
    """Where a dotted path of fields lies in a record, and its type; None where the record has no such field."""
    text = ""
    for name in path.split("."):
        if name.isdigit() and kind.kind == "tuple":
            text, kind = f"{text}.at[{name}]", DOUBLE
            continue
        found = kind.found(name)
        if found is None:
            return None
        text, kind = f"{text}.{safe(name)}" if text else safe(name), found.type
    return text, kind


def indices(variables: Sequence[Variable]) -> list[int]:
    """Place of each variable among those of its kind."""
    seen: dict[Any, int] = dict.fromkeys(KINDS, -1)
    references = []
    for v in variables:
        seen[v.kind] += 1
        references.append(seen[v.kind])
    return references


def c_name(name: str) -> str:
    """A variable's name in C."""
    return name.replace(".", "_")


def outputs_code(variables: Sequence[Variable], shown: Callable[[str], str]) -> str:
    """The functions that read outputs from the last estimate; `shown` gives an output in C."""
    kinds = {Kind.REAL: ("double", "0.0"), Kind.INTEGER: ("int", "0"), Kind.BOOLEAN: ("bool", "false")}
    lines: list[str] = []
    for kind, (c, neutral) in kinds.items():
        lines += [
            f"{c} unit_{kind.value.lower()}(const Unit *unit, int variable)",
            "{",
            "    switch (variable) {",
        ]
        for v in variables:
            if v.kind is kind and v.causality in ("output", "independent"):
                value = shown(v.name) if v.causality == "output" else TIME
                lines.append(f"    case VR_{c_name(v.name)}: return {value};")
        lines += [f"    default: return {neutral};", "    }", "}", ""]
    return "\n".join(lines)
