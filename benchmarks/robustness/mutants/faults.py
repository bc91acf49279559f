"""Places in the sources where one small fault can be put, and the faults."""

from __future__ import annotations

import ast
import copy
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
COMMUTATIVE = {"max", "min", "maximum", "minimum", "fmax", "fmin", "hypot", "isinstance", "zip", "gcd"}
WORDS = {"print", "debug", "info", "warning", "warn", "error", "exception", "Option", "Argument", "NewType"}
"""Calls whose arguments are for people: no faults there."""
COMPILERS = {"njit", "jit", "compiled", "inlined", "vectorize", "guvectorize", "cfunc"}
"""Decorators behind which Python sees no lines run."""


@dataclass(frozen=True)
class Place:
    """One place, and the faults that it can have.

    `lines` are those of the statement that the place is in; `loaded` says that it runs when the module is loaded, and
    `compiled` that it is compiled, so that no test is seen to run it.
    """

    file: str
    function: str
    kind: str
    start: int
    end: int
    lines: tuple[int, int]
    statement: str
    loaded: bool
    compiled: bool
    faults: tuple[str, ...]


@dataclass(frozen=True)
class Mutant:
    """A place with the fault that it has."""

    place: Place
    before: str
    after: str

    @property
    def name(self) -> str:
        """File, line and what is changed there."""
        p = self.place
        return f"{p.file}:{p.lines[0]} {p.function} {p.kind}: {_short(self.before)} -> {_short(self.after)}"

    @property
    def identity(self) -> tuple[str, ...]:
        """What stays the same where only other lines of the file change."""
        p = self.place
        return p.file, p.function, p.kind, p.statement, self.before, self.after

    def source(self, whole: bytes) -> bytes:
        """The file with the fault."""
        return whole[: self.place.start] + self.after.encode() + whole[self.place.end :]


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) < 100 else line[:97] + "..."


def sample(root: Path, folders: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """So many mutants of the folders' files, drawn evenly from all places; those of compiled code come last."""
    draw = random.Random(seed)
    places = [p for file in files_of(root, folders) for p in places_of(root, file)]
    chosen = draw.sample(range(len(places)), min(count, len(places)))
    mutants = [_mutant(root, places[i], draw.choice(places[i].faults)) for i in sorted(chosen)]
    return sorted(mutants, key=lambda m: m.place.compiled)


def every(root: Path, files: Sequence[str]) -> list[Mutant]:
    """All mutants of these files."""
    return [_mutant(root, p, fault) for file in files for p in places_of(root, file) for fault in p.faults]


def files_of(root: Path, folders: Sequence[str]) -> list[str]:
    """The Python files of these folders and files, relative to the root; raises ValueError where one has none."""
    found = []
    for name in folders:
        place = root / name
        files = [place] if place.is_file() else sorted(place.rglob("*.py"))
        if not files:
            raise ValueError(f"{name}: no Python file there; expected a folder or a file, from the root")
        found += [file.relative_to(root).as_posix() for file in files]
    return found


def prefix_of(name: str) -> str:
    """What paths of a folder's files, or the path of a file, begin with."""
    return name if name.endswith(".py") else f"{name}/"


def _mutant(root: Path, place: Place, fault: str) -> Mutant:
    return Mutant(place, (root / place.file).read_bytes()[place.start : place.end].decode(), fault)


def places_of(root: Path, file: str) -> list[Place]:
    """All places of a file."""
    return list(_Walk(file, (root / file).read_bytes()).places())


class _Walk:
    """Goes through a file's statements and the expressions in them."""

    def __init__(self, file: str, source: bytes) -> None:
        self.file, self.source = file, source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def places(self) -> Iterator[Place]:
        yield from self._body(ast.parse(self.source).body, "", loaded=True, compiled=False)

    def _body(self, body: list[ast.stmt], where: str, *, loaded: bool, compiled: bool) -> Iterator[Place]:
        for statement in body:
            if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
                names = {
                    n.id for d in statement.decorator_list for n in ast.walk(d) if isinstance(n, ast.Name)
                }
                inner = {"loaded": False, "compiled": compiled or bool(names & COMPILERS)}
                here = (statement, where, loaded, compiled)
                for default in (*statement.args.defaults, *filter(None, statement.args.kw_defaults)):
                    yield from self._expression(default, here)
                yield from self._body(statement.body, f"{where}.{statement.name}".strip("."), **inner)
            elif isinstance(statement, ast.ClassDef):
                inner = {"loaded": loaded, "compiled": compiled}
                yield from self._body(statement.body, f"{where}.{statement.name}".strip("."), **inner)
            else:
                yield from self._statement(statement, where, loaded, compiled)

    def _statement(self, statement: ast.stmt, where: str, loaded: bool, compiled: bool) -> Iterator[Place]:
        here = (statement, where, loaded, compiled)
        if isinstance(statement, (ast.Import, ast.ImportFrom, ast.Assert)) or _for_types(statement):
            return
        bodies = ("body", "orelse", "finalbody", "handlers", "cases")
        for name, value in ast.iter_fields(statement):
            if name in bodies or name in ("annotation", "target") or isinstance(statement, ast.Raise):
                continue
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, ast.AST):
                    yield from self._expression(part, here)
        for name in bodies:
            for part in getattr(statement, name, []):
                inner = [part] if isinstance(part, ast.stmt) else part.body
                yield from self._body(inner, where, loaded=loaded, compiled=compiled)
        yield from self._own(statement, here)

    def _own(self, statement: ast.stmt, here: tuple[ast.stmt, str, bool, bool]) -> Iterator[Place]:
        """Faults of a statement as a whole."""
        match statement:
            case ast.If(test=test) if not _constant(test):
                yield self._place("condition", test, ("True", "False"), here)
            case ast.While(test=test) if not _constant(test):
                yield self._place("condition", test, ("False",), here)
            case ast.AugAssign(target=target, op=op, value=value) if type(op) in OPERATORS:
                other = ast.AugAssign(target, OPERATORS[type(op)](), value)
                yield self._place("operator", statement, (ast.unparse(other),), here)
                yield self._place("removed", statement, ("pass",), here)
            case ast.Expr(value=ast.Call() as call) if _name(call) not in WORDS:
                yield self._place("removed", statement, ("pass",), here)
            case ast.Raise() | ast.Break() | ast.Continue() | ast.Delete():
                yield self._place("removed", statement, ("pass",), here)
            case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
                yield self._place("removed", statement, ("pass",), here)
            case ast.Return(value=ast.Tuple(elts=[first, second, *rest])):
                swapped = ast.Return(ast.Tuple([second, first, *rest], ast.Load()))
                yield self._place("returned", statement, (ast.unparse(swapped),), here)
            case ast.Return(value=value) if value is not None and not _constant(value):
                yield self._place("returned", statement, ("return None",), here)

    def _expression(self, node: ast.AST, here: tuple[ast.stmt, str, bool, bool]) -> Iterator[Place]:
        if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Call) and _name(node) in WORDS):
            return
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                unions = isinstance(op, ast.BitOr) and here[2]
                if not unions and not _text(left) and not _text(right):
                    yield self._place("operator", node, (_with(node, op=OPERATORS[type(op)]()),), here)
            case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
                yield self._place("operator", node, (ast.unparse(operand),), here)
            case ast.Compare(ops=[op, *rest]):
                faults = tuple(_with(node, ops=[other(), *rest]) for other in COMPARISONS[type(op)])
                yield self._place("comparison", node, faults, here)
            case ast.BoolOp(op=op):
                other = ast.Or() if isinstance(op, ast.And) else ast.And()
                yield self._place("boolean", node, (_with(node, op=other),), here)
            case ast.IfExp(test=test):
                yield self._place("condition", test, ("True", "False"), here)
            case ast.comprehension(ifs=ifs):
                for test in ifs:
                    yield self._place("condition", test, ("True", "False"), here)
            case ast.Call(args=[first, second, *rest]) if _name(node) not in COMMUTATIVE:
                if not isinstance(first, ast.Starred) and not isinstance(second, ast.Starred):
                    yield self._place("arguments", node, (_with(node, args=[second, first, *rest]),), here)
            case ast.Constant(value=bool() as value):
                yield self._place("constant", node, (str(not value),), here)
            case ast.Constant(value=int() as value):
                yield self._place("constant", node, (str(value + 1),), here)
            case ast.Constant(value=float() as value):
                yield self._place("constant", node, (repr(1.25 * value or 1.0),), here)
        for child in ast.iter_child_nodes(node):
            yield from self._expression(child, here)

    def _place(
        self, kind: str, node: ast.AST, faults: tuple[str, ...], here: tuple[ast.stmt, str, bool, bool]
    ) -> Place:
        statement, where, loaded, compiled = here
        body = getattr(statement, "body", None)
        header = body[0].lineno - 1 if isinstance(body, list) and body else statement.end_lineno
        first, last = statement.lineno, max(statement.lineno, header or 0)
        text = (ast.get_source_segment(self.source.decode(), statement) or "").splitlines()[
            : last - first + 1
        ]
        bracketed = tuple(f"({f})" if isinstance(node, ast.expr) else f for f in faults)
        start, end = self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)
        statement_text = " ".join(" ".join(text).split())
        lines = (first, last)
        return Place(self.file, where, kind, start, end, lines, statement_text, loaded, compiled, bracketed)

    def _at(self, line: int, column: int) -> int:
        return self.starts[line - 1] + column


def _name(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")


def _constant(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant)


def _text(node: ast.expr) -> bool:
    """Whether an operand is a text: with any other operator there is only an error of types."""
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _with(node: ast.expr, **changed: object) -> str:
    other = copy.copy(node)
    for name, value in changed.items():
        setattr(other, name, value)
    return ast.unparse(other)


def _for_types(statement: ast.stmt) -> bool:
    text = ast.unparse(statement)
    return text.startswith(("__all__", "if TYPE_CHECKING"))
