"""An independent solution of the plant's equations: other code, another method, tight tolerances.

Torque and road are piecewise smooth, so the integration restarts at each corner of the torque and at each border that
an axle crosses. Wheels at rest that a resistance holds are outside its reach: start rolling, or without resistance.
"""

import numpy as np
from scipy.integrate import solve_ivp

G = 9.81


def friction_force(theta, slip, load, stiffness):
    """Modified Dugoff force, straight from its definition with L (slip below 1)."""
    if slip == 0.0:
        return 0.0
    saturation = theta * load * (1.0 - slip) / (2.0 * stiffness * slip)
    f = saturation * (2.0 - saturation) if saturation < 1.0 else 1.0
    g = (1.15 - 0.75 * theta) * slip**2 - (1.63 - 0.75 * theta) * slip + 1.27
    return stiffness * slip / (1.0 - slip) * f * g


def shrunk(theta, slip, load, stiffness, step=1e-6):
    """Share of its length that a relaxation keeps which goes with the force's slope, here a difference quotient."""
    slip = abs(slip) + step
    ends = [friction_force(theta, slip + side * step, load, stiffness) for side in (-0.5, 0.5)]
    return np.clip((ends[1] - ends[0]) / step / (1.27 * stiffness), 0.1, 1.0)


OPTIONS = {
    "h": 0.0,  # height that acceleration moves load through
    "k": 0.0,  # drag per speed squared
    "c": 0.0,  # rolling resistance
    "c_hub": 0.0,  # the same as a force on the body
    "drag_torque": 0.0,
    "grade": 0.0,
    "falloff": 0.0,
    "falloff_floor": 1.0,
    "stiffness_exponent": 0.0,  # power of load over mean static load that stiffness goes with
    "relaxation": 0.0,
    "slip_lags": False,
    "relaxation_by_slope": False,
    "shaft_stiffness": 0.0,
    "shaft_damping": 0.0,
    "motor_inertia": 0.0,
}


def reference(car, road, torque_at, corners_s, time_s, speed=0.0, position=0.0, floor=0.01):
    """States (n, 18) at time_s: position, speed, four each of wheel speed, tyre force or slip, twist, motor speed.

    car: dict with m, l_f, l_r, radius, inertia, stiffness, and those OPTIONS that are not at their defaults.
    road: list of (start, theta left, theta right).
    """
    car = {**OPTIONS, **car}
    angle = np.arctan(car["grade"])
    lags, has_shaft = car["relaxation"] > 0.0, car["motor_inertia"] > 0.0
    used = np.array([*range(6), *(range(6, 10) if lags else ()), *(range(10, 18) if has_shaft else ())])

    def theta_at(x):
        left_right = road[0][1:]
        for start, *both in road:
            if x >= start:
                left_right = both
        return left_right

    def axle_loads(accel):
        base = car["l_f"] + car["l_r"]
        front = car["m"] * (G * np.cos(angle) * car["l_r"] - car["h"] * accel) / (2.0 * base)
        rear = car["m"] * (G * np.cos(angle) * car["l_f"] + car["h"] * accel) / (2.0 * base)
        return np.array([front, front, rear, rear])

    def slips(v, wheels):
        rims = wheels * car["radius"]
        return (rims - v) / np.maximum(np.maximum(rims, v), floor)

    def tyre_forces(v, wheels, acting, theta, accel):
        loads = axle_loads(accel)
        out = []
        for w, slip, mu, load in zip(wheels, acting, theta, loads, strict=True):
            rim = w * car["radius"]
            fallen = car["falloff_floor"] + (1.0 - car["falloff_floor"]) * np.exp(
                -car["falloff"] * abs(rim - v)
            )
            stiffness = car["stiffness"] * (4.0 * load / (car["m"] * G)) ** car["stiffness_exponent"]
            out.append(np.sign(slip) * friction_force(mu * fallen, abs(slip), load, stiffness))
        return np.array(out), loads

    def rates(t, reduced, theta, guess):
        y = np.zeros(18)
        y[used] = reduced
        v, wheels, lagged, twist, motor = y[1], y[2:6], y[6:10], y[10:14], y[14:18]
        slip = slips(v, wheels)
        acting = lagged if car["slip_lags"] else slip
        accel = np.inf
        while abs(guess[0] - accel) > 1e-12:  # loads follow acceleration and acceleration follows loads
            accel = guess[0]
            steady, loads = tyre_forces(v, wheels, acting, theta, accel)
            forces = lagged if lags and not car["slip_lags"] else steady
            guess[0] = (forces.sum() - car["k"] * v * v - car["c_hub"] * loads.sum()) / car["m"]
        transport = np.maximum(np.maximum(wheels * car["radius"], v), floor)
        behind = (slip if car["slip_lags"] else steady) - lagged
        lengths = np.full(4, car["relaxation"])
        if car["relaxation_by_slope"]:
            lengths *= [
                shrunk(mu, s, load, car["stiffness"])
                for mu, s, load in zip(theta, acting, loads, strict=True)
            ]
        force_rate = transport / lengths * behind if lags else np.zeros(4)
        torque = torque_at(t)
        twist_rate = motor_rate = np.zeros(4)
        if has_shaft:
            twist_rate = motor - wheels
            shaft = car["shaft_stiffness"] * twist + car["shaft_damping"] * twist_rate
            motor_rate = (torque - shaft) / car["motor_inertia"]
            torque = shaft
        resistance = (forces + car["c"] * loads) * car["radius"] + car["drag_torque"]
        spin = (torque - resistance) / (car["inertia"] - car["motor_inertia"])
        return np.array([v, guess[0] - G * np.sin(angle), *spin, *force_rate, *twist_rate, *motor_rate])[used]

    def slopes(t, y, theta, guess):
        """The Jacobian; SciPy's own steps overflow where a rate does not depend on a state at all."""
        steps = 1e-7 * np.maximum(np.abs(y), 1.0)
        here = rates(t, y, theta, guess)
        return np.column_stack(
            [(rates(t, y + step, theta, guess) - here) / step.sum() for step in np.diag(steps)]
        )

    stops = sorted({float(c) for c in corners_s if time_s[0] < c < time_s[-1]} | {float(time_s[-1])})
    rolling = [speed / car["radius"]] * 4
    y = np.array([position, speed, *rolling, *np.zeros(8), *rolling])[used]
    t = float(time_s[0])
    result = np.zeros((len(time_s), 18))
    result[1:, used] = np.nan
    result[0, used] = y
    guess = [0.0]
    for stop in stops:
        while t < stop - 1e-12:
            front, rear = y[0] + car["l_f"] + 1e-9, y[0] - car["l_r"] + 1e-9
            theta = [*theta_at(front), *theta_at(rear)]
            borders = [b[0] - car["l_f"] for b in road if b[0] > front]
            borders += [b[0] + car["l_r"] for b in road if b[0] > rear]
            events = []
            for border in borders:

                def crossing(t, y, theta, guess, border=border):
                    return y[0] - border

                crossing.terminal = True
                events.append(crossing)
            part = solve_ivp(
                rates,
                (t, stop),
                y,
                "Radau",
                jac=slopes,
                args=(theta, guess),
                events=events,
                dense_output=True,
                rtol=1e-8,
                atol=np.where(
                    (used >= 6) & (used < 10), 1e-6, 1e-10
                ),  # forces carry the slip's rounding errors
            )
            inside = (time_s > t) & (time_s <= part.t[-1] + 1e-12)
            result[np.ix_(inside, used)] = part.sol(time_s[inside]).T
            t, y = float(part.t[-1]), part.y[:, -1]
    return result
