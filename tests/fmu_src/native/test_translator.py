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
    text = "".join(library.program.bodies[library.program.require(translatable.nested).c])
    assert "pair.first" in text


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


@pytest.mark.parametrize(
    "function",
    [_power, _text, _untyped, _generator, _hypot, _divided, _identity, _raising, _anything, _many],
    ids=lambda f: f.__name__,
)
def test_what_it_does_not_know_it_refuses_with_file_and_line(function):
    first = function.__code__.co_firstlineno
    with pytest.raises(Unsupported, match=rf"test_translator\.py:({first}|{first + 1}|{first + 2}): "):
        Program(translated).require(function)
