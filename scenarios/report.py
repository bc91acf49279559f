"""report.html of a run, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenarios.html_page import data_address, page
from scenarios.runner import Run

TEMPLATE = Path(__file__).with_name("report.html.jinja")
DASH = "–"


def write_report(run: Run, figure: Path, overlay: Path | None, path: Path) -> None:
    """Write the report of a run with its figure and, where there was a camera, its sheet of pictures."""
    text = page(
        TEMPLATE,
        {"number": number},
        run=run,
        summary=run.summary,
        rows=score_rows(run.summary),
        conclusion=conclusion(run.summary),
        figure=data_address(figure.read_bytes()),
        overlay=data_address(overlay.read_bytes(), "image/jpeg") if overlay is not None else None,
    )
    path.write_text(text, encoding="utf-8")


def score_rows(summary: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Rows of a table: estimator and score, stretch by stretch."""
    estimators = summary["estimators"]
    stretches = len(next(iter(estimators.values())))
    return [(name, estimators[name][i]) for i in range(stretches) for name in estimators]


def conclusion(summary: dict[str, Any]) -> str:
    """Results of the run in sentences."""
    sentences = []
    for before, (dife, alone) in _steps(summary):
        where = f"From {before:g} to {dife['theta']:g}"
        if dife["steady_state_error"] is None:
            sentences.append(f"{where} the tyre was not excited: the estimates hold what they had.")
            continue
        sentences.append(
            f"{where} DIFE {_convergence(dife)} and stays {dife['steady_state_error']:.3f} off; "
            f"DE alone {_convergence(alone)} and stays {number(alone['steady_state_error'])} off."
        )
    return " ".join(sentences)


def _steps(summary: dict[str, Any]) -> list[tuple[float, tuple[dict[str, Any], dict[str, Any]]]]:
    """Adhesion before each change of road, with DIFE's and DE's scores after it."""
    dife, alone = summary["estimators"]["DIFE"], summary["estimators"]["DE"]
    return [(dife[i - 1]["theta"], (dife[i], alone[i])) for i in range(1, len(dife))]


def _convergence(score: dict[str, Any]) -> str:
    if score["convergence_time_s"] is None:
        return "does not converge"
    return f"converges within {score['convergence_time_s']:.2f} s of excited time"


def number(value: float | None, digits: int = 3) -> str:
    """A number as text; a dash for None."""
    return DASH if value is None else f"{value:.{digits}f}"
