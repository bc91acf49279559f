"""One estimate for the car from those of its wheels along a log, by the rule of `trpac_core.car_friction`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trpac_core.car_friction import Friction, car_friction
from trpac_core.four_wheels import FourWheelsConfig

Array = NDArray[np.float64]


def vehicle_level(theta: Array, std: Array, load_n: Array) -> tuple[Array, Array]:
    """What of the wheels' friction the car can use, and its standard deviation.

    Parameters
    ----------
    theta, std, load_n : array, shape (n, 4)
        Estimates and standard deviations of fl, fr, rl, rr [-], and vertical loads [N].

    Returns
    -------
    theta, std : array, shape (n,)
        Of the car [-].
    """
    axle = FourWheelsConfig().axle_deviation
    rows = zip(theta.tolist(), std.tolist(), load_n.tolist(), strict=True)
    found = [
        car_friction(
            (Friction(t[0], s[0]), Friction(t[1], s[1]), Friction(t[2], s[2]), Friction(t[3], s[3])),
            (w[0], w[1], w[2], w[3]),
            axle,
        )
        for t, s, w in rows
    ]
    both = np.array(found, dtype=np.float64).reshape(-1, 2)
    return both[:, 0], both[:, 1]
