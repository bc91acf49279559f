"""Scores of estimators per stretch of road: error, convergence, excitation."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trpac_core.estimator_data import Method


def estimators(method: Method) -> dict[str, str]:
    """Names of this project's estimators, and the unit's output of each, in their order in reports."""
    return {"IFE": "TRPAC_image", "DE": "TRPAC_dynamics", method.title: "TRPAC"}


ESTIMATORS = estimators(Method.DIFE)
"""Those that every sweep runs."""
CONVERGED_SHARE = 0.05
"""Error within which an estimator has converged, as a share of the step of friction [-]."""
STEADY_SHARE = 0.3
"""Last share of a stretch's excited time, over which the steady-state error is averaged [-]."""


@dataclass(frozen=True)
class SegmentScore:
    """The scores of an estimator on a stretch of road; None where there is nothing to measure.

    Attributes
    ----------
    start_m, theta : float
        Where the stretch begins [m], and its adhesion under the wheel [-].
    steady_state_error : float or None
        Mean absolute error over the last 30 % of the excited time [-].
    max_error_after_convergence : float or None
        Largest absolute error from convergence to the end of the stretch [-].
    convergence_time_s, wall_convergence_time_s : float or None
        Excited, and elapsed, time on the stretch until the error stays within 5 % of the step; None: it never does [s].
    excited_time_s : float
        Time on the stretch with the start/stop flag set [s].
    """

    start_m: float
    theta: float
    steady_state_error: float | None
    max_error_after_convergence: float | None
    convergence_time_s: float | None
    wall_convergence_time_s: float | None
    excited_time_s: float


def score_segment(
    start_m: float,
    theta: float,
    theta_before: float,
    estimate: NDArray[np.float64],
    excited: NDArray[np.bool_],
    step_s: float,
) -> SegmentScore:
    """The scores of an estimate over the steps of the wheel on one stretch.

    Parameters
    ----------
    start_m, theta, theta_before : float
        Start of the stretch [m], adhesion on it and adhesion (or first estimate) before it [-].
    estimate, excited : arrays, shape (n,)
        The estimate [-] and the excitation flag at each step.
    step_s : float
        Step [s].
    """
    error = np.abs(estimate - theta)
    excited_s = np.cumsum(excited) * step_s
    total_s = float(excited_s[-1]) if len(excited_s) else 0.0
    steady = excited & (excited_s > (1.0 - STEADY_SHARE) * total_s)
    outside = np.flatnonzero(error > CONVERGED_SHARE * abs(theta - theta_before) + 1e-12)
    first = int(outside[-1]) + 1 if len(outside) else 0
    settled = first < len(error)
    return SegmentScore(
        start_m=start_m,
        theta=theta,
        steady_state_error=float(error[steady].mean()) if steady.any() else None,
        max_error_after_convergence=float(error[first:].max()) if settled else None,
        convergence_time_s=float(excited_s[first]) if settled else None,
        wall_convergence_time_s=first * step_s if settled else None,
        excited_time_s=total_s,
    )


def score_run(
    starts_m: NDArray[np.float64],
    segment: NDArray[np.int64],
    theta: NDArray[np.float64],
    theta_initial: float,
    estimates: dict[str, NDArray[np.float64]],
    excited: NDArray[np.bool_],
    step_s: float,
) -> dict[str, list[dict[str, Any]]]:
    """The scores of every estimator on every stretch that the wheel reached.

    Parameters
    ----------
    starts_m : array, shape (segments,)
        Where each stretch begins [m].
    segment, theta : arrays, shape (n,)
        Index of the stretch under the wheel and its adhesion [-] at each step.
    theta_initial : float
        The estimate at the start, from which the first step is counted [-].
    estimates : dict of arrays, shape (n,)
        By estimator [-].
    excited : array, shape (n,)
        DIFE's start/stop flag, by which the excited time of all estimators is counted.
    step_s : float
        Step [s].

    Returns
    -------
    dict
        Estimator name to one score, as a dictionary, per stretch.
    """
    scores: dict[str, list[dict[str, Any]]] = {name: [] for name in estimates}
    before = theta_initial
    for index in np.unique(segment):
        here = segment == index
        value = float(theta[here][0])
        for name, estimate in estimates.items():
            score = score_segment(
                float(starts_m[index]), value, before, estimate[here], excited[here], step_s
            )
            scores[name].append(asdict(score))
        before = value
    return scores
