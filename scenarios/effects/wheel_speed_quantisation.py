"""Wheel speeds from counted pulses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.effects.base import Array, Effect, Signals, parameter
from scenarios.effects.shifting import advanced

MOST_TEETH = 20_000.0
"""More pulses per revolution than any counter has [-]."""


@dataclass(frozen=True)
class WheelSpeedQuantisation(Effect):
    """Pulses are counted over consecutive windows; each count is reported during the next window.

    Windows and pulses begin with the first row; before it the wheels have the speed of the first row.
    """

    id = "wheel_speed_quantisation"
    stage = "sensors"
    subsystem = "wheel_speed_sensor"
    equation = "omega_read = 2 pi counts / (teeth window), counts of the last full window"
    source = "Kiencke and Nielsen (2005), Automotive Control Systems; pulse counting as with a toothed ring"
    excited_by = "any driving: steps of 2 pi / (teeth window), one window late on average"
    confounders = ("wheel_speed_delay",)

    teeth: float = parameter(
        "-", "pulses per revolution", neutral=48.0, low=1.0, high=MOST_TEETH, starts=(48.0, 100.0)
    )
    window_s: float = parameter(
        "s",
        "length of a window; 0 is an ideal sensor",
        neutral=0.0,
        low=0.0,
        high=0.5,
        starts=(0.01, 0.02, 0.05),
    )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """Each wheel's speed is counted anew."""
        if self.window_s == 0.0:
            return signals
        counted = {k: self._count(time_s, v) for k, v in signals.items() if k.startswith("wheel_speed_")}
        return {**signals, **counted}

    @property
    def age_s(self) -> float:
        """Mean age of what is read: half a window of counting and half a window of holding [s]."""
        return self.window_s

    def correct(self, time_s: Array, signals: Signals) -> Signals:
        """What is read, earlier by its mean age."""
        early = {
            k: advanced(time_s, v, self.age_s) for k, v in signals.items() if k.startswith("wheel_speed_")
        }
        return {**signals, **early}

    def _count(self, time_s: Array, speed_rad_s: Array) -> Array:
        since = time_s - time_s[0]
        # A row that falls on a window's end already reports that window, however its time was rounded.
        window = np.floor(since / self.window_s + 1e-9)
        ends = np.asarray(np.arange(-1, int(window[-1]) + 1) * self.window_s, dtype=np.float64)
        pulses = np.floor(_angle(since, speed_rad_s, ends) * (self.teeth / (2.0 * np.pi)) + 1e-9)
        return (np.diff(pulses) * (2.0 * np.pi / (self.teeth * self.window_s)))[window.astype(int)]


def _angle(time_s: Array, speed_rad_s: Array, at_s: Array) -> Array:
    """Angle turned since time 0 at other times [rad]: the integral of a speed that is linear between the rows."""
    turned = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time_s) * (speed_rad_s[1:] + speed_rad_s[:-1]))])
    row = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 1)
    there = np.interp(at_s, time_s, speed_rad_s)
    return np.asarray(turned[row] + 0.5 * (at_s - time_s[row]) * (speed_rad_s[row] + there))
