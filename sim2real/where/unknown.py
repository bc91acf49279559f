"""What no effect explains, in words: which equation wants a further term, on what it depends, in which shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.result import Measure, Unexplained
from sim2real.where.equations import PER_DRIVE, QUANTITIES, TORQUE_GAIN, TWO_SIDED, Equation
from sim2real.where.terms import Term

Array = NDArray[np.float64]

SLIGHT, ALONE = 0.15, 20.0
"""Share of the misfit below which no term explains it, and how many times the others' squares beyond noise one kind of
sensor's must be for the gap to be its own [-]."""
SENSOR_OF = {
    "wheel_speed": "wheel_speed_sensor",
    "vehicle_speed": "vehicle_speed_sensor",
    "accel_x": "accelerometer",
}


def characterise(
    terms: Sequence[Term], suspect: Equation | None = None, of: str = "the misfit"
) -> Unexplained:
    """The best term in the form of a result; `suspect` is a sensor that stands alone, `of` what it explains."""
    best = terms[0]
    share = 1.0 - best.loss / max(best.null_loss, 1e-12)
    shape, sign = shape_of(best), sign_of(best)
    wanted = _wanted(best, sign, shape)
    subsystem = subsystem_of(best)
    sentence = (
        f"The {subsystem.replace('_', ' ')}'s equation ({best.equation.key}) {wanted}. "
        f"Such a term takes {100.0 * share:.0f} % of {of}."
    )
    if suspect:
        sentence = f"Without the {suspect.key.removesuffix(' sensor')}'s signal all else agrees. {sentence}"
    if best.equation.key == "axles":
        sentence += " Another split of the torque does so, or tyres of one axle unlike the other's."
    return Unexplained(
        subsystem,
        best.equation.signal,
        best.quantity,
        best.equation.unit,
        sign,
        shape,
        share,
        *best.drawn,
        sentence,
    )


def subsystem_of(term: Term) -> str:
    """Where a term belongs: what the tyres give by the place is what the road gives."""
    by_place = term.equation.key == "tyre" and term.quantity == "position"
    return "road" if by_place else term.equation.subsystem


def _wanted(term: Term, sign: str, shape: str) -> str:
    """What an equation wants, in words; sign and shape are the curve's."""
    on = f"{term.quantity} [{QUANTITIES[term.quantity][0]}]"
    if term.equation.key != TORQUE_GAIN:
        unit = "" if term.equation.unit == "-" else f" in {term.equation.unit}"
        return f"wants a further term{unit} that depends on {on}: it {sign} and {shape}"
    x, y = term.drawn
    if term.quantity not in TWO_SIDED:
        return f"wants another share of the torque, which depends on {on}: {_span(x, y)}"
    sides = {"where it drives": x > 0.0, "where it brakes": x < 0.0}
    spans = [f"{words} {_span(np.abs(x[side]), y[side])}" for words, side in sides.items() if side.any()]
    return f"wants another share of the torque, which depends on {on}: {', '.join(spans)}"


def _span(x: Array, y: Array) -> str:
    """The least and the greatest share of a curve, in the order of their places."""
    ends = sorted((int(y.argmin()), int(y.argmax())), key=lambda at: float(x[at]))
    return " to ".join(f"{100.0 * y[at]:+.0f} % at {x[at]:.3g}" for at in ends)


def seen_alone(term: Unexplained, before: Measure) -> Unexplained:
    """A gap that one kind of sensor alone shows, and that no term explains, is that sensor's: a force moves the car.

    `before` is the gap as simulated [noise floors].
    """
    if term.share >= SLIGHT:
        return term
    excess = {signal: max(before.signals.get(signal, 1.0) ** 2 - 1.0, 0.0) for signal in SENSOR_OF}
    signal = max(excess, key=lambda name: excess[name])
    others = sum(size for name, size in excess.items() if name != signal)
    if excess[signal] < max(ALONE * others, 1.0):
        return term
    sensor = SENSOR_OF[signal]
    sentence = (
        f"{signal} alone shows it ({before.signals[signal]:.1f} times the noise), and no term takes more than "
        f"{100.0 * term.share:.0f} % of it: look at the {sensor.replace('_', ' ')}."
    )
    return replace(term, subsystem=sensor, signal=signal, sentence=sentence)


def sign_of(term: Term) -> str:
    """Sign of a curve, in words."""
    if np.all(term.y >= 0.0):
        return "is positive throughout"
    if np.all(term.y <= 0.0):
        return "is negative throughout"
    if term.quantity in ("torque", "acceleration", "slip") and np.corrcoef(term.x, term.y)[0, 1] < -0.5:
        return "opposes it"
    return "changes sign"


def shape_of(term: Term) -> str:
    """Shape of a curve, in words: the simplest of a few that comes within a tenth of it."""
    if term.quantity in PER_DRIVE:
        return "comes and goes"
    x = term.x / max(float(np.abs(term.x).max()), 1e-12)
    spread = float(np.sqrt(np.mean(term.y**2)))
    forms = {
        "is constant": [np.ones_like(x)],
        "is proportional to it": [x],
        "grows with its square": [x * np.abs(x)],
        "has one size with the quantity's sign": [np.sign(x)],
        "is a straight line": [np.ones_like(x), x],
        "is a parabola": [np.ones_like(x), x, x * x],
    }
    for words, basis in forms.items():
        design = np.column_stack(basis)
        rest = term.y - design @ np.linalg.lstsq(design, term.y, rcond=None)[0]
        if np.sqrt(np.mean(rest**2)) < 0.1 * spread:
            return words
    return "bends in its own way"
