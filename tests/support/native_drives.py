"""Inputs of a wheel over time for both kinds of the unit, and what each gives."""

import math
import random

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


def drive(seed, steps):
    """Inputs and size of each step: driving, braking, backing, classes, and now and then something of no sense."""
    rng, speed = random.Random(seed), 12.0
    for step in range(steps):
        torque = 400.0 * math.sin(0.006 * step) + rng.gauss(0.0, 3.0)
        speed = max(speed + 1e-5 * torque - 0.006 * (step > 0.8 * steps), -2.0)
        omega = speed * (1.0 + torque / 20000.0) / 0.29 + rng.gauss(0.0, 0.02)
        values = {
            "wheel_speed": omega,
            "wheel_torque": torque,
            "vehicle_speed": speed + rng.gauss(0.0, 0.005),
        }
        if step > 200 and step % 40 == 0:
            values["road_class"] = rng.choice([0, 1, 2, 2, -1])
            values["road_class_confidence"] = rng.choice([0.9, 0.9, 0.3])
            values["frame_id"] = rng.choice([0, step])
        if rng.random() < 0.005:
            values[rng.choice(SIGNALS)] = rng.choice(SUDDEN)
        if rng.random() < 0.02:
            values |= {"steering_angle": rng.gauss(0.0, 0.1), "yaw_rate": rng.gauss(0.0, 0.1)}
            values |= {"vertical_load": rng.gauss(2900.0, 100.0)}
            values |= {"longitudinal_acceleration": rng.gauss(0.0, 1.0)}
        if rng.random() < 0.004:
            values["road_class"] = rng.choice([7, -5])
        odd = rng.random() < 0.02
        yield values, rng.choice([0.0, 0.01, 1e-4, -1.0, math.nan, 1e9, 11.0]) if odd else 0.001


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


WHEELS = ("fl", "fr", "rl", "rr")
CAR_SIGNALS = (
    *(f"{name}.{wheel}" for name in ("wheel_speed", "wheel_torque", "vertical_load") for wheel in WHEELS),
    *("vehicle_speed", "steering_angle", "longitudinal_acceleration", "lateral_acceleration", "yaw_rate"),
    *("road_class_confidence.left", "road_class_confidence.right"),
)


def drive_of_four(seed, steps):
    """The same as `drive` for the unit of four wheels."""
    rng, speed = random.Random(seed), 12.0
    for step in range(steps):
        values = {}
        for wheel in WHEELS:
            torque = 300.0 * math.sin(0.006 * step) + rng.gauss(0.0, 3.0)
            values[f"wheel_torque.{wheel}"] = torque
            values[f"wheel_speed.{wheel}"] = speed * (1.0 + torque / 20000.0) / 0.29 + rng.gauss(0.0, 0.02)
        speed = max(speed + 3e-3 * math.sin(0.006 * step) - 0.008 * (step > 0.8 * steps), -2.0)
        values["vehicle_speed"] = speed + rng.gauss(0.0, 0.005)
        if step > 100 and step % 40 == 0:
            for side in ("left", "right"):
                values[f"road_class.{side}"] = rng.choice([0, 1, 2, 2, -1])
                values[f"road_class_confidence.{side}"] = rng.choice([0.9, 0.9, 0.3])
            values["frame_id"] = rng.choice([0, step])
        if rng.random() < 0.015:
            values[rng.choice(CAR_SIGNALS)] = rng.choice(SUDDEN)
        if rng.random() < 0.03:
            values |= {"steering_angle": rng.gauss(0.0, 0.1), "yaw_rate": rng.gauss(0.0, 0.1)}
            values |= {"lateral_acceleration": rng.gauss(0.0, 2.0)}
            values |= {"longitudinal_acceleration": rng.gauss(0.0, 1.0)}
        if rng.random() < 0.01:
            values |= {f"vertical_load.{wheel}": rng.gauss(3000.0, 200.0) for wheel in WHEELS}
        if rng.random() < 0.005:
            values["road_class.right"] = rng.choice([7, -5])
        odd = rng.random() < 0.02
        yield values, rng.choice([0.0, 0.01, 1e-4, -1.0, math.nan, 1e9, 11.0]) if odd else 0.001
