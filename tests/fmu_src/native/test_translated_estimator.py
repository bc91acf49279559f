"""The estimator's functions in C return what they return in Python, bit for bit."""

import copy
import inspect

import numpy as np
import pytest
from native_calls import bits, build, drawn

from fmu_src.native.build import NATIVE_UNITS
from fmu_src.native.estimator import estimator_program
from trpac_core.robust import wheel as robust
from trpac_core.robust.belief import WheelModel
from trpac_core.vehicle import CarTolerance, Vehicle

PROGRAM = estimator_program()
for unit in NATIVE_UNITS.values():
    for needed in unit.functions:
        PROGRAM.require(needed)
CALLS = 60
REFUSALS = (ArithmeticError, ValueError)
"""What Python raises where C goes on with inf or NaN."""


def whole(kind):
    """Whether nothing of a type is left out in C: else only the unit's drives compare it."""
    inner = [field.type for field in kind.fields if kind.kind == "record"] + [kind.item] * (
        kind.item is not None
    )
    return not kind.left_out and all(map(whole, inner))


FUNCTIONS = [
    f for f in PROGRAM.functions.values() if not f.private and all(whole(kind) for _, kind in f.parameters)
]
CAR = Vehicle()
WHEEL = WheelModel(CAR.longitudinal_stiffness_n, 3300.0, CAR.wheel_inertia_kg_m2, CAR.wheel_radius_m)
SETUP = (WHEEL, 0.012, 0.0042, 10.0, CarTolerance(), (0.8, 0.6, 0.2))


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return build(PROGRAM, tmp_path_factory.mktemp("c"))


@pytest.mark.parametrize("odd", [0.0, 0.05])
@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.c)
def test_random_calls(library, function, odd):
    rng = np.random.default_rng(sum(function.c.encode()))
    compared = 0
    many = any(kind.big or kind.kind == "array" for _, kind in function.parameters)
    for _ in range(CALLS // 4 if many else CALLS):
        arguments = [drawn(kind, rng, name, odd) for name, kind in function.parameters]
        given = copy.deepcopy(arguments)  # some are changed in place
        try:
            with np.errstate(all="ignore"):
                expected = _python(function, arguments)
        except REFUSALS:
            continue
        assert bits(library.call(function.python, *given)) == bits(expected)
        assert bits(given) == bits(arguments)
        compared += 1
    assert compared or odd


def _python(function, arguments):
    """What Python returns; some arguments are taken by name only."""
    parameters = inspect.signature(function.python).parameters
    by_name = {
        n: a for (n, p), a in zip(parameters.items(), arguments, strict=True) if p.kind is p.KEYWORD_ONLY
    }
    return function.python(*arguments[: len(arguments) - len(by_name)], **by_name)


def drive(seed, steps):
    """Samples of a wheel that is driven and braked, some unusable, and what else a step takes."""
    rng, speed = np.random.default_rng(seed), 15.0
    for step in range(steps):
        torque = 500.0 * np.sin(0.01 * step) + 5.0 * rng.normal()
        speed = max(speed + 1e-6 * torque, 2.0)
        slip = torque / 0.29 / 3000.0 * 0.06
        omega = speed * (1.0 + slip) / 0.29 + 0.02 * rng.normal()
        sample = robust.Sample(float(omega), float(torque), float(speed + 0.01 * rng.normal()), 3000.0)
        given = -1 if step < steps // 3 else (step // 150) % 4 - 1
        yield None if step % 397 == 396 else sample, given, 0.001, 0.001 * speed, step % 7 == 0


def test_robust_drive(library):
    known = robust.setup(*SETUP)
    assert bits(library.call(robust.setup, *SETUP)) == bits(known)
    state = there = robust.begun(known)
    assert bits(library.call(robust.begun, known)) == bits(state)
    begun = state.said
    for arguments in drive(1, 1500):
        state = robust.stepped(state, known, *arguments)
        there = library.call(robust.stepped, there, known, *arguments)
        assert bits(there) == bits(state)
        assert library.call(robust.point, there, 0.5) == robust.point(state, 0.5)
    assert state.said != begun
