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
    terms: Sequence[Term], isolated: Equation | None = None, of: str = "the misfit"
) -> Unexplained:
    """The best term as a result; `isolated` is the sensor without which all others agree."""
    best = terms[0]
    share = 1.0 - best.loss / max(best.null_loss, 1e-12)
    shape, sign = shape_of(best), sign_of(best)
    wanted = _wanted(best, sign, shape)
    subsystem = subsystem_of(best)
    sentence = (
        f"The equation of the {subsystem.replace('_', ' ')} ({best.equation.key}) {wanted}. Such a term explains "
        f"{100.0 * share:.0f} % of {of}."
    )
    if isolated:
        name = isolated.key.removesuffix(" sensor")
        sentence = f"Without the signal of the {name} all other signals agree. {sentence}"
    if best.equation.key == "axles":
        sentence += (
            " Possible reasons: another torque split between the axles, or different tyres on the axles."
        )
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
        return f"needs an additional term{unit} that depends on {on}: it {sign} and {shape}"
    x, y = term.drawn
    if term.quantity not in TWO_SIDED:
        return f"needs a relative torque correction that depends on {on}: {_span(x, y)}"
    sides = {"in driving": x > 0.0, "in braking": x < 0.0}
    spans = [f"{words} {_span(np.abs(x[side]), y[side])}" for words, side in sides.items() if side.any()]
    return f"needs a relative torque correction that depends on {on}: {', '.join(spans)}"


def _span(x: Array, y: Array) -> str:
    """The least and the greatest share of a curve, in the order of their places."""
    ends = sorted((int(y.argmin()), int(y.argmax())), key=lambda at: float(x[at]))
    return " to ".join(f"{100.0 * y[at]:+.0f} % at {x[at]:.3g}" for at in ends)


def seen_alone(term: Unexplained, before: Measure) -> Unexplained:
    """A gap that one kind of sensor alone shows, and that no term explains, is that sensor's: a force moves the car.

    `before` is the gap as simulated [sensor noises].
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
        f"Only {signal} shows the gap ({before.signals[signal]:.1f} times the noise), and no term explains more "
        f"than {100.0 * term.share:.0f} % of it: check the {sensor.replace('_', ' ')}."
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
        return "varies"
    x = term.x / max(float(np.abs(term.x).max()), 1e-12)
    spread = float(np.sqrt(np.mean(term.y**2)))
    forms = {
        "is constant": [np.ones_like(x)],
        "is proportional to it": [x],
        "grows with its square": [x * np.abs(x)],
        "has a constant size and the sign of the quantity": [np.sign(x)],
        "is a straight line": [np.ones_like(x), x],
        "is a parabola": [np.ones_like(x), x, x * x],
    }
    for words, basis in forms.items():
        design = np.column_stack(basis)
        rest = term.y - design @ np.linalg.lstsq(design, term.y, rcond=None)[0]
        if np.sqrt(np.mean(rest**2)) < 0.1 * spread:
            return words
    return "has no simple form"
