r"""The modified Dugoff tyre at pure longitudinal slip, its inverse in theta and its derivatives.

With the slip ratio X = C_x lambda / (1 - lambda) and L = theta F_z / (2 X), the force is

.. math:: \mu F_z = X f(L) G, \quad f = L (2 - L) \text{ for } L < 1, \text{ else } 1,

with the correction G = (1.15 - 0.75 theta) lambda^2 - (1.63 - 0.75 theta) lambda + 1.27 [1]_ [2]_. G is
linear in theta, G = g_0 + g_1 theta, so that below L = 1 the used friction is the cubic
mu = theta (g_0 + g_1 theta) (1 - kappa theta) with kappa = F_z / (4 X). It rises with theta all the way up to L = 1.

All functions take and return floats. Slip is unsigned, between 0 and 1.

References
----------
.. [1] Bian, Chen, Luo, Li (2014), SAE Technical Paper 2014-01-0123.
.. [2] Korayem et al. (2024) for the coefficients; the constant 1.27 gives a locked-to-peak ratio of 0.79.
"""

from __future__ import annotations

import math
from typing import NamedTuple

LEAST_THETA, GREATEST_THETA = 0.02, 1.2
"""Frictions that a road may have [-]: at 0 the tyre has no force and an estimate could never leave it; the upper end is
that of the difference's domain in section 4.2 of Tian et al. 2022."""
INITIAL_SLOPE = 1.27
"""G at slip 0: the curve starts with 1.27 C_x [-]."""
NEWTON_STEPS = 50
"""Far above what the safeguarded Newton searches need (3 to 6): a bound, not a setting."""
LEAST_STEP = 1e-6
"""Newton's last step in the search for theta [-]: the error left is about its square."""
LEAST_SLIP_STEP = 1e-3
"""Newton's last step in the search for the curve's maximum [-]: that is flat, so its height is then right to 1e-9."""
GREATEST_PEAK_SLIP = 0.95
"""Where the search for the curve's maximum ends [-]."""


def slip_ratio_force(slip: float, longitudinal_stiffness_n: float) -> float:
    """X = C_x lambda / (1 - lambda), the force of a tyre that never slides. [N]."""
    return longitudinal_stiffness_n * slip / (1.0 - slip)


def correction(theta: float, slip: float) -> float:
    """Correction factor G of the modified Dugoff tyre [-]."""
    return (1.15 - 0.75 * theta) * slip * slip - (1.63 - 0.75 * theta) * slip + 1.27


class TyreAtSlip(NamedTuple):
    """The tyre at one slip and load, a function of theta alone: the cubic of the module's text."""

    adhering: float
    """Used friction of a tyre that never slides, over G: X / F_z [-]."""
    g_0: float
    """Part of G that does not depend on theta [-]."""
    g_1: float
    """Part of G by theta [-]."""
    kappa: float
    """F_z / (4 X) [-]."""

    @property
    def sliding_onset_friction(self) -> float:
        """Used friction at L = 1, the most at this slip that theta can be read from [-]."""
        return self.adhering * (self.g_0 + self.g_1 * (2.0 * self.adhering))

    def friction(self, theta: float) -> float:
        """Used friction mu [-]."""
        slides = theta < 2.0 * self.adhering
        share = theta * (1.0 - self.kappa * theta) if slides else self.adhering
        return share * (self.g_0 + self.g_1 * theta)

    def friction_by_theta(self, theta: float) -> float:
        """Sensitivity d mu / d theta [-]: how clearly the tyre shows the road's friction."""
        if theta >= 2.0 * self.adhering:
            return self.adhering * self.g_1
        return self._friction_by_theta_sliding(theta)

    def _friction_by_theta_sliding(self, theta: float) -> float:
        G, share = self.g_0 + self.g_1 * theta, theta * (1.0 - self.kappa * theta)
        return (1.0 - 2.0 * self.kappa * theta) * G + share * self.g_1

    def theta(self, friction: float) -> float | None:
        """The one theta below L = 1 that gives this used friction; None where none does."""
        if friction <= 0.0:
            return 0.0 if friction == 0.0 else None
        if friction >= self.sliding_onset_friction:
            return None
        lower, upper = 0.0, 2.0 * self.adhering
        # Without g_1 the cubic is a quadratic, whose root is within a few per cent: Newton does the rest.
        left = 1.0 - friction / (self.adhering * self.g_0)
        theta = upper * (1.0 - math.sqrt(left)) if left > 0.0 else upper
        for _ in range(NEWTON_STEPS):
            share = theta * (1.0 - self.kappa * theta)
            excess = share * (self.g_0 + self.g_1 * theta) - friction
            proposal = theta - excess / self._friction_by_theta_sliding(theta)
            # The cubic rises: where it is above the friction theta has to fall, else to rise.
            if excess > 0.0:
                upper = theta
            else:
                lower = theta
            if not lower <= proposal <= upper:
                proposal = 0.5 * (lower + upper)
            if abs(proposal - theta) < LEAST_STEP:
                return proposal
            theta = proposal
        return theta


def tyre_at_slip(slip: float, load_n: float, longitudinal_stiffness_n: float) -> TyreAtSlip:
    """The tyre at this unsigned slip [-], vertical load F_z [N] and longitudinal stiffness C_x [N]."""
    adhering = slip_ratio_force(slip, longitudinal_stiffness_n) / load_n
    return TyreAtSlip(
        adhering,
        g_0=1.27 + slip * (1.15 * slip - 1.63),
        g_1=0.75 * slip * (1.0 - slip),
        kappa=0.25 / adhering if adhering > 0.0 else math.inf,
    )


def sliding_onset_friction(slip: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """Used friction at L = 1, the most at this slip that theta can be read from; 0 at a slip below 0 [-]."""
    return tyre_at_slip(slip, load_n, longitudinal_stiffness_n).sliding_onset_friction if slip > 0.0 else 0.0


def used_friction(theta: float, slip: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """Used friction mu(theta, lambda) = abs(F_x) / F_z [-].

    Parameters
    ----------
    theta, slip : float
        Peak adhesion coefficient and unsigned slip [-].
    load_n, longitudinal_stiffness_n : float
        Vertical load F_z and longitudinal stiffness C_x [N].

    Examples
    --------
    >>> round(used_friction(0.5, 0.0186, 2895.0, 50_000.0), 3)
    0.384
    """
    return tyre_at_slip(slip, load_n, longitudinal_stiffness_n).friction(theta)


def force(
    theta: float, slip: float, load_n: float, longitudinal_stiffness_n: float, direction: float
) -> float:
    """Longitudinal force F_x, positive where it drives the car. [N]."""
    return direction * load_n * used_friction(theta, slip, load_n, longitudinal_stiffness_n)


def friction_by_theta(theta: float, slip: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """Sensitivity d mu / d theta at constant slip [-]: how clearly the tyre shows the road's friction."""
    return tyre_at_slip(slip, load_n, longitudinal_stiffness_n).friction_by_theta(theta)


def friction_by_slip(theta: float, slip: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """Slope d mu / d lambda at constant theta [-]."""
    adhering = slip_ratio_force(slip, longitudinal_stiffness_n) / load_n
    rolls = 1.0 - slip
    adhering_by_slip = longitudinal_stiffness_n / (load_n * rolls * rolls)
    correction_by_slip = 2.0 * (1.15 - 0.75 * theta) * slip - (1.63 - 0.75 * theta)
    if theta >= 2.0 * adhering:
        return adhering_by_slip * correction(theta, slip) + adhering * correction_by_slip
    share_by_slip = -theta * adhering_by_slip / (4.0 * adhering * adhering)
    return theta * (
        -share_by_slip * correction(theta, slip) + (1.0 - theta / (4.0 * adhering)) * correction_by_slip
    )


def onset_adhering(theta: float, sensitivity: float) -> float:
    """X / F_z at which d mu / d theta reaches a sensitivity: from here on the tyre shows theta [-].

    G's dependence on theta (0.75 theta lambda, about 1 %) is left out, and G is taken at small slip, 1.27.
    """
    return theta / (2.0 * (1.0 - sensitivity / 1.27))


def onset_slip(theta: float, load_n: float, longitudinal_stiffness_n: float, sensitivity: float) -> float:
    """Slip at which d mu / d theta reaches a sensitivity, see `onset_adhering` [-]."""
    ratio = onset_adhering(theta, sensitivity) * load_n / longitudinal_stiffness_n
    return ratio / (1.0 + ratio)


def peak_slip(theta: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """Slip at which the used friction is greatest, found by Newton on d mu / d lambda = 0 [-].

    The slope falls through zero once between slip 0 and the curve's end; a very soft tyre rises all the way.
    """
    quarter = theta * load_n / (4.0 * longitudinal_stiffness_n)
    square, linear = 1.15 - 0.75 * theta, 1.63 - 0.75 * theta
    lower, upper = 1e-6, GREATEST_PEAK_SLIP
    slip = min(math.sqrt(1.27 * quarter / linear), 0.5)
    # lambda^2 times the slope of (1 - quarter (1 - lambda) / lambda) G(lambda): a cubic without a linear term
    cubic, quadratic = 2.0 * square * (1.0 + quarter), linear * (1.0 + quarter) + square * quarter
    constant, thrice_cubic, twice_quadratic = 1.27 * quarter, 3.0 * cubic, 2.0 * quadratic
    for _ in range(NEWTON_STEPS):
        value = (cubic * slip - quadratic) * slip * slip + constant
        if value > 0.0:
            lower = slip
        else:
            upper = slip
        value_by_slip = (thrice_cubic * slip - twice_quadratic) * slip
        proposal = slip - value / value_by_slip if value_by_slip != 0.0 else upper
        if not lower < proposal < upper:
            proposal = 0.5 * (lower + upper)
        if abs(proposal - slip) < LEAST_SLIP_STEP:
            return proposal
        slip = proposal
    return slip


def peak_friction(theta: float, load_n: float, longitudinal_stiffness_n: float) -> float:
    """The curve's maximum at this theta, what a brake test or friction tester measures [-].

    Examples
    --------
    >>> round(peak_friction(0.9, 3411.0, 50_000.0) / 0.9, 2)
    1.04
    """
    if theta <= 0.0:
        return 0.0
    slip = peak_slip(theta, load_n, longitudinal_stiffness_n)
    return used_friction(theta, slip, load_n, longitudinal_stiffness_n)
