"""Residuals that another build of a car makes, and those of faults that no effect of the library has the form of.

Both are linear: a column is what a small change leaves through the observer, over that change.

References
----------
.. [1] Kennedy, O'Hagan (2001), Bayesian calibration of computer models, J. R. Statist. Soc. B 63, 425-464.
.. [2] Brynjarsdottir, O'Hagan (2014), Learning about physical parameters: the importance of model discrepancy,
   Inverse Problems 30, 114007.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from scenarios.effects import Effect
from scenarios.effects.friction_falloff import FrictionFalloff
from scenarios.effects.friction_offset import FrictionOffset
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, WHEEL, Drive
from sim2real.observing.observer import Prediction, Push, Simulation
from trpac_core.vehicle import GRAVITY_M_S2, WHEELS

Array = NDArray[np.float64]
Column = tuple[str, Push]

GRIP_KNOTS = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Knots of the slip correction over used grip |F_x| / (theta F_z) [-]."""
LIMIT_GRIP, LIMIT_SLIP, LIMIT_S = 0.85, 0.12, 0.3
"""Used grip and slip from which a tyre is near its limit [-], and how long before and after that counts [s]."""
SMOOTHING_S = 0.1
"""Window over which the force that moves the body is averaged [s]."""
SLOWEST_M_S = 3.0
"""Least speed that slip is divided by [m/s]."""
FORCE_KNOT_S = 2.0
"""Distance of the knots of a force over time [s]."""
OVER_TIME = "force over time"
"""Name of the columns of such a force, one per knot."""
FORCE_M_S2 = 0.2
"""Size of a force over time: prior standard deviation at each knot [m/s^2]."""


def of_build(model: Simulation, drive: Drive) -> tuple[list[Column], NDArray[np.bool_]]:
    """Columns of another build of the car along a drive, and the rows in which a tyre is near its limit.

    Slip at the same force over signed used grip, per axle; slip stiffness that goes with load; relaxation; pitch at the
    accelerometer; small resistances and shares of the acceleration; rolling radii.
    """
    said = model.predict(drive)
    tyres = _Tyres(model, drive, said)
    return [*_slip(tyres), *_smaller(tyres)], tyres.near_limit()


class _Tyres:
    """What the tyres do along a drive, as the nominal model says."""

    def __init__(self, model: Simulation, drive: Drive, said: Prediction) -> None:
        car = model.vehicle
        self.car, self.drive, self.states = car, drive, np.nan_to_num(said.states)
        force = np.nan_to_num(said.force_n)
        self.grip = np.clip(np.nan_to_num(force / np.maximum(said.theta * said.load_n, 1.0)), -1.0, 1.0)
        self.slip = np.clip(force / car.tyre.longitudinal_stiffness_n, -0.05, 0.05)
        self.speed = np.maximum(self.states[:, SPEED], 0.0)
        self.accel = uniform_filter1d(force.sum(axis=1) / car.mass_kg, drive.rows_in(SMOOTHING_S))
        self.turning = self.slip * self.speed[:, None] / car.wheel_radius_m
        """Wheel speed that the linear slip makes, shape (n, 4) [rad/s]."""

    def near_limit(self) -> NDArray[np.bool_]:
        """Rows in which a tyre is near its limit, by the model or as measured."""
        measured, radius = self.drive.measured, self.car.wheel_radius_m
        rim = measured[:, WHEEL] * radius - measured[:, [SPEED]]
        slip = np.abs(np.nan_to_num(rim)) / np.maximum(np.nan_to_num(measured[:, [SPEED]]), SLOWEST_M_S)
        limit = ((np.abs(self.grip) > LIMIT_GRIP) | (slip > LIMIT_SLIP)).any(axis=1)
        return maximum_filter1d(limit, 2 * self.drive.rows_in(LIMIT_S) + 1)

    def reads(self, offset: Array, *channels: int) -> Push:
        """Channels that read otherwise by an offset, shape (n,) or (n, number of channels)."""
        still = self.nothing()
        still.offset[:, list(channels)] = offset if offset.ndim == 2 else offset[:, None]
        return still

    def nothing(self) -> Push:
        """No push at all."""
        n = len(self.drive)
        return Push(np.zeros((n, 4)), np.zeros(n), False, np.zeros((n, len(CHANNELS))))

    def turned(self, torque_nm: Array) -> Push:
        """A torque at the wheels, shape (n, 4)."""
        none = self.nothing()
        return Push(torque_nm, none.accel_m_s2, False, none.offset)

    def forced(self, accel_m_s2: Array) -> Push:
        """A force on the body, as an acceleration."""
        none = self.nothing()
        return Push(none.torque_nm, accel_m_s2, True, none.offset)


ALL_WHEELS = range(*WHEEL.indices(len(CHANNELS)))
AXLES = {"front": (0, 1), "rear": (2, 3)}


def _slip(tyres: _Tyres) -> Iterator[Column]:
    hats = np.eye(len(GRIP_KNOTS))
    for axle, wheels in AXLES.items():
        grip = tyres.grip[:, list(wheels)]
        for knot, hat in zip(GRIP_KNOTS, hats, strict=True):
            for side, sign in (("drive", 1.0), ("brake", -1.0)):
                share = np.interp(np.abs(grip), GRIP_KNOTS, hat) * (np.sign(grip) == sign)
                offset = tyres.turning[:, list(wheels)] * share
                if np.abs(offset).max() > 1e-9:
                    yield f"slip {axle} {side} {knot:g}", tyres.reads(offset, *(2 + w for w in wheels))


def _smaller(tyres: _Tyres) -> Iterator[Column]:
    """Columns per unit: load exponent [-], relaxation [m], resistance [m/s^2]; of all else a share [-]."""
    car, drive, accel = tyres.car, tyres.drive, tyres.accel
    rear = car.cog_to_rear_axle_m
    front, shift = car.wheelbase_m - rear, accel * car.cog_height_m / GRAVITY_M_S2
    load = np.column_stack([-shift / rear, -shift / rear, shift / front, shift / front]).clip(-0.8, 0.8)
    yield "stiffness by load", tyres.reads(-tyres.turning * load, *ALL_WHEELS)
    rate = np.gradient(uniform_filter1d(tyres.slip, drive.rows_in(SMOOTHING_S), axis=0), drive.step_s, axis=0)
    yield "relaxation", tyres.reads(rate / car.wheel_radius_m, *ALL_WHEELS)
    yield "pitch", tyres.reads(accel, ACCEL)
    even = np.ones(len(drive))
    yield "resistance", tyres.forced(even)
    yield "resistance over speed squared", tyres.forced(even * (tyres.speed / 20.0) ** 2)
    yield "share of acceleration", tyres.forced(accel)
    yield "share of braking", tyres.forced(np.minimum(accel, 0.0))
    turning = tyres.states[:, WHEEL]
    rate = np.gradient(uniform_filter1d(turning, drive.rows_in(SMOOTHING_S), axis=0), drive.step_s, axis=0)
    yield "inertia", tyres.turned(-car.wheel_inertia_kg_m2 * rate)
    yield "radius", tyres.reads(turning, *ALL_WHEELS)
    yield "radius, front against rear", tyres.reads(turning * np.array([1.0, 1.0, -1.0, -1.0]), *ALL_WHEELS)


def of_tyres(model: Simulation) -> dict[str, tuple[float, Simulation]]:
    """Models with another tyre, and the size of the change [-]: peak friction, and its fall over sliding speed."""
    changed: dict[str, tuple[float, Effect]] = {
        "friction": (-0.1, FrictionOffset(1.0 - 0.1)),
        "fall": (0.2, FrictionFalloff(0.3, 1.0 - 0.2)),
    }
    return {
        name: (size, model.with_effects(effect))
        for name, (size, effect) in changed.items()
        if not model.has(effect.id)
    }


def of_other_faults(model: Simulation, drive: Drive) -> list[Column]:
    """Columns of faults that no effect of the library has the form of.

    One wheel's torque, brake, drag or radius; brakes that fade with heat; a force over time.
    """
    said = model.predict(drive)
    tyres, torque = _Tyres(model, drive, said), np.asarray(drive.torque_nm)
    turning, braking = tyres.states[:, WHEEL], np.minimum(torque, 0.0)

    columns: list[Column] = []
    for i, wheel in enumerate(WHEELS):
        only = np.eye(4)[i]
        columns += [
            (f"torque {wheel}", tyres.turned(0.1 * torque * only)),
            (f"brake {wheel}", tyres.turned(0.1 * braking * only)),
            (f"drag {wheel}", tyres.turned(-10.0 * (turning > 1.0) * only)),
            (f"radius {wheel}", tyres.reads(0.01 * turning[:, i], 2 + i)),
        ]
    heat = np.cumsum(-braking * turning, axis=0) * drive.step_s / 1e5
    columns.append(("fading brakes", tyres.turned(0.1 * braking * heat)))
    knots = np.arange(drive.time_s[0], drive.time_s[-1] + FORCE_KNOT_S, FORCE_KNOT_S)
    for hat in np.eye(len(knots)):
        force = FORCE_M_S2 * np.interp(drive.time_s, knots, hat)
        columns.append((OVER_TIME, tyres.forced(force)))
    return columns
