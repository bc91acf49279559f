"""Calibration of slip offset and stiffness from gentle driving, in which the tyre does not slide.

A rolling radius or a speed signal that is off by half a per cent moves slip by as much as the difference between two
roads, and a stiffness that is off moves all that is read from it. Both show where a tyre surely does not slide:

    lambda_read = b / v + r + (1 + c) F_hat / (1.27 C_x)

with the bias b of the speed signals [m/s], the share r by which the radius or the speed's scale is off, and the share
c by which the tyre is softer than told. A Kalman filter estimates the three; the estimate's own standard deviation
rests on their covariance. A torque that is off by a factor is taken up by c, one that is off by a constant by b and
r, so that force and slip agree with each other on the elastic line. What is learned is used as far as it lies beyond
two deviations, and all of it counts in the estimate's own deviation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from .tyre import INITIAL_SLOPE

REJECTED = 3.0
"""Standard deviations beyond which a reading contradicts what is known [-]."""
CORRELATED = 2.2
"""Samples a filter constant apart are alike by 1/e: their mean's variance is (1 + 1/e) / (1 - 1/e) as large [-]."""
SETTLING = 5.0
"""F_hat settles after slip does: so many times the slip's distance from its own course is a reading's error [-]."""
CONTRADICTED = 2.0
"""Deviations up to which the car is taken to be as told: what noise teaches does not spoil a car that is [-]."""
SOFTEST, STIFFEST = 1.0, -0.5
"""Bounds of c [-]: half and double the stiffness that is known."""


@dataclass(frozen=True)
class CarTolerance:
    """How well the car is known before it drives; three deviations of 0 leave it as it is told.

    Parameters
    ----------
    speed_bias_m_s : float
        Standard deviation of b: an INS drifts by 0.05 km/h [m/s].
    speed_drift_m_s : float
        How far b wanders in a root of a second [m/s/sqrt(s)].
    ratio : float
        Standard deviation of r: a tyre's rolling radius over load and temperature [-].
    compliance : float
        Standard deviation of c [-].
    force_doubt_n : float
        Standard deviation of F_hat, per reading, beside what noise makes of it [N].
    coasting : float
        Used friction below which no driven road lets a tyre slide: whatever slip reads is off [-].
    gentle : float
        Used friction below which a tyre does not slide on 0.1, the least of the three classes: 0.62 of it [-].
    """

    speed_bias_m_s: float = 0.014
    speed_drift_m_s: float = 0.001
    ratio: float = 0.003
    compliance: float = 0.05
    coasting: float = 0.02
    gentle: float = 0.06
    force_doubt_n: float = 15.0

    @property
    def prior(self) -> SlipCalibration:
        """Before anything was driven."""
        b, r, c = self.speed_bias_m_s, self.ratio, self.compliance
        return SlipCalibration(0.0, 0.0, 0.0, b * b, 0.0, 0.0, r * r, 0.0, c * c)


EXACT_CAR = CarTolerance(0.0, 0.0, 0.0, 0.0)
"""The car is as it is told: nothing is learned of it."""


def significant(value: float, variance: float) -> float:
    """The part of a value that lies beyond `CONTRADICTED` deviations of 0 [-]."""
    least = CONTRADICTED * math.sqrt(variance)
    return value - least if value > least else value + least if value < -least else 0.0


class SlipCalibration(NamedTuple):
    """b [m/s], r [-], c [-] and the upper triangle of their covariance."""

    b: float
    r: float
    c: float
    bb: float
    br: float
    bc: float
    rr: float
    rc: float
    cc: float

    def offset(self, speed_m_s: float) -> float:
        """What is taken off the slip that is read [-]."""
        return significant(self.b / speed_m_s + self.r, self.offset_variance(speed_m_s))

    def offset_variance(self, speed_m_s: float) -> float:
        """Variance of what the slip reads too much [-]."""
        return max((self.bb / speed_m_s + 2.0 * self.br) / speed_m_s + self.rr, 0.0)

    def compliance(self) -> float:
        """Share by which the tyre is taken to be softer [-]."""
        return significant(self.c, self.cc)

    def slip_variance(self, slip: float, speed_m_s: float) -> float:
        """Mean square error of a slip on the elastic line, with what was learned and not used in it [-]."""
        covariance = 2.0 * slip * (self.bc / speed_m_s + self.rc)
        learned = self.b / speed_m_s + self.r + slip * self.c
        unused = learned - (self.offset(speed_m_s) + slip * self.compliance())
        total = self.offset_variance(speed_m_s) + covariance + slip * slip * self.cc
        return max(total, 0.0) + unused * unused

    def drifted(self, model: CarTolerance, passed_s: float) -> SlipCalibration:
        """The calibration after a time in which the speed signals may have drifted."""
        most = max(self.bb, model.speed_bias_m_s**2)
        return self._replace(bb=min(self.bb + model.speed_drift_m_s**2 * passed_s, most))


def calibrated(
    known: SlipCalibration,
    model: CarTolerance,
    slip: float,
    speed_m_s: float,
    force_n: float,
    load_n: float,
    longitudinal_stiffness_n: float,
    deviation: float,
    slip_change: float,
) -> SlipCalibration:
    """The calibration after one reading, unchanged where the tyre might slide.

    Parameters
    ----------
    known, model : SlipCalibration, CarTolerance
        What is known.
    slip : float
        Signed slip as it is read [-].
    speed_m_s, force_n, load_n, longitudinal_stiffness_n : float
        Speed [m/s], signed F_hat [N], F_z [N], C_x as it is told [N].
    deviation, slip_change : float
        Standard deviation of the slip through noise, and how far it is from its lagged value: force and slip of a
        tyre that is being loaded do not belong together [-].
    """
    used = abs(force_n) / load_n
    if used > model.gentle:
        return known
    b, r, c, bb, br, bc, rr, rc, cc = known
    adhering_slip = force_n / (INITIAL_SLOPE * longitudinal_stiffness_n)
    inverse_v = 1.0 / speed_m_s
    by_b = bb * inverse_v + br + bc * adhering_slip
    by_r = br * inverse_v + rr + rc * adhering_slip
    by_c = bc * inverse_v + rc + cc * adhering_slip
    predicted = by_b * inverse_v + by_r + by_c * adhering_slip
    if predicted <= 0.0:
        return known
    force_doubt = model.force_doubt_n / (INITIAL_SLOPE * longitudinal_stiffness_n)
    settling = SETTLING * slip_change
    total = predicted + CORRELATED * deviation * deviation + force_doubt * force_doubt + settling * settling
    innovation = slip - (b * inverse_v + r + (1.0 + c) * adhering_slip)
    if innovation * innovation > REJECTED * REJECTED * total:
        if used > model.coasting:
            return known
        # No force and yet slip, more than was thought possible: the radius or the speed is off by about that much.
        rr += innovation * innovation
        by_r += innovation * innovation
        total += innovation * innovation
    gain = innovation / total
    return SlipCalibration(
        b + by_b * gain,
        r + by_r * gain,
        min(max(c + by_c * gain, STIFFEST), SOFTEST),
        bb - by_b * by_b / total,
        br - by_b * by_r / total,
        bc - by_b * by_c / total,
        rr - by_r * by_r / total,
        rc - by_r * by_c / total,
        cc - by_c * by_c / total,
    )
