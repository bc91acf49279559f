"""The variables of the unit `TorquePulses`, in the order of their value references."""

from __future__ import annotations

from trpac_core.parameters.variables import Kind, Variable

WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
MOST_TORQUE_NM = 20_000.0
"""Greatest torque, that of the plant [N m]."""


def _parameter(
    name: str, unit: str, description: str, start: float, least: float, most: float | None
) -> Variable:
    return Variable(name, Kind.REAL, "parameter", "fixed", description, unit, start, least, most)


TORQUE_PULSES = (
    *(
        Variable(
            f"wheel_torque.{wheel}",
            Kind.REAL,
            "output",
            "continuous",
            f"{wheel_name[0].upper()}{wheel_name[1:]} wheel: torque for the next step, positive drives",
            "N.m",
            None,
            -MOST_TORQUE_NM,
            MOST_TORQUE_NM,
            300.0,
        )
        for wheel, wheel_name in WHEELS.items()
    ),
    _parameter(
        "drive.torque", "N.m", "Torque of a driving pulse at each driven wheel", 240.0, 0.0, MOST_TORQUE_NM
    ),
    _parameter("drive.duration", "s", "Duration of a driving pulse, ramps included", 1.5, 0.0, None),
    _parameter(
        "brake.torque",
        "N.m",
        "Torque of a braking pulse at each wheel, as a positive number",
        240.0,
        0.0,
        MOST_TORQUE_NM,
    ),
    _parameter("brake.duration", "s", "Duration of a braking pulse, ramps included", 0.4, 0.0, None),
    _parameter("pulse.ramp", "s", "Duration of the rise and of the fall of a pulse", 0.05, 1e-6, None),
    _parameter("pulse.pause", "s", "Pause before each driving and each braking pulse", 0.1, 0.0, None),
    _parameter(
        "drive.front_share",
        "1",
        "Torque of the front wheels in a driving pulse, as a share of drive.torque",
        1.0,
        0.0,
        1.0,
    ),
    _parameter(
        "drive.rear_share",
        "1",
        "Torque of the rear wheels in a driving pulse, as a share of drive.torque",
        1.0,
        0.0,
        1.0,
    ),
)
"""Variables of the unit `TorquePulses`."""
