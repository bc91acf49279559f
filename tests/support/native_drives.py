"""Inputs of a wheel over time for both kinds of the unit, and what each gives."""

import math
import random
from functools import partial

import numpy as np

SUDDEN = (math.nan, math.inf, -1e300, 1e5, -3.0, 0.0)
SIGNALS = (
    "wheel_speed",
    "wheel_torque",
    "vehicle_speed",
    "vertical_load",
    "steering_angle",
    "longitudinal_acceleration",
    "yaw_rate",
    "road_class_confidence",
)


WHEELS, SIDES = (".fl", ".fr", ".rl", ".rr"), (".left", ".right")
"""Ends of names of the unit of four wheels."""


ODD_STEPS_S = (0.01, 1e-4)
IMPOSSIBLE_STEPS_S = (0.0, -1.0, math.nan, 1e9, 11.0)
"""Steps that units discard before the estimator sees them."""


def drive(seed, steps, wheels=("",), sides=("",), odd_steps_s=ODD_STEPS_S):
    """Inputs and size of each step: driving, braking, backing, classes, and now and then something of no sense."""
    rng, speed = random.Random(seed), 12.0
    of_car = ["steering_angle", "longitudinal_acceleration", "yaw_rate", "lateral_acceleration"][
        : 3 + (wheels == WHEELS)
    ]
    sudden = ["vehicle_speed", *of_car, *(f"road_class_confidence{side}" for side in sides)]
    sudden += [
        f"{name}{wheel}" for name in ("wheel_speed", "wheel_torque", "vertical_load") for wheel in wheels
    ]
    for step in range(steps):
        values = {}
        for wheel in wheels:
            torque = 400.0 * math.sin(0.006 * step) + rng.gauss(0.0, 3.0)
            values[f"wheel_torque{wheel}"] = torque
            values[f"wheel_speed{wheel}"] = speed * (1.0 + torque / 20000.0) / 0.29 + rng.gauss(0.0, 0.02)
        stopping = 18.0 / (0.2 * steps) if step > 0.8 * steps else 0.0
        speed = max(speed + 4e-3 * math.sin(0.006 * step) - stopping, -2.0)
        values["vehicle_speed"] = speed + rng.gauss(0.0, 0.005)
        if step > steps // 6 and step % 40 == 0:
            for side in sides:
                values[f"road_class{side}"] = rng.choice([0, 1, 2, 2, -1])
                values[f"road_class_confidence{side}"] = rng.choice([0.9, 0.9, 0.3])
            values["frame_id"] = rng.choice([0, step])
        if rng.random() < 0.01:
            values[rng.choice(sudden)] = rng.choice(SUDDEN)
        if rng.random() < 0.02:
            values |= {name: rng.gauss(0.0, 1.0 if "acceleration" in name else 0.1) for name in of_car}
        if rng.random() < 0.02:
            values |= {f"vertical_load{wheel}": rng.gauss(3000.0, 150.0) for wheel in wheels}
        if rng.random() < 0.004:
            values[f"road_class{sides[-1]}"] = rng.choice([7, -5])
        odd = rng.random() < 0.01
        yield values, rng.choice(odd_steps_s) if odd else 0.001


drive_of_four = partial(drive, wheels=WHEELS, sides=SIDES)


def rows(steps, seed=1):
    """The rows that `native_host.c` reads, shape (steps, 11): good readings with classes from a third on."""
    rng, speed, made = np.random.default_rng(seed), 12.0, []
    for step in range(steps):
        torque = 400.0 * math.sin(0.006 * step) + rng.normal(0.0, 3.0)
        speed += 1e-5 * torque
        omega = speed * (1.0 + torque / 20000.0) / 0.29 + rng.normal(0.0, 0.02)
        road_class = -1 if step < steps // 3 else (step // 300) % 4 - 1
        read_m_s = speed + rng.normal(0.0, 0.005)
        made.append([0.001, omega, torque, read_m_s, 0.9, 0.0, 0.0, 0.0, 0.0, road_class, step // 40])
    return np.array(made)


def pedal(steps, radius_m):
    """Inputs of a wheel of this radius on ice, whose slip and torque follow a pedal; its tyre is softer than told."""
    rng = np.random.default_rng(5)
    for step in range(steps):
        slip = 0.03 * math.sin(0.02 * step)
        used = 0.2 * math.tanh(60.0 * slip)
        yield {
            "wheel_speed": float(12.0 / radius_m * (1.0 + slip) + 0.01 * rng.standard_normal()),
            "wheel_torque": used * 3400.0 * radius_m,
            "vehicle_speed": float(12.0 + 0.003 * rng.standard_normal()),
            "vertical_load": 3400.0,
        }
