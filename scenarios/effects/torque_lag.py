"""First-order lag of the torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from scenarios.effects.base import Array, Effect, parameter


@dataclass(frozen=True)
class TorqueLag(Effect):
    """The torque follows its command with a first-order lag; it starts at the command of the first row."""

    id = "torque_lag"
    form = "in one stage"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "time_constant T_true' = T - T_true, exact for a command linear between the rows"
    source = "Kiencke and Nielsen (2005), Automotive Control Systems; definition"
    excited_by = "steps of torque, at any speed"
    confounders = ("torque_delay", "tyre_relaxation", "driveline_compliance", "wheel_inertia_offset")

    time_constant_s: float = parameter(
        "s",
        "time to 63 % of a step",
        neutral=0.0,
        low=0.0,
        high=2.0,
        starts=(0.02, 0.1, 0.3),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Solve the lag over each row's interval in closed form."""
        if self.time_constant_s == 0.0 or len(time_s) < 2:
            return torque_nm
        from scipy.signal import lfilter  # here, since its import takes longer than all else of a plant

        ratio = self.time_constant_s * (len(time_s) - 1) / (time_s[-1] - time_s[0])
        decay = np.exp(-1.0 / ratio)
        gain = -np.expm1(-1.0 / ratio)
        now, before = 1.0 - ratio * gain, ratio * gain - decay
        settled = torque_nm[:1] * (1.0 - now)
        lagged, _ = lfilter([now, before], [1.0, -decay], torque_nm, axis=0, zi=settled)
        return np.asarray(lagged)


@dataclass(frozen=True)
class TorqueLagInTwoStages(TorqueLag):
    """Two equal lags in series, for example current control and filter; the time constant is their sum."""

    form = "in two stages"
    equation = "two lags of time_constant / 2 each"

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """The first stage's output is the second's command."""
        stage = TorqueLag(0.5 * self.time_constant_s)
        return stage.actuate(time_s, stage.actuate(time_s, torque_nm))


@dataclass(frozen=True)
class TorqueLagOfRiseAndFall(TorqueLag):
    """Torque rises more slowly or faster than it falls; `time_constant_s` is the mean."""

    form = "rising and falling unlike"
    equation = "time_constant (1 + apart) where the torque grows, time_constant (1 - apart) where it falls"

    apart: float = parameter(
        "-",
        "half of the difference, rising minus falling, over the mean",
        neutral=0.0,
        low=-0.8,
        high=0.8,
        starts=(-0.3, 0.3),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """In parts of a row, each with the time constant of its beginning."""
        if self.apart == 0.0 or self.time_constant_s == 0.0 or len(time_s) < 2:
            return super().actuate(time_s, torque_nm)
        step_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1) / PARTS
        growing, falling = (self.time_constant_s * (1.0 + sign * self.apart) / step_s for sign in (1.0, -1.0))
        return np.asarray(_follow(np.ascontiguousarray(torque_nm, dtype=np.float64), growing, falling))


PARTS = 4
"""Parts of a row in each of which the torque either grows or falls."""


@njit(cache=True)
def _follow(torque_nm: Array, growing: float, falling: float) -> Array:
    """The lag of each wheel, exact for a command linear between the rows; time constants in parts of a row."""
    followed = np.empty_like(torque_nm)
    for wheel in range(torque_nm.shape[1]):
        y = torque_nm[0, wheel]
        followed[0, wheel] = y
        for i in range(1, len(torque_nm)):
            command_nm = torque_nm[i - 1, wheel]
            slope = (torque_nm[i, wheel] - command_nm) / PARTS
            for _ in range(PARTS):
                ratio = growing if y * (command_nm + 0.5 * slope - y) >= 0.0 else falling
                behind = ratio * slope
                y = command_nm + slope - behind + (y - command_nm + behind) * np.exp(-1.0 / ratio)
                command_nm += slope
            followed[i, wheel] = y
    return followed
