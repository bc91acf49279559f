"""One decision over all hypotheses: no effect, each effect, pairs, faults that no effect has the form of.

measured = simulated + effect(x) + build(b) + noise. A hypothesis costs

    min over x, b of  sum huber((z + D b + J dx) / s) / T + |b|^2 + |x|^2 / SIZE^2 + PRICE (number of x)

with x in noticeable changes and b in prior standard deviations, s and T the size and tempered memory of what the best
account leaves. By how much an effect's cost is less than that of no effect is twice a logarithm of posterior odds.

References
----------
.. [1] Bissiri, Holmes, Walker (2016), A general framework for updating belief distributions, J. R. Statist. Soc. B 78.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim2real.discrepancy.beside import TEMPER, Hypothesis, Stack
from sim2real.discrepancy.ridge import Scale, read_scale, solve
from sim2real.result import Verdict

Array = NDArray[np.float64]

SIZE = 5.0
"""Prior standard deviation of an effect's parameters [noticeable changes]."""
LEAST_SIZE = 0.25
"""An effect that is smaller is none [noticeable changes]."""
PRICE = 2.0
"""Price of a parameter, as Akaike's [-]."""
LEAST_DROP = 30.0
"""Least drop of the cost with which an effect is named: on cars without a fault, and with faults outside the library,
wrong ones reach 27; true effects that are excited have 37 and more, most above 100 [-]."""
LIKE, LIKE_SHARE = 8.0, 0.08
"""Effects whose drops differ by less than this, or by this share of the best one, are not told apart [-]."""
OUTSIDE = 6.0
"""A fault that no effect has the form of explains more where its drop is so much greater [-]."""
SECOND, SECOND_SHARE = 20.0, 0.10
"""What a second effect adds to the drop at least, and as a share of both [-]."""
ALONE = 0.4
"""Share of both effects' drop that the better one takes alone, or they only bend to what neither is [-]."""
MOTION_LEFT = 4.0
"""What may be left of position and vehicle speed away from the tyres' limit [standard deviations]: another build hardly
moves the body otherwise; faults of other forms leave 5 and more, true ones up to 3."""
OF_TYRE = ("friction_offset", "mu_split", "friction_falloff", "tyre_stiffness_offset")
"""What a foreign tyre looks like beside a fault: never the second of two."""
LOOSE = 1e-4
"""Precision of coefficients without a prior [-]."""


@dataclass(frozen=True)
class Judged:
    """The verdict over all hypotheses.

    Attributes
    ----------
    verdict : Verdict
        `unknown`, `partial`, `ambiguous` or `compound`.
    named : tuple of Hypothesis
        What it names, with the refined parameters; the effects that cannot be told apart where ambiguous.
    drops : dict
        Of every effect, best first [-].
    probability : dict
        Of every effect; the rest is "no effect" [-].
    outside : dict
        Drops of faults that no effect has the form of, where they were asked [-].
    structure : dict
        How the build differs beside what is named, each change in its unit, the least expected ones first.
    """

    verdict: Verdict
    named: tuple[Hypothesis, ...]
    drops: Mapping[str, float]
    probability: Mapping[str, float]
    outside: Mapping[str, float]
    structure: Mapping[str, float]


@dataclass(frozen=True)
class _Account:
    """A hypothesis at its best: cost, parameters, the build's coefficients, what is left."""

    cost: float
    x: Array
    build: Array
    rest: Array


def _null(stack: Stack, scale: Scale) -> _Account:
    """No effect."""
    cost, b = solve(stack.z, stack.build, scale.size, scale.memory * TEMPER, stack.one)
    return _Account(cost, np.zeros(0), b, stack.z + stack.build @ b)


def _account(stack: Stack, h: Hypothesis, scale: Scale) -> _Account:
    """An effect as fitted, or one linear step further, whichever costs less."""
    temper, count = scale.memory * TEMPER, len(h.x)
    both = np.concatenate([stack.build, h.slopes], axis=-1)
    far, b = solve(h.z, both, scale.size, temper, np.r_[stack.one, np.full(count, LOOSE)])
    near, b_near = solve(h.z, stack.build, scale.size, temper, stack.one)
    step = b[-count:]
    far += PRICE * count + float((((h.size + step) / SIZE) ** 2).sum())
    near += PRICE * count + float(((h.size / SIZE) ** 2).sum())
    if near <= far:
        return _Account(near, h.x, b_near, h.z + stack.build @ b_near)
    return _Account(far, h.x + step * h.candidate.scale, b[:-count], h.z + both @ b)


def _outside(stack: Stack, columns: Array, scale: Scale) -> float:
    """Cost of a fault with columns of its own; a flexible one pays Occam's factor."""
    count, temper = columns.shape[-1], scale.memory * TEMPER
    both = np.concatenate([stack.build, columns], axis=-1)
    precision = np.r_[stack.one, np.full(count, 1.0 if count > 1 else LOOSE)]
    cost, _ = solve(stack.z, both, scale.size, temper, precision)
    if count == 1:
        return cost + PRICE
    rows = (both / scale.size[..., None]).reshape(-1, both.shape[-1])
    information = rows.T @ rows / temper + np.diag(precision)
    known = len(stack.one)
    return cost + float(np.linalg.slogdet(information)[1] - np.linalg.slogdet(information[:known, :known])[1])


def _moves_so(stack: Stack, account: _Account) -> bool:
    """Whether an account leaves little of how the body moves."""
    size = read_scale(account.rest, stack.z != 0.0, stack.limit).size[~stack.limit, :2]
    return not len(size) or float(size.max()) <= MOTION_LEFT


def judge(
    stack: Stack,
    scale: Scale,
    singles: Sequence[Hypothesis],
    fit_pairs: Callable[[], Sequence[Hypothesis]],
    other_faults: Callable[[], Mapping[str, Array]],
) -> Judged:
    """The verdict over single effects, pairs, and faults that no effect has the form of.

    Pairs and other faults are asked for only where a single effect would be named.
    """
    live = stack.z != 0.0
    first = {h.ids[0]: _account(stack, h, scale) for h in singles}
    # a fault beyond the build's reach is no noise: the remainder is read from whatever leaves least
    read = {key: read_scale(account.rest, live, stack.limit) for key, account in first.items()}
    ahead = min(first, key=lambda key: first[key].cost)
    size = np.minimum(scale.size, np.min([r.size for r in read.values()], axis=0))
    scale = Scale(size, max(scale.memory, read[ahead].memory))
    null = _null(stack, scale)
    best = {h.ids[0]: _account(stack, h, scale) for h in singles}
    of = {h.ids[0]: h for h in singles}
    drops = {key: null.cost - account.cost for key, account in best.items()}
    for key, account in best.items():
        h = of[key]
        if np.abs((account.x - h.candidate.neutral) / h.candidate.scale).max() < LEAST_SIZE:
            drops[key] = min(drops[key], 0.0)
    ranked = sorted(drops, key=lambda key: -drops[key])
    drops = {key: drops[key] for key in ranked}
    top = drops[ranked[0]]
    weight = np.exp(0.5 * (np.array([0.0, *drops.values()]) - max(0.0, *drops.values())))
    probability = dict(zip(ranked, (float(w) for w in (weight / weight.sum())[1:]), strict=True))

    def said(verdict: Verdict, keys: Sequence[str], outside: Mapping[str, float], build: Array) -> Judged:
        named = tuple(replace(of[key], x=best[key].x) for key in keys)
        values, widths = stack.mix @ build, np.sqrt((stack.mix**2).sum(axis=1))
        order = np.argsort(-np.abs(values / widths))
        told = {stack.names[i]: float(values[i]) for i in order}
        return Judged(verdict, named, drops, probability, outside, told)

    if top <= LEAST_DROP:
        return said(Verdict.UNKNOWN, (), {}, null.build)
    two = sorted(
        ((null.cost - _account(stack, h, scale).cost, h) for h in fit_pairs()), key=lambda found: -found[0]
    )
    outside = {key: null.cost - _outside(stack, columns, scale) for key, columns in other_faults().items()}
    if max(outside.values(), default=0.0) > max(top + OUTSIDE, two[0][0] if two else 0.0):
        return said(Verdict.UNKNOWN, (), outside, null.build)
    for drop, h in two:
        lesser = min(h.ids, key=lambda key: drops[key])
        if lesser in OF_TYRE:
            continue
        account = _account(stack, h, scale)
        if drop - top > max(SECOND, SECOND_SHARE * drop) and _moves_so(stack, account):
            if max(drops[key] for key in h.ids) < ALONE * drop:
                return said(Verdict.UNKNOWN, (), outside, null.build)
            told = said(Verdict.COMPOUND, (), outside, account.build)
            return replace(told, named=(replace(h, x=account.x),))
        break
    if not _moves_so(stack, best[ranked[0]]):
        return said(Verdict.UNKNOWN, (), outside, null.build)
    alike = [
        key for key in ranked if drops[key] > LEAST_DROP and top - drops[key] < max(LIKE, LIKE_SHARE * top)
    ]
    verdict = Verdict.AMBIGUOUS if len(alike) > 1 else Verdict.PARTIAL
    return said(verdict, alike or ranked[:1], outside, best[ranked[0]].build)
