"""The next manoeuvre: the profile on which two effects differ most, with the predicted distance."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import Effect
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import simulate
from sim2real.hypotheses.contest import Entry, Progress, silent
from sim2real.hypotheses.fitting import fit
from sim2real.observing.doubt import doubt
from sim2real.observing.drive import CHANNELS, Drive, make_drive
from sim2real.observing.evidence import Evidence
from sim2real.observing.noise import Noise, widening
from sim2real.observing.observer import Simulation
from sim2real.result import NextManoeuvre
from trpac_core.vehicle import WHEELS

Array = NDArray[Any]

STEP_S = 0.005
DURATION_S = 12.0
SEPARATE_SIGMA = 5.0
"""Distance from which on two effects are told apart reliably [standard deviations]."""


@dataclass(frozen=True)
class Profile:
    """A manoeuvre to choose from.

    Torque over time is a share of the motor's peak where it drives (above 0), of full braking below.
    """

    name: str
    sentence: str
    initial_speed_m_s: float
    times_s: tuple[float, ...]
    shares: tuple[float, ...]


STEADY_SPEEDS = Profile(
    "steady speeds",
    "Hold 8 m/s for four seconds, drive three seconds at full torque, then hold the speed for four seconds.",
    8.0,
    (0, 4, 4.5, 7.5, 8, 12),
    (0.05, 0.05, 1, 1, 0.08, 0.08),
)
"""It also tells effects of the camera chain apart: borders that are crossed fast and slowly."""

BRAKING = Profile(
    "brake to the limit",
    "From 18 m/s increase the brake force slowly until the wheels are about to lock, release, and repeat at the "
    "remaining speed.",
    18.0,
    (0, 1, 2, 2.2, 5.5, 5.7, 7, 7.2, 10, 10.2, 12),
    (0.5, 0.5, 0, -0.2, -1.0, 0, 0.8, -0.2, -1.0, 0, 0),
)
"""It also tells whose friction value is wrong: the tyres show the road's."""

PROFILES = (
    Profile("coast-down", "Coast down from 30 m/s without any torque.", 30.0, (0.0, 12.0), (0.0, 0.0)),
    STEADY_SPEEDS,
    Profile(
        "steady acceleration",
        "Accelerate from 3 m/s with half torque for ten seconds.",
        3.0,
        (0, 0.5, 10, 10.5, 12),
        (0, 0.5, 0.5, 0, 0),
    ),
    Profile(
        "tip-in and tip-out",
        "At 10 m/s step the accelerator on and off, once per second.",
        10.0,
        tuple(float(t) for k in range(12) for t in (k, k + 0.03, k + 0.5, k + 0.53)),
        (-0.1, 0.8, 0.8, -0.1) * 12,
    ),
    Profile(
        "torque sweep",
        "From 8 m/s raise the torque slowly to its peak, then lower it.",
        8.0,
        (0, 5, 10, 12),
        (0, 1, 0, 0),
    ),
    BRAKING,
    Profile(
        "pulses at two speeds",
        "Short full-torque pulses at 5 m/s, and again at higher speed, with one tip-out between.",
        5.0,
        (0, 0.5, 0.6, 1.0, 1.1, 2, 2.1, 2.5, 2.6, 3, 9, 9.1, 9.5, 9.6, 10.5, 10.6, 11, 11.1, 12),
        (0, 0, 1, 1, 0, 0, 1, 1, 0, 0.8, 0.8, 0, 0, 1, 1, -0.6, -0.6, 0, 0),
    ),
)
BRAKE_SHARE = 0.95
"""Full brake is this share of the friction on the front axle at static load on the road's best segment [-]."""


def propose(
    model: Simulation,
    a: Entry,
    b: Entry,
    road: RoadFile,
    noise: Noise,
    now_sigma: float,
    step_s: float,
    progress: Progress = silent,
) -> NextManoeuvre:
    """The profile that tells two fitted entries apart best.

    Parameters
    ----------
    model : Simulation
        The simulation without either.
    a, b : Entry
        Fitted candidates.
    road : RoadFile
        Where it would be driven.
    noise : Noise
        Of the sensors.
    now_sigma : float
        Their distance on the data at hand.
    step_s : float
        Of the rows that the noise is told for [s].
    progress : callable
        Told the stage, and how much of how much is done.
    """
    best: tuple[float, Profile, Array, Array] | None = None
    for number, profile in enumerate(PROFILES):
        time_s, torque = torque_of(profile, model.vehicle, road)
        power = min(
            separation(model, truth, rival, road, noise, profile, time_s, torque, step_s)
            for truth, rival in ((a, b), (b, a))
            if not set(truth.ids) < set(rival.ids)  # a pair holds its members: it never differs from them
        )
        if best is None or power > best[0]:
            best = (power, profile, time_s, torque)
        progress("next manoeuvre", number + 1, len(PROFILES))
    assert best is not None
    power, profile, time_s, torque = best
    names = (a.name, b.name)
    verdict = (
        f"The predicted distance between {names[0]} and {names[1]} is {power:.0f} standard deviations"
        if power >= SEPARATE_SIGMA
        else f"The predicted distance between {names[0]} and {names[1]} is only {power:.1f} standard deviations"
    )
    at_hand = f"in the present logs it is {now_sigma:.1f}"
    if now_sigma >= power:
        better = min((a, b), key=lambda entry: entry.loss).name
        at_hand += f", in favour of {better}, which may come from other model differences"
    return NextManoeuvre(
        f"{profile.sentence} {verdict}; {at_hand}.",
        profile.initial_speed_m_s,
        time_s[::2],
        torque[::2],
        names,
        power,
        now_sigma,
    )


def torque_of(profile: Profile, vehicle: VehicleFile, road: RoadFile) -> tuple[Array, Array]:
    """Time (n,) [s] and torque (n, 4) [N m] of a profile for a car."""
    time_s: Array = np.arange(round(DURATION_S / STEP_S) + 1) * STEP_S
    share = np.interp(time_s, profile.times_s, profile.shares)
    grip = max(max(s.mu_left, s.mu_right) for s in road.segments)
    car = vehicle.to_core()
    torque = np.empty((len(time_s), 4))
    for i in range(4):
        brake = BRAKE_SHARE * grip * car.wheel_load(front=i < 2) * vehicle.wheel_radius_m
        torque[:, i] = np.where(share > 0.0, share * vehicle.motor_peak_torque_nm, share * brake)
    return time_s, torque


def separation(
    model: Simulation,
    truth: Entry,
    rival: Entry,
    road: RoadFile,
    noise: Noise,
    profile: Profile,
    time_s: Array,
    torque: Array,
    step_s: float,
) -> float:
    """Distance that is left when the rival is fitted to what the truth would do, in standard deviations."""
    on_grid = np.arange(0.0, time_s[-1], step_s)
    torque = np.column_stack([np.interp(on_grid, time_s, of_wheel) for of_wheel in torque.T])
    drive = imagined(model, truth, road, profile, torque, step_s)
    sure = replace(noise, widening=widening(doubt(model, drive), noise.sigma))
    evidence = Evidence((drive,), (sure,))
    refit = fit(rival.fitted.candidate, evidence, rival.fitted.x)
    return float(np.sqrt(refit.loss))


def imagined(
    model: Simulation, entry: Entry, road: RoadFile, profile: Profile, torque: Array, step_s: float
) -> Drive:
    """The drive as a car with the entry's effects would do it, without noise, in steps of the noise's rows."""
    found = entry.fitted
    effects: list[Effect] = list(model.with_effects(*found.candidate.effects(found.x)).effects)
    forms = {e.id: e.form for e in effects if e.form}
    car = model.vehicle.model_copy(update={"effects": {e.id: asdict(e) for e in effects}, "forms": forms})
    run = simulate(car, road, torque, step_s, profile.initial_speed_m_s, 0.0)
    columns = dict(
        zip(
            CHANNELS,
            (run.position_m, run.speed_m_s, *run.wheel_speed_rad_s.T, run.accel_x_m_s2),
            strict=True,
        )
    )
    for effect in effects:
        columns = effect.sense(run.time_s, columns)
    columns |= {f"wheel_torque_{w}_nm": torque[:, i] for i, w in enumerate(WHEELS)}
    return make_drive(profile.name, road, run.time_s, columns)
