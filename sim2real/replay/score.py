"""How far estimates are off a reference of peak friction, and whether their deviation says so."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim2real.replay.run import Replay

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Score:
    """Errors over some rows; None where there are none.

    Attributes
    ----------
    time_s : float
        How long these rows are; of four wheels together where wheels are counted one by one [s].
    mean, mean_abs, p95_abs : float or None
        Of TRPAC_peak minus the reference [-].
    within_2_std : float or None
        Share of rows whose error is at most 2 standard deviations of TRPAC_peak; None without a deviation [-].
    mean_std : float or None
        Mean standard deviation of TRPAC_peak [-].
    """

    time_s: float
    mean: float | None
    mean_abs: float | None
    p95_abs: float | None
    within_2_std: float | None
    mean_std: float | None


def score(peak: Array, std: Array, reference: Array, rows: Mask, step_s: float) -> Score:
    """Score an estimate over some rows; all arrays have one shape."""
    rows = rows & np.isfinite(reference)
    error = (peak - reference)[rows]
    if not len(error):
        return Score(0.0, None, None, None, None, None)
    size, of_error = np.abs(error), std[rows]
    known = bool(np.isfinite(of_error).all())
    return Score(
        time_s=len(error) * step_s,
        mean=float(error.mean()),
        mean_abs=float(size.mean()),
        p95_abs=float(np.quantile(size, 0.95)),
        within_2_std=float((size <= 2.0 * of_error).mean()) if known else None,
        mean_std=float(of_error.mean()) if known else None,
    )


def errors(done: Replay) -> dict[str, Any] | None:
    """Errors of the car's estimate against the log's `mu_reference`, per estimator; None without a reference.

    The reference is peak friction, so it is held against TRPAC_peak. Three sets of rows: where the estimator
    is excited at any wheel, where the tyre moved ours, and all driving.
    """
    reference = done.inputs.mu_reference
    if reference is None:
        return None
    moving = done.inputs.moving
    out: dict[str, Any] = {"reference": "mu_reference", "compared": "TRPAC_peak"}
    for name, trace in done.traces.items():
        theta, std, peak = trace.of_the_car
        peak_std = std * peak / theta
        out[name] = {
            label: asdict(score(peak, peak_std, reference, rows, done.inputs.step_s))
            for label, rows in (
                ("excited", moving & trace.excited.any(axis=1)),
                ("seen", moving & done.seen.any(axis=1)),
                ("all", moving),
            )
        }
    return out


def excitation(done: Replay) -> dict[str, float]:
    """How long the car drove, and for which share of that it was excited, seen, and not usable [s], [-]."""
    moving = done.inputs.moving
    count = max(int(np.count_nonzero(moving)), 1)

    def share(wheels: Mask) -> float:
        """Of the driving, where this holds for any wheel."""
        return float(np.count_nonzero(np.logical_or.reduce(wheels, axis=1) & moving) / count)

    return {
        "driven_s": float(np.count_nonzero(moving) * done.inputs.step_s),
        "excited_share": share(done.ours.excited),
        "seen_share": share(done.seen),
        "camera_share": share(done.flag),
        "unusable_share": share(~done.usable),
    }
