"""The withheld cases' nominal car, how it rolls, and a drive that shows whether a world differs from it."""

from __future__ import annotations

import numpy as np

from benchmarks.gap.withheld.generator.car import Car, Road
from benchmarks.gap.withheld.generator.driver import drive
from benchmarks.gap.withheld.generator.kernel import N, begin, integrate
from benchmarks.gap.withheld.generator.sensors import Noise, read
from benchmarks.gap.withheld.generator.world import World, nominal

CAR = Car()
ICE = Road((0.0, 60.0), (0.9, 0.3))
QUIET = Noise(0.02, 0.01, 0.03, 0.0, 0.0, 0.01, 0.0, 0.0)


def roll(world: World, speed: float, seconds: float, torque: float = 0.0) -> np.ndarray:
    """Path of a car that begins freely rolling, with the same torque at all wheels from the first moment."""
    rows = round(seconds * 1000)
    command = np.full((rows // 10 + 1, 4), torque)
    path = np.zeros((rows + 1, N + 1))
    y = begin(world.physics, 0.0, speed, np.full(4, speed / world.physics.radius), 0.0, command)
    path[0, :N] = y
    integrate(world.physics, y, 0, rows, world.split, command, path)
    return path


def carried(car: Car) -> float:
    """Mass with the wheels' rotation in it [kg]."""
    return car.mass_kg + 4.0 * car.wheel_inertia_kg_m2 / car.wheel_radius_m**2


NEUTRAL = {
    "aero_drag": {"drag_area_m2": 0.0},
    "rolling_resistance": {"coefficient": 0.0},
    "road_grade": {"grade": 0.0},
    "mass_offset": {"mass_kg": 0.0},
    "wheel_radius_offset": {"radius_m": CAR.wheel_radius_m},
    "wheel_inertia_offset": {"inertia_kg_m2": CAR.wheel_inertia_kg_m2},
    "load_transfer": {"cog_height_m": 0.0},
    "tyre_relaxation": {"length_m": 0.0},
    "tyre_stiffness_offset": {"stiffness_n": CAR.stiffness_n},
    "friction_falloff": {"falloff_s_m": 0.0, "floor": 0.4},
    "friction_offset": {"factor": 1.0},
    "torque_lag": {"time_constant_s": 0.0},
    "torque_delay": {"delay_s": 0.0},
    "torque_gain": {"factor": 1.0},
    "brake_drag": {"torque_nm": 0.0},
    "driveline_compliance": {"stiffness_nm_rad": 9e3, "damping_nm_s_rad": 1.0, "motor_inertia_kg_m2": 0.0},
    "wheel_speed_delay": {"delay_s": 0.0},
    "wheel_speed_quantisation": {"teeth": 100.0, "window_s": 0.0},
    "vehicle_speed_delay": {"delay_s": 0.0},
    "vehicle_speed_scale": {"factor": 1.0},
    "accelerometer_bias": {"bias_m_s2": 0.0},
    "mu_split": {"left_factor": 1.0, "right_factor": 1.0},
}


class LimitDrive:
    """A rich drive with ice in it: what the sensors of a world say when its torque is driven from the same start.

    A world with the nominal physics moves as the nominal car does: it is not integrated again.
    """

    def __init__(self) -> None:
        self.world = nominal(CAR, ICE)
        self._driven = drive(CAR, self.world, True, 9.0, np.random.default_rng(2))
        self._path = self._moved(self.world)
        self.nominal = self._read(self.world, self._path)

    def shows(self, world: World) -> bool:
        """Whether some sensor's reading is off by more than twice its noise in the root mean square.

        What is left of the drive can only add to the sum of squares: where it is enough the car may stop.
        """
        rows = len(self.nominal)
        path, y = self._at_start()
        for start in range(0, rows, 1000):
            self._move(world, y, path, start, min(start + 1000, rows))
            told = self._read(world, path[: start + 1001])
            squares = np.sum((told - self.nominal[: len(told)]) ** 2, axis=0)
            if np.any(squares / rows > (2.0 * QUIET.sigmas) ** 2):
                return True
        return False

    def is_nominal(self, world: World) -> bool:
        """Whether its sensors say to the last bit what the nominal car's say."""
        alike = (
            all(map(np.array_equal, world.physics, self.world.physics)) and world.split == self.world.split
        )
        return np.array_equal(self._read(world, self._path if alike else self._moved(world)), self.nominal)

    def _read(self, world: World, path: np.ndarray) -> np.ndarray:
        return read(path[1:], world.sensors, np.arange(len(path) - 1) * 1e-3)

    def _moved(self, world: World) -> np.ndarray:
        path, y = self._at_start()
        self._move(world, y, path, 0, len(path) - 1)
        return path

    def _at_start(self) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros_like(self._driven.path), self._driven.path[0, :N].copy()

    def _move(self, world: World, y: np.ndarray, path: np.ndarray, start: int, end: int) -> None:
        integrate(world.physics, y, start, end - start, world.split, self._driven.command, path)
