"""What slip, load and force show of theta, and where noise hides it."""

from __future__ import annotations

import math
from typing import NamedTuple

from .excitation import FuzzyScheduler
from .slip import GREATEST_SLIP
from .stationary_mean import Steady, mean_deviation
from .tyre import Cubic, cubic_at_slip, elastic_friction, theta_of

GREATEST_THETA = 1.2
"""Upper end of what the estimate may be: the domain of the difference in section 4.2 [-]."""
SIGNIFICANCE = 1.5
"""How many standard deviations of slip must lie between the tyre and one that does not slide at all, for a mean that
has long been held [-]."""
YOUNG = 1.0
"""How many more for a single reading [-]: a young mean is another one at each step, and one of many is soon far off."""
YOUNG_S = 0.08
"""Time with which a mean that is held outgrows that [s]."""
AT_ONCE = SIGNIFICANCE + YOUNG
BACKED_SIGNIFICANCE = 0.25
"""The same where the camera's class is that of such a road: two witnesses need less of each [-]."""
BACKED_AFTER_S = 0.02
"""How long a mean must have been held for that: as long as its noise takes to forget itself [s]."""
NEAR_CLASS = 0.15
"""How far roads lie about the value of their class [-]."""
LEAST_SENSITIVITY = 0.1
"""Where d mu / d theta is below this, an error of 0.01 in the used friction would be one of 0.1 in theta: there is
nothing to invert [-]."""


class WheelInputs(NamedTuple):
    """What one wheel's estimator is given at a step."""

    wheel_speed_rad_s: float
    wheel_speed_ahead_rad_s: float
    """Mean over the step to come: a wheel that gains speed would else seem to bear too much force."""
    wheel_torque_nm: float
    """Mean over the step to come."""
    slip: tuple[float, float]
    """Size and direction, as in `Slip`."""
    load_n: float
    slip_deviation: float
    """Standard deviation of the slip through sensor noise and a bias that is not known better [-]."""
    slip_change: float
    """Distance of the slip from its own, once more filtered, course [-]: force and slip of a tyre that is being
    loaded or unloaded pass the filter along the chord of its bent curve, and lie that far beside it."""
    way_m: float = 0.0
    """Way driven over the step to come [m]."""
    torque_known: bool = True
    """False at a locked wheel: its brake holds what the road gives, whatever was commanded."""
    slip_noise: float = 0.0
    """Standard deviation of the filtered slip through noise alone, which a mean over time lessens [-]."""
    slip_doubt: float = 0.0
    """That of slip's steady offset and of the tyre's curve, which no mean lessens, as far as it counts [-]."""
    slip_rise: float = 0.0
    """`slip_change` with its sign: positive while the tyre is being loaded [-]."""
    noise_s: float = 1.0
    """Time in which the filtered noise forgets itself: twice the filter's constant [s]."""


Look = tuple[Cubic, float, float]
"""What slip and load say before any force is known, the same for DE and DIFE: the tyre, the slip that stands beyond
noise, 0 or less where noise hides it [-], and the excitation threshold without a picture [-]."""

Place = tuple[Steady, Cubic, float, float]
"""Where on the curve the mean of slip stands, the same for DE and DIFE: the means of which it is taken (used friction
does not count), the tyre there, the used friction below which it surely slides, 0 where noise hides it [-], and the
deviation of the mean [-]."""


def look_at(inputs: WheelInputs, longitudinal_stiffness_n: float, scheduler: FuzzyScheduler) -> Look:
    """What slip and load say of the tyre.

    On grippy roads force and slip lie on the curve's elastic part, where noise alone decides on which side of its
    end: half of all samples then seem to slide, and to have a theta of little more than the friction they use.
    So the force must also be below the elastic one of a slip that is `AT_ONCE` deviations smaller.
    """
    size, load_n, deviation, change = inputs[3][0], inputs[4], inputs[5], inputs[6]
    surely = size - AT_ONCE * (deviation + change)
    threshold = scheduler.threshold(None, load_n, longitudinal_stiffness_n, deviation)
    return cubic_at_slip(size, load_n, longitudinal_stiffness_n), surely, threshold


def shown(friction: float, tyre: Cubic, slides_below: float) -> tuple[float | None, float]:
    """theta(lambda, F) and the sensitivity there; (None, 0) where the tyre does not show it.

    Below `slides_below` the tyre surely slides; 0 where noise hides it [-].
    """
    if friction > slides_below or slides_below == 0.0:
        return None, 0.0
    theta = theta_of(friction, tyre)
    if theta is None:
        return None, 0.0
    _, g_0, g_1, kappa = tyre
    sensitivity = (1.0 - 2.0 * kappa * theta) * (g_0 + g_1 * theta) + theta * (1.0 - kappa * theta) * g_1
    if sensitivity < LEAST_SENSITIVITY:
        return None, 0.0
    return (theta if theta < GREATEST_THETA else GREATEST_THETA), sensitivity


def place_of_mean(steady: Steady, inputs: WheelInputs, longitudinal_stiffness_n: float) -> Place:
    """Where the mean slip stands on the curve, and what of it noise leaves beyond doubt."""
    load_n = inputs[4]
    deviation = mean_deviation(steady, inputs[9], inputs[12], inputs[10]) + abs(steady[2])
    tyre = cubic_at_slip(steady[0], load_n, longitudinal_stiffness_n)
    significance = SIGNIFICANCE + YOUNG * math.exp(-steady[3] / YOUNG_S)
    surely = steady[0] - significance * deviation
    return steady, tyre, elastic_friction(surely, load_n, longitudinal_stiffness_n), deviation


def backed_theta(
    theta_img: float,
    steady: Steady,
    place: Place | None,
    inputs: WheelInputs,
    longitudinal_stiffness_n: float,
) -> float | None:
    """theta(lambda, F_hat) by the means where tyre and camera agree on it, though the tyre alone is not sure [-].

    `place` is where their slip stands, if that has been worked out.
    """
    if steady[3] < BACKED_AFTER_S:
        return None
    if place is None:
        place = place_of_mean(steady, inputs, longitudinal_stiffness_n)
    surely = steady[0] - BACKED_SIGNIFICANCE * place[3]
    below = elastic_friction(surely, inputs[4], longitudinal_stiffness_n)
    theta, _ = shown(steady[1], place[1], below)
    return theta if theta is not None and abs(theta - theta_img) < NEAR_CLASS else None


def visible_theta(
    force_n: float, inputs: WheelInputs, longitudinal_stiffness_n: float
) -> tuple[float | None, float]:
    """theta(lambda, F) and the sensitivity there; (None, 0) where the tyre does not show it, see `look_at`."""
    tyre, surely, _ = look_at(inputs, longitudinal_stiffness_n, FuzzyScheduler())
    _, direction = inputs.slip
    below = elastic_friction(surely, inputs.load_n, longitudinal_stiffness_n)
    return shown(force_n * direction / inputs.load_n, tyre, below)


def least_theta(force_n: float, inputs: WheelInputs, longitudinal_stiffness_n: float) -> float:
    """The smallest theta that force and slip allow: the inverse at a slip `AT_ONCE` deviations larger.

    Below the curve's maximum, that is: beyond it a larger slip asks for more theta, but there the tyre is seen.
    """
    (size, direction), load_n, deviation, change = inputs[3:7]
    surely = size + AT_ONCE * (deviation + change)
    friction = force_n * direction / load_n
    tyre = cubic_at_slip(
        surely if surely < GREATEST_SLIP else GREATEST_SLIP, load_n, longitudinal_stiffness_n
    )
    theta = theta_of(friction, tyre)
    if theta is None:
        theta = 2.0 * tyre[0] if friction > 0.0 else 0.0
    return theta if theta < GREATEST_THETA else GREATEST_THETA
