"""First-order lag of the torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from scenarios.effects.base import Array, Effect, parameter


@dataclass(frozen=True)
class TorqueLag(Effect):
    """The torque follows its command with a first-order lag, settled on the first row's command before it."""

    id = "torque_lag"
    form = "in one stage"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "time_constant T_true' = T - T_true, exact for a command linear between the rows"
    source = "Kiencke and Nielsen (2005), Automotive Control Systems; definition"
    excited_by = "steps of torque, at any speed"
    look_alikes = ("torque_delay", "tyre_relaxation", "driveline_compliance", "wheel_inertia_offset")

    time_constant_s: float = parameter(
        "s",
        "time until a step has come to 63 %",
        neutral=0.0,
        low=0.0,
        high=2.0,
        starts=(0.02, 0.1, 0.3),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Solve the lag over each row's interval in closed form."""
        if self.time_constant_s == 0.0 or len(time_s) < 2:
            return torque_nm
        ratio = self.time_constant_s * (len(time_s) - 1) / (time_s[-1] - time_s[0])
        decay = np.exp(-1.0 / ratio)
        gain = -np.expm1(-1.0 / ratio)
        now, before = 1.0 - ratio * gain, ratio * gain - decay
        settled = torque_nm[:1] * (1.0 - now)
        lagged, _ = lfilter([now, before], [1.0, -decay], torque_nm, axis=0, zi=settled)
        return np.asarray(lagged)


@dataclass(frozen=True)
class TorqueLagInTwoStages(TorqueLag):
    """Two like lags behind each other, as of a current's control and a filter; the time constant is their sum."""

    form = "in two stages"
    equation = "two lags of time_constant / 2 each"

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """The first stage's output is the second's command."""
        stage = TorqueLag(0.5 * self.time_constant_s)
        return stage.actuate(time_s, stage.actuate(time_s, torque_nm))
