"""Scale of the ground-speed sensor."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Array, Effect, Signals, parameter


@dataclass(frozen=True)
class VehicleSpeedScale(Effect):
    """The sensor of the speed over ground reads the true speed times one factor."""

    id = "vehicle_speed_scale"
    stage = "sensors"
    subsystem = "vehicle_speed_sensor"
    equation = "v_read = factor v"
    source = "definition"
    excited_by = "free rolling at any speed; position compared with speed"
    confounders = ("wheel_radius_offset", "tyre_stiffness_offset")

    factor: float = parameter(
        "-",
        "reading over true speed",
        neutral=1.0,
        low=0.5,
        high=1.5,
        starts=(0.95, 0.985, 1.015, 1.05),
    )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The speed is scaled."""
        return {**signals, "vehicle_speed_m_s": signals["vehicle_speed_m_s"] * self.factor}

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """The factor is divided out."""
        return {**signals, "vehicle_speed_m_s": signals["vehicle_speed_m_s"] / self.factor}
