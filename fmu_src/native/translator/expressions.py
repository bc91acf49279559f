"""Expressions of one function."""

from __future__ import annotations

import ast
import builtins
import dataclasses
import enum
import math
import re
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from .program import Function, Program
from .source import Unsupported, source_of
from .types import (
    AND,
    ATOM,
    BOOL,
    DOUBLE,
    INT,
    NOTHING,
    OR,
    PRODUCT,
    RELATION,
    SUM,
    TERNARY,
    UNARY,
    Expression,
    Type,
    array_at,
    array_of,
    declared,
    literal,
    safe,
)

_MATH = (
    "sqrt exp expm1 log log1p erf sin cos tan atan atan2 floor ceil copysign tanh fabs isinf isnan isfinite"
)
MATH = frozenset(_MATH.split())
BINARY = {
    ast.Add: ("+", SUM),
    ast.Sub: ("-", SUM),
    ast.Mult: ("*", PRODUCT),
    ast.Div: ("/", PRODUCT),
    ast.BitOr: ("|", RELATION),
}
COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
MISSING = object()


class Expressions:
    """What the expressions of a function are in C."""

    def __init__(self, program: Program, function: Function) -> None:
        self.program, self.function = program, function
        self.source = source_of(function.python.__module__)
        self.parameters = dict(function.parameters)
        self.locals: dict[str, Type] = {}
        self.aliases: dict[str, Expression] = {}
        self.final = False
        self.lazy = 0
        """How many conditional expressions enclose the one at hand."""
        self.temporaries = 0

    def refuse(self, node: ast.AST, why: str) -> Unsupported:
        """What to raise about a node."""
        return Unsupported(f"{self.source.file}:{getattr(node, 'lineno', '?')}: {why}")

    # Of the statements and loops

    def put(self, text: str) -> None:
        """Write a line."""
        raise NotImplementedError

    def flush(self) -> None:
        """Write the loops that are waiting."""
        raise NotImplementedError

    def waiting(self, name: str) -> bool:
        """Whether an array is worked out in a loop that is not yet written."""
        raise NotImplementedError

    def placed(self, e: Expression) -> str:
        """The address of an array that is worked out."""
        raise NotImplementedError

    def local_array(self, name: str, kind: Type) -> Expression:
        """A local array."""
        raise NotImplementedError

    def array_call(self, name: str, node: ast.Call) -> Expression | None:
        """A call of one of the functions of arrays; None for another one."""
        raise NotImplementedError

    def fill(self, target: str, kind: Type, node: ast.expr) -> None:
        """Write a value that has an array in it to a place."""
        raise NotImplementedError

    # Values

    def as_type(self, node: ast.expr, kind: Type, binds: int = 0) -> str:
        """The text of an expression as a value of a type."""
        return self.coerced(self.expr(node, kind), kind, node).bound(binds)

    def coerced(self, e: Expression, kind: Type, node: ast.AST) -> Expression:
        """An expression as a value of a type."""
        if e.type == kind:
            return e
        if e.type.number and kind.number and (kind == DOUBLE or e.type == BOOL):
            return Expression(e.text, kind, e.binds)
        if kind.kind == "optional" and kind.item is not None:
            if e.type == NOTHING:
                return Expression(literal(None, kind, ""), kind)
            held = self.coerced(e, kind.item, node)
            return Expression(f"({kind.c}){{true, {'*' if held.pointer else ''}{held.text}}}", kind)
        if e.type.kind == "optional":
            return self.coerced(self.plain(e), kind, node)
        if e.type.kind == "array" and e.type.size == 1 and kind == DOUBLE and e.at is not None:
            return e.at(("0",) * len(e.type.shape))
        if not self.final and e.type == NOTHING:
            return Expression(e.text, kind)
        raise self.refuse(node, f"{e.type.c} where {kind.c} is needed.")

    def plain(self, e: Expression) -> Expression:
        """What an optional holds; that it holds something mypy has shown."""
        return e.member("value", e.type.item) if e.type.kind == "optional" and e.type.item else e

    def operand(self, node: ast.expr) -> Expression:
        """An operand of arithmetic."""
        e = self.plain(self.expr(node))
        number = e.type.item if e.type.kind == "array" else e.type
        if not (number and number.number) and (self.final or e.type != NOTHING):
            raise self.refuse(node, f"arithmetic with {e.type.c}.")
        return e

    def truth(self, node: ast.expr) -> Expression:
        """What Python takes for true."""
        if isinstance(node, ast.BoolOp):
            sign, binds = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
            parts = [self.truth(node.values[0])]
            self.lazy += 1
            parts += [self.truth(value) for value in node.values[1:]]
            self.lazy -= 1
            # The brackets about && inside of || are for the reader, and for gcc -Wall.
            inner = RELATION if binds == OR else AND + 1
            return Expression(f" {sign} ".join(part.bound(inner) for part in parts), BOOL, binds)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return Expression(f"!{self.truth(node.operand).bound(UNARY)}", BOOL, UNARY)
        e = self.expr(node)
        if e.type == BOOL or not (self.final or e.type != NOTHING):
            return e
        if e.type.number:
            return Expression(
                f"{e.bound(RELATION + 1)} != {'0.0' if e.type == DOUBLE else '0'}", BOOL, RELATION
            )
        if e.type.kind == "optional" and e.type.item is not None:
            held = f"{e.bound(ATOM)}.has"
            if e.type.item.number:
                return Expression(f"{held} && {e.bound(ATOM)}.value != 0", BOOL, AND)
            return Expression(held, BOOL)
        raise self.refuse(node, f"the truth of {e.type.c}.")

    def expr(self, node: ast.expr, want: Type | None = None) -> Expression:
        """An expression; `want` is the type that it will be taken for."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, f"the expression {type(node).__name__} is not known to the translator.")
        made: Expression = method(node, want)
        return made

    def elementwise(self, parts: list[Expression], make: Any, item: Type, node: ast.AST) -> Expression:
        """An expression of every element where a part is an array, else of the parts themselves."""
        if not any(part.type.kind == "array" for part in parts):
            made: Expression = make(parts)
            return made
        parts = [self.named(p) if p.type.kind != "array" and re.search(r"\w\(", p.text) else p for p in parts]
        shapes = [part.type.shape for part in parts if part.type.kind == "array"]
        try:
            shape = np.broadcast_shapes(*shapes)
        except ValueError as error:
            raise self.refuse(node, f"shapes that do not broadcast: {error}.") from error

        def at(indices: tuple[str, ...]) -> Expression:
            whole: Expression = make([element(part, indices) for part in parts])
            return whole

        names = frozenset[str]().union(*(part.names for part in parts))
        return Expression("", array_of(item, shape), at=at, names=names)

    def _constant(self, node: ast.Constant, want: Type | None) -> Expression:
        value = node.value
        if value is None:
            return Expression("none", NOTHING)
        if isinstance(value, bool):
            return Expression(str(value).lower(), BOOL)
        if isinstance(value, int | float):
            kind = DOUBLE if isinstance(value, float) or want == DOUBLE else INT
            return Expression(literal(value, kind, ""), kind)
        raise self.refuse(node, f"the constant {value!r}.")

    def _name(self, node: ast.Name, want: Type | None) -> Expression:
        name = node.id
        if name in self.aliases:
            return self.aliases[name]
        kind = self.parameters.get(name) or self.locals.get(name)
        if kind is None:
            return self._global(node)
        if kind.kind == "array":
            if name in self.parameters:
                return array_at(safe(name), kind)
            return self.local_array(name, kind)
        return Expression(safe(name), kind, pointer=kind.big and name in self.parameters)

    def known(self, node: ast.expr) -> Any:
        """The value that a name or attribute has in the module; MISSING where it is none."""
        if isinstance(node, ast.Name) and node.id not in self.parameters | self.locals | self.aliases:
            return self.function.python.__globals__.get(node.id, getattr(builtins, node.id, MISSING))
        if isinstance(node, ast.Attribute):
            owner = self.known(node.value)
            if isinstance(owner, ModuleType | type):
                return getattr(owner, node.attr, MISSING)
        return MISSING

    def _global(self, node: ast.Name | ast.Attribute) -> Expression:
        value = self.known(node)
        name = node.id if isinstance(node, ast.Name) else node.attr
        if value is MISSING or callable(value) or isinstance(value, ModuleType):
            raise self.refuse(node, f"{ast.unparse(node)} is not known here.")
        if isinstance(value, enum.Enum):
            kind = self.program.types.of(type(value), self.source.file)
            return Expression(f"{kind.c}_{value.name}", kind)
        if isinstance(value, float | int) and (math.isinf(value) or math.isnan(value)):
            return Expression(literal(value, DOUBLE, ""), DOUBLE)
        text, kind = self.program.constant(self.function.python.__module__, name, value)
        return array_at(text, kind) if kind.kind == "array" else Expression(text, kind)

    def _attribute(self, node: ast.Attribute, want: Type | None) -> Expression:
        if self.known(node) is not MISSING:
            return self._global(node)
        base = self.plain(self.expr(node.value))
        if base.type.kind == "array":
            item = base.type.item
            found = item.found(node.attr) if item else None
            if found is None:
                raise self.refuse(node, f"an array's {node.attr}.")
            return self.elementwise(
                [base], lambda parts: parts[0].member(found.name, found.type), found.type, node
            )
        if base.type.kind == "enum" and node.attr == "value":
            return Expression(f"(int){base.bound(UNARY)}", INT, UNARY)
        found = base.type.found(node.attr) if base.type.kind == "record" else None
        if found is not None:
            return base.member(found.name, found.type)
        method = getattr(base.type.python, node.attr, None)
        if isinstance(method, property):
            return self.called(self.program.require(method.fget), [base], node, [], {})
        why = base.type.left_out.get(node.attr, "is not known")
        raise self.refuse(node, f"{base.type.c}.{node.attr}: {why}.")

    def _subscript(self, node: ast.Subscript, want: Type | None) -> Expression:
        base = self.plain(self.expr(node.value))
        if base.type.kind == "tuple":
            return Expression(f"{base.bound(ATOM)}.at[{self.index(node.slice)}]", DOUBLE)
        if base.type.kind == "record" and isinstance(node.slice, ast.Constant):
            f = base.type.fields[self.whole(node.slice)]
            return base.member(f.name, f.type)
        if base.type.kind != "array":
            raise self.refuse(node, f"an index into {base.type.c}.")
        return self._part(base, node)

    def index(self, node: ast.expr) -> str:
        """A whole number as index."""
        e = self.expr(node)
        if e.type.kind not in ("int", "enum") and self.final:
            raise self.refuse(node, f"an index that is {e.type.c}.")
        return e.text

    def _part(self, base: Expression, node: ast.Subscript) -> Expression:
        """Part of an array: rows by a slice, a row or an element by index, an axis more or less."""
        for name in base.names:
            if self.waiting(name):
                self.flush()
        given = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        shape, takes, left = [], [], list(base.type.shape)
        for part in given:
            if isinstance(part, ast.Constant) and part.value is None:
                shape.append(1)
                takes.append(("new", ""))
            elif isinstance(part, ast.Slice):
                size = left.pop(0)
                low = 0 if part.lower is None else self.whole(part.lower)
                high = size if part.upper is None else min(self.whole(part.upper), size)
                shape.append(high - low)
                takes.append(("from", str(low)))
            else:
                left.pop(0)
                takes.append(("at", self.index(part)))
        shape += left
        kind = array_of(base.type.item or DOUBLE, tuple(shape))

        def at(indices: tuple[str, ...]) -> Expression:
            own, given_indices = [], list(indices)
            for sort, text in takes:
                if sort == "at":
                    own.append(text)
                else:
                    index = given_indices.pop(0)
                    if sort == "from":
                        own.append(index if text == "0" else added(index, text))
            return base.at((*own, *given_indices))  # type: ignore[misc]

        if not shape:
            return at(())
        address = ""
        if base.address and len(takes) == 1 and takes[0][0] != "new":
            stride = kind.size if takes[0][0] == "at" else kind.size // kind.shape[0]
            address = f"{base.address} + {stride} * {takes[0][1]}" if takes[0][1] != "0" else base.address
        return Expression(address, kind, at=at, names=base.names, address=address, part=True)

    def whole(self, node: ast.expr) -> int:
        """A whole number that is known when translating."""
        value = node.value if isinstance(node, ast.Constant) else self.known(node)
        if not isinstance(value, int):
            raise self.refuse(node, f"{ast.unparse(node)} is no number known here.")
        return value

    def _tuple(self, node: ast.Tuple, want: Type | None) -> Expression:
        kind = want.item if want is not None and want.kind == "optional" else want
        if kind is None or kind.kind not in ("tuple", "record"):
            kind = self.program.types.tuple_of([self.expr(item).type for item in node.elts])
        if kind.kind == "tuple":
            return Expression(
                f"({kind.c}){{{{{', '.join(self.as_type(v, DOUBLE) for v in node.elts)}}}}}", kind
            )
        values = dict(zip((f.name for f in kind.fields), node.elts, strict=True))
        return self.record(kind, values, node)

    def _unaryop(self, node: ast.UnaryOp, want: Type | None) -> Expression:
        if isinstance(node.op, ast.Not):
            return self.truth(node)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(node, "an operator that is not known to the translator.")
        e = self.operand(node.operand)
        item = e.type.item or e.type
        return self.elementwise(
            [e], lambda parts: Expression(f"-{parts[0].bound(ATOM)}", item, UNARY), item, node
        )

    def _binop(self, node: ast.BinOp, want: Type | None) -> Expression:
        left, right = self.operand(node.left), self.operand(node.right)
        if isinstance(node.op, ast.Pow):
            raise self.refuse(
                node, "a power, whose last bit differs between compilers: multiply, or take math.sqrt."
            )
        if isinstance(node.op, ast.FloorDiv) and left.type == right.type == INT:
            return Expression(f"floor_divided({left.text}, {right.text})", INT)
        if type(node.op) not in BINARY:
            raise self.refuse(node, f"the operator {type(node.op).__name__} is not known to the translator.")
        sign, binds = BINARY[type(node.op)]
        kinds = [e.type.item or e.type for e in (left, right)]
        kind = INT if all(k in (INT, BOOL) for k in kinds) else DOUBLE
        if kind == INT and sign == "/":
            raise self.refuse(node, "a division of whole numbers, which C would round.")
        if kind != INT and sign == "|":
            raise self.refuse(node, "bits of something else than whole numbers.")

        def make(parts: list[Expression]) -> Expression:
            return Expression(f"{parts[0].bound(binds)} {sign} {parts[1].bound(binds + 1)}", kind, binds)

        return self.elementwise([left, right], make, kind, node)

    def _boolop(self, node: ast.BoolOp, want: Type | None) -> Expression:
        first = self.plain(self.expr(node.values[0]))
        if isinstance(node.op, ast.Or) and first.type in (DOUBLE, INT) and len(node.values) == 2:
            second, test = (
                self.coerced(self.expr(node.values[1]), first.type, node),
                self.truth(node.values[0]),
            )
            return Expression(
                f"{test.bound(OR)} ? {first.bound(OR)} : {second.bound(TERNARY)}", first.type, TERNARY
            )
        if self.final and any(self.expr(value).type != BOOL for value in node.values):
            raise self.refuse(node, "`and` or `or` of something else than truths.")
        return self.truth(node)

    def _ifexp(self, node: ast.IfExp, want: Type | None) -> Expression:
        test = self.truth(node.test)
        self.lazy += 1
        yes, no = self.expr(node.body, want), self.expr(node.orelse, want)
        kind = want if want is not None and want.kind != "array" else self.joined(yes.type, no.type, node)
        yes, no = self.coerced(yes, kind, node), self.coerced(no, kind, node)
        self.lazy -= 1
        return Expression(f"{test.bound(OR)} ? {yes.bound(OR)} : {no.bound(TERNARY)}", kind, TERNARY)

    def joined(self, first: Type, second: Type, node: ast.AST) -> Type:
        """The type that holds both."""
        if first == second:
            return first
        if NOTHING in (first, second):
            return self.program.types.optional(second if first == NOTHING else first)
        if "optional" in (first.kind, second.kind):
            return self.program.types.optional(self.joined(first.item or first, second.item or second, node))
        if first.number and second.number:
            return DOUBLE if DOUBLE in (first, second) else INT
        raise self.refuse(node, f"{first.c} here and {second.c} there.")

    def _compare(self, node: ast.Compare, want: Type | None) -> Expression:
        terms = [node.left, *node.comparators]
        if isinstance(node.ops[0], ast.In | ast.NotIn) and isinstance(terms[1], ast.Tuple):
            return self._within(node, terms[1].elts)
        parts = [self._compared(node, terms[i], op, terms[i + 1]) for i, op in enumerate(node.ops)]
        if len(parts) == 1:
            return parts[0]
        if any(isinstance(n, ast.Call) for term in terms[1:-1] for n in ast.walk(term)):
            raise self.refuse(
                node, "a call within a chain of comparisons would be made twice: give it a name."
            )
        return Expression(" && ".join(part.bound(RELATION) for part in parts), BOOL, AND)

    def _within(self, node: ast.Compare, values: list[ast.expr]) -> Expression:
        parts = [self._compared(node, node.left, ast.Eq(), value).bound(RELATION) for value in values]
        if isinstance(node.ops[0], ast.In):
            return Expression(" || ".join(parts), BOOL, OR)
        return Expression(f"!({' || '.join(parts)})", BOOL, UNARY)

    def _compared(
        self, node: ast.Compare, left_node: ast.expr, op: ast.cmpop, right_node: ast.expr
    ) -> Expression:
        left, right = self.expr(left_node), self.expr(right_node)
        negated, equality = isinstance(op, ast.IsNot | ast.NotEq), isinstance(op, ast.Eq | ast.NotEq)
        if isinstance(op, ast.Is | ast.IsNot):
            if right.type == NOTHING and left.type.kind == "optional":
                return Expression(f"{'' if negated else '!'}{left.member('has', BOOL).text}", BOOL, UNARY)
            if right.type == NOTHING and not self.final:
                return Expression("true", BOOL)
            if left.type.kind != "enum" or right.type.kind != "enum":
                raise self.refuse(
                    node, f"`is` between {left.type.c} and {right.type.c}: values have no identity."
                )
            equality = True
        if "optional" in (left.type.kind, right.type.kind) and equality:
            kind = self.joined(left.type, right.type, node)
            left, right = self.coerced(left, kind, node), self.coerced(right, kind, node)
        if left.type.kind in ("record", "optional", "tuple") and equality:
            text = f"{self._equal(left.type)}({left.text}, {self.coerced(right, left.type, node).text})"
            return Expression(f"{'!' if negated else ''}{text}", BOOL, UNARY)
        sign = COMPARE.get(type(op), {ast.Is: "==", ast.IsNot: "!="}.get(type(op)))
        if sign is None:
            raise self.refuse(node, f"the comparison {type(op).__name__} is not known to the translator.")

        def make(parts: list[Expression]) -> Expression:
            return Expression(
                f"{parts[0].bound(RELATION + 1)} {sign} {parts[1].bound(RELATION + 1)}", BOOL, RELATION
            )

        return self.elementwise([self.plain(left), self.plain(right)], make, BOOL, node)

    def _equal(self, kind: Type) -> str:
        """The name of a function that compares two values as Python does."""
        name = f"{kind.c}_equal"
        if name not in self.program.helpers:

            def part(inner: Type, member: str) -> str:
                if inner.kind in ("record", "optional", "tuple"):
                    return f"{self._equal(inner)}(a.{member}, b.{member})"
                return f"a.{member} == b.{member}"

            if kind.kind == "optional" and kind.item is not None:
                test = f"a.has == b.has && (!a.has || {part(kind.item, 'value')})"
            elif kind.kind == "tuple":
                test = " && ".join(f"a.at[{k}] == b.at[{k}]" for k in range(kind.size))
            else:
                test = " && ".join(part(f.type, safe(f.name)) for f in kind.fields)
            self.program.helpers[name] = (
                f"static inline bool {name}({kind.c} a, {kind.c} b) {{ return {test}; }}"
            )
        return name

    # Calls

    def _call(self, node: ast.Call, want: Type | None) -> Expression:
        called, keywords = node.func, {str(k.arg): k.value for k in node.keywords}
        value = self.known(called)
        if value is MISSING and isinstance(called, ast.Attribute):
            return self._method(node, called, keywords)
        name = getattr(value, "__name__", "")
        if value is float or value is bool or value is int:
            kind = {float: DOUBLE, int: INT, bool: BOOL}[value]
            e = self.plain(self.expr(node.args[0]))
            e = self.coerced(e, DOUBLE, node) if kind == DOUBLE else e
            return e if e.type == kind else Expression(f"({kind.c}){e.bound(UNARY)}", kind, UNARY)
        if value in (min, max, abs):
            return self._least(value.__name__, [self.operand(v) for v in node.args], node)
        if value is len:
            return Expression(str(self.expr(node.args[0]).type.shape[0]), INT)
        if getattr(math, name, None) is value and name in MATH:
            kind = BOOL if name.startswith("is") else DOUBLE
            listed = ", ".join(self.coerced(self.plain(self.expr(v)), DOUBLE, v).text for v in node.args)
            return Expression(f"{name}({listed})", kind)
        if value is dataclasses.replace:
            return self._replaced(self.plain(self.expr(node.args[0])), keywords, node)
        array = self.array_call(f"np.{name}" if getattr(np, name, None) is value else name, node)
        if array is not None:
            return array
        if isinstance(value, type):
            if issubclass(value, enum.Enum):
                kind = self.program.types.of(value, self.source.file)
                return Expression(f"({kind.c}){self.expr(node.args[0]).bound(UNARY)}", kind, UNARY)
            return self.constructed(value, node, keywords)
        if isinstance(called, ast.Name) and called.id == "cls":
            return self.constructed(self._owner(), node, keywords)
        if isinstance(value, FunctionType) or hasattr(value, "__func__"):
            return self.called(self.program.require(value), [], node, node.args, keywords)
        raise self.refuse(node, f"{ast.unparse(called)} is not known to the translator.")

    def _owner(self) -> Any:
        python = self.function.python
        return python.__globals__[python.__qualname__.rpartition(".")[0]]

    def _least(self, name: str, parts: list[Expression], node: ast.AST) -> Expression:
        """`min`, `max` or `abs` of numbers."""
        kind = INT if all(part.type == INT for part in parts) else DOUBLE
        if any(part.type.kind == "array" for part in parts):
            raise self.refuse(node, f"{name} of an array.")
        if name == "abs":
            return Expression(f"fabs({parts[0].text})", DOUBLE)
        call = {"min": "least", "max": "most"}[name] + ("_int" if kind == INT else "_of")
        text = parts[0].text
        for part in parts[1:]:
            text = f"{call}({text}, {part.text})"
        return Expression(text, kind)

    def _method(self, node: ast.Call, called: ast.Attribute, keywords: dict[str, ast.expr]) -> Expression:
        base = self.plain(self.expr(called.value))
        if called.attr == "_replace":
            return self._replaced(base, keywords, node)
        method = getattr(base.type.python, called.attr, None)
        if method is None:
            raise self.refuse(node, f"the method {base.type.c}.{called.attr} is not known.")
        return self.called(self.program.require(method), [base], node, node.args, keywords)

    def _replaced(self, base: Expression, given: dict[str, ast.expr], node: ast.AST) -> Expression:
        """A record with some of its fields anew."""
        kind = base.type.item if base.type.kind == "array" else base.type
        if kind is None or kind.kind != "record" or kind.big:
            raise self.refuse(node, f"{base.type.c} with other fields, in an expression.")
        fields = [f for f in kind.fields if f.name in given]
        values = [self.expr(given[f.name], f.type) for f in fields]

        def make(parts: list[Expression]) -> Expression:
            fresh = {f.name: self.coerced(e, f.type, node) for f, e in zip(fields, parts[1:], strict=True)}
            listed = (
                fresh[f.name] if f.name in fresh else parts[0].member(f.name, f.type) for f in kind.fields
            )
            return Expression(f"({kind.c}){{{', '.join(e.text for e in listed)}}}", kind)

        return self.elementwise([base, *values], make, kind, node)

    def constructed(self, python: Any, node: ast.Call, keywords: dict[str, ast.expr]) -> Expression:
        """A record of its fields' values, with the class's own defaults."""
        kind = self.program.types.of(python, f"{self.source.file}:{node.lineno}")
        if len(node.args) == 1 and isinstance(node.args[0], ast.Starred):
            e = self.expr(node.args[0].value)
            if [f.type for f in e.type.fields] != [f.type for f in kind.fields]:
                raise self.refuse(node, f"{kind.c} of {e.type.c}, which is not alike.")
            return e
        return self.record(kind, self.values_of(kind, node.args, keywords, node), node)

    def values_of(
        self, kind: Type, arguments: list[ast.expr], keywords: dict[str, ast.expr], node: ast.AST
    ) -> dict[str, Any]:
        """The values of a record's fields: expressions, or Python's defaults."""
        given: dict[str, Any] = dict(zip((f.name for f in kind.fields), arguments, strict=False))
        given |= keywords
        for name in given:
            if kind.found(name) is None:
                raise self.refuse(node, f"{kind.c}.{name}: {kind.left_out.get(name, 'is not known')}.")
        for f in kind.fields:
            if f.name not in given:
                given[f.name] = default_of(kind.python, f.name)
                if given[f.name] is MISSING:
                    raise self.refuse(node, f"{kind.c} is made without {f.name}.")
        return given

    def record(self, kind: Type, given: dict[str, Any], node: ast.AST) -> Expression:
        """A record of expressions and default values."""
        if kind.big:
            name = self.temporary(kind)
            for f in kind.fields:
                self.fill_part(f"{name}.{safe(f.name)}", f.type, given[f.name], node)
            return Expression(name, kind)
        parts = []
        for f in kind.fields:
            value = given[f.name]
            if isinstance(value, ast.expr):
                e = self.expr(value, f.type)
                parts.append(e if e.type.kind == "array" else self.coerced(e, f.type, value))
            else:
                parts.append(Expression(literal(value, f.type, self.source.file), f.type))

        def make(items: list[Expression]) -> Expression:
            return Expression(f"({kind.c}){{{', '.join(item.text for item in items)}}}", kind)

        return self.elementwise(parts, make, kind, node)

    def fill_part(self, target: str, kind: Type, value: Any, node: ast.AST) -> None:
        """Write an expression or a default value to a place."""
        if isinstance(value, ast.expr):
            self.fill(target, kind, value)
        elif kind.kind == "array":
            if any(value):
                raise self.refuse(node, "an array whose default is not 0 everywhere.")
            self.put(f"memset({target}, 0, sizeof {target});")
        elif kind.big and kind.kind == "record":
            for f in kind.fields:
                self.fill_part(f"{target}.{safe(f.name)}", f.type, getattr(value, f.name), node)
        else:
            self.put(f"{target} = {literal(value, kind, self.source.file)};")

    def named(self, e: Expression) -> Expression:
        """An expression's value under a name of its own."""
        self.temporaries += 1
        name = f"t{self.temporaries}"
        self.put(f"const {e.type.c} {name} = {e.text};")
        return Expression(name, e.type)

    def temporary(self, kind: Type) -> str:
        """The name of a new variable of this type."""
        self.temporaries += 1
        name = f"t{self.temporaries}"
        self.put(f"{declared(kind, name)};")
        return name

    def called(
        self,
        function: Function,
        before: list[Expression],
        node: ast.AST,
        arguments: list[ast.expr],
        keywords: dict[str, ast.expr],
        target: str = "",
    ) -> Expression:
        """A call; what is large is written to `target`, a pointer, or to a new variable."""
        parts, kinds = self._arguments(function, before, node, arguments, keywords)
        returns = function.returns
        scalar = not returns.big and returns.kind != "array"
        if scalar and any(
            p.type.kind == "array" and k.kind != "array" for p, k in zip(parts, kinds, strict=True)
        ):

            def make(items: list[Expression]) -> Expression:
                return Expression(f"{function.c}({', '.join(item.text for item in items)})", returns)

            return self.elementwise(parts, make, returns, node)
        texts = [self._passed(part, kind, node) for part, kind in zip(parts, kinds, strict=True)]
        if function.updates:
            if not target:
                raise self.refuse(node, f"{function.c} changes what it is given: assign what it returns.")
            if texts[0] != target:
                self.put(
                    f"*{target} = *{texts[0]};" if target.isidentifier() else f"{target[1:]} = *{texts[0]};"
                )
                texts[0] = target
            self.put(f"{function.c}({', '.join(texts)});")
            return Expression(target, returns, pointer=True)
        if function.by_pointer:
            if self.lazy:
                raise self.refuse(node, f"{function.c} within a condition: give its result a name before.")
            name = target or self.temporary(returns)
            slot = target or (name if returns.kind == "array" else f"&{name}")
            self.put(f"{function.c}({', '.join([slot, *texts])});")
            return array_at(name, returns) if returns.kind == "array" else Expression(name, returns)
        return Expression(f"{function.c}({', '.join(texts)})", returns)

    def _arguments(
        self,
        function: Function,
        before: list[Expression],
        node: ast.AST,
        arguments: list[ast.expr],
        keywords: dict[str, ast.expr],
    ) -> tuple[list[Expression], list[Type]]:
        names = [name for name, _ in function.parameters]
        given = dict(zip(names[len(before) :], arguments, strict=False)) | keywords
        python = function.python
        defaults = dict(zip(reversed(names), reversed(python.__defaults__ or ()), strict=False))
        defaults |= python.__kwdefaults__ or {}
        parts = list(before)
        for name, kind in function.parameters[len(before) :]:
            if name in given:
                e = self.expr(given[name], kind)
                keep = e.type.kind == "array" or kind.kind == "array"
                parts.append(e if keep else self.coerced(e, kind, given[name]))
            elif name in defaults:
                parts.append(Expression(literal(defaults[name], kind, self.source.file), kind))
            else:
                raise self.refuse(node, f"{function.c} is called without {name}.")
        return parts, [kind for _, kind in function.parameters]

    def _passed(self, e: Expression, kind: Type, node: ast.AST) -> str:
        """An argument as it is passed."""
        if kind.kind == "array":
            if e.type != kind:
                raise self.refuse(node, f"an array of shape {e.type.shape} where {kind.shape} is needed.")
            return self.placed(e)
        return e.reference if kind.big else e.text


def element(e: Expression, indices: tuple[str, ...]) -> Expression:
    """The element of a broadcast array at the indices of a loop; what is no array is the same everywhere."""
    if e.at is None:
        return e
    own = indices[len(indices) - len(e.type.shape) :]
    return e.at(tuple("0" if size == 1 else index for index, size in zip(own, e.type.shape, strict=True)))


def added(index: str, offset: str) -> str:
    """An index further on."""
    return str(int(index) + int(offset)) if index.isdigit() else f"({index} + {offset})"


def default_of(python: Any, name: str) -> Any:
    """A field's default, or MISSING."""
    if hasattr(python, "_field_defaults"):
        return python._field_defaults.get(name, MISSING)
    item = python.__dataclass_fields__[name]
    if item.default is not dataclasses.MISSING:
        return item.default
    return MISSING if item.default_factory is dataclasses.MISSING else item.default_factory()
