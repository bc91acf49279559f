"""What a sweep showed: quantiles of errors and times, coverage of TRPAC_std, per estimator and level."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

SLIPPERY = ("wet", "snow_ice")
"""The paper claims its figures for these."""
ENOUGH_SHOWN_S = 0.5
"""Time for which the tyre must truly show theta for a stretch to be judged: the time in which to converge [s]."""
MEASURES = (
    "steady_state_error",
    "convergence_time_s",
    "shown_convergence_time_s",
    "wall_convergence_time_s",
    "band_time_s",
)
COVERAGE_SPAN = (0.90, 0.99)
"""Between these shares of true values shall lie within 2 TRPAC_std, at a nominal 0.95 [-]."""


def slippery(table: pd.DataFrame) -> pd.DataFrame:
    """The stretches on which the estimators are judged: wet, snow and ice."""
    return table[table["surface"].isin(SLIPPERY)]


def shown_enough(table: pd.DataFrame) -> pd.DataFrame:
    """Those on which the tyre truly showed theta for long enough, by the plant's own slip and load."""
    return table[table["shown_s"] >= ENOUGH_SHOWN_S]


def quantile(values: pd.Series, share: float, never: bool = False) -> float | None:
    """A quantile; with `never` what is missing counts as later than everything, and None stands for that."""
    numbers: NDArray[np.float64] = values.to_numpy(dtype=np.float64)
    numbers = np.where(np.isnan(numbers), np.inf, numbers) if never else numbers[~np.isnan(numbers)]
    if not len(numbers):
        return None
    found = float(np.quantile(numbers, share, method="higher"))
    return found if np.isfinite(found) else None


def distribution(table: pd.DataFrame) -> dict[str, Any]:
    """Median and 95th percentile of each measure over some rows, and how many rows say nothing."""
    result: dict[str, Any] = {"stretches": len(table)}
    for measure in MEASURES:
        never = measure != "steady_state_error"
        result[measure] = {
            "median": quantile(table[measure], 0.5, never),
            "percentile_95": quantile(table[measure], 0.95, never),
            "missing": int(table[measure].isna().sum()),
        }
    return result


def coverage(table: pd.DataFrame) -> dict[str, Any] | None:
    """Share of true values within 2 TRPAC_std, weighted by time; None where an estimator states none."""
    stated = table[table["covered_share"].notna()]
    if stated.empty:
        return None
    shown = stated[stated["covered_share_shown"].notna()]
    return {
        "all_time": _weighted(stated["covered_share"], stated["time_s"]),
        "while_shown": _weighted(shown["covered_share_shown"], shown["shown_s"]),
        "at_the_end_of_a_stretch": float(stated["covered_end"].mean()),
    }


def _weighted(values: pd.Series, weights: pd.Series) -> float | None:
    return float(np.average(values, weights=weights)) if weights.sum() > 0.0 else None


def summarise(table: pd.DataFrame) -> dict[str, Any]:
    """All figures of a sweep, by level and estimator.

    Returns
    -------
    dict
        `levels`: a list of parameter, level and, per estimator, distributions over `slippery` stretches, those of them
        that the tyre has `shown`, these `after_a_change` of road and `from_standstill`, all shown ones `by_surface`,
        and `coverage`.
    """
    levels = []
    for (parameter, _), part in table.groupby(["parameter", "level"], dropna=False, sort=False):
        estimators = {
            str(name): estimator_summary(rows) for name, rows in part.groupby("estimator", sort=True)
        }
        level = float(part["level"].iloc[0])
        value = None if np.isnan(level) else level
        levels.append(
            {
                "parameter": parameter,
                "level": value,
                "runs": int(part["run"].nunique()),
                "estimators": estimators,
            }
        )
    return {"levels": levels}


def estimator_summary(rows: pd.DataFrame) -> dict[str, Any]:
    """One estimator at one level."""
    slick = slippery(rows)
    judged = shown_enough(slick)
    return {
        "slippery": distribution(slick),
        "shown": distribution(judged),
        "after_a_change": distribution(judged[judged["stretch"] > 0]),
        "from_standstill": distribution(judged[judged["stretch"] == 0]),
        "by_surface": {
            str(surface): distribution(shown_enough(part))
            for surface, part in rows.groupby("surface", sort=True)
        },
        "mean_error": float(np.average(rows["error_mean"], weights=rows["time_s"])),
        "mean_error_slippery": float(np.average(slick["error_mean"], weights=slick["time_s"]))
        if len(slick)
        else None,
        "coverage": coverage(rows),
        "coverage_by_surface": {
            str(surface): coverage(part) for surface, part in rows.groupby("surface", sort=True)
        },
    }
