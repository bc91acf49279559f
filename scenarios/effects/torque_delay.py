"""Dead time of the torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.effects.base import Array, Effect, parameter
from scenarios.effects.shifting import delayed


@dataclass(frozen=True)
class TorqueDelay(Effect):
    """The torque follows its command after a dead time; before that the command of the first row holds."""

    id = "torque_delay"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "T_true(t) = T(t - delay), linear between the rows"
    source = "definition"
    excited_by = "steps of torque, at any speed"
    confounders = ("torque_lag", "wheel_speed_delay", "tyre_relaxation", "driveline_compliance")

    delay_s: float = parameter(
        "s",
        "dead time between command and torque",
        neutral=0.0,
        low=0.0,
        high=1.0,
        starts=(0.01, 0.04, 0.12),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """All wheels' torque is late."""
        return np.column_stack([delayed(time_s, wheel, self.delay_s) for wheel in torque_nm.T])
