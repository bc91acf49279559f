"""Values in C: numbers, names, operators, conditions, parts of records and arrays."""

from __future__ import annotations

import ast
import builtins
import enum
import math
from types import ModuleType
from typing import Any

from .loops import AND, ATOM, OR, PRODUCT, RELATION, SUM, TERNARY, UNARY, Expression, Loops, added, array_at
from .types import BOOL, DOUBLE, INT, NOTHING, Type, array_of, literal, safe

ARITHMETIC = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT)}
ORDER = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
EQUALITY = {ast.Eq: "==", ast.NotEq: "!="}
IDENTITY = {ast.Is: "==", ast.IsNot: "!="}
MISSING = object()


class Expressions(Loops):
    """What the expressions of a function are in C."""

    lazy = 0
    """How many conditional expressions enclose the one at hand."""

    def expr(self, node: ast.expr, want: Type | None = None) -> Expression:
        """An expression; `want` is the type that it will be taken for."""
        self.line = node.lineno
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(f"the expression {type(node).__name__} is not known to the translator.")
        made: Expression = method(node, want)
        return made

    def as_type(self, node: ast.expr, kind: Type) -> Expression:
        """An expression as a value of a type."""
        return self.coerced(self.expr(node, kind), kind)

    def coerced(self, e: Expression, kind: Type) -> Expression:
        """A value as one of another type."""
        if e.type == kind:
            return e
        if kind.kind == "optional":
            if e.type == NOTHING:
                return Expression(literal(None, kind, ""), kind)
            return Expression(f"({kind.c}){{true, {self.coerced(e, kind.item).value}}}", kind)
        if e.type.kind == "optional":
            return self.coerced(self.plain(e), kind)
        raise self.refuse(f"{e.type.c} where {kind.c} is needed.")

    def plain(self, e: Expression) -> Expression:
        """What an optional holds; that it holds something mypy has shown."""
        return e.member("value", e.type.item) if e.type.kind == "optional" else e

    def operand(self, node: ast.expr) -> Expression:
        """An operand of arithmetic."""
        e = self.plain(self.expr(node))
        if not (e.type.item or e.type).number:
            raise self.refuse(f"arithmetic with {e.type.c}.")
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
        if e.type == BOOL:
            return e
        if e.type.number:
            return Expression(f"{e.bound(SUM)} != {'0.0' if e.type == DOUBLE else '0'}", BOOL, RELATION)
        if e.type.kind == "optional" and e.type.item.number:
            return Expression(f"{e.bound(ATOM)}.has && {e.bound(ATOM)}.value != 0", BOOL, AND)
        raise self.refuse(f"the truth of {e.type.c}.")

    def joined(self, first: Type, second: Type) -> Type:
        """The type that holds both."""
        if first == second:
            return first
        if NOTHING in (first, second):
            return self.program.types.optional(second if first == NOTHING else first)
        if "optional" in (first.kind, second.kind):
            return self.program.types.optional(self.joined(first.item or first, second.item or second))
        raise self.refuse(f"{first.c} here and {second.c} there.")

    # Names and numbers

    def _constant(self, node: ast.Constant, want: Type | None) -> Expression:
        value = node.value
        if value is None:
            return Expression("none", NOTHING)
        if isinstance(value, bool | int | float):
            kind = {bool: BOOL, int: DOUBLE if want == DOUBLE else INT, float: DOUBLE}[type(value)]
            return Expression(literal(value, kind, ""), kind)
        raise self.refuse(f"the constant {value!r}.")

    def _name(self, node: ast.Name, want: Type | None) -> Expression:
        name = node.id
        if name in self.aliases:
            return self.aliases[name]
        kind = self.parameters.get(name) or self.locals.get(name)
        if kind is None:
            return self._global(node)
        if kind.kind == "array":
            return array_at(safe(name), kind) if name in self.parameters else self.local_array(name, kind)
        return Expression(safe(name), kind, pointer=kind.big and name in self.parameters)

    def known(self, node: ast.expr) -> Any:
        """The value that a name or attribute has in the module; MISSING where it is none."""
        if isinstance(node, ast.Name) and node.id not in self.parameters | self.locals | self.aliases:
            python = self.function.python
            name = python.__qualname__.rpartition(".")[0] if node.id == "cls" else node.id
            return python.__globals__.get(name, getattr(builtins, name, MISSING))
        if isinstance(node, ast.Attribute):
            owner = self.known(node.value)
            if isinstance(owner, ModuleType | type):
                return getattr(owner, node.attr, MISSING)
        return MISSING

    def _global(self, node: ast.Name | ast.Attribute) -> Expression:
        value = self.known(node)
        if value is MISSING or callable(value) or isinstance(value, ModuleType):
            raise self.refuse(f"{ast.unparse(node)} is not known here.")
        if isinstance(value, enum.Enum):
            kind = self.program.types.of(type(value), self.source.file)
            return Expression(literal(value, kind, ""), kind)
        if isinstance(value, float) and not math.isfinite(value):
            return Expression(literal(value, DOUBLE, ""), DOUBLE)
        name = node.id if isinstance(node, ast.Name) else node.attr
        text, kind = self.program.constant(self.function.python.__module__, name, value)
        return array_at(text, kind) if kind.kind == "array" else Expression(text, kind)

    # Parts

    def field(self, base: Expression, name: str, kind: Type) -> Expression:
        """A field of a record, or of each record of an array."""
        if base.type.kind != "array":
            return base.member(name, kind)
        return self.each(f"{{}}.{safe(name)}", [base], [ATOM], kind)

    def _subscript(self, node: ast.Subscript, want: Type | None) -> Expression:
        base = self.plain(self.expr(node.value))
        if base.type.kind == "tuple":
            return Expression(f"{base.bound(ATOM)}.at[{self.index(node.slice)}]", DOUBLE)
        if base.type.kind != "array":
            raise self.refuse(f"an index into {base.type.c}.")
        return self._part(base, node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice])

    def index(self, node: ast.expr) -> str:
        """A whole number as index."""
        e = self.expr(node)
        if e.type.kind not in ("int", "enum"):
            raise self.refuse(f"an index that is {e.type.c}.")
        return e.text

    def whole(self, node: ast.expr) -> int:
        """A whole number that is known when translating."""
        value = node.value if isinstance(node, ast.Constant) else self.known(node)
        if not isinstance(value, int):
            raise self.refuse(f"{ast.unparse(node)} is no number known here.")
        return value

    def _part(self, base: Expression, given: list[ast.expr]) -> Expression:
        """Part of an array: rows by a slice, a row or an element by index, an axis more or less."""
        self.ready(base)
        shape: list[int] = []
        takes: list[tuple[str, str]] = []
        left = list(base.type.shape)
        for part in given:
            if isinstance(part, ast.Constant) and part.value is None:
                takes.append(("new", "0"))
                shape.append(1)
            elif isinstance(part, ast.Slice):
                size = left.pop(0)
                low = 0 if part.lower is None else self.whole(part.lower)
                high = size if part.upper is None else min(self.whole(part.upper), size)
                takes.append(("from", str(low)))
                shape.append(high - low)
            else:
                left.pop(0)
                takes.append(("at", self.index(part)))
        kind = array_of(base.type.item, (*shape, *left))

        def at(indices: tuple[str, ...]) -> Expression:
            own, rest = [], list(indices)
            for sort, text in takes:
                index = "0" if sort == "at" else rest.pop(0)
                if sort != "new":
                    own.append(text if sort == "at" else added(index, text))
            return base.at((*own, *rest))  # type: ignore[misc]

        if not kind.shape:
            return at(())
        sort, text = takes[0]
        address = ""
        if base.address and len(takes) == 1 and sort != "new":
            stride = math.prod(base.type.shape[1:])
            address = base.address if text == "0" else f"{base.address} + {stride} * {text}"
        return Expression(address, kind, at=at, names=base.names, address=address, part=True)

    # Operators

    def _unaryop(self, node: ast.UnaryOp, want: Type | None) -> Expression:
        if isinstance(node.op, ast.Not):
            return self.truth(node)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(f"the operator {type(node.op).__name__} is not known to the translator.")
        e = self.operand(node.operand)
        return self.each("-{}", [e], [ATOM], e.type.item or e.type, UNARY)

    def _binop(self, node: ast.BinOp, want: Type | None) -> Expression:
        left, right = self.operand(node.left), self.operand(node.right)
        whole = all((e.type.item or e.type) in (INT, BOOL) for e in (left, right))
        kind = INT if whole else DOUBLE
        if whole and isinstance(node.op, ast.FloorDiv):
            return Expression(f"floor_divided({left.text}, {right.text})", INT)
        if whole and isinstance(node.op, ast.Div):
            raise self.refuse("a division of whole numbers, which C would round.")
        if whole and isinstance(node.op, ast.BitOr):
            sign, binds = "|", RELATION
        elif type(node.op) in ARITHMETIC:
            sign, binds = ARITHMETIC[type(node.op)]
        else:
            # A power's last bit differs between compilers.
            raise self.refuse(f"the operator {type(node.op).__name__} of {kind.c}.")
        return self.each(f"{{}} {sign} {{}}", [left, right], [binds, binds + 1], kind, binds)

    def _boolop(self, node: ast.BoolOp, want: Type | None) -> Expression:
        first = self.plain(self.expr(node.values[0]))
        if isinstance(node.op, ast.Or) and first.type in (DOUBLE, INT) and len(node.values) == 2:
            second, test = self.as_type(node.values[1], first.type), self.truth(node.values[0])
            return self._chosen(test, first, second)
        if any(self.expr(value).type != BOOL for value in node.values):
            raise self.refuse("`and` or `or` of something else than truths.")
        return self.truth(node)

    def _ifexp(self, node: ast.IfExp, want: Type | None) -> Expression:
        test = self.truth(node.test)
        self.lazy += 1
        yes, no = self.expr(node.body, want), self.expr(node.orelse, want)
        kind = want if want is not None and want.kind != "array" else self.joined(yes.type, no.type)
        made = self._chosen(test, self.coerced(yes, kind), self.coerced(no, kind))
        self.lazy -= 1
        return made

    def _chosen(self, test: Expression, yes: Expression, no: Expression) -> Expression:
        return Expression(f"{test.bound(OR)} ? {yes.bound(OR)} : {no.bound(TERNARY)}", yes.type, TERNARY)

    # Comparisons

    def _compare(self, node: ast.Compare, want: Type | None) -> Expression:
        terms = [node.left, *node.comparators]
        if isinstance(node.ops[0], ast.NotIn) and isinstance(terms[1], ast.Tuple):
            parts = [self._compared(terms[0], ast.Eq(), value) for value in terms[1].elts]
            return Expression(f"!({' || '.join(part.bound(RELATION) for part in parts)})", BOOL, UNARY)
        parts = [self._compared(*terms) for terms in zip(terms, node.ops, terms[1:], strict=False)]
        if len(parts) == 1:
            return parts[0]
        if any(isinstance(n, ast.Call) for term in terms[1:-1] for n in ast.walk(term)):
            raise self.refuse("a call within a chain of comparisons would be made twice: give it a name.")
        return Expression(" && ".join(part.bound(RELATION) for part in parts), BOOL, AND)

    def _compared(self, left_node: ast.expr, operator: ast.cmpop, right_node: ast.expr) -> Expression:
        left, right = self.expr(left_node), self.expr(right_node)
        if type(operator) not in ORDER | EQUALITY | IDENTITY:
            raise self.refuse(f"the comparison {type(operator).__name__} is not known to the translator.")
        sign = (ORDER | EQUALITY | IDENTITY)[type(operator)]
        no = "!" if sign == "!=" else ""
        if type(operator) in IDENTITY:
            if right.type == NOTHING and left.type.kind == "optional":
                return Expression(f"{'' if no else '!'}{left.member('has', BOOL).text}", BOOL, UNARY)
            if (left.type.kind, right.type.kind) != ("enum", "enum"):
                raise self.refuse(f"`is` between {left.type.c} and {right.type.c}: values have no identity.")
        if type(operator) in EQUALITY:
            if "optional" in (left.type.kind, right.type.kind):
                kind = self.joined(left.type, right.type)
                left, right = self.coerced(left, kind), self.coerced(right, kind)
            if left.type.kind in ("record", "optional", "tuple"):
                equal, other = self._equal(left.type), self.coerced(right, left.type)
                return Expression(f"{no}{equal}({left.text}, {other.text})", BOOL, UNARY)
        parts = [self.plain(left), self.plain(right)]
        if not all((e.type.item or e.type).number or e.type.kind == "enum" for e in parts):
            raise self.refuse(f"which of {left.type.c} and {right.type.c} is less.")
        return self.each(f"{{}} {sign} {{}}", parts, [RELATION + 1] * 2, BOOL, RELATION)

    def _equal(self, kind: Type) -> str:
        """The name of a function that compares two values as Python does."""
        name = f"{kind.c}_equal"
        if name not in self.program.helpers:

            def part(inner: Type, member: str) -> str:
                if inner.number or inner.kind == "enum":
                    return f"a.{member} == b.{member}"
                return f"{self._equal(inner)}(a.{member}, b.{member})"

            if kind.kind == "optional":
                test = f"a.has == b.has && (!a.has || {part(kind.item, 'value')})"
            elif kind.kind == "record":
                test = " && ".join(part(f.type, safe(f.name)) for f in kind.fields)
            else:
                raise self.refuse(f"whether {kind.c} are equal.")
            self.program.helpers[name] = (
                f"static inline bool {name}({kind.c} a, {kind.c} b) {{ return {test}; }}"
            )
        return name
