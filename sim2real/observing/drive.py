"""A log made ready for the diagnosis: one clock, one rate, the channels that the model predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from scenarios.files import RoadFile
from sim2real.logs.errors import LogError
from sim2real.logs.resampling import SLOWEST_S
from sim2real.observing.lattice import Lattice
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

CHANNELS = (
    "position_m",
    "vehicle_speed_m_s",
    *(f"wheel_speed_{w}_rad_s" for w in WHEELS),
    "accel_x_m_s2",
)
"""The columns that the model predicts, in the order of all channel arrays."""
POSITION, SPEED, WHEEL, ACCEL = 0, 1, slice(2, 6), 6
GROUPS = {
    "position": slice(0, 1),
    "vehicle_speed": slice(1, 2),
    "wheel_speed": slice(2, 6),
    "accel_x": slice(6, 7),
}
"""Signals as the verdict names them, and their channels."""
UNITS = {"position": "m", "vehicle_speed": "m/s", "wheel_speed": "rad/s", "accel_x": "m/s^2"}

BLOCK_S = 0.2
"""Residuals are averaged over blocks of this length to see what noise would average out [s]."""
ANALYSIS_RATE_HZ = 125.0
"""Rate that a faster log is averaged down to: fast enough for driveline oscillation [Hz]."""


@dataclass(frozen=True)
class Drive:
    """One log on the diagnosis' grid.

    Attributes
    ----------
    name : str
        For messages.
    road : RoadFile
        Where it was driven.
    time_s : array, shape (n,)
        Uniform time [s].
    torque_nm : array, shape (n, 4)
        Commanded torque [N m].
    measured : array, shape (n, 7)
        The channels as measured; NaN where a sample is lost or a channel is not measured.
    moving : array of bool, shape (n,)
        Rows in which the car moves, and all wheels forward: at rest nothing of the model shows, and it has no wheels
        that turn back.
    counted : array of bool, shape (7,)
        Channels that are evidence: measured, and not computed from others.
    lattice : Lattice or None
        What a pulse-counting sensor left in the wheel speeds, as logged.
    swing : array, shape (n, 7), or None
        What was taken off `measured` since it repeats with the wheels' angle, see `sim2real.observing.orders`.
    reference : array, shape (n, 7), or None
        What the nominal model leaves of a reference log at the same points of the manoeuvre, in each channel's unit; it
        is subtracted from what any model leaves of this log. NaN where there is no reference; see
        `sim2real.observing.reference`.
    """

    name: str
    road: RoadFile
    time_s: Array
    torque_nm: Array
    measured: Array
    moving: NDArray[np.bool_]
    counted: NDArray[np.bool_]
    lattice: Lattice | None = None
    swing: Array | None = None
    reference: Array | None = None

    @property
    def step_s(self) -> float:
        """Grid step [s]."""
        return float(self.time_s[1] - self.time_s[0])

    def rows_in(self, duration_s: float) -> int:
        """Rows of a block of this length, at least one."""
        return max(round(duration_s / self.step_s), 1)

    def __len__(self) -> int:
        return len(self.time_s)


LEAST_SPEED_M_S = 0.5
"""Below this speed the car counts as standing [m/s]."""
BACKWARD_RAD_S, BACKWARD_S = -1.0, 0.05
"""A wheel that is slower than this, in the median over this time, turns back [rad/s], [s]."""
RECOVERY_S = 2.0
"""Until the model has forgotten what it was not told: twice the observer's memory of the car's speed [s]."""


def make_drive(
    name: str,
    road: RoadFile,
    time_s: Array,
    columns: dict[str, Array],
    without: frozenset[str] = frozenset(),
    lattice: Lattice | None = None,
) -> Drive:
    """Channels of a log that is on a uniform grid.

    Parameters
    ----------
    name, road : str, RoadFile
        What to call it, and where it was driven.
    time_s : array, shape (n,)
        Uniform time [s].
    columns : dict
        The contract's columns, shape (n,) each, NaN where lost.
    without : frozenset of str
        Columns that are not evidence of their own (computed from others); they still tell where on the road the car is.
    lattice : Lattice, optional
        Found in the wheel speeds at the log's own rate.
    """
    measured = np.column_stack([columns[name] for name in CHANNELS]).astype(np.float64)
    torque = np.column_stack([columns[f"wheel_torque_{w}_nm"] for w in WHEELS]).astype(np.float64)
    untold = untold_torque(time_s, torque)
    for i in range(4):  # a lost sample of a command that is continuous
        lost = ~np.isfinite(torque[:, i])
        if lost.all():
            raise LogError(
                f"{name}: column wheel_torque_{WHEELS[i]}_nm tells nothing at any time of the drive."
            )
        if lost.any():
            torque[lost, i] = np.interp(time_s[lost], time_s[~lost], torque[~lost, i])
    speed = measured[:, SPEED]
    moving = np.nan_to_num(speed, nan=np.inf) > LEAST_SPEED_M_S
    moving &= ~(backward(time_s, measured[:, WHEEL]) | untold)
    counted = np.isfinite(measured).any(axis=0) & np.array([name not in without for name in CHANNELS])
    return Drive(name, road, time_s, torque, measured, moving, counted, lattice)


def backward(time_s: Array, wheels: Array) -> NDArray[np.bool_]:
    """Rows in which a wheel turns back, as a motor does with a locked wheel, and those in which it still matters.

    Parameters
    ----------
    time_s : array, shape (n,)
        Uniform time [s].
    wheels : array, shape (n, 4)
        Wheel speeds, NaN where lost [rad/s].
    """
    step_s = time_s[1] - time_s[0]
    rows = 2 * round(0.5 * BACKWARD_S / step_s) + 1
    slowest = np.nan_to_num(wheels, nan=np.inf).min(axis=1)
    back = median_filter(slowest, max(rows, 3), mode="nearest") < BACKWARD_RAD_S
    return _until_forgotten(time_s, back)


def untold_torque(time_s: Array, torque_nm: Array) -> NDArray[np.bool_]:
    """Rows in which a wheel's torque, shape (n, 4), is lost for longer than a line tells, and those after them."""
    known = np.isfinite(torque_nm)
    before = np.maximum.accumulate(np.where(known, time_s[:, None], -np.inf), axis=0)
    after = np.minimum.accumulate(np.where(known, time_s[:, None], np.inf)[::-1], axis=0)[::-1]
    lost = ~known & (after - before > SLOWEST_S)
    return _until_forgotten(time_s, np.asarray(lost.any(axis=1)))


def _until_forgotten(time_s: Array, bad: NDArray[np.bool_]) -> NDArray[np.bool_]:
    since = time_s - np.maximum.accumulate(np.where(bad, time_s, -np.inf))
    return np.asarray(since <= RECOVERY_S)


def awake(drive: Drive) -> Drive:
    """The drive from where the car's speed is known on: by its sensor, or by a wheel where it has none.

    Loggers start before their sensors do, and a model that has to guess how fast the car was is off for seconds.
    """
    speed = drive.measured[:, SPEED]
    known = np.isfinite(speed if np.isfinite(speed).any() else drive.measured[:, WHEEL].T)
    first = int(np.argmax(np.atleast_2d(known).any(axis=0)))
    return replace(
        drive,
        time_s=drive.time_s[first:],
        torque_nm=drive.torque_nm[first:],
        measured=drive.measured[first:],
        moving=drive.moving[first:],
    )


def grid_step(rate_hz: float) -> float:
    """Step of the diagnosis' grid for a log of this rate [s]."""
    return 1.0 / min(rate_hz, ANALYSIS_RATE_HZ)
