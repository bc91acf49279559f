"""A pulse counter whose window runs along with the log: no value is held, so its length shows in what it averages.

Where the values change at every row the lattice tells the quantum alone. A mean over a window is late by half of it,
and smoother than what is merely late: so a window is believed only where it fits better than a delay does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from scenarios.effects.wheel_speed_delay import WheelSpeedDelay
from sim2real.drive import Drive
from sim2real.evidence import gather
from sim2real.fitting import loss
from sim2real.lattice import LONGEST_WINDOW_S, Lattice
from sim2real.observer import Simulation

TRIED = 8
"""Windows that are tried before the best is refined."""
GAIN = 0.01
"""Share that a window takes off the loss beside none, and beside a delay, before it is believed [-]."""


def with_running_window(lattice: Lattice, model: Simulation, fit: Sequence[Drive]) -> Lattice:
    """The lattice with the window that fits, where none is seen in it; as it is where none fits better.

    Parameters
    ----------
    lattice : Lattice
        Of the wheel speeds.
    model : Simulation
        Without a counter.
    fit : sequence of Drive
        Logs to fit to.
    """
    if lattice.is_seen:
        return lattice
    counted = model.with_effects(lattice.effect())
    evidence = gather(counted, fit)

    def left(changed: Simulation) -> float:
        return loss(evidence.whitened(evidence.residuals(changed)))

    def averaging(window_s: float) -> float:
        return left(model.with_effects(replace(lattice, window_s=window_s, runs=True).effect()))

    def late(delay_s: float) -> float:
        return left(counted.with_effects(WheelSpeedDelay(delay_s)))

    window_s, runs = _least(averaging, 2.0 * lattice.step_s, LONGEST_WINDOW_S)
    _, delayed = _least(late, lattice.step_s, 0.5 * LONGEST_WINDOW_S)
    if runs > (1.0 - GAIN) * min(left(counted), delayed):
        return lattice
    return replace(lattice, window_s=window_s, runs=True)


def _least(cost: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Where a cost is least between two durations, and how much that is."""
    grid = np.geomspace(low, high, TRIED)
    at = int(np.argmin([cost(float(x)) for x in grid]))
    bounds = (float(grid[max(at - 1, 0)]), float(grid[min(at + 1, TRIED - 1)]))
    found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02 * bounds[0]})
    return float(found.x), float(found.fun)
