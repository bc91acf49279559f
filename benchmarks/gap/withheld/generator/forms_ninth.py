"""What the ninth family adds: each entry is named after the aspect that it is a form of."""

from __future__ import annotations

from typing import Any

from .forms_second import Apply, Foreign, payload, with_more
from .recording_ninth import DIGITS_NINTH, NOISES_NINTH
from .styles_ninth import CRUISE_CONTROL
from .tyre import BRUSH_ELLIPTIC, SPLINED
from .world import Parameters, World, with_foreign

SHELTER = 0.15
"""Of the drag: less between walls or woods, and more where a light wind can reach."""
ROLL_SLOW = 0.4
"""By which seals and grease add to what a tyre resists, at a standstill; none at speed."""
SEATS, ASIDE_M, HALF_TRACK_M = 0.3, 0.4, 0.75
"""Where a load lies on the seats, how far to the left, and half of a car's track."""
RADIUS_WET = -0.25
"""Of a deviation: less on wet road and snow, where the tread does not stand on the stones alone."""
INERTIA_SPEED = 0.25
"""Of a deviation, by which it is more at double speed: a sealant in the tyres that spreads outward."""
HEIGHT_JACK = 0.12
"""By which links lift the body in driving and draw it down in braking, over the height."""
RELAXATION_RISE = 0.2
"""By which a tyre takes longer to build its force up, and less to let it go."""
GRIP_SIGN, GRIP_SLIDE = -0.15, -0.25
"""Of a friction's deviation: more in braking, by the tread's direction; less where a tyre sweeps sand away."""
LAG_WARM = -0.2
"""By which a lag is less of warm oil."""
DELAY_PACED = 0.2
"""Part of a delay that is a motor's own turn, at whose steps it is told anew."""
GAIN_TURN = 0.2
"""Of a gain's deviation, by which it is more and less over a turn, as a rotor's angle is read a little off."""
BRAKE_WET = -0.25
"""By which a brake drags less with water or snow on its disc."""
SHAFT_TURN = 0.15
"""By which a shaft stiffens and softens twice in a turn, as its joints are bent."""
MEDIAN_S = 0.05
"""Time whose middle value a reading is; at most twice the delay, so that it sees nothing ahead."""
EPOCH_S = 0.1
"""Of a receiver that goes on from each fix as from the last one to it; no more than the delay."""
MOUNT = 0.3
"""Of a scale's deviation, by which it is more where a bracket shakes."""
JUMPS = 0.2
"""Of a bias, by which a sensor's beam goes from one stress to another and back."""


def _on_one_side(world: World, given: Parameters) -> World:
    """On the seats of the driver's side: the left tyres carry more of it."""
    loaded = payload(SEATS)(world, given)
    return loaded.moved(load_side=given["mass_kg"] * ASIDE_M / (loaded.physics.mass * HALF_TRACK_M))


def _radius(world: World, given: Parameters) -> World:
    more = given["radius_m"] - world.physics.radius
    return world.moved(radius=given["radius_m"], radius_wet=RADIUS_WET * more)


def _inertia(world: World, given: Parameters) -> World:
    more = given["inertia_kg_m2"] - world.physics.inertia
    return world.moved(inertia=given["inertia_kg_m2"], inertia_speed=INERTIA_SPEED * more)


def _median(world: World, given: Parameters) -> World:
    delay = given["delay_s"]
    return world.sensed(wheel_delay_s=delay, wheel_median_s=min(MEDIAN_S, 2.0 * delay))


def _extrapolated(world: World, given: Parameters) -> World:
    delay = given["delay_s"]
    return world.sensed(speed_delay_s=delay, speed_message_s=min(EPOCH_S, delay), speed_extrapolated=True)


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"sheltered_stretches": with_more("aero_drag", drag_shelter=SHELTER)},
    "rolling_resistance": {
        "seals_when_slow": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_slow=ROLL_SLOW),
    },
    "mass_offset": {"on_one_side": _on_one_side},
    "wheel_radius_offset": {"less_when_wet": _radius},
    "wheel_inertia_offset": {"more_at_speed": _inertia},
    "load_transfer": {"jacking_links": with_more("load_transfer", height_jack=HEIGHT_JACK)},
    "tyre_relaxation": {"let_go_sooner": with_more("tyre_relaxation", relaxation_rise=RELAXATION_RISE)},
    "friction_offset": {"more_in_braking": with_more("friction_offset", grip_sign=GRIP_SIGN)},
    "torque_lag": {"less_when_warm": with_more("torque_lag", lag_warm=LAG_WARM)},
    "torque_delay": {
        "older_when_slow": lambda w, g: w.moved(delay=g["delay_s"], delay_speed=DELAY_PACED * g["delay_s"]),
    },
    "torque_gain": {"over_a_turn": with_more("torque_gain", gain_turn=GAIN_TURN)},
    "brake_drag": {"less_when_wet": with_more("brake_drag", brake_wet=BRAKE_WET)},
    "driveline_compliance": {"bent_joints": with_more("driveline_compliance", shaft_turn=SHAFT_TURN)},
    "wheel_speed_delay": {"median": _median},
    "vehicle_speed_delay": {"extrapolated_epochs": _extrapolated},
    "vehicle_speed_scale": {
        "shaking_bracket": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_mount=MOUNT),
    },
    "accelerometer_bias": {
        "in_jumps": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_bias_jumps=JUMPS),
    },
    "mu_split": {"swept_away": with_more("mu_split", grip_slide=GRIP_SLIDE)},
}

FOREIGN: dict[str, Foreign] = {
    "brush_elliptic": Foreign(
        lambda rng: {}, lambda world, share: with_foreign(world, BRUSH_ELLIPTIC, share)
    ),
    "splined": Foreign(
        lambda rng: {"stretch": float(rng.uniform(1.7, 2.8)), "sliding": float(rng.uniform(0.7, 0.9))},
        lambda world, share, stretch, sliding: with_foreign(world, SPLINED, share, stretch, sliding),
    ),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_NINTH,
    "digits": DIGITS_NINTH,
    "driver": {"cruise_control": CRUISE_CONTROL},
}
