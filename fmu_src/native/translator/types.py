"""Python's types as C's, and Python's values as C's literals."""

from __future__ import annotations

import dataclasses
import enum
import math
import re
import types
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .source import Unsupported, field_texts

_KEYWORDS = """
auto break case char const default do double else enum extern float for goto if inline int long register restrict return
short signed sizeof static struct switch typedef union unsigned void volatile while bool true false i j k result"""
KEYWORDS = frozenset(_KEYWORDS.split())
"""Names that C or the generated code uses itself."""
MOST_BY_VALUE = 16
"""Most numbers in a record that is passed by value."""
ARRAY = NDArray[np.float64]
"""Python's type of an array without a shape: in C one of its elements."""


class Field(NamedTuple):
    """A field of a record, and what is said of it."""

    name: str
    type: Type
    text: str = ""


@dataclass(frozen=True)
class Type:
    """A type in C: its name, of an array that of its elements, and the class that it is in Python.

    `kind` is double, int, bool, enum, record, tuple (of numbers alike), optional, array or nothing. `mutable` tells
    whether fields may be set in place, `left_out` which have no type in C, and why.
    """

    c: str
    kind: str
    shape: tuple[int, ...] = ()
    item: Any = field(default=None, compare=False)
    fields: tuple[Field, ...] = field(default=(), compare=False)
    python: Any = field(default=None, compare=False)
    mutable: bool = field(default=False, compare=False)
    left_out: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def number(self) -> bool:
        """Whether it takes part in arithmetic."""
        return self.kind in ("double", "int", "bool")

    @property
    def big(self) -> bool:
        """Whether it goes by pointer: a record that can be changed in place, or of many numbers."""
        return self.kind == "record" and (self.mutable or self.numbers > MOST_BY_VALUE)

    @property
    def numbers(self) -> int:
        """How many numbers it holds; an array is too many to go by value."""
        if self.kind == "array":
            return MOST_BY_VALUE + 1
        if self.kind == "record":
            return sum(f.type.numbers for f in self.fields)
        return self.size if self.kind == "tuple" else 1 if self.item is None else 1 + int(self.item.numbers)

    @property
    def slots(self) -> dict[str, Type]:
        """The types of its fields, by name."""
        return {f.name: f.type for f in self.fields}

    @property
    def size(self) -> int:
        """Number of elements of an array."""
        return math.prod(self.shape)

    def found(self, name: str) -> Field | None:
        """The field of that name."""
        return next((f for f in self.fields if f.name == name), None)


DOUBLE, INT, BOOL, NOTHING = (Type(c, c) for c in ("double", "int", "bool", "nothing"))


def array_of(item: Type, shape: tuple[int, ...]) -> Type:
    """An array of a shape."""
    return Type(item.c, "array", shape, item)


class Types:
    """The types met so far."""

    def __init__(self) -> None:
        self.named: dict[str, Type] = {}

    def of(self, hint: Any, where: str) -> Type:
        """The C type of a type hint; `where` is told in a refusal."""
        if hint in (float, int, bool, ARRAY):
            return {float: DOUBLE, int: INT, bool: BOOL, ARRAY: DOUBLE}[hint]
        if hint in (None, type(None)):
            return NOTHING
        origin, arguments = get_origin(hint), get_args(hint)
        if origin is Annotated and isinstance(hint.__metadata__[0], tuple):
            item = get_args(arguments[0])[0] if get_origin(arguments[0]) is list else arguments[0]
            return self.array(self.of(item, where), hint.__metadata__[0])
        if origin in (Union, types.UnionType) and len(arguments) == 2 and arguments[1] is type(None):
            return self.optional(self.of(arguments[0], where))
        if origin is tuple and ... not in arguments:
            return self.tuple_of([self.of(argument, where) for argument in arguments])
        if isinstance(hint, type):
            return self._class(hint, where)
        raise Unsupported(f"{where}: {hint} has no type in C.")

    def of_value(self, value: Any, where: str) -> Type:
        """The type of a module's constant."""
        if isinstance(value, np.ndarray):
            return array_of(DOUBLE, value.shape)
        if type(value) is tuple:
            return self.tuple_of([self.of_value(item, where) for item in value])
        return self.of(type(value), where)

    def array(self, item: Type, shape: tuple[int, ...]) -> Type:
        """An array of a shape; of records a record of arrays."""
        if item.kind != "record":
            return array_of(item, shape)
        fields = tuple(Field(f.name, self.array(f.type, shape), f.text) for f in item.fields)
        c = f"{item.c}_{'x'.join(map(str, shape))}"
        return self._named(Type(c, "record", fields=fields, python=item.python))

    def optional(self, item: Type) -> Type:
        """`T | None`."""
        return item if item.kind == "optional" else self._named(Type(f"opt_{item.c}", "optional", item=item))

    def tuple_of(self, items: list[Type]) -> Type:
        """A tuple: a record of its parts, or numbers alike by index."""
        if all(item == DOUBLE for item in items):
            return self._named(Type(f"double{len(items)}", "tuple", (len(items),), DOUBLE))
        fields = tuple(Field(f"_{index}", item) for index, item in enumerate(items))
        c = "tuple_" + "_".join(item.c for item in items)
        return self._named(Type(c, "record", fields=fields, python=tuple))

    def _class(self, python: Any, where: str) -> Type:
        name = python.__name__
        if name in self.named:
            if self.named[name].python is not python:
                raise Unsupported(f"{where}: there are two classes {name}.")
            return self.named[name]
        if issubclass(python, enum.Enum):
            return self._named(Type(name, "enum", python=python))
        if not (dataclasses.is_dataclass(python) or hasattr(python, "_fields")):
            raise Unsupported(f"{where}: {name} is no enum, dataclass or NamedTuple.")
        texts, hints = field_texts(python), get_type_hints(python, include_extras=True)
        frozen = hasattr(python, "_fields") or python.__dataclass_params__.frozen
        fields, left_out = [], {}
        for part in getattr(python, "_fields", None) or [f.name for f in dataclasses.fields(python)]:
            try:
                kind = self.of(hints[part], f"{where}, {name}.{part}")
                fields.append(Field(part, kind, texts.get(part, "")))
            except Unsupported as reason:
                left_out[part] = str(reason)
        made = Type(
            name, "record", fields=tuple(fields), python=python, mutable=not frozen, left_out=left_out
        )
        return self._named(made)

    def _named(self, made: Type) -> Type:
        return self.named.setdefault(made.c, made)

    def definitions(self) -> list[str]:
        """All types in C, each after those that it holds, as they were met."""
        return [line for kind in self.named.values() for line in [*_definition(kind), ""]]


def _definition(kind: Type) -> list[str]:
    if kind.kind == "enum":
        members = ", ".join(f"{kind.c}_{member.name} = {member.value}" for member in kind.python)
        return [f"typedef enum {{ {members} }} {kind.c};"]
    if kind.kind == "tuple":
        return [f"typedef struct {{ double at[{kind.size}]; }} {kind.c};"]
    if kind.kind == "optional":
        return [f"typedef struct {{ bool has; {kind.item.c} value; }} {kind.c};"]
    fields = [f"    {declared(f.type, safe(f.name))};{comment(f.text, ' ')}" for f in kind.fields]
    return ["typedef struct {", *fields, f"}} {kind.c};"]


def declared(kind: Type, name: str) -> str:
    """A declaration of a variable or field."""
    return f"{kind.c} {name}[{kind.size}]" if kind.kind == "array" else f"{kind.c} {name}"


def comment(text: str, before: str = "") -> str:
    """A text as a comment in one line; empty for none."""
    return f"{before}/* {' '.join(text.split()).replace('*/', '* /')} */" if text else ""


def safe(name: str) -> str:
    """A name that C can have."""
    return f"{name}_" if name in KEYWORDS else name


def literal(value: Any, kind: Type, where: str) -> str:
    """A Python value as a C expression of a type; of an array within braces."""
    if kind.kind == "optional":
        held = "false" if value is None else f"true, {literal(value, kind.item, where)}"
        return f"({kind.c}){{{held}}}"
    if kind.kind == "enum":
        return f"{kind.c}_{value.name}"
    if kind.kind == "array":
        items = np.asarray(value).ravel().tolist()
        return "{" + ", ".join(literal(item, kind.item, where) for item in items) + "}"
    if kind.kind == "tuple":
        return f"({kind.c}){{{{{', '.join(literal(item, DOUBLE, where) for item in value)}}}}}"
    if kind.kind == "record":
        parts = value if type(value) is tuple else [getattr(value, f.name) for f in kind.fields]
        listed = ", ".join(literal(v, f.type, where) for v, f in zip(parts, kind.fields, strict=True))
        return f"({kind.c}){{{listed}}}"
    if kind == BOOL and isinstance(value, bool):
        return str(value).lower()
    if kind == DOUBLE and isinstance(value, int | float):
        if math.isfinite(value):
            return repr(float(value))
        return "NAN" if math.isnan(value) else "-INFINITY" if value < 0 else "INFINITY"
    if kind == INT and isinstance(value, int):
        return repr(int(value))
    raise Unsupported(f"{where}: {value!r} cannot be written as {kind.c}.")


def initialiser(value: Any, kind: Type, where: str) -> str:
    """A Python value within braces, as it begins a constant."""
    return re.sub(r"\(\w+\)\{", "{", literal(value, kind, where))
