"""Units that logs come in, and their factors to the units of the log format.

A table of our own, since general unit libraries read some of these spellings as something else without an error: Nm as
nanometre, g as gram, Hz as rad/s without the factor 2 pi.
"""

from __future__ import annotations

from math import pi

from scipy import constants

UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": constants.minute, "h": constants.hour},
    "m": {
        "m": 1.0,
        "km": 1e3,
        "cm": 1e-2,
        "mm": 1e-3,
        "mi": constants.mile,
        "ft": constants.foot,
    },
    "m/s": {
        "m/s": 1.0,
        "km/h": constants.kmh,
        "kph": constants.kmh,
        "kmph": constants.kmh,
        "mph": constants.mph,
        "knot": constants.knot,
        "ft/s": constants.foot,
        "cm/s": 1e-2,
        "mm/s": 1e-3,
    },
    "m/s2": {"m/s2": 1.0, "g": constants.g, "ft/s2": constants.foot, "cm/s2": 1e-2, "mm/s2": 1e-3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": constants.degree, "°": constants.degree},
    "rad/s": {
        "rad/s": 1.0,
        "rpm": 2.0 * pi / constants.minute,
        "1/min": 2.0 * pi / constants.minute,
        "rev/s": 2.0 * pi,
        "deg/s": constants.degree,
        "°/s": constants.degree,
    },
    "N m": {
        "Nm": 1.0,
        "kNm": 1e3,
        "daNm": 10.0,
        "lbf ft": constants.lbf * constants.foot,
        "lb ft": constants.lbf * constants.foot,
        "ft lb": constants.lbf * constants.foot,
        "lbf in": constants.lbf * constants.inch,
    },
    "-": {"-": 1.0, "1": 1.0, "%": 1e-2},
}
"""Unit of the log format to the units that become it, each with its factor."""

_PLAIN = str.maketrans({" ": "", "·": "", "*": "", ".": "", "^": "", "²": "2", "µ": "u", "μ": "u"})


def factor(unit: str, quantity: str) -> float:
    """What a value in `unit` is multiplied with to be in the log format's unit `quantity`.

    Spaces, points, stars and capitals do not matter: N.m, N*m and Nm are the same.

    Raises
    ------
    ValueError
        There is no such way; names the units that there are.

    Examples
    --------
    >>> round(factor("km/h", "m/s") * 36.0, 9)
    10.0
    """
    table = {_plain(name): value for name, value in UNITS[quantity].items()}
    if _plain(unit) not in table:
        raise ValueError(
            f"unit {unit!r} cannot become [{quantity}]; known units: {', '.join(UNITS[quantity])}."
        )
    return table[_plain(unit)]


def _plain(unit: str) -> str:
    return unit.translate(_PLAIN).lower()
