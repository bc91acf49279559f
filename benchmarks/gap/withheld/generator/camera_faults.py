"""How what is hidden in a camera's chain comes about: late pictures, a turned mounting, lost confidence."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from .camera_forms import function
from .camera_outside_faults import set_clock_s, weather_kept
from .camera_road import Passage, Whole
from .camera_system import BEHIND_M, HEIGHT_M, Chain, Fault

Array = NDArray[np.floating[Any]]

GUESS = 1.0 / 3.0
"""Least probability that the likeliest of three classes can have."""
FLOORS = {"to_nothing": 0.02, "to_a_guess": GUESS, "to_a_sixth": 1.0 / 6.0}
"""Share of the confidence that nothing takes."""
GLARE_M, GLARE_SHARE = 90.0, 0.35
"""From one stretch with the sun in the lens to the next, and how much of the road has it."""
FREEZES_S = 5.0
"""From one standstill of the pictures to the next, in the mean."""
TURNS = 0.2
"""By which a turned mounting is turned less at first, and more in the end, as its bracket creeps [-]."""
NOD_RAD, NOD_M, HARD_M_S2 = 9e-4, 0.1, 4.0
"""Nose down for each m/s^2 of braking, at most as much as moves a place by `NOD_M` in hard braking."""
COURSE, LIGHT_M, HUNT_S = 0.25, (120.0, 260.0), (3.0, 8.0)
"""By which an exposure is off more and less; from one dark stretch to the next, and the time of a control's swing."""
LOOSE_M_S2 = 3.0
"""Where a loose bracket shakes as much as it does."""


def acceleration(passage: Passage, time_s: Array) -> Array:
    """Of the car, without what shakes [m/s^2]."""
    speed = uniform_filter1d(passage.speed_m_s, 200, mode="nearest")
    clock = np.arange(speed.size) * 1e-3
    return np.asarray(np.interp(time_s, clock, np.gradient(speed, 1e-3)))


def shown_s(chain: Chain, fault: Fault, passage: Passage, taken: Array, log: str) -> Array:
    """When what the result tells was really seen [s]."""
    delay: Array | float = 0.0
    if fault.delay_s:
        late = function(chain.forms, "lateness")
        delay = late(fault.delay_s, 1.0 / chain.rate_hz, taken.size, chain.rng(log, 4))
    shown = taken - delay - fault.clock * np.maximum(taken, 0.0)
    if fault.frozen_s > 0.0:
        rng, at = chain.rng(log, 10), 0.0
        while (at := at + rng.exponential(FREEZES_S)) < taken[-1]:
            held = (taken >= at) & (taken < at + fault.frozen_s)
            shown[held] = shown[held][:1]
            at += fault.frozen_s
    if fault.clock_set_s > 0.0:
        shown = shown - set_clock_s(chain, fault, taken, log)
    return np.asarray(shown)


def pitch_of(chain: Chain, fault: Fault, n: int) -> Array:
    """By how much the camera is nose down in each of n pictures [rad]."""
    creeps = chain.forms["mounting"] == "creeping"
    return fault.pitch_rad * (np.linspace(1.0 - TURNS, 1.0 + TURNS, n) if creeps else np.ones(n))


def _swing(along: Array, period: float, phase: float) -> Array:
    return np.sin(2.0 * np.pi * (along / period + phase))


def nod_of(chain: Chain, passage: Passage, taken: Array) -> Array:
    """What the body's own pitch adds, on every car and about none in the mean [rad]."""
    if chain.forms["body"] == "level":
        return np.zeros(taken.size)
    distance = chain.preview_m + BEHIND_M + chain.window_m
    most = NOD_M * HEIGHT_M / (distance**2 + HEIGHT_M**2) / HARD_M_S2
    push = np.clip(acceleration(passage, taken), -HARD_M_S2, HARD_M_S2)
    return np.asarray(-min(NOD_RAD, most) * (push - push.mean()))


def kept_of(
    chain: Chain, fault: Fault, speed_m_s: Array, by: tuple[Array, Array] | tuple[float, float] = (1.0, 1.0)
) -> Array:
    """Share of the confidence that blur and wrong exposure leave, at each speed and times what each is off `by` [-]."""
    blur, exposure = function(chain.forms, "blur_law"), function(chain.forms, "exposure_law")
    wrong = abs(fault.stops) / chain.stops * (chain.over if fault.stops > 0.0 else 1.0)
    smeared = speed_m_s * fault.exposure_s / chain.blur_m
    kept = blur(smeared * by[0]) * exposure(np.full(speed_m_s.size, wrong) * by[1])
    return np.asarray(1.0 - (1.0 - FLOORS[chain.forms["kept"]]) * (1.0 - kept))


def courses(chain: Chain, place_m: Array, taken: Array, log: str) -> tuple[Array | float, Array | float]:
    """Blur and wrong exposure of each picture over their means [-]."""
    return tuple(
        _course(chain, chain.forms[f"{of}_course"], place_m, taken, log) for of in ("blur", "exposure")
    )


def _course(chain: Chain, kind: str, place_m: Array, taken: Array, log: str) -> Array | float:
    if kind == "by_light":
        rng = chain.rng("", 26)
        return 1.0 + COURSE * _swing(place_m, rng.uniform(*LIGHT_M), rng.random())
    if kind == "hunting":
        rng = chain.rng(log, 27)
        return 1.0 + COURSE * _swing(taken, rng.uniform(*HUNT_S), rng.random())
    return 1.0


def outside_kept(
    chain: Chain, fault: Fault, passage: Passage, taken: Array, place_m: Array, surface: Whole, log: str
) -> Array | float:
    """What deviations that the library lacks leave of the confidence [-]."""
    kept: Array | float = 1.0 - fault.glare * _sunny(chain, place_m)
    if fault.fogged > 0.0:
        kept = kept * (1.0 - fault.fogged * np.clip(taken / passage.end_s, 0.0, 1.0))
    if fault.loose > 0.0:
        push = np.minimum(np.abs(acceleration(passage, taken)) / LOOSE_M_S2, 1.0)
        kept = kept * (1.0 - fault.loose * push)
    if fault.unsure > 0.0:
        kept = kept * (1.0 - fault.unsure * (surface == 1))
    return kept * weather_kept(chain, fault, passage, taken, log)


def _sunny(chain: Chain, place_m: Array) -> Array:
    """1 where the sun is in the lens: stretches of the road, as it bends [-]."""
    bends = np.cos(2.0 * np.pi * (place_m / GLARE_M + chain.rng("", 11).random()))
    return np.asarray((bends > np.cos(np.pi * GLARE_SHARE)).astype(float))


def jumps_m(chain: Chain, fault: Fault, time_s: Array, end_s: float, log: str) -> Array:
    """By how far positions have jumped by a time: once or twice in a log, either way [m]."""
    rng = chain.rng(log, 33)
    moments, signs = np.sort(rng.uniform(0.2, 0.8, rng.integers(1, 3))) * end_s, rng.choice([-1.0, 1.0], 2)
    return fault.jumped_m * sum(
        sign * (time_s >= moment) for moment, sign in zip(moments, signs, strict=False)
    )
