"""Drives the plant on the bus between two speeds without end, over a road that repeats itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, Scenario
from scenarios.plant import dynamics
from scenarios.plant.parameters import FORCE, POSITION, SPEED, WHEEL
from scenarios.plant.pipeline import initial_state
from trpac_core.vision.classes import Surface

SLOW_M_S, FAST_M_S = 4.0, 14.0
"""Speeds at which the driver changes from brake to accelerator, and back [m/s]."""
PULSE_S, PAUSE_S, RAMP_S = 0.45, 0.25, 0.05
"""Length of a torque pulse, pause after it, rise and fall within it; as the paper's pedal pulses [s]."""
GRIP_SHARE = 0.88
"""Share of theta F_z that a pulse uses: enough slip to estimate theta, and no sliding [-]."""
BLOCK = 10
"""Steps that one call of the plant computes: the call itself costs more than a step."""


class Instant(NamedTuple):
    """The plant's outputs at one time; lists are of the wheels fl, fr, rl, rr."""

    time_s: float
    position_m: float
    speed_m_s: float
    accel_x_m_s2: float
    wheel_speed_rad_s: list[float]
    wheel_torque_nm: list[float]
    theta: list[float]


@dataclass
class Driver:
    """A driver of pedal pulses: accelerator up to `FAST_M_S`, then brake down to `SLOW_M_S`.

    Parameters
    ----------
    peak_nm : float
        Peak torque of a motor [N m].
    radius_m : float
        Rolling radius of the wheels [m].
    """

    peak_nm: float
    radius_m: float
    braking: bool = False

    def torque_nm(
        self,
        time_s: NDArray[np.float64],
        speed_m_s: float,
        theta: NDArray[np.float64],
        load_n: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Torque of the four wheels at these times, shape (n, 4), for the current speed, theta and load [N m]."""
        if speed_m_s > FAST_M_S:
            self.braking = True
        elif speed_m_s < SLOW_M_S:
            self.braking = False
        within_s = np.fmod(time_s, PULSE_S + PAUSE_S)
        share = np.clip(np.minimum(within_s, PULSE_S - within_s) / RAMP_S, 0.0, 1.0)
        grip = theta * load_n * self.radius_m
        each = GRIP_SHARE * np.array([grip[:2].min()] * 2 + [grip[2:].min()] * 2)
        return share[:, None] * (-each if self.braking else np.minimum(each, self.peak_nm))


class EndlessDrive:
    """The reference plant on a scenario's road, which is repeated without end.

    Parameters
    ----------
    scenario : Scenario
        Car and road; raises ScenarioError where they cannot be used.
    step_s : float
        Output step of the plant [s].
    """

    def __init__(self, scenario: Scenario, step_s: float) -> None:
        self._length_m, self._step_s = scenario.end.position_m, step_s
        self.road = repeated(scenario.road, self._length_m)
        car = scenario.vehicle.to_core()
        self._to_front_m = car.cog_to_front_axle_m
        self._driver = Driver(car.motor_peak_torque_nm, car.wheel_radius_m)
        start = initial_state(scenario.vehicle, self.road, SLOW_M_S)
        self._setup, self._y = start.setup, start.y
        self._theta, self._load_n = start.wheels.theta.copy(), start.wheels.load_n.copy()
        self._torque_nm: NDArray[np.float64] = np.zeros(4)
        self._instants = self._drive()
        self.now = next(self._instants)

    def advance(self, steps: int = 1) -> None:
        """Make `now` the plant's outputs some steps later."""
        self.now = next(islice(self._instants, steps - 1, None))

    def _drive(self) -> Iterator[Instant]:
        """The plant's outputs step by step, without end."""
        first = 0
        while True:
            time_s: NDArray[np.float64] = (first + np.arange(BLOCK + 1, dtype=np.float64)) * self._step_s
            torque_nm = self._driver.torque_nm(time_s, float(self._y[SPEED]), self._theta, self._load_n)
            torque_nm[0] = self._torque_nm
            states, accel, _, _, load_n, theta = dynamics.run(
                self._y, torque_nm, self._step_s, self._setup.parameters, self._setup.road
            )
            self._torque_nm, self._theta, self._load_n = torque_nm[-1], theta[-1], load_n[-1]
            yield from map(
                Instant,
                time_s[1:].tolist(),
                states[1:, POSITION].tolist(),
                states[1:, SPEED].tolist(),
                accel[1:].tolist(),
                states[1:, WHEEL:FORCE].tolist(),
                torque_nm[1:].tolist(),
                theta[1:].tolist(),
            )
            first += BLOCK
            if self._y[POSITION] > 1.5 * self._length_m:
                self._y[POSITION] -= self._length_m

    def surfaces_ahead(self, ahead_m: float) -> tuple[Surface, Surface]:
        """Surfaces of the left and the right track at this distance ahead of the front axle."""
        return self.road.segment_at(self.now.position_m + self._to_front_m + ahead_m).surface_classes


def repeated(road: RoadFile, length_m: float) -> RoadFile:
    """The road twice in a row, so that a car in the second half can be put back by one length."""
    first = [s for s in road.segments if s.start_m < length_m]
    if not first or first[0].start_m > 0.0:
        raise ScenarioError("The road has no stretch at 0 m; expected one, to repeat the road from there.")
    again = [s.model_copy(update={"start_m": s.start_m + length_m}) for s in first]
    return road.model_copy(update={"segments": [*first, *again]})
