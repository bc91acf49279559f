"""The second family's forms: of each aspect the first is the first family's only one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.random import Generator

from .driver import BRISK
from .falling import HYPERBOLIC, SATURATING
from .library import LIBRARY
from .recording import DIGITS, NOISES
from .styles import RESTLESS, SQUEEZING
from .tyre import BRUSH, RATIONAL
from .world import Parameters, World, with_foreign, with_magic

Apply = Callable[[World, Parameters], World]

SPRINGS_S = 0.04
"""How late the loads follow where springs carry the body: a damped pitch of about 2 Hz, less what the links carry."""
PAYLOAD_BEHIND = 0.5
"""Where a payload lies behind the centre of gravity, as a share of the way to the rear axle: the rear seats."""
MESSAGE_S = 0.02
"""Of a vehicle's bus, one to the next; a delay shorter than half of it has them follow at twice the delay."""
AVERAGE_S = 0.04
"""What a speed sensor averages over; no more than its delay, so that it is late rather than slow."""


@dataclass(frozen=True)
class Foreign:
    """A tyre of another formula: its own parameters, and how a world gets a share of it."""

    draw: Callable[[Generator], Parameters]
    apply: Callable[..., World]


FOREIGN: dict[str, Foreign] = {
    "magic_formula": Foreign(
        lambda rng: {"shape": float(rng.uniform(1.4, 1.6)), "curvature": float(rng.uniform(-1.0, 0.3))},
        with_magic,
    ),
    "brush": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, BRUSH, share)),
    "rational": Foreign(
        lambda rng: {"stretch": float(rng.uniform(2.3, 3.2)), "sliding": float(rng.uniform(0.7, 0.9))},
        lambda world, share, stretch, sliding: with_foreign(world, RATIONAL, share, stretch, sliding),
    ),
}
"""Curves with the slope and the peak of the simulation's tyre."""


def with_more(effect: str, **how: Any) -> Apply:
    """The library's, with some physics more."""
    return lambda world, given: LIBRARY[effect].apply(world, given).moved(**how)


def message_of(delay_s: float) -> float:
    return min(MESSAGE_S, 2.0 * delay_s)


def payload(behind: float) -> Apply:
    """Behind the centre of gravity by a share of the way to the rear axle: the centre of gravity moves back with it."""

    def apply(world: World, given: Parameters) -> World:
        p = world.physics
        mass = p.mass + given["mass_kg"]
        back = behind * p.rear_arm * given["mass_kg"] / mass
        return world.moved(mass=mass, front_arm=p.front_arm + back, rear_arm=p.rear_arm - back)

    return apply


def _running(world: World, given: Parameters) -> World:
    return world.sensed(wheel_teeth=given["teeth"], wheel_window_s=given["window_s"], wheel_window_runs=True)


def falling(curve: int) -> Apply:
    """Friction that falls by a curve of the kernel's."""
    return lambda w, g: w.moved(falloff=g["falloff_s_m"], falloff_floor=g["floor"], falloff_curve=curve)


def _late(sensor: str, how: str, duration: Callable[[float], float]) -> Apply:
    """A sensor's delay as one of averaging or of messages, whose duration follows from it."""

    def apply(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        return world.sensed(**{f"{sensor}_delay_s": delay, f"{sensor}_{how}_s": duration(delay)})

    return apply


def _sensor_delays(effect: str, sensor: str) -> dict[str, Apply]:
    """As a shift; as a mean over a while that long ago; as messages of that mean age."""
    return {
        "shifted": LIBRARY[effect].apply,
        "averaged": _late(sensor, "average", lambda delay: min(AVERAGE_S, delay)),
        "messages": _late(sensor, "message", message_of),
    }


EFFECT_FORMS: dict[str, dict[str, Apply]] = {
    "rolling_resistance": {
        "force_on_body": LIBRARY["rolling_resistance"].apply,
        "moment_at_wheel": lambda w, g: w.moved(roll_moment=g["coefficient"]),
    },
    "mass_offset": {"at_centre": LIBRARY["mass_offset"].apply, "rear_seats": payload(PAYLOAD_BEHIND)},
    "load_transfer": {
        "at_once": LIBRARY["load_transfer"].apply,
        "through_springs": lambda w, g: w.moved(cog_height=g["cog_height_m"], pitch_time=SPRINGS_S),
    },
    "tyre_relaxation": {
        "slip": LIBRARY["tyre_relaxation"].apply,
        "force": lambda w, g: w.moved(force_relaxation=g["length_m"]),
    },
    "friction_falloff": {
        "exponential": LIBRARY["friction_falloff"].apply,
        "hyperbolic": falling(HYPERBOLIC),
        "saturating": falling(SATURATING),
    },
    "torque_delay": {
        "shifted": LIBRARY["torque_delay"].apply,
        "messages": lambda w, g: w.moved(delay=g["delay_s"], message=message_of(g["delay_s"])),
    },
    "wheel_speed_delay": _sensor_delays("wheel_speed_delay", "wheel"),
    "wheel_speed_quantisation": {
        "window_by_window": LIBRARY["wheel_speed_quantisation"].apply,
        "running_window": _running,
    },
    "vehicle_speed_delay": _sensor_delays("vehicle_speed_delay", "speed"),
}
"""Effects of the library that can be read in more than one way."""

STYLES = {"brisk": BRISK, "squeezing": SQUEEZING, "restless": RESTLESS}

ASPECTS: dict[str, dict[str, Any]] = {
    **EFFECT_FORMS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES,
    "digits": DIGITS,
    "driver": STYLES,
}
"""All that has forms."""
