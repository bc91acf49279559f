"""The command `trpac sweep`: many runs on Dask."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from scenarios.errors import ScenarioError
from trpac_cli.console import Terminal, bars, complain, refuse, require_folder

if TYPE_CHECKING:
    import pandas as pd

    from scenarios.sweep.execute import Failure
    from scenarios.sweep.files import Sweep
    from scenarios.sweep.store import Parts

EXIT_SOME_FAILED = 1
"""Exit code where some runs failed; they are named on standard error."""
MOST_NAMED = 5
"""Failed runs that are named."""


def sweep(
    file: Annotated[
        Path, typer.Argument(help="Sweep file, or the name of a shipped one, such as paper_simulation.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for runs.parquet, report.html and summary.json.")],
    runs: Annotated[
        int | None, typer.Option(min=1, help="Runs of each level, in place of the number in the file.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a running Dask cluster; without it the runs use this machine."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine; by default one per core.")
    ] = None,
    allow_code: Annotated[
        bool,
        typer.Option(
            "--allow-code",
            help="Allow estimators of your own, package.module:function, in the sweep file: this runs their code.",
        ),
    ] = False,
) -> None:
    """Run a scenario many times with random roads, noise, errors and disturbances; write a table and a report.

    If it is stopped, call it again with the same folder: finished runs are kept.

    Example: trpac sweep paper_simulation --runs 10 --out out/sweep

    Guide: docs/guide/sweep.md.

    Exit codes: 0 done, 1 done but some runs failed, 2 unusable input.
    """
    from scenarios.sweep.execute import execute
    from scenarios.sweep.files import load_sweep

    console = Terminal()
    try:
        _require(scheduler, jobs)
        require_folder("trpac sweep", out)
        loaded = load_sweep(file, allow_code=allow_code, runs=runs)
        with bars() as progress:
            parts, failures = execute(loaded, out, scheduler, jobs, partial(progress, "runs"))
        if not parts.empty():
            _finish(loaded, parts, failures, out, console)
    except (ScenarioError, OSError) as error:
        refuse("trpac sweep", error)
    if failures:
        named = "; ".join(f"run {f.run}: {f.why}" for f in failures[:MOST_NAMED])
        complain("trpac sweep", f"{len(failures)} runs failed: {named}. Call again to try these once more.")
        raise typer.Exit(EXIT_SOME_FAILED)


def _require(scheduler: str | None, jobs: int | None) -> None:
    """Raise ScenarioError for contradicting options."""
    if scheduler is not None and jobs is not None:
        raise ScenarioError("--jobs goes with processes of this machine; leave it out with --scheduler.")


def _finish(loaded: Sweep, parts: Parts, failures: list[Failure], out: Path, console: Terminal) -> None:
    """Write table, summary and report, all or none, and print the summary."""
    from scenarios.sweep.outcome import outcome
    from scenarios.sweep.report import write_report
    from scenarios.sweep.store import write_table
    from scenarios.sweep.summary import summarise
    from scenarios.whole_files import written_whole

    table: pd.DataFrame = parts.table()
    cpu_s = parts.cpu_s()
    summary: dict[str, Any] = {
        "name": loaded.file.name,
        "seed": loaded.file.seed,
        "cpu_s": {"total": sum(cpu_s), "median_per_run": sorted(cpu_s)[len(cpu_s) // 2]},
        **summarise(table),
    }
    became = outcome(table, failures)
    with written_whole(out) as made:
        write_table(table, made / "runs.parquet")
        (made / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        write_report(loaded, table, summary, became, made / "report.html")
    console.print(became.sentence)
    console.print(_shown(summary, became.estimator))
    console.print(f"Report: {out / 'report.html'}   table: {out / 'runs.parquet'}", soft_wrap=True)


def _shown(summary: dict[str, Any], main: str) -> Table:
    """The table of medians and 95th percentiles for the terminal."""
    from scenarios.html_page import number

    table = Table(
        title=f"{summary['name']}: slippery stretches that the tyre showed, median / 95th percentile"
    )
    for heading in (
        "level",
        "estimator",
        "steady-state error",
        "5 % of step [s]",
        "within 0.02 [s]",
        "in 2 std",
    ):
        left = heading in ("level", "estimator")
        table.add_column(heading, justify="left" if left else "right", overflow="fold")
    for level in summary["levels"]:
        where = f"{level['parameter']} {level['level']:g}" if level["parameter"] else ""
        for name, found in level["estimators"].items():
            shown, covered = found["shown"], found["coverage"]
            times = [
                " / ".join(
                    number(shown[m][q], 2, "not reached" if shown["stretches"] else "not shown")
                    for q in ("median", "percentile_95")
                )
                for m in ("convergence_time_s", "band_time_s")
            ]
            error = shown["steady_state_error"]
            table.add_row(
                where,
                name,
                " / ".join(number(error[q], 4, "not excited") for q in ("median", "percentile_95")),
                *times,
                number(covered["all_time"], 3) if covered else "no std",
                style="bold" if name == main else None,
            )
    return table
