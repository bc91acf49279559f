"""Where even the right model cannot foretell: a wheel that is about to slide, a border between two surfaces.

There the smallest difference grows: a hundredth of friction, a hand of road, a millisecond of the clock. Each is
tried on the model itself, and what it changes in the prediction is no evidence against anyone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from scenarios.effects.friction_offset import FrictionOffset
from sim2real.observing.drive import CHANNELS, POSITION, Drive
from sim2real.observing.observer import Push, Simulation

Array = NDArray[np.float64]

FRICTION = 0.002
"""Share that a road's friction is known to at best [-]."""
PLACE_M = 0.01
"""What a border's place is known to at best [m]."""
CLOCK_S = 0.0005
"""What a row's time is known to at best [s]."""
NEARBY_S = 0.05
"""A doubt holds this long before and after its row [s]."""


def doubt(model: Simulation, drive: Drive) -> Array:
    """What the model's prediction may be off by though it is right, shape (n, 7), in each channel's unit."""
    plain = model.predict(drive).channels
    factor = next((e.factor for e in model.effects if isinstance(e, FrictionOffset)), 1.0)
    slippery = model.with_effects(FrictionOffset(factor * (1.0 - FRICTION))).predict(drive).channels - plain
    offset = np.zeros((len(drive), len(CHANNELS)))
    offset[:, POSITION] = PLACE_M
    push = Push(np.zeros((len(drive), 4)), np.zeros(len(drive)), False, offset)
    moved = model.predict(drive, push).channels - plain
    moved[:, POSITION] = 0.0  # where along the road it is stays as measured; only the border moves
    late = np.gradient(plain, drive.step_s, axis=0) * CLOCK_S
    size = np.sqrt(slippery**2 + moved**2 + late**2)
    rows = 2 * round(NEARBY_S / drive.step_s) + 1
    return np.asarray(maximum_filter1d(size, rows, axis=0))
