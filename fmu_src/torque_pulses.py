"""The unit `TorquePulses`: a driver of periodic driving and braking pulses."""

from __future__ import annotations

from typing import Any, ClassVar

from trpac_core.parameters.configuration import check_parameters
from trpac_core.parameters.variables import Variable

from .guarded_slave import GuardedSlave
from .interface_pulses import TORQUE_PULSES, WHEELS


class TorquePulses(GuardedSlave):
    """Pause, driving pulse, pause, braking pulse, repeated; each pulse is a trapezium."""

    variables: ClassVar[tuple[Variable, ...]] = TORQUE_PULSES

    def initialise(self) -> None:
        """Apply the parameters; ValueError where they cannot be applied."""
        check_parameters(self.variables, self.values)
        self._time_s = 0.0

    def step(self, step_s: float) -> None:
        """Advance the time [s]."""
        self._time_s += step_s
        self._publish()

    def _publish(self) -> None:
        values = self.values
        pause_s, drive_s, brake_s = (
            values[name] for name in ("pulse.pause", "drive.duration", "brake.duration")
        )
        period_s = 2.0 * pause_s + drive_s + brake_s
        since_s = self._time_s % period_s if period_s > 0.0 else 0.0
        driving = values["drive.torque"] * self._height(since_s - pause_s, drive_s)
        braking = values["brake.torque"] * self._height(since_s - 2.0 * pause_s - drive_s, brake_s)
        for wheel in WHEELS:
            share = values["drive.front_share" if wheel.startswith("f") else "drive.rear_share"]
            values[f"wheel_torque.{wheel}"] = share * driving - braking

    def _height(self, since_s: float, duration_s: float) -> float:
        """Value of a pulse of height 1 at a time after its start [-]."""
        ramp_s = self.values["pulse.ramp"]
        return max(0.0, min(1.0, since_s / ramp_s, (duration_s - since_s) / ramp_s))

    def inner_state(self) -> float:
        """The time since the start [s]."""
        return self._time_s

    def restore_inner_state(self, values: dict[str, Any], state: Any) -> None:
        """Restore what `inner_state` returned; the outputs are among the values."""
        self._time_s = float(state)
