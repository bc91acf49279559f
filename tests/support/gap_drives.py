"""Short drives of the plant, on the diagnosis' grid, for the tests of its core."""

from __future__ import annotations

import numpy as np
from random_gap_drives import BARE, Case, drives

from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import simulate
from sim2real.observing.drive import CHANNELS, make_drive
from sim2real.observing.observer import Simulation
from trpac_core.vehicle import WHEELS

MODEL = Simulation(BARE)
STEP_S = 0.008
SIGMA = np.array([0.02, 0.02, 0.05, 0.05, 0.05, 0.05, 0.08])
"""Noise of `driven`, in the channels' units."""


def random_drives(effects, count=2, seed=0, duration_s=10.0, **case):
    """Logs of the benchmark's random driving by a car with these effects."""
    return drives(Case(effects, seed=seed, duration_s=duration_s, **case), count)


def road_of(*thetas, length_m=40.0):
    """Stretches of equal length."""
    return RoadFile.model_validate(
        {
            "schema": 1,
            "segments": [
                {"start_m": i * length_m, "mu_left": theta, "mu_right": theta, "surface": "dry"}
                for i, theta in enumerate(thetas)
            ],
        }
    )


DRY = road_of(0.9)


def trace(*points, duration_s):
    """Torque that is the same at all wheels, linear between (time [s], torque [N m]), shape (n, 4)."""
    times, values = zip(*points, strict=True)
    time_s = np.arange(round(duration_s / STEP_S) + 1) * STEP_S
    return np.repeat(np.interp(time_s, times, values)[:, None], 4, axis=1)


def pulses(duration_s):
    """Drive, coast, brake, again and again: no wheel slides on a dry road."""
    points = []
    for k in range(int(duration_s / 4.0) + 1):
        points += [(4 * k + t, T) for t, T in ((0, 0), (0.5, 0), (0.7, 200), (1.7, 200), (1.9, 0), (2.4, 0))]
        points += [(4 * k + t, T) for t, T in ((2.6, -180), (3.6, -180), (3.8, 0))]
    return trace(*points, duration_s=duration_s)


def clean(torque_nm, speed_m_s, road=DRY, effects=None, commanded_nm=None, car=BARE):
    """A drive without noise; where `commanded_nm` is given, the log tells of that torque."""
    car = VehicleFile.model_validate({**car.model_dump(by_alias=True), "effects": effects or {}})
    run = simulate(car, road, torque_nm, STEP_S, speed_m_s, 0.0)
    signals = (run.position_m, run.speed_m_s, *run.wheel_speed_rad_s.T, run.accel_x_m_s2)
    columns = dict(zip(CHANNELS, signals, strict=True))
    for effect in car.make_effects():
        columns = effect.sense(run.time_s, columns)
    told = torque_nm if commanded_nm is None else commanded_nm
    columns |= {f"wheel_torque_{w}_nm": told[:, i] for i, w in enumerate(WHEELS)}
    return make_drive("drive", road, run.time_s, columns)


def noisy(drive, seed=0, sigma=SIGMA):
    """The drive with white noise on its channels."""
    noise = np.random.default_rng(seed).standard_normal(drive.measured.shape)
    return remeasured(drive, drive.measured + sigma * noise)


def remeasured(drive, measured):
    """The drive with other readings of the channels."""
    columns = dict(zip(CHANNELS, measured.T, strict=True))
    columns |= {f"wheel_torque_{w}_nm": drive.torque_nm[:, i] for i, w in enumerate(WHEELS)}
    return make_drive(drive.name, drive.road, drive.time_s, columns, lattice=drive.lattice)


def rms(values, axis=0):
    """Root mean square of what is finite."""
    return np.sqrt(np.nanmean(np.square(values), axis=axis))
