"""An effect whose value is not the same everywhere: what it leaves as a constant has its own signature.

Nature has no constants: a grade is uneven, friction comes in patches, a scale sways. Where an effect takes most of a
gap and leaves more than noise, its parameters may vary, smoothly over time or over place, each by a share of its own
size. If that takes the rest to the noise, and no term over the car's own motion does as well, the rest is the same
effect; the constant then is its mean.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import EFFECTS
from sim2real.observing.drive import Drive
from sim2real.observing.evidence import Evidence, all_logs, rest_of
from sim2real.observing.noise import Noise
from sim2real.observing.observer import Simulation, Towards
from sim2real.observing.probing import sets_apart, windows
from sim2real.observing.robust import loss, robust_weight
from sim2real.where.equations import OF_THE_MOTION
from sim2real.where.terms import Term, fit_terms, with_refined
from sim2real.which.contest import Contest, Entry, Progress, Varied, run_all, silent
from sim2real.which.goodness import fitness, loss_beyond_noise
from sim2real.which.selection import explains, two_are_needed

Array = NDArray[np.float64]

KNOT_S = 1.0
"""Distance of the knots of a value over time, and over place where that much time is spent [s]."""
SPREAD = 0.5
"""Share of its size that a value is expected to vary by, as a standard deviation [-]."""
STEP = 0.1
"""Step of the slopes, in noticeable changes of a parameter [-]."""
ROUNDS = 3
"""Gauss-Newton steps with the slopes at the constant."""
TRIED = 2
"""Best single effects that may vary."""
MOSTLY = 0.7
"""As a constant an effect has to take at least this share of what the loss has more than noise: a deviation about zero
is another thing [-]."""
OVER = ("time", "position")
"""What a value may vary over: that is no property of the car's motion, which would be another effect."""


def add_varied(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with its best effects free to vary, and what terms over the motion leave beside or without them.

    Single effects first, then the best beside another tyre's curve, then the best pair, or that before all where it
    leaves half of what one leaves: the first that explain the gap. As it is where none does.
    """
    null = contest.null
    excess = loss_beyond_noise(null)
    before = fitness(null, fit_to, holdout)
    drives, noises = all_logs(fit_to, holdout)
    pairs = contest.pairs[:1]
    groups = [contest.singles[:TRIED], contest.structured[:1]]
    groups.insert(0 if any(two_are_needed(contest, pair) for pair in pairs) else 2, pairs)
    for group in groups:
        tried = [e for e in group if null.loss - e.loss >= MOSTLY * excess]
        work = [partial(vary, e, fit_to, holdout, over) for e in tried for over in OVER]
        found = run_all(work, jobs, progress, "varying effects")
        if any(explains(fitness(v.entry, fit_to, holdout), before) for v in found):
            constant = [e.fitted.candidate.model(e.fitted.x) for e in tried]
            motion = min(_over_motion(each, drives, noises, jobs)[0].loss for each in constant)
            alone = with_refined(model, drives, noises, _over_motion(model, drives, noises, jobs), jobs)
            varied = tuple(sorted(found, key=lambda v: v.cost))
            return replace(contest, varied=varied, motion=motion, instead=min(t.loss for t in alone))
    return contest


def _over_motion(
    model: Simulation, drives: Sequence[Drive], noises: Sequence[Noise], jobs: int
) -> list[Term]:
    return fit_terms(model, drives, noises, jobs, quantities=OF_THE_MOTION)


@dataclass(frozen=True)
class Bump:
    """One knot of a parameter's curve: which parameter, and its weight along each drive, None where it has none."""

    parameter: int
    weights: tuple[Array | None, ...]


def vary(entry: Entry, fit_to: Evidence, holdout: Evidence, over: str) -> Varied:
    """The entry with all parameters of its effects free to vary; those of a structural one stay.

    Parameters
    ----------
    entry : Entry
        Fitted as a constant.
    fit_to, holdout : Evidence
        What it is held against; all drives have a curve, over place a common one on the same road.
    over : str
        One of `OVER`.
    """
    found = entry.fitted
    candidate, x = found.candidate, found.x
    low, high = candidate.bounds
    step = STEP * candidate.scale * np.where(high - x > x - low, 1.0, -1.0)
    base = candidate.model(x)
    count = len(x)
    within = np.sort([(low - x) / step, (high - x) / step], axis=0)
    ends = tuple(candidate.model(x + step * (np.arange(count) == j)) for j in range(count))
    every = [(e, i) for e in (fit_to, holdout) for i in range(len(e.drives))]
    drives = [e.drives[i] for e, i in every]

    def left(of: int, shares: Array) -> Array:
        evidence, i = every[of]
        drive = drives[of]
        channels = base.predict(drive, towards=Towards(ends, shares)).channels
        return np.nan_to_num(evidence.noises[i].whitened(rest_of(drive, channels))).ravel()

    free = [j for j, (key, _) in enumerate(candidate.parameters) if not EFFECTS[key].structural]
    bumps = _bumps(free, drives, over)
    shares = [np.zeros((len(d), count)) for d in drives]
    z = [left(i, shares[i]) for i in range(len(drives))]
    slopes = [_slopes(partial(left, i), z[i], shares[i], bumps, i) for i in range(len(drives))]
    size = np.maximum(np.abs(x - candidate.neutral), 1e-9)
    sigma = SPREAD * size / np.abs(step)
    prior = np.array([1.0 / sigma[bump.parameter] ** 2 for bump in bumps])
    a = np.zeros(len(bumps))
    best = sum(loss(part) for part in z)
    for _ in range(ROUNDS):
        new = _solved(z, slopes, prior, a)
        # Beyond its bounds a parameter is no car's any more: a negative inertia the plant would follow in tiny steps.
        tried = [np.clip(_along(bumps, new, i, len(d), count), *within) for i, d in enumerate(drives)]
        z_new = [left(i, tried[i]) for i in range(len(drives))]
        cost = sum(loss(part) for part in z_new) + float(prior @ new**2)
        if cost >= best:
            break
        best, a, shares, z = cost, new, tried, z_new
    cut = len(fit_to.drives)
    spreads = np.std(np.concatenate(shares), axis=0) * np.abs(step)
    spread = {
        (key, p.name): float(spreads[j]) for j, (key, p) in enumerate(candidate.parameters) if j in free
    }
    varied = Entry(entry.ids, found, np.concatenate(z[:cut]), np.concatenate(z[cut:]))
    seconds = sum(float(d.time_s[-1] - d.time_s[0]) for d in drives)
    return Varied(varied, over, spread, float(prior @ a**2), seconds)


@dataclass(frozen=True)
class Slopes:
    """What one drive's residuals do with the bumps that it has."""

    columns: NDArray[np.int64]
    values: Array


def _slopes(
    left: Callable[[Array], Array], z: Array, at_rest: Array, bumps: Sequence[Bump], drive: int
) -> Slopes:
    """Finite differences of a drive's residuals by its bumps; those that lie far apart share a run."""
    mine = [(b, bump.parameter, w) for b, bump in enumerate(bumps) if (w := bump.weights[drive]) is not None]
    values = np.zeros((len(at_rest), len(z) // len(at_rest), len(mine)))
    for parameter in sorted({j for _, j, _ in mine}):
        own = [at for at, (_, j, _) in enumerate(mine) if j == parameter]
        for chosen in sets_apart([mine[at][2] for at in own], KNOT_S):
            columns = [own[k] for k in chosen]
            weights = [mine[at][2] for at in columns]
            moved = at_rest.copy()
            moved[:, parameter] += np.sum(weights, axis=0)
            response = (left(moved) - z).reshape(len(at_rest), -1)
            for at, rows in zip(columns, windows(weights), strict=True):
                values[rows, :, at] = response[rows]
    return Slopes(np.array([b for b, _, _ in mine], dtype=np.int64), values.reshape(len(z), -1))


def _along(bumps: Sequence[Bump], a: Array, drive: int, rows: int, parameters: int) -> Array:
    shares = np.zeros((rows, parameters))
    for bump, value in zip(bumps, a, strict=True):
        weight = bump.weights[drive]
        if weight is not None:
            shares[:, bump.parameter] += value * weight
    return shares


def _solved(z: Sequence[Array], slopes: Sequence[Slopes], prior: Array, a: Array) -> Array:
    """The next values: reweighted least squares on the residuals at `a`, with the prior."""
    normal, right = np.diag(prior), -prior * a
    for part, slope in zip(z, slopes, strict=True):
        weighted = slope.values * robust_weight(part)[:, None]
        normal[np.ix_(slope.columns, slope.columns)] += slope.values.T @ weighted
        right[slope.columns] -= weighted.T @ part
    return np.asarray(a + np.linalg.solve(normal, right))


def _bumps(free: Sequence[int], drives: Sequence[Drive], over: str) -> list[Bump]:
    """All knots of the curves of the parameters that are free."""
    curves = [
        d.time_s if over == "time" else np.maximum.accumulate(np.nan_to_num(d.measured[:, 0])) for d in drives
    ]
    roads = [d.road if over == "position" else None for d in drives]
    groups: list[list[int]] = []
    for i in range(len(drives)):
        same = next((g for g in groups if roads[i] is not None and roads[g[0]] == roads[i]), None)
        if same is None:
            groups.append([i])
        else:
            same.append(i)
    out = []
    for group in groups:
        low = min(float(curves[i][0]) for i in group)
        high = max(float(curves[i][-1]) for i in group)
        longest = max(float(drives[i].time_s[-1] - drives[i].time_s[0]) for i in group)
        knots = np.linspace(low, max(high, low + 1e-3), max(round(longest / KNOT_S), 2) + 1)
        for at in range(len(knots)):
            hat = np.eye(len(knots))[at]
            weights = tuple(
                np.interp(curves[i], knots, hat) if i in group else None for i in range(len(drives))
            )
            out += [Bump(j, weights) for j in free]
    return out
