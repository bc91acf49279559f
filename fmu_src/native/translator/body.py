"""Statements of one function."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from types import FunctionType
from typing import Any

import numpy as np

from .expressions import BINARY, MISSING
from .loops import ARRAY_FUNCTIONS, Loops, Step
from .program import Function, Program
from .source import is_text, names_in
from .types import DOUBLE, INT, NOTHING, Expression, Type, array_of, safe


def translated(program: Program, function: Function) -> list[str]:
    """The body of a function in C."""
    return Body(program, function).lines()


class Body(Loops):
    """Passes over a function until the types of its variables stand; the last one is written."""

    def lines(self) -> list[str]:
        """The body with its braces."""
        statements = self.function.node.body
        self.homes = homes(statements, set(self.parameters))
        names = [n for n in ast.walk(self.function.node) if isinstance(n, ast.Name)]
        self.assigned = [n.id for n in names if isinstance(n.ctx, ast.Store)]
        self.read = [n.id for n in names if isinstance(n.ctx, ast.Load)]
        while True:
            self.out: list[str] = []
            self.depth, self.temporaries, self.changed = 1, 0, False
            self.aliases, self.arrays, self.steps, self.remarks = {}, {}, [], []
            self.last_line = statements[0].lineno
            self.block(statements)
            if self.final:
                if self.out[-1] == "    return;":
                    self.out.pop()
                return ["{", *(f"    {line}" for line in self.declarations()), *self.out, "}"]
            self.final = not self.changed

    def put(self, text: str) -> None:
        """Write a line."""
        self.out.append("    " * self.depth + text)

    # Statements

    def block(self, statements: list[ast.stmt]) -> None:
        """The statements of a block, with the variables that live in it."""
        waiting = set(self.homes.get(id(statements), ()))
        for statement in statements:
            if isinstance(statement, ast.Pass) or is_text(statement):
                continue
            self._comments(statement)
            here = {name for name in waiting if name in names_in(statement)}
            waiting -= here
            self.fresh_names = set()
            if isinstance(statement, ast.Assign | ast.AnnAssign):
                self.fresh_names = {n for t in targets_of(statement) for n in names_in(t)} & here
                self.fresh_names -= names_in(statement.value)
            for name in sorted(here - self.fresh_names):
                if name in self.locals and self.locals[name].kind not in ("array", "nothing"):
                    self.put(f"{self.locals[name].c} {safe(name)};")
            self.statement(statement)
        self.flush()

    def _comments(self, statement: ast.stmt) -> None:
        for line in range(self.last_line + 1, statement.lineno):
            if line in self.source.comments:
                self.remark(f"/* {self.source.comments[line]} */")
        self.last_line = max(self.last_line, statement.lineno)

    def statement(self, node: ast.stmt) -> None:
        """One statement."""
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = targets_of(node)
            for index, target in enumerate(targets):
                # The value once, then one name from the other: a = b = x.
                self.assign(target, node.value if index == 0 else targets[0])
            return
        if isinstance(node, ast.AugAssign):
            if type(node.op) not in BINARY:
                raise self.refuse(node, "an operator that is not known to the translator.")
            self.assign(
                node.target, ast.copy_location(ast.BinOp(as_value(node.target), node.op, node.value), node)
            )
            return
        if isinstance(node, ast.Return):
            self.give(node)
            return
        self.flush()
        if isinstance(node, ast.If):
            self.branch(node)
        elif isinstance(node, ast.While) and not node.orelse:
            self.put(f"while ({self.truth(node.test).text}) {{")
            self.inner(node.body)
            self.put("}")
        elif isinstance(node, ast.For) and not node.orelse and isinstance(node.target, ast.Name):
            self.loop(node, node.target.id)
        elif isinstance(node, ast.Break | ast.Continue):
            self.put("break;" if isinstance(node, ast.Break) else "continue;")
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            self.put(f"{self.expr(node.value).text};")
        else:
            raise self.refuse(node, f"the statement {type(node).__name__} is not known to the translator.")

    def inner(self, statements: list[ast.stmt]) -> None:
        """A block within another."""
        self.depth += 1
        self.block(statements)
        self.depth -= 1

    def branch(self, node: ast.If) -> None:
        """`if`, `elif` and `else`."""
        self.put(f"if ({self.truth(node.test).text}) {{")
        self.inner(node.body)
        rest = node.orelse
        while len(rest) == 1 and isinstance(rest[0], ast.If) and id(rest) not in self.homes:
            inner = rest[0]
            if needs_line(inner.test):
                break
            self.put(f"}} else if ({self.truth(inner.test).text}) {{")
            self.inner(inner.body)
            rest = inner.orelse
        if rest:
            self.put("} else {")
            self.inner(rest)
        self.put("}")

    def loop(self, node: ast.For, name: str) -> None:
        """`for` over a range."""
        call = node.iter
        if not (isinstance(call, ast.Call) and self.known(call.func) is range and len(call.args) < 3):
            raise self.refuse(node, "a loop over something else than a range.")
        bounds = [self.as_type(argument, INT) for argument in call.args]
        start, stop = ("0", bounds[0]) if len(bounds) == 1 else bounds
        self.locals[name] = INT
        index = f"k{self.depth}" if name == "_" else safe(name)
        self.put(f"for (int {index} = {start}; {index} < {stop}; {index}++) {{")
        self.inner(node.body)
        self.put("}")

    def give(self, node: ast.Return) -> None:
        """`return`."""
        function = self.function
        if node.value is None or function.returns == NOTHING:
            self.flush()
            self.put("return;")
        elif function.updates:
            self.update(function.parameters[0][0], node.value)
            self.put("return;")
        elif function.by_pointer:
            self.fill("*result" if function.returns.big else "result", function.returns, node.value)
            self.flush()
            self.put("return;")
        else:
            text = self.as_type(node.value, function.returns)
            self.flush()
            self.put(f"return {text};")

    # Assignments

    def assign(self, target: ast.expr, value: ast.expr) -> None:
        """A value to a name, to names, or to a field of what can be changed."""
        if isinstance(target, ast.Tuple):
            self.unpack(target, value)
        elif isinstance(target, ast.Attribute | ast.Subscript):
            self.flush()
            slot = self.expr(target)
            base: ast.expr = target
            while isinstance(base, ast.Attribute | ast.Subscript):
                base = base.value
            kind = self.parameters.get(base.id) if isinstance(base, ast.Name) else None
            if kind is None or not kind.mutable:
                raise self.refuse(target, "a field is set in what cannot be changed.")
            self.fill(slot.text, slot.type, value)
            self.flush()
        elif isinstance(target, ast.Name):
            self.name(target.id, value)
        else:
            raise self.refuse(target, f"a store to {type(target).__name__}.")

    def name(self, name: str, value: ast.expr) -> None:
        """A value to a variable."""
        kind = self.parameters.get(name) or self.locals.get(name)
        if self.function.updates and name == self.function.parameters[0][0]:
            self.update(name, value)
            return
        if kind is not None and kind.big:
            self.large(name, kind, value)
            return
        called = self.known(value.func) if isinstance(value, ast.Call) else None
        self.wanted = name if getattr(called, "__name__", "") in ARRAY_FUNCTIONS else ""
        e = self.expr(value, None if kind == NOTHING else kind)
        self.wanted = ""
        self.store_value(name, e, value)

    def store_value(self, name: str, e: Expression, node: ast.AST) -> None:
        """An expression to a variable."""
        if e.type.kind == "array":
            self.array(name, e)
            return
        if self.assigned.count(name) > 1 or name in self.parameters:
            self.flush()
        if e.type.big:
            if name not in self.locals:
                self.locals[name], self.changed = e.type, True
            if self.assigned.count(name) == 1 and not e.text.startswith("t"):
                self.aliases[name] = e
            else:
                self.put(f"{self.declared_here(name, e.type)} = {'*' if e.pointer else ''}{e.text};")
            return
        if name in self.parameters:
            kind = self.parameters[name]
        else:
            kind = self.joined(self.locals.get(name, e.type), e.type, node)
            if self.locals.get(name) != kind:
                self.locals[name], self.changed = kind, True
        self.put(f"{self.declared_here(name, kind)} = {self.coerced(e, kind, node).text};")

    def declared_here(self, name: str, kind: Type) -> str:
        """A variable as it is assigned to: with its type where it begins."""
        fresh = name in self.fresh_names
        self.fresh_names.discard(name)
        return f"{kind.c} {safe(name)}" if fresh else safe(name)

    def array(self, name: str, e: Expression) -> None:
        """An array to a variable; a part of another one, and records that are read once, need no place of their own."""
        if e.names == {name} and e.address == safe(name):
            return
        once = e.type.item is not None and e.type.item.kind == "record" and self.read.count(name) == 1
        if (e.part or once) and self.assigned.count(name) == 1:
            self.aliases[name] = e
            return
        self.fresh(name, e.type)
        self.step(Step(safe(name), e, name))

    def large(self, name: str, kind: Type, value: ast.expr) -> None:
        """A record with arrays to a variable."""
        if name in self.fresh_names:
            self.fresh_names.discard(name)
            self.put(f"{kind.c} {safe(name)};")
        if name in names_in(value):
            other = self.temporary(kind)
            self.fill(other, kind, value)
            self.flush()
            self.put(f"{safe(name)} = {other};")
        else:
            self.fill(safe(name), kind, value)
        self.flush()

    def unpack(self, target: ast.Tuple, value: ast.expr) -> None:
        """Values to names, nested or not."""
        if isinstance(value, ast.Tuple):
            names = [names_in(name) for name in target.elts]
            if any(names[i] & names_in(later) for i in range(len(names)) for later in value.elts[i + 1 :]):
                kept = [(name, self.kept(part)) for name, part in zip(target.elts, value.elts, strict=True)]
                for name, e in kept:
                    self.store_value(name.id, e, value)  # type: ignore[attr-defined]
                return
            for name, part in zip(target.elts, value.elts, strict=True):
                self.assign(name, part)
            return
        e = self.plain(self.expr(value))
        if not (e.pointer or e.text.replace(".", "").replace("->", "").isidentifier()):
            e = self.named(e)
        self.unpack_from(target, e)

    def unpack_from(self, target: ast.Tuple, e: Expression) -> None:
        """The parts of a record or tuple to names."""
        if e.type.kind == "tuple":
            parts = [Expression(f"{e.text}.at[{k}]", DOUBLE) for k in range(e.type.size)]
        else:
            parts = [e.member(f.name, f.type) for f in e.type.fields]
        if len(parts) != len(target.elts):
            raise self.refuse(target, f"{len(parts)} values for {len(target.elts)} names.")
        for name, part in zip(target.elts, parts, strict=True):
            if isinstance(name, ast.Tuple):
                self.unpack_from(name, part)
            elif isinstance(name, ast.Name) and name.id != "_":
                self.store_value(name.id, part, target)

    def kept(self, node: ast.expr) -> Expression:
        """An expression's value under a name of its own."""
        e = self.expr(node)
        return e if e.type.kind == "array" else self.named(e)

    def update(self, name: str, value: ast.expr) -> None:
        """A record that is changed in place to the value of an expression that begins with it."""
        self.flush()
        if isinstance(value, ast.Name) and value.id == name:
            return
        if not isinstance(value, ast.Call):
            raise self.refuse(value, f"{name} can only be replaced by itself with other fields.")
        kind = self.parameters[name]
        if isinstance(value.func, ast.Attribute) and value.func.attr == "_replace":
            self.update(name, value.func.value)
            self.replace_in(f"*{safe(name)}", kind, {str(k.arg): k.value for k in value.keywords})
            return
        function, first = self.known(value.func), value.args[0]
        if function is MISSING:
            raise self.refuse(value, f"{ast.unparse(value.func)} is not known here.")
        if not isinstance(first, ast.Name):
            self.update(name, first)
            value.args[0] = ast.copy_location(ast.Name(name, ast.Load()), first)
        keywords = {str(k.arg): k.value for k in value.keywords}
        e = self.called(self.program.require(function), [], value, value.args, keywords, safe(name))
        if e.text != safe(name):
            raise self.refuse(value, f"{ast.unparse(value.func)} does not change its first argument.")

    def replace_in(self, target: str, kind: Type, given: dict[str, ast.expr]) -> None:
        """Set fields of a record in place; what they become is worked out before."""
        later: list[tuple[str, Type, str | ast.expr | Expression]] = []
        for field, value in given.items():
            node: Any = value
            f = kind.found(field)
            if f is None:
                raise self.refuse(node, f"{kind.c} has no field {field}.")
            if f.type.big or f.type.kind == "array":
                if not simple(node):
                    name = self.temporary(f.type)
                    self.fill(name, f.type, node)
                    self.flush()
                    node = f"memcpy(&{part_of(target, field)}, &{name}, sizeof {name});"
                later.append((part_of(target, field), f.type, node))
                continue
            e = self.coerced(self.expr(node, f.type), f.type, node)
            self.flush()
            later.append((part_of(target, field), f.type, e if simple(node) else self.named(e)))
        for slot, field_type, what in later:
            if isinstance(what, str):
                self.put(what)
            elif isinstance(what, Expression):
                self.put(f"{slot} = {what.text};")
            else:
                self.fill(slot, field_type, what)
                self.flush()

    # Places

    def fill(self, target: str, kind: Type, node: ast.expr) -> None:
        """Write a value to a place; `target` is what would be assigned to, `*name` for what a pointer points to."""
        if isinstance(node, ast.IfExp) and (kind.big or kind.kind == "array"):
            self.flush()
            self.put(f"if ({self.truth(node.test).text}) {{")
            for index, branch in enumerate((node.body, node.orelse)):
                if index:
                    self.put("} else {")
                self.depth += 1
                self.fill(target, kind, branch)
                self.flush()
                self.depth -= 1
            self.put("}")
        elif kind.kind == "array":
            self.fill_array(target, kind, node)
        elif kind.big:
            self.fill_record(target, kind, node)
        else:
            text = self.as_type(node, kind)
            self.put(f"{target} = {text};")

    def fill_array(self, target: str, kind: Type, node: ast.expr) -> None:
        """Write an array to a place."""
        if isinstance(node, ast.Call):
            called = self.known(node.func)
            if called is np.array and isinstance(node.args[0], ast.List):
                row = array_of(DOUBLE, kind.shape[1:])
                for index, value in enumerate(node.args[0].elts):
                    self.fill(f"{target} + {index * row.size}", row, value)
                return
            if isinstance(called, FunctionType) and called.__name__ not in ARRAY_FUNCTIONS:
                function = self.program.require(called)
                if function.returns == kind:
                    self.flush()
                    self.called(
                        function, [], node, node.args, {str(k.arg): k.value for k in node.keywords}, target
                    )
                    return
        e = self.expr(node)
        if e.type.kind == "array" and e.type.shape != kind.shape:
            raise self.refuse(node, f"an array of shape {e.type.shape} where {kind.shape} is needed.")
        self.step(Step(target, e))

    def fill_stacked(self, target: str, kind: Type, node: ast.Call) -> None:
        """Write rows of records under each other to the arrays of a record."""
        row = 0
        for part in [self.expr(rows) for rows in node.args]:
            name = self.temporary_array(part.type)
            self.step(Step(name, part, name))
            rows = self.local_array(name, part.type)
            for f in kind.fields:
                column = self.elementwise(
                    [rows], lambda items, f=f: items[0].member(f.name, DOUBLE), DOUBLE, node
                )
                self.step(Step(part_of(target, f.name), column, row=row))
            row += part.type.shape[0]

    def fill_record(self, target: str, kind: Type, node: ast.expr) -> None:
        """Write a record with arrays to a place."""
        address = target[1:] if target.startswith("*") else f"&{target}"
        if isinstance(node, ast.Call):
            called: Any = self.known(node.func)
            keywords = {str(k.arg): k.value for k in node.keywords}
            if isinstance(called, type):
                values = self.values_of(kind, node.args, keywords, node)
                # Those first that can share the loop that waits.
                for field in sorted(kind.fields, key=lambda f: f.type.shape != self.waiting_shape):
                    self.fill_part(part_of(target, field.name), field.type, values[field.name], node)
                return
            if getattr(called, "__name__", "") == "stacked":
                self.fill_stacked(target, kind, node)
                return
            if called is not MISSING:
                self.flush()
                function = self.program.require(called)
                self.called(function, [], node, node.args, keywords, address)
                return
            if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
                self.fill(target, kind, node.func.value)
                self.flush()
                self.replace_in(target, kind, keywords)
                return
        if kind.kind == "optional" and kind.item is not None:
            e = self.expr(node)
            if e.type == NOTHING:
                self.put(f"{part_of(target, 'has')} = false;")
                return
            if e.type != kind:
                self.put(f"{part_of(target, 'has')} = true;")
                self.fill(part_of(target, "value"), kind.item, node)
                return
        e = self.expr(node)
        if e.type != kind:
            raise self.refuse(node, f"{e.type.c} where {kind.c} is needed.")
        if e.text != target:
            self.put(f"{target} = {'*' if e.pointer else ''}{e.text};")


def part_of(target: str, name: str) -> str:
    """A field of a place."""
    return f"{target[1:]}->{safe(name)}" if target.startswith("*") else f"{target}.{safe(name)}"


def needs_line(node: ast.expr) -> bool:
    """Whether an expression may need a line of its own before it."""
    return any(isinstance(n, ast.Call) for n in ast.walk(node))


def simple(node: ast.expr) -> bool:
    """Whether an expression is a variable or a number: setting other fields does not change it."""
    return isinstance(node, ast.Name | ast.Constant)


def as_value(target: ast.expr) -> ast.expr:
    """What a target of an assignment holds."""
    value = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(value, target)


def targets_of(node: ast.Assign | ast.AnnAssign) -> list[ast.expr]:
    """What is assigned to."""
    return list(node.targets) if isinstance(node, ast.Assign) else [node.target]


def stored_in(statements: list[ast.stmt]) -> set[str]:
    """Names that statements assign to, without those of loops."""
    nodes = [n for s in statements for n in ast.walk(s)]
    loops = {id(n.target) for n in nodes if isinstance(n, ast.For)}
    stored = [n for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    return {n.id for n in stored if id(n) not in loops} - {"_"}


def homes(statements: list[ast.stmt], taken: Iterable[str]) -> dict[int, set[str]]:
    """For each block, by its identity, the names to declare in it: those that live in no smaller block."""
    found: dict[int, set[str]] = {}

    def settle(block: list[ast.stmt], name: str) -> None:
        mentions = [s for s in block if name in names_in(s)]
        only = mentions[0]
        if len(mentions) == 1 and isinstance(only, ast.If | ast.For | ast.While):
            outside = names_in(only.iter if isinstance(only, ast.For) else only.test)
            inner = [b for b in (only.body, only.orelse) if any(name in names_in(s) for s in b)]
            if name not in outside and len(inner) == 1:
                settle(inner[0], name)
                return
        found.setdefault(id(block), set()).add(name)

    for name in sorted(stored_in(statements) - set(taken)):
        settle(statements, name)
    return found
