"""The plant's car with any effects, roads by their friction, and torques over time."""

from pathlib import Path

import numpy as np

from scenarios.files import RoadFile, VehicleFile, load_vehicle

SCENARIOS = Path(__file__).parents[2] / "scenarios"
CAR = load_vehicle(SCENARIOS / "vehicles" / "four_in_wheel_motor_ev.yaml")


def make_road(*segments):
    rows = [
        {"start_m": float(start), "mu_left": left, "mu_right": right, "surface": "dry"}
        for start, left, right in segments
    ]
    return RoadFile.model_validate({"schema": 1, "segments": rows})


def with_effects(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


def constant(torque_nm, duration_s, step_s=1e-3):
    return np.full((round(duration_s / step_s) + 1, 4), float(torque_nm))


def profile(knots, duration_s, step_s=1e-3):
    """Torque of all wheels through (time, torque) knots."""
    time_s = np.arange(round(duration_s / step_s) + 1) * step_s
    times, torques = zip(*knots, strict=True)
    return np.repeat(np.interp(time_s, times, torques)[:, None], 4, axis=1)


EVERYTHING = {
    "driveline_compliance": {"stiffness_nm_rad": 1e4, "damping_nm_s_rad": 20.0, "motor_inertia_kg_m2": 0.4},
    "tyre_relaxation": {"length_m": 0.3},
    "load_transfer": {"cog_height_m": 0.54},
    "aero_drag": {"drag_area_m2": 0.7},
    "rolling_resistance": {"coefficient": 0.01},
    "brake_drag": {"torque_nm": 10.0},
    "road_grade": {"grade": 0.05},
    "friction_falloff": {"falloff_s_m": 0.1, "floor": 0.5},
}
