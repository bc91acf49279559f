r"""Eqs. (12) to (19) of Tian et al. 2022 [1]_ as they are printed, for one wheel.

.. math::

    I \dot\omega &= T - F_x R, \qquad \lambda = |\omega R - v| / \max(\omega R, v)  \quad (12), (13) \\
    \hat F_x &= F_z \mu(\hat\theta, \lambda) \sigma - (I / R)(s + K \omega)  \quad (14) \\
    \dot s &= -(K / I)(T - R \hat F_x) + (R / I) F_z \mu_\theta \sigma \dot{\hat\theta}  \quad (15) \\
    \dot{\hat\theta} &= \gamma [\theta(\lambda, \hat F_x) - \hat\theta]  \quad (16), (19) \\
    \dot{\hat\theta} &= \gamma [\theta(\lambda, \hat F_x) - \hat\theta
        + \varepsilon K_v (\hat\theta_{img} - \hat\theta)]  \quad (17) \\
    \dot{\hat\theta} &= \gamma [\theta(\lambda, \hat F_x) - \hat\theta]
        + \varepsilon K_v (\hat\theta_{img} - \hat\theta)  \quad (18)

Errata. Printed, (14) and (15) hold for the opposite sign of the force, and the last term of (15) lacks F_z; here both
are as Eq. (12) needs them. The equations are solved over a step with held inputs, not by Euler's rule.

Left open by the print, and read here as follows. The fuzzy sets lie evenly over the printed domains. Without a picture
the threshold is that of the estimate itself, so that from 0.8 DE does not begin below a slip of 0.048. Where no theta
gives the observed force, the estimate holds.

References
----------
.. [1] Tian et al. (2022), Remote Sensing 14, 5583, doi:10.3390/rs14215583.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .fuzzy import Partition
from .observer import advanced_state, observed_force, settled_state
from .slip import wheel_slip
from .tyre import GREATEST_THETA, LEAST_THETA, tyre_at_slip

THETA_SETS = Partition(0.0, 0.5, 1.0)
"""Sets S, M, B of the camera's adhesion, even over the printed domain [-]."""
DIFFERENCE_SETS = Partition(0.0, 0.6, 1.2)
"""Those of its difference from the estimate [-]."""
THRESHOLDS = (0.0, 0.03, 0.06)
"""Slip thresholds S, M, B, even over the printed domain [-]."""
GAINS = (0.0, 1.5, 3.0)
"""Visual gains K_v S, M, B, even over the printed domain [-] in (17), [1/s] in (18)."""


class PrintedWheel(NamedTuple):
    """Constants of the wheel and of the estimator."""

    inertia_kg_m2: float
    radius_m: float
    longitudinal_stiffness_n: float
    K: float
    """Bandwidth of the observer [1/s]."""
    gamma: float
    """Rate of the estimator [1/s]."""
    inside: bool
    """Whether the visual term stands inside of the bracket, Eq. (17)."""
    floor_m_s: float
    """Speed below which slip is 0 [m/s]."""


class Printed(NamedTuple):
    """State of the estimator."""

    theta_hat: float
    s: float
    """The observer's s [rad/s^2]; not a number until the first step."""


class PrintedStep(NamedTuple):
    """Outcome of a step."""

    state: Printed
    slip: float
    force_n: float
    """Observed force F_hat [N]."""
    threshold: float
    """Slip above which the estimator runs [-]."""
    excited: bool
    K_v: float


def begun(theta_initial: float) -> Printed:
    """The state before the first step, with an estimate [-]."""
    return Printed(theta_initial, math.nan)


def printed_step(
    state: Printed,
    wheel: PrintedWheel,
    wheel_speed_rad_s: float,
    wheel_torque_nm: float,
    vehicle_speed_m_s: float,
    load_n: float,
    theta_img: float | None,
    step_s: float,
) -> PrintedStep:
    """One step of observer and estimator.

    Parameters
    ----------
    state, wheel
        State now; constants.
    wheel_speed_rad_s, wheel_torque_nm, vehicle_speed_m_s, load_n : float
        omega [rad/s], T [N m], v [m/s], F_z [N], held over the step.
    theta_img : float or None
        Adhesion of the camera's class; None where epsilon is 0 [-].
    step_s : float
        Step [s].
    """
    inertia, radius_m, K = wheel.inertia_kg_m2, wheel.radius_m, wheel.K
    slip, sign = wheel_slip(wheel_speed_rad_s, vehicle_speed_m_s, radius_m, wheel.floor_m_s)
    tyre = tyre_at_slip(slip, load_n, wheel.longitudinal_stiffness_n)
    theta_hat, s = state
    model_n = sign * load_n * tyre.friction(theta_hat)
    if math.isnan(s):
        s = settled_state(model_n, wheel_torque_nm / radius_m, wheel_speed_rad_s, K, inertia, radius_m)
    force_n = observed_force(model_n, s, wheel_speed_rad_s, K, inertia, radius_m)
    threshold = THETA_SETS.blend(theta_hat if theta_img is None else theta_img, THRESHOLDS)
    excited, K_v, rate, pull = slip > threshold, 0.0, 0.0, 0.0
    if excited:
        shown = tyre.theta(sign * force_n / load_n)
        if shown is not None:
            rate, pull = wheel.gamma, wheel.gamma * shown
        if theta_img is not None:
            K_v = DIFFERENCE_SETS.blend(abs(theta_img - theta_hat), GAINS)
            by_camera = K_v * (wheel.gamma if wheel.inside else 1.0)
            rate, pull = rate + by_camera, pull + by_camera * theta_img
    theta_next = theta_hat
    if rate > 0.0:
        target = pull / rate
        theta_next = target + (theta_hat - target) * math.exp(-rate * step_s)
        theta_next = min(max(theta_next, LEAST_THETA), GREATEST_THETA)
    model_change_n = sign * load_n * tyre.friction(theta_next) - model_n
    s = advanced_state(
        s,
        model_n,
        model_change_n,
        wheel_torque_nm,
        wheel_speed_rad_s,
        K,
        inertia,
        radius_m,
        step_s,
    )
    return PrintedStep(Printed(theta_next, s), slip, force_n, threshold, excited, K_v)
