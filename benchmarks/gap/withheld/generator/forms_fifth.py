"""What the fifth family adds: each entry is named after the aspect that it is a form of.

Where an effect had one form only, that is the library's and comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import lfilter

from .details import PROFILE_STEP_M, USUAL_RAD_S
from .falling import ARCTANGENT
from .forms_second import Apply, Foreign, falling, payload, with_more
from .kernel import COMMAND_STEP_S, GRAVITY
from .library import LIBRARY
from .outside import WIND_S
from .recording_fifth import DIGITS_FIFTH, NOISES_FIFTH
from .styles_fifth import LEARNER, ROBOT, WINTER
from .tyre import CUBED, HYPERBOLIC_TANGENT
from .world import AIR_KG_M3, Array, Parameters, World, with_foreign

SHUTTERS = -0.06
"""What shutters before the radiator take of a drag at speed, and add at low speed."""
BREEZES = ((1.3, 13.0, 0.7), (0.7, 5.6, 2.1))
"""Of a light wind that turns: size [m/s], period [s], phase."""
TEXTURE, ROLL_TILT = 0.25, 0.2
"""By which a coarse road's rolling resistance is more; by which the front tyres' is more than their share."""
CURVE_M = 340.0
"""From one crest to the next, with even curvature between."""
CURVED, SURVEYED = 0.35, 0.3
"""How much more or less of a grade there is at most."""
HITCH, REAR_SEATS = 1.7, 0.5
"""Where a load lies, as a share of the way to the rear axle: on a carrier behind the car, and in it."""
SINKING_M_N = 4e-7
"""By which a rolling radius is less under a load: a tenth of what the tyre gives way."""
RADIUS_SIDE, RADIUS_TILT = 0.2, 0.1
"""More of the deviation at one diagonal and at the front, as of pressures that nobody has looked at."""
ROTOR_SHARE, ROTOR_HZ, ROTOR_DAMPING = 0.5, 55.0, 0.1
"""Of the deviation that turns with the motor on its shaft; at what frequency, and how damped, over the critical one."""
INERTIA_SIDE, INERTIA_TILT = 0.2, -0.1
SPRINGS_S, DIVING = 0.05, 0.35
"""How late the loads follow, and by how much sooner where the nose dives, and later where it lifts."""
RELAXATION_TILT = 0.2
"""More of the length at the front, with tyres of another size behind."""
STIFFNESS_SIGN, STIFFNESS_SIDE = 0.12, 0.2
"""Of the deviation: more in driving and less in braking; more at one diagonal."""
BLOTCHES_M, BLOTCHES = (420.0, 9.0), 0.45
"""Length of a road's repair and the distance over which it changes; how much more or less of a deviation at most."""
CLEARED = 0.15
"""Of a friction's deviation, more under the front wheels: the rear ones go where those have cleared the road."""
LAG_TILT, LAG_SPEED = 0.25, 0.2
"""By which the front motors are slower; by which all are at double speed, as the field is weakened."""
DELAY_TILT, MESSAGE_S, LOST = 0.1, 0.02, 0.08
"""By which the front motors' delay is more; the cycle of messages, at most the delay, and the share that is lost."""
GAIN_SIDES = np.array([1.2, 0.8, 1.2, 0.8])
"""Left and right differ, their mean does not."""
GAIN_LOAD = -0.2
"""By which a gain's deviation is more at double torque, as the iron saturates."""
RELEASE = 0.25
"""By which a brake's drag is less at double speed."""
RUBBING_NM, SHAFT_AXLES = 1.5, 0.15
"""Friction of a shaft's joints; by which the front shafts are the stiffer ones."""
TURN_S, EPOCH_S = 0.006, 0.1
"""From the mean to the wheel that is read last; of a satellite receiver; each no more than the delay."""
ENDS_SOONER, SCATTER = 0.1, 0.1
"""Of a window, at most, by a task that is not always on time; of the teeth's places."""
GRAIN, WARMING = 0.15, 0.12
"""Of a scale's deviation: on coarse stretches; before and after the sensor is warm."""
WANDER = 0.25
"""Of a bias, by which it wanders."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _shutters(world: World, given: Parameters) -> World:
    return _first("aero_drag")(world, given).moved(drag_fast=SHUTTERS)


def _breeze(world: World, given: Parameters) -> World:
    """A drag in air that itself moves a little, now with the car and now against it."""
    clock = np.arange(0.0, WIND_S, COMMAND_STEP_S)
    wind = sum(size * np.sin(2.0 * np.pi * clock / period + phase) for size, period, phase in BREEZES)
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(drag=drag, gust_drag=drag, wind=wind)


def _noise_along(length_m: float, over_m: float, most: float, seed: int) -> Array:
    """Smooth and of chance, closed in a ring, none on the whole, `most` at most."""
    rows = round(length_m / PROFILE_STEP_M)
    keep = np.exp(-PROFILE_STEP_M / over_m)
    pushes = np.tile(np.random.default_rng(seed).standard_normal(rows), 3)
    wave = lfilter([1.0], [1.0, -2.0 * keep, keep**2], pushes)[-rows:]
    wave -= wave.mean()
    return np.asarray(most * wave / np.abs(wave).max())


def _curved() -> Array:
    """Crests and sags: parabolas, so that the grade goes straight up and down."""
    phase = np.arange(0.0, 1.0, PROFILE_STEP_M / CURVE_M)
    return CURVED * (4.0 * np.abs(phase - 0.5) - 1.0)


def _hilly(profile: Array) -> Apply:
    mean_free = profile - profile.mean()
    return lambda world, given: world.moved(grade=given["grade"], profile=mean_free)


def _sinking(world: World, given: Parameters) -> World:
    """On the rear seats; the tyres below roll on a radius that is a little less."""
    loaded = payload(REAR_SEATS)(world, given)
    weight = given["mass_kg"] * GRAVITY
    rear = weight * (world.physics.front_arm + REAR_SEATS * world.physics.rear_arm)
    rear /= world.physics.front_arm + world.physics.rear_arm
    less = 0.5 * SINKING_M_N * np.array([weight - rear, rear])
    return loaded.moved(radius=world.physics.radius - less.mean(), radius_tilt=0.5 * float(less[1] - less[0]))


def _radius(world: World, given: Parameters) -> World:
    more = given["radius_m"] - world.physics.radius
    return world.moved(
        radius=given["radius_m"], radius_side=RADIUS_SIDE * more, radius_tilt=RADIUS_TILT * more
    )


def _rotor(world: World, given: Parameters) -> World:
    """A part of what is more, or is left, is the motor's and turns on a shaft that gives way a little."""
    rotor = ROTOR_SHARE * abs(given["inertia_kg_m2"] - world.physics.inertia)
    series = rotor * (given["inertia_kg_m2"] - rotor) / given["inertia_kg_m2"]
    stiffness = max((2.0 * np.pi * ROTOR_HZ) ** 2 * series, 1.0)
    return world.moved(
        inertia=given["inertia_kg_m2"],
        motor_inertia=rotor,
        shaft_stiffness=stiffness,
        shaft_damping=2.0 * ROTOR_DAMPING * float(np.sqrt(stiffness * series)),
    )


def _inertia(world: World, given: Parameters) -> World:
    more = given["inertia_kg_m2"] - world.physics.inertia
    return world.moved(
        inertia=given["inertia_kg_m2"], inertia_side=INERTIA_SIDE * more, inertia_tilt=INERTIA_TILT * more
    )


def _stiffness(sign: float, side: float) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        told, more = given["stiffness_n"], given["stiffness_n"] - world.physics.stiffness_drive
        return world.moved(
            stiffness_drive=told + sign * more,
            stiffness_brake=told - sign * more,
            stiffness_side=side * more,
        )

    return apply


def _grip(effect: str) -> dict[str, Apply]:
    """In blotches of chance; more of it under the front wheels."""
    blotches = _noise_along(*BLOTCHES_M, BLOTCHES, seed=5)
    return {
        "blotches": lambda world, given: _first(effect)(world, given).moved(blotches=blotches),
        "cleared": lambda world, given: _first(effect)(world, given).moved(grip_tilt=CLEARED),
    }


def _losing(world: World, given: Parameters) -> World:
    """Messages of which some are lost; without those it would be less late."""
    message = min(MESSAGE_S, given["delay_s"])
    return world.moved(delay=given["delay_s"] - LOST * message, message=message, message_lost=LOST)


def _sensor_losing(sensor: str) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        message = min(MESSAGE_S, given["delay_s"])
        waiting = LOST / (1.0 - LOST) * message
        return world.sensed(
            **{
                f"{sensor}_delay_s": given["delay_s"] - waiting,
                f"{sensor}_message_s": message,
                f"{sensor}_lost": LOST,
            }
        )

    return apply


def _epochs(world: World, given: Parameters) -> World:
    """Of a receiver that tells the mean over an epoch at its end."""
    epoch = min(EPOCH_S, given["delay_s"])
    return world.sensed(speed_delay_s=given["delay_s"], speed_average_s=epoch, speed_message_s=epoch)


def _in_turn(world: World, given: Parameters) -> World:
    return world.sensed(wheel_delay_s=given["delay_s"], wheel_turn_s=min(TURN_S, given["delay_s"]))


def _pulses(**how: Any) -> Apply:
    return lambda w, g: w.sensed(wheel_teeth=g["teeth"], wheel_window_s=g["window_s"], **how)


def _late_task(world: World, given: Parameters) -> World:
    """Windows that end sooner by the time of a pulse at most, so that the pulses are what shows."""
    pulses = USUAL_RAD_S * given["teeth"] * given["window_s"] / (2.0 * np.pi)
    return _pulses(wheel_window_jitter=min(ENDS_SOONER, 1.0 / max(pulses, 1.0)))(world, given)


def _tilted(world: World, given: Parameters) -> World:
    """A bias that is gravity's: the sensor is mounted askew, and reads a little less of all else."""
    lean = min(abs(given["bias_m_s2"]) / GRAVITY, 1.0)
    return world.sensed(accel_bias_m_s2=given["bias_m_s2"], accel_scale=float(np.sqrt(1.0 - lean**2)))


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"shutters": _shutters, "breeze": _breeze},
    "rolling_resistance": {
        "coarse_stretches": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_texture=TEXTURE),
        "unlike_axles": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_tilt=ROLL_TILT),
    },
    "road_grade": {
        "crests": _hilly(_curved()),
        "surveyed": _hilly(_noise_along(600.0, 30.0, SURVEYED, seed=8)),
    },
    "mass_offset": {"carrier": payload(HITCH), "sinking_tyres": _sinking},
    "wheel_radius_offset": {"each_its_own": _radius},
    "wheel_inertia_offset": {"rotor_on_shaft": _rotor, "each_its_own": _inertia},
    "load_transfer": {
        "dives_sooner": lambda w, g: w.moved(
            cog_height=g["cog_height_m"], pitch_time=SPRINGS_S, pitch_sign=DIVING
        ),
    },
    "tyre_relaxation": {"unlike_axles": with_more("tyre_relaxation", relaxation_tilt=RELAXATION_TILT)},
    "tyre_stiffness_offset": {
        "unlike_in_braking": _stiffness(STIFFNESS_SIGN, 0.0),
        "each_its_own": _stiffness(0.0, STIFFNESS_SIDE),
    },
    "friction_falloff": {"arctangent": falling(ARCTANGENT)},
    "friction_offset": _grip("friction_offset"),
    "torque_lag": {
        "unlike_axles": with_more("torque_lag", lag_tilt=LAG_TILT),
        "slower_at_speed": with_more("torque_lag", lag_speed=LAG_SPEED),
    },
    "torque_delay": {
        "unlike_axles": lambda w, g: w.moved(delay=g["delay_s"], delay_tilt=DELAY_TILT * g["delay_s"]),
        "losing_messages": _losing,
    },
    "torque_gain": {
        "unlike_sides": lambda w, g: w.moved(gain=1.0 + (g["factor"] - 1.0) * GAIN_SIDES),
        "saturating": with_more("torque_gain", gain_load=GAIN_LOAD),
    },
    "brake_drag": {"knocked_back": with_more("brake_drag", brake_release=RELEASE)},
    "driveline_compliance": {
        "rubbing_joints": with_more("driveline_compliance", shaft_friction=RUBBING_NM),
        "unlike_axles": with_more("driveline_compliance", shaft_axles=SHAFT_AXLES),
    },
    "wheel_speed_delay": {"in_turn": _in_turn, "losing_messages": _sensor_losing("wheel")},
    "wheel_speed_quantisation": {
        "late_task": _late_task,
        "scattered_teeth": _pulses(wheel_scatter=SCATTER),
    },
    "vehicle_speed_delay": {"epochs": _epochs, "losing_messages": _sensor_losing("speed")},
    "vehicle_speed_scale": {
        "on_coarse_stretches": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_grain=GRAIN),
        "warming": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_warming=WARMING),
    },
    "accelerometer_bias": {
        "tilted": _tilted,
        "wandering": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_wander=WANDER),
    },
    "mu_split": _grip("mu_split"),
}

FOREIGN: dict[str, Foreign] = {
    "cubed": Foreign(
        lambda rng: {"curvature": float(rng.uniform(-0.2, 0.5))},
        lambda world, share, curvature: with_foreign(world, CUBED, share, curvature),
    ),
    "hyperbolic_tangent": Foreign(
        lambda rng: {}, lambda world, share: with_foreign(world, HYPERBOLIC_TANGENT, share)
    ),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_FIFTH,
    "digits": DIGITS_FIFTH,
    "driver": {"robot": ROBOT, "learner": LEARNER, "winter": WINTER},
}
