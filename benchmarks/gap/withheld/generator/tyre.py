"""Longitudinal tyre curves: the modified Dugoff tyre, and foreign ones of the same initial slope and peak.

Foreign curves take the unsigned slip [-], the force per slip at zero [N], well above the peak, the largest force [N],
and parameters of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiling import compiled

Array = NDArray[np.floating[Any]]

THETA_GRID = np.linspace(0.02, 1.5, 75)
MAGIC, BRUSH, RATIONAL, DECAYING, SATURATED, BRUSH_UNIFORM, BRUSH_FALLING, CUBED, HYPERBOLIC_TANGENT = range(
    9
)
BLENDED, TWO_LINES, PLAIN_DUGOFF, SINE_RISE, ARCTANGENT, BRISTLES, COMPOSITE = range(9, 16)
BRUSH_ELLIPTIC, SPLINED, HUMPED = range(16, 19)
"""Codes of the foreign curves."""
COMPOSITE_AT, COMPOSITE_TOP = 2.1045880, 0.99907098
"""Where the composite slip's function has its peak, and how large that is [-]."""


@compiled
def dugoff(slip: float, stiffness: float, theta: float, load: float) -> float:
    """Force of the modified Dugoff tyre in pure longitudinal slip [N].

    With the adhesion force x = C s / (1 - s), Dugoff's L is theta F_z / (2 x): the force is x while x < theta F_z / 2,
    and saturates as theta F_z (1 - theta F_z / (4 x)) beyond, which stays finite for the locked wheel. The shape G
    multiplies both (Bian, Chen, Luo, Li 2014, SAE 2014-01-0123).

    Parameters
    ----------
    slip : float
        Unsigned slip, 0 to 1 [-].
    stiffness : float
        C_x [N].
    theta : float
        Friction of the road [-].
    load : float
        Vertical load [N].
    """
    if slip <= 0.0 or load <= 0.0 or theta <= 0.0:
        return 0.0
    grip = theta * load
    adhesion = stiffness * slip / max(1.0 - slip, 1e-12)
    force = adhesion if adhesion < 0.5 * grip else grip * (1.0 - 0.25 * grip / adhesion)
    shape = 1.27 + slip * ((1.15 - 0.75 * theta) * slip - (1.63 - 0.75 * theta))
    return force * shape


@compiled
def magic(slip: float, slope: float, peak: float, shape: float, curvature: float) -> float:
    """Force of the magic formula [N] (Pacejka 2012, Tire and Vehicle Dynamics, Eq. 4.49).

    shape, curvature: C and E [-].
    """
    if peak <= 0.0:
        return 0.0
    b = slope / (shape * peak) * slip
    return peak * np.sin(shape * np.arctan(b - curvature * (b - np.arctan(b))))


@compiled
def brush(slip: float, slope: float, peak: float) -> float:
    """Force of the brush model under a parabolic pressure [N] (Pacejka 2012, Sec. 3.2): cubic, then it slides."""
    if peak <= 0.0:
        return 0.0
    gripping = max(1.0 - slope * slip / (3.0 * peak), 0.0)
    return peak * (1.0 - gripping**3)


@compiled
def rational(slip: float, slope: float, peak: float, stretch: float, sliding: float) -> float:
    """Force of a rational function up to the peak and a cubic fall beyond [N] (Rill 2013, the TMeasy tyre).

    stretch: slip of the peak over peak / slope, at least 2 [-].
    sliding: force from five times the peak's slip on, over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slip * slope / (stretch * peak)
    if x <= 1.0:
        return slope * slip / (1.0 + x * (x + stretch - 2.0))
    z = min((x - 1.0) / 4.0, 1.0)
    return peak * (1.0 - (1.0 - sliding) * z * z * (3.0 - 2.0 * z))


@compiled
def decaying(slip: float, slope: float, peak: float, loss: float) -> float:
    """Force of c (1 - exp(-b s) - `loss` s) [N] (Burckhardt 1993, Fahrwerktechnik: Radschlupf-Regelsysteme).

    loss: what a locked wheel's force lacks, over c; above 0 [-].
    """
    if peak <= 0.0:
        return 0.0
    top = peak
    for _ in range(6):
        ratio = loss * top / (slope + loss * top)
        top = peak / (1.0 - ratio + ratio * np.log(ratio))
    return top * (1.0 - np.exp(-(slope / top + loss) * slip) - loss * slip)


@compiled
def saturated(slip: float, slope: float, peak: float) -> float:
    """Force of a line, then a hyperbola that has its peak at the locked wheel [N] (Fiala's, as Adams has it)."""
    if peak <= 0.0:
        return 0.0
    grip = 2.0 * slope * (1.0 - np.sqrt(max(1.0 - peak / slope, 0.0)))
    if slip <= 0.5 * grip / slope:
        return slope * slip
    return grip - 0.25 * grip * grip / (slope * slip)


@compiled
def brush_uniform(slip: float, slope: float, peak: float) -> float:
    """Force of the brush model under an even pressure [N]: a parabola, then all of it slides."""
    if peak <= 0.0:
        return 0.0
    x = min(0.5 * slope * slip / peak, 1.0)
    return peak * x * (2.0 - x)


@compiled
def brush_falling(slip: float, slope: float, peak: float, kinetic: float) -> float:
    """Force of the brush model under a parabolic pressure, whose bristles slide with less friction than they hold [N].

    With the share that holds, l = 1 - slope s / (3 hold), and r the friction's ratio, the force over `hold` is
    3 (1 - l) l^2 + r (1 - 3 l^2 + 2 l^3), largest at l = 2 (1 - r) / (3 - 2 r) (Pacejka 2012, Sec. 3.2, extended).

    kinetic: friction of what slides over that of what holds, below 1 [-].
    """
    if peak <= 0.0:
        return 0.0
    top = 2.0 * (1.0 - kinetic) / (3.0 - 2.0 * kinetic)
    hold = peak / (3.0 * (1.0 - top) * top**2 + kinetic * (1.0 - 3.0 * top**2 + 2.0 * top**3))
    held = max(1.0 - slope * slip / (3.0 * hold), 0.0)
    return hold * (3.0 * (1.0 - held) * held**2 + kinetic * (1.0 - 3.0 * held**2 + 2.0 * held**3))


@compiled
def cubed(slip: float, slope: float, peak: float, curvature: float) -> float:
    """Force of 1 - exp(-(x + E x^2 + (E^2 + 1/12) x^3)) times the peak, x = `slope` s / peak [N].

    The static part of the UniTire model (Guo, Lu 2007, Vehicle System Dynamics 45, 79-99).

    curvature: E [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slope * slip / peak
    return peak * (1.0 - np.exp(-x * (1.0 + x * (curvature + x * (curvature**2 + 1.0 / 12.0)))))


@compiled
def blended(slip: float, slope: float, peak: float, order: float) -> float:
    """Force of a line and a level blended, (1/line^n + 1/level^n)^(-1/n), with its peak at the locked wheel [N].

    order: n [-].
    """
    if peak <= 0.0 or slip <= 0.0:
        return 0.0
    rest = (slope / peak) ** order - 1.0
    return slope * slip / (1.0 + rest * slip**order) ** (1.0 / order)


@compiled
def two_lines(slip: float, slope: float, peak: float, sliding: float) -> float:
    """Force of a parabola up to the peak and a straight fall to the locked wheel's [N].

    sliding: force of the locked wheel over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    best = 2.0 * peak / slope
    x = slip / best
    if x <= 1.0:
        return peak * x * (2.0 - x)
    return peak * (1.0 - (1.0 - sliding) * (slip - best) / (1.0 - best))


@compiled
def plain_dugoff(slip: float, slope: float, peak: float) -> float:
    """Force of Dugoff's tyre without the modified one's shape, with its peak at the locked wheel [N]."""
    if peak <= 0.0:
        return 0.0
    adhesion = slope * slip / max(1.0 - slip, 1e-12)
    return adhesion if adhesion < 0.5 * peak else peak * (1.0 - 0.25 * peak / adhesion)


@compiled
def sine_rise(slip: float, slope: float, peak: float, sliding: float) -> float:
    """Force of a quarter of a sine up to the peak, and a bell's fall to `sliding` of it over five times as far [N].

    sliding: force of a wheel that slides over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slope * slip / peak
    if x <= 0.5 * np.pi:
        return peak * np.sin(x)
    beyond = (x - 0.5 * np.pi) / (2.5 * np.pi)
    return peak * (sliding + (1.0 - sliding) * np.exp(-beyond * beyond))


@compiled
def arctangent(slip: float, slope: float, peak: float) -> float:
    """Force of an arctangent whose peak is the locked wheel's [N]."""
    if peak <= 0.0:
        return 0.0
    top = peak
    for _ in range(8):
        top = 0.5 * np.pi * peak / np.arctan(0.5 * np.pi * slope / top)
    return top * 2.0 / np.pi * np.arctan(0.5 * np.pi * slope * slip / top)


@compiled
def bristles(slip: float, slope: float, peak: float) -> float:
    """Force of bristles with even load that give way [N]: 1 - (1 - exp(-2 x)) / (2 x) of `slope` s over it.

    The steady state of the distributed LuGre tyre with one friction (Canudas-de-Wit et al. 2003, Vehicle System
    Dynamics 39, 189-226); its peak is the locked wheel's.
    """
    if peak <= 0.0 or slip <= 0.0:
        return 0.0
    top = peak
    for _ in range(8):
        x = 2.0 * slope / top
        top = peak / (1.0 + np.expm1(-x) / x)
    x = 2.0 * slope * slip / top
    return top * (1.0 + np.expm1(-x) / x)


@compiled
def composite(slip: float, slope: float, peak: float, fading: float) -> float:
    """Force of a ratio of cubics in the composite slip, less `fading` of it for the locked wheel [N].

    The saturation function (c^3 + 0.34 c^2 + 4 c / pi) / (c^3 + 0.57 c^2 + 0.32 c + 1) of a radial tyre (Szostak,
    Allen, Rosenthal 1988, DOT HS 807 271), whose largest value is `COMPOSITE_TOP`; the fading begins beyond it.

    fading: what a locked wheel's force lacks, over the peak [-].
    """
    if peak <= 0.0 or slip <= 0.0:
        return 0.0
    per_slip = 0.25 * np.pi * slope * COMPOSITE_TOP / peak
    c = per_slip * slip
    rise = c * (4.0 / np.pi + c * (0.34 + c)) / (1.0 + c * (0.32 + c * (0.57 + c)))
    best = COMPOSITE_AT / per_slip
    if slip > best:
        rise *= 1.0 - fading * (slip - best) / (1.0 - best)
    return peak * rise / COMPOSITE_TOP


@compiled
def brush_elliptic(slip: float, slope: float, peak: float) -> float:
    """Force of the brush model under an elliptic pressure, as Hertz has it of a stiff belt [N].

    With k = pi `slope` s / (4 `peak`), the bristles hold from the leading edge to u = (k^2 - 1) / (k^2 + 1) of half the
    contact, and slide behind it; the peak is approached as the slip grows.
    """
    if peak <= 0.0:
        return 0.0
    k = 0.25 * np.pi * slope * slip / peak
    over = 1.0 + k * k
    u = (k * k - 1.0) / over
    holds = 2.0 * k / over**2
    slides = 0.5 * (2.0 * u * k / over + np.arcsin(u)) + 0.25 * np.pi
    return peak * 2.0 / np.pi * (holds + slides)


@compiled
def splined(slip: float, slope: float, peak: float, stretch: float, sliding: float) -> float:
    """Force of two cubics, as of a table with three points: at rest, at the peak, of the locked wheel [N].

    stretch: slip of the peak over peak / slope, at most 3 [-].
    sliding: force of the locked wheel over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    best = stretch * peak / slope
    x = slip / best
    if x <= 1.0:
        return peak * x * (stretch * (1.0 - x) ** 2 + x * (3.0 - 2.0 * x))
    z = (slip - best) / (1.0 - best)
    return peak * (1.0 - (1.0 - sliding) * z * z * (3.0 - 2.0 * z))


@compiled
def humped(slip: float, slope: float, peak: float, sliding: float) -> float:
    """Force of z exp(1 - z) up to the peak at z = 1, and beyond it of the same fall to `sliding` [N].

    sliding: force of a wheel that slides over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    z = slope * slip / (np.e * peak)
    hump = z * np.exp(1.0 - z)
    return peak * (hump if z <= 1.0 else sliding + (1.0 - sliding) * hump)


@compiled
def foreign(curve: int, slip: float, slope: float, peak: float, first: float, second: float) -> float:
    """Force of a foreign curve by its code [N]; `first` and `second` are its own parameters."""
    if curve == BRUSH:
        return brush(slip, slope, peak)
    if curve == RATIONAL:
        return rational(slip, slope, peak, first, second)
    if curve == DECAYING:
        return decaying(slip, slope, peak, first)
    if curve == BRUSH_UNIFORM:
        return brush_uniform(slip, slope, peak)
    if curve == BRUSH_FALLING:
        return brush_falling(slip, slope, peak, first)
    if curve == SATURATED:
        return saturated(slip, slope, peak)
    if curve == CUBED:
        return cubed(slip, slope, peak, first)
    if curve == HYPERBOLIC_TANGENT:
        return peak * np.tanh(slope * slip / peak) if peak > 0.0 else 0.0
    if curve == BLENDED:
        return blended(slip, slope, peak, first)
    if curve == TWO_LINES:
        return two_lines(slip, slope, peak, first)
    if curve == PLAIN_DUGOFF:
        return plain_dugoff(slip, slope, peak)
    if curve == SINE_RISE:
        return sine_rise(slip, slope, peak, first)
    if curve == ARCTANGENT:
        return arctangent(slip, slope, peak)
    if curve == BRISTLES:
        return bristles(slip, slope, peak)
    if curve == COMPOSITE:
        return composite(slip, slope, peak, first)
    if curve == BRUSH_ELLIPTIC:
        return brush_elliptic(slip, slope, peak)
    if curve == SPLINED:
        return splined(slip, slope, peak, first, second)
    if curve == HUMPED:
        return humped(slip, slope, peak, first)
    return magic(slip, slope, peak, first, second)


def peaks(stiffness: float, load: float) -> Array:
    """Largest force over load of the modified Dugoff tyre, at each value of `THETA_GRID` [-]."""
    slips = np.geomspace(1e-3, 1.0, 600)
    return np.array([max(dugoff(s, stiffness, t, load) for s in slips) / load for t in THETA_GRID])
