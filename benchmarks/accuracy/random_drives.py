"""Random drives in the paper's simulation condition: three stretches of 20 m, pulsed acceleration, a camera by classes.

The order of the stretches and their adhesion are drawn, each from its class's real range; so are the sensors' noise and
the camera's frames, some of them wrong with the flag up. The driver uses nine tenths of the road's grip or the motors'
peak, whichever is less.
A car may differ from what the estimator is told of it. No command: `std`, `wrong_cars` and others drive them.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenarios.files import RoadFile, SensorNoise, VehicleFile, load_vehicle
from scenarios.plant.pipeline import PlantTrajectory, simulate
from scenarios.plant.sensors import make_log
from trpac_core.estimator import EstimatorConfig, RoadClass, Sensors, TrpacEstimator
from trpac_core.vision.classes import Surface

CAR_FILE = "scenarios/vehicles/four_in_wheel_motor_ev.yaml"
RANGES = {"dry": (0.7, 1.1), "wet": (0.4, 0.7), "snow_ice": (0.1, 0.35)}
STRETCH_M, STEP_S, LONGEST_S = 20.0, 1e-3, 25.0
PULSE_S, PERIOD_S, RAMP_S, LAUNCH_S = 0.45, 0.58, 0.05, 1.45
USED = 0.9
FRAME_S, NEAR_M = 0.05, 3.5
WRONG_SHARE, WRONG_FRAMES = 0.1, 3.0
"""Share of frames whose class is wrong, and how many wrong ones come in a row."""
NOISE = SensorNoise(
    wheel_speed_noise_rad_s=0.01,
    wheel_torque_noise_nm=3.2,
    vehicle_speed_noise_m_s=0.003,
    accel_x_noise_m_s2=0.05,
)
BY_LOAD = (0.7, 1.0)
"""Exponents of a car tyre's stiffness over its load (Pacejka 2012, ch. 4), of which one is drawn [-]."""
BY_LOAD_STREAM = 1
"""Names the random stream that it is drawn from, so that no other draw depends on it."""
COLUMNS = ["wheel_speed_fl_rad_s", "wheel_torque_fl_nm", "vehicle_speed_m_s", "accel_x_m_s2"]


@dataclass(frozen=True)
class CarError:
    """By how much the car is not what it is told to be, as shares; the bias of its speed signal in m/s."""

    mass: float = 0.0
    radius: float = 0.0
    stiffness: float = 0.0
    torque: float = 0.0
    speed_bias_m_s: float = 0.0

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "CarError":
        """A car of which as much is known as the estimator takes to be: its settings' standard deviations."""
        known = EstimatorConfig()
        return cls(
            mass=0.025 * rng.standard_normal(),
            radius=known.tolerance.ratio * rng.standard_normal(),
            stiffness=known.tolerance.compliance * rng.standard_normal(),
            torque=0.015 * rng.standard_normal(),
            speed_bias_m_s=known.tolerance.speed_bias_m_s * rng.standard_normal(),
        )


@dataclass(frozen=True)
class Tyre:
    """How the tyre is built, where it is not the modified Dugoff tyre of constant stiffness.

    A magic formula of shape factor C and curvature E, whose force follows the slip over the relaxation length [m].
    """

    shape: float
    curvature: float
    relaxation_m: float = 0.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, foreign: bool) -> "Tyre":
        """A formula as car tyres have it; a foreign one with relaxation as they have it too."""
        shape, curvature = float(rng.uniform(1.25, 1.9)), float(rng.uniform(-1.0, 0.6))
        return cls(shape, curvature, float(rng.uniform(0.05, 0.5)) if foreign else 0.0)

    def put_on(self, car: VehicleFile) -> VehicleFile:
        """The car with this tyre."""
        values = car.model_dump(by_alias=True)
        values["effects"]["tyre_formula"] = {"share": 1.0, "shape": self.shape, "curvature": self.curvature}
        if self.relaxation_m > 0.0:
            values["effects"]["tyre_relaxation"] = {"length_m": self.relaxation_m}
        return VehicleFile.model_validate(values)


@dataclass(frozen=True)
class Drive:
    """What the estimator is given and what is true, one row per millisecond."""

    rows: NDArray[np.float64]
    theta: NDArray[np.float64]
    front_m: NDArray[np.float64]
    road: RoadFile
    noise: float = 1.0
    frames: dict[int, RoadClass] = field(default_factory=dict)


def _road(rng: np.random.Generator) -> RoadFile:
    segments = []
    for index, surface in enumerate(rng.permutation(list(RANGES))):
        theta = float(rng.uniform(*RANGES[surface]))
        segments.append(
            {"start_m": index * STRETCH_M, "mu_left": theta, "mu_right": theta, "surface": str(surface)}
        )
    return RoadFile.model_validate({"schema": 1, "segments": segments})


def _actual(car: VehicleFile, error: CarError, by_load: float) -> VehicleFile:
    values = car.model_dump(by_alias=True)
    values["mass_kg"] *= 1.0 + error.mass
    values["wheel_radius_m"] *= 1.0 + error.radius
    values["tyre"]["longitudinal_stiffness_n"] *= 1.0 + error.stiffness
    stiffness = {"stiffness_n": values["tyre"]["longitudinal_stiffness_n"], "by_load": by_load}
    values["effects"]["tyre_stiffness_offset"] = stiffness
    values["forms"]["tyre_stiffness_offset"] = "with load"
    return VehicleFile.model_validate(values)


def _driven(car: VehicleFile, road: RoadFile, gain: float) -> PlantTrajectory:
    """The pedal is set by the stretch under the front axle, which is known only once it has been driven to."""
    core = car.to_core()
    time_s = np.arange(round(LONGEST_S / STEP_S)) * STEP_S
    phase = np.where(time_s < LAUNCH_S, 0.2, (time_s - LAUNCH_S) % PERIOD_S)
    shape = np.clip(np.minimum(phase, PULSE_S - phase) / RAMP_S, 0.0, 1.0) * np.clip(time_s / RAMP_S, 0, 1)
    torque = np.zeros(len(time_s))
    begun = 0
    for segment in road.segments:
        grip_nm = USED * segment.mu_left * core.wheel_load(True) * core.wheel_radius_m
        torque[begun:] = min(core.motor_peak_torque_nm, grip_nm) * shape[begun:]
        run = simulate(
            car,
            road,
            np.repeat(gain * torque[:, None], 4, axis=1),
            STEP_S,
            initial_position_m=-core.cog_to_front_axle_m,
        )
        front_m = run.position_m + core.cog_to_front_axle_m
        begun = int(np.searchsorted(front_m, segment.start_m + STRETCH_M))
    return run.rows(begun)


def _frames(rng: np.random.Generator, road: RoadFile, front_m: NDArray[np.float64]) -> dict[int, RoadClass]:
    frames, wrong = {}, None
    begin = WRONG_SHARE / WRONG_FRAMES / (1.0 - WRONG_SHARE)
    for row in range(0, len(front_m), round(FRAME_S / STEP_S)):
        true = road.segment_at(front_m[row] + NEAR_M).surface_class
        if wrong is None and rng.random() < begin:
            wrong = Surface((true + rng.integers(1, 3)) % 3)
        elif wrong is not None and rng.random() < 1.0 / WRONG_FRAMES:
            wrong = None
        flagged = rng.random() < 0.9
        frames[row] = RoadClass(true if wrong is None else wrong, 0.9 if flagged else 0.3)
    return frames


def make_drive(
    seed: int, error: CarError | None = None, noise: float | None = None, tyre: Tyre | None = None
) -> Drive:
    """A drive; without a car error one is drawn, and so is the noise, between half and twice the scenario's.

    The tyres' stiffness goes with their load, by a share that is drawn.
    """
    rng = np.random.default_rng(seed)
    road = _road(rng)
    drawn, scale = CarError.drawn(rng), float(2.0 ** rng.uniform(-1.0, 1.0))
    error, scale = error or drawn, noise or scale
    car = load_vehicle(CAR_FILE)
    by_load = float(np.random.default_rng((seed, BY_LOAD_STREAM)).uniform(*BY_LOAD))
    actual = _actual(car, error, by_load)
    if tyre is not None:
        actual = tyre.put_on(actual)
    run = _driven(actual, road, 1.0 + error.torque)
    louder = NOISE.model_copy(update={name: scale * value for name, value in NOISE.model_dump().items()})
    rows = make_log(run, actual, louder, seed)[COLUMNS].to_numpy(copy=True)
    rows[:, 1] /= 1.0 + error.torque
    rows[:, 2] += error.speed_bias_m_s
    front_m = run.position_m + car.to_core().cog_to_front_axle_m
    return Drive(rows, run.theta[:, 0], front_m, road, scale, _frames(rng, road, front_m))


def estimated(drive: Drive, config: EstimatorConfig, with_frames: bool = True) -> NDArray[np.float64]:
    """TRPAC, DE, its excitation flag and TRPAC_std at each row, shape (n, 4)."""
    estimator, found = TrpacEstimator(config), np.empty((len(drive.rows), 4))
    for row, (omega, torque, speed, acceleration) in enumerate(drive.rows.tolist()):
        sensors = Sensors(omega, torque, max(speed, 0.0), longitudinal_acceleration_m_s2=acceleration)
        e = estimator.step(STEP_S, sensors, drive.frames.get(row) if with_frames else None)
        found[row] = e.TRPAC, e.TRPAC_dynamics, e.excitation_flag, e.TRPAC_std
    return found


def told(noise: float = 1.0) -> EstimatorConfig:
    """The estimator's settings for the nominal car with sensors this noisy."""
    core = load_vehicle(CAR_FILE).to_core()
    deviation = float(
        np.hypot(NOISE.vehicle_speed_noise_m_s, core.wheel_radius_m * NOISE.wheel_speed_noise_rad_s)
    )
    return EstimatorConfig(vehicle=core, sliding_speed_noise_m_s=noise * deviation)
