"""Warnings, as sentences, about a car that differs from its description."""

from __future__ import annotations

import math

from ..tyre import INITIAL_SLOPE
from .arrays import first_greatest, total
from .belief import mean_offset
from .tyres import PEAKS
from .wheel import RobustSetup, RobustState

LASTING_S = 2.0
"""Time of readings for which the belief must contradict the description of the car [s]."""
MOST_OFFSET = 0.05
"""Slip without force that no wrong radius explains: ten standard deviations of the prior of `TYRES` [-]."""
MOST_STIFFNESS = 4.0
"""Estimated over described stiffness, or the reverse, that no tyre explains: about seven standard deviations of the
prior of `TYRES` [-]."""
WRONG_INPUT = "the measured wheel torque or a speed is wrong, or vehicle.yaml."


def learnt_stiffness_n(state: RobustState, known: RobustSetup, load_n: float) -> float | None:
    """Estimated stiffness of a tyre that does not follow the described formula, at a load [N]; None where it does."""
    if state.doubted_s < LASTING_S:
        return None
    tyre = first_greatest(state.belief.tyre)
    if PEAKS[tyre] == 0.0:
        return None
    softness = total(state.belief.road[tyre] * state.belief.softness[tyre])[0]
    return known.wheel.stiffness_n * math.exp(-softness) * load_n / known.wheel.mean_load_n


def learnt_offset(state: RobustState) -> float | None:
    """Slip of a wheel without force that the stated tolerances do not explain [-]; None where they do."""
    return mean_offset(state.belief) if state.offset_s >= LASTING_S else None


def is_implausible(state: RobustState, known: RobustSetup, load_n: float) -> bool:
    """Whether stiffness or slip offset are so far from the description that they are no measurements of the car."""
    offset = learnt_offset(state)
    if offset is not None and abs(offset) > MOST_OFFSET:
        return True
    learnt_n = learnt_stiffness_n(state, known, load_n)
    if learnt_n is None:
        return False
    share = learnt_n * known.wheel.mean_load_n / (known.wheel.stiffness_n * load_n)
    return share > MOST_STIFFNESS or share * MOST_STIFFNESS < 1.0


def tyre_message(state: RobustState, known: RobustSetup, axle: str, load_n: float) -> str | None:
    """The warning that the tyre does not follow the described formula; None where it does.

    `axle` is the first word of the sentences, `load_n` the load at which the stiffness is named [N].
    """
    learnt_n = learnt_stiffness_n(state, known, load_n)
    if learnt_n is None:
        return None
    if is_implausible(state, known, load_n):
        return f"{axle} tyres are further from the expected curve than any tyre: {WRONG_INPUT}"
    told_n = INITIAL_SLOPE * known.wheel.stiffness_n
    return (
        f"{axle} tyres do not follow the expected curve: slip stiffness estimated {1e-3 * learnt_n:.0f} kN per unit "
        f"slip at {1e-3 * load_n:.1f} kN load, expected {1e-3 * told_n:.0f} kN ({INITIAL_SLOPE:g} C_x). Use TRPAC_low "
        "and TRPAC_high, and adjust tyre.longitudinal_stiffness_n in vehicle.yaml."
    )


def radius_message(state: RobustState, known: RobustSetup, axle: str, load_n: float) -> str | None:
    """The warning that a wheel without force shows a slip beyond the stated tolerances; None where it does not.

    Arguments as of `tyre_message`.
    """
    offset, told_m = learnt_offset(state), known.wheel.radius_m
    if offset is None:
        return None
    if is_implausible(state, known, load_n):
        return f"{axle} wheels slip without force, which no radius explains: {WRONG_INPUT}"
    return (
        f"{axle} wheels do not have the expected radius: slip without force estimated {100.0 * offset:+.1f} %, as of a "
        f"radius of {told_m * (1.0 - offset):.4f} m, expected {told_m:.4f} m. Adjust wheel_radius_m in vehicle.yaml."
    )
