"""What the fourth family adds: each entry is named after the aspect that it is a form of.

Where an effect had one form only, that is the library's and comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .details import PROFILE_STEP_M
from .falling import LOGARITHMIC
from .forms_second import Apply, Foreign, falling, payload
from .library import LIBRARY
from .recording_fourth import DIGITS_FOURTH, NOISES_FOURTH
from .styles_fourth import ASSISTED, HURRIED
from .tyre import BRUSH_FALLING, BRUSH_UNIFORM
from .world import AIR_KG_M3, Parameters, World, with_foreign

FANNING = 0.12
"""Share of the drag that the turning wheels take as fans do: one of their spokes, not of a plain disc."""
REAR_LIFT = 0.2
"""Of the drag, all of it at the rear axle: an estate car without a spoiler."""
ROLL_LINEAR, ROLL_WET = 0.15, 0.2
"""By which a rolling resistance is more at double speed; by which a film of water or slush adds to it."""
SECTIONS_M = (0.0, 35.0, 55.0, 95.0, 115.0, 150.0, 165.0, 205.0, 220.0)
SECTIONS = (0.25, 0.25, -0.3, -0.3, 0.2, 0.2, -0.15, -0.15, 0.25)
"""How much more or less of a grade there is: sections of even grade with short curves between."""
WAVES = ((1, 0.15, 0.4), (3, 0.12, 1.9), (7, 0.06, 4.1))
"""The same as waves: how many in a profile, size, phase."""
FRUNK, ROOF_BEHIND, ROOF_M = -0.7, 0.2, 1.0
"""Where a load lies, as a share of the way to the rear axle; height of a loaded roof above the centre of gravity."""
RADIUS_TILT, RADIUS_GROWTH = 0.25, -0.08
"""More of the deviation at the front and less at the rear; less of it at speed, where the belt stretches."""
LINKS_SHARE, LINKS_TILT, SPRINGS_S = 0.4, 0.15, 0.07
"""Of the load transfer: what the links carry, more in braking (anti-dive) than in driving; how late the rest is."""
RELAXATION_SPEED = 0.15
"""By which a tyre's relaxation length is more at double speed."""
STIFFNESS_TILT = 0.25
"""More of the deviation at the front and less at the rear."""
RUBBING_S = 0.02
"""In which a sliding contact gets warm."""
STRETCHES = 0.3
"""How much more or less of a friction's deviation there is from stretch to stretch."""
CURRENT_DAMPING = 0.7
"""Of a motor whose current is controlled with a swing, over the critical one."""
LAG_SIGN = -0.25
"""Of a lag: the motors drive sooner than the brakes bite."""
MESSAGE_S = 0.02
"""Between the messages that a controller joins by straight lines; no more than the delay, as it waits for the next."""
WAIT_S = 0.02
"""By which the age of a value differs at most on a bus with other traffic; no more than the delay."""
SMOOTHED_S = 0.02
"""Of a delay, what a filter takes: half of it at most."""
GAIN_SIGN, GAIN_SPEED = 0.2, -0.2
"""By which a gain's deviation is more in driving than in braking; by which it is more at double speed."""
CALIPERS = np.array([1.3, 0.8, 1.1, 0.8])
"""Each brake has its own drag, the mean is as told."""
PLAY_RAD, SHAFTS = 0.0035, 0.2
"""Half of a driveline's play at the wheel (0.4 degrees in all); by which a short left shaft is the stiffer one."""
PARTS, LATE_FLANK = 4, 0.25
"""Windows that overlap; how late every second flank is [teeth]."""
SCALE_GROWTH, SCALE_PITCH = 0.15, 0.04
"""Of a scale's deviation: at double speed; with the body's pitch [1/(m/s^2)]."""
BIAS_GROWTH = 0.2
"""Of a bias: at double speed, as the vibration is more."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _fanning(world: World, given: Parameters) -> World:
    """Of free-rolling wheels it takes the power that the body's drag has less."""
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    fanning = FANNING * drag * world.physics.radius**3 / 4.0
    return world.moved(drag=(1.0 - FANNING) * drag, fanning=fanning)


def _rear_lift(world: World, given: Parameters) -> World:
    """All of a lift at the rear is a lift in the middle and as much of a moment."""
    p, drag = world.physics, 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    height = -0.5 * REAR_LIFT * (p.front_arm + p.rear_arm)
    return world.moved(drag=drag, lift=REAR_LIFT * drag, drag_height=height)


def _hilly(shape: str) -> Apply:
    at = np.arange(0.0, SECTIONS_M[-1], PROFILE_STEP_M)
    if shape == "sections":
        profile = np.interp(at, SECTIONS_M, SECTIONS)
    else:
        turns = 2.0 * np.pi * at / SECTIONS_M[-1]
        profile = np.sum([size * np.sin(n * turns + phase) for n, size, phase in WAVES], axis=0)
    profile -= profile.mean()
    return lambda world, given: world.moved(grade=given["grade"], profile=profile)


def _roof(world: World, given: Parameters) -> World:
    """A little behind and well above; the height counts only where loads shift at all."""
    loaded = payload(ROOF_BEHIND)(world, given)
    p = loaded.physics
    up = ROOF_M * given["mass_kg"] / p.mass if p.cog_height > 0.0 else 0.0
    return loaded.moved(cog_height=max(p.cog_height + up, 0.5 * p.cog_height))


def _radius(tilt: float, growth: float) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        more = given["radius_m"] - world.physics.radius
        return world.moved(radius=given["radius_m"], radius_tilt=tilt * more, radius_growth=growth * more)

    return apply


def _stiffness(world: World, given: Parameters) -> World:
    more = given["stiffness_n"] - world.physics.stiffness_drive
    return _first("tyre_stiffness_offset")(world, given).moved(stiffness_tilt=STIFFNESS_TILT * more)


def _slow_to_fall(world: World, given: Parameters) -> World:
    rubbing = RUBBING_S if given["falloff_s_m"] > 0.0 else 0.0
    return _first("friction_falloff")(world, given).moved(falloff_time=rubbing)


def _stretches(effect: str) -> Apply:
    return lambda world, given: _first(effect)(world, given).moved(stretch_depth=STRETCHES)


def _joined(world: World, given: Parameters) -> World:
    message = min(MESSAGE_S, given["delay_s"])
    return world.moved(delay=given["delay_s"], message=message, message_joined=True)


def _wait_of(delay_s: float) -> float:
    return min(WAIT_S, delay_s)


def _sensor_delays(sensor: str) -> dict[str, Apply]:
    """As messages that wait for others; as a filter in part."""

    def waiting(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        return world.sensed(**{f"{sensor}_delay_s": delay, f"{sensor}_wait_s": _wait_of(delay)})

    def smoothed(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        return world.sensed(
            **{f"{sensor}_delay_s": delay, f"{sensor}_filter_s": min(0.5 * delay, SMOOTHED_S)}
        )

    return {"loaded_bus": waiting, "smoothed": smoothed}


def _gain(**how: float) -> Apply:
    return lambda world, given: _first("torque_gain")(world, given).moved(**how)


def _shafts(**how: float) -> Apply:
    return lambda world, given: _first("driveline_compliance")(world, given).moved(**how)


def _pulses(**how: Any) -> Apply:
    return lambda w, g: w.sensed(wheel_teeth=g["teeth"], wheel_window_s=g["window_s"], **how)


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"fanning_wheels": _fanning, "rear_lift": _rear_lift},
    "rolling_resistance": {
        "linear_in_speed": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_linear=ROLL_LINEAR),
        "more_when_wet": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_wet=ROLL_WET),
    },
    "road_grade": {"sections": _hilly("sections"), "rolling_country": _hilly("waves")},
    "mass_offset": {"front_boot": payload(FRUNK), "roof": _roof},
    "wheel_radius_offset": {
        "unlike_axles": _radius(RADIUS_TILT, 0.0),
        "less_at_speed": _radius(0.0, RADIUS_GROWTH),
    },
    "load_transfer": {
        "anti_dive": lambda w, g: w.moved(
            cog_height=g["cog_height_m"],
            springs_share=1.0 - LINKS_SHARE,
            springs_tilt=LINKS_TILT,
            springs_time=SPRINGS_S,
        ),
    },
    "tyre_relaxation": {
        "grows_with_speed": lambda w, g: w.moved(relaxation=g["length_m"], relaxation_speed=RELAXATION_SPEED),
    },
    "tyre_stiffness_offset": {"unlike_axles": _stiffness},
    "friction_falloff": {"logarithmic": falling(LOGARITHMIC), "slow_to_fall": _slow_to_fall},
    "friction_offset": {"stretches": _stretches("friction_offset")},
    "torque_lag": {
        "swinging": lambda w, g: w.moved(lag=g["time_constant_s"], lag_damping=CURRENT_DAMPING),
        "brakes_later": lambda w, g: w.moved(lag=g["time_constant_s"], lag_sign=LAG_SIGN),
    },
    "torque_delay": {
        "joined_messages": _joined,
        "loaded_bus": lambda w, g: w.moved(delay=g["delay_s"], wait=_wait_of(g["delay_s"])),
    },
    "torque_gain": {
        "unlike_in_braking": _gain(gain_sign=GAIN_SIGN),
        "less_at_speed": _gain(gain_speed=GAIN_SPEED),
    },
    "brake_drag": {
        "each_its_own": lambda w, g: w.moved(brake_drag=g["torque_nm"], brake_share=CALIPERS),
    },
    "driveline_compliance": {
        "shafts": _first("driveline_compliance"),
        "with_play": _shafts(shaft_play=PLAY_RAD),
        "unequal_shafts": _shafts(shaft_tilt=SHAFTS),
    },
    "wheel_speed_delay": _sensor_delays("wheel"),
    "wheel_speed_quantisation": {
        "overlapping_windows": _pulses(wheel_window_parts=PARTS),
        "late_flanks": _pulses(wheel_flanks=LATE_FLANK),
    },
    "vehicle_speed_delay": _sensor_delays("speed"),
    "vehicle_speed_scale": {
        "grows_with_speed": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_growth=SCALE_GROWTH),
        "with_pitch": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_pitch=SCALE_PITCH),
    },
    "accelerometer_bias": {
        "with_vibration": lambda w, g: w.sensed(
            accel_bias_m_s2=g["bias_m_s2"], accel_bias_growth=BIAS_GROWTH
        ),
    },
    "mu_split": {"stretches": _stretches("mu_split")},
}

FOREIGN: dict[str, Foreign] = {
    "brush_uniform": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, BRUSH_UNIFORM, share)),
    "brush_falling": Foreign(
        lambda rng: {"kinetic": float(rng.uniform(0.75, 0.92))},
        lambda world, share, kinetic: with_foreign(world, BRUSH_FALLING, share, kinetic),
    ),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_FOURTH,
    "digits": DIGITS_FOURTH,
    "driver": {"assisted": ASSISTED, "hurried": HURRIED},
}
