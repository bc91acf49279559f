"""One estimate for the car from those of its wheels: the one place where that rule stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def vehicle_level(theta: Array, std: Array) -> tuple[Array, Array]:
    """Mean over the wheels, each weighted with the inverse of its variance, and its standard deviation.

    The wheels share tyre model, vehicle speed and accelerometer, so their errors are not independent: the deviation is
    that of the mixture (mean variance plus the wheels' spread), which does not shrink with their number and grows
    where left and right, or front and rear, see different roads.

    Parameters
    ----------
    theta, std : array, shape (n, 4)
        Estimates and standard deviations of fl, fr, rl, rr [-].

    Returns
    -------
    theta, std : array, shape (n,)
        Of the car [-].
    """
    weight = 1.0 / np.maximum(std, 1e-6) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    mean = (weight * theta).sum(axis=1)
    variance = (weight * (std**2 + (theta - mean[:, None]) ** 2)).sum(axis=1)
    return mean, np.sqrt(variance)
