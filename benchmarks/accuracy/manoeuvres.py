"""How often is a claim wrong over speed and adhesion?

Driving, braking, locking, coasting, reversing torque and ABS-like cycling; prints JSON.

.venv/bin/python -m benchmarks.accuracy.manoeuvres

A claim is wrong where the true adhesion is more than 2 TRPAC_std off, and confidently wrong where TRPAC_std is also
below 0.1.
"""

import json
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.random_drives import CAR_FILE, COLUMNS, NOISE, STEP_S, Drive, estimated, told
from scenarios.files import RoadFile, load_vehicle
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log

Array = NDArray[np.float64]

SPEEDS_M_S = (1.0, 3.0, 10.0, 20.0, 40.0)
THETAS = (0.05, 0.1, 0.3, 0.5, 0.8, 1.2)
SECONDS, RAMP_S, CONFIDENT = 3.0, 0.2, 0.1
MOTOR_NM = 320.0

MANOEUVRES: dict[str, Callable[[Array, float], Array]] = {
    "driving": lambda t, grip: min(MOTOR_NM, 0.9 * grip) * np.clip(t / RAMP_S, 0.0, 1.0),
    "braking": lambda t, grip: -0.9 * grip * np.clip(t / RAMP_S, 0.0, 1.0),
    "locking": lambda t, grip: -1.6 * grip * np.clip(t / RAMP_S, 0.0, 1.0) * (t < 2.0),
    "coasting": lambda t, grip: np.zeros_like(t),
    "reversing": lambda t, grip: min(MOTOR_NM, 0.9 * grip) * np.sin(2.0 * np.pi * t),
    "cycling": lambda t, grip: (
        -grip * (0.9 + 0.4 * np.sin(2.0 * np.pi * 5.0 * t)) * np.clip(t / RAMP_S, 0.0, 1.0)
    ),
}
"""Torque of each wheel [N m] over time [s], for a road whose grip is given as a torque at static load [N m]."""


def make_manoeuvre(name: str, speed_m_s: float, theta: float, seed: int = 0) -> Drive:
    """One manoeuvre on an even road."""
    car = load_vehicle(CAR_FILE)
    core = car.to_core()
    segment = {"start_m": 0.0, "mu_left": theta, "mu_right": theta, "surface": "dry"}
    road = RoadFile.model_validate({"schema": 1, "segments": [segment]})
    time_s = np.arange(round(SECONDS / STEP_S)) * STEP_S
    torque = MANOEUVRES[name](time_s, theta * core.wheel_load(True) * core.wheel_radius_m)
    run = simulate(car, road, np.repeat(torque[:, None], 4, axis=1), STEP_S, initial_speed_m_s=speed_m_s)
    rows = make_log(run, car, NOISE, seed)[COLUMNS].to_numpy(copy=True)
    return Drive(rows, run.theta[:, 0], run.position_m, road)


def measure(name: str, speed_m_s: float, theta: float) -> dict[str, float | str]:
    """Shares of wrong and of confidently wrong claims, and the last estimate."""
    drive = make_manoeuvre(name, speed_m_s, theta)
    theta_hat, _, excited, std = estimated(drive, told()).T
    off = np.abs(theta_hat - drive.theta)
    wrong = off > 2.0 * std
    return {
        "manoeuvre": name,
        "speed_m_s": speed_m_s,
        "theta": theta,
        "excited": round(float(excited.mean()), 3),
        "wrong": round(float(wrong.mean()), 3),
        "confidently_wrong": round(float((wrong & (std < CONFIDENT)).mean()), 4),
        "TRPAC": round(float(theta_hat[-1]), 3),
        "TRPAC_std": round(float(std[-1]), 3),
    }


def main() -> None:
    rows = [measure(name, v, theta) for name in MANOEUVRES for v in SPEEDS_M_S for theta in THETAS]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
