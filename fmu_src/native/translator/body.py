"""Statements of one function."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

from .calls import Calls
from .expressions import MISSING
from .loops import Expression, Step
from .program import Function, Program
from .source import is_text, names_in
from .types import DOUBLE, INT, NOTHING, Type, safe


def translated(program: Program, function: Function) -> list[str]:
    """The body of a function in C."""
    return Body(program, function).lines()


class Body(Calls):
    """Passes over a function until the types of its variables stand."""

    def lines(self) -> list[str]:
        """The body with its braces."""
        statements = self.function.node.body
        self.homes = homes(statements, set(self.parameters))
        names = [n for n in ast.walk(self.function.node) if isinstance(n, ast.Name)]
        self.assigned = [n.id for n in names if isinstance(n.ctx, ast.Store)]
        self.read = [n.id for n in names if isinstance(n.ctx, ast.Load)]
        self.changed = True
        while self.changed:
            self.begin()
            self.last_line = statements[0].lineno
            self.block(statements)
        if self.out[-1] == "    return;":
            self.out.pop()
        return ["{", *(f"    {line}" for line in self.declarations()), *self.out, "}"]

    # Statements

    def block(self, statements: list[ast.stmt]) -> None:
        """The statements of a block, with the variables that live in it."""
        waiting = set(self.homes.get(id(statements), ()))
        for statement in statements:
            if isinstance(statement, ast.Pass) or is_text(statement):
                continue
            self._comments(statement)
            here = waiting & names_in(statement)
            waiting -= here
            self.fresh_names: set[str] = set()
            """Variables that are declared where the statement at hand assigns to them."""
            if isinstance(statement, ast.Assign):
                targets = {n for target in statement.targets for n in names_in(target)}
                self.fresh_names = (targets & here) - names_in(statement.value)
            for name in sorted(here - self.fresh_names):
                if name in self.locals and self.locals[name].kind not in ("array", "nothing"):
                    self.put(f"{self.locals[name].c} {safe(name)};")
            self.line = statement.lineno
            self.statement(statement)
        self.flush()

    def _comments(self, statement: ast.stmt) -> None:
        for line in range(self.last_line + 1, statement.lineno):
            if line in self.source.comments:
                self.remarks.append(f"/* {self.source.comments[line]} */")
        self.last_line = max(self.last_line, statement.lineno)

    def statement(self, node: ast.stmt) -> None:
        """One statement."""
        if isinstance(node, ast.Assign):
            first, *others = node.targets
            self.assign(first, node.value)
            for other in others:
                self.assign(other, first)
            return
        if isinstance(node, ast.AugAssign):
            value = ast.BinOp(node.target, node.op, node.value)
            self.assign(node.target, ast.copy_location(value, node))
            return
        if isinstance(node, ast.Return):
            self.give(node)
            return
        self.flush()
        if isinstance(node, ast.If):
            self.branch(node)
        elif isinstance(node, ast.While) and not node.orelse:
            lines, test = len(self.out), self.truth(node.test).text
            self.flush()
            if len(self.out) > lines:
                raise self.refuse("a condition of `while` that needs lines of its own.")
            self.put(f"while ({test}) {{")
            self.inner(node.body)
            self.put("}")
        elif isinstance(node, ast.For) and not node.orelse and isinstance(node.target, ast.Name):
            self.loop(node, node.target.id)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            self.put(f"{self.expr(node.value).text};")
        else:
            raise self.refuse(f"the statement {type(node).__name__} is not known to the translator.")

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
            if any(isinstance(n, ast.Call) for n in ast.walk(inner.test)):
                break  # which may need a line of its own before it
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
            raise self.refuse("a loop over something else than a range.")
        *start, stop = (self.as_type(argument, INT).text for argument in call.args)
        self.locals[name] = INT
        index = f"k{self.depth}" if name == "_" else safe(name)
        self.put(f"for (int {index} = {start[0] if start else '0'}; {index} < {stop}; {index}++) {{")
        self.inner(node.body)
        self.put("}")

    def give(self, node: ast.Return) -> None:
        """`return`."""
        returns, text = self.function.returns, ""
        if node.value is None or returns == NOTHING:
            pass
        elif self.function.updates:
            self.update(self.function.parameters[0][0], node.value)
        elif self.function.by_pointer:
            self.fill("*result" if returns.big else "result", returns, node.value)
        else:
            text = f" {self.as_type(node.value, returns).text}"
        self.flush()
        self.put(f"return{text};")

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
                raise self.refuse("a field is set in what cannot be changed.")
            self.fill(slot.text, slot.type, value)
            self.flush()
        elif isinstance(target, ast.Name):
            self.name(target.id, value)
        else:
            raise self.refuse(f"a store to {type(target).__name__}.")

    def name(self, name: str, value: ast.expr) -> None:
        """A value to a variable."""
        kind = self.parameters.get(name) or self.locals.get(name)
        if self.function.updates and name == self.function.parameters[0][0]:
            self.update(name, value)
        elif kind is not None and kind.big:
            self.large(name, kind, value)
        else:
            called = self.known(value.func) if isinstance(value, ast.Call) else None
            self.wanted = name if self.array_function(called) else ""
            e = self.expr(value, None if kind == NOTHING else kind)
            self.wanted = ""
            self.store_value(name, e)

    def store_value(self, name: str, e: Expression) -> None:
        """An expression to a variable."""
        if e.type.kind == "array":
            self.array(name, e)
            return
        if self.assigned.count(name) > 1 or name in self.parameters:
            self.flush()
        if e.type.big:
            # In the next pass it is written to the variable itself.
            self.learn(name, e.type)
            return
        kind = self.parameters.get(name) or self.joined(self.locals.get(name, e.type), e.type)
        if name not in self.parameters:
            self.learn(name, kind)
        declared = f"{kind.c} {safe(name)}" if name in self.fresh_names else safe(name)
        self.fresh_names.discard(name)
        self.put(f"{declared} = {self.coerced(e, kind).text};")

    def array(self, name: str, e: Expression) -> None:
        """An array to a variable; a part of another one, and records that are read once, need no place of their own."""
        if e.names == {name} and e.address == safe(name):
            return
        once = e.type.item.kind == "record" and self.read.count(name) == 1
        if (e.part or once) and self.assigned.count(name) == 1:
            self.aliases[name] = e
            return
        self.local_array(name, e.type)
        self.step(Step(safe(name), e, name))

    def large(self, name: str, kind: Type, value: ast.expr) -> None:
        """A record with arrays to a variable."""
        if name in self.fresh_names:
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
        """Values to names."""
        if isinstance(value, ast.Tuple):
            names = [names_in(name) for name in target.elts]
            if any(names[i] & names_in(later) for i in range(len(names)) for later in value.elts[i + 1 :]):
                raise self.refuse("a name that is assigned to and read in one line.")
            for to, part in zip(target.elts, value.elts, strict=True):
                self.assign(to, part)
            return
        e = self.plain(self.expr(value))
        # What is no variable is worked out once.
        if not (e.pointer or e.text.replace(".", "").replace("->", "").isidentifier()):
            e = self.named(e)
        if e.type.kind == "tuple":
            parts = [Expression(f"{e.text}.at[{k}]", DOUBLE) for k in range(e.type.size)]
        else:
            parts = [e.member(f.name, f.type) for f in e.type.fields]
        if len(parts) != len(target.elts):
            raise self.refuse(f"{len(parts)} values for {len(target.elts)} names.")
        for to, e in zip(target.elts, parts, strict=True):
            if not isinstance(to, ast.Name):
                raise self.refuse("names within names.")
            if to.id != "_":
                self.store_value(to.id, e)

    def update(self, name: str, value: ast.expr) -> None:
        """A record that is changed in place to the value of an expression that begins with it."""
        self.flush()
        if isinstance(value, ast.Name) and value.id == name:
            return
        if not isinstance(value, ast.Call):
            raise self.refuse(f"{name} can only be replaced by itself with other fields.")
        if isinstance(value.func, ast.Attribute) and value.func.attr == "_replace":
            self.update(name, value.func.value)
            self.replace_in(f"*{safe(name)}", self.parameters[name], value)
            return
        function: Any = self.known(value.func)
        if function is MISSING:
            raise self.refuse(f"{ast.unparse(value.func)} is not known here.")
        if self.called(self.program.require(function), [], value, safe(name)).text != safe(name):
            raise self.refuse(f"{ast.unparse(value.func)} does not change its first argument.")


def homes(statements: list[ast.stmt], taken: Iterable[str]) -> dict[int, set[str]]:
    """For each block, by its identity, the names to declare in it: those that live in no smaller block."""
    nodes = [n for s in statements for n in ast.walk(s)]
    loops = {id(n.target) for n in nodes if isinstance(n, ast.For)}
    stored = {
        n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) and id(n) not in loops
    }
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

    for name in sorted(stored - set(taken) - {"_"}):
        settle(statements, name)
    return found
