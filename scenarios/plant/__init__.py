"""The reference plant: actuators, then dynamics, then sensors."""

from scenarios.plant.pipeline import (
    PlantState,
    PlantTrajectory,
    advance,
    drive,
    initial_state,
    simulate,
)
from scenarios.plant.sensors import make_log, write_log

__all__ = [
    "PlantState",
    "PlantTrajectory",
    "advance",
    "drive",
    "initial_state",
    "make_log",
    "simulate",
    "write_log",
]
