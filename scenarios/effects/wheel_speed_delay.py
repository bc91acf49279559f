"""Delay of the wheel-speed sensors."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Array, Effect, Signals, parameter
from scenarios.effects.shifting import advanced, delayed


@dataclass(frozen=True)
class WheelSpeedDelay(Effect):
    """All wheel speeds are reported late; before that their first values hold."""

    id = "wheel_speed_delay"
    stage = "sensors"
    subsystem = "wheel_speed_sensor"
    equation = "omega_read(t) = omega(t - delay), linear between the rows"
    source = "definition"
    excited_by = "strong changes of torque: wheel speeds compared with speed and accelerometer"
    confounders = ("torque_delay", "vehicle_speed_delay", "wheel_speed_quantisation", "tyre_relaxation")

    delay_s: float = parameter(
        "s", "age of the reported speeds", neutral=0.0, low=0.0, high=1.0, starts=(0.01, 0.04, 0.12)
    )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The wheel speeds are late."""
        late = {
            k: delayed(time_s, v, self.delay_s) for k, v in signals.items() if k.startswith("wheel_speed_")
        }
        return {**signals, **late}

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """The wheel speeds are put where they belong."""
        early = {
            k: advanced(time_s, v, self.delay_s) for k, v in signals.items() if k.startswith("wheel_speed_")
        }
        return {**signals, **early}
