"""The variables of the unit `TrpacEstimator4W`, in the order of their value references.

They are those of one wheel, four times for signals of a wheel, twice for signals of a side of the road.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from trpac_core.four_wheels import FourWheelsConfig
from trpac_core.parameters.variables import Kind, Variable
from trpac_core.tyre import GREATEST_THETA
from trpac_core.vehicle import WHEELS

from .settings import PARAMETERS
from .signals import INPUTS, INTERVAL_OUTPUTS, OUTPUTS

PER_WHEEL = ("wheel_speed", "wheel_torque", "vertical_load")
PER_SIDE = ("road_class", "road_class_confidence")
SIDES = ("left", "right")
WHICH_WHEEL = ("wheel.front", "wheel.left")
"""Parameters of the one-wheel unit that select its wheel."""
WHEEL_NAMES = dict(zip(WHEELS, ("front left", "front right", "rear left", "rear right"), strict=True))


def _at_each_wheel(variable: Variable) -> Iterator[Variable]:
    for wheel, wheel_name in WHEEL_NAMES.items():
        yield replace(
            variable,
            name=f"{variable.name}.{wheel}",
            description=f"{_capital(wheel_name)} wheel: {variable.description}",
        )


def _input(variable: Variable) -> Iterator[Variable]:
    if variable.name in PER_WHEEL:
        yield from _at_each_wheel(variable)
    elif variable.name in PER_SIDE:
        for side in SIDES:
            yield replace(
                variable,
                name=f"{variable.name}.{side}",
                description=f"{_capital(side)} track: {variable.description}",
            )
    else:
        yield variable


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


_LATERAL = Variable(
    "lateral_acceleration",
    Kind.REAL,
    "input",
    "continuous",
    "Lateral acceleration, positive to the left; used only beside a longitudinal acceleration",
    "m/s2",
    0.0,
    nominal=10.0,
)
_OF_THE_CAR = (
    Variable(
        "TRPAC.vehicle",
        Kind.REAL,
        "output",
        "continuous",
        "Adhesion that the braking car can use: each front wheel its own, both rear wheels the lower of the two",
        "1",
        None,
        0.0,
        GREATEST_THETA,
    ),
    Variable(
        "TRPAC_std.vehicle",
        Kind.REAL,
        "output",
        "continuous",
        "Standard deviation of TRPAC.vehicle",
        "1",
        None,
        0.0,
    ),
)
_AXLE_DEVIATION = Variable(
    "estimator.axle_deviation",
    Kind.REAL,
    "parameter",
    "fixed",
    "Standard deviation of the change of adhesion along one wheelbase",
    "1",
    FourWheelsConfig().axle_deviation,
    0.0,
    source="axle_deviation",
)

TRPAC_ESTIMATOR_4W = (
    *(made for variable in INPUTS for made in _input(variable)),
    _LATERAL,
    *(made for variable in OUTPUTS for made in _at_each_wheel(variable)),
    *_OF_THE_CAR,
    _AXLE_DEVIATION,
    *(
        replace(v, source=f"wheel.{v.source}" if v.source else "")
        for v in PARAMETERS
        if v.name not in WHICH_WHEEL
    ),
    *(made for variable in INTERVAL_OUTPUTS for made in _at_each_wheel(variable)),
    *(replace(v, name=f"{v.name}.vehicle", description=f"Car: {v.description}") for v in INTERVAL_OUTPUTS),
)
"""Variables of the unit `TrpacEstimator4W`."""
