"""What no effect explains: which equation wants a further term, on what it depends, in which shape.

Every subsystem's equation is given a free term in turn: a piecewise linear function of one quantity. Its values at the
knots are fitted to all signals at once, through the model's own response to it. The term that leaves least names
subsystem and quantity, and its curve is the shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from scenarios.files import WHEELS
from sim2real.drive import ACCEL, CHANNELS, SPEED, WHEEL, Drive
from sim2real.evidence import rest_of
from sim2real.fitting import robust, robust_weight
from sim2real.noise import Noise
from sim2real.observer import Prediction, Push, Simulation
from sim2real.probing import sets_apart, windows
from sim2real.result import Unexplained

Array = NDArray[Any]

KNOTS = 6
"""Values of a curve over a quantity of the motion."""
KNOT_S = 2.0
"""Distance of the knots of a curve over time [s]."""
PRICE_PER_KNOT = 10.0
"""Price of a fitted value, about the logarithm of the number of residuals [-]."""
RIDGE = 1e-6
"""Share of the greatest slope that a term's values are held to zero with [-]."""


@dataclass(frozen=True)
class Equation:
    """A place for a further term: the push of a unit term on a drive, and the names that a reader knows it by."""

    key: str
    subsystem: str
    signal: str
    unit: str
    step: float
    """Size of the term for finite differences, in `unit`."""
    push: Callable[[Simulation, Drive, Prediction, Array], Push]
    quantities: tuple[str, ...]
    channel: int | None = None
    """Of a single sensor's equation: its channel."""


def _none(drive: Drive) -> dict[str, Array]:
    n = len(drive)
    return {"torque_nm": np.zeros((n, 4)), "accel_m_s2": np.zeros(n), "offset": np.zeros((n, len(CHANNELS)))}


def _torque(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "torque_nm": np.repeat(term[:, None], 4, axis=1)}, felt=False)


def _motor(wheel: int, model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    none = _none(drive)
    none["torque_nm"][:, wheel] = term
    return Push(**none, felt=False)


def _creep(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    """A slip that the tyre has beside its own: the wheel turns faster or slower at the same force."""
    none = _none(drive)
    none["offset"][:, WHEEL] = (term * seen.states[:, SPEED] / model.vehicle.wheel_radius_m)[:, None]
    return Push(**none, felt=False)


def _force(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "accel_m_s2": term / model.vehicle.mass_kg}, felt=True)


def _gravity(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    return Push(**{**_none(drive), "accel_m_s2": term}, felt=False)


def _tyre(model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    extra = seen.force_n * term[:, None]
    return Push(
        **{
            **_none(drive),
            "torque_nm": -extra * model.vehicle.wheel_radius_m,
            "accel_m_s2": extra.sum(axis=1) / model.vehicle.mass_kg,
        },
        felt=True,
    )


def _sensor(columns: slice, model: Simulation, drive: Drive, seen: Prediction, term: Array) -> Push:
    none = _none(drive)
    none["offset"][:, columns] = term[:, None]
    return Push(**none, felt=False)


def _one(column: int) -> slice:
    return slice(column, column + 1)


EQUATIONS = (
    Equation("torque", "powertrain", "wheel_torque", "N m", 5.0, _torque, ("torque", "acceleration", "time")),
    Equation("bearing", "wheel", "wheel_torque", "N m", 5.0, _torque, ("speed",)),
    Equation("force", "vehicle", "accel_x", "N", 50.0, _force, ("speed", "acceleration", "time", "position")),
    Equation("gravity", "road", "vehicle_speed", "m/s^2", 0.05, _gravity, ("time", "position")),
    Equation("tyre", "tyre", "wheel_speed", "-", 0.02, _tyre, ("speed", "torque", "slip", "time", "position")),
    Equation("creep", "tyre", "wheel_speed", "-", 0.005, _creep, ("acceleration",)),
    Equation(
        "speed sensor", "vehicle_speed_sensor", "vehicle_speed", "m/s", 0.05,
        partial(_sensor, _one(SPEED)), ("speed", "acceleration", "time"), SPEED,
    ),
    Equation(
        "accelerometer", "accelerometer", "accel_x", "m/s^2", 0.05,
        partial(_sensor, _one(ACCEL)), ("speed", "acceleration", "time"), ACCEL,
    ),
    Equation(
        "wheel sensors", "wheel_speed_sensor", "wheel_speed", "rad/s", 0.1,
        partial(_sensor, WHEEL), ("speed", "acceleration", "time"),
    ),
    *(
        Equation(
            f"wheel sensor {name}", "wheel_speed_sensor", f"wheel_speed_{name}", "rad/s", 0.1,
            partial(_sensor, _one(WHEEL.start + i)), ("speed", "acceleration"), WHEEL.start + i,
        )
        for i, name in enumerate(WHEELS)
    ),
    *(
        Equation(
            f"motor {name}", "powertrain", f"wheel_torque_{name}", "N m", 5.0, partial(_motor, i), ("torque",)
        )
        for i, name in enumerate(WHEELS)
    ),
)  # fmt: skip
"""Every equation of the car with the quantities that a term in it may depend on."""
AT_ONE_WHEEL = tuple(e for e in EQUATIONS if e.key.startswith(("motor ", "wheel sensor ")))
"""Those of a single motor or wheel sensor."""
WHOLE_CAR = tuple(e for e in EQUATIONS if e not in AT_ONE_WHEEL)

QUANTITIES: dict[str, tuple[str, Callable[[Drive, Prediction], Array]]] = {
    "speed": ("m/s", lambda drive, seen: seen.states[:, SPEED]),
    "torque": ("N m", lambda drive, seen: drive.torque_nm.mean(axis=1)),
    "acceleration": ("m/s^2", lambda drive, seen: seen.force_n.sum(axis=1)),
    "slip": ("-", lambda drive, seen: np.sign(seen.force_n.sum(axis=1)) * seen.slip.mean(axis=1)),
    "time": ("s", lambda drive, seen: drive.time_s),
    "position": ("m", lambda drive, seen: seen.states[:, 0]),
}
"""Unit and values of what a term may depend on; acceleration is the tyres' force, scaled by the mass later."""
PER_DRIVE = ("time", "position")
"""Quantities whose curve is another one in each drive."""
PRICE_PER_DRIVE = 1.4
"""By how much more such a curve has to explain: it tells less than one over the car's own motion [-]."""


@dataclass(frozen=True)
class Term:
    """A fitted free term.

    Attributes
    ----------
    equation, quantity : Equation, str
        Where it stands and on what it depends.
    x, y : array, shape (m,)
        The curve: quantity and term, in `QUANTITIES`' and the equation's units.
    loss : float
        What it leaves of the loss on all drives.
    null_loss : float
        The loss without it.
    size, samples : int
        Values that were fitted, and residuals behind them.
    """

    equation: Equation
    quantity: str
    x: Array
    y: Array
    loss: float
    null_loss: float
    size: int
    samples: int


def fit_terms(
    model: Simulation,
    drives: Sequence[Drive],
    noises: Sequence[Noise],
    jobs: int = 1,
    *,
    shared: bool = False,
    equations: Sequence[Equation] = EQUATIONS,
) -> list[Term]:
    """All free terms of these equations, fitted to these drives, best quasi-likelihood first.

    `shared` leaves out `PER_DRIVE`.
    """
    seen = [model.predict(drive) for drive in drives]
    z = [_whitened(drive, noise, p.channels) for drive, noise, p in zip(drives, noises, seen, strict=True)]
    work = [
        (equation, quantity)
        for equation in equations
        for quantity in equation.quantities
        if not (shared and quantity in PER_DRIVE)
    ]
    found = Parallel(n_jobs=jobs, prefer="threads")(
        delayed(_fit_term)(model, drives, noises, seen, z, equation, quantity) for equation, quantity in work
    )
    return sorted(found, key=score)


def score(term: Term) -> float:
    """Loss and a price for each value of the curve, in units of what the loss leaves per degree of freedom."""
    priced = term.loss + PRICE_PER_KNOT * term.size * max(term.loss, 1.0) / max(term.samples, 1)
    return priced * (PRICE_PER_DRIVE if term.quantity in PER_DRIVE else 1.0)


def _whitened(drive: Drive, noise: Noise, channels: Array) -> Array:
    return np.nan_to_num(noise.whitened(rest_of(drive, channels)))


def _fit_term(
    model: Simulation,
    drives: Sequence[Drive],
    noises: Sequence[Noise],
    seen: Sequence[Prediction],
    z: Sequence[Array],
    equation: Equation,
    quantity: str,
) -> Term:
    values = [QUANTITIES[quantity][1](drive, p) for drive, p in zip(drives, seen, strict=True)]
    if quantity == "acceleration":
        values = [v / model.vehicle.mass_kg for v in values]
    knots = _knots(values, drives, quantity)
    hats = _hats(knots, values)
    slopes = [np.zeros((*part.shape, len(hats))) for part in z]
    for i, together in _runs(hats, values, quantity):
        weights = [hats[at][2](values[i]) for at in together]
        push = equation.push(model, drives[i], seen[i], equation.step * np.sum(weights, axis=0))
        moved = _whitened(drives[i], noises[i], model.predict(drives[i], push).channels)
        response = (moved - z[i]) / equation.step
        rows = windows(weights) if quantity in PER_DRIVE else [slice(None)]
        for at, cut in zip(together, rows, strict=True):
            slopes[i][cut, :, at] = response[cut]
    every = np.concatenate([part.ravel() for part in z])
    y, left = _solve(every, np.concatenate([part.reshape(-1, len(hats)) for part in slopes]))
    null = float(np.sum(robust(every)))
    x = np.array([place for _, place, _ in hats])
    return Term(equation, quantity, x, y, left, null, len(hats), int(np.count_nonzero(every)))


def _runs(
    hats: Sequence[tuple[list[int], float, Callable[[Array], Array]]], values: Sequence[Array], quantity: str
) -> list[tuple[int, list[int]]]:
    """Drives and the basis functions that one run along them probes together."""
    if quantity not in PER_DRIVE:
        return [(i, [at]) for at, (which, _, _) in enumerate(hats) for i in which]
    out = []
    for i, along in enumerate(values):
        mine = [at for at, (which, _, _) in enumerate(hats) if i in which]
        sets = sets_apart([hats[at][2](along) for at in mine], KNOT_S)
        out += [(i, [mine[at] for at in chosen]) for chosen in sets]
    return out


def _knots(values: Sequence[Array], drives: Sequence[Drive], quantity: str) -> list[Array]:
    """Knots per drive; the same for all where the curve is the same."""
    if quantity in PER_DRIVE:
        count = [max(round((d.time_s[-1] - d.time_s[0]) / KNOT_S), 2) + 1 for d in drives]
        return [np.linspace(v.min(), v.max(), n) for v, n in zip(values, count, strict=True)]
    every = np.concatenate([v[d.moving] for v, d in zip(values, drives, strict=True)])
    shared = np.unique(np.quantile(every, np.linspace(0.01, 0.99, KNOTS)))
    return [shared] * len(drives) if len(shared) > 1 else [shared + np.array([0.0, 1.0])] * len(drives)


def _hats(
    knots: Sequence[Array], values: Sequence[Array]
) -> list[tuple[list[int], float, Callable[[Array], Array]]]:
    """Basis functions: the drives that each acts in, its knot, and the function."""

    def hat(x: Array, at: int, u: Array) -> Array:
        return np.interp(u, x, np.eye(len(x))[at])

    if (knots[0] is knots[-1] and len(knots) > 1) or len(knots) == 1:
        return [
            (list(range(len(knots))), float(k), partial(hat, knots[0], i)) for i, k in enumerate(knots[0])
        ]
    return [([d], float(k), partial(hat, x, i)) for d, x in enumerate(knots) for i, k in enumerate(x)]


def _solve(z: Array, slopes: Array) -> tuple[Array, float]:
    """Values of the term by reweighted least squares, and the loss that they leave."""
    y: Array = np.zeros(slopes.shape[1])
    for _ in range(3):
        rest = z + slopes @ y
        weight = robust_weight(rest)
        normal = slopes.T @ (slopes * weight[:, None])
        normal += RIDGE * np.eye(len(y)) * max(float(np.diag(normal).max()), 1e-12)
        y = np.linalg.solve(normal, -slopes.T @ (weight * z))
    return y, float(np.sum(robust(z + slopes @ y)))


def characterise(terms: Sequence[Term], suspect: Equation | None = None) -> Unexplained:
    """The best term in the form of a result; `suspect` is a sensor without which all else agrees."""
    best = terms[0]
    share = 1.0 - best.loss / max(best.null_loss, 1e-12)
    shape, sign = shape_of(best), sign_of(best)
    unit = QUANTITIES[best.quantity][0]
    sentence = (
        f"The {best.equation.subsystem.replace('_', ' ')}'s equation ({best.equation.key}) wants a further term in "
        f"{best.equation.unit} that depends on {best.quantity} [{unit}]: it {sign} and {shape}. "
        f"Such a term takes {100.0 * share:.0f} % of the misfit."
    )
    if suspect:
        sentence = f"Without the {suspect.key.removesuffix(' sensor')}'s signal all else agrees. {sentence}"
    return Unexplained(
        best.equation.subsystem,
        best.equation.signal,
        best.quantity,
        best.equation.unit,
        sign,
        shape,
        share,
        best.x,
        best.y,
        sentence,
    )


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
