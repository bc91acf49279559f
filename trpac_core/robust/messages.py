"""What a drive shows of a car that is not as told, in sentences."""

from __future__ import annotations

import math

from ..tyre import INITIAL_SLOPE
from .belief import mean_offset
from .tyres import TYRES
from .wheel import RobustSetup, RobustState

LASTING_S = 2.0
"""Time of readings for which the belief must contradict what is told [s]."""


def tyre_message(state: RobustState, known: RobustSetup, axle: str, load_n: float) -> str | None:
    """Sentences where the tyre does not follow the told formula; None where it does, or too little was read.

    `axle` is the first word of the sentences, `load_n` the load at which the stiffness is named [N].
    """
    tyre = int(state.belief.tyre.argmax())
    if state.doubted_s < LASTING_S or TYRES[tyre].peak == 0.0:
        return None
    softness = float((state.belief.road[tyre] * state.belief.softness[tyre]).sum())
    learnt_n = known.wheel.stiffness_n * math.exp(-softness) * load_n / known.wheel.mean_load_n
    told_n = INITIAL_SLOPE * known.wheel.stiffness_n
    return (
        f"{axle} tyres do not follow the told curve: slip stiffness learnt {1e-3 * learnt_n:.0f} kN per unit slip at "
        f"{1e-3 * load_n:.1f} kN load, told {1e-3 * told_n:.0f} kN ({INITIAL_SLOPE:g} C_x). TRPAC is an interval here; "
        "adjust tyre.longitudinal_stiffness_n in vehicle.yaml."
    )


def radius_message(state: RobustState, known: RobustSetup, axle: str) -> str | None:
    """Sentences where a wheel without force reads a slip that the told tolerances do not explain; else None."""
    if state.offset_s < LASTING_S:
        return None
    offset, told_m = mean_offset(state.belief), known.wheel.radius_m
    return (
        f"{axle} wheels do not have the told radius: slip without force learnt {100.0 * offset:+.1f} %, as of a radius "
        f"of {told_m * (1.0 - offset):.4f} m, told {told_m:.4f} m. Adjust wheel_radius_m in vehicle.yaml."
    )
