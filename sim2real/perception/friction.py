"""The class's friction value against a friction reference, stretch by stretch of road.

The simulation of a car with a camera predicts mu_reference as the class's value: one that follows road.yaml's own
friction instead says that the class's value is wrong for this road. Without camera results nothing is said of classes,
and road.yaml's friction, or the tyre's peak there, is what the simulation has. With or without, a reference that
follows the friction that the dynamics were found to show is no gap of the camera. A stretch of one segment is one
observation.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from scenarios.effects import Effect
from scenarios.effects.class_friction_offset import ClassFrictionOffset
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import make_setup
from sim2real.logs import Log
from sim2real.perception.chain import DECISIVE, Account, Chain, price
from sim2real.perception.frames import Modelled
from sim2real.perception.late_reference import lateness_in_words
from sim2real.result import Interval, Place
from trpac_core.tyre import peak_friction
from trpac_core.vision.classes import CLASS_THETA, Surface

Array = NDArray[np.float64]

BORDER_M = 1.5
"""Rows closer to a border are left out: either side may be under the wheels, and references average [m]."""
FEWEST_ROWS = 5
TOLERANCE = 0.02
"""Standard deviation with which a reference gives a friction that is exactly known: testers repeat that well [-]."""
TAIL = 4.0
"""Degrees of freedom of a stretch's error."""
CALIBRATION = 0.04
"""Standard deviation, as a share, of what references mean by friction: peak or theta, and on which tyre [-]."""
CLASSES = tuple(s.label for s in Surface)
SIMULATED = (
    "road.yaml's friction",
    "the tyre's peak on road.yaml's friction",
    "the friction that the dynamics show",
    "the tyre's peak on the friction that the dynamics show",
)
"""Frictions that the simulation has already."""
OF_ROAD_FILE = 2
"""The first of them are those that it has without the dynamics' findings."""
SIGNAL, OFFSET = "mu_reference", "class_friction_offset"
NEXT_STEP = (
    "Brake to the limit on each surface: the tyres show the road's friction, and whose value is wrong."
)
NOTABLE, MOST_PLACES = 3.0, 4
BOUNDS = {p.name: (float(p.low), float(p.high)) for p in ClassFrictionOffset.parameters()}  # type: ignore[arg-type]
"""Offsets that are possible at all."""


@dataclass(frozen=True)
class Stretches:
    """Pieces of road within one segment, one row each.

    Attributes
    ----------
    log : array of str, shape (n,)
        Where.
    from_s, to_s : array, shape (n,)
        When the front axle was on it [s].
    classes : array of int, shape (n,)
        Surface.
    reference, deviation : array, shape (n,)
        Mean mu_reference and its standard deviation, tolerance included [-].
    simulated : array, shape (n, 4)
        Frictions that the simulation has there, mean of left and right, in the order of `SIMULATED` [-].
    """

    log: NDArray[np.str_]
    from_s: Array
    to_s: Array
    classes: NDArray[np.intp]
    reference: Array
    deviation: Array
    simulated: Array

    def __len__(self) -> int:
        return len(self.classes)

    @property
    def class_value(self) -> Array:
        """The classes' friction values, shape (n,) [-]."""
        return np.array([CLASS_THETA[Surface(int(c))] for c in self.classes], dtype=np.float64)


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
        spread = np.hypot(stretches.deviation, calibration_error(stretches.class_value))
        return (stretches.reference - self.predict(stretches)) / spread

    def log_likelihood(self, stretches: Stretches) -> float:
        """Of stretches, at what was fitted; each class may be off together by the calibration's error [nats]."""
        rest = stretches.reference - self.predict(stretches)
        total = 0.0
        for c in np.unique(stretches.classes):
            here = stretches.classes == c
            spread = float(calibration_error(stretches.class_value[here])[0])
            off = np.linspace(-4.0, 4.0, 161) * spread
            z = (rest[here] - off[:, None]) / stretches.deviation[here]
            fits = -0.5 * (TAIL + 1.0) * np.log1p(z**2 / TAIL).sum(axis=1) - 0.5 * (off / spread) ** 2
            total += float(fits.max())
        return total


def calibration_error(value: Array) -> Array:
    """Standard deviation of what all stretches of a class are off together, same shape [-]."""
    return np.maximum(CALIBRATION * value, TOLERANCE)


def find_stretches(
    logs: Sequence[Log], roads: Sequence[RoadFile], vehicle: VehicleFile, found: Sequence[Effect] = ()
) -> Stretches:
    """Stretches of some drives that have a friction reference; `found` are effects that the dynamics show."""
    rows = [
        row
        for log, road in zip(logs, roads, strict=True)
        if "mu_reference" in log.signals
        for row in _of_one(log, road, vehicle, found)
    ]
    columns = list(zip(*rows, strict=True)) if rows else [()] * 7
    numbers = [np.array(c, dtype=np.float64) for c in columns[1:]]
    return Stretches(
        np.array(columns[0], dtype=np.str_),
        numbers[0],
        numbers[1],
        numbers[2].astype(np.intp),
        numbers[3],
        numbers[4],
        numbers[5].reshape(len(rows), len(SIMULATED)),
    )


def _of_one(log: Log, road: RoadFile, vehicle: VehicleFile, found: Sequence[Effect]) -> list[tuple]:
    core = vehicle.to_core()
    simulated = _simulated(road, vehicle, found)
    front_m = log.signals["position_m"] + core.cog_to_front_axle_m
    starts = [-np.inf, *(s.start_m for s in road.segments[1:]), np.inf]
    rows = []
    for segment, begin, end, friction in zip(road.segments, starts[:-1], starts[1:], simulated, strict=True):
        inside = (front_m > begin + BORDER_M) & (front_m < end - BORDER_M)
        inside &= np.isfinite(log.signals["mu_reference"])
        if np.count_nonzero(inside) < FEWEST_ROWS:
            continue
        values = log.signals["mu_reference"][inside]
        # A reference is filtered, or late: at first it still tells of the stretch before.
        settled, newest = values[len(values) // 2 :], values[3 * len(values) // 4 :]
        wander = float(settled.std() / np.sqrt(min(len(settled), 10)))
        moving = abs(float(np.median(newest) - np.median(settled)))
        rows.append(
            (
                log.name,
                log.time_s[inside][0],
                log.time_s[inside][-1],
                int(segment.surface_class),
                float(np.median(settled)),
                float(np.hypot(TOLERANCE, np.hypot(wander, moving))),
                friction,
            )
        )
    return rows


def _simulated(road: RoadFile, vehicle: VehicleFile, found: Sequence[Effect]) -> Array:
    """Frictions per segment, shape (segments, 4), in the order of `SIMULATED`."""
    core = vehicle.to_core()
    table = make_setup(vehicle, road).road
    with_found = table
    for effect in found:
        with_found = effect.road(with_found)

    def peak(theta: float) -> float:
        return peak_friction(theta, core.wheel_load(front=True), core.longitudinal_stiffness_n)

    columns = [
        values.mean(axis=1)
        for each in (table, with_found)
        for values in (each.theta, np.vectorize(peak, otypes=[float])(each.theta))
    ]
    return np.column_stack(columns)


def as_simulated(stretches: Stretches, offset: Array, camera: bool) -> FrictionFit:
    """The best of the accounts that mean no gap: class values (with the offsets modelled already), road, tyre."""
    fits = [FrictionFit((), 0, lambda s: s.class_value + offset[s.classes], {}, "the class's value")]
    for column, what in enumerate(SIMULATED):
        is_found = not np.array_equal(
            stretches.simulated[:, column], stretches.simulated[:, column % OF_ROAD_FILE]
        )
        if is_found or not camera:
            fits.append(_of_column(column, what))
    return max(fits, key=lambda f: f.log_likelihood(stretches))


def _of_column(column: int, what: str) -> FrictionFit:
    """One of the frictions that the simulation has, taken as it is."""
    return FrictionFit((), 0, lambda s: s.simulated[:, column], {}, what)


def with_class_offsets(stretches: Stretches) -> FrictionFit:
    """The class's value plus an offset per class; classes that were not driven on are left open.

    Intervals hold what a reference's calibration may be off, which no number of stretches averages out.
    """
    values = np.zeros(len(CLASSES))
    parameters = {}
    for c, name in enumerate(CLASSES):
        here = stretches.classes == c
        if not here.any():
            parameters[name] = Interval(0.0, *BOUNDS[name])
            continue
        off = (stretches.reference - stretches.class_value)[here]
        values[c], half = _location(off, stretches.deviation[here])
        half = float(np.hypot(half, 1.96 * calibration_error(stretches.class_value[here])[0]))
        parameters[name] = Interval(float(values[c]), float(values[c] - half), float(values[c] + half))

    def predict(s: Stretches) -> Array:
        return s.class_value + values[s.classes]

    size = len(np.unique(stretches.classes))
    return FrictionFit(("class_friction_offset",), size, predict, parameters, "class values of their own")


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
    quantile = float(student.ppf(0.975, max(len(values) - 1, 3)))
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
    known = find_stretches(*fitted, vehicle, found)
    unseen = find_stretches([held_out[0]], [held_out[1]], vehicle, found)
    measured = [log for log in (*fitted[0], held_out[0]) if "mu_reference" in log.signals]
    if not measured:
        return None
    rows = sum(int(np.isfinite(log.signals["mu_reference"]).sum()) for log in measured)
    if not len(known):
        why = "mu_reference covers no stretch of one surface on the fit logs."
        return Chain.silent(SIGNAL, rows, [OFFSET], why)
    plain = as_simulated(known, np.array(modelled.class_offset), camera)
    fits = [with_class_offsets(known), with_road_factor(known)]
    if _follows_road(known, fits[1]):
        fits = fits[:1]
    accounts = [_account(fit, plain, known, unseen) for fit in (plain, *fits)]
    outside = [account for account in accounts if set(account.effects) & set(exclude)]
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
    )
    late = lateness_in_words((*fitted[0], held_out[0]), (*fitted[1], held_out[1]), vehicle)
    if late:
        return replace(chain, unexplained=late)
    # Values per class, and a factor on all, are free curves too: where only they do, no effect of the library does.
    needed = [account for account in outside if account.score > chain.best().score + DECISIVE]
    if needed:
        told = max(needed, key=lambda account: account.score).evidence_for[0]
        return replace(chain, unexplained=f"No effect of the library explains {SIGNAL}. {told}")
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
                f"{name} {np.median(known.reference[here]):.2f} (class value {known.class_value[here][0]:g}, "
                f"road.yaml {np.median(known.simulated[here, 0]):.2f})"
            )
    return (
        f"mu_reference over {len(known)} stretches: {', '.join(means)}. Nearest without a gap is {nothing.what}; "
        f"{fit.what} leave{'s' if fit.size == 1 else ''} {np.sqrt(np.mean(fit.z(known) ** 2)):.1f} of its deviation.",
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
    return {OFFSET: f"No friction reference on {' or '.join(missing)}: the value of that class is open."}
