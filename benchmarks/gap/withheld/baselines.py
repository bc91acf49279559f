"""Simple rankers to hold the diagnosis against. They always name an effect: "unknown" and "no gap" are beyond them."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .generator.cases import Case
from .generator.driver import ROWS_PER_COMMAND
from .generator.kernel import RECORD_STEP_S, N, X, begin, integrate
from .generator.library import LIBRARY
from .generator.sensors import WHEELS, read
from .generator.severity import residual_of
from .generator.world import World

Array = NDArray[np.floating[Any]]

LOOKED_AT_S = 12.0
BLOCK = round(0.1 / RECORD_STEP_S)
SIGNALS = [f"wheel_speed_{w}_rad_s" for w in WHEELS] + ["vehicle_speed_m_s", "accel_x_m_s2"]


def cosine(case: Case) -> list[str]:
    """Effects by how well the hold-out's residual points where each effect, at a middling size, would point it.

    Signatures are residuals in blocks of 0.1 s over the noise, of the first `LOOKED_AT_S`; the sign is left open.
    """
    base, noise = case.base["holdout"], case.noise
    rows = int(LOOKED_AT_S / RECORD_STEP_S)
    command = case.drives["holdout"].command[: rows // ROWS_PER_COMMAND + 1]
    log = case.logs["holdout"]
    shown, position = _on_grid(log, rows)
    seen = _signature(residual_of(shown, position, base, command), noise.sigmas)
    scores = {}
    for effect, entry in LIBRARY.items():
        rng = np.random.default_rng(0)
        world = entry.apply(base, entry.at(case.car, rng)(0.5))
        scores[effect] = abs(
            float(seen @ _signature(_imagined(world, base, shown, position, command), noise.sigmas))
        )
    return sorted(scores, key=lambda effect: -scores[effect])


def _on_grid(log: pd.DataFrame, rows: int) -> tuple[Array, Array]:
    clock = np.arange(rows) * RECORD_STEP_S
    time_s = log["time_s"].to_numpy()
    time_s = time_s - time_s[0] + np.median(np.diff(time_s))
    filled = log[SIGNALS].interpolate(limit_direction="both").to_numpy()
    shown = np.column_stack([np.interp(clock, time_s, column) for column in filled.T])
    place = log["position_m"].interpolate(limit_direction="both").to_numpy()
    return shown, np.interp(clock, time_s, place)


def _imagined(world: World, base: World, shown: Array, position: Array, command: Array) -> Array:
    """Residual that `world` would have left, driven with the log's torque from where the log begins."""
    path = np.zeros((len(shown), N + 1))
    speed = max(shown[:50, 4].mean(), 3.0)
    y = begin(world.physics, position[0], speed, np.full(4, speed / world.physics.radius), 0.0, command)
    path[0, :N] = y
    integrate(world.physics, y, 0, len(path) - 1, world.split, command, path)
    readings = read(path, world.sensors, np.arange(len(path)) * RECORD_STEP_S)
    return residual_of(readings, path[:, X].copy(), base, command)


def _signature(residual: Array, sigmas: Array) -> Array:
    """Unit vector of the blocks' means."""
    whole = len(residual) // BLOCK * BLOCK
    blocks = np.nanmean((residual[1:whole] / sigmas)[: whole - BLOCK].reshape(-1, BLOCK, 6), axis=1).ravel()
    size = np.linalg.norm(blocks)
    return blocks / size if size > 0.0 else blocks


def in_sample_bic(diagnosis: Mapping[str, Any], known: Container[str] = LIBRARY) -> list[str]:
    """Effects, of those `known`, by the Bayesian information criterion on the logs that they were fitted to."""
    return _by(diagnosis, "fit_bic", known)


def closure(diagnosis: Mapping[str, Any], known: Container[str] = LIBRARY) -> list[str]:
    """Effects, of those `known`, by the gap that they leave on the hold-out."""
    return _by(diagnosis, "gap_after", known)


def _by(diagnosis: Mapping[str, Any], key: str, known: Container[str]) -> list[str]:
    causes = [c for c in diagnosis["causes"] if c["effect"] in known and c.get(key) is not None]
    return [c["effect"] for c in sorted(causes, key=lambda c: float(c[key]))]
