"""Scores on the terminal, and the confusion matrix as a picture."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .generator.library import LIBRARY
from .scorer import Line, Scores

VERDICTS = ("unknown", "no_gap", "error")


def print_scores(scores: Scores, console: Console) -> None:
    """Thresholds first, then what explains them."""
    console.print(_lines(scores.lines, "Thresholds (frozen before the cases were opened)"))
    console.print(_lines(scores.asides, "Asides"))
    table = Table(
        "ranker", "first", "first two", "n", title="Baselines on rich cases; they always name an effect"
    )
    for name, shares in scores.baselines.items():
        table.add_row(name, _percent(shares["first"]), _percent(shares["two"]), f"{shares['n']:.0f}")
    console.print(table)
    table = Table(
        "effect", "cases", "gap large enough", "right first", "first two", title="Rich cases by effect"
    )
    for effect, row in scores.by_effect.items():
        table.add_row(effect, *(str(row[key]) for key in ("cases", "counted", "first", "two")))
    console.print(table)
    table = Table(
        "probability", "cases", "believed", "right", title="Reliability of the most probable answer"
    )
    for b in scores.bins:
        table.add_row(
            f"{b['low']:.1f} to {b['high']:.1f}", str(b["n"]), _percent(b["believed"]), _percent(b["right"])
        )
    console.print(table)
    table = Table("kind", "verdicts", title="Verdicts")
    for group, verdicts in scores.verdicts.items():
        table.add_row(group, ", ".join(f"{n} {verdict}" for verdict, n in sorted(verdicts.items())))
    console.print(table)
    for name, error in scores.errors.items():
        console.print(f"[red]{name}[/red]: {escape(error)}", highlight=False)
    if scores.pending:
        console.print(f"{len(scores.pending)} cases have no result yet: the figures are not the run's.")


def _lines(lines: list[Line], title: str) -> Table:
    table = Table("line", "value", "hits", "95 %", "limit", "", title=title)
    for line in lines:
        counted = line.hits is not None
        value = _percent(line.value) if counted else f"{line.value:.3g}"
        between = f"{_percent(line.low)} to {_percent(line.high)}" if line.low is not None else ""
        limit = " and ".join(
            f"{'>=' if key == 'at_least' else '<='} {_percent(x) if counted else f'{x:g}'}"
            for key, x in line.limits.items()
        )
        mark = (
            "" if not line.limits else "-" if line.n == 0 else "holds" if line.holds else "[red]missed[/red]"
        )
        table.add_row(
            escape(line.text),
            value,
            f"{line.hits}/{line.n}" if counted else f"n = {line.n}",
            between,
            limit,
            mark,
        )
    return table


def _percent(share: float | None) -> str:
    return "-" if share is None or math.isnan(share) else f"{100 * share:.1f} %"


def draw_confusion(scores: Scores, path: Path) -> None:
    """Truth down, answer across; each row in shares, counts in the cells."""
    columns = [*LIBRARY, *VERDICTS]
    columns += sorted({answer for row in scores.confusion.values() for answer in row} - set(columns))
    counts = np.array([[row.get(c, 0) for c in columns] for row in scores.confusion.values()]).reshape(
        -1, len(columns)
    )
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure, axes = plt.subplots(
        figsize=(0.42 * len(columns) + 3.5, 0.38 * len(counts) + 2.8), layout="constrained"
    )
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(
            j,
            i,
            str(counts[i, j]),
            ha="center",
            va="center",
            fontsize=8,
            color="white" if shares[i, j] > 0.6 else "black",
        )
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(counts)), list(scores.confusion), fontsize=8)
    axes.set_xlabel("answer: first cause, or the verdict where none is blamed")
    axes.set_ylabel("truth")
    axes.set_title("Rich driving, gap at least five times the noise floor")
    figure.savefig(path, dpi=130)
    plt.close(figure)
