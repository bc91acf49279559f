"""The command `trpac log check`: how a recorded log is read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from trpac_cli.console import Terminal, bars, refuse, require_folder

if TYPE_CHECKING:
    from sim2real.logs.inspection import ColumnReport
    from sim2real.logs.read import Understood

COMMAND = "trpac log check"
EXIT_NOT_ENOUGH = 1
"""Exit code of a file that can be read and does not hold what an estimate needs."""

HEADINGS = ("column", "source", "unit", "factor", "Hz", "lost", "range")
OPTIONAL = ("factor", "lost")
"""Columns of the table that are left out where they are empty."""

app = typer.Typer(help="Recorded logs: check how a file is read.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Commands on recorded logs."""


@app.command()
def check(
    log: Annotated[
        Path,
        typer.Argument(help="Recorded drive: text table, Parquet, MDF, MAT-file or raw bus log."),
    ],
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="Mapping file or name of a shipped one: where each column of the log format is, and its unit.",
        ),
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(help="DBC file of a raw bus log; may be repeated."),
    ] = None,
    vehicle: Annotated[
        Path | None,
        typer.Option(help="Car file: the logged torque is compared with the car's acceleration."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the log with the names and units of the log format: .parquet, .csv or .mf4."
        ),
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a figure of the signals: .png.")] = None,
    propose: Annotated[
        Path | None,
        typer.Option(
            help="Write a draft of a mapping file, by names and units of the columns: .yaml. Correct it by hand."
        ),
    ] = None,
) -> None:
    """Show how each column of a log is read: source, unit, rate, range, lost samples, what is missing.

    If columns have other names than those of the log format, a draft of a
    mapping file is shown. Correct it and give it with --map.

    Example, with the files of trpac example example:
    trpac log check example/foreign.csv --map example/mapping.yaml
    --picture drive.png --out drive.parquet

    Columns, units and mapping files: docs/guide/logs.md.

    Exit codes: 0 usable, 1 readable but columns are missing, 2 not readable; then nothing is written.
    """
    from scenarios.whole_files import write_whole, written_whole
    from sim2real.logs.inspection import draw, missing_for_diagnosis, missing_for_estimate
    from sim2real.logs.mapping import load_mapping
    from sim2real.logs.proposal import candidates, proposed_mapping
    from sim2real.logs.read import understood
    from sim2real.logs.table import read_as
    from sim2real.logs.write import write_log
    from trpac_core.errors import TrpacError

    for path in (out, picture, propose):
        if path is not None:
            require_folder(COMMAND, path.parent)
    try:
        size = log.stat().st_size if log.is_file() else 0
        with bars() as progress:
            found = understood(
                log,
                load_mapping(mapping) if mapping else None,
                dbc,
                progress=lambda done: progress("reading [kB]", done // 1000, max(1, size // 1000)),
            )
    except (TrpacError, OSError) as error:
        refuse(COMMAND, error)
    console = Terminal()
    console.print(f"{log.name}: {len(found.time_s)} rows, read as: {read_as(found.table.notes)}")
    _show(console, found)
    for text in found.problems:
        console.print(text, style="red")
    for text in found.warnings:
        console.print(text, style="yellow")
    lacks = missing_for_estimate(found)
    fit = not found.problems and not lacks
    usable = "usable" if fit else "not usable, see above"
    try:
        apart = _torque_apart(found, vehicle) if fit and vehicle is not None else None
    except TrpacError as error:
        refuse(COMMAND, error)
    if apart:
        console.print(apart, style="yellow")
        usable = "readable, but the torque does not fit the car"
    hint = " With --vehicle the torque is compared with the car." if fit and vehicle is None else ""
    console.print(f"For trpac estimate: {usable}.{hint}")
    if fit:
        console.print(f"For trpac gap diagnose: {'; '.join(missing_for_diagnosis(found)) or 'usable'}.")
    try:
        written = []
        if picture is not None:
            draw(found, picture)
            written.append(picture)
        if propose is not None:
            write_whole(propose, proposed_mapping(found.table, log.name).encode())
            written.append(propose)
        if out is not None and fit:
            with written_whole(out.parent) as scratch:
                write_log(found.log(lambda: ""), scratch / out.name)  # the hash is not written
            written.append(out)
    except (TrpacError, OSError) as error:
        refuse(COMMAND, error)
    if propose is None and lacks and candidates(found.table):
        console.print(
            "\nDraft of a mapping file. Correct it and give it with --map (--propose FILE writes it):\n"
        )
        console.print(proposed_mapping(found.table, log.name), soft_wrap=True)
    if written:
        console.print("  ".join(str(path) for path in written), soft_wrap=True)
    if not fit:
        if out is not None:
            console.print(f"{out} was not written: see the problems above.", style="red")
        raise typer.Exit(EXIT_NOT_ENOUGH)


def _torque_apart(found: Understood, vehicle: Path) -> str | None:
    """The sentence that the torque does not fit the car; None where it may."""
    from scenarios.files import load_vehicle
    from sim2real.replay.inputs import make_inputs

    return make_inputs(found.log(lambda: ""), load_vehicle(vehicle)).contradiction


def _show(console: Terminal, found: Understood) -> None:
    from sim2real.logs.inspection import column_reports

    rows = [_row(column) for column in column_reports(found)]
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    shown = [
        i for i, heading in enumerate(HEADINGS) if heading not in OPTIONAL or any(row[i] for row in rows)
    ]
    for heading in (HEADINGS[i] for i in shown):
        wraps = heading in ("source", "range")
        table.add_column(
            heading,
            justify="left" if heading in ("column", "source", "unit") else "right",
            overflow="fold",
            min_width=10 if wraps else None,
            no_wrap=not wraps,
        )
    for row in rows:
        table.add_row(*(row[i] for i in shown))
    console.print(table)


def _row(column: ColumnReport) -> tuple[str, ...]:
    return (
        column.name,
        "" if column.source == column.name else column.source,
        column.unit,
        "" if math.isnan(column.factor) or column.factor == 1.0 else f"{column.factor:.6g}",
        f"{column.rate_hz:.4g}",
        f"{column.lost:.1%}" if column.lost else "",
        f"{column.low:.4g} ... {column.high:.4g}",
    )
