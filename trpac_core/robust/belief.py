r"""The filter: the probability of each friction under each tyre, and the tyre's slip offset and softness in each.

In cell theta_j and tyre l the wheel's slip offset r and softness c are two Gaussian states of an extended Kalman filter
that predicts the used friction

.. math:: f = \mu_l(\theta_j, \lambda - r;\ C_x e^{-c}) + e .

The road changes with the distance driven: a share of the probability returns to the prior of the camera. r and c belong
to the tyre, not to the road, so the probability that returns keeps the mean of the tyre. The likelihood of a reading
counts with a power below 1: readings 10 ms apart are not independent, and no model of a tyre is exact.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .arrays import Array, count_below, cumulated, exp, greatest, log, total
from .blocks import Reading
from .roads import PerCell
from .tyres import FORMULAS, IS_TOLD, TOLD, TYRES, Column, Grid, PerTyre, Tyre, curves

POWER_PER_S = 20.0
"""Power with which the likelihood of a second of readings counts, as of independent readings; a reading
counts as one at most [1/s]."""
INDEPENDENT_1_S = 1.0
"""How often a second the normalisation of the likelihood counts: operating points are new about once a second [1/s]."""
MODEL_SHARE = 0.02
"""Standard deviation of the used friction by load, torque and curve, as a share of it [-]."""
SLIDING_SHARE = 0.2
"""What is added to it where the tyre slides all over: a locked wheel has 0.6 to 1 of the peak (Pacejka 2012) [-]."""
RELAXATION_M = 0.3
"""Way over which a tyre's force follows its slip: car tyres have 0.1 to 0.6 m (Pacejka 2012, ch. 7) [m]."""
DRIFT = 0.02
"""Random walk of slip offset and softness per root of a second, over their standard deviations [1/sqrt(s)]."""
SOFTER = 0.03
"""Standard deviation that the softness of a tyre of unknown curve gains where the road changes [-]."""
FORGETTING_1_S = 0.1
"""Share of the tyres' weights that goes back to the first ones per second: no tyre stays sure by chance [1/s]."""
LEAST_SLOPE = 0.5
"""Slope of the curve by slip below which it does not count in the normalisation [-]."""
LEAST_SPEED_M_S, LEAST_RIM_M_S = 1.5, 0.5
"""Speed below which slip is not used, and rim speed below which the brake's torque is not the road's [m/s]."""
MOST_SLIP = 0.4
"""Slip of a driven wheel above which it spins, and what its tyre loses is not known: to a fifth of the peak by magic
formulas, hardly any by others [-]."""
SLIDES = 0.05
"""Probability that the road is so slippery that the described tyre slides, from which the observer reads theta [-]."""
NEVER = 1e-30
"""Weight that each cell keeps [-]."""


class Hypotheses(NamedTuple):
    """The tyres as arrays, shape (tyres, 1) each but for the weights; attributes as in `Tyre`."""

    weight: PerTyre
    """Shape (tyres,)."""
    offset_variance: Column
    softness_variance: Column
    mean_softness: Column
    peak: Column
    fall: Column
    softer: Column
    """Variance that the softness gains where the road changes [-]."""


def hypotheses(tyres: tuple[Tyre, ...]) -> Hypotheses:
    """The tyres as arrays."""

    def column(values: Iterable[float]) -> Array:
        return np.array([[value] for value in values])

    return Hypotheses(
        np.array([tyre.weight for tyre in tyres]),
        column(tyre.slip_offset * tyre.slip_offset for tyre in tyres),
        column(tyre.softness * tyre.softness for tyre in tyres),
        column(tyre.mean_softness for tyre in tyres),
        column(tyre.peak for tyre in tyres),
        column(tyre.fall for tyre in tyres),
        column(SOFTER * SOFTER if tyre.peak > 0.0 else 0.0 for tyre in tyres),
    )


FIRST = hypotheses(TYRES)
"""The hypotheses that a wheel starts with."""


def as_told(tyres: Hypotheses, slip_offset: float, softness: float) -> Hypotheses:
    """The hypotheses, with these standard deviations of slip offset and softness for the described tyre [-]."""
    return Hypotheses(
        tyres.weight,
        np.where(IS_TOLD > 0.0, slip_offset * slip_offset, tyres.offset_variance),
        np.where(IS_TOLD > 0.0, softness * softness, tyres.softness_variance),
        tyres.mean_softness,
        tyres.peak,
        tyres.fall,
        tyres.softer,
    )


@dataclass(frozen=True)
class Belief:
    """The belief: a probability distribution over road friction and tyre.

    Attributes
    ----------
    tyre : array, shape (tyres,)
        Probability of each tyre [-].
    road : array, shape (tyres, cells)
        Probability of each cell under a tyre; each row sums to 1 [-].
    offset, softness : array, shape (tyres, cells)
        Mean of the slip offset r and of the softness c there [-].
    offset_variance, covariance, softness_variance : array, shape (tyres, cells)
        Their covariance matrix.
    """

    tyre: PerTyre
    road: Grid
    offset: Grid
    softness: Grid
    offset_variance: Grid
    covariance: Grid
    softness_variance: Grid


def unread(tyres: Hypotheses, prior: PerCell) -> Belief:
    """The belief before anything was read, with the cells as probable as in the prior, shape (cells,) [-]."""
    like = np.zeros((len(tyres.weight), len(prior)))
    return Belief(
        tyres.weight,
        like + prior,
        like,
        like + tyres.mean_softness,
        like + tyres.offset_variance,
        like,
        like + tyres.softness_variance,
    )


def driven(
    belief: Belief,
    tyres: Hypotheses,
    prior: PerCell,
    changed: float,
    duration_s: float,
    slip_drift: float = 0.0,
) -> Belief:
    """The belief after a distance on which the road may have changed.

    Parameters
    ----------
    belief, tyres, prior
        Before; the tyres; probability of each cell of a new road, shape (cells,) [-].
    changed, duration_s : float
        Share of the belief that goes to the prior [-], time [s].
    slip_drift : float
        Variance that the slip offset gains because an error of the speed is another share of another speed [-].
    """
    road, offset, softness = belief.road, belief.offset, belief.softness
    mean_offset, mean_softness = total(road * offset), total(road * softness)
    off, soft = offset - mean_offset, softness - mean_softness
    mean_oo = total(road * (belief.offset_variance + off * off))
    mean_os = total(road * (belief.covariance + off * soft))
    mean_ss = total(road * (belief.softness_variance + soft * soft)) + tyres.softer
    # On another road the tyre is not less known than before anything was read.
    o_share = np.minimum(1.0, (tyres.offset_variance + slip_drift) / mean_oo)
    s_share = np.minimum(1.0, tyres.softness_variance / mean_ss)
    mean_oo, mean_ss, mean_os = mean_oo * o_share, mean_ss * s_share, mean_os * o_share * s_share
    came = changed * prior
    after = (1.0 - changed) * road + came
    share = came / after
    # Of two that merge: the mean of both, the variances of both and what their means are apart.
    stays, apart = 1.0 - share, share * (1.0 - share)
    drift = DRIFT * DRIFT * duration_s
    return Belief(
        belief.tyre,
        after,
        offset - share * off,
        softness - share * soft,
        stays * belief.offset_variance
        + share * mean_oo
        + apart * off * off
        + drift * tyres.offset_variance
        + slip_drift,
        stays * belief.covariance + share * mean_os + apart * off * soft,
        stays * belief.softness_variance
        + share * mean_ss
        + apart * soft * soft
        + drift * tyres.softness_variance,
    )


@dataclass(frozen=True)
class WheelModel:
    """Description of a wheel: C_x at a load [N], I [kg m^2], R [m]."""

    stiffness_n: float
    mean_load_n: float
    inertia_kg_m2: float
    radius_m: float


def shows(reading: Reading) -> bool:
    """Whether a reading can be used: the car drives, and the wheel neither stands nor spins."""
    return (
        reading.speed_m_s > LEAST_SPEED_M_S and reading.rim_m_s > LEAST_RIM_M_S and reading.slip < MOST_SLIP
    )


def read(
    belief: Belief,
    tyres: Hypotheses,
    theta: PerCell,
    reading: Reading,
    wheel: WheelModel,
    wheel_noise: float,
    speed_noise: float,
    torque_noise_nm: float,
) -> Belief:
    """The belief after a reading.

    Parameters
    ----------
    belief, tyres, theta, reading, wheel
        Before; the tyres; the cells; what was read; description of the wheel.
    wheel_noise, speed_noise : float
        Variance of a sample of wheel speed [rad^2/s^2] and of vehicle speed [m^2/s^2].
    torque_noise_nm : float
        Standard deviation of a sample of the torque [N m].
    """
    samples, duration_s, radius_m = reading.samples, reading.duration_s, wheel.radius_m
    spun_up, arm_nm = wheel.inertia_kg_m2 / duration_s, radius_m * reading.load_n
    inertial = 2.0 * spun_up * spun_up * wheel_noise / samples
    # The force follows the slip over the relaxation length, and both change within a block.
    lag = 1.0 + RELAXATION_M / (reading.speed_m_s * duration_s)
    lagged = lag * reading.friction_change
    torque_variance = torque_noise_nm * torque_noise_nm / samples + inertial
    friction_variance = torque_variance / (arm_nm * arm_nm) + lagged * lagged
    speed_variance = (wheel_noise * radius_m * radius_m + speed_noise) / samples
    within = 0.5 * reading.slip_change
    slip_variance = speed_variance / (reading.speed_m_s * reading.speed_m_s) + within * within
    slip = reading.slip - belief.offset
    direction = np.where(slip >= 0.0, 1.0, -1.0)
    curve = curves(
        theta,
        slip,
        belief.softness,
        reading.load_n,
        wheel.stiffness_n,
        wheel.mean_load_n,
        tyres.peak,
        tyres.fall,
    )
    error = reading.friction - direction * curve.friction
    by_slip, by_softness = curve.by_slip, -direction * curve.by_stiffness
    to_offset = belief.covariance * by_softness - belief.offset_variance * by_slip
    to_softness = belief.softness_variance * by_softness - belief.covariance * by_slip
    model = (MODEL_SHARE + SLIDING_SHARE * curve.sliding) * curve.friction
    variance = (
        friction_variance
        + model * model
        + by_slip * by_slip * slip_variance
        - by_slip * to_offset
        + by_softness * to_softness
    )
    power = min(POWER_PER_S * duration_s, 1.0)
    normalisation = np.maximum(np.abs(by_slip), LEAST_SLOPE) / np.sqrt(variance)
    likelihood = -0.5 * power * error * error / variance + INDEPENDENT_1_S * duration_s * log(normalisation)
    gain_offset, gain_softness = power * to_offset / variance, power * to_softness / variance
    road = belief.road * exp(likelihood - greatest(likelihood))
    mass = total(road)
    tyre = belief.tyre * mass[:, 0]
    forgotten = FORGETTING_1_S * duration_s
    return Belief(
        (1.0 - forgotten) * tyre / total(tyre) + forgotten * tyres.weight,
        (road + NEVER) / (mass + NEVER * len(theta)),
        belief.offset + gain_offset * error,
        belief.softness + gain_softness * error,
        belief.offset_variance - gain_offset * to_offset,
        belief.covariance - gain_offset * to_softness,
        belief.softness_variance - gain_softness * to_softness,
    )


def told_formula(belief: Belief) -> float:
    """Probability that the tyre has the described formula [-]."""
    return float(total(belief.tyre[:FORMULAS])[0])


def onset_theta(belief: Belief, theta: PerCell) -> float:
    """Friction that the road has at most with the probability `SLIDES`, if the tyre is as described [-]."""
    up_to = cumulated(belief.road[TOLD])
    return float(theta[min(count_below(up_to, SLIDES), len(theta) - 1)])


def mean_offset(belief: Belief) -> float:
    """Mean of the slip offset over all tyres and cells [-]."""
    under_each = total(belief.road * belief.offset)
    return float(total(belief.tyre * under_each[:, 0])[0])
