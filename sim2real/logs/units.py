"""Units that logs come in, and their factors to the units of the log format.

A table of our own, since general unit libraries read some of these spellings as something else without an error: Nm as
nanometre, g as gram, Hz as rad/s without the factor 2 pi.
"""

from __future__ import annotations

import re
from functools import cache
from math import pi

from scipy import constants

_HYPHEN = re.compile(r"(?<=[A-Za-z])-(?=[A-Za-z])")
_RPM = 2.0 * pi / constants.minute
UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": constants.minute, "h": constants.hour}
    | {"sec": 1.0, "second": 1.0, "seconds": 1.0, "msec": 1e-3, "usec": 1e-6},
    "m": {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "mi": constants.mile, "ft": constants.foot}
    | {"meter": 1.0, "metre": 1.0, "meters": 1.0, "metres": 1.0, "mile": constants.mile},
    "m/s": {"m/s": 1.0, "km/h": constants.kmh, "mph": constants.mph, "kn": constants.knot}
    | {"kph": constants.kmh, "kmph": constants.kmh, "kmh": constants.kmh, "km/hr": constants.kmh}
    | {"mi/h": constants.mph, "mile/h": constants.mph, "knot": constants.knot, "knots": constants.knot}
    | {"kt": constants.knot, "m/sec": 1.0, "mps": 1.0, "m*s-1": 1.0, "ft/s": constants.foot}
    | {"cm/s": 1e-2, "mm/s": 1e-3, "meterpersec": 1.0, "kmperhour": constants.kmh},
    "m/s2": {"m/s2": 1.0, "g": constants.g, "ft/s2": constants.foot, "cm/s2": 1e-2, "mm/s2": 1e-3}
    | {"m/s/s": 1.0, "m/sec2": 1.0, "m*s-2": 1.0, "mps2": 1.0, "gn": constants.g, "mg": 1e-3 * constants.g},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": constants.degree, "°": constants.degree}
    | {"degree": constants.degree, "degrees": constants.degree, "radian": 1.0},
    "rad/s": {"rad/s": 1.0, "rpm": _RPM, "1/min": _RPM, "rev/s": 2.0 * pi, "deg/s": constants.degree}
    | {"U/min": _RPM, "min-1": _RPM, "rev/min": _RPM, "r/min": _RPM, "/min": _RPM, "Upm": _RPM}
    | {"rps": 2.0 * pi, "U/s": 2.0 * pi, "rad/sec": 1.0, "rad*s-1": 1.0, "mrad/s": 1e-3}
    | {"°/s": constants.degree, "degree/s": constants.degree, "degrees/s": constants.degree}
    | {"deg/sec": constants.degree, "dps": constants.degree},
    "N m": {"Nm": 1.0, "kNm": 1e3, "daNm": 10.0, "mNm": 1e-3, "MNm": 1e6, "cNm": 1e-2}
    | {"lbf ft": constants.lbf * constants.foot, "lb ft": constants.lbf * constants.foot}
    | {"ft lb": constants.lbf * constants.foot, "ft lbf": constants.lbf * constants.foot}
    | {"lbf in": constants.lbf * constants.inch, "newtonmeter": 1.0, "newtonmetre": 1.0},
    "-": {"-": 1.0, "1": 1.0, "%": 1e-2, "unitless": 1.0, "none": 1.0, "ratio": 1.0, "percent": 1e-2},
}
"""Unit of the log format to the units that become it, each with its factor."""

_PLAIN = str.maketrans(
    dict.fromkeys(" _·*.^()[]⋅×", "") | {"²": "2", "⁻": "-", "¹": "1", "µ": "u", "μ": "u", "−": "-"}
)


def factor(unit: str, quantity: str) -> float:
    """What a value in `unit` is multiplied with to be in the log format's unit `quantity`.

    Spaces, points, stars, hyphens between letters and, where no two units differ by them, capitals do not matter:
    N.m, N-m and NM are Nm, but mNm is not MNm.

    Raises
    ------
    ValueError
        There is no such way; names the units that there are.

    Examples
    --------
    >>> round(factor("km/h", "m/s") * 36.0, 9)
    10.0
    """
    plain = plain_unit(unit)
    exact, folded = _tables()[quantity]
    if plain in exact:
        return exact[plain]
    values = folded.get(plain.casefold(), frozenset())
    if len(values) != 1:
        what = "may be one of two, by its capitals" if values else f"cannot become [{quantity}]"
        raise ValueError(f"unit {unit!r} {what}; known units: {', '.join(UNITS[quantity])}.")
    return next(iter(values))


def quantities(unit: str) -> frozenset[str]:
    """The log format's units that a unit can become; empty for a text that is no unit."""
    plain = plain_unit(unit)
    return frozenset(
        quantity
        for quantity, (exact, folded) in _tables().items()
        if plain in exact or len(folded.get(plain.casefold(), ())) == 1
    )


@cache
def _tables() -> dict[str, tuple[dict[str, float], dict[str, frozenset[float]]]]:
    """By quantity: factors by the plain unit, and all factors by the unit without capitals."""
    tables = {}
    for quantity, units in UNITS.items():
        exact = {plain_unit(name): value for name, value in units.items()}
        folded: dict[str, frozenset[float]] = {}
        for name, value in exact.items():
            folded[name.casefold()] = folded.get(name.casefold(), frozenset()) | {value}
        tables[quantity] = exact, folded
    return tables


def plain_unit(unit: str) -> str:
    """A unit without what does not matter in it: blanks, points, stars, brackets."""
    return _HYPHEN.sub("", unit.strip().translate(_PLAIN))
