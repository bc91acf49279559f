"""The plant's equations and their integration, compiled.

A straight-line car in 34 states, integrated by the classical Runge-Kutta method at one fixed step per car, small enough
for the stiffest mode: the wheel's eigenvalue is 1.27 C_x R^2 / (I v), so the slip's denominator has a floor of
`FLOOR_M_S`, below which the drives do not go. A wheel that a brake has stopped stays at rest until the road or the
motor turns it.

What every wheel calls in every step is inlined: handing on the whole of `Physics` costs a third of the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .compiling import compiled
from .details import (
    FLOOR_M_S,
    LASH_NM,
    LASH_SHARE,
    ROLL_M_S,
    RUBS_M_S,
    SLIPPERY,
    USUAL_M_S,
    coarse,
    friction,
    gravelly,
    let_through,
    radius_at,
    spread,
    told_friction,
    warmth,
    winding,
)
from .motors import COMMAND_STEP_S, motor_torque, on_grid
from .physics import Physics
from .tyre import THETA_GRID, dugoff, foreign

Array = NDArray[np.floating[Any]]

GRAVITY = 9.81
RECORD_STEP_S = 0.001
LEAST_LAG_S = 0.001
"""Of a motor whose torque rises at a limited rate: how closely it follows below the limit."""
STAGES = (0.0, 0.5, 0.5, 1.0)
"""Where in a step the Runge-Kutta method takes the slope [-]."""

PITCH_S = 0.0005
"""How late the loads follow the acceleration, in place of an implicit loop. 4 ms would show in a locking wheel."""
SLOSH_DAMPING = 0.12
"""Of a load that sways in the car, over the critical one [-]."""

X, V, W, MOTOR, TWIST, SLIP, LAG, ANGLE, HEAT, PITCH, BODY, SWAY, SWAYING, N = (
    *(0, 1, 2, 6, 10, 14, 18, 22, 26, 30),
    *(31, 32, 33, 34),
)
"""Where the states lie: position, speed; each wheel's speed, motor speed, twist, slip, torque, angle, heat; pitch; what
the springs carry of it; a load's place and speed in the car."""


@njit(cache=True, inline="always")
def slip_of(rim: float, speed: float) -> float:
    """Signed slip, positive when driving [-]."""
    return (rim - speed) / max(abs(rim), abs(speed), FLOOR_M_S)


@njit(cache=True, inline="always")
def tyre_force(
    p: Physics, slip: float, sliding: float, theta: float, load: float, heat: float, stiffer: float = 0.0
) -> float:
    """Signed longitudinal force of one tyre [N], `stiffer` than the others [N]."""
    size = min(abs(slip), 1.0)
    stiffness = p.stiffness_drive if slip >= 0.0 else p.stiffness_brake
    if stiffer != 0.0:
        stiffness += stiffer
    fade = 1.0 / (1.0 + heat)
    grip = theta * fade
    if p.falloff > 0.0:
        fallen = p.falloff * abs(sliding)
        if p.falloff_logarithmic:
            grip *= 1.0 - (1.0 - p.falloff_floor) * min(np.log1p(fallen), 1.0)
        else:
            grip *= p.falloff_floor + (1.0 - p.falloff_floor) * np.exp(-fallen)
    force = dugoff(size, stiffness * fade, grip, load)
    if p.foreign_share > 0.0:
        top = load * on_grid(p.peak, (grip - THETA_GRID[0]) / (THETA_GRID[1] - THETA_GRID[0]))
        rise = 1.27 * stiffness * fade
        other = foreign(p.foreign_curve, size, rise, top, p.foreign_first, p.foreign_second)
        force += p.foreign_share * (other - force)
    return force if slip >= 0.0 else -force


@compiled
def slope(p: Physics, y: Array, time: float, command: Array, dy: Array) -> float:
    """Derivative of the state into `dy`; returns what an ideal accelerometer reads [m/s^2]."""
    speed, length = y[V], p.front_arm + p.rear_arm
    grade = p.grade
    if p.wave_slope != 0.0:
        grade += p.wave_slope * np.sin(2.0 * np.pi * y[X] / p.wave_length)
    press = p.mass * GRAVITY / np.sqrt(1.0 + grade * grade)
    shifted = y[PITCH]
    if p.springs_share > 0.0:
        shifted += p.springs_share * (y[BODY] - y[PITCH])
    total = 0.0
    for w in range(4):
        arm = p.rear_arm if w < 2 else p.front_arm
        pitch = -shifted if w < 2 else shifted
        tilt = 0.5 * p.drag * p.drag_height / length
        air = speed * speed * (0.25 * p.lift + (tilt if w < 2 else -tilt))
        load = max((press * arm + pitch * p.mass * p.cog_height) / (2.0 * length) - air, 0.0)
        if p.load_side != 0.0:
            load *= 1.0 + (p.load_side if w % 2 == 0 else -p.load_side)
        more = 0.0
        if p.grip_sign != 0.0:
            more = p.grip_sign * np.tanh((y[W + w] * p.radius - speed) / RUBS_M_S)
        theta = friction(p, w, y[X], speed, more)
        radius = p.radius
        unlike = p.radius_tilt != 0.0 or p.radius_side != 0.0 or p.radius_sides != 0.0
        if unlike or p.radius_growth != 0.0 or p.out_of_round > 0.0:
            radius = radius_at(p, w, speed, y[ANGLE + w])
        rim = y[W + w] * radius
        slip = slips = slip_of(rim, speed)
        dy[SLIP + w] = 0.0
        if p.relaxation > 0.0:
            path = p.relaxation
            if p.relaxation_load:
                path *= max(load / (0.25 * p.mass * GRAVITY), 0.2)
            dy[SLIP + w] = (slip - y[SLIP + w]) * max(abs(rim), abs(speed), FLOOR_M_S) / path
            slip = y[SLIP + w]
        rubbing = rim - speed
        if p.falloff_wet != 0.0 and told_friction(p, w, y[X]) < SLIPPERY:
            rubbing *= 1.0 + p.falloff_wet
        stiffer = spread(p.stiffness_tilt, 0.0, w)
        if p.stiffness_texture != 0.0:
            stiffer += p.stiffness_texture * coarse(y[X] + (p.front_arm if w < 2 else -p.rear_arm))
        force = tyre_force(p, slip, rubbing, theta, load, y[HEAT + w], stiffer)
        total += force
        dy[HEAT + w] = p.heating * abs(force * (rim - speed)) - p.cooling * y[HEAT + w]
        dy[ANGLE + w] = y[W + w]
        resisting = p.brake_drag * p.brake_share[w]
        if p.brake_pulse > 0.0:
            resisting *= 1.0 + p.brake_pulse * np.cos(y[ANGLE + w] + 1.7 * w)
        rolling = p.roll_moment * load * p.radius
        if p.roll_growth > 0.0:
            rolling *= 1.0 + p.roll_growth * ((speed / ROLL_M_S) ** 2 - 1.0)
        if p.roll_linear > 0.0 or p.roll_load != 0.0:
            faster = 1.0 + p.roll_linear * (speed / ROLL_M_S - 1.0)
            rolling *= faster * max(load / (0.25 * p.mass * GRAVITY), 1e-3) ** p.roll_load
        if p.roll_warm != 0.0:
            rolling *= 1.0 + p.roll_warm * warmth(time)
        resisting += rolling
        if p.gravel > 0.0:
            at = y[X] + (p.front_arm if w < 2 else -p.rear_arm)
            resisting += p.gravel * load * p.radius * gravelly(at)
        if p.slush > 0.0 and told_friction(p, w, y[X]) < SLIPPERY:
            resisting += 0.25 * p.slush * speed * speed * radius
        if resisting > 0.0:
            resisting *= np.tanh(y[W + w] / 0.2)
        resisting += p.bearing * y[W + w]
        told = motor_torque(p, command, w, time, y[ANGLE + w], y[W + w])
        follows = p.lag > 0.0 or p.slew > 0.0 or p.actuator_play > 0.0
        lag = p.lag
        if p.lag_zero != 0.0:
            lag *= 1.0 + p.lag_zero * (np.exp(-((y[LAG + w] / LASH_NM) ** 2)) - LASH_SHARE)
        if p.actuator_play > 0.0:
            told -= min(max(told - y[LAG + w], -p.actuator_play), p.actuator_play)
        dy[LAG + w] = (told - y[LAG + w]) / max(lag, LEAST_LAG_S) if follows else 0.0
        if p.slew > 0.0:
            dy[LAG + w] = min(max(dy[LAG + w], -p.slew), p.slew)
        torque = y[LAG + w] if follows else told
        if p.axle_viscous > 0.0:
            torque += p.axle_viscous * (y[W + (w + 2) % 4] - y[W + w])
        if p.slip_cut > 0.0:
            torque = let_through(p, torque, slips)
        dy[MOTOR + w] = dy[TWIST + w] = 0.0
        if p.motor_inertia > 0.0:
            dy[TWIST + w] = y[MOTOR + w] - y[W + w]
            stiffness = p.shaft_stiffness * (1.0 + spread(p.shaft_axles, 0.0, w))
            shaft = stiffness * y[TWIST + w] + p.shaft_damping * dy[TWIST + w]
            dy[MOTOR + w] = (torque - shaft) / p.motor_inertia
            torque = shaft
        dy[W + w] = (torque - force * radius - resisting) / (p.inertia - p.motor_inertia)
    total -= p.drag * speed * speed + p.roll_force * press * np.tanh(speed / 0.1)
    if p.bend_drag > 0.0:
        total -= p.bend_drag * winding(y[X]) * (speed / USUAL_M_S) ** 2
    if p.gust_drag > 0.0:
        against = speed + on_grid(p.wind, time / COMMAND_STEP_S)
        total -= p.gust_drag * (against * abs(against) - speed * speed)
    reading = total / p.mass
    dy[SWAY] = dy[SWAYING] = 0.0
    if p.slosh_share > 0.0:
        pull = p.slosh_rate * (p.slosh_rate * y[SWAY] + 2.0 * SLOSH_DAMPING * y[SWAYING])
        reading = (reading + p.slosh_share * pull) / (1.0 - p.slosh_share)
        dy[SWAY] = y[SWAYING]
        dy[SWAYING] = -reading - pull
    dy[X] = speed
    dy[V] = reading - press * grade / p.mass
    dy[PITCH] = (reading - y[PITCH]) / PITCH_S
    dy[BODY] = (reading - y[BODY]) / p.springs_time
    return reading


@compiled
def step(p: Physics, y: Array, time: float, h: float, command: Array, k: Array, trial: Array) -> float:
    """One step of the classical Runge-Kutta method, in place; returns the accelerometer's reading before it.

    The slope is called at one place, since each call compiles it once more.
    """
    reading = 0.0
    for stage in range(4):
        ahead = STAGES[stage] * h
        trial[:] = y
        if stage > 0:
            trial += ahead * k[stage - 1]
        told = slope(p, trial, time + ahead, command, k[stage])
        if stage == 0:
            reading = told
    y += h / 6.0 * (k[0] + 2.0 * (k[1] + k[2]) + k[3])
    y[V] = max(y[V], 0.0)
    for w in range(4):
        if y[W + w] < 0.0:
            y[W + w] = 0.0
            y[MOTOR + w] = max(y[MOTOR + w], 0.0)
    return reading


@compiled
def integrate(p: Physics, y: Array, start: int, rows: int, split: int, command: Array, out: Array) -> None:
    """Carry `y` over `rows` records of `RECORD_STEP_S` from record `start` on.

    Parameters
    ----------
    p : Physics
    y : array, shape (N,)
        State at record `start`; changed.
    start, rows : int
        First record and how many follow.
    split : int
        Integration steps per record.
    command : array, shape (n, 4)
        Commanded torque every `COMMAND_STEP_S` [N m].
    out : array, shape (>= start + rows + 1, N + 1)
        State from `start + 1` on; the accelerometer's reading in the last column, that at `start` included.
    """
    k, trial = np.zeros((4, N)), np.zeros(N)
    h = RECORD_STEP_S / split
    for i in range(start, start + rows):
        for j in range(split):
            reading = step(p, y, i * RECORD_STEP_S + j * h, h, command, k, trial)
            if j == 0:
                out[i, N] = reading
        out[i + 1, :N] = y
    out[start + rows, N] = slope(p, y, (start + rows) * RECORD_STEP_S, command, trial)


@compiled
def begin(p: Physics, position: float, speed: float, wheels: Array, time: float, command: Array) -> Array:
    """State of a car that has driven steadily like this until now."""
    y = np.zeros(N)
    y[X], y[V] = position, speed
    for w in range(4):
        y[W + w] = y[MOTOR + w] = wheels[w]
        y[SLIP + w] = slip_of(wheels[w] * p.radius, speed)
        y[LAG + w] = motor_torque(p, command, w, time, 0.0, wheels[w])
        if p.motor_inertia > 0.0:
            y[TWIST + w] = y[LAG + w] / p.shaft_stiffness
    dy = np.empty(N)
    for _ in range(6):
        y[PITCH] = slope(p, y, time, command, dy)
        if p.springs_share > 0.0:
            y[BODY] = y[PITCH]
    return y


@compiled
def replay(
    p: Physics,
    position: Array,
    speed: Array,
    wheels: Array,
    split: int,
    command: Array,
    rows: int,
    settle: int,
) -> Array:
    """What the car `p` does after every `rows` records when it is set to the state that was read there.

    Returns
    -------
    array, shape (n, 6)
        Four wheel speeds, vehicle speed, accelerometer; NaN for the first `settle` records of each window.
    """
    n = speed.size
    out = np.full((n, 6), np.nan)
    path = np.zeros((n + 1, N + 1))
    for start in range(0, n - 1, rows):
        count = min(rows, n - 1 - start)
        y = begin(p, position[start], speed[start], wheels[start], start * RECORD_STEP_S, command)
        integrate(p, y, start, count, split, command, path)
        for i in range(start + settle, start + count + 1):
            out[i, :4] = path[i, W : W + 4]
            out[i, 4] = path[i, V]
            out[i, 5] = path[i, N]
    return out
