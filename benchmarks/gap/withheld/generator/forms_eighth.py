"""What the eighth family adds: each entry is named after the aspect that it is a form of."""

from __future__ import annotations

from typing import Any

import numpy as np

from .forms_second import Apply, Foreign, with_more
from .library import LIBRARY
from .recording_eighth import DIGITS_EIGHTH, NOISES_EIGHTH
from .styles_eighth import TRAINING
from .tyre import BRISTLES, COMPOSITE
from .world import Parameters, World, with_foreign

DRAG_POWER = -0.08
"""Power of the speed that a drag coefficient goes with, as it falls with the Reynolds number."""
ROLL_TORQUE = 0.1
"""By which a tyre resists more at the usual torque, with its square: a tread that creeps under it."""
SLAB_M, SETTLED = 16.0, 0.35
"""Length of a road's slabs, and how much more or less of a grade there is as they settle."""
RADIUS_LOAD = 0.5
"""Part of a radius' deviation that is the tyre's deflection and so goes with the load."""
STIFFNESS_WET, FALLOFF_WET = -0.3, 0.3
"""Of a deviation: less on a film of water or on ice; of a falloff: sooner there."""
GRIP_WET = 0.15
"""By which a friction's deviation is more on slippery road and less on dry."""
LAG_ZERO = 0.5
"""By which a motor is slower about no torque, where it lets its gears change sides gently."""
DELAY_QUEUE = 0.15
"""Of a delay, by which it is more while a queue holds more, and less else."""
GAIN_HUNTS = 0.15
"""Of a gain's deviation, by which it goes to and fro with the estimate of the motor's flux."""
CIRCUIT = np.array([1.6, 0.4, 0.4, 1.6])
"""The drag is most of it in one of two circuits, which go from corner to corner."""
SHAFT_SIGN = 0.15
"""By which a driveline is stiffer in driving and softer in braking, as its mounts are."""
FILTER_SHARE, FILTER_S = 0.4, 0.015
"""Of a delay: what each of two filters takes, and its longest time."""
SLOW_SHARE = 0.4
"""Share of the usual pulses below which a counter takes two windows."""
EPOCH_S = 0.1
"""Of a satellite receiver; no more than the delay, as straight lines wait for the next."""
TABLE = 0.15
"""Of a scale's deviation, by which it is more and less between a calibration's points."""
AIRED = 0.2
"""Of a bias, by which it is less at double speed, after a while in the air stream."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _slabs(world: World, given: Parameters) -> World:
    return world.moved(grade=given["grade"], wave_slope=SETTLED * given["grade"], wave_length=SLAB_M)


def _deflecting(world: World, given: Parameters) -> World:
    more = given["radius_m"] - world.physics.radius
    return world.moved(radius=given["radius_m"], radius_load=RADIUS_LOAD * more)


def _stiffness(world: World, given: Parameters) -> World:
    more = given["stiffness_n"] - world.physics.stiffness_drive
    return _first("tyre_stiffness_offset")(world, given).moved(stiffness_wet=STIFFNESS_WET * more)


def _smoothed_twice(world: World, given: Parameters) -> World:
    delay = given["delay_s"]
    return world.sensed(
        wheel_delay_s=delay, wheel_filter_s=min(FILTER_SHARE * delay, FILTER_S), wheel_filter_twice=True
    )


def _longer_when_slow(world: World, given: Parameters) -> World:
    return world.sensed(
        wheel_teeth=given["teeth"], wheel_window_s=given["window_s"], wheel_window_slow=SLOW_SHARE
    )


def _joined_epochs(world: World, given: Parameters) -> World:
    delay = given["delay_s"]
    return world.sensed(speed_delay_s=delay, speed_message_s=min(EPOCH_S, delay), speed_joined=True)


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"less_when_fast": with_more("aero_drag", drag_power=DRAG_POWER)},
    "rolling_resistance": {
        "more_under_torque": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_torque=ROLL_TORQUE),
    },
    "road_grade": {"settled_slabs": _slabs},
    "wheel_radius_offset": {"deflecting": _deflecting},
    "tyre_stiffness_offset": {"less_when_wet": _stiffness},
    "friction_falloff": {"sooner_when_wet": with_more("friction_falloff", falloff_wet=FALLOFF_WET)},
    "friction_offset": {"more_when_wet": with_more("friction_offset", grip_wet=GRIP_WET)},
    "torque_lag": {"gentle_about_zero": with_more("torque_lag", lag_zero=LAG_ZERO)},
    "torque_delay": {
        "queue": lambda w, g: w.moved(delay=g["delay_s"], delay_jump=DELAY_QUEUE * g["delay_s"]),
    },
    "torque_gain": {"hunting": with_more("torque_gain", gain_sway=GAIN_HUNTS)},
    "brake_drag": {
        "one_circuit": lambda w, g: w.moved(brake_drag=g["torque_nm"], brake_share=CIRCUIT),
    },
    "driveline_compliance": {"softer_in_braking": with_more("driveline_compliance", shaft_sign=SHAFT_SIGN)},
    "wheel_speed_delay": {"smoothed_twice": _smoothed_twice},
    "wheel_speed_quantisation": {"longer_when_slow": _longer_when_slow},
    "vehicle_speed_delay": {"joined_epochs": _joined_epochs},
    "vehicle_speed_scale": {
        "by_table": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_table=TABLE),
    },
    "accelerometer_bias": {
        "aired": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_bias_aired=AIRED),
    },
    "mu_split": {"more_when_wet": with_more("mu_split", grip_wet=GRIP_WET)},
}

FOREIGN: dict[str, Foreign] = {
    "bristles": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, BRISTLES, share)),
    "composite": Foreign(
        lambda rng: {"fading": float(rng.uniform(0.08, 0.25))},
        lambda world, share, fading: with_foreign(world, COMPOSITE, share, fading),
    ),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_EIGHTH,
    "digits": DIGITS_EIGHTH,
    "driver": {"training": TRAINING},
}
