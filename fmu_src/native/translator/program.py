"""All functions, types and constants that are needed, and the two files of C that they make."""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType
from typing import Any, get_type_hints

import numpy as np

from .source import Unsupported, definition, source_of, summary
from .types import ARRAY, Type, Types, comment, initialiser, safe

WIDTH = 110

PRELUDE = """\
#ifdef __FAST_MATH__
#error "Compile without fast math: the results would be others."
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* As Python has them: the first operand where neither is less, also with NaN. */
static inline double least_of(double a, double b) { return b < a ? b : a; }
static inline double most_of(double a, double b) { return b > a ? b : a; }
static inline int least_int(int a, int b) { return b < a ? b : a; }
static inline int most_int(int a, int b) { return b > a ? b : a; }
/* As numpy has them: NaN where either is. */
static inline double minimum(double a, double b) { return a < b || a != a ? a : b; }
static inline double maximum(double a, double b) { return a > b || a != a ? a : b; }
static inline int floor_divided(int a, int b) { return a / b - ((a % b != 0) && ((a < 0) != (b < 0))); }
/* Whether a is sorted before b, NaN last. */
static inline bool before(double a, double b) { return a < b || (b != b && a == a); }
"""


@dataclass(frozen=True)
class Function:
    """A function or method of Python's and its form in C.

    `updates` tells that its first argument is changed in place to what it returns, `inline` that loops call it for each
    element of an array.
    """

    python: Any
    node: ast.FunctionDef
    c: str
    returns: Type
    parameters: tuple[tuple[str, Type], ...]
    updates: bool
    inline: bool

    @property
    def private(self) -> bool:
        """Whether only the file itself calls it: its name begins with an underscore, or loops call it."""
        return self.inline or self.node.name.startswith("_")

    @property
    def by_pointer(self) -> bool:
        """Whether the result is written to a place that is given."""
        return not self.updates and (self.returns.big or self.returns.kind == "array")

    @property
    def file(self) -> str:
        """File and line."""
        return f"{source_of(self.python.__module__).file}:{self.node.lineno}"

    def head(self) -> str:
        """Its declaration without a semicolon."""
        listed = [f"{self.returns.c} *restrict result"] if self.by_pointer else []
        for index, (name, kind) in enumerate(self.parameters):
            by_pointer, changed = (
                kind.kind == "array" or kind.big,
                kind.mutable or (self.updates and not index),
            )
            constant = "const " if by_pointer and not changed else ""
            listed.append(f"{constant}{kind.c} {'*' * by_pointer}{safe(name)}")
        by_value = not (self.by_pointer or self.updates or self.returns.kind == "nothing")
        words = "static " * self.private + "inline " * self.inline + (self.returns.c if by_value else "void")
        return f"{words} {self.c}({', '.join(listed) or 'void'})"


class Program:
    """What is translated: the functions that `require` was asked for, and all that these need."""

    def __init__(self, translate: Callable[[Program, Function], list[str]]) -> None:
        self.types = Types()
        self.functions: dict[Any, Function] = {}
        self.bodies: dict[str, list[str]] = {}
        self.constants: dict[str, str] = {}
        self.helpers: dict[str, str] = {}
        self._values: dict[str, Any] = {}
        self._translate = translate

    def require(self, python: Any) -> Function:
        """The form in C of a function, which is translated with all that it needs."""
        python = getattr(python, "__func__", python)
        if python in self.functions:
            return self.functions[python]
        if not isinstance(python, FunctionType):
            raise Unsupported(f"{python!r} is no function in Python.")
        function = self._function(python)
        if function.c in self.bodies:
            raise Unsupported(f"{function.file}: another function has the same name in C, {function.c}.")
        self.functions[python], self.bodies[function.c] = function, []
        self.bodies[function.c] = self._translate(self, function)
        return function

    def _function(self, python: FunctionType) -> Function:
        node = definition(python)
        where = f"{source_of(python.__module__).file}:{node.lineno}"
        if node.args.vararg or node.args.kwarg:
            raise Unsupported(f"{where}: {node.name} takes any number of arguments.")
        hints = get_type_hints(python, include_extras=True)
        owner = python.__qualname__.rpartition(".")[0]
        if owner:
            hints["self"] = getattr(sys.modules[python.__module__], owner)
        names = [name for name in inspect.signature(python).parameters if name != "cls"]
        for name in names:
            if name not in hints:
                raise Unsupported(f"{where}: {name} has no type.")
        parameters = tuple((name, self.types.of(hints[name], where)) for name in names)
        returns = self.types.of(hints.get("return"), where)
        c = f"{owner or python.__module__.rpartition('.')[2]}_{node.name.lstrip('_')}"
        updates = returns.big and bool(names) and parameters[0][1] == returns and _updates(node, names[0])
        return Function(python, node, c, returns, parameters, updates, ARRAY in hints.values())

    def constant(self, module: str, name: str, value: Any) -> tuple[str, Type]:
        """The name in C of a module's constant, and its type."""
        where = f"{source_of(module).file}: {name}"
        kind, c = self.types.of_value(value, where), name.lstrip("_")
        first = self._values.setdefault(c, value)
        if first is not value and not np.array_equal(first, value):
            c = f"{module.rpartition('.')[2].upper()}_{c}"
        size = f"[{kind.size}]" if kind.kind == "array" else ""
        self.constants[c] = f"static const {kind.c} {c}{size} = {initialiser(value, kind, where)};"
        return c, kind

    def texts(self, name: str, note: str) -> tuple[str, str]:
        """Header and code; `note` is their first line."""
        functions = list(self.functions.values())
        public = [f"{f.head()};" for f in functions if not f.private]
        private = [f"{f.head()};" for f in functions if f.private]
        guard = f"{name.upper()}_H"
        header = [
            comment(note), f"#ifndef {guard}", f"#define {guard}", "", "#include <stdbool.h>", "",
            *self.types.definitions(), *public, "", "#endif", "",
        ]  # fmt: skip
        code = [
            comment(note), f'#include "{name}.h"', "", "#include <math.h>", "#include <string.h>", "", PRELUDE,
            *self.helpers.values(), "", *self.constants.values(), "", *private, "",
        ]  # fmt: skip
        for f in functions:
            code += [comment(f"{summary(f.node)} ({f.file})"), f.head(), *self.bodies[f.c], ""]
        return _file(header), _file(code)


def _updates(node: ast.FunctionDef, first: str) -> bool:
    """Whether every return of a function gives its first argument, changed or not."""

    def is_first(value: ast.expr | None) -> bool:
        if isinstance(value, ast.Name):
            return value.id == first
        if not isinstance(value, ast.Call):
            return False
        if isinstance(value.func, ast.Attribute) and value.func.attr == "_replace":
            return is_first(value.func.value)
        return isinstance(value.func, ast.Name) and bool(value.args) and is_first(value.args[0])

    returned = [n.value for n in ast.walk(node) if isinstance(n, ast.Return)]
    return bool(returned) and all(is_first(value) for value in returned)


def _file(parts: list[str]) -> str:
    return "\n".join(part for line in "\n".join(parts).split("\n") for part in wrapped(line))


def wrapped(line: str) -> list[str]:
    """A line broken where it is too wide, after a comma or before an operator; a comment where a word ends."""
    lines: list[str] = []
    while len(line) > WIDTH and " " in line[24:WIDTH] and not line.startswith("#"):
        inside = line.find("/*")
        marks = (", ", " && ", " || ", " ? ", " : ", " + ", " - ", " * ", " = ")
        cut = max(line.rfind(mark, 24, WIDTH) + (2 if mark == ", " else 1) for mark in marks)
        if cut < 24 or 0 <= inside < cut:
            cut = line.rfind(" ", 24, WIDTH) + 1
        lines.append(line[:cut].rstrip())
        indent = re.match(r" *", lines[0]).group()  # type: ignore[union-attr]
        line = f"{indent}{'   ' if 0 <= inside < cut else '    '}{line[cut:].lstrip()}"
    return [*lines, line]
