"""What the third family adds: each entry is named after the aspect that it is a form of.

Where an effect had one form only, that is the library's and comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .falling import POWER, STRAIGHT
from .forms_second import Apply, Foreign, falling, message_of, payload
from .library import LIBRARY
from .recording import DIGITS_THIRD, NOISES_THIRD
from .styles_third import ONE_PEDAL, PROVING
from .tyre import DECAYING, SATURATED
from .world import AIR_KG_M3, Parameters, World, with_foreign

LIFT_SHARE = 0.3
"""Of the drag: a saloon's lift."""
DRAG_HEIGHT_M = 0.6
"""Where the drag acts: it presses the rear wheels and lightens the front ones."""
ROLL_GROWTH = 0.08
"""Of a car tyre's rolling resistance over the square of the speed."""
BOOT = 0.9
"""Where a load in the boot lies, as a share of the way from the centre of gravity to the rear axle."""
LINKS, SPRINGS_S = 0.4, 0.06
"""Share of the load transfer that the suspension's links carry at once, and how late the springs' share follows."""
BODY_RAD_S = 2.0 * np.pi * 2.2
"""Of a body that pitches on its springs."""
PATCHY = 0.3
"""How much more or less of a deviation there is from place to place."""
UNEVEN_GRADE, GRADE_M = 0.2, 110.0
"""The same of a grade, and over what length."""
FIRST_STAGE = 0.2
"""Share of a motor's lag that its current takes, the torque's build-up the rest."""
BEAT_S = 0.02
"""Cycle of two senders whose clocks differ a little; the age of a value varies by it, at most by half of the delay."""
AXLES = np.array([1.15, 1.15, 0.85, 0.85])
"""Front and rear differ, their mean does not."""
DRAG_AXLES = np.array([0.75, 0.75, 1.25, 1.25])
PULSE = 0.4
"""Of a pad's drag over a turn of a disc that wobbles."""
INERTIA_TILT = 0.25
"""How much more of the deviation the rear wheels have, and the front ones less."""
STIFFNESS_LOAD = 0.5
"""How much of the deviation goes with the load."""
TEETH_OFF = 0.4
"""Of a tone wheel that sits off its centre [teeth]."""
WARMING, SWAY = 0.1, 0.12
"""How much more or less of a deviation there is from time to time."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _air(**more: float) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
        return world.moved(drag=drag, lift=more.get("lift", 0.0) * drag, drag_height=more.get("height", 0.0))

    return apply


def _rolling_alone(world: World, given: Parameters) -> World:
    """The force keeps its lever: with another pressure a tyre sinks in, its belt's length changes less."""
    p = world.physics
    return world.moved(radius=given["radius_m"], lever=p.radius / given["radius_m"])


def _inertia(world: World, given: Parameters) -> World:
    more = given["inertia_kg_m2"] - world.physics.inertia
    return world.moved(inertia=given["inertia_kg_m2"], inertia_tilt=INERTIA_TILT * more)


def _stiffness(world: World, given: Parameters) -> World:
    """What it deviates by grows with the load."""
    more = STIFFNESS_LOAD * (given["stiffness_n"] - world.physics.stiffness_drive)
    return LIBRARY["tyre_stiffness_offset"].apply(world, given).moved(stiffness_load=more)


def _patchy(effect: str) -> Apply:
    return lambda world, given: _first(effect)(world, given).moved(patch_depth=PATCHY)


def _stages(world: World, given: Parameters) -> World:
    whole = given["time_constant_s"]
    return world.moved(lag=(1.0 - FIRST_STAGE) * whole, lag_first=FIRST_STAGE * whole)


def _beat_of(delay_s: float) -> float:
    return min(BEAT_S, delay_s)


def _sensor_delays(sensor: str) -> dict[str, Apply]:
    """As one that two clocks' beat shortens and stretches; as messages that straight lines join."""

    def beating(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        return world.sensed(**{f"{sensor}_delay_s": delay, f"{sensor}_beat_s": _beat_of(delay)})

    def joined(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        message = {f"{sensor}_message_s": message_of(delay), f"{sensor}_joined": True}
        return world.sensed(**{f"{sensor}_delay_s": delay}, **message)

    return {"beating": beating, "joined_messages": joined}


def _pulses(**how: Any) -> Apply:
    return lambda w, g: w.sensed(wheel_teeth=g["teeth"], wheel_window_s=g["window_s"], **how)


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {
        "drag_alone": _first("aero_drag"),
        "with_lift": _air(lift=LIFT_SHARE),
        "at_height": _air(height=DRAG_HEIGHT_M),
    },
    "rolling_resistance": {
        "grows_with_speed": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_growth=ROLL_GROWTH),
    },
    "road_grade": {
        "even": _first("road_grade"),
        "uneven": lambda w, g: w.moved(
            grade=g["grade"], wave_slope=UNEVEN_GRADE * g["grade"], wave_length=GRADE_M
        ),
    },
    "mass_offset": {"boot": payload(BOOT)},
    "wheel_radius_offset": {"lever_too": _first("wheel_radius_offset"), "rolling_alone": _rolling_alone},
    "wheel_inertia_offset": {"all_alike": _first("wheel_inertia_offset"), "unlike_axles": _inertia},
    "load_transfer": {
        "links_and_springs": lambda w, g: w.moved(
            cog_height=g["cog_height_m"], springs_share=1.0 - LINKS, springs_time=SPRINGS_S
        ),
        "pitching_body": lambda w, g: w.moved(cog_height=g["cog_height_m"], body_rate=BODY_RAD_S),
    },
    "tyre_relaxation": {
        "with_load": lambda w, g: w.moved(relaxation=g["length_m"], relaxation_load=True),
        "shrinks_in_sliding": lambda w, g: w.moved(relaxation=g["length_m"], relaxation_shrinks=True),
    },
    "tyre_stiffness_offset": {"everywhere": _first("tyre_stiffness_offset"), "with_load": _stiffness},
    "friction_falloff": {"straight": falling(STRAIGHT), "power": falling(POWER)},
    "friction_offset": {"everywhere": _first("friction_offset"), "patchy": _patchy("friction_offset")},
    "torque_lag": {"one_stage": _first("torque_lag"), "two_stages": _stages},
    "torque_delay": {
        "beating": lambda w, g: w.moved(delay=g["delay_s"], beat=_beat_of(g["delay_s"])),
    },
    "torque_gain": {
        "all_alike": _first("torque_gain"),
        "unlike_axles": lambda w, g: w.moved(gain=1.0 + (g["factor"] - 1.0) * AXLES),
    },
    "brake_drag": {
        "even": _first("brake_drag"),
        "pulsating": lambda w, g: w.moved(brake_drag=g["torque_nm"], brake_pulse=PULSE),
        "unlike_axles": lambda w, g: w.moved(brake_drag=g["torque_nm"], brake_share=DRAG_AXLES),
    },
    "wheel_speed_delay": _sensor_delays("wheel"),
    "wheel_speed_quantisation": {
        "shared_windows": _pulses(wheel_window_shared=True),
        "uneven_teeth": _pulses(wheel_uneven=TEETH_OFF),
    },
    "vehicle_speed_delay": _sensor_delays("speed"),
    "vehicle_speed_scale": {
        "steady": _first("vehicle_speed_scale"),
        "swaying": lambda w, g: w.sensed(speed_scale=g["factor"], speed_sway=SWAY),
    },
    "accelerometer_bias": {
        "steady": _first("accelerometer_bias"),
        "warming": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_warming=WARMING),
    },
    "mu_split": {"everywhere": _first("mu_split"), "patchy": _patchy("mu_split")},
}

FOREIGN: dict[str, Foreign] = {
    "decaying": Foreign(
        lambda rng: {"loss": float(rng.uniform(0.05, 0.25))},
        lambda world, share, loss: with_foreign(world, DECAYING, share, loss),
    ),
    "saturated": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, SATURATED, share)),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_THIRD,
    "digits": DIGITS_THIRD,
    "driver": {"one_pedal": ONE_PEDAL, "proving": PROVING},
}
