"""Arrays of fixed shape: consecutive statements of every element share one loop.

A statement waits until something needs an array as a whole, an element elsewhere, or another shape. An array that only
its own loop reads is a number there.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import dataclass, replace

from .expressions import Expressions, added, element
from .program import Function, Program
from .types import (
    DOUBLE,
    INT,
    RELATION,
    SUM,
    TERNARY,
    Expression,
    Type,
    array_of,
    declared,
    flat_index,
    safe,
)

HELPERS = {
    "greatest": """\
static double greatest(const double *values, int n)
{
    double most = values[0];
    bool odd = most != most;
    for (int j = 1; j < n; j++) {
        most = values[j] > most ? values[j] : most;
        odd |= values[j] != values[j];
    }
    return odd ? NAN : most;
}""",
    "first_greatest": """\
static int first_greatest(const double *values, int n)
{
    int most = 0;
    for (int j = 1; j < n && values[most] == values[most]; j++)
        if (!(values[j] <= values[most]))
            most = j;
    return most;
}""",
    "cumulated": """\
static void cumulated(double *result, const double *values, int n)
{
    result[0] = values[0];
    for (int j = 1; j < n; j++)
        result[j] = result[j - 1] + values[j];
}""",
    "spacing": """\
static void spacing(double *result, const double *values, int n)
{
    result[0] = values[1] - values[0];
    for (int j = 1; j < n - 1; j++)
        result[j] = (values[j + 1] - values[j - 1]) / 2.0;
    result[n - 1] = values[n - 1] - values[n - 2];
}""",
    "count_below": """\
static int count_below(const double *ascending, double value, int n)
{
    int low = 0, high = n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (before(ascending[middle], value))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}""",
    "count_up_to": """\
static int count_up_to(const double *ascending, double value, int n)
{
    int low = 0, high = n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (!before(value, ascending[middle]))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}""",
}
"""The functions of `trpac_core/robust/arrays.py` that are no loop of their own."""
ELEMENTWISE = {
    "exp": "exp({})",
    "log": "log({})",
    "np.sqrt": "sqrt({})",
    "np.absolute": "fabs({})",
    "np.minimum": "minimum({}, {})",
    "np.maximum": "maximum({}, {})",
}
"""Functions of every element."""
APART = ("exp", "log")
"""Those of the C library: a loop without them works out two numbers at once."""
ARRAY_FUNCTIONS = frozenset((*HELPERS, *ELEMENTWISE, "total", "over_rows", "stacked"))
"""All that is not translated but known."""


@dataclass(frozen=True)
class Step:
    """A statement of every element: where it is written to, from which row on, whether it is added up, and comments."""

    target: str
    value: Expression
    name: str = ""
    row: int = 0
    sums: bool = False
    remarks: tuple[str, ...] = ()


class Loops(Expressions):
    """The loops of a function."""

    def __init__(self, program: Program, function: Function) -> None:
        super().__init__(program, function)
        self.steps: list[Step] = []
        self.remarks: list[str] = []
        self.stored: set[str] = set()
        """Local arrays that other loops read too."""
        self.here: set[str] = set()
        """Arrays that the loop being written has worked out."""
        self.changed = False
        self.wanted = ""
        """Name of the variable that the expression at hand is assigned to."""

    def waiting(self, name: str) -> bool:
        """Whether an array is worked out in a loop that is not yet written."""
        return any(step.name == name for step in self.steps)

    def local_array(self, name: str, kind: Type) -> Expression:
        """A local array: in its own loop a number, if no other needs it."""
        item = kind.item or DOUBLE

        def at(indices: tuple[str, ...]) -> Expression:
            if name not in self.here:
                self.store(name)
            if kind.size == 1 or name not in self.stored:
                return Expression(safe(name), item)
            return Expression(f"{safe(name)}[{flat_index(indices, kind.shape)}]", item)

        return Expression("", kind, at=at, names=frozenset((name,)), address=safe(name))

    def store(self, name: str) -> None:
        """Keep an array for other loops."""
        if name not in self.stored:
            self.stored.add(name)
            self.changed = True

    def step(self, step: Step) -> None:
        """Put a statement of every element into the loop that waits, or begin another."""
        sums = {s.name for s in self.steps if s.sums}
        if self.steps and (
            step.value.type.shape != self.steps[0].value.type.shape or step.value.names & sums
        ):
            self.flush()
        self.steps.append(replace(step, remarks=tuple(self.remarks)))
        self.remarks = []

    def flush(self) -> None:
        """Write the loop that waits."""
        if not self.steps:
            self._put_remarks(self.remarks)
            self.remarks = []
            return
        steps, self.steps = self.steps, []
        shape = steps[0].value.type.shape
        names = ("i", "j")[2 - len(shape) :]
        indices = tuple("0" if size == 1 else name for name, size in zip(names, shape, strict=True))
        sums = [s for s in steps if s.sums]
        for name, size in zip(names[:-1], shape[:-1], strict=True):
            self.put(f"for (int {name} = 0; {name} < {size}; {name}++) {{")
            self.depth += 1
        for s in sums:
            # From -0.0 on, as -0.0 + x is x, also where x is -0.0.
            self.put(f"{f'double {s.name}_sum' if len(shape) > 1 else safe(s.name)} = -0.0;")
        if shape[-1] > 1:
            self.put(f"for (int j = 0; j < {shape[-1]}; j++) {{")
            self.depth += 1
        self.here = set()
        begun = len(self.out)
        for s in steps:
            self._write(s, indices, shape)
        if any("[k" in line for line in self.out[begun:]):
            self.out.insert(begun, f"{'    ' * self.depth}const int k = {shape[-1]} * i + j;")
        if shape[-1] > 1:
            self._close()
        for s in sums:
            if len(shape) > 1:
                self.put(f"{safe(s.name)}[i] = {s.name}_sum;")
        for _ in names[:-1]:
            self._close()
        self.here = set()

    @property
    def waiting_shape(self) -> tuple[int, ...]:
        """Shape of the loop that waits; empty for none."""
        return self.steps[0].value.type.shape if self.steps else ()

    def remark(self, text: str) -> None:
        """A comment, before what comes next."""
        if self.steps:
            self.remarks.append(text)
        else:
            self.put(text)

    def _put_remarks(self, remarks: Iterable[str]) -> None:
        for text in remarks:
            self.put(text)

    depth = 0
    out: list[str]

    def _close(self) -> None:
        self.depth -= 1
        self.put("}")

    def _write(self, s: Step, indices: tuple[str, ...], shape: tuple[int, ...]) -> None:
        e = element(s.value, indices)
        self._put_remarks(s.remarks)
        if s.sums:
            self.put(f"{f'{s.name}_sum' if len(shape) > 1 else safe(s.name)} += {e.text};")
        elif s.name and s.name not in self.stored:
            self.put(f"{'' if s.name in self.here else f'{e.type.c} '}{safe(s.name)} = {e.text};")
            self.here.add(s.name)
        elif s.value.type.size == 1 and s.name:
            self.put(f"{safe(s.name)} = {e.text};")
            self.here.add(s.name)
        else:
            if s.row:
                indices = (added(indices[0], str(s.row)), *indices[1:])
            self.put(f"{s.target}[{flat_index(indices, shape)}] = {e.text};")
            self.here.add(s.name)

    def temporary_array(self, kind: Type) -> str:
        """The name of a new array: that of the variable it is for, if it is for one."""
        name, self.wanted = self.wanted, ""
        if not name:
            self.temporaries += 1
            name = f"t{self.temporaries}"
        self.fresh(name, kind)
        return name

    def fresh(self, name: str, kind: Type) -> None:
        """Note a local array."""
        if self.locals.get(name) != kind:
            self.locals[name], self.changed = kind, True
        self.arrays[name] = kind

    arrays: dict[str, Type]

    def declarations(self) -> list[str]:
        """The arrays that several loops share."""
        kinds = [(name, kind) for name, kind in self.arrays.items() if name in self.stored]
        return [
            f"{declared(kind, safe(name)) if kind.size > 1 else f'{kind.c} {safe(name)}'};"
            for name, kind in kinds
        ]

    # The functions of arrays

    def array_call(self, name: str, node: ast.Call) -> Expression | None:
        """A call of one of the functions of arrays; None for another one."""
        if name in ELEMENTWISE:
            form = ELEMENTWISE[name]

            def make(items: list[Expression]) -> Expression:
                return Expression(form.format(*(item.text for item in items)), DOUBLE)

            made = self.elementwise([self.operand(v) for v in node.args], make, DOUBLE, node)
            return self._apart(made) if name in APART and made.at is not None else made
        if name == "np.where":
            return self._where(node)
        if name == "np.zeros":
            shape = node.args[0].elts if isinstance(node.args[0], ast.Tuple) else [node.args[0]]
            sizes = tuple(int(self.expr(size).text) for size in shape)
            return Expression("", array_of(DOUBLE, sizes), at=lambda _: Expression("0.0", DOUBLE))
        if name in ARRAY_FUNCTIONS:
            wanted, self.wanted = self.wanted, ""
            parts = [self.expr(v, DOUBLE) for v in node.args]
            self.wanted = wanted
            if name == "stacked":
                rows = (sum(p.type.shape[0] for p in parts), *parts[0].type.shape[1:])
                names = frozenset[str]().union(*(p.names for p in parts))
                return Expression(
                    "", array_of(parts[0].type.item or DOUBLE, rows), names=names, stack=tuple(parts)
                )
            return (
                self._total(parts[0], name) if name in ("total", "over_rows") else self._helper(name, parts)
            )
        return None

    def _apart(self, e: Expression) -> Expression:
        """An array worked out in a loop of its own, before the one that waits if that makes no part of it."""
        if any(self.waiting(name) for name in e.names):
            self.flush()
        waiting, self.steps = self.steps, []
        result = self.temporary_array(e.type)
        self.store(result)
        self.step(Step(safe(result), e, result))
        self.flush()
        self.steps = waiting
        return self.local_array(result, e.type)

    def _where(self, node: ast.Call) -> Expression:
        parts = [self.expr(value, DOUBLE) for value in node.args]

        def make(items: list[Expression]) -> Expression:
            yes, no = items[1].bound(TERNARY + 1), items[2].bound(TERNARY)
            return Expression(f"{items[0].bound(RELATION)} ? {yes} : {no}", DOUBLE, TERNARY)

        return self.elementwise(parts, make, DOUBLE, node)

    def _total(self, e: Expression, name: str) -> Expression:
        """The sum over the last axis, which stays with length 1, or over the first."""
        if name == "over_rows":
            for inner in e.names:
                if self.waiting(inner):
                    self.flush()
            rows = range(e.type.shape[0])

            def at(indices: tuple[str, ...]) -> Expression:
                return Expression(
                    " + ".join(element(e, (str(i), *indices)).bound(SUM + 1) for i in rows), DOUBLE, SUM
                )

            return Expression("", array_of(DOUBLE, e.type.shape[1:]), at=at, names=e.names)
        kind = array_of(DOUBLE, (*e.type.shape[:-1], 1))
        result = self.temporary_array(kind)
        self.store(result)
        self.step(Step(safe(result), e, result, sums=True))
        return self.local_array(result, kind)

    def _helper(self, name: str, parts: list[Expression]) -> Expression:
        self.program.helpers.setdefault(name, HELPERS[name])
        e = parts[0]
        address = self.placed(e)
        if name == "greatest":
            return Expression(f"greatest({address}, {e.type.size})", DOUBLE)
        if name == "first_greatest":
            return Expression(f"first_greatest({address}, {e.type.size})", INT)
        if name in ("count_below", "count_up_to"):
            return Expression(f"{name}({address}, {parts[1].text}, {e.type.size})", INT)
        result = self.temporary_array(e.type)
        self.store(result)
        self.put(f"{name}({safe(result)}, {address}, {e.type.size});")
        return self.local_array(result, e.type)

    def placed(self, e: Expression) -> str:
        """The address of an array that is worked out."""
        if not e.address:
            wanted, self.wanted = self.wanted, ""
            name = self.temporary_array(e.type)
            self.wanted = wanted
            self.step(Step(safe(name), e, name))
            e = self.local_array(name, e.type)
        for name in e.names:
            self.store(name)
            if self.waiting(name):
                self.flush()
        return e.address
