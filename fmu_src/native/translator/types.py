"""Python's types as C's, and Python's values as C's literals."""

from __future__ import annotations

import dataclasses
import enum
import math
import re
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

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


@dataclass(frozen=True)
class Field:
    """A field of a record, or a member of an enum with its number as type name."""

    name: str
    type: Type
    text: str = ""


@dataclass(frozen=True, eq=False)
class Type:
    """A type in C.

    Attributes
    ----------
    c : str
        Its name in C; of an array that of its elements.
    kind : str
        double, int, bool, enum, record, tuple (of numbers alike), optional, array or nothing.
    fields : tuple of Field
        Of a record or enum.
    item : Type or None
        Of an optional, a tuple or an array.
    shape : tuple of int
        Of an array or a tuple.
    python : Any
        The class.
    mutable : bool
        Whether fields may be set in place.
    left_out : mapping
        Fields that have no type in C, and why.
    """

    c: str
    kind: str
    fields: tuple[Field, ...] = ()
    item: Type | None = None
    shape: tuple[int, ...] = ()
    python: Any = None
    mutable: bool = False
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Type) and (self.c, self.kind, self.shape) == (
            other.c,
            other.kind,
            other.shape,
        )

    def __hash__(self) -> int:
        return hash((self.c, self.kind, self.shape))

    @property
    def number(self) -> bool:
        """Whether it takes part in arithmetic."""
        return self.kind in ("double", "int", "bool")

    @property
    def big(self) -> bool:
        """Whether it goes by pointer: a record that can be changed in place, or of many numbers."""
        if self.kind == "optional" and self.item is not None:
            return self.item.big
        if self.kind != "record":
            return False
        return self.mutable or self.numbers > MOST_BY_VALUE

    @property
    def numbers(self) -> int:
        """How many numbers it holds; an array is too many to go by value."""
        if self.kind == "array":
            return MOST_BY_VALUE + 1
        if self.kind == "record":
            return sum(f.type.numbers for f in self.fields)
        return self.size if self.kind == "tuple" else 1 if self.item is None else 1 + self.item.numbers

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
    return Type(item.c, "array", item=item, shape=shape)


class Types:
    """The types met so far."""

    def __init__(self) -> None:
        self.named: dict[str, Type] = {}

    def of(self, hint: Any, where: str) -> Type:
        """The C type of a type hint; `where` is told in a refusal."""
        if hint in (float, int, bool, ARRAY):
            return {float: DOUBLE, int: INT, bool: BOOL, ARRAY: DOUBLE}[hint]
        if hint is None or hint is type(None):
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

    def array(self, item: Type, shape: tuple[int, ...]) -> Type:
        """An array of a shape; of records a record of arrays."""
        if item.kind != "record":
            return array_of(item, shape)
        fields = tuple(Field(f.name, self.array(f.type, shape), f.text) for f in item.fields)
        return self._named(
            Type(f"{item.c}_{'x'.join(map(str, shape))}", "record", fields, python=item.python)
        )

    def optional(self, item: Type) -> Type:
        """`T | None`."""
        if item.kind == "optional":
            return item
        return self._named(Type(f"opt_{item.c}", "optional", item=item))

    def tuple_of(self, items: list[Type]) -> Type:
        """A tuple: a record of its parts, or numbers alike by index."""
        if all(item == DOUBLE for item in items):
            return self._named(Type(f"double{len(items)}", "tuple", item=DOUBLE, shape=(len(items),)))
        fields = tuple(Field(f"_{index}", item) for index, item in enumerate(items))
        return self._named(
            Type("tuple_" + "_".join(item.c for item in items), "record", fields, python=tuple)
        )

    def _class(self, python: Any, where: str) -> Type:
        known = self.named.get(python.__name__)
        if known is not None:
            if known.python is not python:
                raise Unsupported(f"{where}: there are two classes {python.__name__}.")
            return known
        if issubclass(python, enum.Enum):
            members = tuple(
                Field(f"{python.__name__}_{m.name}", Type(str(m.value), "number")) for m in python
            )
            return self._named(Type(python.__name__, "enum", members, python=python))
        if not (dataclasses.is_dataclass(python) or hasattr(python, "_fields")):
            raise Unsupported(f"{where}: {python.__name__} is no enum, dataclass or NamedTuple.")
        texts, slot = field_texts(python), f"{where}, {python.__name__}"
        hints = get_type_hints(python, include_extras=True)
        names = getattr(python, "_fields", None) or [f.name for f in dataclasses.fields(python)]
        fields, left_out = [], {}
        for name in names:
            try:
                fields.append(Field(name, self.of(hints[name], f"{slot}.{name}"), texts.get(name, "")))
            except Unsupported as reason:
                left_out[name] = str(reason)
        frozen = hasattr(python, "_fields") or python.__dataclass_params__.frozen
        return self._named(
            Type(
                python.__name__,
                "record",
                tuple(fields),
                python=python,
                mutable=not frozen,
                left_out=left_out,
            )
        )

    def _named(self, made: Type) -> Type:
        return self.named.setdefault(made.c, made)

    def of_value(self, value: Any, where: str) -> Type:
        """The type of a module's constant."""
        if isinstance(value, np.ndarray):
            return array_of(DOUBLE, value.shape)
        if type(value) is tuple:
            return self.tuple_of([self.of_value(item, where) for item in value])
        return self.of(type(value), where)

    def definitions(self) -> list[str]:
        """All types in C, each after those that it holds."""
        done: dict[str, list[str]] = {}

        def visit(kind: Type) -> None:
            for inner in [f.type for f in kind.fields if kind.kind == "record"] + [kind.item] * (
                kind.item is not None
            ):
                if inner is not None and inner.c in self.named:
                    visit(self.named[inner.c])
            done.setdefault(kind.c, _definition(kind))

        for kind in self.named.values():
            visit(kind)
        return [line for lines in done.values() for line in [*lines, ""]]


def _definition(kind: Type) -> list[str]:
    if kind.kind == "enum":
        return [f"typedef enum {{ {', '.join(f'{f.name} = {f.type.c}' for f in kind.fields)} }} {kind.c};"]
    if kind.kind == "tuple":
        return [f"typedef struct {{ double at[{kind.size}]; }} {kind.c};"]
    if kind.kind == "optional" and kind.item is not None:
        return [f"typedef struct {{ bool has; {kind.item.c} value; }} {kind.c};"]
    lines = ["typedef struct {"]
    for f in kind.fields:
        lines.append(f"    {declared(f.type, safe(f.name))};{comment(f.text, ' ')}")
    return [*lines, f"}} {kind.c};"]


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
    """A Python value as a C expression of a type; of an array or a tuple within braces."""
    if kind.kind == "optional" and kind.item is not None:
        held = "false" if value is None else f"true, {literal(value, kind.item, where)}"
        return f"({kind.c}){{{held}}}"
    if kind.kind == "enum":
        return f"{kind.c}_{value.name}"
    if kind.kind == "array" and kind.item is not None:
        item = kind.item
        return "{" + ", ".join(literal(v, item, where) for v in np.asarray(value).ravel().tolist()) + "}"
    if kind.kind == "tuple":
        return f"({kind.c}){{{{{', '.join(literal(v, DOUBLE, where) for v in value)}}}}}"
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


ATOM, UNARY, PRODUCT, SUM, RELATION, AND, OR, TERNARY = 100, 90, 80, 70, 60, 50, 45, 40
"""How strongly operators of C bind."""


@dataclass(frozen=True)
class Expression:
    """An expression in C, its type and how strongly its outermost operator binds.

    `pointer` tells that the text is a pointer to the value. Of an array, `at` gives the element at indices, one for
    each dimension; `names` are the local arrays that it is made of; `address` is where it lies, empty where it has no
    place; `part` tells that it is nothing but elements of another one; `stack` are the arrays that lie under each
    other in it.
    """

    text: str
    type: Type
    binds: int = ATOM
    pointer: bool = False
    at: Callable[[tuple[str, ...]], Expression] | None = None
    names: frozenset[str] = frozenset()
    address: str = ""
    part: bool = False
    stack: tuple[Expression, ...] = ()

    def bound(self, binds: int) -> str:
        """The text where an operator binds so strongly."""
        return self.text if self.binds >= binds else f"({self.text})"

    def member(self, name: str, kind: Type) -> Expression:
        """A field of the record."""
        text = f"{self.bound(ATOM)}{'->' if self.pointer else '.'}{safe(name)}"
        return array_at(text, kind) if kind.kind == "array" else Expression(text, kind)

    @property
    def reference(self) -> str:
        """A pointer to the value."""
        return self.text if self.pointer else f"&{self.bound(ATOM)}"


def array_at(address: str, kind: Type, names: frozenset[str] = frozenset()) -> Expression:
    """An array that lies at an address."""
    item = kind.item or DOUBLE

    def at(indices: tuple[str, ...]) -> Expression:
        return Expression(f"{address}[{flat_index(indices, kind.shape)}]", item)

    return Expression(address, kind, at=at, names=names, address=address, part=True)


def flat_index(indices: tuple[str, ...], shape: tuple[int, ...]) -> str:
    """The place of an element in the memory of an array; within a loop over two dimensions `k` is that of i and j."""
    if (
        len(shape) == 2
        and 1 not in shape
        and indices[1] == "j"
        and (indices[0] == "i" or indices[0].startswith("(i + "))
    ):
        rows = int(indices[0].strip("()").removeprefix("i").removeprefix(" + ") or 0)
        return f"k + {rows * shape[1]}" if rows else "k"
    terms, stride = [], 1
    for index, size in zip(reversed(indices), reversed(shape), strict=True):
        if index != "0":
            terms.append(index if stride == 1 else f"{stride} * {index}")
        stride *= size
    text = " + ".join(reversed(terms)) or "0"
    return text[1:-1] if text.startswith("(i + ") and len(terms) == 1 else text
