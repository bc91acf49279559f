"""What the translator makes of each construct that it knows, and what it refuses."""

import copy
import math
import types
from itertools import product

import numpy as np
import pytest
import translatable
from native_calls import bits, build, drawn

from fmu_src.native.translator.body import translated
from fmu_src.native.translator.program import Program
from fmu_src.native.translator.source import Unsupported
from trpac_core.robust.arrays import cumulated, total

FUNCTIONS = [
    f
    for f in vars(translatable).values()
    if isinstance(f, types.FunctionType) and f.__module__ == "translatable"
]
SPECIAL = (0.0, -0.0, 1.0, -2.0, math.inf, -math.inf, math.nan)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    program = Program(translated)
    for function in FUNCTIONS:
        program.require(function)
    return build(program, tmp_path_factory.mktemp("c"))


@pytest.mark.parametrize(
    "function", [f for f in FUNCTIONS if f.__name__ not in ("_lower", "shaped")], ids=lambda f: f.__name__
)
def test_each_construct(library, function):
    rng = np.random.default_rng(0)
    kinds = library.program.require(function).parameters
    compared = 0
    for _ in range(200):
        arguments = [drawn(kind, rng, "given" if kind.kind == "int" else "", 0.2) for _, kind in kinds]
        if function.__name__ in ("by_index", "row_of"):
            arguments[-1] = int(rng.integers(0, 2))
        given = copy.deepcopy(arguments)  # some are changed in place
        try:
            with np.errstate(all="ignore"):
                expected = function(*given)
        except ArithmeticError:
            continue
        assert bits(library.call(function, *arguments)) == bits(expected)
        assert bits(arguments) == bits(given)
        compared += 1
    assert compared > 100


@pytest.mark.parametrize("function", [translatable.least, translatable.ordered])
def test_special_numbers_are_compared_as_python_does(library, function):
    for arguments in product(SPECIAL, repeat=3):
        assert bits(library.call(function, *arguments)) == bits(function(*arguments))


def test_docstrings_comments_and_lines_go_along(library):
    line = translatable.unpacked.__code__.co_firstlineno
    _, code = library.program.texts("all", "")
    assert f"/* What comes of two pairs. (translatable.py:{line}) */\ndouble translatable_unpacked(" in code
    assert "    /* The second one counts. */\n    return a - b * c;\n" in code


def _power(x: float) -> float:
    return x**2


def _text(x: float) -> str:
    return f"{x}"


def _untyped(x):
    return x


def _generator(x: float) -> float:
    return sum(k for k in (x, x))


def _hypot(x: float) -> float:
    return math.hypot(x, x)


def _divided(n: int) -> float:
    return n / 2


def _identity(a: translatable.Pair, b: translatable.Pair) -> bool:
    return a is b


def _raising(x: float) -> float:
    if x < 0.0:
        raise ValueError
    return x


def _anything(x: float) -> float:
    return math.fsum([x, x])


def _many(*x: float) -> float:
    return x[0]


def _swapped(a: float, b: float) -> float:
    a, b = b, a
    return a


def _stacked(pair: translatable.Pair) -> float:
    (a, _b), _c = pair
    return a


def _unnamed(line: translatable.LINE) -> translatable.LINE:
    return cumulated(np.abs(line))


def _while(line: translatable.LINE) -> float:
    while total(line)[0] < 1.0:
        return 1.0
    return 2.0


def _loop(pair: translatable.Pair) -> float:
    for value in pair:
        return value
    return 0.0


def _unfit(rows: translatable.ROWS, line: translatable.LINE) -> translatable.ROWS:
    return rows + line[:2]


REFUSED = (
    _power, _text, _untyped, _generator, _hypot, _divided, _identity, _raising, _anything, _many, _swapped, _stacked,
    _unnamed, _while, _loop, _unfit,
)  # fmt: skip


@pytest.mark.parametrize("function", REFUSED, ids=lambda f: f.__name__)
def test_what_it_does_not_know_it_refuses_with_file_and_line(function):
    first = function.__code__.co_firstlineno
    with pytest.raises(Unsupported, match=rf"test_translator\.py:({first}|{first + 1}|{first + 2}): "):
        Program(translated).require(function)
