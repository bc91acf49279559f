"""What the sixth family adds: each entry is named after the aspect that it is a form of.

Where an effect had one form only, that is the library's and comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .details import PROFILE_STEP_M
from .falling import TWO_RATES
from .forms_second import Apply, Foreign, falling, payload, with_more
from .library import LIBRARY
from .recording_sixth import DIGITS_SIXTH, NOISES_SIXTH
from .styles_sixth import DELIVERY, SAVING, TWO_FEET
from .tyre import BLENDED, PLAIN_DUGOFF, TWO_LINES
from .world import AIR_KG_M3, Array, Parameters, World, with_foreign

FRONT_LIFT = 0.15
"""Of the drag, all of it at the front axle: a small car with a blunt nose."""
CROSS_WIND_M_S = 3.5
"""A fresh breeze from the side, where the car is: less than a weather station says."""
ROLL_LINEAR, ROLL_GROWTH, ROLL_LOAD = 0.05, 0.06, -0.1
"""Of a tyre on the drum: by which its resistance is more at double speed, and with its square; power of the load."""
ROLL_SIDE = 0.15
"""By which the left tyres resist more, nearer the road's edge and its grit."""
BRIDGES_M = (0.0, 85.0, 100.0, 125.0, 140.0, 235.0, 250.0, 275.0, 290.0, 385.0)
BRIDGES = (0.0, 0.0, 0.4, -0.4, 0.0, 0.0, -0.35, 0.35, 0.0, 0.0)
"""How much more or less of a grade there is: a road that has sunk on either side of a bridge, and over a pipe."""
BENDS_M = (0.0, 60.0, 75.0, 95.0, 110.0, 180.0, 195.0, 220.0, 235.0, 275.0, 290.0, 310.0, 325.0)
BENDS = (0.1, 0.1, -0.4, -0.4, 0.1, 0.1, -0.4, -0.4, 0.1, 0.1, -0.4, -0.4, 0.1)
"""The same of a pass, which is flatter in its bends."""
SEATS, LOOSE, LOOSE_HZ = 0.35, 0.4, 1.1
"""Where a load lies; share of it that is loose and sways, and how fast."""
STIFFENED = 0.5
"""By which a tyre's stiffness is more over that by which its load is more."""
RADIUS_SIDES = 0.2
"""More of the deviation on the left: worn by a camber that all roads have."""
INERTIA_POWER = 3.0
"""Of a wheel's inertia over its radius, where wheels of another size are on the car: a little more than a disc of one
width would have without the motor's."""
BODY_RAD_S = 2.0 * np.pi * 1.4
"""Of a comfortable car's body that pitches on its springs."""
AT_ONCE = 0.2
"""Share of the slip that a tyre's force follows at once."""
STIFFNESS_WARM, STIFFNESS_SPEED = 0.15, -0.15
"""Of the deviation: more on warm tyres; less at double speed."""
REPAIRS_M = (30.0, 75.0, 110.0, 125.0, 180.0, 240.0, 265.0, 330.0)
REPAIRS = 0.5
"""Where repairs of a road begin and end in turn; by how much their friction's deviation is more than the rest's."""
GRIP_SPEED = 0.25
"""By which a friction's deviation is more at double speed, as the surface's drainage matters more."""
LAG_RISE, LAG_SIDE = 0.3, 0.2
"""By which torque is built up slower, and let go sooner; by which the motors of one diagonal are slower."""
TASK_S = 0.01
"""Cycle of a motor's controller, of which a mean lag holds half."""
DELAY_SIGN = 0.15
"""By which a delay is more in braking and less in driving."""
SMOOTHED, MOST_SMOOTHED_S = 0.3, 0.008
"""Of a delay: what a filter takes, and its longest time."""
GAINS = np.array([1.25, 0.95, 0.85, 0.95])
"""Each motor has its own gain, the mean is as told."""
GAIN_WARM = 0.15
"""By which a gain's deviation is more of warm magnets."""
HAND_BRAKE = np.array([0.3, 0.3, 1.7, 1.7])
"""The drag is most of it at the rear: a parking brake that is not all released."""
SHAFT_RISE = 0.25
"""By which a shaft with a rubber joint stiffens from rest to a large torque."""
AXLES = 0.1
"""Of a delay, by which the front wheels' is less and the rear ones' more."""
PACED = 0.3
"""Part of a delay that goes with the distance covered."""
JUMPS = 0.12
"""Of a scale's deviation, from one lock of the sensor to the next."""
ROUGH = 0.2
"""Of a bias, by which vibration on coarse stretches adds to it."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _front_lift(world: World, given: Parameters) -> World:
    """All of a lift at the front is a lift in the middle and as much of a moment."""
    p, drag = world.physics, 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    height = 0.5 * FRONT_LIFT * (p.front_arm + p.rear_arm)
    return world.moved(drag=drag, lift=FRONT_LIFT * drag, drag_height=height)


def _rolling(**how: float) -> Apply:
    return lambda world, given: world.moved(roll_moment=given["coefficient"], **how)


def _hilly(places_m: tuple[float, ...], shares: tuple[float, ...]) -> Apply:
    profile = np.interp(np.arange(0.0, places_m[-1], PROFILE_STEP_M), places_m, shares)
    profile -= profile.mean()
    return lambda world, given: world.moved(grade=given["grade"], profile=profile)


def _loose(world: World, given: Parameters) -> World:
    """On the seats, in part not tied down; what a car has less is nothing that could sway."""
    loaded = payload(SEATS)(world, given)
    share = LOOSE * max(given["mass_kg"], 0.0) / loaded.physics.mass
    return loaded.moved(slosh_share=share, slosh_rate=2.0 * np.pi * LOOSE_HZ)


def _stiffening(world: World, given: Parameters) -> World:
    """The longer contact of a loaded tyre is stiffer."""
    p = world.physics
    more = 1.0 + STIFFENED * given["mass_kg"] / p.mass
    loaded = payload(SEATS)(world, given)
    return loaded.moved(stiffness_drive=p.stiffness_drive * more, stiffness_brake=p.stiffness_brake * more)


def _radius_sides(world: World, given: Parameters) -> World:
    more = given["radius_m"] - world.physics.radius
    return world.moved(radius=given["radius_m"], radius_sides=RADIUS_SIDES * more)


def _other_size(world: World, given: Parameters) -> World:
    """Wheels of another size have another inertia too."""
    p = world.physics
    inertia = p.inertia * (given["radius_m"] / p.radius) ** INERTIA_POWER
    return world.moved(radius=given["radius_m"], inertia=inertia)


def _partly_at_once(world: World, given: Parameters) -> World:
    """The rest takes longer, so that a step of the slip covers the length that is told."""
    return world.moved(relaxation=given["length_m"] / (1.0 - AT_ONCE), relaxation_direct=AT_ONCE)


def _stiffness(warm: float, speed: float) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        more = given["stiffness_n"] - world.physics.stiffness_drive
        changed = _first("tyre_stiffness_offset")(world, given)
        return changed.moved(stiffness_warm=warm * more, stiffness_speed=speed * more)

    return apply


def _repaired() -> Array:
    """Repairs and what is between them, none on the whole."""
    places = np.arange(0.0, REPAIRS_M[-1], PROFILE_STEP_M)
    profile = REPAIRS * (np.searchsorted(REPAIRS_M, places, side="right") % 2)
    return np.asarray(profile - profile.mean())


def _grip(effect: str) -> dict[str, Apply]:
    """Another on repairs; more at speed."""
    return {
        "repairs": with_more(effect, blotches=_repaired()),
        "more_at_speed": with_more(effect, grip_speed=GRIP_SPEED),
    }


def _in_a_task(world: World, given: Parameters) -> World:
    """A controller hears of a command only in its next cycle, which is part of what looks like a lag."""
    whole = given["time_constant_s"]
    cycle = min(TASK_S, whole)
    return world.moved(lag=whole - 0.5 * cycle, delay=0.5 * cycle, message=cycle)


def _longer_in_braking(world: World, given: Parameters) -> World:
    return world.moved(delay=given["delay_s"], delay_sign=DELAY_SIGN * given["delay_s"])


def _smoothed(world: World, given: Parameters) -> World:
    """Late, and in part by a filter that spares the gears."""
    lag = min(SMOOTHED * given["delay_s"], MOST_SMOOTHED_S)
    return world.moved(delay=given["delay_s"] - lag, lag=lag)


def _wheel_axles(world: World, given: Parameters) -> World:
    return world.sensed(wheel_delay_s=given["delay_s"], wheel_axles_s=AXLES * given["delay_s"])


def _paced(sensor: str) -> Apply:
    """A part of it is the time for a distance, as of pulses or of a sensor's grid."""

    def apply(world: World, given: Parameters) -> World:
        delay = given["delay_s"]
        return world.sensed(**{f"{sensor}_delay_s": delay, f"{sensor}_paced_s": PACED * delay})

    return apply


def _every_second(world: World, given: Parameters) -> World:
    """The bus is slower than the counter: of two windows one is told."""
    return world.sensed(wheel_teeth=given["teeth"], wheel_window_s=given["window_s"], wheel_window_parts=0.5)


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {
        "front_lift": _front_lift,
        "cross_wind": with_more("aero_drag", drag_cross=CROSS_WIND_M_S),
    },
    "rolling_resistance": {
        "as_on_the_drum": _rolling(roll_linear=ROLL_LINEAR, roll_growth=ROLL_GROWTH, roll_load=ROLL_LOAD),
        "unlike_sides": _rolling(roll_side=ROLL_SIDE),
    },
    "road_grade": {"bridges": _hilly(BRIDGES_M, BRIDGES), "pass": _hilly(BENDS_M, BENDS)},
    "mass_offset": {"loose_load": _loose, "stiffening_tyres": _stiffening},
    "wheel_radius_offset": {"unlike_sides": _radius_sides, "other_size": _other_size},
    "load_transfer": {
        "soft_body": lambda w, g: w.moved(cog_height=g["cog_height_m"], body_rate=BODY_RAD_S),
    },
    "tyre_relaxation": {"partly_at_once": _partly_at_once},
    "tyre_stiffness_offset": {
        "warming": _stiffness(STIFFNESS_WARM, 0.0),
        "less_at_speed": _stiffness(0.0, STIFFNESS_SPEED),
    },
    "friction_falloff": {"two_rates": falling(TWO_RATES)},
    "friction_offset": _grip("friction_offset"),
    "torque_lag": {
        "let_go_sooner": with_more("torque_lag", lag_rise=LAG_RISE),
        "each_its_own": with_more("torque_lag", lag_side=LAG_SIDE),
        "in_a_task": _in_a_task,
    },
    "torque_delay": {"longer_in_braking": _longer_in_braking, "smoothed": _smoothed},
    "torque_gain": {
        "each_its_own": lambda w, g: w.moved(gain=1.0 + (g["factor"] - 1.0) * GAINS),
        "warming": with_more("torque_gain", gain_warm=GAIN_WARM),
    },
    "brake_drag": {"hand_brake": lambda w, g: w.moved(brake_drag=g["torque_nm"], brake_share=HAND_BRAKE)},
    "driveline_compliance": {"rubber_joints": with_more("driveline_compliance", shaft_rise=SHAFT_RISE)},
    "wheel_speed_delay": {"unlike_axles": _wheel_axles, "older_when_slow": _paced("wheel")},
    "wheel_speed_quantisation": {"every_second_window": _every_second},
    "vehicle_speed_delay": {"older_when_slow": _paced("speed")},
    "vehicle_speed_scale": {
        "in_jumps": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_jumps=JUMPS),
    },
    "accelerometer_bias": {
        "on_coarse_stretches": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_bias_grain=ROUGH),
    },
    "mu_split": _grip("mu_split"),
}

FOREIGN: dict[str, Foreign] = {
    "blended": Foreign(
        lambda rng: {"order": float(rng.uniform(1.7, 3.0))},
        lambda world, share, order: with_foreign(world, BLENDED, share, order),
    ),
    "two_lines": Foreign(
        lambda rng: {"sliding": float(rng.uniform(0.7, 0.9))},
        lambda world, share, sliding: with_foreign(world, TWO_LINES, share, sliding),
    ),
    "plain_dugoff": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, PLAIN_DUGOFF, share)),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_SIXTH,
    "digits": DIGITS_SIXTH,
    "driver": {"delivery": DELIVERY, "saving": SAVING, "two_feet": TWO_FEET},
}
