"""Command line of the check on withheld data."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from .frozen import run_frozen, write_list
from .generator.table import SIZES
from .outcome import ResultError
from .runner import RunError, pending, run, seal_run
from .scorer import print_scores, score_run

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
console, complaints = Console(), Console(stderr=True, soft_wrap=True)


Size = StrEnum("Size", list(SIZES))
Out = Annotated[Path, typer.Option(help="Folder of the run.")]


@app.command("run")
def run_command(
    out: Out,
    cases: Annotated[Size, typer.Option(help="A few of each kind, or all; or the camera's.")] = Size.small,
    seed: Annotated[
        int, typer.Option(min=0, help="1 is for development; a seal wants one that nobody has looked at.")
    ] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Cases side by side.")] = 2,
    keep: Annotated[bool, typer.Option(help="Keep the cases' logs.")] = False,
) -> None:
    """Make the cases and have each diagnosed; a stopped run goes on where it stopped."""
    seal_run(out, cases.value, seed)
    waiting, total = pending(out, cases.value)
    failed = 0
    with Progress(console=complaints) as progress:
        task = progress.add_task("diagnoses", total=total, completed=total - len(waiting))
        for result in run(out, cases.value, seed, jobs, keep):
            failed += result["error"] is not None
            progress.update(
                task, advance=1, description=f"diagnoses, {failed} failed" if failed else "diagnoses"
            )


@app.command("score")
def score_command(out: Out) -> None:
    """Open the seal: print the scores, write scores.json. Exit code 1 where a threshold is missed."""
    scores = score_run(out)
    print_scores(scores, console)
    (out / "scores.json").write_text(json.dumps(scores.to_json(), indent=1), encoding="utf-8")
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
        won = after.right == "yes" and before.right == "no"
        mark = "LOST" if lost else "won" if won else "" if before.right else "not run before"
        then = f"{before.verdict or '-'} {before.first}".strip()
        said = f"{after.spec.name}: {after.verdict} {after.first} (right: {after.right}; then: {then}) {mark}"
        console.print(said, highlight=False)
    console.print(f"{sum(case.right == 'yes' for case in now)} of {len(now)} right, {worse} lost")
    if record:
        write_list(now)
    if worse:
        raise typer.Exit(1)


def main() -> None:
    """Errors of the run are one line and exit code 2."""
    try:
        app()
    except (RunError, ResultError) as problem:
        complaints.print(str(problem), style="red", highlight=False)
        raise SystemExit(2) from problem


if __name__ == "__main__":
    main()
