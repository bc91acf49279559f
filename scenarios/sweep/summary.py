"""Results of a sweep: quantiles of errors and times, coverage of TRPAC_std, per estimator and level."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

SLIPPERY = ("wet", "snow_ice")
"""Surfaces on which the paper states its results."""
ENOUGH_SHOWN_S = 0.5
"""Least time with identifiable theta for a stretch to be scored, which is the required convergence time [s]."""
MEASURES = (
    "steady_state_error",
    "convergence_time_s",
    "shown_convergence_time_s",
    "wall_convergence_time_s",
    "band_time_s",
)
COVERAGE_SPAN = (0.90, 0.99)
"""Required range of the share of true values within 2 TRPAC_std, at a nominal 0.95 [-]."""


def slippery(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of wet, snowy and icy stretches."""
    return table[table["surface"].isin(SLIPPERY)]


def shown_enough(table: pd.DataFrame) -> pd.DataFrame:
    """The rows with identifiable theta for at least `ENOUGH_SHOWN_S`, by the plant's slip and load."""
    return table[table["shown_s"] >= ENOUGH_SHOWN_S]


def quantile(values: pd.Series, share: float, never: bool = False) -> float | None:
    """A quantile, None without values; with `never` missing values are infinite, and an infinite quantile is None."""
    numbers: NDArray[np.float64] = values.to_numpy(dtype=np.float64)
    numbers = np.where(np.isnan(numbers), np.inf, numbers) if never else numbers[~np.isnan(numbers)]
    if not len(numbers):
        return None
    found = float(np.quantile(numbers, share, method="higher"))
    return found if np.isfinite(found) else None


def distribution(table: pd.DataFrame) -> dict[str, Any]:
    """Median, 95th percentile and number of missing values of each measure over rows."""
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
    """Share of true values within 2 TRPAC_std, weighted by time; None without TRPAC_std."""
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
    """All results of a sweep by level and estimator.

    Returns
    -------
    dict
        `levels`: a list of parameter, level and, per estimator, distributions over `slippery` stretches, those with
        theta `shown` long enough, of these `after_a_change` of road and `from_standstill`, all shown ones
        `by_surface`, and `coverage`.
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
    """Results of one estimator at one level."""
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
