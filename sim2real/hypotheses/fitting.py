"""Fitting candidates: robust least squares on the observer's residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scenarios.effects import FORMS, Effect, Parameter
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import ROBUST_FROM, loss

Array = NDArray[np.float64]

MOST_STARTS = 8
"""Points of the coarse grid before the local fit."""
AT_BOUND = 1e-3
"""An estimate this close to a bound, in shares of the range, lies at it [-]."""
FULL_STEPS = 12
"""Most steps of a fit with full care."""


@dataclass(frozen=True)
class Candidate:
    """Effects that are fitted together, on top of a base model."""

    base: Simulation
    ids: tuple[str, ...]
    forms: tuple[int, ...] = ()
    """Which of its `FORMS` each effect has; empty: the first."""

    @cached_property
    def kinds(self) -> tuple[type[Effect], ...]:
        """The effects' classes."""
        return tuple(
            FORMS[key][i] for key, i in zip(self.ids, self.forms or (0,) * len(self.ids), strict=True)
        )

    @cached_property
    def parameters(self) -> tuple[tuple[str, Parameter], ...]:
        """Effect id and parameter, in the order of all vectors."""
        return tuple((kind.id, p) for kind in self.kinds for p in kind.parameters())

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values."""
        car = self.base.vehicle.to_core()
        pairs = [p.bounds(car) for _, p in self.parameters]
        return np.array([a for a, _ in pairs]), np.array([b for _, b in pairs])

    @cached_property
    def scale(self) -> Array:
        """What a noticeable change of each parameter is, in its unit."""
        car = self.base.vehicle.to_core()
        return np.array([_scale(p.start_values(car), p.neutral_value(car)) for _, p in self.parameters])

    @cached_property
    def neutral(self) -> Array:
        """Where the effects vanish."""
        car = self.base.vehicle.to_core()
        return np.array([p.neutral_value(car) for _, p in self.parameters])

    @cached_property
    def open_share(self) -> Array:
        """Share of each parameter that no log can tell [-]."""
        return np.array([p.open_share for _, p in self.parameters])

    @cached_property
    def starts(self) -> Array:
        """Points to start from, shape (m, k)."""
        car = self.base.vehicle.to_core()
        values = [p.start_values(car) for _, p in self.parameters]
        points = np.array(list(product(*values)), dtype=np.float64)
        if len(points) <= MOST_STARTS:
            return points
        return points[np.linspace(0, len(points) - 1, MOST_STARTS).astype(int)]

    def effects(self, x: Array) -> list[Effect]:
        """The effects at a parameter vector."""
        low, high = self.bounds
        values = iter(map(float, np.clip(x, low, high)))
        return [kind(*islice(values, len(kind.parameters()))) for kind in self.kinds]

    def model(self, x: Array) -> Simulation:
        """The base model with the effects at x."""
        return self.base.with_effects(*self.effects(x))

    def at_bound(self, x: Array) -> list[str]:
        """Parameters that lie at a bound which is not the effect's absence."""
        low, high = self.bounds
        near = AT_BOUND * (high - low)
        off = ((x - low < near) & (self.neutral > low + near)) | (
            (high - x < near) & (self.neutral < high - near)
        )
        return [p.name for (_, p), is_off in zip(self.parameters, off, strict=True) if is_off]

    def is_proper(self, x: Array) -> bool:
        """Whether every effect is itself at x, see `Effect.is_itself`."""
        car = self.base.vehicle.to_core()
        return all(effect.is_itself(car) for effect in self.effects(x))


def _scale(starts: Sequence[float], neutral: float) -> float:
    spread = [abs(value - neutral) for value in starts if value != neutral and np.isfinite(value)]
    return min(spread) if spread else max(abs(neutral), 1.0)


@dataclass(frozen=True)
class Fit:
    """A candidate at its best.

    Attributes
    ----------
    candidate : Candidate
        What was fitted.
    x : array, shape (k,)
        Parameters.
    z : array
        Whitened residuals on the evidence, see `Evidence.whitened`.
    loss : float
        Of z [-].
    jacobian : array, shape (len(z), k)
        Of z by x; empty where it was not needed.
    passes : int
        Simulations that it took.
    """

    candidate: Candidate
    x: Array
    z: Array
    loss: float
    jacobian: Array = field(repr=False)
    passes: int


def fit(candidate: Candidate, evidence: Evidence, start: Array | None = None, steps: int = FULL_STEPS) -> Fit:
    """Coarse grid, then a trust-region fit from its best point.

    Parameters
    ----------
    candidate : Candidate
        With k parameters.
    evidence : Evidence
        What to fit to.
    start : array, shape (k,) or (m, k), optional
        Where to start in place of the grid; of several, the best.
    steps : int
        Most steps of the trust-region fit.
    """
    low, high = candidate.bounds
    count = 0
    seen: dict[bytes, Array] = {}
    sloped: dict[bytes, Array] = {}

    def passed(x: Array) -> Array:
        nonlocal count
        count += 1
        return evidence.whitened(evidence.residuals(candidate.model(x)))

    def z_at(x: Array) -> Array:
        key = np.asarray(x, dtype=np.float64).tobytes()
        if key not in seen:
            seen.clear()
            seen[key] = passed(x)
        return seen[key]

    def jacobian(x: Array) -> Array:
        key = x.tobytes()
        if key not in sloped:
            sloped.clear()
            sloped[key] = slopes(passed, x, z_at(x), candidate)
        return sloped[key].copy()  # least squares may weigh them in place

    points = candidate.starts if start is None else np.atleast_2d(start)
    tried = [z_at(x) for x in points] if len(points) > 1 else []
    best = points[int(np.argmin([loss(z) for z in tried]))] if tried else points[0]

    inside = np.clip(best, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
    found = least_squares(
        z_at,
        inside,
        jac=jacobian,
        bounds=(low, high),
        x_scale=candidate.scale,
        loss="soft_l1",
        f_scale=ROBUST_FROM,
        ftol=1e-4,
        xtol=1e-5,
        gtol=1e-8,
        max_nfev=steps,
    )
    z = z_at(found.x)
    return Fit(candidate, found.x, z, loss(z), jacobian(found.x), count)


def slopes(z_at: Callable[[Array], Array], x: Array, z: Array, candidate: Candidate) -> Array:
    """Finite differences of z by x, away from the nearer bound, shape (*z.shape, k)."""
    low, high = candidate.bounds
    out = np.empty((*z.shape, len(x)))
    for i, scale in enumerate(candidate.scale):
        step = STEP * scale * (1.0 if high[i] - x[i] > x[i] - low[i] else -1.0)
        moved = x.copy()
        moved[i] += step
        out[..., i] = (z_at(moved) - z) / step
    return out


STEP = 0.02
"""Step of the finite differences in parameters' scales: well above the integrator's tolerance [-]."""
