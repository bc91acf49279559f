"""Effects fitted while the car's build is free: what an effect takes that another build could not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sim2real.discrepancy.columns import OVER_TIME, of_build, of_other_faults, of_tyres
from sim2real.discrepancy.prior import prior_root
from sim2real.discrepancy.ridge import Scale, scale_beside, solve, weighed
from sim2real.hypotheses.contest import Entry, Progress, run_all
from sim2real.hypotheses.fitting import Candidate
from sim2real.hypotheses.fitting import slopes as slopes_of
from sim2real.observing.drive import Drive
from sim2real.observing.evidence import Evidence, all_logs, rest_of
from sim2real.observing.noise import Noise
from sim2real.observing.observer import Push, Simulation

Array = NDArray[np.float64]

BLOCK_S = 0.04
"""Residuals are averaged over blocks of this length before they are solved [s]."""
FREE = 1e-6
"""Precision of an effect's own coefficients while it is fitted: next to none [-]."""
STEPS, HALVINGS = 4, (1.0, 0.3, 0.09, 0.027)
"""Gauss-Newton steps of a fit, and the shares of a step that are tried."""
MOST_STARTS = 3
"""Points of the effect's coarse grid that a fit may begin at, beside the one of the first fit."""
ENOUGH = 0.5
"""A step that takes less off the cost is the last one [-]."""
TEMPER = 30.0
"""Evidence counts by this much less than independent noise would say: what a family of columns leaves of another
build is neither white nor small [-]."""
OF_TYRE = {"friction_offset": "friction", "friction_falloff": "fall"}
"""Effects that another tyre has, too, and the change of the build that they are."""
LEAST_CHANGE = 0.01
"""A friction that is off by less is as good as none [-]."""
PAIRS = 4
"""Pairs of effects that are fitted, the most promising ones by their slopes."""


@dataclass(frozen=True)
class Stack:
    """Blocks of all logs behind each other, n of them, with what the car's build may make of them.

    Attributes
    ----------
    model : Simulation
        The car as simulated.
    logs : tuple of (Drive, Noise)
        Fit logs and hold-out, then those of the car without the fault.
    z : array, shape (n, 7)
        Whitened residuals of the model, 0 where nothing counts.
    changes : array, shape (n, 7, k)
        What another build's changes leave, each per unit.
    names : tuple of str
        Of the changes.
    limit : array of bool, shape (n,)
        Blocks in which a tyre is near its limit.
    faultless : int
        How many of the logs, the last ones, are of the car without the fault.
    """

    model: Simulation
    logs: tuple[tuple[Drive, Noise], ...]
    z: Array
    changes: Array
    names: tuple[str, ...]
    limit: NDArray[np.bool_]
    faultless: int = 0

    @property
    def lengths(self) -> list[int]:
        """Blocks of each log."""
        return [len(drive) // drive.rows_in(BLOCK_S) for drive, _ in self.logs]

    @cached_property
    def mix(self) -> Array:
        """Root of the changes' prior covariance: mix @ independent unit normals is a draw of them, shape (k, k)."""
        return prior_root(self.names)

    @cached_property
    def build(self) -> Array:
        """Columns of another build, independent and of one prior standard deviation each, shape (n, 7, k)."""
        return np.asarray(self.changes @ self.mix)

    @property
    def one(self) -> Array:
        """Precisions of the build's coefficients, shape (k,)."""
        return np.ones(len(self.names))

    def of_fit_logs(self, count: int) -> Stack:
        """The first logs, `count` of them, and those of the car without the fault."""
        kept = [i < count or i >= len(self.logs) - self.faultless for i in range(len(self.logs))]
        rows = np.repeat(kept, self.lengths)
        logs = tuple(log for log, keep in zip(self.logs, kept, strict=True) if keep)
        return replace(self, logs=logs, z=self.z[rows], changes=self.changes[rows], limit=self.limit[rows])

    def blocks(self, model: Simulation) -> Array:
        """What a model leaves, shape (n, 7); of the logs without the fault what the car as simulated leaves."""
        with_fault = self.logs[: len(self.logs) - self.faultless]
        found = [block_means(noise.whitened(_rest(model, drive)), drive) for drive, noise in with_fault]
        rows = sum(len(part) for part in found)
        return np.concatenate([*found, self.z[rows:]])

    def pushed(self, columns: Sequence[tuple[int, Push]]) -> Array:
        """Columns of pushes, each on the log of that number, shape (n, 7, number of pushes)."""
        ends = np.cumsum([0, *self.lengths])
        out = np.zeros((*self.z.shape, len(columns)))
        for j, (log, push) in enumerate(columns):
            rows = slice(ends[log], ends[log + 1])
            drive, noise = self.logs[log]
            out[rows, :, j] = (
                block_means(noise.whitened(_rest(self.model, drive, push)), drive) - self.z[rows]
            )
        return out


@dataclass(frozen=True)
class Hypothesis:
    """One or two effects fitted beside the build.

    Attributes
    ----------
    candidate : Candidate
        The effects.
    x : array, shape (k,)
        Their parameters.
    z : array, shape (n, 7)
        What the model with them leaves.
    slopes : array, shape (n, 7, k)
        Of z, per noticeable change of each parameter.
    """

    candidate: Candidate
    x: Array
    z: Array
    slopes: Array

    @property
    def ids(self) -> tuple[str, ...]:
        """The effects."""
        return self.candidate.ids

    @property
    def size(self) -> Array:
        """How far each parameter is from the effect's absence, in noticeable changes."""
        return np.asarray((self.x - self.candidate.neutral) / self.candidate.scale)


def _rest(model: Simulation, drive: Drive, push: Push | None = None) -> Array:
    return rest_of(drive, model.predict(drive, push).channels)


def block_means(z: Array, drive: Drive) -> Array:
    """Means over blocks of whitened residuals, shape (n, 7), in units of what independent noise gives."""
    rows = drive.rows_in(BLOCK_S)
    count = len(z) // rows
    return np.asarray(np.nan_to_num(z)[: count * rows].reshape(count, rows, -1).sum(axis=1) / np.sqrt(rows))


def stack_of(
    model: Simulation, fit_to: Evidence, holdout: Evidence, faultless: Evidence | None = None
) -> Stack:
    """Blocks of all logs, with the columns of another build of the car."""
    parts = [fit_to, holdout, *([faultless] if faultless else [])]
    logs = tuple(zip(*all_logs(*parts), strict=True))
    found = [of_build(model, drive) for drive, _ in logs]
    z = np.concatenate([block_means(noise.whitened(_rest(model, drive)), drive) for drive, noise in logs])
    limit = np.concatenate([_any_of(near, drive) for (_, near), (drive, _) in zip(found, logs, strict=True)])
    tyres = of_tyres(model)
    names = (*dict.fromkeys(name for columns, _ in found for name, _ in columns), *tyres)
    bare = Stack(model, logs, z, np.zeros((*z.shape, 0)), names, limit)
    every = [(log, name, push) for log, (columns, _) in enumerate(found) for name, push in columns]
    made = bare.pushed([(log, push) for log, _, push in every])
    build = np.zeros((*z.shape, len(names)))
    for j, (_, name, _) in enumerate(every):
        build[..., names.index(name)] += made[..., j]
    for name, (size, other) in tyres.items():
        build[..., names.index(name)] = (bare.blocks(other) - z) / size
    return replace(bare, changes=build, faultless=len(faultless.drives) if faultless else 0)


def with_tyre(stack: Stack, singles: Sequence[Hypothesis]) -> Stack:
    """The stack with what another friction does as far off as the logs want it: near the limit that is no line."""
    changes = stack.changes.copy()
    for h in singles:
        name, off = OF_TYRE.get(h.ids[0], ""), h.x[-1] - 1.0
        if name in stack.names and abs(off) > LEAST_CHANGE:
            changes[..., stack.names.index(name)] = (h.z - stack.z) / (off if name == "friction" else -off)
    return replace(stack, changes=changes)


def _any_of(rows: NDArray[np.bool_], drive: Drive) -> NDArray[np.bool_]:
    """Blocks that hold any of these rows."""
    length = drive.rows_in(BLOCK_S)
    count = len(rows) // length
    return np.asarray(rows[: count * length].reshape(count, length).any(axis=1))


def other_faults(stack: Stack) -> dict[str, Array]:
    """Columns of faults that the library lacks, shape (n, 7, k) each; a force over time has one per knot."""
    every = []
    for log in range(len(stack.logs) - stack.faultless):
        every += [(log, name, push) for name, push in of_other_faults(stack.model, stack.logs[log][0])]
    made = stack.pushed([(log, push) for log, _, push in every])
    found: dict[str, list[Array]] = {}
    for j, (_, name, _) in enumerate(every):
        found.setdefault(name, []).append(made[..., j])
    return {
        kind: np.stack(parts, axis=-1) if kind == OVER_TIME else np.sum(parts, axis=0)[..., None]
        for kind, parts in found.items()
    }


def scale_of_build(stack: Stack) -> Scale:
    """Size and memory of what another build alone leaves."""
    return scale_beside(stack.z, stack.build, stack.limit)[0]


def hypotheses(
    stack: Stack, entries: Sequence[Entry], scale: Scale, jobs: int, progress: Progress
) -> list[Hypothesis]:
    """Every effect in its best form, fitted beside the build."""
    work = [partial(_of_entry, stack, entry, scale) for entry in entries]
    return run_all(work, jobs, progress, "effects beside another build")


def _of_entry(stack: Stack, entry: Entry, scale: Scale) -> Hypothesis:
    candidate, x = entry.fitted.candidate, entry.fitted.x
    nearer = candidate.neutral + (x - candidate.neutral) / 3.0
    return fit_beside(stack, candidate, [x, nearer, *candidate.starts[:MOST_STARTS]], scale)


def fit_beside(stack: Stack, candidate: Candidate, starts: Sequence[Array], scale: Scale) -> Hypothesis:
    """Effects fitted with the build free: Gauss-Newton steps from the best of some starts."""
    low, high = candidate.bounds
    margin = 1e-6 * (high - low)
    temper, one = scale.memory * TEMPER, stack.one

    def z_at(x: Array) -> Array:
        return stack.blocks(candidate.model(x))

    def cost_of(z: Array) -> float:
        return solve(z, stack.build, scale.size, temper, one)[0]

    def tried(x: Array) -> tuple[float, Array, Array]:
        inside = np.clip(x, low + margin, high - margin)
        z = z_at(inside)
        return cost_of(z), inside, z

    cost, x, z = min((tried(start) for start in starts), key=lambda found: found[0])
    slopes = slopes_of(z_at, x, z, candidate) * candidate.scale
    for _ in range(STEPS):
        both = np.concatenate([stack.build, slopes], axis=-1)
        foretold, b = solve(z, both, scale.size, temper, np.r_[one, np.full(len(x), FREE)])
        if cost - foretold < ENOUGH:
            break
        steps = (tried(x + share * b[-len(x) :] * candidate.scale) for share in HALVINGS)
        better = next((found for found in steps if found[0] < cost - 1e-3), None)
        if better is None:
            break
        gain = cost - better[0]
        cost, x, z = better
        slopes = slopes_of(z_at, x, z, candidate) * candidate.scale
        if gain < ENOUGH:
            break
    return Hypothesis(candidate, x, z, slopes)


def fit_pairs(
    stack: Stack, singles: Sequence[Hypothesis], scale: Scale, jobs: int, progress: Progress
) -> list[Hypothesis]:
    """The most promising pairs by a linear forecast, fitted beside the build."""
    best = sorted(_forecasts(stack, singles, scale), key=lambda found: found[0])[:PAIRS]
    work = [partial(_pair, stack, singles[i], singles[j], scale) for _, i, j in best]
    return run_all(work, jobs, progress, "pairs beside another build")


def _forecasts(stack: Stack, singles: Sequence[Hypothesis], scale: Scale) -> list[tuple[float, int, int]]:
    """Cost that each two effects promise to leave, by their slopes and what they do alone, and their numbers."""
    one = stack.one
    temper = scale.memory * TEMPER
    _, b = solve(stack.z, stack.build, scale.size, temper, one)
    columns = [stack.build, *(h.slopes for h in singles), *((h.z - stack.z)[..., None] for h in singles)]
    every = np.concatenate([*columns, stack.z[..., None]], axis=-1)
    rows = weighed(every, stack.z + stack.build @ b, scale.size, temper)
    gram = rows.T @ rows
    ends = np.cumsum([len(one), *(len(h.x) for h in singles)])
    out = []
    for i, j in combinations(range(len(singles)), 2):
        free = np.r_[: len(one), ends[i] : ends[i + 1], ends[j] : ends[j + 1]]
        fixed = np.zeros(len(gram))
        fixed[[ends[-1] + i, ends[-1] + j, -1]] = 1.0
        slope = gram[free] @ fixed
        inner = gram[np.ix_(free, free)] + np.diag(np.r_[one, np.full(len(free) - len(one), FREE)])
        out.append((float(fixed @ gram @ fixed - slope @ np.linalg.solve(inner, slope)), i, j))
    return out


def _pair(stack: Stack, a: Hypothesis, b: Hypothesis, scale: Scale) -> Hypothesis:
    forms = tuple((h.candidate.forms or (0,))[0] for h in (a, b))
    both = Candidate(stack.model, (*a.ids, *b.ids), forms)
    return fit_beside(stack, both, [np.concatenate([a.x, b.x])], scale)
