"""Deviations that the contract's library does not hold: the right answer to them is "unknown", and where they lie.

Each has the subsystems that are a right answer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from .car import Car
from .library import Scale, growing, signed
from .motors import COMMAND_STEP_S
from .tyre import MAGIC
from .world import AIR_KG_M3, Effect, Parameters, World, with_foreign

WIND_S = 120.0
GUST_S = 0.75

At = Callable[[Car, Generator], Scale]


def _moves(field: str, name: str, least: float, most: float, *places: str, at: Any = growing) -> Effect:
    """One parameter that is one of the physics."""
    return Effect(at(name, least, most), lambda w, g: w.moved(**{field: g[name]}), places)


def _reads(field: str, name: str, least: float, most: float, *places: str, at: Any = growing) -> Effect:
    """One parameter that is one of the sensors'."""
    return Effect(at(name, least, most), lambda w, g: w.sensed(**{field: g[name]}), places)


def _varies(draw: Callable[[Car, Generator], dict[str, float]], name: str, least: float, ratio: float) -> At:
    """One parameter that grows, beside what is drawn once."""

    def at(car: Car, rng: Generator) -> Scale:
        drawn = draw(car, rng)
        return lambda severity: {name: least * ratio**severity, **drawn}

    return at


# --- air, road and body


def _gusts(car: Car, rng: Generator) -> dict[str, float]:
    seed = float(rng.integers(2**31))
    return {"drag_area_m2": float(rng.uniform(0.6, 0.9)), "seed": seed}


def _blow(world: World, given: Parameters) -> World:
    """Smooth gusts of about a second, without the drag in still air: that is another effect's."""
    n = int(WIND_S / COMMAND_STEP_S)
    keep = np.exp(-COMMAND_STEP_S / GUST_S)
    pushes = np.random.default_rng(int(given["seed"])).standard_normal(n)
    wind = lfilter([1.0], [1.0, -2.0 * keep, keep**2], pushes)
    wind *= given["wind_m_s"] / wind.std()
    return world.moved(gust_drag=0.5 * AIR_KG_M3 * given["drag_area_m2"], wind=wind - wind.mean())


def _head_wind(car: Car, rng: Generator) -> Scale:
    sign, area = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.6, 0.9))
    return lambda severity: {"wind_m_s": sign * 0.7 * 20.0**severity, "drag_area_m2": area}


def _blows(world: World, given: Parameters) -> World:
    """Steadily against the car, or with it; the drag in still air is another effect's."""
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(gust_drag=drag, wind=np.full(2, given["wind_m_s"]))


def _wave(car: Car, rng: Generator) -> dict[str, float]:
    return {"length_m": float(rng.uniform(25.0, 70.0))}


def _sway(car: Car, rng: Generator) -> dict[str, float]:
    return {"hertz": float(rng.uniform(0.5, 1.1))}


# --- tyres and wheels


def _asymmetry(car: Car, rng: Generator) -> Scale:
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda severity: {"brake_factor": 1.0 + sign * 0.1 * 5.0**severity}


def _magic(car: Car, rng: Generator) -> dict[str, float]:
    return {"shape": float(rng.uniform(1.4, 1.6)), "curvature": float(rng.uniform(-1.0, 0.3))}


def _one_tyre(car: Car, rng: Generator) -> Scale:
    wheel = float(rng.integers(4))
    return lambda severity: {"wheel": wheel, "less_m": car.wheel_radius_m * 0.003 * 15.0**severity}


def _flat(world: World, given: Parameters) -> World:
    """A quarter of it in the mean, and in each way of dividing the wheels in two: three of them cancel."""
    wheel, part = int(given["wheel"]), -0.25 * given["less_m"]
    front, left = (1.0 if wheel < 2 else -1.0), (1.0 if wheel % 2 == 0 else -1.0)
    return world.moved(
        radius=world.physics.radius + part,
        radius_tilt=front * part,
        radius_sides=left * part,
        radius_side=front * left * part,
    )


# --- motors and brakes


def _one_wheel(name: str, least: float, most: float) -> Effect:
    """A factor at one wheel alone: its speed sensor's scale, or its motor's gain."""

    def at(car: Car, rng: Generator) -> Scale:
        wheel, sign = float(rng.integers(4)), float(rng.choice([-1.0, 1.0]))
        return lambda severity: {"wheel": wheel, "factor": 1.0 + sign * least * (most / least) ** severity}

    def apply(world: World, given: Parameters) -> World:
        factors = [given["factor"] if w == int(given["wheel"]) else 1.0 for w in range(4)]
        if name == "sensor":
            return world.sensed(wheel_scale=tuple(factors))
        return world.moved(gain=np.array(factors))

    places = ("wheel_speed_sensor", "wheel") if name == "sensor" else ("powertrain", "wheel")
    return Effect(at, apply, places)


def _limit(car: Car, rng: Generator) -> Scale:
    return lambda severity: {"torque_nm": car.motor_peak_torque_nm * (0.85 - 0.6 * severity)}


def _power(car: Car, rng: Generator) -> Scale:
    """Of a motor that gives its peak torque up to ever lower speeds."""
    peak_per_m_s = car.motor_peak_torque_nm / car.wheel_radius_m
    return lambda severity: {"power_w": peak_per_m_s * 22.0 * 0.2**severity}


def _order(car: Car, rng: Generator) -> dict[str, float]:
    return {"order": float(rng.integers(2, 7))}


def _wheel(car: Car, rng: Generator) -> dict[str, float]:
    return {"wheel": float(rng.integers(4))}


def _drag_on_one(world: World, given: Parameters) -> World:
    share = np.arange(4) == int(given["wheel"])
    return world.moved(brake_drag=given["torque_nm"], brake_share=share.astype(float))


def _slip(car: Car, rng: Generator) -> dict[str, float]:
    """Of a controller of ever more authority; a weak one already decides whether a wheel locks."""
    return {"slip": float(rng.uniform(0.03, 0.12))}


def _below(car: Car, rng: Generator) -> dict[str, float]:
    return {"below_m_s": float(rng.uniform(7.0, 12.0))}


def _blending(world: World, given: Parameters) -> World:
    """The motors brake less below a speed, and the brakes make up for a part of it only."""
    return world.moved(regen_fade=given["below_m_s"] / world.physics.radius, regen_lost=given["share"])


def _vectored(world: World, given: Parameters) -> World:
    """A controller hands torque from one side to the other, which the log's command does not tell."""
    return world.moved(
        gain=world.physics.gain * (1.0 + given["left_more"] * np.array([1.0, -1.0, 1.0, -1.0]))
    )


def _notch(car: Car, rng: Generator) -> dict[str, float]:
    """Of motors that spare a housing's resonance."""
    return {"at_rad_s": float(rng.uniform(40.0, 75.0))}


# --- sensors


def _from_wheels(world: World, given: Parameters) -> World:
    """As a brake controller does it where no other speed is at hand: in part from how the wheels turn."""
    return world.sensed(speed_rolling=given["share"], wheel_radius_m=world.physics.radius)


OUTSIDE: dict[str, Effect] = {
    "wind_gusts": Effect(_varies(_gusts, "wind_m_s", 1.5, 8.0), _blow, ("vehicle",)),
    "one_wheel_scale": _one_wheel("sensor", 0.003, 0.05),
    "one_motor_gain": _one_wheel("motor", 0.05, 0.5),
    "accelerometer_scale": Effect(
        growing("excess", 0.02, 0.4),
        lambda w, g: w.sensed(accel_scale=1.0 + g["excess"]),
        ("accelerometer",),
    ),
    "accelerometer_lag": _reads("accel_lag_s", "time_constant_s", 0.01, 0.5, "accelerometer"),
    "torque_dead_band": _moves("dead_band", "torque_nm", 5.0, 60.0, "powertrain"),
    "torque_limit": Effect(_limit, lambda w, g: w.moved(torque_limit=g["torque_nm"]), ("powertrain",)),
    "torque_ripple": Effect(
        _varies(_order, "share", 0.05, 10.0),
        lambda w, g: w.moved(ripple=g["share"], ripple_order=g["order"]),
        ("powertrain", "wheel"),
    ),
    "grade_waves": Effect(
        _varies(_wave, "grade", 0.006, 12.0),
        lambda w, g: w.moved(wave_slope=g["grade"], wave_length=g["length_m"]),
        ("road", "vehicle"),
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
        _varies(_magic, "share", 0.1, 10.0),
        lambda w, g: with_foreign(w, MAGIC, g["share"], g["shape"], g["curvature"]),
        ("tyre",),
    ),
    "speed_low_pass": _reads("speed_lag_s", "time_constant_s", 0.05, 1.5, "vehicle_speed_sensor"),
    "speed_dropouts": _reads("speed_hold_s", "hold_s", 0.05, 1.0, "vehicle_speed_sensor"),
    "bearing_drag": _moves("bearing", "nm_s_rad", 0.05, 1.5, "wheel", "powertrain"),
    "torque_slew": _moves("slew", "nm_s", 20_000.0, 250.0, "powertrain"),
    "tone_wheel_runout": _reads("wheel_runout", "share", 0.001, 0.05, "wheel_speed_sensor", "wheel"),
    "speed_clock_drift": _reads("speed_clock", "share", 0.0005, 0.02, "vehicle_speed_sensor"),
    "motor_power_limit": Effect(_power, lambda w, g: w.moved(power=g["power_w"]), ("powertrain",)),
    "motor_derating": _moves("derating", "share", 0.05, 0.6, "powertrain"),
    "one_brake_drags": Effect(_varies(_wheel, "torque_nm", 8.0, 20.0), _drag_on_one, ("wheel", "powertrain")),
    "accelerometer_limit": _reads("accel_limit_m_s2", "limit_m_s2", 7.5, 1.5, "accelerometer"),
    "speed_offset": _reads("speed_offset_m_s", "offset_m_s", 0.03, 1.5, "vehicle_speed_sensor"),
    "slip_controller": Effect(
        _varies(_slip, "share", 0.005, 170.0),
        lambda w, g: w.moved(slip_allowed=g["slip"], slip_cut=g["share"]),
        ("powertrain",),
    ),
    "brake_torque_rise": _moves("pad_rise", "share", 0.03, 0.4, "powertrain", "wheel"),
    "swaying_load": Effect(
        _varies(_sway, "share", 0.03, 10.0),
        lambda w, g: w.moved(slosh_share=g["share"], slosh_rate=2.0 * np.pi * g["hertz"]),
        ("vehicle",),
    ),
    "wet_grip_falls_with_speed": _moves("wet_fall", "share", 0.05, 0.7, "road", "tyre"),
    "speed_from_wheels": Effect(growing("share", 0.05, 1.0), _from_wheels, ("vehicle_speed_sensor",)),
    "actuator_hysteresis": _moves("actuator_play", "torque_nm", 3.0, 60.0, "powertrain"),
    "axles_share_torque": _moves("axle_share", "share", 0.03, 0.5, "powertrain"),
    "wheels_out_of_round": _moves("out_of_round", "share", 0.001, 0.02, "wheel", "tyre"),
    "slush_drag": _moves("slush", "n_s2_m2", 0.15, 4.0, "road", "tyre", "wheel"),
    "accelerometer_pitches": _reads("accel_pitch", "share", 0.02, 0.25, "accelerometer", "vehicle"),
    "speed_in_steps": _reads("speed_step_m_s", "step_m_s", 0.03, 1.0, "vehicle_speed_sensor"),
    "regeneration_fades": Effect(_varies(_below, "share", 0.04, 22.0), _blending, ("powertrain",)),
    "torque_dropouts": _moves("stall", "hold_s", 0.02, 0.7, "powertrain"),
    "wheel_speed_dropouts": _reads("wheel_hold_s", "hold_s", 0.03, 0.8, "wheel_speed_sensor"),
    "accelerometer_delay": _reads("accel_delay_s", "delay_s", 0.008, 0.4, "accelerometer"),
    "speed_predicted_ahead": _reads("speed_ahead_s", "ahead_s", 0.01, 0.4, "vehicle_speed_sensor"),
    "head_wind": Effect(_head_wind, _blows, ("vehicle",)),
    "road_map_shifted": Effect(
        signed("shift_m", 0.5, 25.0),
        lambda w, g: w.moved(border=w.physics.border + g["shift_m"]),
        ("road", "tyre"),
    ),
    "unlike_tyres_by_axle": Effect(
        signed("front_more", 0.04, 0.48),
        lambda w, g: w.moved(stiffness_tilt=g["front_more"] * w.physics.stiffness_drive),
        ("tyre",),
    ),
    "one_tyre_flat": Effect(_one_tyre, _flat, ("tyre", "wheel", "wheel_speed_sensor")),
    "torque_split_shifted": _moves("axle_split", "front_more", 0.03, 0.36, "powertrain", at=signed),
    "axles_coupled": _moves("axle_viscous", "nm_s_rad", 1.0, 80.0, "powertrain"),
    "accelerometer_bends": _reads("accel_bend_s2_m", "per_m_s2", 0.003, 0.06, "accelerometer", at=signed),
    "speed_rate_limited": _reads("speed_rate_m_s2", "limit_m_s2", 9.0, 1.0, "vehicle_speed_sensor"),
    "loose_gravel": _moves("gravel", "coefficient", 0.01, 0.2, "road", "wheel", "vehicle"),
    "torque_vectored": Effect(signed("left_more", 0.01, 0.3), _vectored, ("powertrain",)),
    "road_borders_blurred": _moves("border_blur", "over_m", 1.0, 40.0, "road", "tyre"),
    "wheel_speed_dies": _reads("wheel_least_rad_s", "least_rad_s", 8.0, 40.0, "wheel_speed_sensor"),
    "speed_hysteresis": _reads("speed_play_m_s", "play_m_s", 0.02, 0.6, "vehicle_speed_sensor"),
    "accelerometer_in_steps": _reads("accel_step_m_s2", "step_m_s2", 0.1, 1.6, "accelerometer"),
    # Valves that open in pulses: a few bar each.
    "torque_in_steps": _moves("torque_step", "step_nm", 3.0, 80.0, "powertrain"),
    "cornering_drag": _moves("bend_drag", "force_n", 20.0, 900.0, "vehicle", "tyre", "road"),
    # Of a converter from pulses to a voltage, which the wheels share.
    "wheel_speed_offset": _reads(
        "wheel_offset_rad_s", "offset_rad_s", 0.05, 2.5, "wheel_speed_sensor", at=signed
    ),
    "speed_tracking_loop": _reads("speed_loop_s", "loop_s", 0.02, 0.8, "vehicle_speed_sensor"),
    "accelerometer_fades": _reads("accel_fades_s", "time_constant_s", 60.0, 1.0, "accelerometer"),
    "torque_notch": Effect(
        _varies(_notch, "share", 0.01, 80.0),
        lambda w, g: w.moved(notch=g["share"], notch_rad_s=g["at_rad_s"]),
        ("powertrain",),
    ),
    # New tyres on one axle and worn ones on the other.
    "unlike_grip_by_axle": _moves("grip_axles", "front_more", 0.005, 0.3, "tyre", "road", at=signed),
    "wheel_speeds_blended": _reads("wheel_blend", "share", 0.02, 0.9, "wheel_speed_sensor"),
    # Of a sensor that now and then follows its own echo, or another car.
    "speed_mislocks": _reads("speed_mislocks", "share", 0.005, 0.3, "vehicle_speed_sensor", at=signed),
    "accelerometer_on_soft_pad": _reads("accel_period_s", "period_s", 0.015, 0.35, "accelerometer"),
}
