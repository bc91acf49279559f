"""Calls, records, and the places that large values are written to."""

from __future__ import annotations

import ast
import dataclasses
import enum
import math
from types import FunctionType
from typing import Any

import numpy as np

from .arrays import ARRAY_FUNCTIONS, Arrays
from .expressions import MISSING
from .loops import UNARY, Expression, Step, array_at
from .program import Function
from .types import BOOL, DOUBLE, INT, Type, array_of, literal, safe

MATH = (math.sqrt, math.exp, math.expm1, math.log, math.erf, math.sin, math.cos, math.tan, math.copysign)
TESTS = (math.isnan, math.isinf)
"""Functions of the C library that Python's `math` calls."""


class Calls(Arrays):
    """Calls and records. A place is what would be assigned to, `*name` for what a pointer points to."""

    def array_function(self, called: Any) -> str:
        """The name of a function of arrays; empty for all else."""
        name = getattr(called, "__name__", "")
        name = f"np.{name}" if getattr(np, name, None) is called else name
        return name if name in ARRAY_FUNCTIONS else ""

    def _call(self, node: ast.Call, want: Type | None) -> Expression:
        value = self.known(node.func)
        if isinstance(node.func, ast.Attribute) and value is MISSING:
            base = self.plain(self.expr(node.func.value))
            if node.func.attr == "_replace":
                return self._replaced(base, node)
            return self._method(base, node.func.attr, node)
        if value in (float, bool, int):
            kind = {float: DOUBLE, int: INT, bool: BOOL}[value]
            e = self.plain(self.expr(node.args[0]))
            if kind == DOUBLE or e.type == kind:
                return self.coerced(e, kind)
            return Expression(f"({kind.c}){e.bound(UNARY)}", kind, UNARY)
        if value in (min, max, abs):
            return self._least(value.__name__, [self.operand(v) for v in node.args])
        if value is len:
            return Expression(str(self.expr(node.args[0]).type.shape[0]), INT)
        if value in MATH + TESTS:
            parts = [self.as_type(argument, DOUBLE) for argument in node.args]
            kind = BOOL if value in TESTS else DOUBLE
            return Expression(f"{value.__name__}({', '.join(part.text for part in parts)})", kind)
        if value is dataclasses.replace:
            return self._replaced(self.plain(self.expr(node.args[0])), node)
        if array := self.array_function(value):
            return self.array_call(array, node)
        if isinstance(value, type):
            kind = self.program.types.of(value, f"{self.source.file}:{node.lineno}")
            if issubclass(value, enum.Enum):
                return Expression(f"({kind.c}){self.expr(node.args[0]).bound(UNARY)}", kind, UNARY)
            if kind.big:
                name = self.temporary(kind)
                self.fill(name, kind, node)
                return Expression(name, kind)
            return self.record(kind, self.values_of(kind, node))
        if isinstance(value, FunctionType) or hasattr(value, "__func__"):
            return self.called(self.program.require(value), [], node)
        raise self.refuse(f"{ast.unparse(node.func)} is not known to the translator.")

    def _least(self, name: str, parts: list[Expression]) -> Expression:
        """`min`, `max` or `abs` of numbers."""
        if any(part.type.kind == "array" for part in parts):
            raise self.refuse(f"{name} of an array.")
        if name == "abs":
            return Expression(f"fabs({parts[0].text})", DOUBLE)
        kind = INT if all(part.type == INT for part in parts) else DOUBLE
        call = {"min": "least", "max": "most"}[name] + ("_int" if kind == INT else "_of")
        text = parts[0].text
        for part in parts[1:]:
            text = f"{call}({text}, {part.text})"
        return Expression(text, kind)

    def _attribute(self, node: ast.Attribute, want: Type | None) -> Expression:
        if self.known(node) is not MISSING:
            return self._global(node)
        base = self.plain(self.expr(node.value))
        kind = base.type.item if base.type.kind == "array" else base.type
        found = kind.found(node.attr)
        return self.field(base, found.name, found.type) if found else self._method(base, node.attr, None)

    def _method(self, base: Expression, name: str, node: ast.Call | None) -> Expression:
        """A method, or without a call a property."""
        method = getattr(base.type.python, name, None)
        method = method.fget if isinstance(method, property) else method
        if method is None or name in base.type.left_out:
            raise self.refuse(f"{base.type.c}.{name}: {base.type.left_out.get(name, 'is not known')}.")
        return self.called(self.program.require(method), [base], node)

    def called(
        self, function: Function, before: list[Expression], node: ast.Call | None, target: str = ""
    ) -> Expression:
        """A call; what is large is written to `target`, a pointer, or to a new variable."""
        parts = self._arguments(function, before, node)
        returns, kinds = function.returns, [kind for _, kind in function.parameters]
        spread = [p.type.kind == "array" and k.kind != "array" for p, k in zip(parts, kinds, strict=True)]
        if any(spread) and not (function.by_pointer or function.updates):
            form = f"{function.c}({', '.join(['{}'] * len(parts))})"
            return self.each(form, parts, [0] * len(parts), returns)
        texts = [self._passed(part, kind) for part, kind in zip(parts, kinds, strict=True)]
        if function.updates:
            if texts[0] != target:
                raise self.refuse(f"{function.c} changes its first argument: assign what it returns to that.")
            self.put(f"{function.c}({', '.join(texts)});")
            return Expression(target, returns, pointer=True)
        if not function.by_pointer:
            return Expression(f"{function.c}({', '.join(texts)})", returns)
        if self.lazy:
            raise self.refuse(f"{function.c} within a condition: give its result a name before.")
        name = target or self.temporary(returns)
        slot = target or (name if returns.kind == "array" else f"&{name}")
        self.put(f"{function.c}({', '.join([slot, *texts])});")
        return array_at(name, returns) if returns.kind == "array" else Expression(name, returns)

    def _arguments(
        self, function: Function, before: list[Expression], node: ast.Call | None
    ) -> list[Expression]:
        names, python = [name for name, _ in function.parameters], function.python
        given = dict(zip(names[len(before) :], node.args if node else [], strict=False)) | keywords_of(node)
        defaults = dict(zip(reversed(names), reversed(python.__defaults__ or ()), strict=False))
        defaults |= python.__kwdefaults__ or {}
        parts = list(before)
        for name, kind in function.parameters[len(before) :]:
            if name in given:
                e = self.expr(given[name], kind)
                parts.append(e if "array" in (e.type.kind, kind.kind) else self.coerced(e, kind))
            elif name in defaults:
                parts.append(Expression(literal(defaults[name], kind, self.source.file), kind))
            else:
                raise self.refuse(f"{function.c} is called without {name}.")
        return parts

    def _passed(self, e: Expression, kind: Type) -> str:
        """An argument as it is passed."""
        if kind.kind == "array":
            if e.type != kind:
                raise self.refuse(f"an array of shape {e.type.shape} where {kind.shape} is needed.")
            return self.placed(e)
        return f"&{e.text}" if kind.big and not e.pointer else e.text

    # Records

    def values_of(self, kind: Type, node: ast.Call) -> dict[str, Any]:
        """The values of a record's fields: expressions, or Python's defaults."""
        given: dict[str, Any] = dict(zip((f.name for f in kind.fields), node.args, strict=False))
        given |= keywords_of(node)
        for name in given:
            if kind.found(name) is None:
                raise self.refuse(f"{kind.c}.{name}: {kind.left_out.get(name, 'is not known')}.")
        for f in kind.fields:
            if f.name not in given:
                given[f.name] = default_of(kind.python, f.name)
                if given[f.name] is MISSING:
                    raise self.refuse(f"{kind.c} is made without {f.name}.")
        return given

    def record(self, kind: Type, given: dict[str, Any]) -> Expression:
        """A record of expressions, of their source, and of default values."""
        parts = []
        for f in kind.fields:
            value = given[f.name]
            value = self.expr(value, f.type) if isinstance(value, ast.expr) else value
            if isinstance(value, Expression):
                parts.append(value if value.type.kind == "array" else self.coerced(value, f.type))
            else:
                parts.append(Expression(literal(value, f.type, self.source.file), f.type))
        form = f"({kind.c}){{{{{', '.join(['{}'] * len(parts))}}}}}"
        return self.each(form, parts, [0] * len(parts), kind)

    def _replaced(self, base: Expression, node: ast.Call) -> Expression:
        """A record with some of its fields anew."""
        kind, given = base.type.item if base.type.kind == "array" else base.type, keywords_of(node)
        if kind.kind != "record" or kind.big:
            raise self.refuse(f"{base.type.c} with other fields, in an expression.")
        return self.record(kind, {f.name: self.field(base, f.name, f.type) for f in kind.fields} | given)

    def _tuple(self, node: ast.Tuple, want: Type | None) -> Expression:
        kind = want.item if want is not None and want.kind == "optional" else want
        if kind is None or kind.kind not in ("tuple", "record"):
            kind = self.program.types.tuple_of([self.expr(item).type for item in node.elts])
        if kind.kind == "tuple":
            listed = ", ".join(self.as_type(item, DOUBLE).text for item in node.elts)
            return Expression(f"({kind.c}){{{{{listed}}}}}", kind)
        return self.record(kind, dict(zip((f.name for f in kind.fields), node.elts, strict=True)))

    # Places

    def fill(self, place: str, kind: Type, value: Any) -> None:
        """Write an expression or a default value to a place."""
        if not isinstance(value, ast.expr):
            self._fill_default(place, kind, value)
        elif isinstance(value, ast.IfExp) and (kind.big or kind.kind == "array"):
            self.flush()
            self.put(f"if ({self.truth(value.test).text}) {{")
            for branch in (value.body, value.orelse):
                self.depth += 1
                self.fill(place, kind, branch)
                self.flush()
                self.depth -= 1
                self.put("} else {" if branch is value.body else "}")
        elif kind.kind == "array":
            self._fill_array(place, kind, value)
        elif kind.big:
            self._fill_record(place, kind, value)
        else:
            text = self.as_type(value, kind).text
            self.put(f"{place} = {text};")

    def _fill_default(self, place: str, kind: Type, value: Any) -> None:
        if kind.kind == "array":
            if any(value):
                raise self.refuse("an array whose default is not 0 everywhere.")
            self.put(f"memset({place}, 0, sizeof {place});")
        elif kind.big:
            for f in kind.fields:
                self.fill(part_of(place, f.name), f.type, getattr(value, f.name))
        else:
            self.put(f"{place} = {literal(value, kind, self.source.file)};")

    def _fill_array(self, place: str, kind: Type, node: ast.expr) -> None:
        called = self.known(node.func) if isinstance(node, ast.Call) else None
        if isinstance(node, ast.Call) and called is np.array and isinstance(node.args[0], ast.List):
            row = array_of(DOUBLE, kind.shape[1:])
            for index, value in enumerate(node.args[0].elts):
                self.fill(f"{place} + {index * row.size}", row, value)
            return
        if (
            isinstance(node, ast.Call)
            and isinstance(called, FunctionType)
            and not self.array_function(called)
        ):
            function = self.program.require(called)
            if function.returns == kind:
                self.flush()
                self.called(function, [], node, place)
                return
        e = self.expr(node)
        if e.type.kind == "array" and e.type.shape != kind.shape:
            raise self.refuse(f"an array of shape {e.type.shape} where {kind.shape} is needed.")
        self.step(Step(place, e))

    def _fill_record(self, place: str, kind: Type, node: ast.expr) -> None:
        if isinstance(node, ast.Call):
            called = self.known(node.func)
            if getattr(called, "__name__", "") == "stacked":
                self._fill_stacked(place, kind, node)
                return
            if isinstance(called, type):
                values = self.values_of(kind, node)
                # Those first that can share the loop that waits.
                for f in sorted(kind.fields, key=lambda f: f.type.shape != self.waiting_shape):
                    self.fill(part_of(place, f.name), f.type, values[f.name])
                return
            if called is not MISSING:
                self.flush()
                address = place[1:] if place.startswith("*") else f"&{place}"
                self.called(self.program.require(called), [], node, address)
                return
            if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
                self.fill(place, kind, node.func.value)
                self.flush()
                self.replace_in(place, kind, node)
                return
        e = self.expr(node)
        if e.type != kind:
            raise self.refuse(f"{e.type.c} where {kind.c} is needed.")
        if e.text != place:
            self.put(f"{place} = {e.value};")

    def _fill_stacked(self, place: str, kind: Type, node: ast.Call) -> None:
        """Write rows of records under each other to the arrays of a record."""
        row = 0
        for part in [self.expr(argument) for argument in node.args]:
            name = self.new_name()
            self.step(Step(name, part, name))
            rows = self.local_array(name, part.type)
            for f in kind.fields:
                self.step(Step(part_of(place, f.name), self.field(rows, f.name, f.type.item), row=row))
            row += part.type.shape[0]

    def replace_in(self, place: str, kind: Type, node: ast.Call) -> None:
        """Set fields of a record in place; what they become is worked out before."""
        later: list[tuple[str, Type, Any]] = []
        for name, value in keywords_of(node).items():
            field, simple = kind.found(name), isinstance(value, ast.Name | ast.Constant)
            if field is None:
                raise self.refuse(f"{kind.c} has no field {name}.")
            slot = part_of(place, name)
            if not (field.type.big or field.type.kind == "array"):
                e = self.as_type(value, field.type)
                self.flush()
                later.append((slot, field.type, e if simple else self.named(e)))
            elif simple:
                later.append((slot, field.type, value))
            else:
                raise self.refuse(f"{name} is not worked out yet: give it a name before.")
        for slot, field_type, what in later:
            if isinstance(what, Expression):
                self.put(f"{slot} = {what.text};")
            else:
                self.fill(slot, field_type, what)
                self.flush()


def keywords_of(node: ast.Call | None) -> dict[str, ast.expr]:
    """What a call is given by name."""
    return {str(keyword.arg): keyword.value for keyword in node.keywords} if node else {}


def part_of(place: str, name: str) -> str:
    """A field of a place."""
    return f"{place[1:]}->{safe(name)}" if place.startswith("*") else f"{place}.{safe(name)}"


def default_of(python: Any, name: str) -> Any:
    """A field's default, or MISSING."""
    if hasattr(python, "_field_defaults"):
        return python._field_defaults.get(name, MISSING)
    item = python.__dataclass_fields__[name]
    if item.default is not dataclasses.MISSING:
        return item.default
    return MISSING if item.default_factory is dataclasses.MISSING else item.default_factory()
