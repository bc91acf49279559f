"""What a diagnosis is worth to the product: the estimator's error with the simulation's model, and with what was found.

The dynamics estimator of the front left wheel runs over a drive twice. An effect has a place in it where it

- changes a parameter of its vehicle: mass, height of load transfer, wheel radius and inertia, tyre stiffness, rolling
  resistance;
- changes the wheel torque: by its `actuate`, or as a drag torque, for which the estimator has no parameter;
- changes readings: by its `correct`, with hindsight (on the road a late signal can only be waited for).

What changes the road is found by the estimator itself; all else leaves the estimate as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import Effect
from scenarios.effects.base import mean_of_wheels
from scenarios.files import VehicleFile
from scenarios.plant.parameters import DynamicsParameters
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, WHEEL, Drive
from sim2real.observing.noise import read_noise
from sim2real.observing.observer import Prediction, Simulation
from sim2real.result import RmsError
from trpac_core.dife import LEAST_SENSITIVITY
from trpac_core.estimator import LOCKED_M_S, EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors, filter_share
from trpac_core.slip import GREATEST_SLIP
from trpac_core.tyre import sliding_onset_friction, tyre_at_slip
from trpac_core.vehicle import EXACT_CAR, Vehicle

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLING = 5.0
"""Time constants of the estimator that it is given after a change of the road; 0.7 % of a step are left then [-]."""

SURELY = 2.5
"""Standard deviations of the slip's noise by which the tyre must slide to count as one that shows the road [-]."""

PARAMETERS = {
    "mass_kg": "the mass",
    "transfer_height_m": "the height of the load transfer",
    "wheel_radius_m": "the wheel radius",
    "wheel_inertia_kg_m2": "the wheel inertia",
    "longitudinal_stiffness_n": "the tyre stiffness",
    "rolling_coefficient": "the rolling resistance",
    "drag_torque_nm": "the wheel torque",
}
"""The plant's parameters that have a place in the estimator, and where."""


@dataclass(frozen=True)
class Inputs:
    """What the estimator is told: the car, and row by row what its sensors read, shape (n,) each.

    Attributes
    ----------
    vehicle : Vehicle
        The car.
    wheel_speed_rad_s, wheel_torque_nm, vehicle_speed_m_s : array
        Of the front left wheel and the car; NaN where there is nothing to estimate from.
    accel_m_s2 : array or None
        Accelerometer; None where there is none of its own.
    """

    vehicle: Vehicle
    wheel_speed_rad_s: Array
    wheel_torque_nm: Array
    vehicle_speed_m_s: Array
    accel_m_s2: Array | None

    def same_as(self, other: Inputs) -> bool:
        """Whether the estimator would say the same."""
        if self.vehicle != other.vehicle:
            return False
        pairs = zip(self.readings, other.readings, strict=True)
        return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)

    @property
    def readings(self) -> tuple[Array, ...]:
        """The rows' arrays in the order of `Sensors`, the accelerometer last."""
        measured = () if self.accel_m_s2 is None else (self.accel_m_s2,)
        return (self.wheel_speed_rad_s, self.wheel_torque_nm, self.vehicle_speed_m_s, *measured)


@dataclass(frozen=True)
class Run:
    """The estimator over a drive, shape (n,) each.

    Attributes
    ----------
    theta, peak : array
        TRPAC and TRPAC_peak [-].
    seen : array of bool
        Where it is excited and takes the tyre to show the road: without a camera only that moves the estimate.
    usable : array of bool
        Where its input was usable.
    """

    theta: Array
    peak: Array
    seen: Mask
    usable: Mask


def trpac_error(
    vehicle: VehicleFile,
    drive: Drive,
    added: Sequence[Effect],
    mu_reference: Array | None = None,
) -> RmsError | None:
    """Error of the estimator with the simulation's model in it, and with the effects that were found.

    A run is judged where the tyre truly shows the road's friction (at the slip and load that the simulation with
    `added` has there, through sensors as noisy as the drive's) and where the estimator takes it to, each time from
    `SETTLING` time constants of such driving on a stretch of road on. Elsewhere it holds what it last saw, maybe of
    another stretch. So missed and false sightings count, and what no estimator could know does not.

    The simulation without load transfer has static loads, and so has the estimator then, whatever the car file's
    height of the centre of gravity.

    Parameters
    ----------
    vehicle : VehicleFile
        The car as its simulation has it, with the effects that it models already.
    drive : Drive
        Hold-out.
    added : sequence of Effect
        What the diagnosis adds.
    mu_reference : array, shape (n,), optional
        Measured peak friction under the front wheels on the drive's rows, NaN where lost [-]; it is compared with
        TRPAC_peak. Without it TRPAC is held to the road file's friction, with the road's effects in it. A
        reference of both sides is split as the road file has them.

    Returns
    -------
    RmsError or None
        None where the tyre is never excited, nor taken to be by either run. Where only one of them has anything to
        be judged by, the other is held to account over the same rows, with the estimate that it holds.

    Raises
    ------
    ValueError
        A reference of another length than the drive.
    """
    if mu_reference is not None and mu_reference.shape != drive.time_s.shape:
        raise ValueError(
            f"mu_reference has shape {mu_reference.shape}; expected {drive.time_s.shape}, "
            f"a value per row of {drive.name}."
        )
    simulation, improved = Simulation(vehicle), Simulation(vehicle, added)
    model = improved.predict(drive)
    noise_m_s = _sliding_speed_noise(improved, drive, model)
    old, new = _inputs(simulation, drive), _inputs(improved, drive)
    first = _run(old, drive, noise_m_s)
    second = first if new.same_as(old) else _run(new, drive, noise_m_s)
    truth = _truth(model, mu_reference)
    shown = _shown(truth, model, new, drive.step_s, noise_m_s)
    own = [_judged(run, shown, model.theta[:, 0], drive.step_s) for run in (first, second)]
    rows = [(mask if mask.any() else own[0] | own[1]) & np.isfinite(truth) for mask in own]
    if not all(mask.any() for mask in rows):
        return None
    before, after = (
        _rms((run.theta if mu_reference is None else run.peak) - truth, mask)
        for run, mask in zip((first, second), rows, strict=True)
    )
    said = (_placed(simulation, added, drive), _judgement(own, drive.step_s))
    return RmsError(before, after, _against(improved, mu_reference), " ".join(said))


def places(effect: Effect, parameters: DynamicsParameters) -> tuple[str, ...]:
    """What of the estimator an effect changes, in words; empty where it has no place.

    Parameters
    ----------
    effect : Effect
        With its values.
    parameters : DynamicsParameters
        The plant that it is added to.
    """
    changed = effect.dynamics(parameters)._asdict()
    found = [words for name, words in PARAMETERS.items() if changed[name] != getattr(parameters, name)]
    if type(effect).actuate is not Effect.actuate:
        found.append("the wheel torque")
    if type(effect).correct is not Effect.correct:
        found.append("the readings")
    return tuple(found)


def _inputs(model: Simulation, drive: Drive) -> Inputs:
    """What the estimator is told by a simulation's model."""
    parameters, _ = model.setup(drive.road)
    columns = {name: drive.measured[:, i] for i, name in enumerate(CHANNELS)}
    for effect in reversed(model.effects):
        columns = effect.correct(drive.time_s, columns)
    torque_nm = drive.torque_nm
    for effect in model.effects:
        torque_nm = effect.actuate(drive.time_s, torque_nm)
    wheel_rad_s, speed_m_s = columns[CHANNELS[WHEEL][0]], columns[CHANNELS[SPEED]]
    turning = wheel_rad_s > 0.0
    actual_nm = torque_nm[:, 0] - np.where(turning, mean_of_wheels(parameters.drag_torque_nm), 0.0)
    rim_m_s = wheel_rad_s * mean_of_wheels(parameters.wheel_radius_m)
    locked = (rim_m_s < LOCKED_M_S) & (speed_m_s > EstimatorConfig.floor_m_s)
    return Inputs(
        _core(model.vehicle, parameters),
        wheel_rad_s,
        np.where(locked, np.nan, actual_nm),
        speed_m_s,
        columns[CHANNELS[ACCEL]] if drive.counted[ACCEL] else None,
    )


def _core(vehicle: VehicleFile, parameters: DynamicsParameters) -> Vehicle:
    """The vehicle as the estimator knows it, with all parameters as the simulation has them."""
    return replace(
        vehicle.to_core(),
        mass_kg=parameters.mass_kg,
        cog_height_m=parameters.transfer_height_m,
        wheel_radius_m=mean_of_wheels(parameters.wheel_radius_m),
        wheel_inertia_kg_m2=mean_of_wheels(parameters.wheel_inertia_kg_m2),
        longitudinal_stiffness_n=mean_of_wheels(parameters.longitudinal_stiffness_n),
        rolling_resistance=mean_of_wheels(parameters.rolling_coefficient),
    )


def _sliding_speed_noise(model: Simulation, drive: Drive, prediction: Prediction) -> float:
    """Standard deviation of omega R - v as the sensors read it [m/s]."""
    rests = drive.measured - prediction.channels
    sigma = read_noise(drive, rests, np.zeros_like(rests)).sigma
    return float(np.hypot(sigma[SPEED], model.vehicle.wheel_radius_m * sigma[WHEEL][0]))


def _run(inputs: Inputs, drive: Drive, sliding_speed_noise_m_s: float) -> Run:
    # What a model is worth shows where the estimator does not correct it by itself.
    config = EstimatorConfig(
        vehicle=inputs.vehicle,
        tolerance=EXACT_CAR,
        sliding_speed_noise_m_s=sliding_speed_noise_m_s,
        method=Method.DIFE,
    )
    estimator, step_s, said = TrpacEstimator(config), drive.step_s, []
    for wheel_rad_s, torque_nm, speed_m_s, *accel in zip(
        *(values.tolist() for values in inputs.readings), strict=True
    ):
        sensors = Sensors(
            wheel_rad_s, torque_nm, speed_m_s, longitudinal_acceleration_m_s2=accel[0] if accel else None
        )
        e = estimator.step(step_s, sensors)
        said.append((e.TRPAC, e.TRPAC_peak, e.excitation_flag, e.problem is None))
    theta, peak, excited, usable = np.array(said).T
    moved = np.diff(theta, prepend=config.theta_initial) != 0.0
    return Run(theta, peak, (excited > 0.0) & moved, usable > 0.0)


def _truth(model: Prediction, mu_reference: Array | None) -> Array:
    """What the estimate is held to [-]: theta under the wheel, or the reference."""
    left, right = model.theta[:, 0], model.theta[:, 1]
    return left if mu_reference is None else mu_reference * 2.0 * left / (left + right)


def _shown(truth: Array, model: Prediction, inputs: Inputs, step_s: float, noise_m_s: float) -> Mask:
    """Where the wheel turns in a moving car and its tyre shows these sensors the road."""
    stiffness_n = inputs.vehicle.longitudinal_stiffness_n
    share = filter_share(step_s, EstimatorConfig.sensor_filter_s)
    filtered_m_s = noise_m_s * np.sqrt(share / (2.0 - share))
    moving = inputs.vehicle_speed_m_s > EstimatorConfig.floor_m_s
    able = moving & np.isfinite(inputs.wheel_torque_nm) & np.isfinite(truth)
    able &= (model.slip[:, 0] > 0.0) & (model.load_n[:, 0] > 0.0)
    shown = np.zeros(len(truth), dtype=np.bool_)
    for k in np.flatnonzero(able):
        slip, load_n = min(float(model.slip[k, 0]), GREATEST_SLIP), float(model.load_n[k, 0])
        surely = slip - SURELY * float(filtered_m_s / inputs.vehicle_speed_m_s[k])
        tyre, theta = tyre_at_slip(slip, load_n, stiffness_n), float(truth[k])
        slides = tyre.friction(theta) < sliding_onset_friction(surely, load_n, stiffness_n)
        shown[k] = slides and tyre.friction_by_theta(theta) >= LEAST_SENSITIVITY
    return shown


def _judged(run: Run, shown: Mask, theta: Array, step_s: float) -> Mask:
    """Rows of a run that count, see `trpac_error`."""
    settling_s = SETTLING / EstimatorConfig().gains.gamma
    change = np.flatnonzero(np.diff(theta)) + 1
    starts = np.concatenate([[0], change])
    stretch = np.searchsorted(change, np.arange(len(theta)), side="right")
    rows = np.zeros(len(theta), dtype=np.bool_)
    for mask in (shown & run.usable, run.seen):
        so_far = np.cumsum(mask)
        earlier: NDArray[np.int64] = (so_far - mask)[starts][stretch]
        rows |= mask & ((so_far - earlier) * step_s > settling_s)
    return rows


def _rms(values: Array, rows: Mask) -> float:
    return float(np.sqrt(np.mean(values[rows] ** 2)))


def _judgement(own: Sequence[Mask], step_s: float) -> str:
    """Over how long the runs were judged, and what that means where one has nothing to be judged by."""
    lengths_s = [np.count_nonzero(mask) * step_s for mask in own]
    text = (
        f"Evaluated over {lengths_s[0]:.1f} s before and {lengths_s[1]:.1f} s after, in which the excitation of "
        "the front left tyre suffices, by the reference or by the estimator."
    )
    for which, length_s in zip(("Before", "After"), lengths_s, strict=True):
        if length_s == 0.0:
            text += (
                f" {which}, it never suffices: that error is the one of the value that the estimator holds."
            )
    return text


def _against(model: Simulation, mu_reference: Array | None) -> str:
    if mu_reference is not None:
        return "mu_reference"
    scaled = [effect.id for effect in model.effects if type(effect).road is not Effect.road]
    return f"road.yaml's friction{' with ' + ' and '.join(scaled) if scaled else ''}"


def _placed(simulation: Simulation, added: Sequence[Effect], drive: Drive) -> str:
    """A sentence per effect on its place in the estimator."""
    if not added:
        return "No effect was found that could be put into the estimator."
    parameters, _ = simulation.setup(drive.road)
    out = []
    for effect in added:
        found = places(effect, parameters)
        if found:
            out.append(f"{effect.id} changes {' and '.join(found)} of the estimator.")
        elif type(effect).road is not Effect.road:
            out.append(f"{effect.id} changes the road, which the estimator estimates itself.")
        else:
            out.append(f"{effect.id} has no parameter in the estimator; its estimate does not change.")
    return " ".join(out)
