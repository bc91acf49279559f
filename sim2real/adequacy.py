"""Whether logs are of the file's car and tell anything about it, before minutes of fits.

No plant is simulated. Each log is smoothed by a triangle of 1 s, so that the change of speed and the force that causes
it are averaged alike, and held to the force balance of the whole car,

    (sum T - I sum omega') / R = m v' + c_0 + c_2 v^2,

which holds whatever the slip of the tyres. m is the mass that the torque moves; c_0 takes slope and rolling resistance,
c_2 air drag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from scenarios.effects import EFFECTS
from scenarios.effects.base import mean_of_wheels
from scenarios.files import RoadFile
from sim2real.logs.errors import LogError
from sim2real.observing.drive import CHANNELS, SPEED, WHEEL, Drive
from sim2real.observing.evidence import SETTLING_S
from sim2real.observing.observer import Simulation
from sim2real.sources import Source, Sources
from trpac_core.vehicle import GRAVITY_M_S2, WHEELS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

HALF_S = 0.5
"""Half the length of the triangle that a log is smoothed by: shorter than a manoeuvre, longer than noise [s]."""
DRIVING = 0.03
"""Force over weight from which on a car drives, or brakes: beyond air drag and rolling resistance at 20 m/s [-]."""
REGIME_S = 1.0
"""Least time in a regime for the logs to hold it [s]."""
MOVED_M_S2 = 0.2
"""Standard deviation of the acceleration below which a drive excites hardly anything: that of a 2 % grade [m/s^2]."""
STILL_M_S2, STILL = 0.03, 0.005
"""Standard deviations below which nothing happens: of the acceleration [m/s^2], of the force over weight [-]."""
HILLS_M_S2 = 0.5
"""Acceleration, up and down, that a constant torque does not give on hills of 5 % [m/s^2]."""
ROLLS_M_S2 = 1.5
"""Acceleration that a car without torque does not reach: 5 % of grade, and air drag at 40 m/s [m/s^2]."""
EXPLAINED = 0.5
"""Share of the force's variance from which on torque and change of speed belong to one car [-]."""
KNOWN = 0.8
"""Least share of a triangle's samples that are not lost [-]."""
LOCKED = 0.2
"""Rim speed over vehicle speed below which a wheel is about to lock: its brake then holds more than it uses [-]."""
FEWEST, FEWEST_EACH = 8, 4
"""Smoothed samples for a regression, and those of driving and of braking for one of each."""
UNLIKE = 1.4
"""Ratio of force per acceleration in braking and driving beyond what a calibration is off [-]."""
SURE = 3.0
"""Standard errors between an estimate and a limit from which on it is beyond it [-]."""
PLAUSIBLE = (0.7, 1.5)
"""Mass that the torque moves over that of the file: within it a car is loaded or a torque miscalibrated [-]."""
RADIUS_WARNING, RADIUS_REFUSAL = 0.08, 0.17
"""Deviation of the rolling radius that no wear or tyre size makes, and that of another car, less what slip and noise
take off 20 % [-]."""
SHARED_ROWS = 0.2
"""Share of the hold-out's rows that stand in a fit log from which on it is no hold-out [-]."""
GENTLE = 0.1
"""Force over weight up to which slip shifts the rolling radius by less than 1 % [-]."""

RECORD = (
    "Record 30 s or more with full and half torque from 5 to 20 m/s, braking with 3 m/s^2 and more, and coasting in "
    "between."
)


@dataclass(frozen=True)
class Motion:
    """What a log says of the car as a whole, smoothed, one row per half triangle.

    Attributes
    ----------
    name : str
        Of the log.
    speed_m_s, accel_m_s2, force_n : array, shape (n,)
        Speed, its change, and the force of torque and turning wheels at the contacts.
    radius_m : array, shape (4,)
        Median of vehicle speed over wheel speed while little force acts; NaN without such rows [m].
    silent : bool
        Whether no wheel's torque ever changes.
    torque_nm : float
        Greatest torque of a wheel, unsigned [N m].
    """

    name: str
    speed_m_s: Array
    accel_m_s2: Array
    force_n: Array
    radius_m: Array
    silent: bool
    torque_nm: float


@dataclass(frozen=True)
class Car:
    """The car of the vehicle file with what its simulation models already: mass [kg], radius [m], inertia [kg m^2]."""

    mass_kg: float
    radius_m: float
    inertia_kg_m2: float
    heaviest: float
    lightest: float
    """Greatest and least mass over the file's that a gain of the torque within its bounds looks like [-]."""

    @property
    def weight_n(self) -> float:
        """Its weight [N]."""
        return self.mass_kg * GRAVITY_M_S2


@dataclass(frozen=True)
class Mass:
    """What the torque of a log moves.

    Attributes
    ----------
    value_kg, error_kg : float
        Mass, and its standard error [kg].
    explained : float
        Share of the force's variance that it explains, beyond slope and drag [-].
    unlike : float or None
        Force in braking over that in driving, per acceleration, where they surely differ [-].
    """

    value_kg: float
    error_kg: float
    explained: float
    unlike: float | None


def require_adequate(sources: Sources) -> tuple[str, ...]:
    """Sentences on what the logs cannot tell, or of what other car they may be; see the module.

    Raises
    ------
    LogError
        Nothing happens in the logs, torque is missing or reversed, or they are of another car than the file's.
    """
    model = Simulation(sources.vehicle)
    car = _car(model, sources.holdout.road)
    motions = [_motion(model, car, source.drive) for source in sources.all]
    held, fit = motions[-1], motions[:-1]
    problems = [text for motion in motions for text in _untold_torque(motion)]
    problems += [text for source in sources.all for text in _uncounted(source.drive)]
    problems += _stillness(fit, held, car)
    warnings = _excitation(fit, [source.drive for source in sources.fit], car)
    of_mass = {motion.name: mass for motion in motions if (mass := _mass(motion)) is not None}
    refused, warned = _masses(of_mass, car)
    of_radius, warned_of_radius = _radii(motions, car)
    problems += [*refused, *of_radius]
    if problems:
        raise LogError("\n".join(problems))
    if not warned:  # the regression says the same with a mass
        warned = _contradictions(motions, car)
    return (*warnings, *warned, *warned_of_radius, *_shared(sources))


def contradiction(model: Simulation, drive: Drive, whole: bool = True) -> str | None:
    """The sentence that a drive's torque and acceleration are not of this car; None where they may be.

    Parameters
    ----------
    model, drive : Simulation, Drive
        The car and one drive.
    whole : bool
        Whether the torque of all wheels is measured; without it too little torque is no contradiction.
    """
    car = _car(model, drive.road)
    motion = _motion(model, car, drive)
    return None if motion.silent else _contradicted([motion], car, whole)


def _contradictions(motions: Sequence[Motion], car: Car) -> list[str]:
    """The same of each log, or of all together where each is too short."""
    told = [motion for motion in motions if not motion.silent]
    each = [(motion.name, text) for motion in told if (text := _contradicted([motion], car))]
    if each:
        texts = dict.fromkeys(text for _, text in each)
        return [f"{', '.join(name for name, t in each if t == text)}: {text}" for text in texts]
    text = _contradicted(told, car)
    return [f"All logs together: {text}"] if text else []


def _contradicted(motions: Sequence[Motion], car: Car, whole: bool = True) -> str | None:
    """Where most of the driven, or of the braked samples ask for a mass beyond `PLAUSIBLE`, whatever slope and drag.

    No regression, so that few samples are enough, and no drag of a wrong sign can take what the torque has too much.
    """
    if not motions:
        return None
    change = np.concatenate([motion.accel_m_s2 for motion in motions])
    asked = np.concatenate([motion.force_n for motion in motions]) / car.mass_kg
    for sign, does, by in ((1.0, "accelerate", "accelerates"), (-1.0, "slow down", "slows down")):
        taken = np.maximum(sign * asked, sign * change) > ROLLS_M_S2
        if np.count_nonzero(taken) < FEWEST_EACH:
            continue
        a, f = sign * change[taken], sign * asked[taken]
        more = np.mean(f - ROLLS_M_S2 > PLAUSIBLE[1] * np.maximum(a, 0.0)) > 0.5
        less = whole and np.mean(f + ROLLS_M_S2 < PLAUSIBLE[0] * a) > 0.5
        if more or less:
            others = ", or brake torque is missing or only demanded" if sign < 0.0 else ""
            return (
                f"The logged torque would {does} this car at {np.median(f):.2g} m/s2 where it {by} at "
                f"{np.median(a):.2g} m/s2: torque scale, gear or mass is wrong{others}."
            )
    return None


def _car(model: Simulation, road: RoadFile) -> Car:
    parameters, _ = model.setup(road)
    (gain,) = EFFECTS["torque_gain"].parameters()
    low, high = gain.bounds(model.vehicle.to_core())
    return Car(
        parameters.mass_kg,
        mean_of_wheels(parameters.wheel_radius_m),
        mean_of_wheels(parameters.wheel_inertia_kg_m2),
        heaviest=1.0 / low,
        lightest=1.0 / high,
    )


def _motion(model: Simulation, car: Car, drive: Drive) -> Motion:
    columns = {name: drive.measured[:, i] for i, name in enumerate(CHANNELS)}
    columns = model.corrected(drive.time_s, columns)
    torque_nm = model.actuated(drive.time_s, drive.torque_nm)
    speed = columns[CHANNELS[SPEED]]
    wheels = np.column_stack([columns[name] for name in CHANNELS[WHEEL]])
    locked = (wheels * car.radius_m < LOCKED * speed[:, None]).any(axis=1)
    known = np.isfinite(speed) & np.isfinite(wheels).all(axis=1)
    rows = drive.rows_in(HALF_S)
    whole = (_share(drive.moving & ~locked, rows) > 0.999) & (_share(known, rows) > KNOWN)
    v = _smoothed(_bridged(speed), rows)
    change = _change(_bridged(speed), rows, drive.step_s)
    spin = _change(_bridged(np.sum(wheels, axis=1)), rows, drive.step_s)
    force = (_smoothed(torque_nm.sum(axis=1), rows) - car.inertia_kg_m2 * spin) / car.radius_m
    taken = np.flatnonzero(whole)[::rows]
    silent = bool(np.all(np.ptp(drive.torque_nm, axis=0) <= 1e-3 * model.vehicle.motor_peak_torque_nm))
    return Motion(
        drive.name,
        v[taken],
        change[taken],
        force[taken],
        _radius(speed, wheels, whole & (np.abs(force) < GENTLE * car.weight_n)),
        silent,
        float(np.abs(drive.torque_nm).max()),
    )


def _share(holds: Mask, rows: int) -> Array:
    """Share of the rows under the triangle around each row for which something holds [-]."""
    return uniform_filter1d(holds.astype(float), 2 * rows + 1, mode="constant")


def _bridged(values: Array) -> Array:
    """The values with lost ones on lines between their neighbours; zeros without any."""
    known = np.isfinite(values)
    rows = np.arange(len(values))
    return np.interp(rows, rows[known], values[known]) if known.any() else np.zeros(len(values))


def _smoothed(values: Array, rows: int) -> Array:
    return uniform_filter1d(uniform_filter1d(values, rows, mode="nearest"), rows, mode="nearest")


def _change(values: Array, rows: int, step_s: float) -> Array:
    """The change per second, averaged by the triangle of `_smoothed`."""
    mean = uniform_filter1d(values, rows, mode="nearest")
    half = (rows - rows // 2, rows // 2)
    padded = np.pad(mean, (half[1], half[0]), mode="edge")
    return (padded[rows:] - padded[: len(values)]) / (rows * step_s)


def _radius(speed: Array, wheels: Array, gentle: Mask) -> Array:
    rolls = gentle & (speed > 1.0)
    if np.count_nonzero(rolls) < 20:
        return np.full(4, np.nan)
    return np.asarray(np.median(speed[rolls, None] / wheels[rolls], axis=0))


def _untold_torque(motion: Motion) -> list[str]:
    """Torque that never changes while the car accelerates and brakes."""
    if not motion.silent or len(motion.accel_m_s2) < 3:
        return []
    slowest, fastest = np.quantile(motion.accel_m_s2, (0.05, 0.95))
    both_ways = slowest < -HILLS_M_S2 and fastest > HILLS_M_S2
    beyond = motion.torque_nm == 0.0 and max(fastest, -slowest) > ROLLS_M_S2
    if not (both_ways or beyond):
        return []
    size = "0" if motion.torque_nm == 0.0 else f"{motion.torque_nm:.3g} N m at most"
    return [
        f"{motion.name}: the wheel torques never change ({size}) while the car's acceleration goes from {slowest:.1f} "
        f"to {fastest:.1f} m/s^2; expected the commanded torque of each wheel, brakes included. A diagnosis needs it: "
        "record it, or map its columns."
    ]


def _uncounted(drive: Drive) -> list[str]:
    """A log whose car moves only while the observer settles: nothing of it can be compared."""
    if np.any(drive.moving & (drive.time_s >= drive.time_s[0] + SETTLING_S)):
        return []
    return [
        f"{drive.name}: the car moves only in the first {SETTLING_S:g} s, which are not compared with the simulation; "
        "expected a log of driving."
    ]


def _is_still(motion: Motion, car: Car) -> bool:
    return bool(
        len(motion.accel_m_s2) >= 2
        and np.std(motion.accel_m_s2) < STILL_M_S2
        and np.std(motion.force_n) < STILL * car.weight_n
    )


def _stillness(fit: Sequence[Motion], held: Motion, car: Car) -> list[str]:
    """Logs in which neither speed nor torque changes."""
    still = [motion.name for motion in fit if _is_still(motion, car)]
    names = still if len(still) == len(fit) else []
    names = [*names, *([held.name] if _is_still(held, car) else [])]
    if not names:
        return []
    return [
        f"{', '.join(names)}: speed and torque are constant; expected a drive in which the car accelerates and brakes. "
        f"{RECORD}"
    ]


def _regimes(fit: Sequence[Drive], car: Car) -> dict[str, float]:
    """Time of the fit logs in each regime by the torque alone, which needs no smoothing [s]."""
    held = dict.fromkeys(("driving", "braking", "coasting"), 0.0)
    for drive in fit:
        share = drive.torque_nm[drive.moving].sum(axis=1) / (car.radius_m * car.weight_n)
        held["driving"] += np.count_nonzero(share > DRIVING) * drive.step_s
        held["braking"] += np.count_nonzero(share < -DRIVING) * drive.step_s
        held["coasting"] += np.count_nonzero(np.abs(share) <= DRIVING) * drive.step_s
    return held


def _excitation(fit: Sequence[Motion], drives: Sequence[Drive], car: Car) -> list[str]:
    """What the fit logs together do not excite."""
    accel = np.concatenate([motion.accel_m_s2 for motion in fit])
    if len(accel) < 2:
        return []
    held = [name for name, time_s in _regimes(drives, car).items() if time_s >= REGIME_S]
    deviation = float(np.std(accel))
    what = []
    if len(held) == 1:
        what.append(f"contain only {held[0]}")
    if deviation < MOVED_M_S2:
        what.append(
            f"have little excitation (the acceleration's standard deviation is {deviation:.2f} m/s^2, expected "
            f"{MOVED_M_S2:g} "
            "and more)"
        )
    if not what:
        return []
    return [
        f"The fit logs {' and '.join(what)}: effects that need other driving are not found or not separated, and "
        f"a verdict of no gap has little weight. {RECORD}"
    ]


def _mass(motion: Motion) -> Mass | None:
    """The mass that the torque of a log moves; None where it hardly accelerates."""
    a = motion.accel_m_s2
    if len(a) < FEWEST or np.std(a) < MOVED_M_S2 or motion.silent:
        return None
    x, error, explained = _regressed(motion, a[:, None])
    driving, braking = a > MOVED_M_S2, a < -MOVED_M_S2
    if min(np.count_nonzero(driving), np.count_nonzero(braking)) < FEWEST_EACH:
        return Mass(float(x[0]), float(error[0]), explained, None)
    (of_driving, of_braking), errors, _ = _regressed(
        motion, np.column_stack([np.maximum(a, 0.0), np.minimum(a, 0.0)])
    )
    if of_driving <= 0.0:
        return Mass(float(x[0]), float(error[0]), explained, None)
    share, share_error = of_braking / of_driving, float(np.hypot(*errors)) / of_driving
    unlike = share + SURE * share_error < 1.0 / UNLIKE or share - SURE * share_error > UNLIKE
    return Mass(float(x[0]), float(error[0]), explained, float(share) if unlike else None)


def _regressed(motion: Motion, changes: Array) -> tuple[Array, Array, float]:
    """Robust slopes of the force over `changes`, shape (n, m), their standard errors, and the share that they explain.

    The share is that of the variance which a constant and the squared speed leave.
    """
    v, force = motion.speed_m_s, motion.force_n
    columns = np.column_stack([changes, np.ones(len(v)), v * v / max(float(np.mean(v * v)), 1e-9)])
    weight = np.ones(len(v))
    for _ in range(20):
        x = np.linalg.lstsq(columns * weight[:, None], force * weight, rcond=None)[0]
        rest = force - columns @ x
        scale = max(1.4826 * float(np.median(np.abs(rest))), 1e-9)
        weight = np.sqrt(np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(rest), 1e-12)))
    spread = max(float(np.sqrt(np.mean(rest**2))), scale)
    # Neighbouring triangles overlap by half, and what is left is no noise: twice the plain standard error.
    error = 2.0 * spread * np.sqrt(np.diag(np.linalg.pinv(columns.T @ columns)))
    count = changes.shape[1]
    without = force - columns[:, count:] @ np.linalg.lstsq(columns[:, count:], force, rcond=None)[0]
    explained = 1.0 - float(np.var(rest) / max(np.var(without), 1e-9))
    return np.asarray(x[:count]), np.asarray(error[:count]), explained


def _masses(of: dict[str, Mass], car: Car) -> tuple[list[str], list[str]]:
    """Problems, and warnings, of the mass that the torques move."""
    told = {name: mass for name, mass in of.items() if mass.explained >= EXPLAINED}
    odd = [name for name in of if name not in told]
    reversed_ = [name for name, mass in told.items() if mass.value_kg + SURE * mass.error_kg < 0.0]
    beyond = _beyond(told, car, car.lightest, car.heaviest)
    unlike = [name for name, mass in told.items() if mass.unlike is not None and mass.value_kg > 0.0]
    unlikely = [name for name in _beyond(told, car, *PLAUSIBLE) if name not in (*beyond, *reversed_, *unlike)]
    problems = [
        f"{name}: the car slows down where the wheel torques drive it and speeds up where they brake; expected torque "
        "that is positive in driving. A mapping file turns it: {column: NAME, sign: -1}."
        for name in reversed_
    ]
    of_another = [name for name in beyond if name not in reversed_]
    if of_another:
        problems.append(
            f"{_moved(of_another, told, car)} No effect of the library is so large. {_remedy(car)}"
        )
    warnings = [f"{_moved(unlikely, told, car)} {_remedy(car)}"] if unlikely else []
    if unlike:
        share = float(np.median([m for name in unlike if (m := told[name].unlike) is not None]))
        warnings.append(
            f"{', '.join(unlike)}: per change of speed the logged torque in braking is {share:.2g} of that in driving. "
            "Expected the commanded torque of motors and of friction brakes, both in N m at the wheel: missing "
            "torque is named as an effect."
        )
    if odd:
        least = min(of[name].explained for name in odd)
        warnings.append(
            f"{', '.join(odd)}: the wheel torques explain {100.0 * max(least, 0.0):.0f} % of the car's acceleration "
            "(share of the variance). Expected the torque of all wheels, brakes included, in N m at the wheel: "
            "missing torque is named as an effect."
        )
    return problems, warnings


def _beyond(of: dict[str, Mass], car: Car, least: float, most: float) -> list[str]:
    """Logs whose mass is surely below or above these shares of the file's."""
    return [
        name
        for name, mass in of.items()
        if mass.value_kg + SURE * mass.error_kg < least * car.mass_kg
        or mass.value_kg - SURE * mass.error_kg > most * car.mass_kg
    ]


def _moved(names: Sequence[str], of: dict[str, Mass], car: Car) -> str:
    mass_kg = float(np.median([of[name].value_kg for name in names]))
    return (
        f"{', '.join(names)}: the wheel torques move a car of about {mass_kg:.0f} kg, the vehicle file says "
        f"{car.mass_kg:.0f} kg: these logs are of another car, or {car.mass_kg / mass_kg:.2g} times the logged torque "
        "is at the wheels."
    )


def _remedy(car: Car) -> str:
    return "Expected the car's own mass_kg in the vehicle file, and in the logs N m at each wheel, behind the gears."


def _radii(motions: Sequence[Motion], car: Car) -> tuple[list[str], list[str]]:
    """Problems, and warnings, of the radius that the wheels roll with."""
    problems: list[str] = []
    warnings: list[str] = []
    for least, texts in ((RADIUS_REFUSAL, problems), (RADIUS_WARNING, warnings)):
        off = {
            motion.name: motion.radius_m
            for motion in motions
            if np.isfinite(motion.radius_m).all()
            and abs(np.median(motion.radius_m) / car.radius_m - 1.0) > least
        }
        if off:
            radius = np.median(list(off.values()), axis=0)
            wheels = ", ".join(f"{w} {r:.3f}" for w, r in zip(WHEELS, radius, strict=True))
            texts.append(
                f"{', '.join(off)}: the wheels roll with radii of {wheels} m (vehicle speed over wheel speed), the "
                f"vehicle file says {car.radius_m:.3f} m: these logs are of another car, or the unit of a speed "
                "is wrong. Expected wheel_radius_m of the car that was driven, or a mapping with the unit."
            )
            break
    return problems, warnings


def _shared(sources: Sources) -> list[str]:
    """Fit logs that hold rows of the hold-out, under another name or as a piece of it."""
    held = sources.holdout
    rows = _rows(held)
    names = [
        source.log.name
        for source in sources.fit
        if source.log.sha256 != held.log.sha256
        and len(rows)
        and len(rows & _rows(source)) > SHARED_ROWS * len(rows)
    ]
    if not names:
        return []
    return [
        f"{held.log.name}: holds the same samples as {', '.join(names)}; expected a hold-out of another drive. "
        "Its gap is not that of an independent drive."
    ]


def _rows(source: Source) -> set[bytes]:
    """The rows of a log in which the car moves, as bytes, without time and position."""
    signals = source.log.signals
    columns = [
        values for name, values in signals.items() if name.startswith(("wheel_", "vehicle_speed", "accel_x"))
    ]
    table = np.ascontiguousarray(np.column_stack(columns)[signals["vehicle_speed_m_s"] > 1.0])
    return {row.tobytes() for row in table}
