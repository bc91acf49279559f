"""report.html of a sweep, in one file."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.html_page import page
from scenarios.plots import Figure
from scenarios.sweep import figures
from scenarios.sweep.files import Sweep
from scenarios.sweep.outcome import Outcome
from scenarios.sweep.store import source_digest
from scenarios.sweep.summary import ENOUGH_SHOWN_S

TEMPLATE = Path(__file__).with_name("report.html.jinja")
PACKAGES = ("trpac-fmu", "numpy", "numba", "scipy")
MOST_LISTED = 500
"""Runs that the report lists; further ones are in runs.parquet."""


def write_report(
    sweep: Sweep, table: pd.DataFrame, summary: dict[str, Any], outcome: Outcome, path: Path
) -> None:
    """Write the report of a finished sweep."""
    text = page(
        TEMPLATE,
        file=sweep.file,
        scenario=sweep.scenario.name,
        path=sweep.path.name,
        outcome=outcome,
        levels=summary["levels"],
        enough_s=ENOUGH_SHOWN_S,
        most=MOST_LISTED,
        source=source_digest(),
        sha256=sweep.sha256,
        versions={name: version(name) for name in PACKAGES},
        figures=_figures(table),
    )
    path.write_bytes(text.encode("utf-8", "backslashreplace"))  # a name may hold half a surrogate pair


def _figures(table: pd.DataFrame) -> list[tuple[str, str, Figure]]:
    """Title, caption and plots of each part."""
    shown = []
    if table["parameter"].nunique() == 1 and table["level"].nunique() <= 1:
        caption = "Share of stretches with at most this error or time. Crosses: required median and 95th percentile."
        shown.append(("Error and convergence", caption, figures.distributions(table)))
        caption = "Every stretch of every run, by whether the tyre showed its friction for long enough there."
        shown.append(("Error over true friction", caption, figures.errors_by_friction(table)))
    caption = "Share of time with the true value within 2 TRPAC_std."
    shown.append(("Coverage of TRPAC_std", caption, figures.coverage(table)))
    for parameter, figure in figures.degradations(table):
        caption = (
            "Slippery stretches on which the tyre showed its friction; the last plot: all slippery stretches."
        )
        shown.append((f"Degradation over {parameter}", caption, figure))
    return shown
