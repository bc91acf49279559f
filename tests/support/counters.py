"""Pulse-counting wheel-speed sensors, written for the tests alone: an angle finely integrated, pulses counted."""

import numpy as np

RATE_HZ = 500.0
TURN = 2.0 * np.pi


def driving(duration_s=12.0, rate_hz=RATE_HZ, seed=0):
    """Time and a wheel speed that rises and falls between 25 and 75 rad/s."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    phase = rng.uniform(0.0, TURN, 3)
    swing = np.sin(0.9 * time_s + phase[0]) + 0.4 * np.sin(2.3 * time_s + phase[1])
    return time_s, 50.0 + 18.0 * swing


def count(time_s, speed_rad_s, teeth, window_s, phase=0.0, begin_s=0.0):
    """Pulses per window, each window's reported through the next; the angle is integrated a hundred times finer."""
    fine = np.linspace(time_s[0] - 2.0 * window_s, time_s[-1], 100 * len(time_s) // 10)
    speed = np.interp(fine, time_s, speed_rad_s)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
    ends = np.arange(time_s[0] - 2.0 * window_s + begin_s, time_s[-1] + window_s, window_s)
    turned = np.interp(ends, fine, angle) - np.interp(time_s[0], fine, angle)
    pulses = np.floor(turned * teeth / TURN + phase + 1e-6)
    values = np.diff(pulses) * TURN / (teeth * window_s)
    last_full = np.searchsorted(ends, time_s + 1e-9, side="right") - 1
    return values[np.clip(last_full - 1, 0, len(values) - 1)]


def running(time_s, speed_rad_s, teeth, window_s, phase=0.0):
    """Pulses of the last window at every row: those that have come by now, less those that had by its begin."""
    fine = np.linspace(time_s[0] - 2.0 * window_s, time_s[-1], 10 * len(time_s))
    speed = np.interp(fine, time_s, speed_rad_s)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])

    def come(at_s):
        return np.floor(np.interp(at_s, fine, angle) * teeth / TURN + phase)

    return (come(time_s) - come(time_s - window_s)) * TURN / (teeth * window_s)


def counted_wheels(teeth, window_s, noise_quanta=0.0, seed=0, rate_hz=RATE_HZ, duration_s=12.0):
    """Four wheels, each with its own phase of teeth."""
    rng = np.random.default_rng(seed)
    time_s, speed = driving(duration_s, rate_hz, seed)
    quantum = TURN / (teeth * window_s)
    wheels = [
        count(time_s, speed * (1.0 + 0.002 * i), teeth, window_s, rng.uniform())
        + noise_quanta * quantum * rng.standard_normal(len(time_s))
        for i in range(4)
    ]
    return time_s, wheels
