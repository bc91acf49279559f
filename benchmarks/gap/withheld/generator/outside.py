"""Deviations that the contract's library does not hold: the right answer to them is "unknown", and where they lie."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from .car import Car
from .kernel import COMMAND_STEP_S
from .library import Scale, growing
from .world import AIR_KG_M3, Effect, Parameters, World, with_magic

WIND_S = 120.0
GUST_S = 0.75


def _gusts(car: Car, rng: Generator) -> Scale:
    seed = float(rng.integers(2**31))
    area = float(rng.uniform(0.6, 0.9))
    return lambda severity: {"wind_m_s": 1.5 * 8.0**severity, "drag_area_m2": area, "seed": seed}


def _blow(world: World, given: Parameters) -> World:
    """Smooth gusts of about a second, without the drag in still air: that is another effect's."""
    n = int(WIND_S / COMMAND_STEP_S)
    keep = np.exp(-COMMAND_STEP_S / GUST_S)
    pushes = np.random.default_rng(int(given["seed"])).standard_normal(n)
    wind = lfilter([1.0], [1.0, -2.0 * keep, keep**2], pushes)
    wind *= given["wind_m_s"] / wind.std()
    return world.moved(gust_drag=0.5 * AIR_KG_M3 * given["drag_area_m2"], wind=wind - wind.mean())


def _one_wheel(name: str, least: float, most: float) -> Effect:
    """A factor at one wheel alone: its speed sensor's scale, or its motor's gain."""

    def at(car: Car, rng: Generator) -> Scale:
        wheel, sign = float(rng.integers(4)), float(rng.choice([-1.0, 1.0]))
        return lambda severity: {"wheel": wheel, "factor": 1.0 + sign * least * (most / least) ** severity}

    def apply(world: World, given: Parameters) -> World:
        factors = [given["factor"] if w == int(given["wheel"]) else 1.0 for w in range(4)]
        return (
            world.sensed(wheel_scale=tuple(factors))
            if name == "sensor"
            else world.moved(gain=np.array(factors))
        )

    places = ("wheel_speed_sensor", "wheel") if name == "sensor" else ("powertrain", "wheel")
    return Effect(at, apply, places)


def _ripple(car: Car, rng: Generator) -> Scale:
    order = float(rng.integers(2, 7))
    return lambda severity: {"share": 0.05 * 10.0**severity, "order": order}


def _limit(car: Car, rng: Generator) -> Scale:
    return lambda severity: {"torque_nm": car.motor_peak_torque_nm * (0.85 - 0.6 * severity)}


def _waves(car: Car, rng: Generator) -> Scale:
    length = float(rng.uniform(25.0, 70.0))
    return lambda severity: {"grade": 0.006 * 12.0**severity, "length_m": length}


def _asymmetry(car: Car, rng: Generator) -> Scale:
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda severity: {"brake_factor": 1.0 + sign * 0.1 * 5.0**severity}


def _magic(car: Car, rng: Generator) -> Scale:
    shape, curvature = float(rng.uniform(1.4, 1.6)), float(rng.uniform(-1.0, 0.3))
    return lambda severity: {"share": 0.1 * 10.0**severity, "shape": shape, "curvature": curvature}


OUTSIDE: dict[str, Effect] = {
    "wind_gusts": Effect(_gusts, _blow, ("vehicle",)),
    "one_wheel_scale": _one_wheel("sensor", 0.003, 0.05),
    "one_motor_gain": _one_wheel("motor", 0.05, 0.5),
    "accelerometer_scale": Effect(
        growing("excess", 0.02, 0.4), lambda w, g: w.sensed(accel_scale=1.0 + g["excess"]), ("accelerometer",)
    ),
    "accelerometer_lag": Effect(
        growing("time_constant_s", 0.01, 0.5),
        lambda w, g: w.sensed(accel_lag_s=g["time_constant_s"]),
        ("accelerometer",),
    ),
    "torque_dead_band": Effect(
        growing("torque_nm", 5.0, 60.0), lambda w, g: w.moved(dead_band=g["torque_nm"]), ("powertrain",)
    ),
    "torque_limit": Effect(_limit, lambda w, g: w.moved(torque_limit=g["torque_nm"]), ("powertrain",)),
    "torque_ripple": Effect(
        _ripple, lambda w, g: w.moved(ripple=g["share"], ripple_order=g["order"]), ("powertrain", "wheel")
    ),
    "grade_waves": Effect(
        _waves, lambda w, g: w.moved(wave_slope=g["grade"], wave_length=g["length_m"]), ("road", "vehicle")
    ),
    "brake_side_stiffness": Effect(
        _asymmetry,
        lambda w, g: w.moved(stiffness_brake=w.physics.stiffness_drive * g["brake_factor"]),
        ("tyre",),
    ),
    "tyre_heating": Effect(
        growing("per_joule", 2e-6, 2e-4),
        lambda w, g: w.moved(heating=g["per_joule"], cooling=0.08),
        ("tyre",),
    ),
    "magic_formula_tyre": Effect(
        _magic, lambda w, g: with_magic(w, g["share"], g["shape"], g["curvature"]), ("tyre",)
    ),
    "speed_low_pass": Effect(
        growing("time_constant_s", 0.05, 1.5),
        lambda w, g: w.sensed(speed_lag_s=g["time_constant_s"]),
        ("vehicle_speed_sensor",),
    ),
    "speed_dropouts": Effect(
        growing("hold_s", 0.05, 1.0),
        lambda w, g: w.sensed(speed_hold_s=g["hold_s"]),
        ("vehicle_speed_sensor",),
    ),
    "bearing_drag": Effect(
        growing("nm_s_rad", 0.05, 1.5), lambda w, g: w.moved(bearing=g["nm_s_rad"]), ("wheel", "powertrain")
    ),
}
"""Of all families, with the subsystems that are a right answer."""

FURTHER: dict[str, Effect] = {
    "torque_slew": Effect(
        growing("nm_s", 20_000.0, 250.0), lambda w, g: w.moved(slew=g["nm_s"]), ("powertrain",)
    ),
    "tone_wheel_runout": Effect(
        growing("share", 0.001, 0.05),
        lambda w, g: w.sensed(wheel_runout=g["share"]),
        ("wheel_speed_sensor", "wheel"),
    ),
    "speed_clock_drift": Effect(
        growing("share", 0.0005, 0.02),
        lambda w, g: w.sensed(speed_clock=g["share"]),
        ("vehicle_speed_sensor",),
    ),
}
"""From the second family on."""


def _power(car: Car, rng: Generator) -> Scale:
    """Of a motor that gives its peak torque up to ever lower speeds."""
    peak_per_m_s = car.motor_peak_torque_nm / car.wheel_radius_m
    return lambda severity: {"power_w": peak_per_m_s * 22.0 * 0.2**severity}


def _one_caliper(car: Car, rng: Generator) -> Scale:
    wheel = float(rng.integers(4))
    return lambda severity: {"wheel": wheel, "torque_nm": 8.0 * 20.0**severity}


def _drag_on_one(world: World, given: Parameters) -> World:
    share = np.arange(4) == int(given["wheel"])
    return world.moved(brake_drag=given["torque_nm"], brake_share=share.astype(float))


STILL_FURTHER: dict[str, Effect] = {
    "motor_power_limit": Effect(_power, lambda w, g: w.moved(power=g["power_w"]), ("powertrain",)),
    "motor_derating": Effect(
        growing("share", 0.05, 0.6), lambda w, g: w.moved(derating=g["share"]), ("powertrain",)
    ),
    "one_brake_drags": Effect(_one_caliper, _drag_on_one, ("wheel", "powertrain")),
    "accelerometer_limit": Effect(
        growing("limit_m_s2", 7.5, 1.5),
        lambda w, g: w.sensed(accel_limit_m_s2=g["limit_m_s2"]),
        ("accelerometer",),
    ),
    "speed_offset": Effect(
        growing("offset_m_s", 0.03, 1.5),
        lambda w, g: w.sensed(speed_offset_m_s=g["offset_m_s"]),
        ("vehicle_speed_sensor",),
    ),
}
"""From the third family on."""


def _from_wheels(world: World, given: Parameters) -> World:
    """As a brake controller does it where no other speed is at hand: in part from how the wheels turn."""
    return world.sensed(speed_rolling=given["share"], wheel_radius_m=world.physics.radius)


def _load_that_sways(car: Car, rng: Generator) -> Scale:
    hertz = float(rng.uniform(0.5, 1.1))
    return lambda severity: {"share": 0.03 * 10.0**severity, "hertz": hertz}


def _slip_controller(car: Car, rng: Generator) -> Scale:
    """Of ever more authority; a weak one already decides whether a wheel locks."""
    slip = float(rng.uniform(0.03, 0.12))
    return lambda severity: {"slip": slip, "share": 0.005 * 170.0**severity}


YET_FURTHER: dict[str, Effect] = {
    "slip_controller": Effect(
        _slip_controller,
        lambda w, g: w.moved(slip_allowed=g["slip"], slip_cut=g["share"]),
        ("powertrain",),
    ),
    "brake_torque_rise": Effect(
        growing("share", 0.03, 0.4), lambda w, g: w.moved(pad_rise=g["share"]), ("powertrain", "wheel")
    ),
    "swaying_load": Effect(
        _load_that_sways,
        lambda w, g: w.moved(slosh_share=g["share"], slosh_rate=2.0 * np.pi * g["hertz"]),
        ("vehicle",),
    ),
    "wet_grip_falls_with_speed": Effect(
        growing("share", 0.05, 0.7), lambda w, g: w.moved(wet_fall=g["share"]), ("road", "tyre")
    ),
    "speed_from_wheels": Effect(growing("share", 0.05, 1.0), _from_wheels, ("vehicle_speed_sensor",)),
}
"""From the fourth family on."""

EVEN_FURTHER: dict[str, Effect] = {
    "actuator_hysteresis": Effect(
        growing("torque_nm", 3.0, 60.0), lambda w, g: w.moved(actuator_play=g["torque_nm"]), ("powertrain",)
    ),
    "axles_share_torque": Effect(
        growing("share", 0.03, 0.5), lambda w, g: w.moved(axle_share=g["share"]), ("powertrain",)
    ),
    "wheels_out_of_round": Effect(
        growing("share", 0.001, 0.02), lambda w, g: w.moved(out_of_round=g["share"]), ("wheel", "tyre")
    ),
    "slush_drag": Effect(
        growing("n_s2_m2", 0.15, 4.0), lambda w, g: w.moved(slush=g["n_s2_m2"]), ("road", "tyre", "wheel")
    ),
    "accelerometer_pitches": Effect(
        growing("share", 0.02, 0.25),
        lambda w, g: w.sensed(accel_pitch=g["share"]),
        ("accelerometer", "vehicle"),
    ),
    "speed_in_steps": Effect(
        growing("step_m_s", 0.03, 1.0),
        lambda w, g: w.sensed(speed_step_m_s=g["step_m_s"]),
        ("vehicle_speed_sensor",),
    ),
}
"""From the fifth family on."""
