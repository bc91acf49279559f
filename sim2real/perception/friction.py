"""The class's friction value against a friction reference, stretch by stretch of road.

The simulation of a car with a camera predicts mu_reference as the class's value, or the tyre's peak at it: one that
follows road.yaml's own friction instead says that the class's value is wrong for this road. Without camera results
nothing is said of classes, and road.yaml's friction, or the tyre's peak there, is what the simulation has. With or
without, a reference that follows the friction that the dynamics were found to show is no gap of the camera. A stretch
of one segment is one observation.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from scenarios.effects import Effect
from scenarios.effects.class_friction_offset import ClassFrictionOffset
from scenarios.files import RoadFile, VehicleFile
from sim2real.logs import Log
from sim2real.perception.chain import DECISIVE, Account, Chain, Oddity, price
from sim2real.perception.frames import Modelled
from sim2real.perception.late_reference import answer_of, odd_lateness
from sim2real.perception.stretches import (
    OF_ROAD_FILE,
    SIMULATED,
    TOLERANCE,
    Reading,
    Stretches,
    find_stretches,
    readings,
)
from sim2real.result import NORMAL_95, Interval, Place
from trpac_core.vision.classes import CLASS_THETA, Surface

Array = NDArray[np.float64]

TAIL = 4.0
"""Degrees of freedom of a stretch's error."""
CALIBRATION = 0.04
"""Standard deviation, as a share, of what references are off in all stretches of a class: another tyre's peak [-]."""
CLASSES = tuple(s.label for s in Surface)
USUAL = np.array([CLASS_THETA[s] for s in Surface])
"""The classes' values, in the order of `Surface` [-]."""
CALIBRATION_ERROR = np.maximum(CALIBRATION * USUAL, TOLERANCE)
"""Standard deviation of what all stretches of a class are off together, in the order of `Surface` [-]."""
SIGNAL, OFFSET = "mu_reference", "class_friction_offset"
NEXT_STEP = "Brake to the limit on each surface: the tyres then show the friction of the road and which value is wrong."
NOTABLE, MOST_PLACES = 3.0, 4
IN_DOUBT = 0.5 * DECISIVE
"""By so much the plain reading may change the class values more than another one before it is left [nats]."""
FEWEST_UNSEEN = 3
"""Stretches of the hold-out that can say that there is no gap."""
BOUNDS = {p.name: (float(p.low), float(p.high)) for p in ClassFrictionOffset.parameters()}  # type: ignore[arg-type]
"""Class values that are possible at all."""


@dataclass(frozen=True)
class FrictionFit:
    """An account of the reference: what it predicts, its parameters, how well it does."""

    effects: tuple[str, ...]
    size: int
    predict: Callable[[Stretches], Array]
    parameters: dict[str, Interval]
    what: str

    def z(self, stretches: Stretches) -> Array:
        """What it leaves, in standard deviations, shape (n,)."""
        spread = np.hypot(stretches.deviation, CALIBRATION_ERROR[stretches.classes])
        return (stretches.reference - self.predict(stretches)) / spread

    def log_likelihood(self, stretches: Stretches) -> float:
        """Of stretches, at what was fitted; each class may be off together by the calibration's error [nats]."""
        rest = stretches.reference - self.predict(stretches)
        total = 0.0
        for c in np.unique(stretches.classes):
            here = stretches.classes == c
            spread = float(CALIBRATION_ERROR[c])
            off = np.linspace(-4.0, 4.0, 161) * spread
            z = (rest[here] - off[:, None]) / stretches.deviation[here]
            fits = -0.5 * (TAIL + 1.0) * np.log1p(z**2 / TAIL).sum(axis=1) - 0.5 * (off / spread) ** 2
            total += float(fits.max())
        return total


def as_simulated(
    stretches: Stretches, value: Array, camera: bool, meanings: Sequence[Reading]
) -> FrictionFit:
    """The best of the accounts that mean no gap: class values (as modelled already), road, tyre."""
    fits = [_at_class_values((), value, {}, reading, reading.what) for reading in meanings]
    for column, what in enumerate(SIMULATED):
        is_found = not np.array_equal(
            stretches.simulated[:, column], stretches.simulated[:, column % OF_ROAD_FILE]
        )
        if is_found or not camera:
            fits.append(_of_column(column, what))
    return max(fits, key=lambda f: f.log_likelihood(stretches))


def _at_class_values(
    effects: tuple[str, ...], value: Array, parameters: dict[str, Interval], reading: Reading, what: str
) -> FrictionFit:
    told = reading.of(value)
    return FrictionFit(effects, len(parameters), lambda s: told[s.classes], parameters, what)


def _of_column(column: int, what: str) -> FrictionFit:
    """One of the frictions that the simulation has, taken as it is."""
    return FrictionFit((), 0, lambda s: s.simulated[:, column], {}, what)


def with_class_values(stretches: Stretches, value: Array, meanings: Sequence[Reading]) -> FrictionFit:
    """A value per class, in the plain reading, or in another that changes fewer; classes not driven on are open."""
    plain, *others = (_class_values(stretches, value, reading) for reading in meanings)
    least = min(others, key=lambda fit: _changed(fit, value))
    return least if _changed(least, value) + IN_DOUBT < _changed(plain, value) else plain


def _class_values(stretches: Stretches, value: Array, reading: Reading) -> FrictionFit:
    """A value per class under one reading.

    Intervals hold what a reference's calibration may be off, which no number of stretches averages out.
    """
    values, parameters = value.copy(), {}
    for c, name in enumerate(CLASSES):
        here = stretches.classes == c
        if not here.any():
            parameters[name] = Interval(float(value[c]), *BOUNDS[name])
            continue
        told, deviation = stretches.reference[here], stretches.deviation[here]
        within = 0.5 * (reading.theta_of(told + deviation) - reading.theta_of(told - deviation))
        values[c], half = _location(reading.theta_of(told), within)
        half = float(np.hypot(half, NORMAL_95 * CALIBRATION_ERROR[c]))
        parameters[name] = Interval(float(values[c]), float(values[c] - half), float(values[c] + half))
    fit = _at_class_values((OFFSET,), values, parameters, reading, "class values of their own")
    return replace(fit, size=len(np.unique(stretches.classes)))


def _changed(fit: FrictionFit, value: Array) -> float:
    """How much class values differ from those before, each up to what is beyond doubt [nats]."""
    off = np.array([fit.parameters[name].value for name in CLASSES]) - value
    return float(np.minimum(0.5 * (off / CALIBRATION_ERROR) ** 2, DECISIVE).sum())


def with_road_factor(stretches: Stretches) -> FrictionFit:
    """One factor on the road's friction, as the dynamics' friction_offset has it."""
    theta = stretches.simulated[:, 0]
    factor, half = _location(stretches.reference / theta, stretches.deviation / theta)

    def predict(s: Stretches) -> Array:
        return factor * s.simulated[:, 0]

    interval = {"factor": Interval(factor, factor - half, factor + half)}
    return FrictionFit(("friction_offset",), 1, predict, interval, "one factor on road.yaml's friction")


def _follows_road(stretches: Stretches, factor: FrictionFit) -> bool:
    """Whether road.yaml's friction, or the tyre's peak on it, does as well as a factor on it: then there is none."""
    plain = [_of_column(column, what) for column, what in enumerate(SIMULATED[:OF_ROAD_FILE])]
    best = max(fit.log_likelihood(stretches) for fit in plain)
    return factor.log_likelihood(stretches) - best < DECISIVE


def _location(values: Array, deviation: Array) -> tuple[float, float]:
    """Weighted mean without regard to outliers, and half the width of its 95 % interval."""
    weight = 1.0 / deviation**2
    centre = float(np.median(values))
    for _ in range(20):
        pull = weight * (TAIL + 1.0) / (TAIL + ((values - centre) / deviation) ** 2)
        centre = float(np.average(values, weights=pull))
    scatter = max(float(np.sqrt(np.average(((values - centre) / deviation) ** 2, weights=pull))), 1.0)
    quantile = float(stdtrit(max(len(values) - 1, 3), 0.975))
    return centre, quantile * scatter / float(np.sqrt(weight.sum()))


def friction_chain(
    fitted: tuple[Sequence[Log], Sequence[RoadFile]],
    held_out: tuple[Log, RoadFile],
    vehicle: VehicleFile,
    modelled: Modelled,
    exclude: Collection[str],
    found: Sequence[Effect] = (),
    camera: bool = True,
) -> Chain | None:
    """The friction reference's account; None where no log has one.

    Beside class_friction_offset it holds an account of friction_offset, which the dynamics judge too. `camera` says
    whether the logs have a camera's results.
    """
    every = (*fitted[0], held_out[0])
    measured = [log for log in every if "mu_reference" in log.signals]
    if not measured:
        return None
    answer = answer_of(every, (*fitted[1], held_out[1]), vehicle)
    known = find_stretches(*fitted, vehicle, answer, found)
    unseen = find_stretches([held_out[0]], [held_out[1]], vehicle, answer, found)
    rows = sum(int(np.isfinite(log.signals["mu_reference"]).sum()) for log in measured)
    if not len(known):
        why = "mu_reference covers no stretch of one surface on the fit logs."
        return Chain.silent(SIGNAL, rows, [OFFSET], why)
    value, meanings = np.array(modelled.class_value), readings(vehicle)
    plain = as_simulated(known, value, camera, meanings)
    fits = [with_class_values(known, value, meanings), with_road_factor(known)]
    if _follows_road(known, fits[1]):
        fits = fits[:1]
    accounts = [_account(fit, plain, known, unseen) for fit in (plain, *fits)]
    left_out = {*exclude, OFFSET} if not camera else set(exclude)
    outside = [account for account in accounts if set(account.effects) & left_out]
    accounts = [account for account in accounts if account not in outside]
    chain = Chain(
        SIGNAL,
        rows,
        float(len(known) + len(unseen)),
        accounts[0],
        tuple(accounts[1:]),
        places=_places(accounts[0], unseen),
        unexcited=_undriven(known),
        next_step=NEXT_STEP,
        no_gap=len(unseen) >= FEWEST_UNSEEN and accounts[0].left() <= 1.0,
    )
    late = odd_lateness(answer)
    if late:
        return replace(chain, unexplained=late)
    # Values per class, and a factor on all, are free curves too: where only they do, no effect of the library does.
    needed = [account for account in outside if account.score > chain.best().score + DECISIVE]
    if needed:
        told = max(needed, key=lambda account: account.score)
        sentence = f"No effect of the library explains {SIGNAL}. {told.evidence_for[0]}"
        of_class = OFFSET in told.effects
        odd = Oddity(
            SIGNAL,
            sentence,
            "surface" if of_class else "friction of road.yaml",
            "other than simulated",
            "a value per surface" if of_class else "one factor",
        )
        return replace(chain, unexplained=odd)
    return chain


def _account(fit: FrictionFit, nothing: FrictionFit, known: Stretches, unseen: Stretches) -> Account:
    return Account(
        fit.effects,
        fit.size,
        price(*[len(known) + len(unseen)] * fit.size),
        fit.log_likelihood(known) - nothing.log_likelihood(known),
        fit.log_likelihood(unseen) - nothing.log_likelihood(unseen),
        fit.parameters,
        fit.z(unseen),
        evidence_for=_evidence(fit, nothing, known),
    )


def _evidence(fit: FrictionFit, nothing: FrictionFit, known: Stretches) -> tuple[str, ...]:
    if not fit.effects:
        return ()
    means = []
    for c, name in enumerate(CLASSES):
        here = known.classes == c
        if here.any():
            means.append(
                f"{name} {np.median(known.reference[here]):.2f} (class value {USUAL[c]:g}, "
                f"road.yaml {np.median(known.simulated[here, 0]):.2f})"
            )
    return (
        f"mu_reference over {len(known)} stretches: {', '.join(means)}. The closest prediction without an effect "
        f"is {nothing.what}; {fit.what} leave{'s' if fit.size == 1 else ''} "
        f"{np.sqrt(np.mean(fit.z(known) ** 2)):.1f} standard deviations.",
    )


def _places(nothing: Account, unseen: Stretches) -> tuple[Place, ...]:
    share = nothing.z**2 / max(float((nothing.z**2).sum()), 1e-12)
    notable = np.flatnonzero(np.abs(nothing.z) > NOTABLE)
    worst = notable[np.argsort(-share[notable])][:MOST_PLACES]
    return tuple(
        Place(
            SIGNAL,
            "camera",
            f"on {CLASSES[unseen.classes[k]]}",
            float(unseen.from_s[k]),
            float(unseen.to_s[k]),
            float(share[k]),
            str(unseen.log[k]),
        )
        for k in worst
    )


def _undriven(known: Stretches) -> dict[str, str]:
    missing = [name for c, name in enumerate(CLASSES) if not (known.classes == c).any()]
    if not missing:
        return {}
    return {OFFSET: f"No friction reference on {' or '.join(missing)}: the value of that class is not known."}
