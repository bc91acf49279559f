"""report.html of a sweep, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.html_page import data_address, page
from scenarios.report import number
from scenarios.sweep import figures
from scenarios.sweep.execute import Failure
from scenarios.sweep.files import Sweep
from scenarios.sweep.summary import ENOUGH_SHOWN_S

TEMPLATE = Path(__file__).with_name("report.html.jinja")


def write_report(
    sweep: Sweep, table: pd.DataFrame, summary: dict[str, Any], failures: list[Failure], path: Path
) -> None:
    """Write the report of a finished sweep."""
    file = sweep.file
    text = page(
        TEMPLATE,
        {"number": number, "never": lambda value: "never" if value is None else f"{value:.2f}"},
        name=file.name,
        description=file.description,
        runs=table["run"].nunique(),
        scenario=sweep.scenario.name,
        camera=file.camera.source,
        seed=file.seed,
        levels=summary["levels"],
        failures=[f"run {f.run} ({f.why})" for f in failures],
        enough_s=ENOUGH_SHOWN_S,
        pictures=[(title, caption, data_address(data)) for title, caption, data in _pictures(table)],
    )
    path.write_bytes(text.encode("utf-8", "backslashreplace"))  # a name may hold half a surrogate pair


def _pictures(table: pd.DataFrame) -> list[tuple[str, str, bytes]]:
    """Title, caption and PNG of each figure."""
    shown = []
    if table["parameter"].nunique() == 1 and table["level"].nunique() <= 1:
        caption = "Share of stretches that are at most so far off, or take at most so long. Crosses: what is asked for."
        shown.append(("Error and convergence", caption, figures.distributions(table)))
        caption = "Every stretch of every run. Grey: the tyre did not truly show its friction for long enough there."
        shown.append(("Error over true friction", caption, figures.errors_by_friction(table)))
    covered = figures.coverage_figure(table)
    if covered is not None:
        caption = "Share of time with the true value within 2 TRPAC_std."
        shown.append(("Coverage of TRPAC_std", caption, covered))
    for parameter, picture in figures.degradations(table):
        caption = "Slippery stretches that the tyre showed; on the right all the time on slippery stretches."
        shown.append((f"Degradation over {parameter}", caption, picture))
    return shown
