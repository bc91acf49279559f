"""A hum in a wheel's sensor: what stands in the difference of left and right at one pitch is noise, whatever damps it.

The noise model knows one correlation, no spectral line. An effect that changes how the observer passes a wheel's
noise on then takes something off a hum, and seems to explain it. A car that drives straight turns left and right
wheels alike, so that the pitch of a hum is seen in their difference, and an oscillation of the driveline is not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sim2real.observing.drive import WHEEL
from sim2real.observing.evidence import Evidence

Array = NDArray[np.float64]

WIDTH_HZ = 1.0
"""Spectra are averaged over this width before a hum is looked for [Hz]."""
STANDS_OUT = 2.0
"""A hum has this many times the median power of the spectrum [-]."""
LEAST_HZ = 5.0
"""Below this pitch the car itself moves [Hz]."""


def hum(rows: Array, step_s: float) -> NDArray[np.bool_]:
    """Where each channel's spectrum holds a hum, shape (n // 2 + 1, 7), of whitened residuals of shape (n, 7)."""
    count = len(rows) // 2 + 1
    pitch = np.fft.rfftfreq(len(rows), step_s)
    width = max(round(WIDTH_HZ * len(rows) * step_s), 1)
    found = np.zeros((count, rows.shape[1]), dtype=bool)
    for left in range(WHEEL.start, WHEEL.stop, 2):
        power = np.abs(np.fft.rfft(rows[:, left] - rows[:, left + 1])) ** 2
        smooth = uniform_filter1d(power, width, mode="nearest")
        loud = (smooth > STANDS_OUT * np.median(smooth)) & (pitch > LEAST_HZ)
        found[:, left : left + 2] = loud[:, None]
    return found


def without_hum(z: Array, null: Array, evidence: Evidence) -> Array:
    """Whitened residuals without what lies at the pitch of a hum in those of the model as it is."""
    out = z.copy()
    for part, drive in zip(evidence.parts, evidence.drives, strict=True):
        rows = z[part].reshape(-1, drive.measured.shape[1])
        spectrum = np.fft.rfft(rows, axis=0)
        spectrum[hum(null[part].reshape(rows.shape), drive.step_s)] = 0.0
        quiet = np.fft.irfft(spectrum, len(rows), axis=0)
        out[part] = np.where(rows == 0.0, 0.0, quiet).ravel()
    return out
