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


def reference(car, road, torque_at, corners_s, time_s, speed=0.0, position=0.0, floor=0.01):
    """States (n, 6): position, speed, four wheel speeds, at time_s.

    car: dict with m, l_f, l_r, radius, inertia, stiffness, h (load transfer), k (drag per speed squared), c (rolling).
    road: list of (start, theta left, theta right).
    """

    def theta_at(x):
        left_right = road[0][1:]
        for start, *both in road:
            if x >= start:
                left_right = both
        return left_right

    def axle_loads(accel):
        base = car["l_f"] + car["l_r"]
        front = car["m"] * (G * car["l_r"] - car["h"] * accel) / (2.0 * base)
        rear = car["m"] * (G * car["l_f"] + car["h"] * accel) / (2.0 * base)
        return np.array([front, front, rear, rear])

    def tyre_forces(v, wheels, theta, accel):
        loads = axle_loads(accel)
        out = []
        for w, mu, load in zip(wheels, theta, loads, strict=True):
            rim = w * car["radius"]
            slip = (rim - v) / max(rim, v, floor)
            out.append(np.sign(slip) * friction_force(mu, abs(slip), load, car["stiffness"]))
        return np.array(out), loads

    def rates(t, y, theta, guess):
        v, wheels = y[1], y[2:]

        accel = np.inf
        while abs(guess[0] - accel) > 1e-12:  # loads follow acceleration and acceleration follows loads
            accel = guess[0]
            forces, loads = tyre_forces(v, wheels, theta, accel)
            guess[0] = (forces.sum() - car["k"] * v * v) / car["m"]
        spin = (torque_at(t) - (forces + car["c"] * loads) * car["radius"]) / car["inertia"]
        return np.array([v, guess[0], *spin])

    stops = sorted({float(c) for c in corners_s if time_s[0] < c < time_s[-1]} | {float(time_s[-1])})
    y = np.array([position, speed, *([speed / car["radius"]] * 4)])
    t = float(time_s[0])
    result = np.full((len(time_s), 6), np.nan)
    result[0] = y
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
                args=(theta, guess),
                events=events,
                dense_output=True,
                rtol=1e-8,
                atol=1e-10,
            )
            inside = (time_s > t) & (time_s <= part.t[-1] + 1e-12)
            result[inside] = part.sol(time_s[inside]).T
            t, y = float(part.t[-1]), part.y[:, -1]
    return result
