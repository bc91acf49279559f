"""Small functions in the subset that the translator knows, one for each rule."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, NamedTuple

import numpy as np

from trpac_core.robust.arrays import (
    Array,
    count_below,
    count_up_to,
    cumulated,
    exp,
    greatest,
    over_rows,
    total,
)

ROWS = Annotated[Array, (2, 5)]
COLUMN = Annotated[Array, (2, 1)]
LINE = Annotated[Array, (5,)]
TABLE = np.array([[1.0, 2.0, 3.0, 4.0, 5.0], [-1.0, 0.5, 0.25, -0.0, 7.0]])
OUTPUTS = (0.5, 1.5, 3.0)


class Colour(Enum):
    RED = 0
    BLUE = 3


class Pair(NamedTuple):
    first: float
    second: float = 2.5

    @property
    def gap(self) -> float:
        return self.second - self.first


@dataclass(frozen=True)
class Named:
    pair: Pair
    colour: Colour
    count: int = 3
    limit: float | None = None


@dataclass
class Memory:
    rows: ROWS
    pair: Pair
    calls: int


class Kept(NamedTuple):
    rows: ROWS
    level: float


class Shape(NamedTuple):
    height: Array
    slope: Array


def least(a: float, b: float, c: float) -> float:
    return min(max(a, b), c)


def least_count(a: int, b: int) -> int:
    return max(min(a, b), -2)


def ordered(a: float, b: float, c: float) -> bool:
    return a < b <= c and c != a


def first_of(a: float, b: float) -> float:
    return a or b


def either(value: float | None, other: float) -> float:
    return value or other


def held(value: float | None) -> float:
    return -1.0 if value is None else value * 2.0


def unpacked(pair: Pair, other: Pair) -> float:
    """What comes of two pairs.

    More of it.
    """
    (a, b), c = pair, other.gap
    # The second one counts.
    return a - b * c


def changed(named: Named, by: float) -> Named:
    named = replace(named, pair=named.pair._replace(second=by), limit=by if by > 0.0 else None)
    return replace(named, count=named.count + 1)


def is_red(named: Named) -> bool:
    return named.colour is Colour.RED or named.count not in (1, 2)


def looped(start: float, n: int) -> float:
    value = start
    for index in range(n):
        if value <= 1e6:
            value += index * value
    while 10.0 < value < 1e9:
        value /= 2.0
    return value


def by_index(index: int) -> float:
    return OUTPUTS[index]


def mixed(flag: bool, n: int) -> float:
    return (n + 2 * flag) / 4.0 + math.copysign(1.0, -0.0)


def same(a: Named, b: Named) -> bool:
    return a == b


def softened(rows: ROWS, by: COLUMN, line: LINE, scale: float) -> ROWS:
    shifted = rows - by
    size = np.maximum(np.abs(shifted), 0.5)
    mean = total(size * line)
    centred = size / mean
    row_sum = total(centred)
    return exp(-scale * centred) + row_sum[:, 0][:, None] * np.where(rows > by, 1.0, -1.0)


def columns(rows: ROWS) -> LINE:
    most, summed = greatest(rows), over_rows(rows)
    return over_rows(rows[:, :]) / most + cumulated(summed)


def row_of(rows: ROWS, index: int) -> LINE:
    return rows[index] + TABLE[1]


def halves(rows: ROWS) -> float:
    top, bottom = rows[:1], rows[1:]
    return float(total(top[0] - bottom[0])[0]) + rows[1, 2]


def places(line: LINE, value: float) -> tuple[int, int]:
    size = np.abs(line)
    up_to = cumulated(size)
    return count_below(up_to, value), count_up_to(up_to, value)


def shaped(height: Array, slope: float) -> Shape:
    low = height * slope
    return Shape(low, np.sqrt(np.abs(low)))


def all_shaped(rows: ROWS, slope: float) -> ROWS:
    shape = shaped(rows, slope)
    shape = shape._replace(slope=shape.slope + 1.0)
    return shape.height - shape.slope


def kept(state: Kept, by: float) -> Kept:
    rows = state.rows * state.level
    state = state._replace(level=state.level + by, rows=rows)
    if by < 0.0:
        return _lower(state, by)
    return state._replace(level=by)


def _lower(state: Kept, by: float) -> Kept:
    rows = state.rows + by
    return state._replace(rows=rows)


def remembered(memory: Memory, by: float) -> float:
    memory.calls += 1
    memory.pair = memory.pair._replace(first=by)
    memory.rows = memory.rows + memory.pair.gap
    return memory.rows[1, 4]
