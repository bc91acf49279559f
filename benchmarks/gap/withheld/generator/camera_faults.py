"""How what is hidden in a camera's chain comes about: late pictures, a turned mounting, lost confidence."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from .camera_forms import form, function
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
FASTER = 0.15
"""By which a delay is more where the car is faster by a standard deviation, as there is more to see [-]."""
SQUAT = 0.08
"""By which a turned mounting is turned more as the car squats, and less as it dives [1/(m/s^2)]."""
TURNS = 0.2
"""By which it is turned more and less as its bracket creeps or sways [-]."""
RATTLES, RATTLE_S = 0.15, 0.8
"""The same where it rattles, and how long it stays in the mean."""
BOUNCE_HZ = (1.0, 1.6)
"""Of a body on its springs."""
NOD_RAD, NOD_M, HARD_M_S2 = 9e-4, 0.1, 4.0
"""Nose down for each m/s^2 of braking, at most as much as moves a place by `NOD_M` in hard braking."""
COURSE, LIGHT_M, HUNT_S = 0.25, (120.0, 260.0), (3.0, 8.0)
"""By which an exposure is off more and less; from one dark stretch to the next, and the time of a control's swing."""
SHADE_M = (60.0, 160.0)
"""From one row of houses to the next."""
BY_CLASS = {"over": (0.85, 1.0, 1.15), "under": (1.15, 1.0, 0.85), "blur": (1.1, 1.05, 0.85)}
"""What each surface has of it: snow is bright, asphalt dark."""
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
    if fault.delay_s and chain.forms["lateness"] == "when_fast":
        speed = passage.speed(taken)
        delay = fault.delay_s * (1.0 + FASTER * _standard(speed))
    elif fault.delay_s:
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


def _standard(values: Array) -> Array:
    """About their mean, in standard deviations, without a mean of its own where one is cut."""
    scaled = np.clip((values - values.mean()) / max(float(values.std()), 0.5), -2.5, 2.5)
    return np.asarray(scaled - scaled.mean())


def pitch_of(chain: Chain, fault: Fault, passage: Passage, taken: Array, log: str) -> Array:
    """By how much the camera is nose down in each picture [rad]."""
    pitch, kind, rng = fault.pitch_rad * np.ones(taken.size), chain.forms["mounting"], chain.rng(log, 5)
    if kind == "shaking":
        pitch *= 1.0 + 0.15 * np.clip(rng.standard_normal(taken.size), -2.5, 2.5)
    elif kind == "squatting":
        push = np.clip(acceleration(passage, taken), -3.0, 3.0)
        pitch *= 1.0 - SQUAT * (push - push.mean())
    elif kind == "creeping":
        pitch *= np.linspace(1.0 - TURNS, 1.0 + TURNS, taken.size)
    elif kind == "rattling":
        turned = np.where(np.cumsum(rng.random(taken.size) < 1.0 / (RATTLE_S * chain.rate_hz)) % 2, 1.0, -1.0)
        pitch *= 1.0 + RATTLES * (turned - turned.mean())
    elif kind == "swaying":
        pitch *= 1.0 + TURNS * _swing(taken, rng.uniform(2.0, 5.0), rng.random())
    elif kind == "bouncing":
        pitch *= 1.0 + TURNS * _swing(taken, 1.0 / rng.uniform(*BOUNCE_HZ), rng.random())
    return pitch


def _swing(along: Array, period: float, phase: float) -> Array:
    return np.sin(2.0 * np.pi * (along / period + phase))


def nod_of(chain: Chain, passage: Passage, taken: Array) -> Array:
    """What the body's own pitch adds, on every car and about none in the mean [rad]."""
    if form(chain.forms, "body") == "level":
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


def courses(chain: Chain, fault: Fault, surface: Whole, place_m: Array, taken: Array, log: str) -> Any:
    """Blur and wrong exposure of each picture over their means [-]."""
    ways = {"blur": "blur", "exposure": "over" if fault.stops > 0.0 else "under"}
    return tuple(
        _course(chain, form(chain.forms, f"{name}_course"), BY_CLASS[way], surface, place_m, taken, log)
        for name, way in ways.items()
    )


def _course(
    chain: Chain,
    kind: str,
    by_class: tuple[float, ...],
    surface: Whole,
    place_m: Array,
    taken: Array,
    log: str,
) -> Array | float:
    if kind == "by_light":
        rng = chain.rng("", 26)
        return 1.0 + COURSE * _swing(place_m, rng.uniform(*LIGHT_M), rng.random())
    if kind == "hunting":
        rng = chain.rng(log, 27)
        return 1.0 + COURSE * _swing(taken, rng.uniform(*HUNT_S), rng.random())
    if kind == "in_shade":
        rng = chain.rng("", 26)
        return 1.0 + COURSE * np.where(_swing(place_m, rng.uniform(*SHADE_M), rng.random()) > 0.0, 1.0, -1.0)
    if kind == "stepped":
        rng = chain.rng(log, 27)
        return 1.0 + COURSE * np.where(_swing(taken, rng.uniform(*HUNT_S), rng.random()) > 0.0, 1.0, -1.0)
    if kind == "scattered":
        return 1.0 + 0.2 * np.clip(chain.rng(log, 28).standard_normal(taken.size), -2.5, 2.5)
    if kind == "by_class":
        return np.array(by_class)[surface]
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
