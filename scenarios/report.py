"""report.html of a run, in one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenarios.brake_onset import Comparison
from scenarios.figure17 import figure17
from scenarios.html_page import data_address, page
from scenarios.runner import Run
from trpac_core.estimator_data import Method

TEMPLATE = Path(__file__).with_name("report.html.jinja")


def write_report(
    run: Run,
    overlay: Path | None,
    path: Path,
    comparisons: Sequence[Comparison] = (),
    onset_figure: Path | None = None,
) -> None:
    """Write the report of a run with its plots and, where there was a camera, its sheet of pictures.

    With comparisons it begins with their brake onsets and the figure of them.
    """
    text = page(
        TEMPLATE,
        run=run,
        summary=run.summary,
        ours=title(run.summary),
        rows=score_rows(run.summary),
        sentences=sentences(run.summary),
        figure=figure17(run),
        onsets=[compared.onset for compared in comparisons],
        onset_figure=data_address(onset_figure.read_bytes()) if onset_figure is not None else None,
        overlay=data_address(overlay.read_bytes(), "image/jpeg") if overlay is not None else None,
    )
    path.write_text(text, encoding="utf-8")


def title(summary: dict[str, Any]) -> str:
    """Name of the estimator that made the unit's TRPAC."""
    return Method.of(summary["method"]).title


def score_rows(summary: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Rows of a table: estimator and score, stretch by stretch."""
    estimators = summary["estimators"]
    stretches = len(next(iter(estimators.values())))
    return [(name, estimators[name][i]) for i in range(stretches) for name in estimators]


def verdict(summary: dict[str, Any]) -> str:
    """Results of the run in sentences, one per stretch of road."""
    return " ".join(sentences(summary))


def sentences(summary: dict[str, Any]) -> list[str]:
    """One sentence per stretch of road: first those on which TRPAC is not known, then those where it is wrong."""
    scores = summary["estimators"][title(summary)]
    said = [_sentence(end, score) for end, score in zip(summary["at_the_end"], scores, strict=True)]
    return [text for _, text in sorted(said, key=lambda pair: pair[0])]


def _sentence(end: dict[str, Any], score: dict[str, Any]) -> tuple[int, str]:
    """The sentence on a stretch, and its place among the others."""
    name, value = f"{score['theta']:g} stretch from {score['start_m']:g} m", f"{end['TRPAC']:.2f}"
    if not end["shown_s"]:
        why = "the wheel spun or locked" if end["spun"] else "the wheel torque was too small to show it"
        source = " from the camera" if end["camera"] else ""
        return 0, f"{name}: not known, {why} (TRPAC at its end{source}: {value})."
    if score["convergence_time_s"] is None:
        return 1, f"{name}: true value not reached, TRPAC at its end is {value}."
    within = f"within {score['convergence_time_s']:.2f} s of excited time"
    return 2, f"{name}: {value} at its end, converged {within}."
