"""The command `trpac estimate`: the estimator over a recorded log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from trpac_cli.console import MethodOption, Terminal, bars, refuse, require_folder

COMMAND = "trpac estimate"


def estimate(
    log: Annotated[Path, typer.Argument(help="Recorded drive: a table, MDF, MAT-file or bus log.")],
    out: Annotated[Path, typer.Option(help="Folder for estimates.csv, report.html and summary.json.")],
    vehicle: Annotated[
        Path | None,
        typer.Option(help="The car: vehicle.yaml. Without it the paper's car is assumed, and said so."),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            help="The camera: camera.yaml; then the pictures that column image_path names are used."
        ),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option("--map", help="How the log's columns and units become the contract's: mapping.yaml."),
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(help="What the frames of a bus log mean: car.dbc; may be repeated."),
    ] = None,
    peers: Annotated[
        bool,
        typer.Option("--peers", help="Also slip-slope and two Kalman filters; takes a few times as long."),
    ] = False,
    method: MethodOption = "robust",
) -> None:
    """Estimate the road's adhesion along a recorded drive.

    Needs torque and speed of four wheels, vehicle speed, acceleration and
    position, 50 Hz to 2 kHz; names and units of your tool go into a mapping
    file. Classes of a camera (image_class, image_confidence, image_from_m,
    image_to_m) are used where the log has them, pictures with --camera.
    With a column mu_reference (peak friction), summary.json holds the errors.

    The estimate moves only where a tyre slips enough to show the road: brake
    or accelerate up to a slip of 0.02 or more. TRPAC_std says how much to
    believe. What decides is the tyre's stiffness in vehicle.yaml and the
    wheels' rolling radius: 1 % of radius is a slip of 0.01.

    Example: trpac estimate drive.mf4 --vehicle car.yaml --map mapping.yaml
    --out out/drive

    A raw log of the bus (BLF, ASC, candump, TRC, MDF) needs --dbc car.dbc;
    its columns are named Message.Signal.

    Ready-made mapping files lie in sim2real/mappings, formats in docs/guide/logs.md,
    how to read the result in docs/guide/estimate.md.

    Exit codes: 0 with an estimate, 2 unusable input, and then nothing is written.
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
