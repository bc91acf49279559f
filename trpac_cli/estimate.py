"""The command `trpac estimate`: the estimator along a recorded drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from trpac_cli.console import MethodOption, Terminal, bars, refuse, require_folder

COMMAND = "trpac estimate"


def estimate(
    log: Annotated[
        Path, typer.Argument(help="Recorded drive: text table, Parquet, MDF, MAT-file or raw bus log.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for estimates.csv, report.html and summary.json.")],
    vehicle: Annotated[
        Path | None,
        typer.Option(help="Car file. Without it the paper's car is assumed, with a warning."),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(help="Camera file. The pictures named in the column image_path are then classified."),
    ] = None,
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
    peers: Annotated[
        bool,
        typer.Option(
            "--peers",
            help="Also run a slip-slope estimator and two Kalman filters, for comparison; takes a few times as long.",
        ),
    ] = False,
    method: MethodOption = "robust",
) -> None:
    """Estimate the peak friction (TRPAC) along a recorded drive, with an interval for each sample.

    The log needs torque and speed of the four wheels, vehicle speed and
    longitudinal acceleration at 50 Hz to 2 kHz. Other names and units go into
    a mapping file; trpac log check proposes one.

    The friction can be found only where a tyre slips enough: brake or
    accelerate up to a slip of 0.02 or more. Elsewhere TRPAC_std and the
    interval TRPAC_low to TRPAC_high are wide.
    The tyre stiffness and the rolling radius in the car file decide the
    result: a radius error of 1 % is a slip error of 0.01.

    Camera: --camera classifies pictures; classes of the log (image_class,
    image_confidence, image_from_m, image_to_m) are used without it.
    With a column mu_reference (measured peak friction) the errors are stated.

    Example, with the files of trpac example example:
    trpac estimate example/foreign.csv --map example/mapping.yaml
    --vehicle example/car.yaml --out out/drive

    Guide: docs/guide/estimate.md. Formats and mapping files: docs/guide/logs.md.

    Exit codes: 0 done, 2 unusable input; then nothing is written.
    """
    import trpac

    require_folder(COMMAND, out)
    try:
        with bars() as progress:
            done = trpac.estimate(
                log,
                vehicle,
                mapping=mapping,
                dbc=dbc,
                camera=camera,
                peers=peers,
                method=method,
                progress=progress,
            )
            progress("report", 0, 1)
            written = done.write(out)
            progress("report", 1, 1)
    except (trpac.TrpacError, OSError) as error:
        refuse(COMMAND, error)
    console, summary = Terminal(), done.summary
    console.print(done.verdict)
    console.print(f"{summary['log']['name']} read as: {summary['log']['read_as']}.")
    if summary["errors"] is not None:
        console.print(_error_table(summary["errors"]))
    for warning in summary["warnings"]:
        console.print(warning, style="yellow")
    console.print("  ".join(str(path) for path in written), soft_wrap=True)


def _error_table(errors: dict[str, Any]) -> Table:
    from scenarios.html_page import number, percent

    table = Table(
        title="TRPAC_peak against mu_reference", title_justify="left", box=SIMPLE_HEAD, pad_edge=False
    )
    for heading in ("estimator", "rows", "time [s]", "mean abs. error", "within 2 std"):
        left = heading in ("estimator", "rows")
        table.add_column(heading, justify="left" if left else "right")
    for name, sets in errors.items():
        if not isinstance(sets, dict):
            continue
        for label, score in sets.items():
            table.add_row(
                name,
                label,
                number(score["time_s"], 1),
                number(score["mean_abs"], 3, "no such row"),
                percent(score["within_2_std"], "no deviation"),
            )
    return table
