"""Free terms: how well a further term in each of the car's equations would explain what a model leaves.

Every subsystem's equation is given a free term in turn: a piecewise linear function of one quantity. Its values at the
knots are fitted to all signals at once, through the model's own response to it. The term that leaves least names
subsystem and quantity, and its curve is the shape.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.sparse import csc_array, sparray

from sim2real.observing.drive import Drive
from sim2real.observing.evidence import rest_of
from sim2real.observing.noise import Noise
from sim2real.observing.observer import Prediction, Simulation
from sim2real.observing.probing import sets_apart, windows
from sim2real.observing.robust import robust, robust_weight
from sim2real.where.equations import EQUATIONS, PER_DRIVE, QUANTITIES, TORQUE_GAIN, TWO_SIDED, Equation

Array = NDArray[Any]
Slopes: TypeAlias = Array | csc_array
"""Sparse for a curve over time or way, each value of which acts for a few seconds."""

KNOTS = 6
"""Values of a curve over a quantity of the motion."""
KNOT_S = 2.0
"""Distance of the knots of a curve over time [s]."""
FINE_KNOT_S = 0.25
"""The same where the curves over the motion and the coarse ones over time tell little [s]."""
PRICE_PER_KNOT = 10.0
"""Price of a fitted value, about the logarithm of the number of residuals [-]."""
PRICE_PER_DRIVE = 1.4
"""By how much more such a curve has to explain: it tells less than one over the car's own motion [-]."""
PRICE_OF_SHARE = 1.4
"""The same of a curve of the torque's share, which bends on either side of 0 as it likes [-]."""
LITTLE = 0.5
"""Below this share of the loss the best term tells little [-]."""
REFINED = 4
"""Equations whose best terms are held to what the model really does with them."""
RIDGE = 1e-6
"""Share of the greatest slope that a term's values are held to zero with [-]."""


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
    drawn_from : int
        First value to draw: of a curve that each drive has its own of, the last drive's, which is the hold-out.
    """

    equation: Equation
    quantity: str
    x: Array
    y: Array
    loss: float
    null_loss: float
    size: int
    samples: int
    drawn_from: int = 0

    @property
    def drawn(self) -> tuple[Array, Array]:
        """What of x and y is drawn."""
        return self.x[self.drawn_from :], self.y[self.drawn_from :]


def fit_terms(
    model: Simulation,
    drives: Sequence[Drive],
    noises: Sequence[Noise],
    jobs: int = 1,
    *,
    equations: Sequence[Equation] = EQUATIONS,
    quantities: Collection[str] = tuple(QUANTITIES),
    knot_s: float = KNOT_S,
) -> list[Term]:
    """All free terms of these equations over these quantities, fitted to these drives, best quasi-likelihood first."""
    seen = [model.predict(drive) for drive in drives]
    z = [_whitened(drive, noise, p.channels) for drive, noise, p in zip(drives, noises, seen, strict=True)]
    work = [
        (equation, quantity)
        for equation in equations
        for quantity in equation.quantities
        if quantity in quantities
    ]
    found = Parallel(n_jobs=jobs, prefer="threads")(
        delayed(_fit_term)(_free(model, drives, noises, seen, equation, quantity, knot_s), z)
        for equation, quantity in work
    )
    return sorted(found, key=score)


def score(term: Term) -> float:
    """Loss and a price for each value of the curve, in units of what the loss leaves per degree of freedom."""
    priced = term.loss + PRICE_PER_KNOT * term.size * max(term.loss, 1.0) / max(term.samples, 1)
    priced *= PRICE_PER_DRIVE if term.quantity in PER_DRIVE else 1.0
    return priced * (PRICE_OF_SHARE if term.equation.key == TORQUE_GAIN else 1.0)


def explained(term: Term) -> float:
    """Share of the loss that a term takes, its price paid [-]."""
    return 1.0 - score(term) / max(term.null_loss, 1e-12)


def _whitened(drive: Drive, noise: Noise, channels: Array) -> Array:
    return np.nan_to_num(noise.whitened(rest_of(drive, channels)))


def _fit_term(free: _Free, z: Sequence[Array]) -> Term:
    every = np.concatenate([part.ravel() for part in z])
    y, left = _solve(every, free.slopes(z, np.zeros(len(free.hats))))
    null = float(np.sum(robust(every)))
    x = np.array([place for _, place, _ in free.hats])
    last = sum(len(free.drives) - 1 in which for which, _, _ in free.hats)
    samples = int(np.count_nonzero(every))
    return Term(free.equation, free.quantity, x, y, left, null, len(x), samples, len(x) - last)


Hat = tuple[list[int], float, Callable[[Array], Array]]
"""A basis function: the drives that it acts in, its knot, and itself."""


@dataclass(frozen=True)
class _Free:
    """A free term on drives: what any values of its curve leave, and how that changes with each of them."""

    model: Simulation
    drives: Sequence[Drive]
    noises: Sequence[Noise]
    seen: Sequence[Prediction]
    equation: Equation
    quantity: str
    values: Sequence[Array]
    hats: Sequence[Hat]
    knot_s: float

    def moved(self, i: int, term: Array) -> Array:
        """Whitened residuals of a drive with this term in its equation."""
        push = self.equation.push(self.model, self.drives[i], self.seen[i], term)
        return _whitened(self.drives[i], self.noises[i], self.model.predict(self.drives[i], push).channels)

    def term(self, i: int, y: Array) -> Array:
        """The term along a drive."""
        out = np.zeros(len(self.values[i]))
        for at in np.flatnonzero(y).tolist():
            which, _, hat = self.hats[at]
            if i in which:
                out += y[at] * hat(self.values[i])
        return out

    def left(self, y: Array) -> list[Array]:
        """Whitened residuals per drive that a curve leaves."""
        return [self.moved(i, self.term(i, y)) for i in range(len(self.drives))]

    def slopes(self, z: Sequence[Array], y: Array) -> Slopes:
        """Finite differences of all residuals around a curve that leaves z, shape (residuals, values)."""
        columns: list[list[tuple[int, Array]]] = [[] for _ in self.hats]
        begins = np.cumsum([0, *(part.size for part in z)])
        for i, together in _runs(self.hats, self.values, self.quantity, self.knot_s):
            weights = [self.hats[at][2](self.values[i]) for at in together]
            step = self.equation.step
            response = (self.moved(i, self.term(i, y) + step * np.sum(weights, axis=0)) - z[i]) / step
            rows = windows(weights) if self.quantity in PER_DRIVE else [slice(0, len(response))]
            for at, cut in zip(together, rows, strict=True):
                begin = begins[i] + cut.start * response.shape[1]
                columns[at].append((int(begin), response[cut].ravel()))
        matrix = _columns(columns, int(begins[-1]))
        return matrix if self.quantity in PER_DRIVE else _dense(matrix)


def _columns(parts: Sequence[Sequence[tuple[int, Array]]], rows: int) -> csc_array:
    """A matrix of columns that are 0 but for stretches, each with the row that it begins at; of ascending rows."""
    none = np.empty(0)
    values = [np.concatenate([none, *(stretch for _, stretch in column)]) for column in parts]
    where = [
        np.concatenate([none, *(np.arange(begin, begin + len(stretch)) for begin, stretch in column)])
        for column in parts
    ]
    ends = np.cumsum([0, *(len(column) for column in values)])
    data, row = np.concatenate(values), np.concatenate(where).astype(np.int64)
    return csc_array((data, row, ends), shape=(rows, len(parts)))


def _free(
    model: Simulation,
    drives: Sequence[Drive],
    noises: Sequence[Noise],
    seen: Sequence[Prediction],
    equation: Equation,
    quantity: str,
    knot_s: float = KNOT_S,
) -> _Free:
    """A free term with knots where its quantity lies on these drives."""
    values = [QUANTITIES[quantity][1](drive, p) for drive, p in zip(drives, seen, strict=True)]
    if quantity == "acceleration":
        values = [v / model.vehicle.mass_kg for v in values]
    hats = _hats(_knots(values, drives, quantity, knot_s), values)
    return _Free(model, drives, noises, seen, equation, quantity, values, hats, knot_s)


def finer(
    model: Simulation, drives: Sequence[Drive], noises: Sequence[Noise], terms: Sequence[Term], jobs: int = 1
) -> list[Term]:
    """Terms that follow these drives closely, where they tell more than all others, and those tell little.

    What sways or beats within a second or two is no curve over the car's motion: waves of the road, a load that swings.
    """
    if explained(terms[0]) >= LITTLE:
        return list(terms)
    close = fit_terms(model, drives, noises, jobs, quantities=("time",), knot_s=FINE_KNOT_S)
    return close if explained(close[0]) > explained(terms[0]) else list(terms)


def best_of_each(terms: Sequence[Term]) -> list[Term]:
    """The first term of each equation; of terms best first."""
    first: dict[str, Term] = {}
    for term in terms:
        first.setdefault(term.equation.key, term)
    return list(first.values())


def with_refined(
    model: Simulation, drives: Sequence[Drive], noises: Sequence[Noise], terms: Sequence[Term], jobs: int = 1
) -> list[Term]:
    """Terms, best first, of which the best of each of the most promising equations are `refined`."""
    chosen = best_of_each(terms)[:REFINED]
    better = Parallel(n_jobs=jobs, prefer="threads")(
        delayed(refined)(model, drives, noises, term) for term in chosen
    )
    return sorted([*better, *(t for t in terms if not any(t is c for c in chosen))], key=score)


def refined(model: Simulation, drives: Sequence[Drive], noises: Sequence[Noise], term: Term) -> Term:
    """A term as it really does: its curve solved once more around itself, and the loss that the model then leaves.

    A great term, half a motor's torque, say, is more than the slopes around its absence foretell.
    """
    seen = [model.predict(drive) for drive in drives]
    free = _free(model, drives, noises, seen, term.equation, term.quantity)
    z = free.left(term.y)
    every = np.concatenate([part.ravel() for part in z])
    change, _ = _solve(every, free.slopes(z, term.y))
    again = float(sum(np.sum(robust(part)) for part in free.left(term.y + change)))
    here = float(np.sum(robust(every)))
    if again < here:
        return replace(term, y=term.y + change, loss=again)
    return replace(term, loss=here)


def _runs(
    hats: Sequence[Hat], values: Sequence[Array], quantity: str, knot_s: float
) -> list[tuple[int, list[int]]]:
    """Drives and the basis functions that one run along them probes together."""
    if quantity not in PER_DRIVE:
        return [(i, [at]) for at, (which, _, _) in enumerate(hats) for i in which]
    out = []
    for i, along in enumerate(values):
        mine = [at for at, (which, _, _) in enumerate(hats) if i in which]
        sets = sets_apart([hats[at][2](along) for at in mine], knot_s)
        out += [(i, [mine[at] for at in chosen]) for chosen in sets]
    return out


def _knots(values: Sequence[Array], drives: Sequence[Drive], quantity: str, knot_s: float) -> list[Array]:
    """Knots per drive; the same for all where the curve is the same, on either side of 0 where it is of two pieces."""
    if quantity in PER_DRIVE:
        count = [max(round((d.time_s[-1] - d.time_s[0]) / knot_s), 2) + 1 for d in drives]
        return [np.linspace(v.min(), v.max(), n) for v, n in zip(values, count, strict=True)]
    every = np.concatenate([v[d.moving] for v, d in zip(values, drives, strict=True)])
    sides = (every[every < 0.0], every[every > 0.0]) if quantity in TWO_SIDED else (every,)
    spread = np.linspace(0.01, 0.99, KNOTS)
    shared = np.unique(np.concatenate([np.quantile(side, spread) for side in sides if len(side)] or [[0.0]]))
    return [shared] * len(drives) if len(shared) > 1 else [shared + np.array([0.0, 1.0])] * len(drives)


def _hats(knots: Sequence[Array], values: Sequence[Array]) -> list[Hat]:
    """Basis functions of a curve over these knots."""

    def hat(x: Array, at: int, u: Array) -> Array:
        return np.interp(u, x, np.eye(len(x))[at])

    if (knots[0] is knots[-1] and len(knots) > 1) or len(knots) == 1:
        return [
            (list(range(len(knots))), float(k), partial(hat, knots[0], i)) for i, k in enumerate(knots[0])
        ]
    return [([d], float(k), partial(hat, x, i)) for d, x in enumerate(knots) for i, k in enumerate(x)]


def _dense(matrix: Array | sparray) -> Array:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _solve(z: Array, slopes: Slopes) -> tuple[Array, float]:
    """Values of the term by reweighted least squares, and the loss that they leave."""
    y: Array = np.zeros(slopes.shape[1])
    for _ in range(3):
        rest = z + slopes @ y
        weight = robust_weight(rest)
        normal = _dense(slopes.T @ (slopes * weight[:, None]))
        normal += RIDGE * np.eye(len(y)) * max(float(np.diag(normal).max()), 1e-12)
        y = np.linalg.solve(normal, -(slopes.T @ (weight * z)))
    return y, float(np.sum(robust(z + slopes @ y)))
