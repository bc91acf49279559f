"""What the tenth family adds: each entry is named after the aspect that it is a form of."""

from __future__ import annotations

from typing import Any

from .details import USUAL_RAD_S
from .falling import LINE_AND_TAIL
from .forms_second import Apply, Foreign, falling, with_more
from .library import LIBRARY
from .recording_tenth import DIGITS_TENTH, NOISES_TENTH
from .styles_tenth import COMMUTER
from .tyre import HUMPED
from .world import Parameters, World, with_foreign

NOD = 0.1
"""By which a drag is more of a car that squats, and less of one that dives."""
FLAT = 0.3
"""Of a tyre's resistance over a turn, where it has stood for weeks."""
ONE_OTHER = 0.25
"""By which three wheels have more of a radius' deviation, the fourth the less: its tyre has not been changed."""
SPRINGS_S, STOPS = 0.06, 0.8
"""How late the loads follow on the springs alone, and by how much sooner once the body is at their stops."""
RELAXATION_SIDE, STIFFNESS_SIDES = 0.2, 0.2
"""More of a relaxation length at one diagonal, by pressures; of a stiffness' deviation on the left, by wear."""
GRIP_LOAD = -0.3
"""By which a friction's deviation is less under double load, which presses a film away."""
THAWING = -0.25
"""By which one side's friction deviates less after a while."""
TAIL, TAIL_TIMES = 0.25, 2.0
"""Share of a torque that comes later than the rest, and its lag over the mean."""
DELAY_WARM = 0.15
"""By which a delay is more after a while, as a controller has more and more to do."""
GAIN_POWER = 0.15
"""By which a gain's deviation is more at double power, as the battery's voltage sags."""
SHAKEN = -0.25
"""By which a brake drags less on coarse asphalt, which shakes its pads free."""
SHAFT_WARM = -0.12
"""By which a shaft with rubber in it is softer when that has warmed."""
MEAN_S = 0.03
"""Of wheel speeds that are told as their mean since the last message; no more than the delay."""
HALVES = 1.0
"""Speed above which a sensor hands on every second pulse only, over the usual one."""
FIT_S = 0.2
"""Over which a speed is a line through places; at most twice the delay, so that it sees nothing ahead."""
WAVES = 0.2
"""Of a scale's deviation, by which it is more and less as the body goes up and down with the road."""
FAN = 0.2
"""Of a bias, by which it is more and less as a fan in its box stands and runs."""


def _one_other(world: World, given: Parameters) -> World:
    """The right rear wheel is the one with a quarter of the deviation."""
    part = ONE_OTHER * (given["radius_m"] - world.physics.radius)
    return world.moved(radius=given["radius_m"], radius_tilt=part, radius_side=-part, radius_sides=part)


def _stiffness(world: World, given: Parameters) -> World:
    more = given["stiffness_n"] - world.physics.stiffness_drive
    return LIBRARY["tyre_stiffness_offset"].apply(world, given).moved(stiffness_sides=STIFFNESS_SIDES * more)


def _slow_tail(world: World, given: Parameters) -> World:
    """Most of it sooner than the mean and the rest later, as of a caliper whose pads have to give way first."""
    whole = given["time_constant_s"]
    if whole == 0.0:
        return world
    sooner = (1.0 - TAIL * TAIL_TIMES) / (1.0 - TAIL)
    return world.moved(lag=sooner * whole, lag_tail=TAIL, lag_slow=TAIL_TIMES * whole)


def _means(world: World, given: Parameters) -> World:
    message = min(MEAN_S, given["delay_s"])
    return world.sensed(wheel_delay_s=given["delay_s"], wheel_average_s=message, wheel_message_s=message)


def _halved(world: World, given: Parameters) -> World:
    halves = HALVES * USUAL_RAD_S
    return world.sensed(
        wheel_teeth=given["teeth"], wheel_window_s=given["window_s"], wheel_halves_rad_s=halves
    )


def _fitted(world: World, given: Parameters) -> World:
    delay = given["delay_s"]
    return world.sensed(speed_delay_s=delay, speed_fitted_s=min(FIT_S, 2.0 * delay))


EFFECTS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"nodding": with_more("aero_drag", drag_nod=NOD)},
    "rolling_resistance": {
        "flat_spots": lambda w, g: w.moved(roll_moment=g["coefficient"], roll_flat=FLAT),
    },
    "wheel_radius_offset": {"one_other": _one_other},
    "load_transfer": {
        "springs_with_stops": with_more("load_transfer", pitch_time=SPRINGS_S, pitch_stops=STOPS),
    },
    "tyre_relaxation": {"each_its_own": with_more("tyre_relaxation", relaxation_side=RELAXATION_SIDE)},
    "tyre_stiffness_offset": {"unlike_sides": _stiffness},
    "friction_falloff": {"line_and_tail": falling(LINE_AND_TAIL)},
    "friction_offset": {"less_under_load": with_more("friction_offset", grip_load=GRIP_LOAD)},
    "torque_lag": {"slow_tail": _slow_tail},
    "torque_delay": {
        "ever_later": lambda w, g: w.moved(delay=g["delay_s"], delay_warm=DELAY_WARM * g["delay_s"]),
    },
    "torque_gain": {"with_power": with_more("torque_gain", gain_power=GAIN_POWER)},
    "brake_drag": {"shaken_free": with_more("brake_drag", brake_texture=SHAKEN)},
    "driveline_compliance": {"warming_rubber": with_more("driveline_compliance", shaft_warm=SHAFT_WARM)},
    "wheel_speed_delay": {"means": _means},
    "wheel_speed_quantisation": {"halved_when_fast": _halved},
    "vehicle_speed_delay": {"fitted_line": _fitted},
    "vehicle_speed_scale": {
        "over_waves": lambda w, g: w.sensed(speed_scale=g["factor"], speed_scale_waves=WAVES),
    },
    "accelerometer_bias": {
        "with_a_fan": lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"], accel_bias_fan=FAN),
    },
    "mu_split": {"thawing": with_more("mu_split", grip_warm=THAWING)},
}

FOREIGN: dict[str, Foreign] = {
    "humped": Foreign(
        lambda rng: {"sliding": float(rng.uniform(0.7, 0.9))},
        lambda world, share, sliding: with_foreign(world, HUMPED, share, sliding),
    ),
}

MORE: dict[str, dict[str, Any]] = {
    **EFFECTS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES_TENTH,
    "digits": DIGITS_TENTH,
    "driver": {"commuter": COMMUTER},
}
