"""Readings counted in blocks of at least 10 ms: their means, the slip and used friction of two of them, their noise."""

from __future__ import annotations

import math
from typing import NamedTuple

BLOCK_S = 0.0099
"""Least length of a block: 10 ms, less what steps of 1 ms add up to by rounding [s]."""
NOISE_MEMORY_S = 0.3
"""Time constant of the noise that is read from the readings [s]."""
SECOND_DIFFERENCE = 6.0
"""Variance of the second difference of white noise of variance 1 [-]."""


class Noise(NamedTuple):
    """White noise of a signal, read from the second differences of its new values."""

    variance: float
    before: float = 0.0
    """Value before, in the signal's unit."""
    difference: float = 0.0
    """Its difference to the one before that."""
    values: int = 0
    """How many new values came, up to 3."""
    held_s: float = 0.0
    """Time since the last one [s]."""


def heard(noise: Noise, value: float, step_s: float, least: float) -> Noise:
    """The noise after a reading; a value that is held over several steps counts once. Variance at least `least`."""
    held_s = noise.held_s + step_s
    if noise.values > 0 and value == noise.before:
        return noise._replace(held_s=held_s)
    variance, difference = noise.variance, value - noise.before
    if noise.values >= 2:
        second = difference - noise.difference
        share = 1.0 - math.exp(-held_s / NOISE_MEMORY_S)
        variance += share * (second * second / SECOND_DIFFERENCE - variance)
        variance = max(variance, least)
    return Noise(variance, value, difference, min(noise.values + 1, 3))


class Means(NamedTuple):
    """Means of a block."""

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float
    load_n: float
    duration_s: float
    samples: int
    """How many new wheel speeds are in it, at least 1."""


class Filling(NamedTuple):
    """Sums of a block that is not yet full; times time where they have a unit of their own."""

    wheel_speed: float = 0.0
    wheel_torque: float = 0.0
    vehicle_speed: float = 0.0
    load: float = 0.0
    duration_s: float = 0.0
    samples: int = 0


def means_of(filling: Filling) -> Means:
    """The means of a full block."""
    d = filling.duration_s
    return Means(
        filling.wheel_speed / d,
        filling.wheel_torque / d,
        filling.vehicle_speed / d,
        filling.load / d,
        d,
        max(filling.samples, 1),
    )


class Reading(NamedTuple):
    """Slip and used friction of two blocks, with their changes."""

    slip: float
    """Signed, positive where it drives [-]."""
    friction: float
    """Used friction by the wheel's balance, signed likewise [-]."""
    load_n: float
    speed_m_s: float
    """What slip is taken over."""
    slip_change: float
    """Change of slip from block to block [-]."""
    friction_change: float
    """Change of the used friction from the reading before [-]."""
    rim_m_s: float
    """The lower rim speed of the two."""
    duration_s: float
    """Of a block."""
    samples: int
    """Of a block."""


def reading(
    before: Means,
    now: Means,
    friction_before: float,
    inertia_kg_m2: float,
    radius_m: float,
    rolling_resistance: float,
) -> Reading:
    """The reading of two consecutive blocks; inertia [kg m^2], radius [m] and rolling resistance [-] of the wheel."""
    omega = 0.5 * (before.wheel_speed_rad_s + now.wheel_speed_rad_s)
    speed_m_s = 0.5 * (before.vehicle_speed_m_s + now.vehicle_speed_m_s)
    torque_nm, load_n = (
        0.5 * (before.wheel_torque_nm + now.wheel_torque_nm),
        0.5 * (before.load_n + now.load_n),
    )
    gained, rim_m_s = now.wheel_speed_rad_s - before.wheel_speed_rad_s, omega * radius_m
    if rim_m_s > 1.0:
        torque_nm -= rolling_resistance * load_n * radius_m
    between_s = 0.5 * (before.duration_s + now.duration_s)
    force_n = (torque_nm - inertia_kg_m2 * gained / between_s) / radius_m
    over_m_s = max(rim_m_s, speed_m_s)
    gained_m_s = gained * radius_m - (now.vehicle_speed_m_s - before.vehicle_speed_m_s)
    return Reading(
        (rim_m_s - speed_m_s) / over_m_s if over_m_s > 0.0 else 0.0,
        force_n / load_n,
        load_n,
        over_m_s,
        gained_m_s / over_m_s if over_m_s > 0.0 else 0.0,
        force_n / load_n - friction_before,
        min(before.wheel_speed_rad_s, now.wheel_speed_rad_s) * radius_m,
        between_s,
        now.samples,
    )
