"""How the squared gap of the hold-out is shared out: by cause, difference of the models, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import Effect
from sim2real.how_far.gap import BOOTSTRAP, QUANTILES, block_squares, energy
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.result import Budget, Interval

Array = NDArray[np.float64]


def budget(
    holdout: Evidence, effects: Sequence[Effect], model: Simulation, floor: float, seed: int
) -> Budget:
    """Shares of the squared gap, each with its 95 % interval by resampled blocks of the drive.

    Parameters
    ----------
    holdout : Evidence
        The logs that the gap is measured on.
    effects : sequence of Effect
        What the verdict adds; of several, each has the mean of what it takes over all orders of adding them.
    model : Simulation
        The car as simulated.
    floor : float
        The gap that noise alone leaves [sensor noises].
    seed : int
        Of the resampling.
    """
    subsets = {frozenset(chosen) for order in permutations(effects) for chosen in _growing(order)}
    squares = {
        chosen: block_squares(holdout, holdout.residuals(model.with_effects(*chosen))) for chosen in subsets
    }
    blocks = len(next(iter(squares.values()))[1])
    rows = np.random.default_rng(seed).integers(0, blocks, (BOOTSTRAP, blocks))

    def shares(at: NDArray[np.int64]) -> list[float]:
        left = {chosen: energy(*(part[at] for part in parts)) for chosen, parts in squares.items()}
        none, every = left[frozenset()], left[frozenset(effects)]
        own = dict.fromkeys(effects, 0.0)
        for order in permutations(effects):
            for before, after in zip(_growing(order), _growing(order)[1:], strict=False):
                (effect,) = after - before
                own[effect] += (left[before] - left[after]) / factorial(len(effects))
        noise = min(floor**2, every)
        return [value / none for value in (*own.values(), every - noise, noise)]

    value = shares(np.arange(blocks))
    low, high = np.quantile([shares(at) for at in rows], QUANTILES, axis=0)
    names = (*(f"effect:{effect.id}" for effect in effects), "structure", "noise")
    return Budget(
        {
            name: Interval(v, float(min(a, v)), float(max(b, v)))
            for name, v, a, b in zip(names, value, low, high, strict=True)
        }
    )


def _growing(order: Sequence[Effect]) -> list[frozenset[Effect]]:
    """No effect, the first, the first two and so on."""
    return [frozenset(order[:count]) for count in range(len(order) + 1)]
