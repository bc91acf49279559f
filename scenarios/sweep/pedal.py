"""A driver of pedal pulses on roads whose friction differs from run to run.

The paper's pedal pulses are made for theta 0.9, then 0.3, then 0.5; on other roads they would spin the wheels or not
excite the tyre. So each pulse demands a share of theta F_z under the front wheels at its start, up to the motors' peak;
on dry road, where the motors' peak excites too little, a launch is followed by light pulses, as in the paper. A pulse
that spins a front wheel, because the road changes, ends after a reaction time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenarios.files import Manoeuvre, Pulse, RoadSegment, Scenario
from scenarios.plant import dynamics
from scenarios.plant.parameters import POSITION, SPEED
from scenarios.plant.pipeline import PlantSetup, make_setup
from scenarios.sweep.files import PedalDraw, sample
from trpac_core.vehicle import Vehicle

FIRST_S = 0.02
LAUNCH_S = 1.43
RAMP_S = 0.05
"""Start, length of the launch and ramp of the paper's pulses (scenarios/manoeuvres/pulsed_acceleration.yaml) [s]."""
SPINNING = 0.3
"""Slip of a front wheel at which the driver notices the spin [-]."""
REACTION_S = 0.15
"""Time from then until the pedal is released: a quick driver, or a slow traction control [s]."""
NOTICED_M_S = 1.0
"""Car speed below which spin is not noticed: at a standing start slip is 1 [m/s]."""


def drive_pedal(scenario: Scenario, pedal: PedalDraw, random: np.random.Generator) -> Manoeuvre:
    """The manoeuvre of a run: pedal pulses along the road."""
    setup, car, step_s = (
        make_setup(scenario.vehicle, scenario.road),
        scenario.vehicle.to_core(),
        scenario.step_s,
    )
    to_front_m = car.cog_to_front_axle_m
    y = dynamics.initial_y(0.0, -to_front_m, setup.parameters)
    begin_s, made = 0.0, FIRST_S
    pulses: list[Pulse] = []
    while made < scenario.end.time_s and y[POSITION] + to_front_m < scenario.end.position_m:
        here = scenario.road.segment_at(float(y[POSITION]) + to_front_m)
        use = sample("pedal.grip_use", pedal.grip_use, random)
        length_s = sample("pedal.pulse_s", pedal.pulse_s, random)
        launch = not pulses and here.surface == "dry"
        torque_nm = _torque_nm(car, here, use, launch, pedal.light_torque_nm)
        end_s = made + max(LAUNCH_S if launch else length_s, 2.0 * RAMP_S)
        next_s = made + max(pedal.period_s, LAUNCH_S + 0.3 if launch else 0.0, end_s - made + 0.02)
        pulse = Pulse(start_s=made, end_s=end_s, torque_nm=torque_nm, ramp_s=RAMP_S)
        before = y.copy()
        spun_s = _advance(y, pulse, begin_s, next_s, step_s, setup)
        if spun_s is not None and spun_s + REACTION_S < end_s:
            pulse = pulse.model_copy(update={"end_s": max(spun_s + REACTION_S, made + 2.0 * RAMP_S)})
            y = before
            _advance(y, pulse, begin_s, next_s, step_s, setup)
        pulses.append(pulse)
        begin_s, made = next_s, next_s
    return Manoeuvre(schema=1, name="pulsed by grip", pulses=pulses)


def _torque_nm(car: Vehicle, here: RoadSegment, use: float, launch: bool, light_nm: float) -> float:
    """Torque of each wheel: a share of theta F_z of a front wheel under acceleration, up to the peak [N m]."""
    if here.surface == "dry":
        return car.motor_peak_torque_nm if launch else min(light_nm, car.motor_peak_torque_nm)
    peak_n, force_n = car.motor_peak_torque_nm / car.wheel_radius_m, 0.0
    for _ in range(3):  # load and acceleration depend on each other; this converges fast
        load_n = car.wheel_load(True, 4.0 * force_n / car.mass_kg)
        force_n = min(use * min(here.mu_left, here.mu_right) * load_n, peak_n)
    return force_n * car.wheel_radius_m


def _advance(
    y: NDArray[np.float64], pulse: Pulse, from_s: float, to_s: float, step_s: float, setup: PlantSetup
) -> float | None:
    """Advance y over one pulse and the pause after it; returns the time at which a front wheel spins, or None [s]."""
    steps = np.arange(round((to_s - from_s) / step_s) + 1, dtype=np.float64)
    time_s: NDArray[np.float64] = from_s + step_s * steps
    torque = np.repeat(pulse.torque(time_s)[:, None], 4, axis=1)
    states, _, slip, *_ = dynamics.run(y, torque, step_s, setup.parameters, setup.road)
    spinning = (slip[:, :2].max(axis=1) > SPINNING) & (states[:, SPEED] > NOTICED_M_S)
    return float(time_s[int(np.argmax(spinning))]) if spinning.any() else None
