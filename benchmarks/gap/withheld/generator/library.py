"""The contract's effects outside the camera, in this generator's own forms.

Each entry says what is plausible: the parameters over severity, from the least that anyone would care about to the
most that a real car shows, and what they change.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from .car import Car
from .world import AIR_KG_M3, Effect, Parameters, World

Scale = Callable[[float], Parameters]


def growing(name: str, least: float, most: float) -> Callable[[Car, Generator], Scale]:
    """A parameter that grows by a constant ratio from `least` to `most`."""
    return lambda car, rng: lambda severity: {name: least * (most / least) ** severity}


def _none(car: Car) -> float:
    return 0.0


def signed(
    name: str, least: float, most: float, base: Callable[[Car], float] = _none
) -> Callable[[Car, Generator], Scale]:
    """`base (1 + or - x)` with x growing from `least` to `most`; where base is 0, plus or minus x itself."""

    def at(car: Car, rng: Generator) -> Scale:
        sign, start = float(rng.choice([-1.0, 1.0])), base(car)

        def parameters(severity: float) -> Parameters:
            size = sign * least * (most / least) ** severity
            return {name: start * (1.0 + size) if start else size}

        return parameters

    return at


def _rolling(world: World, given: Parameters) -> World:
    """As a force on the body."""
    return world.moved(roll_force=given["coefficient"])


def _mass(car: Car, rng: Generator) -> Scale:
    share = float(rng.choice([-0.2, 0.35], p=[0.3, 0.7]))
    return lambda severity: {"mass_kg": car.mass_kg * share * 0.08 ** (1.0 - severity)}


def _split(car: Car, rng: Generator) -> Scale:
    """One side slippery, the other a little off too."""
    side, other = rng.choice(["left", "right"]), float(rng.uniform(0.98, 1.02))

    def parameters(severity: float) -> Parameters:
        low = 1.0 - 0.05 * 10.0**severity
        return {
            "left_factor": low if side == "left" else other,
            "right_factor": other if side == "left" else low,
        }

    return parameters


def _sides(world: World, given: Parameters) -> World:
    p = world.physics
    return world.moved(
        factor_left=p.factor_left * given["left_factor"], factor_right=p.factor_right * given["right_factor"]
    )


def _falloff(car: Car, rng: Generator) -> Scale:
    floor = float(rng.uniform(0.4, 0.7))
    return lambda severity: {"falloff_s_m": 0.01 * 20.0**severity, "floor": floor}


def _driveline(car: Car, rng: Generator) -> Scale:
    """The softer the severer; damping 2 to 8 % of critical."""
    motor = car.wheel_inertia_kg_m2 * float(rng.uniform(0.35, 0.65))
    series = motor * (car.wheel_inertia_kg_m2 - motor) / car.wheel_inertia_kg_m2
    ratio = float(rng.uniform(0.02, 0.08))

    def parameters(severity: float) -> Parameters:
        stiffness = 30_000.0 * 0.05**severity
        damping = 2.0 * ratio * np.sqrt(stiffness * series)
        return {
            "stiffness_nm_rad": stiffness,
            "damping_nm_s_rad": float(damping),
            "motor_inertia_kg_m2": motor,
        }

    return parameters


def _shaft(world: World, given: Parameters) -> World:
    return world.moved(
        shaft_stiffness=given["stiffness_nm_rad"],
        shaft_damping=given["damping_nm_s_rad"],
        motor_inertia=given["motor_inertia_kg_m2"],
    )


def _pulses(car: Car, rng: Generator) -> Scale:
    """Ever fewer teeth in the same window."""
    window = float(rng.choice([0.005, 0.01, 0.02, 0.04]))
    return lambda severity: {"teeth": float(round(4096.0 / 85.0**severity)), "window_s": window}


def _of(name: str) -> Callable[[Car], float]:
    return lambda car: float(getattr(car, name))


def _one(car: Car) -> float:
    return 1.0


LIBRARY: dict[str, Effect] = {
    "aero_drag": Effect(
        growing("drag_area_m2", 0.1, 1.6),
        lambda w, g: w.moved(drag=0.5 * AIR_KG_M3 * g["drag_area_m2"]),
        ("vehicle",),
    ),
    "rolling_resistance": Effect(growing("coefficient", 0.003, 0.04), _rolling, ("wheel", "vehicle", "road")),
    "road_grade": Effect(
        signed("grade", 0.003, 0.06), lambda w, g: w.moved(grade=g["grade"]), ("road", "vehicle")
    ),
    "mass_offset": Effect(_mass, lambda w, g: w.moved(mass=w.physics.mass + g["mass_kg"]), ("vehicle",)),
    "wheel_radius_offset": Effect(
        signed("radius_m", 0.003, 0.06, _of("wheel_radius_m")),
        lambda w, g: w.moved(radius=g["radius_m"]),
        ("wheel", "tyre"),
    ),
    "wheel_inertia_offset": Effect(
        signed("inertia_kg_m2", 0.05, 0.5, _of("wheel_inertia_kg_m2")),
        lambda w, g: w.moved(inertia=g["inertia_kg_m2"]),
        ("wheel",),
    ),
    "load_transfer": Effect(
        growing("cog_height_m", 0.15, 0.8), lambda w, g: w.moved(cog_height=g["cog_height_m"]), ("vehicle",)
    ),
    "tyre_relaxation": Effect(
        growing("length_m", 0.05, 0.8), lambda w, g: w.moved(relaxation=g["length_m"]), ("tyre",)
    ),
    "tyre_stiffness_offset": Effect(
        signed("stiffness_n", 0.05, 0.5, _of("stiffness_n")),
        lambda w, g: w.moved(stiffness_drive=g["stiffness_n"], stiffness_brake=g["stiffness_n"]),
        ("tyre",),
    ),
    "friction_falloff": Effect(
        _falloff, lambda w, g: w.moved(falloff=g["falloff_s_m"], falloff_floor=g["floor"]), ("tyre",)
    ),
    "friction_offset": Effect(
        signed("factor", 0.03, 0.35, _one),
        lambda w, g: _sides(w, {"left_factor": g["factor"], "right_factor": g["factor"]}),
        ("road", "tyre"),
    ),
    "torque_lag": Effect(
        growing("time_constant_s", 0.005, 0.25),
        lambda w, g: w.moved(lag=g["time_constant_s"]),
        ("powertrain",),
    ),
    "torque_delay": Effect(
        growing("delay_s", 0.004, 0.2), lambda w, g: w.moved(delay=g["delay_s"]), ("powertrain",)
    ),
    "torque_gain": Effect(
        signed("factor", 0.01, 0.25, _one),
        lambda w, g: w.moved(gain=np.full(4, g["factor"])),
        ("powertrain",),
    ),
    "brake_drag": Effect(
        growing("torque_nm", 2.0, 60.0),
        lambda w, g: w.moved(brake_drag=g["torque_nm"]),
        ("wheel", "powertrain"),
    ),
    "driveline_compliance": Effect(_driveline, _shaft, ("powertrain",)),
    "wheel_speed_delay": Effect(
        growing("delay_s", 0.002, 0.15),
        lambda w, g: w.sensed(wheel_delay_s=g["delay_s"]),
        ("wheel_speed_sensor",),
    ),
    "wheel_speed_quantisation": Effect(
        _pulses,
        lambda w, g: w.sensed(wheel_teeth=g["teeth"], wheel_window_s=g["window_s"]),
        ("wheel_speed_sensor",),
    ),
    "vehicle_speed_delay": Effect(
        growing("delay_s", 0.005, 0.4),
        lambda w, g: w.sensed(speed_delay_s=g["delay_s"]),
        ("vehicle_speed_sensor",),
    ),
    "vehicle_speed_scale": Effect(
        signed("factor", 0.003, 0.06, _one),
        lambda w, g: w.sensed(speed_scale=g["factor"]),
        ("vehicle_speed_sensor",),
    ),
    "accelerometer_bias": Effect(
        signed("bias_m_s2", 0.02, 0.8),
        lambda w, g: w.sensed(accel_bias_m_s2=g["bias_m_s2"]),
        ("accelerometer",),
    ),
    "mu_split": Effect(_split, _sides, ("road",)),
}
"""The 22 effects of the contract that are not the camera's."""
