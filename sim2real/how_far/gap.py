"""How large the gap is, and by how much it shrinks, in units of the sensors' noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.observing.drive import GROUPS, UNITS
from sim2real.observing.evidence import Evidence, residuals
from sim2real.observing.observer import Simulation
from sim2real.result import Interval, Measure

Array = NDArray[np.float64]

GAP_SIGNALS = ("wheel_speed", "vehicle_speed", "accel_x")
"""Signals that the gap is measured on; position is evidence, but its noise is often too little known to divide by."""
BOOTSTRAP = 400
"""Resamplings behind an interval."""
BLOCK_S = 1.0
"""Length of the blocks that are resampled: beyond the observer's memory [s]."""
QUANTILES = (0.025, 0.975)
START_S = 0.2
"""A free run begins from what was measured over this time [s]."""


def measure(evidence: Evidence, rests: Sequence[Array]) -> Measure:
    """Root mean square residual per signal in units of its noise, and over the signals."""
    signals, si = {}, {}
    for name in GAP_SIGNALS:
        z, plain = [], []
        for noise, rest in zip(evidence.noises, rests, strict=True):
            scaled = noise.scaled(rest)[:, GROUPS[name]]
            z.append(scaled[np.isfinite(scaled)])
            plain.append(rest[:, GROUPS[name]][np.isfinite(scaled)])
        values = np.concatenate(z)
        if len(values):
            signals[name] = float(np.sqrt(np.mean(values**2)))
            si[f"{name} [{UNITS[name]}]"] = float(np.sqrt(np.mean(np.concatenate(plain) ** 2)))
    return Measure(float(np.sqrt(np.mean(np.square(list(signals.values()))))), signals, si)


def noise_floor(model: Simulation, evidence: Evidence, seed: int) -> float:
    """What `measure` gives where the model is right: a free run of the model itself with fresh noise, followed.

    About 1; more where the logged torque spins up or locks the wheels of the free run from its start on: single samples
    then tell its state no better than to many times the noise.
    """
    generator = np.random.default_rng(seed)
    rests = []
    for drive, noise in zip(evidence.drives, evidence.noises, strict=True):
        begun = np.where((drive.time_s < drive.time_s[0] + START_S)[:, None], drive.measured, np.nan)
        clean = model.predict(replace(drive, measured=begun)).channels
        lost = ~np.isfinite(drive.measured)
        noisy = np.where(lost, np.nan, clean + noise.draw(len(drive), generator))
        silent = None if drive.reference is None else 0.0 * drive.reference  # its noise is in `noise` already
        again = replace(drive, measured=noisy, reference=silent)
        rests.append(residuals(model, again))
    return measure(evidence, rests).total


def shrink(evidence: Evidence, before: Sequence[Array], after: Sequence[Array], seed: int) -> Interval:
    """Shrink of the total gap with a 95 % interval, by resampling blocks of the drives [%]."""
    weights_before, counts = block_squares(evidence, before)
    weights_after, _ = block_squares(evidence, after)
    blocks = len(counts)
    if not blocks:
        return Interval(float("nan"), float("nan"), float("nan"), "%")
    generator = np.random.default_rng(seed)
    values = []
    for rows in generator.integers(0, blocks, (BOOTSTRAP, blocks)):
        values.append(_shrink(weights_before[rows], weights_after[rows], counts[rows]))
    low, high = np.nanquantile(values, QUANTILES)
    value = _shrink(weights_before, weights_after, counts)
    return Interval(value, float(min(low, value)), float(max(high, value)), "%")


def _shrink(before: Array, after: Array, counts: Array) -> float:
    return 100.0 * (1.0 - float(np.sqrt(energy(after, counts) / energy(before, counts))))


def energy(squares: Array, counts: Array) -> float:
    """Mean over the signals of the mean square residual in units of the noise, of `block_squares` [-]."""
    total = counts.sum(axis=0)
    return float(np.mean(squares.sum(axis=0)[total > 0] / total[total > 0]))


def block_squares(evidence: Evidence, rests: Sequence[Array]) -> tuple[Array, Array]:
    """Per block and signal, shape (blocks, signals): sums of squares in units of the noise, and how many samples.

    A block without any sample that counts, as of a standing car, is left out: a resampling of such blocks has no gap.
    """
    squares, counts = [], []
    for drive, noise, rest in zip(evidence.drives, evidence.noises, rests, strict=True):
        z, length = noise.scaled(rest), drive.rows_in(BLOCK_S)
        for at in range(0, len(drive), length):
            parts = [z[at : at + length, GROUPS[name]] for name in GAP_SIGNALS]
            count = [np.isfinite(part).sum() for part in parts]
            if any(count):
                squares.append([np.nansum(part**2) for part in parts])
                counts.append(count)
    shape = (-1, len(GAP_SIGNALS))
    return np.array(squares).reshape(shape), np.array(counts, dtype=np.float64).reshape(shape)
