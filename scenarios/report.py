"""report.html of a run, in one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenarios.brake_onset import Comparison
from scenarios.html_page import data_address, page
from scenarios.runner import Run
from trpac_core.estimator_data import Method

TEMPLATE = Path(__file__).with_name("report.html.jinja")
DASH = "–"


def write_report(
    run: Run,
    figure: Path,
    overlay: Path | None,
    path: Path,
    comparisons: Sequence[Comparison] = (),
    onset_figure: Path | None = None,
) -> None:
    """Write the report of a run with its figure and, where there was a camera, its sheet of pictures.

    With comparisons it begins with their brake onsets and the figure of them.
    """
    text = page(
        TEMPLATE,
        {"number": number},
        run=run,
        summary=run.summary,
        ours=title(run.summary),
        rows=score_rows(run.summary),
        conclusion=conclusion(run.summary),
        figure=data_address(figure.read_bytes()),
        overlay=data_address(overlay.read_bytes(), "image/jpeg") if overlay is not None else None,
        onsets=[compared.onset for compared in comparisons],
        onset_figure=data_address(onset_figure.read_bytes()) if onset_figure is not None else None,
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


def conclusion(summary: dict[str, Any]) -> str:
    """Results of the run in sentences."""
    sentences, name = [], title(summary)
    for before, (dife, alone) in _steps(summary):
        where = f"From {before:g} to {dife['theta']:g}"
        if dife["steady_state_error"] is None:
            sentences.append(f"{where} the tyre was not excited: the estimates hold what they had.")
            continue
        sentences.append(
            f"{where} {name} {_convergence(dife)} and stays {dife['steady_state_error']:.3f} off; "
            f"DE alone {_convergence(alone)} and stays {number(alone['steady_state_error'])} off."
        )
    return " ".join(sentences)


def _steps(summary: dict[str, Any]) -> list[tuple[float, tuple[dict[str, Any], dict[str, Any]]]]:
    """Adhesion before each change of road, with the scores of the unit's TRPAC and of DE after it."""
    dife, alone = summary["estimators"][title(summary)], summary["estimators"]["DE"]
    return [(dife[i - 1]["theta"], (dife[i], alone[i])) for i in range(1, len(dife))]


def _convergence(score: dict[str, Any]) -> str:
    if score["convergence_time_s"] is None:
        return "does not converge"
    return f"converges within {score['convergence_time_s']:.2f} s of excited time"


def number(value: float | None, digits: int = 3) -> str:
    """A number as text; a dash for None."""
    return DASH if value is None else f"{value:.{digits}f}"
