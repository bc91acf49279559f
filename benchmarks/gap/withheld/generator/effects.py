"""Forms of the effects and of a foreign tyre: readings of what the contract leaves open.

A form acts only through its effect, is the nominal car where the effect is none, and keeps what a parameter means:
what varies does so about the value that is told. Shares are of the deviation, or of the value, that the effect has.
The first form of each effect, "plain", is the library's; an effect that is not listed has that alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from . import tyre
from .details import PROFILE_STEP_M
from .library import LIBRARY
from .world import AIR_KG_M3, Array, Parameters, World, with_foreign

Apply = Callable[[World, Parameters], World]

MESSAGE_S = 0.02
"""From one message of a bus to the next."""


def own(effect: str) -> Apply:
    return LIBRARY[effect].apply


def moved(effect: str, **physics: Any) -> Apply:
    """The library's, with some physics more."""
    return lambda world, given: own(effect)(world, given).moved(**physics)


def sensed(effect: str, **sensors: Any) -> Apply:
    """The library's, with some more about the sensors."""
    return lambda world, given: own(effect)(world, given).sensed(**sensors)


def sharing(effect: str, parameter: str, nominal: str, **shares: float) -> Apply:
    """The library's, and shares of the deviation from the `nominal` physics."""

    def apply(world: World, given: Parameters) -> World:
        more = given[parameter] - getattr(world.physics, nominal)
        return own(effect)(world, given).moved(**{name: share * more for name, share in shares.items()})

    return apply


def _lift(total: float, front: float = 0.0) -> Apply:
    """A drag with a lift, as a share of it; `front` is the share's part at the front axle more than at the rear."""

    def apply(world: World, given: Parameters) -> World:
        drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
        wheelbase = world.physics.front_arm + world.physics.rear_arm
        return world.moved(drag=drag, lift=total * drag, drag_height=0.5 * front * wheelbase)

    return apply


def _rolling_moment(**physics: float) -> Apply:
    """As a moment at the wheels."""
    return lambda world, given: world.moved(roll_moment=given["coefficient"], **physics)


def payload(behind: float) -> Apply:
    """Behind the centre of gravity by a share of the way to the rear axle: the centre of gravity moves back with it."""

    def apply(world: World, given: Parameters) -> World:
        p = world.physics
        mass = p.mass + given["mass_kg"]
        back = behind * p.rear_arm * given["mass_kg"] / mass
        return world.moved(mass=mass, front_arm=p.front_arm + back, rear_arm=p.rear_arm - back)

    return apply


def _on_one_side(world: World, given: Parameters) -> World:
    """On the driver's seat, 0.4 m to the left of the middle with half a track of 0.75 m."""
    loaded = payload(0.3)(world, given)
    return loaded.moved(load_side=given["mass_kg"] * 0.4 / (loaded.physics.mass * 0.75))


def _rotor(world: World, given: Parameters) -> World:
    """Half of what is more, or is left, is the motor's and turns on a shaft of 55 Hz that gives way a little."""
    rotor = 0.5 * abs(given["inertia_kg_m2"] - world.physics.inertia)
    series = rotor * (given["inertia_kg_m2"] - rotor) / given["inertia_kg_m2"]
    stiffness = max((2.0 * np.pi * 55.0) ** 2 * series, 1.0)
    return world.moved(
        inertia=given["inertia_kg_m2"],
        motor_inertia=rotor,
        shaft_stiffness=stiffness,
        shaft_damping=2.0 * 0.1 * float(np.sqrt(stiffness * series)),
    )


_REPAIRS_M = (30.0, 75.0, 110.0, 125.0, 180.0, 240.0, 265.0, 330.0)


def _repaired() -> Array:
    """Repairs, whose friction deviates by half more than the rest's; none on the whole."""
    places = np.arange(0.0, _REPAIRS_M[-1], PROFILE_STEP_M)
    profile = 0.5 * (np.searchsorted(_REPAIRS_M, places, side="right") % 2)
    return np.asarray(profile - profile.mean())


def _in_messages(world: World, given: Parameters) -> World:
    """Torque that comes message by message, no farther apart than twice the delay."""
    return own("torque_delay")(world, given).moved(message=min(MESSAGE_S, 2.0 * given["delay_s"]))


def _filtered(world: World, given: Parameters) -> World:
    """Late, and in part (8 ms at most) by a filter that spares the gears."""
    lag = min(0.3 * given["delay_s"], 0.008)
    return world.moved(delay=given["delay_s"] - lag, lag=lag)


def _each_its_own(world: World, given: Parameters) -> World:
    """Each motor's gain, front left and right and rear left and right; the mean is as told."""
    return world.moved(gain=1.0 + (given["factor"] - 1.0) * np.array([1.25, 0.95, 0.85, 0.95]))


def _late(sensor: str, name: str, share: float) -> Apply:
    """A delay with a time of 20 ms of this name, but no longer than a share of it."""
    return lambda world, given: world.sensed(
        **{f"{sensor}_delay_s": given["delay_s"], f"{sensor}_{name}_s": min(0.02, share * given["delay_s"])}
    )


_FORMS: dict[str, dict[str, Apply]] = {
    "aero_drag": {"with_lift": _lift(0.3), "front_lift": _lift(0.15, front=0.15)},
    "rolling_resistance": {
        "warming": _rolling_moment(roll_warm=-0.15),
        "as_on_the_drum": _rolling_moment(roll_linear=0.05, roll_growth=0.06, roll_load=-0.1),
    },
    "mass_offset": {"boot": payload(0.9), "on_one_side": _on_one_side},
    "load_transfer": {"links_and_springs": moved("load_transfer", springs_share=0.6, springs_time=0.06)},
    "wheel_radius_offset": {
        # Where the belt stretches.
        "less_at_speed": sharing("wheel_radius_offset", "radius_m", "radius", radius_growth=-0.08)
    },
    "wheel_inertia_offset": {"rotor_on_shaft": _rotor},
    "tyre_relaxation": {"with_load": moved("tyre_relaxation", relaxation_load=True)},
    "tyre_stiffness_offset": {
        "on_coarse_stretches": sharing(
            "tyre_stiffness_offset", "stiffness_n", "stiffness_drive", stiffness_texture=0.2
        )
    },
    "friction_falloff": {
        "logarithmic": moved("friction_falloff", falloff_logarithmic=True),
        "sooner_when_wet": moved("friction_falloff", falloff_wet=0.3),
    },
    "friction_offset": {
        "more_in_braking": moved("friction_offset", grip_sign=-0.15)
    },  # by the tread's direction
    "mu_split": {"repairs": moved("mu_split", blotches=_repaired())},
    "torque_lag": {
        "gentle_about_zero": moved("torque_lag", lag_zero=0.5)
    },  # lets its gears change sides gently
    "torque_delay": {"messages": _in_messages, "smoothed": _filtered},
    "torque_gain": {
        "each_its_own": _each_its_own,
        "hunting": moved("torque_gain", gain_sway=0.15),  # the estimate of the motor's flux
        "with_power": moved("torque_gain", gain_power=0.15),  # the battery's voltage sags
    },
    "brake_drag": {"pulsating": moved("brake_drag", brake_pulse=0.4)},  # over a turn of a disc that wobbles
    "driveline_compliance": {"unlike_axles": moved("driveline_compliance", shaft_axles=0.15)},
    "wheel_speed_delay": {"beating": _late("wheel", "beat", 1.0), "smoothed": _late("wheel", "filter", 0.5)},
    "wheel_speed_quantisation": {
        "running_window": sensed("wheel_speed_quantisation", wheel_window_runs=True)
    },
    "vehicle_speed_delay": {"smoothed": _late("speed", "filter", 0.5)},
    "vehicle_speed_scale": {
        "with_pitch": sensed("vehicle_speed_scale", speed_scale_pitch=0.04)
    },  # [1/(m/s^2)]
    # More after one direction than the other.
    "accelerometer_bias": {"remembering": sensed("accelerometer_bias", accel_bias_memory=0.2)},
}
EFFECT_FORMS = {effect: {"plain": own(effect), **others} for effect, others in _FORMS.items()}


@dataclass(frozen=True)
class Foreign:
    """A tyre of another formula, with the slope and the peak of the simulation's, and the limits of its parameters."""

    curve: int
    between: dict[str, tuple[float, float]]

    def draw(self, rng: Generator) -> Parameters:
        """Its own parameters."""
        return {name: float(rng.uniform(*limits)) for name, limits in self.between.items()}

    def apply(self, world: World, share: float, **own: float) -> World:
        """A world that has a share of it."""
        return with_foreign(world, self.curve, share, *(own[name] for name in self.between))


FOREIGN = {
    "magic_formula": Foreign(tyre.MAGIC, {"shape": (1.4, 1.6), "curvature": (-1.0, 0.3)}),
    "rational": Foreign(tyre.RATIONAL, {"stretch": (2.3, 3.2), "sliding": (0.7, 0.9)}),
    "decaying": Foreign(tyre.DECAYING, {"loss": (0.05, 0.25)}),
    "cubed": Foreign(tyre.CUBED, {"curvature": (-0.2, 0.5)}),
    "hyperbolic_tangent": Foreign(tyre.HYPERBOLIC_TANGENT, {}),
    "sine_rise": Foreign(tyre.SINE_RISE, {"sliding": (0.72, 0.9)}),
}
