"""Fitting candidates: robust least squares on the observer's residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scenarios.effects import EFFECTS, Effect, Parameter
from sim2real.drive import Drive
from sim2real.noise import Noise
from sim2real.observer import Simulation

Array = NDArray[np.float64]

ROBUST_FROM = 5.0
"""Residuals beyond this many standard deviations count by their size, no longer by its square: at a sliding wheel a
small error of the model makes a large residual [-]."""
MOST_STARTS = 8
"""Points of the coarse grid before the local fit."""
FULL_STEPS = 12
"""Most steps of a fit with full care."""
SETTLING_S = 0.3
"""At the start of a drive the observer's state is no better than single samples: not counted [s]."""


@dataclass(frozen=True)
class Evidence:
    """Drives with the noise of their channels: what a model is held against."""

    drives: tuple[Drive, ...]
    noises: tuple[Noise, ...]

    def residuals(self, model: Simulation) -> tuple[Array, ...]:
        """Measured minus predicted per drive, shape (n, 7) each; NaN where nothing counts."""
        return tuple(residuals(model, drive) for drive in self.drives)

    def whitened(self, found: Sequence[Array]) -> Array:
        """All residuals in standard deviations behind each other, 0 where nothing counts."""
        parts = [n.whitened(r).ravel() for n, r in zip(self.noises, found, strict=True)]
        return np.nan_to_num(np.concatenate(parts))

    def longest(self) -> Evidence:
        """The longest drive alone."""
        i = int(np.argmax([len(d) for d in self.drives]))
        return Evidence((self.drives[i],), (self.noises[i],))

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Where each drive's residuals stand in `whitened`."""
        ends = np.cumsum([0, *(d.measured.size for d in self.drives)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))


def residuals(model: Simulation, drive: Drive) -> Array:
    """Measured minus predicted, shape (n, 7); NaN where a sample is lost or does not count."""
    return rest_of(drive, model.predict(drive).channels)


def rest_of(drive: Drive, channels: Array) -> Array:
    """Measured minus given channels, shape (n, 7); NaN where a sample is lost or does not count."""
    rest = drive.measured - channels
    rest[~drive.moving] = np.nan
    rest[:, ~drive.counted] = np.nan
    rest[drive.time_s < drive.time_s[0] + SETTLING_S] = np.nan
    return rest


def loss(z: Array) -> float:
    """Twice the negative log-likelihood up to a constant: quadratic for noise, linear for outliers."""
    return float(np.sum(robust(z)))


def robust(z: Array) -> Array:
    """Loss of each residual, z^2 near 0 [-]."""
    return 2.0 * ROBUST_FROM**2 * (np.sqrt(1.0 + (z / ROBUST_FROM) ** 2) - 1.0)


def robust_weight(z: Array) -> Array:
    """Weight of each residual in the robust fit [-]."""
    return 1.0 / np.sqrt(1.0 + (z / ROBUST_FROM) ** 2)


@dataclass(frozen=True)
class Candidate:
    """Effects that are fitted together, on top of a base model."""

    base: Simulation
    ids: tuple[str, ...]

    @cached_property
    def parameters(self) -> tuple[tuple[str, Parameter], ...]:
        """Effect id and parameter, in the order of all vectors."""
        return tuple((key, p) for key in self.ids for p in EFFECTS[key].parameters())

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
        values = dict.fromkeys(self.ids, ())
        out, at = [], 0
        for key in values:
            count = len(EFFECTS[key].parameters())
            part = np.clip(x[at : at + count], low[at : at + count], high[at : at + count])
            out.append(EFFECTS[key](*map(float, part)))
            at += count
        return out

    def model(self, x: Array) -> Simulation:
        """The base model with the effects at x."""
        return self.base.with_effects(*self.effects(x))


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
    start : array, shape (k,), optional
        Where to start in place of the grid.
    steps : int
        Most steps of the trust-region fit.
    """
    low, high = candidate.bounds
    count = 0
    seen: dict[bytes, Array] = {}

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
        return slopes(passed, x, z_at(x), candidate)

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
        xtol=1e-3,
        gtol=1e-8,
        max_nfev=steps,
    )
    z = z_at(found.x)
    return Fit(candidate, found.x, z, loss(z), jacobian(found.x), count)


def slopes(z_at: Callable[[Array], Array], x: Array, z: Array, candidate: Candidate) -> Array:
    """Finite differences of z by x, away from the nearer bound, shape (len(z), k)."""
    low, high = candidate.bounds
    out = np.empty((len(z), len(x)))
    for i, scale in enumerate(candidate.scale):
        step = STEP * scale * (1.0 if high[i] - x[i] > x[i] - low[i] else -1.0)
        moved = x.copy()
        moved[i] += step
        out[:, i] = (z_at(moved) - z) / step
    return out


STEP = 0.02
"""Step of the finite differences in parameters' scales: well above the integrator's tolerance [-]."""
