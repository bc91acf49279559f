"""Expressions in C, and the loops that work out arrays of fixed shape.

Consecutive statements of every element share a loop: a statement waits until something needs an array as a whole, an
element elsewhere, or another shape. An array that only its own loop reads is a number there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from .program import Function, Program
from .source import Unsupported, source_of
from .types import Type, array_of, declared, safe

ATOM, UNARY, PRODUCT, SUM, RELATION, AND, OR, TERNARY = 100, 90, 80, 70, 60, 50, 45, 40
"""How strongly operators of C bind."""
Indices = tuple[str, ...]
"""Texts of an element's place, one for each dimension."""


@dataclass(frozen=True)
class Expression:
    """An expression in C, its type and how strongly its outermost operator binds.

    `pointer` tells that the text is a pointer to the value. Of an array, `at` gives the element at indices; `names` are
    the local arrays that it is made of; `address` is where it lies, empty where it has no place; `part` tells that it
    is nothing but elements of another one.
    """

    text: str
    type: Type
    binds: int = ATOM
    pointer: bool = False
    at: Callable[[Indices], Expression] | None = None
    names: frozenset[str] = frozenset()
    address: str = ""
    part: bool = False

    def bound(self, binds: int) -> str:
        """The text where an operator binds so strongly."""
        return self.text if self.binds >= binds else f"({self.text})"

    def member(self, name: str, kind: Type) -> Expression:
        """A field of the record."""
        text = f"{self.bound(ATOM)}{'->' if self.pointer else '.'}{safe(name)}"
        return array_at(text, kind) if kind.kind == "array" else Expression(text, kind)

    @property
    def value(self) -> str:
        """The text of the value, also where there is a pointer to it."""
        return f"*{self.text}" if self.pointer else self.text


def array_at(address: str, kind: Type) -> Expression:
    """An array that lies at an address."""

    def at(indices: Indices) -> Expression:
        return Expression(f"{address}[{flat_index(indices, kind.shape)}]", kind.item)

    return Expression(address, kind, at=at, address=address, part=True)


def element(e: Expression, indices: Indices) -> Expression:
    """The element of a broadcast array at the indices of a loop; what is no array is the same everywhere."""
    if e.at is None:
        return e
    own = indices[len(indices) - len(e.type.shape) :]
    return e.at(tuple("0" if size == 1 else index for index, size in zip(own, e.type.shape, strict=True)))


def added(index: str, offset: str) -> str:
    """An index further on."""
    if offset == "0":
        return index
    return str(int(index) + int(offset)) if index.isdigit() else f"({index} + {offset})"


def flat_index(indices: Indices, shape: tuple[int, ...]) -> str:
    """The place of an element in the memory of an array; within a loop over two dimensions `k` is that of i and j."""
    if len(shape) == 2 and 1 not in shape and indices[1] == "j" and re.match(r"i$|\(i ", indices[0]):
        rows = int(indices[0].strip("(i +)") or 0)
        return f"k + {rows * shape[1]}" if rows else "k"
    terms, stride = [], 1
    for index, size in zip(reversed(indices), reversed(shape), strict=True):
        if index != "0":
            terms.append(index if stride == 1 else f"{stride} * {index}")
        stride *= size
    text = " + ".join(reversed(terms)) or "0"
    return text[1:-1] if text.startswith("(i + ") and len(terms) == 1 else text


@dataclass(frozen=True)
class Step:
    """A statement of every element: where it is written to, from which row on, whether it is added up, and comments."""

    target: str
    value: Expression
    name: str = ""
    row: int = 0
    sums: bool = False
    remarks: tuple[str, ...] = ()


class Loops:
    """The lines of a function, and the loops in them."""

    def __init__(self, program: Program, function: Function) -> None:
        self.program, self.function = program, function
        self.source, self.line = source_of(function.python.__module__), function.node.lineno
        self.parameters = dict(function.parameters)
        self.locals: dict[str, Type] = {}
        self.stored: set[str] = set()
        """Local arrays that other loops read too."""
        self.begin()

    def begin(self) -> None:
        """Begin the text anew, with what is known of the variables."""
        self.out: list[str] = []
        self.depth, self.temporaries, self.changed = 1, 0, False
        self.aliases: dict[str, Expression] = {}
        self.arrays: dict[str, Type] = {}
        self.steps: list[Step] = []
        self.remarks: list[str] = []
        self.here: set[str] = set()
        """Arrays that the loop being written has worked out."""
        self.wanted = ""
        """Name of the variable that the expression at hand is assigned to."""

    def refuse(self, why: str) -> Unsupported:
        """What to raise about the expression at hand."""
        return Unsupported(f"{self.source.file}:{self.line}: {why}")

    def put(self, text: str) -> None:
        """Write a line, and the comments that wait before it."""
        lines, self.remarks = [*self.remarks, text], []
        self.out += ["    " * self.depth + line for line in lines]

    # Names

    def learn(self, name: str, kind: Type) -> None:
        """Note the type of a local variable."""
        if self.locals.get(name) != kind:
            self.locals[name], self.changed = kind, True

    def new_name(self) -> str:
        """A name that is not taken."""
        self.temporaries += 1
        return f"t{self.temporaries}"

    def named(self, e: Expression) -> Expression:
        """An expression's value under a name of its own."""
        name = self.new_name()
        self.put(f"const {e.type.c} {name} = {e.text};")
        return Expression(name, e.type)

    def temporary(self, kind: Type) -> str:
        """The name of a new variable of this type."""
        name = self.new_name()
        self.put(f"{declared(kind, name)};")
        return name

    # Arrays

    def array_name(self) -> str:
        """The name of a new array that other loops read: of the variable that it is for, if it is for one."""
        name, self.wanted = self.wanted or self.new_name(), ""
        self.store(name)
        return name

    def worked_out(self, kind: Type, e: Expression, sums: bool = False) -> Expression:
        """A new array that an expression is worked out in."""
        name = self.array_name()
        result = self.local_array(name, kind)
        self.step(Step(safe(name), e, name, sums=sums))
        return result

    def local_array(self, name: str, kind: Type) -> Expression:
        """A local array: in its own loop a number, if no other needs it."""
        self.learn(name, kind)
        self.arrays[name] = kind

        def at(indices: Indices) -> Expression:
            if name not in self.here:
                self.store(name)
            if kind.size == 1 or name not in self.stored:
                return Expression(safe(name), kind.item)
            return Expression(f"{safe(name)}[{flat_index(indices, kind.shape)}]", kind.item)

        return Expression("", kind, at=at, names=frozenset((name,)), address=safe(name))

    def store(self, name: str) -> None:
        """Keep an array for other loops."""
        if name not in self.stored:
            self.stored.add(name)
            self.changed = True

    def declarations(self) -> list[str]:
        """The arrays that several loops share."""
        shared = [(name, kind) for name, kind in self.arrays.items() if name in self.stored]
        return [f"{declared(kind if kind.size > 1 else kind.item, safe(name))};" for name, kind in shared]

    def each(
        self, form: str, parts: list[Expression], binds: Iterable[int], kind: Type, own: int = ATOM
    ) -> Expression:
        """A form of C, filled with parts; of every element where a part is an array.

        `binds` is how strongly the form binds each part, `kind` and `own` are the type of what it makes, of an element,
        and how strongly that binds.
        """

        def filled(items: list[Expression]) -> Expression:
            texts = [item.bound(bound) for item, bound in zip(items, binds, strict=True)]
            return Expression(form.format(*texts), kind, own)

        arrays = [part for part in parts if part.type.kind == "array"]
        if not arrays:
            return filled(parts)
        # What calls a function is worked out once.
        parts = [self.named(p) if p.at is None and re.search(r"\w\(", p.text) else p for p in parts]
        try:
            shape = np.broadcast_shapes(*(array.type.shape for array in arrays))
        except ValueError as error:
            raise self.refuse(f"shapes that do not broadcast: {error}.") from error
        names = frozenset[str]().union(*(array.names for array in arrays))
        return Expression(
            "",
            array_of(kind, shape),
            at=lambda indices: filled([element(part, indices) for part in parts]),
            names=names,
        )

    # Loops

    def ready(self, e: Expression) -> None:
        """Write the loop that waits if the arrays of an expression are worked out there."""
        if any(step.name in e.names for step in self.steps):
            self.flush()

    def step(self, step: Step) -> None:
        """Put a statement of every element into the loop that waits, or begin another."""
        first = self.steps[0] if self.steps else step
        if (step.value.type.shape, step.sums) != (first.value.type.shape, first.sums):
            self.flush()
        self.steps.append(replace(step, remarks=tuple(self.remarks)))
        self.remarks = []

    @property
    def waiting_shape(self) -> tuple[int, ...]:
        """Shape of the loop that waits; empty for none."""
        return self.steps[0].value.type.shape if self.steps else ()

    def apart(self, e: Expression) -> Expression:
        """An array worked out in a loop of its own, before the one that waits if that makes no part of it."""
        self.ready(e)
        waiting, self.steps = self.steps, []
        result = self.worked_out(e.type, e)
        self.flush()
        self.steps = waiting
        return result

    def flush(self) -> None:
        """Write the loop that waits; comments that wait belong to what comes after it."""
        if not self.steps:
            return
        (steps, self.steps), (remarks, self.remarks) = (self.steps, []), (self.remarks, [])
        shape, depth = steps[0].value.type.shape, self.depth
        names = ("i", "j")[2 - len(shape) :]
        indices = tuple("0" if size == 1 else name for name, size in zip(names, shape, strict=True))
        loops = [(name, size) for name, size in zip(names, shape, strict=True) if size > 1]
        sums = {s.name: safe(s.name) + "[i]" * (len(shape) > 1) for s in steps if s.sums}
        if sums:
            # From -0.0 on, as -0.0 + x is x, also where x is -0.0. All rows at once: no sum waits for itself.
            self._open(loops[:-1])
            for text in sums.values():
                self.put(f"{text} = -0.0;")
            self._close(depth)
            loops.reverse()
        self._open(loops)
        begun, self.here = len(self.out), set()
        for s in steps:
            text, self.remarks = element(s.value, indices).text, list(s.remarks)
            self.put(f"{sums[s.name]} += {text};" if s.sums else f"{self._target(s, indices)} = {text};")
        self.here = set()
        if any("[k" in line for line in self.out[begun:]):
            self.out.insert(begun, f"{'    ' * self.depth}const int k = {shape[-1]} * i + j;")
        self._close(depth)
        self.remarks = remarks

    def _target(self, s: Step, indices: Indices) -> str:
        """What a statement of every element assigns to; with its type where that is a number of the loop."""
        if s.name and (s.name not in self.stored or s.value.type.size == 1):
            new = s.name not in self.stored | self.here
            text = f"{f'{s.value.type.item.c} ' if new else ''}{safe(s.name)}"
        else:
            moved = (added(indices[0], str(s.row)), *indices[1:])
            text = f"{s.target}[{flat_index(moved, s.value.type.shape)}]"
        self.here.add(s.name)
        return text

    def _open(self, loops: list[tuple[str, int]]) -> None:
        for name, size in loops:
            self.put(f"for (int {name} = 0; {name} < {size}; {name}++) {{")
            self.depth += 1

    def _close(self, depth: int) -> None:
        while self.depth > depth:
            self.depth -= 1
            self.put("}")
