"""Longitudinal slip of one wheel, Eq. (13) of Tian et al. 2022."""

from __future__ import annotations

from typing import NamedTuple

GREATEST_SLIP = 0.999
"""A locked or spinning wheel is kept this far from slip 1, where the tyre's slip ratio has its pole [-]."""


class Slip(NamedTuple):
    """Size and direction of a wheel's slip."""

    size: float
    """Unsigned slip lambda, between 0 and 1 [-]."""
    direction: float
    """+1 where the wheel drives, -1 where it brakes, 0 where it rolls freely or stands."""


def wheel_slip(
    wheel_speed_rad_s: float, vehicle_speed_m_s: float, wheel_radius_m: float, floor_m_s: float
) -> Slip:
    """Slip of a wheel that rolls forwards; 0 at standstill.

    Parameters
    ----------
    wheel_speed_rad_s, vehicle_speed_m_s : float
        Wheel speed [rad/s] and longitudinal speed of the car [m/s].
    wheel_radius_m : float
        Rolling radius [m].
    floor_m_s : float
        Below this speed of both wheel and car the slip is 0 [m/s].

    Returns
    -------
    Slip
        Eq. (13) of Tian et al. (2022), doi:10.3390/rs14215583, with the sign kept apart.

    Examples
    --------
    >>> wheel_slip(50.0, 14.0, 0.29, 1.0)
    Slip(size=0.034482758620689655, direction=1.0)
    """
    slip = signed_slip(wheel_speed_rad_s * wheel_radius_m, vehicle_speed_m_s, floor_m_s)
    return Slip(abs(slip), 1.0 if slip > 0.0 else -1.0 if slip < 0.0 else 0.0)


def signed_slip(rim_m_s: float, vehicle_speed_m_s: float, floor_m_s: float) -> float:
    """Size times direction of `wheel_slip`, of the rim's speed omega R [-]."""
    sliding = rim_m_s - vehicle_speed_m_s
    faster = rim_m_s if sliding > 0.0 else vehicle_speed_m_s
    if sliding == 0.0 or faster < floor_m_s:
        return 0.0
    slip = sliding / faster
    if slip > GREATEST_SLIP:
        return GREATEST_SLIP
    return slip if slip > -GREATEST_SLIP else -GREATEST_SLIP
