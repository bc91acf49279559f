"""Calls, records, and the places that large values are written to."""

from __future__ import annotations

import ast
import dataclasses
import enum
import inspect
import math
from collections.abc import Iterable
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
    """Calls and records. A `target` is what is assigned to, `*name` for what a pointer points to."""

    def array_function(self, called: Any) -> str:
        """The name of a function of arrays; empty for all else."""
        name = getattr(called, "__name__", "")
        name = f"np.{name}" if getattr(np, name, None) is called else name
        return name if name in ARRAY_FUNCTIONS else ""

    def translated(self, called: Any) -> bool:
        """Whether a function has to be translated."""
        is_function = isinstance(called, FunctionType) or hasattr(called, "__func__")
        return is_function and not self.array_function(called)

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
            return self.record(kind, self.given(value, kind.slots, node))
        if self.translated(value):
            return self.called(self.program.require(value), [], node)
        raise self.refuse(f"{ast.unparse(node.func)} is not known to the translator.")

    def _least(self, name: str, parts: list[Expression]) -> Expression:
        """`min`, `max` or `abs` of numbers."""
        if any(part.type.kind == "array" for part in parts):
            raise self.refuse(f"{name} of an array.")
        if name == "abs":
            return Expression(f"fabs({self.coerced(parts[0], DOUBLE).text})", DOUBLE)
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
        returns, slots = function.returns, dict(function.parameters)
        parts = self.parts_of(slots, self.given(function.python, slots, node, before))
        pairs = list(zip(parts, slots.values(), strict=True))
        if any(p.type.kind == "array" and k.kind != "array" for p, k in pairs) and not (
            function.by_pointer or function.updates
        ):
            form = f"{function.c}({', '.join(['{}'] * len(parts))})"
            return self.each(form, parts, [0] * len(parts), returns)
        texts = [self._passed(part, kind) for part, kind in pairs]
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

    def _passed(self, e: Expression, kind: Type) -> str:
        """An argument as it is passed."""
        if kind.kind == "array":
            if e.type != kind:
                raise self.refuse(f"an array of shape {e.type.shape} where {kind.shape} is needed.")
            return self.placed(e)
        return f"&{e.text}" if kind.big and not e.pointer else e.text

    def given(
        self, python: Any, names: Iterable[str], node: ast.Call | None, before: Iterable[Expression] = ()
    ) -> dict[str, Any]:
        """What a function or a class is given, by name: expressions, their source, or Python's defaults."""
        given = dict(zip(names, [*before, *(node.args if node else ())], strict=False)) | keywords_of(node)
        self.check_names(python.__name__, names, given)
        for name in names:
            if name not in given:
                given[name] = default_of(python, name)
                if given[name] is inspect.Parameter.empty:
                    raise self.refuse(f"{python.__name__} without {name}.")
        return given

    def check_names(self, what: str, names: Iterable[str], given: Iterable[str]) -> None:
        """Unsupported where something is given that has no name in C."""
        for name in given:
            if name not in names:
                raise self.refuse(f"{what} has no {name} in C.")

    def parts_of(self, slots: dict[str, Type], given: dict[str, Any]) -> list[Expression]:
        """What is given, each as the type that is needed; an array is taken element by element."""
        parts = []
        for name, kind in slots.items():
            value = given[name]
            if isinstance(value, ast.expr):
                value = self.expr(value, kind)
            elif not isinstance(value, Expression):
                value = Expression(literal(value, kind, self.source.file), kind)
            parts.append(value if "array" in (value.type.kind, kind.kind) else self.coerced(value, kind))
        return parts

    # Records

    def record(self, kind: Type, given: dict[str, Any]) -> Expression:
        """A record of what its fields are given."""
        parts = self.parts_of(kind.slots, given)
        form = f"({kind.c}){{{{{', '.join(['{}'] * len(parts))}}}}}"
        return self.each(form, parts, [0] * len(parts), kind)

    def _replaced(self, base: Expression, node: ast.Call) -> Expression:
        """A record with some of its fields anew."""
        kind, given = base.type.item if base.type.kind == "array" else base.type, keywords_of(node)
        if kind.kind != "record" or kind.big:
            raise self.refuse(f"{base.type.c} with other fields, in an expression.")
        self.check_names(kind.c, kind.slots, given)
        return self.record(
            kind, {name: self.field(base, name, of) for name, of in kind.slots.items()} | given
        )

    def _tuple(self, node: ast.Tuple, want: Type | None) -> Expression:
        kind = want.item if want is not None and want.kind == "optional" else want
        items: list[Any] = list(node.elts)
        if kind is None or kind.kind not in ("tuple", "record"):
            items = [self.expr(item) for item in items]
            kind = self.program.types.tuple_of([item.type for item in items])
        if kind.kind == "record":
            return self.record(kind, dict(zip(kind.slots, items, strict=True)))
        slots = {str(index): DOUBLE for index in range(kind.size)}
        parts = self.parts_of(slots, dict(zip(slots, items, strict=True)))
        return Expression(f"({kind.c}){{{{{', '.join(part.text for part in parts)}}}}}", kind)

    # Large values

    def fill(self, target: str, kind: Type, value: Any) -> None:
        """Write an expression or a default value to a target."""
        if not isinstance(value, ast.expr):
            self._fill_default(target, kind, value)
        elif not (kind.big or kind.kind == "array"):
            text = self.as_type(value, kind).text
            self.put(f"{target} = {text};")
        elif isinstance(value, ast.IfExp):
            self.flush()
            self.put(f"if ({self.truth(value.test).text}) {{")
            for branch in (value.body, value.orelse):
                self.depth += 1
                self.fill(target, kind, branch)
                self.flush()
                self.depth -= 1
                self.put("} else {" if branch is value.body else "}")
        elif isinstance(value, ast.Call):
            self._fill_called(target, kind, value, self.known(value.func))
        else:
            self._fill_large(target, kind, self.expr(value))

    def _fill_default(self, target: str, kind: Type, value: Any) -> None:
        if kind.kind == "array":
            if any(value):
                raise self.refuse("an array whose default is not 0 everywhere.")
            self.put(f"memset({target}, 0, sizeof {target});")
        elif kind.big:
            for name, of in kind.slots.items():
                self.fill(part_of(target, name), of, getattr(value, name))
        else:
            self.put(f"{target} = {literal(value, kind, self.source.file)};")

    def _fill_large(self, target: str, kind: Type, e: Expression) -> None:
        if kind.kind == "array":
            if e.type.kind == "array" and e.type.shape != kind.shape:
                raise self.refuse(f"an array of shape {e.type.shape} where {kind.shape} is needed.")
            self.step(Step(target, e))
        elif e.type != kind:
            raise self.refuse(f"{e.type.c} where {kind.c} is needed.")
        elif e.text != target:
            self.put(f"{target} = {e.value};")

    def _fill_called(self, target: str, kind: Type, node: ast.Call, called: Any) -> None:
        if isinstance(called, type):
            values = self.given(called, kind.slots, node)
            # Those first that can share the loop that waits.
            for f in sorted(kind.fields, key=lambda f: f.type.shape != self.waiting_shape):
                self.fill(part_of(target, f.name), f.type, values[f.name])
        elif isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
            self.fill(target, kind, node.func.value)
            self.flush()
            self.replace_in(target, kind, node)
        elif getattr(called, "__name__", "") == "stacked":
            self._fill_stacked(target, kind, node)
        elif called is np.array and isinstance(node.args[0], ast.List):
            row = array_of(DOUBLE, kind.shape[1:])
            for index, value in enumerate(node.args[0].elts):
                self.fill(f"{target} + {index * row.size}", row, value)
        elif self.translated(called) and self.program.require(called).returns == kind:
            self.flush()
            slot = target if kind.kind == "array" else target[1:] if target.startswith("*") else f"&{target}"
            self.called(self.program.require(called), [], node, slot)
        else:
            self._fill_large(target, kind, self.expr(node))

    def _fill_stacked(self, target: str, kind: Type, node: ast.Call) -> None:
        """Write rows of records under each other to the arrays of a record."""
        row = 0
        for part in [self.expr(argument) for argument in node.args]:
            name = self.new_name()
            self.step(Step(name, part, name))
            rows = self.local_array(name, part.type)
            for f in kind.fields:
                self.step(Step(part_of(target, f.name), self.field(rows, f.name, f.type.item), row=row))
            row += part.type.shape[0]

    def replace_in(self, target: str, kind: Type, node: ast.Call) -> None:
        """Set fields of a record; what they become is worked out before."""
        self.check_names(kind.c, kind.slots, keywords_of(node))
        later: list[tuple[str, Any]] = []
        for name, value in keywords_of(node).items():
            of = kind.slots[name]
            if isinstance(value, ast.Name | ast.Constant):
                later.append((name, value))
            elif of.big or of.kind == "array":
                raise self.refuse(f"{name} is not worked out yet: give it a name before.")
            else:
                e = self.as_type(value, of)
                self.flush()
                later.append((name, self.named(e)))
        for name, what in later:
            if isinstance(what, Expression):
                self.put(f"{part_of(target, name)} = {what.text};")
            else:
                self.fill(part_of(target, name), kind.slots[name], what)
                self.flush()


def keywords_of(node: ast.Call | None) -> dict[str, ast.expr]:
    """What a call is given by name."""
    return {str(keyword.arg): keyword.value for keyword in node.keywords} if node else {}


def part_of(target: str, name: str) -> str:
    """A field of a target."""
    return f"{target[1:]}->{safe(name)}" if target.startswith("*") else f"{target}.{safe(name)}"


def default_of(python: Any, name: str) -> Any:
    """The default of a function's parameter or of a record's field; `inspect.Parameter.empty` for none."""
    field = getattr(python, "__dataclass_fields__", {}).get(name)
    if field is not None and field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return inspect.signature(python).parameters[name].default
