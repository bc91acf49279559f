"""Command line of the check on withheld data."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from .frozen import run_frozen, write_list
from .generator.forms import NEWEST, PLAIN
from .generator.making import make_case
from .generator.table import table
from .outcome import ResultError
from .runner import RunError, pending, run, seal_run, write_case
from .scorer import score_run
from .show import draw_confusion, print_scores

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
console, complaints = Console(), Console(stderr=True, soft_wrap=True)


class Size(StrEnum):
    """The keys of `SIZES`, as choices."""

    DEV = "dev"
    SMALL = "small"
    MEDIUM = "medium"
    FULL = "full"
    CAMERA = "camera"
    CAMERA_SMALL = "camera_small"


Out = Annotated[Path, typer.Option(help="Folder of the run.")]
Cases = Annotated[
    Size, typer.Option(help="How many: a handful, a few of each kind, or all; or the camera's.")
]
Seed = Annotated[
    int, typer.Option(min=0, help="1 is for development; a seal wants one that nobody has looked at.")
]


class Forms(StrEnum):
    """What a case draws among."""

    PLAIN = "plain"
    NEWEST = "newest"


EDITIONS = {Forms.PLAIN: PLAIN, Forms.NEWEST: NEWEST}
FormsOf = Annotated[
    Forms, typer.Option(help="What is drawn among: one form of everything, or all that the generator has.")
]


@app.command("cases")
def cases_command(
    out: Out,
    cases: Cases = Size.DEV,
    seed: Seed = 1,
    forms: FormsOf = Forms.PLAIN,
) -> None:
    """Only write the cases' files, with their seals beside, to look at."""
    with _progress() as progress:
        edition = EDITIONS[forms]
        specs = table(cases.value, edition)
        task = progress.add_task("cases", total=len(specs))
        for spec in specs:
            case = make_case(spec, seed, edition)
            folder = write_case(case, seed, out)
            folder.with_suffix(".seal.json").write_text(json.dumps(case.seal(), indent=1), encoding="utf-8")
            progress.advance(task)


@app.command("run")
def run_command(
    out: Out,
    cases: Cases = Size.SMALL,
    seed: Seed = 1,
    forms: FormsOf = Forms.NEWEST,
    jobs: Annotated[int, typer.Option(min=1, help="Cases side by side.")] = 2,
    keep: Annotated[bool, typer.Option(help="Keep the cases' logs.")] = False,
) -> None:
    """Make the cases and have each diagnosed; a stopped run goes on where it stopped."""
    edition = EDITIONS[forms]
    seal_run(out, cases.value, seed, edition)
    waiting, total = pending(out, cases.value, edition)
    failed = 0
    with _progress() as progress:
        task = progress.add_task("diagnoses", total=total, completed=total - len(waiting))
        for result in run(out, cases.value, seed, edition, jobs, keep):
            failed += result["error"] is not None
            progress.update(
                task, advance=1, description=f"diagnoses, {failed} failed" if failed else "diagnoses"
            )


@app.command("score")
def score_command(out: Out) -> None:
    """Open the seal: print the scores, write scores.json and confusion.png. Exit code 1 where a threshold is missed."""
    scores = score_run(out)
    print_scores(scores, console)
    (out / "scores.json").write_text(json.dumps(scores.to_json(), indent=1), encoding="utf-8")
    draw_confusion(scores, out / "confusion.png")
    if any(line.n and not line.holds for line in scores.lines):
        raise typer.Exit(1)


@app.command("frozen")
def frozen_command(
    out: Out,
    only: Annotated[str, typer.Option(help="Part of the names of the cases to run; all by default.")] = "",
    jobs: Annotated[int, typer.Option(min=1, help="Cases side by side.")] = 2,
    record: Annotated[bool, typer.Option(help="Freeze what is said now; needs all cases.")] = False,
) -> None:
    """Run the frozen cases and hold them to what was said when they were frozen. Exit code 1 where one got worse."""
    if record and only:
        raise typer.BadParameter("--record freezes all cases: leave --only out")
    now, worse = [], 0
    for before, after in run_frozen(out, jobs, only):
        now.append(after)
        lost = before.right == "yes" and after.right == "no"
        worse += lost
        mark = (
            "LOST"
            if lost
            else ""
            if before.right == after.right
            else "not run before"
            if not before.right
            else "won"
        )
        then = f"{before.verdict or '-'} {before.first}".strip()
        said = f"{after.spec.name}: {after.verdict} {after.first} (right: {after.right}; then: {then}) {mark}"
        console.print(said, highlight=False)
    console.print(f"{sum(case.right == 'yes' for case in now)} of {len(now)} right, {worse} lost")
    if record:
        write_list(now)
    if worse:
        raise typer.Exit(1)


def _progress() -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=complaints)


def main() -> None:
    """Errors of the run are one line and exit code 2."""
    try:
        app()
    except (RunError, ResultError) as problem:
        complaints.print(str(problem), style="red", highlight=False)
        raise SystemExit(2) from problem


if __name__ == "__main__":
    main()
