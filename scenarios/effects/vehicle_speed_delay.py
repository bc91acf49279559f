"""Delay of the ground-speed sensor."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Array, Effect, Signals, parameter
from scenarios.effects.shifting import advanced, delayed


@dataclass(frozen=True)
class VehicleSpeedDelay(Effect):
    """The speed over ground is reported late; before that its first value holds."""

    id = "vehicle_speed_delay"
    stage = "sensors"
    subsystem = "vehicle_speed_sensor"
    equation = "v_read(t) = v(t - delay), linear between the rows"
    source = "definition"
    excited_by = "strong changes of acceleration: speed compared with accelerometer and wheels"
    confounders = ("wheel_speed_delay", "torque_delay", "tyre_relaxation")

    delay_s: float = parameter(
        "s", "age of the reported speed", neutral=0.0, low=0.0, high=1.0, starts=(0.01, 0.04, 0.12)
    )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The speed is late."""
        late = delayed(time_s, signals["vehicle_speed_m_s"], self.delay_s)
        return {**signals, "vehicle_speed_m_s": late}

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """The speed is put where it belongs."""
        early = advanced(time_s, signals["vehicle_speed_m_s"], self.delay_s)
        return {**signals, "vehicle_speed_m_s": early}
