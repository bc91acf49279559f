"""Bias of the accelerometer."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Array, Effect, Signals, parameter


@dataclass(frozen=True)
class AccelerometerBias(Effect):
    """The accelerometer has a constant offset, from the sensor itself or from a tilted mounting."""

    id = "accelerometer_bias"
    stage = "sensors"
    subsystem = "accelerometer"
    equation = "a_read = a + bias"
    source = "definition"
    excited_by = "any driving: accelerometer compared with the change of speed"
    confounders = ("road_grade",)

    bias_m_s2: float = parameter(
        "m/s^2",
        "reading at standstill on level ground",
        neutral=0.0,
        low=-5.0,
        high=5.0,
        starts=(-0.3, -0.1, 0.1, 0.3),
    )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The bias is added."""
        return {**signals, "accel_x_m_s2": signals["accel_x_m_s2"] + self.bias_m_s2}

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """The bias is subtracted."""
        return {**signals, "accel_x_m_s2": signals["accel_x_m_s2"] - self.bias_m_s2}
