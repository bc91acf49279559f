"""The plant's equations and their integration, compiled.

A straight-line car in 42 states, integrated by the classical Runge-Kutta method at one fixed step per car, small enough
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

from .air import dragging
from .commands import COMMAND_STEP_S, on_grid
from .compiling import compiled
from .details import (
    FLOOR_M_S,
    FORMING,
    JACK_M_S2,
    ROLL_M_S,
    SLIPPERY,
    SMALL_M_S2,
    SMALL_TORQUE_NM,
    STOPS_M_S2,
    USUAL_M_S,
    USUAL_NM,
    USUAL_RAD_S,
    braking,
    coarse,
    friction,
    gravelly,
    gripping,
    lag_of,
    let_through,
    profile_at,
    radius_at,
    rolling_of,
    shaft_of,
    spread,
    stiffened,
    told_friction,
    warmth,
    winding,
)
from .falling import fallen
from .motors import motor_torque
from .physics import Physics
from .tyre import THETA_GRID, dugoff, foreign

Array = NDArray[np.floating[Any]]

GRAVITY = 9.81
RECORD_STEP_S = 0.001
LEAST_LAG_S = 0.001
"""Of a motor whose torque rises at a limited rate: how closely it follows below the limit."""
STAGES = (0.0, 0.5, 0.5, 1.0)
"""Where in a step the Runge-Kutta method takes the slope [-]."""

BODY_DAMPING = 0.4
"""Of a body that pitches on its springs, over the critical one [-]."""
SLOSH_DAMPING = 0.12
"""Of a load that sways in the car, over the critical one [-]."""

X, V, W, MOTOR, TWIST, SLIP, LAG, ANGLE, HEAT, PITCH, BODY, STAGE, RUB, SWAY, SWAYING, N = (
    *(0, 1, 2, 6, 10, 14, 18, 22, 26, 30),
    *(31, 32, 36, 40, 41, 42),
)
"""Where the states lie: position, speed; each wheel's speed, motor speed, twist, slip, torque, angle, heat; pitch; what
the springs carry of it, or its rate; each motor's first stage, each tyre's rubbing; a load's place, speed in the car.

Where the force is what relaxes, `SLIP` holds the force [N].
"""


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
    if p.stiffness_load != 0.0:
        stiffness += p.stiffness_load * (min(load / (0.25 * p.mass * GRAVITY), 2.0) - 1.0)
    fade = 1.0 / (1.0 + heat)
    grip = theta * fade
    if p.falloff > 0.0:
        grip *= fallen(p.falloff_curve, p.falloff * abs(sliding), p.falloff_floor)
    force = dugoff(size, stiffness * fade, grip, load)
    if p.foreign_share > 0.0:
        top = load * on_grid(p.peak, (grip - THETA_GRID[0]) / (THETA_GRID[1] - THETA_GRID[0]))
        rise = 1.27 * stiffness * fade
        other = foreign(p.foreign_curve, size, rise, top, p.foreign_first, p.foreign_second)
        force += p.foreign_share * (other - force)
    return force if slip >= 0.0 else -force


@compiled
def relaxing(p: Physics, slip: float, theta: float, load: float) -> float:
    """Relaxation length of a tyre whose lagged slip is `slip` [m].

    A brush's contact shortens as it begins to slide (Pacejka 2012, Sec. 7.1); a fifth is left of it here.
    """
    length = p.relaxation
    if p.relaxation_load:
        length *= max(load / (0.25 * p.mass * GRAVITY), 0.2)
    if p.relaxation_shrinks:
        gone = 1.27 * p.stiffness_drive * abs(slip) / max(3.0 * theta * load, 1.0)
        length *= max(1.0 - gone, 0.2)
    return length


@compiled
def lean(p: Physics, y: Array, reading: float, dy: Array) -> None:
    """How the body follows its acceleration, into `dy`: at once and in part through springs, or as a mass on them."""
    if p.body_rate > 0.0:
        dy[PITCH] = y[BODY]
        dy[BODY] = p.body_rate * (p.body_rate * (reading - y[PITCH]) - 2.0 * BODY_DAMPING * y[BODY])
        return
    pitch_time = p.pitch_time
    if p.pitch_sign != 0.0:
        pitch_time *= 1.0 + p.pitch_sign * np.tanh((reading - y[PITCH]) / SMALL_M_S2)
    if p.pitch_stops > 0.0:
        pitch_time /= 1.0 + p.pitch_stops * np.tanh((y[PITCH] / STOPS_M_S2) ** 2)
    dy[PITCH] = (reading - y[PITCH]) / pitch_time
    dy[BODY] = (reading - y[BODY]) / p.springs_time if p.springs_share > 0.0 else 0.0


@compiled
def slope(p: Physics, y: Array, time: float, command: Array, dy: Array) -> float:
    """Derivative of the state into `dy`; returns what an ideal accelerometer reads [m/s^2]."""
    speed, length = y[V], p.front_arm + p.rear_arm
    grade = p.grade
    if p.wave_slope != 0.0:
        grade += p.wave_slope * np.sin(2.0 * np.pi * y[X] / p.wave_length)
    if p.profile.size > 0:
        grade += p.grade * profile_at(p.profile, y[X])
    press = p.mass * GRAVITY / np.sqrt(1.0 + grade * grade)
    shifted = y[PITCH]
    if p.springs_share > 0.0:
        share = p.springs_share
        if p.springs_tilt != 0.0:
            share += p.springs_tilt * np.tanh(y[PITCH] / SMALL_M_S2)
        shifted += share * (y[BODY] - y[PITCH])
        if p.springs_rub > 0.0:
            shifted = y[BODY] + min(max(y[PITCH] - y[BODY], -p.springs_rub), p.springs_rub)
    height = p.cog_height
    if p.height_jack != 0.0:
        height *= 1.0 + p.height_jack * np.tanh(shifted / JACK_M_S2)
    total = 0.0
    for w in range(4):
        arm = p.rear_arm if w < 2 else p.front_arm
        pitch = -shifted if w < 2 else shifted
        tilt = 0.5 * p.drag * p.drag_height / length
        air = speed * speed * (0.25 * p.lift + (tilt if w < 2 else -tilt))
        load = max((press * arm + pitch * p.mass * height) / (2.0 * length) - air, 0.0)
        if p.load_side != 0.0:
            load *= 1.0 + (p.load_side if w % 2 == 0 else -p.load_side)
        more = 0.0
        if p.grip_sign != 0.0 or p.grip_slide != 0.0 or p.grip_load != 0.0:
            more = gripping(p, y[W + w] * p.radius - speed, load / (0.25 * p.mass * GRAVITY))
        theta = friction(p, w, y[X], speed, time, more)
        radius = p.radius
        unlike = p.radius_tilt != 0.0 or p.radius_side != 0.0 or p.radius_sides != 0.0
        if unlike or p.radius_growth != 0.0 or p.out_of_round > 0.0:
            radius = radius_at(p, w, speed, y[ANGLE + w])
        if p.radius_warm != 0.0:
            radius += p.radius_warm * warmth(time)
        if p.radius_load != 0.0:
            radius += p.radius_load * (min(load / (0.25 * p.mass * GRAVITY), 2.0) - 1.0)
        if p.radius_wet != 0.0 and told_friction(p, w, y[X]) < SLIPPERY:
            radius += p.radius_wet
        rim = y[W + w] * radius
        slip = slips = slip_of(rim, speed)
        dy[SLIP + w] = 0.0
        if p.relaxation > 0.0:
            path = relaxing(p, y[SLIP + w], theta, load)
            if p.relaxation_speed != 0.0:
                path *= 1.0 + p.relaxation_speed * (speed / USUAL_M_S - 1.0)
            if p.relaxation_warm != 0.0:
                path *= 1.0 + p.relaxation_warm * warmth(time)
            if p.relaxation_rise != 0.0:
                path *= 1.0 + p.relaxation_rise * np.tanh((abs(slip) - abs(y[SLIP + w])) / FORMING)
            if p.relaxation_tilt != 0.0 or p.relaxation_side != 0.0:
                path *= 1.0 + spread(p.relaxation_tilt, p.relaxation_side, w)
            dy[SLIP + w] = (slip - y[SLIP + w]) * max(abs(rim), abs(speed), FLOOR_M_S) / path
            slip = y[SLIP + w]
            if p.relaxation_direct > 0.0:
                slip += p.relaxation_direct * (slips - slip)
        rubbing = rim - speed
        dy[RUB + w] = 0.0
        if p.falloff_time > 0.0:
            dy[RUB + w] = (rubbing - y[RUB + w]) / p.falloff_time
            rubbing = y[RUB + w]
        slippery = (
            told_friction(p, w, y[X]) < SLIPPERY if p.stiffness_wet != 0.0 or p.falloff_wet != 0.0 else False
        )
        if slippery:
            rubbing *= 1.0 + p.falloff_wet
        stiffer = spread(p.stiffness_tilt, p.stiffness_side, w)
        if p.stiffness_sides != 0.0:
            stiffer += p.stiffness_sides if w % 2 == 0 else -p.stiffness_sides
        if p.stiffness_warm != 0.0 or p.stiffness_speed != 0.0:
            stiffer += stiffened(p, time, speed)
        if p.stiffness_texture != 0.0:
            stiffer += p.stiffness_texture * coarse(y[X] + (p.front_arm if w < 2 else -p.rear_arm))
        if slippery:
            stiffer += p.stiffness_wet
        force = tyre_force(p, slip, rubbing, theta, load, y[HEAT + w], stiffer)
        if p.force_relaxation > 0.0:
            dy[SLIP + w] = (force - y[SLIP + w]) * max(abs(speed), FLOOR_M_S) / p.force_relaxation
            force = y[SLIP + w]
        total += force
        dy[HEAT + w] = p.heating * abs(force * (rim - speed)) - p.cooling * y[HEAT + w]
        dy[ANGLE + w] = y[W + w]
        resisting = braking(p, w, y[X], y[ANGLE + w], y[W + w], time)
        rolling = p.roll_moment * load * p.radius
        if p.roll_growth > 0.0:
            rolling *= 1.0 + p.roll_growth * ((speed / ROLL_M_S) ** 2 - 1.0)
        differs = p.roll_linear > 0.0 or p.roll_tilt != 0.0 or p.roll_side != 0.0 or p.roll_load != 0.0
        if differs or p.roll_wet > 0.0 or p.roll_texture > 0.0 or p.roll_slow != 0.0:
            rolling *= rolling_of(p, w, y[X], speed, load / (0.25 * p.mass * GRAVITY))
        if p.roll_warm != 0.0:
            rolling *= 1.0 + p.roll_warm * warmth(time)
        if p.roll_torque > 0.0:
            rolling *= 1.0 + p.roll_torque * min((force * radius / USUAL_NM) ** 2, 4.0)
        if p.roll_flat > 0.0:
            rolling *= 1.0 + p.roll_flat * np.cos(y[ANGLE + w] + 2.9 * w)
        resisting += rolling
        if p.gravel > 0.0:
            at = y[X] + (p.front_arm if w < 2 else -p.rear_arm)
            resisting += p.gravel * load * p.radius * gravelly(at)
        if p.slush > 0.0 and told_friction(p, w, y[X]) < SLIPPERY:
            resisting += 0.25 * p.slush * speed * speed * radius
        if resisting > 0.0:
            resisting *= np.tanh(y[W + w] / 0.2)
        resisting += p.bearing * y[W + w]
        if p.fanning > 0.0:
            resisting += p.fanning * y[W + w] ** 2
        told = motor_torque(p, command, w, time, y[ANGLE + w], y[W + w])
        dy[STAGE + w] = 0.0
        if p.lag_first > 0.0:
            dy[STAGE + w] = (told - y[STAGE + w]) / p.lag_first
            told = y[STAGE + w]
        follows = p.lag > 0.0 or p.slew > 0.0 or p.actuator_play > 0.0
        lag = p.lag
        if p.lag_sign != 0.0:
            lag *= 1.0 + p.lag_sign * np.tanh((told + y[LAG + w]) / SMALL_TORQUE_NM)
        if p.lag_warm != 0.0:
            lag *= 1.0 + p.lag_warm * warmth(time)
        unlike = p.lag_tilt != 0.0 or p.lag_speed != 0.0 or p.lag_side != 0.0
        if unlike or p.lag_rise != 0.0 or p.lag_load != 0.0 or p.lag_zero != 0.0:
            lag *= lag_of(p, w, y[W + w], told, y[LAG + w])
        if p.actuator_play > 0.0:
            told -= min(max(told - y[LAG + w], -p.actuator_play), p.actuator_play)
        dy[LAG + w] = (told - y[LAG + w]) / max(lag, LEAST_LAG_S) if follows else 0.0
        if p.lag > 0.0 and p.lag_damping > 0.0:
            rate = 2.0 * p.lag_damping / max(lag, LEAST_LAG_S)
            dy[LAG + w] = y[STAGE + w]
            dy[STAGE + w] = rate * (rate * (told - y[LAG + w]) - 2.0 * p.lag_damping * y[STAGE + w])
        if p.slew > 0.0:
            dy[LAG + w] = min(max(dy[LAG + w], -p.slew), p.slew)
        torque = y[LAG + w] if follows else told
        if p.lag_tail > 0.0:
            dy[STAGE + w] = (told - y[STAGE + w]) / p.lag_slow
            torque += p.lag_tail * (y[STAGE + w] - torque)
        if p.lag_direct > 0.0 and follows:
            torque += p.lag_direct * (told - torque)
        if p.axle_viscous > 0.0:
            torque += p.axle_viscous * (y[W + (w + 2) % 4] - y[W + w])
        if p.slip_cut > 0.0:
            torque = let_through(p, torque, slips)
        inertia = p.inertia - p.motor_inertia + spread(-p.inertia_tilt, p.inertia_side, w)
        if p.inertia_sides != 0.0:
            inertia += p.inertia_sides if w % 2 == 0 else -p.inertia_sides
        if p.inertia_speed != 0.0:
            inertia += p.inertia_speed * (min(y[W + w] / USUAL_RAD_S, 2.0) - 1.0)
        dy[MOTOR + w] = dy[TWIST + w] = 0.0
        if p.motor_inertia > 0.0:
            dy[TWIST + w] = y[MOTOR + w] - y[W + w]
            shaft = p.shaft_stiffness * y[TWIST + w] + p.shaft_damping * dy[TWIST + w]
            unlike = p.shaft_tilt != 0.0 or p.shaft_axles != 0.0 or p.shaft_sign != 0.0 or p.shaft_turn != 0.0
            unlike = unlike or p.shaft_friction > 0.0 or p.shaft_warm != 0.0
            if unlike or p.shaft_play > 0.0 or p.shaft_rise != 0.0:
                shaft = shaft_of(p, w, y[TWIST + w], dy[TWIST + w], y[ANGLE + w], time)
            dy[MOTOR + w] = (torque - shaft) / p.motor_inertia
            torque = shaft
        dy[W + w] = (torque - force * radius * p.lever - resisting) / inertia
    drag = dragging(p, speed, y[X], time, y[PITCH])
    total -= drag * speed * speed + p.roll_force * press * np.tanh(speed / 0.1)
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
    lean(p, y, reading, dy)
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
        y[SLIP + w] = 0.0 if p.force_relaxation > 0.0 else slip_of(wheels[w] * p.radius, speed)
        y[LAG + w] = y[STAGE + w] = motor_torque(p, command, w, time, 0.0, wheels[w])
        if p.lag_damping > 0.0:
            y[STAGE + w] = 0.0
        if p.motor_inertia > 0.0:
            y[TWIST + w] = y[LAG + w] / p.shaft_stiffness + np.sign(y[LAG + w]) * p.shaft_play
    dy = np.empty(N)
    for _ in range(6):
        y[PITCH] = slope(p, y, time, command, dy)
        if p.springs_share > 0.0:
            y[BODY] = y[PITCH]
        if p.force_relaxation > 0.0:
            y[SLIP : SLIP + 4] += dy[SLIP : SLIP + 4] * p.force_relaxation / max(abs(speed), FLOOR_M_S)
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
