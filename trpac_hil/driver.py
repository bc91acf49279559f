"""Who drives the plant on the bus: up and down between two speeds for ever, over a road that repeats itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, RoadSegment, Scenario
from scenarios.plant import PlantState, advance, initial_state
from scenarios.plant.parameters import POSITION
from trpac_core.vision.classes import Surface

SLOW_M_S, FAST_M_S = 4.0, 14.0
PULSE_S, PAUSE_S, RAMP_S = 0.45, 0.25, 0.05
GRIP_SHARE = 0.88
"""Share of the grip that a pulse uses, as a driver who feels the road would: it shows theta and slides little [-]."""


@dataclass
class Driver:
    """Pedal pulses: the accelerator until fast, then the brake until slow.

    Parameters
    ----------
    peak_nm : float
        Most that a motor gives [N m].
    """

    peak_nm: float
    braking: bool = False

    def torque_nm(
        self,
        time_s: float,
        speed_m_s: float,
        theta: Sequence[float],
        load_n: Sequence[float],
        radius_m: float,
    ) -> tuple[float, float, float, float]:
        """Torque of the four wheels now."""
        if speed_m_s > FAST_M_S:
            self.braking = True
        elif speed_m_s < SLOW_M_S:
            self.braking = False
        within_s = math.fmod(time_s, PULSE_S + PAUSE_S)
        share = GRIP_SHARE * max(0.0, min(within_s / RAMP_S, (PULSE_S - within_s) / RAMP_S, 1.0))
        grips = [t * n * radius_m for t, n in zip(theta, load_n, strict=True)]
        least = [min(grips[:2]), min(grips[:2]), min(grips[2:]), min(grips[2:])]
        if self.braking:
            fl, fr, rl, rr = (-share * grip for grip in least)
        else:
            fl, fr, rl, rr = (min(share * grip, self.peak_nm) for grip in least)
        return fl, fr, rl, rr


class EndlessDrive:
    """The reference plant on a scenario's road, which begins anew where it ends; raises ScenarioError at the start."""

    def __init__(self, scenario: Scenario) -> None:
        self._length_m = scenario.end.position_m
        self.road = repeated(scenario.road, self._length_m)
        self._car = scenario.vehicle.to_core()
        self._driver = Driver(self._car.motor_peak_torque_nm)
        self.state: PlantState = initial_state(scenario.vehicle, self.road, SLOW_M_S)
        self.torque_nm = self.state.wheel_torque_nm
        self._wrapped_m = 0.0

    def advance(self, step_s: float) -> PlantState:
        """The plant one step later."""
        state, wheels = self.state, self.state.wheels
        self.torque_nm = self._driver.torque_nm(
            state.time_s, state.speed_m_s, wheels.theta, wheels.load_n, self._car.wheel_radius_m
        )
        state = advance(state, self.torque_nm, step_s)
        if state.position_m > 1.5 * self._length_m:
            y = state.y.copy()
            y[POSITION] -= self._length_m
            self._wrapped_m += self._length_m
            state = replace(state, y=y)
        self.state = state
        return state

    @property
    def way_m(self) -> float:
        """Way of the centre of gravity since the start [m]."""
        return self.state.position_m + self._wrapped_m

    def surfaces_ahead(self, ahead_m: float) -> tuple[Surface, Surface]:
        """Surface under the left and the right track this far ahead of the front axle."""
        front_m = self.state.position_m + self._car.cog_to_front_axle_m
        return self.road.segment_at(front_m + ahead_m).surface_classes


def repeated(road: RoadFile, length_m: float) -> RoadFile:
    """The road twice in a row: a car that is put back by one length in the second does not notice."""
    first = [s for s in road.segments if s.start_m < length_m]
    if not first or first[0].start_m > 0.0:
        raise ScenarioError("The road has no stretch at 0 m; expected one, to repeat the road from there.")
    again: list[RoadSegment] = [s.model_copy(update={"start_m": s.start_m + length_m}) for s in first]
    return road.model_copy(update={"segments": [*first, *again]})
