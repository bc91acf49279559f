"""What the seventh family adds: each entry is named after the aspect that it is a form of.

Where an effect had one form only, that is the library's and comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .details import PROFILE_STEP_M
from .falling import ROOTED
from .forms_second import AVERAGE_S, Apply, Foreign, falling, payload, with_more
from .library import LIBRARY
from .recording_seventh import DIGITS_SEVENTH, NOISES_SEVENTH
from .styles_seventh import OVERTAKING
from .tyre import ARCTANGENT, SINE_RISE
from .world import Parameters, World, with_foreign

WAKE = 0.15
"""Of the drag: less behind others, and more between them."""
ROLL_WARM = -0.15
"""By which a rolling resistance is more of warm tyres."""
HILL_M, HILL = (0.0, 30.0, 200.0, 240.0, 270.0), (-0.3, -0.3, 0.4, 0.0, -0.3)
"""How much more or less of a grade there is: a hill that is ever steeper, up to its top."""
FLOOR_BEHIND, FLOOR_M = -0.2, -0.25
"""Where a larger battery lies, as a share of the way to the rear axle; its height over the centre of gravity."""
FLOOR_SEATS, SENSITIVITY = 0.35, -0.12
"""Where a load lies; power of the load that a tyre's friction goes with."""
RADIUS_WARM = -0.1
"""By which a radius' deviation is more of warm tyres: their pressure comes nearer to what it should be."""
SPARE = 0.3
"""By which three wheels have more of a deviation, the fourth the less: it has not been changed."""
RUB_M_S2, SPRINGS_S = 0.6, 0.06
"""What the dampers' friction carries before the springs move; how late those are."""
RELAXATION_WARM = -0.12
"""By which a relaxation length is more of warm tyres, whose pressure is higher."""
STIFFNESS_TEXTURE = 0.2
"""Of the deviation: more on coarse asphalt and less between."""
DRYING, WEAVING = -0.2, 0.25
"""By which a friction's deviation is more after a while; by which it is more on one side of the lane."""
LAG_LOAD, LAG_DIRECT = 0.25, 0.2
"""By which a lag is more at double torque, as the voltage is what limits; share of the torque that is there at once."""
TURN_S = 0.006
"""From the mean to the wheel that is told last, no more than the delay."""
GAIN_MAP = 0.12
"""By which a gain's deviation is more and less between the points of a torque map."""
BRAKE_WARM = 0.2
"""By which a dragging brake drags more when it has warmed itself."""
QUEUE = 0.15
"""Of a delay, by which it is more while a gateway's queue holds one more."""
SHAKES = 0.3
"""By how much a sensor moves as the wheel hops [teeth]."""
WANDER, MEMORY = 0.2, 0.2
"""Of a scale's deviation, by which it wanders; of a bias, by which it is more after one direction than the other."""


def _first(effect: str) -> Apply:
    return LIBRARY[effect].apply


def _hill(world: World, given: Parameters) -> World:
    profile = np.interp(np.arange(0.0, HILL_M[-1], PROFILE_STEP_M), HILL_M, HILL)
    return world.moved(grade=given["grade"], profile=profile - profile.mean())


def _floor(world: World, given: Parameters) -> World:
    """Low, and a little ahead; the height counts only where loads shift at all."""
    loaded = payload(FLOOR_BEHIND)(world, given)
    p = loaded.physics
    down = FLOOR_M * given["mass_kg"] / p.mass if p.cog_height > 0.0 else 0.0
    return loaded.moved(cog_height=p.cog_height + down)


def _load_sensitive(world: World, given: Parameters) -> World:
    """Rubber that is pressed harder grips a little less for its load."""
    p = world.physics
    grip = (1.0 + given["mass_kg"] / p.mass) ** SENSITIVITY
    loaded = payload(FLOOR_SEATS)(world, given)
    return loaded.moved(factor_left=p.factor_left * grip, factor_right=p.factor_right * grip)


def _radius_warming(world: World, given: Parameters) -> World:
    more = given["radius_m"] - world.physics.radius
    return world.moved(radius=given["radius_m"], radius_warm=RADIUS_WARM * more)


def _spare(world: World, given: Parameters) -> World:
    """The right rear wheel is the one with a tenth of the deviation."""
    part = SPARE * (given["inertia_kg_m2"] - world.physics.inertia)
    return world.moved(
        inertia=given["inertia_kg_m2"], inertia_tilt=-part, inertia_side=-part, inertia_sides=part
    )


def _sticking(world: World, given: Parameters) -> World:
    return world.moved(
        cog_height=given["cog_height_m"], springs_share=1.0, springs_time=SPRINGS_S, springs_rub=RUB_M_S2
    )


def _texture(world: World, given: Parameters) -> World:
    more = given["stiffness_n"] - world.physics.stiffness_drive
    return _first("tyre_stiffness_offset")(world, given).moved(stiffness_texture=STIFFNESS_TEXTURE * more)


def _partly_at_once(world: World, given: Parameters) -> World:
    """The rest takes longer, so that a step of the torque lacks as much as is told."""
    return world.moved(lag=given["time_constant_s"] / (1.0 - LAG_DIRECT), lag_direct=LAG_DIRECT)


def _at_motor(world: World, given: Parameters) -> World:
    """The speed is that of the motor's own sensor; where nothing gives way, it is the wheel's."""
    shafts = _first("driveline_compliance")(world, given)
    return shafts.sensed(wheel_at_motor=given["motor_inertia_kg_m2"] > 0.0)


def _queue(world: World, given: Parameters) -> World:
    return world.sensed(wheel_delay_s=given["delay_s"], wheel_queue_s=QUEUE * given["delay_s"])


def _shaking(world: World, given: Parameters) -> World:
    return world.sensed(wheel_teeth=given["teeth"], wheel_window_s=given["window_s"], wheel_shakes=SHAKES)


def _averaged_twice(world: World, given: Parameters) -> World:
    """A mean that another device takes the mean of; no longer than the delay, so that neither sees ahead."""
    delay = given["delay_s"]
    return world.sensed(
        speed_delay_s=delay, speed_average_s=min(AVERAGE_S, delay), speed_average_twice=delay > 0.0
    )


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"in_traffic": with_more("aero_drag", drag_wake=WAKE)},
    "rolling_resistance": {
        "warming": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_warm=ROLL_WARM),
    },
    "road_grade": {"ever_steeper": _hill},
    "mass_offset": {"in_the_floor": _floor, "load_sensitive_tyres": _load_sensitive},
    "wheel_radius_offset": {"warming": _radius_warming},
    "wheel_inertia_offset": {"spare_wheel": _spare},
    "load_transfer": {"sticking_dampers": _sticking},
    "tyre_relaxation": {"warming": with_more("tyre_relaxation", relaxation_warm=RELAXATION_WARM)},
    "tyre_stiffness_offset": {"on_coarse_stretches": _texture},
    "friction_falloff": {"rooted": falling(ROOTED)},
    "friction_offset": {"drying": with_more("friction_offset", grip_warm=DRYING)},
    "torque_lag": {
        "longer_for_much": with_more("torque_lag", lag_load=LAG_LOAD),
        "partly_at_once": _partly_at_once,
    },
    "torque_delay": {
        "in_turn": lambda w, g: w.moved(delay=g["delay_s"], delay_turn=min(TURN_S, g["delay_s"])),
    },
    "torque_gain": {"by_map": with_more("torque_gain", gain_map=GAIN_MAP)},
    "brake_drag": {"warming": with_more("brake_drag", brake_warm=BRAKE_WARM)},
    "driveline_compliance": {"read_at_motor": _at_motor},
    "wheel_speed_delay": {"queue": _queue},
    "wheel_speed_quantisation": {"shaking_sensor": _shaking},
    "vehicle_speed_delay": {"averaged_twice": _averaged_twice},
    "vehicle_speed_scale": {
        "wandering": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_wander=WANDER),
    },
    "accelerometer_bias": {
        "remembering": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_bias_memory=MEMORY),
    },
    "mu_split": {"weaving": with_more("mu_split", grip_sway=WEAVING)},
}

FOREIGN: dict[str, Foreign] = {
    "sine_rise": Foreign(
        lambda rng: {"sliding": float(rng.uniform(0.72, 0.9))},
        lambda world, share, sliding: with_foreign(world, SINE_RISE, share, sliding),
    ),
    "arctangent": Foreign(lambda rng: {}, lambda world, share: with_foreign(world, ARCTANGENT, share)),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_SEVENTH,
    "digits": DIGITS_SEVENTH,
    "driver": {"overtaking": OVERTAKING},
}
