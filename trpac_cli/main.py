"""The command `trpac`."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from trpac_cli import fmu as fmu_commands
from trpac_cli import gap, log, vision
from trpac_cli.console import MethodOption, Terminal, UnitOption, bars, kind_to_build, refuse, require_folder
from trpac_cli.estimate import estimate
from trpac_cli.hil import hil, hil_plant
from trpac_cli.sweep import sweep
from trpac_core.errors import TrpacError

app = typer.Typer(
    help="Tyre-road adhesion from dynamics and camera: run scenarios, estimate on recorded logs, diagnose the gap "
    "between simulation and log, judge pictures, run beside a rig.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(vision.app, name="vision")
app.add_typer(gap.app, name="gap")
app.add_typer(log.app, name="log")
app.add_typer(fmu_commands.app, name="fmu")
app.command()(estimate)
app.command()(sweep)
app.command()(hil)
app.command("hil-plant")(hil_plant)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"trpac {version('trpac-fmu')}")
        raise typer.Exit


@app.callback()
def _root(
    version_asked: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    """Options of all commands."""


@app.command()
def run(
    scenario: Annotated[
        Path,
        typer.Argument(
            help="Scenario file, or the name of a shipped one: paper_simulation, cruise_onto_snow."
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for report.html, figure17.png, log.csv and summary.json.")
    ],
    fmu: Annotated[
        Path | None, typer.Option(help="Unit to run; without it one is built from the sources.")
    ] = None,
    unit: UnitOption = None,
    seed: Annotated[int | None, typer.Option(min=0, help="In place of the scenario's seed.")] = None,
    stiffness_n: Annotated[
        float | None,
        typer.Option(min=10_000.0, max=1e6, help="C_x in place of the vehicle's, in plant and unit [N]."),
    ] = None,
    method: MethodOption = "robust",
    compare_camera: Annotated[
        list[Path] | None,
        typer.Option(
            help="Scenario that brakes on another road, such as cruise_onto_snow. It is run with and without its "
            "camera; the report begins with TRPAC at brake onset, drawn in brake_onset.png. May be repeated."
        ),
    ] = None,
) -> None:
    """Run a scenario: plant, rendered and disturbed pictures, the unit under fmpy; write report and scores.

    Example: trpac run paper_simulation --out out/paper

    Exit codes: 0 done, 2 unusable input or no place to write, and then nothing is written.
    """
    import trpac

    require_folder("trpac run", out)
    kind = kind_to_build("trpac run", fmu, unit)
    try:
        with bars() as progress:
            finished = trpac.run(
                scenario,
                seed=seed,
                stiffness_n=stiffness_n,
                fmu=fmu,
                kind=kind,
                method=method,
                compare_camera=compare_camera or (),
                progress=progress,
            )
            finished.write(out, progress)
    except (TrpacError, OSError) as error:
        refuse("trpac run", error)
    console = Terminal()
    console.print(finished.verdict)
    console.print(_score_table(finished.summary))
    for sentence in finished.brake_onsets:
        console.print(sentence)
    console.print(f"Report: {out / 'report.html'}   figure: {out / 'figure17.png'}")


@app.command()
def example(
    folder: Annotated[Path, typer.Argument(help="Folder for the files; it is made where it does not exist.")],
) -> None:
    """Write example files to try each command on: logs, car, road, mapping, camera and pictures.

    Example: trpac example example, then
    trpac estimate example/drive.csv --vehicle example/car.yaml --out out/drive

    Exit codes: 0 done, 2 no place to write, and then nothing is written.
    """
    from trpac.example_files import example as write_example

    require_folder("trpac example", folder)
    try:
        with bars() as progress:
            written = write_example(folder, lambda done, total: progress("drawing pictures", done, total))
    except (TrpacError, OSError) as error:
        refuse("trpac example", error)
    console = Terminal()
    files = [path for path in written if path.parent == folder]
    console.print("  ".join(str(path) for path in files), soft_wrap=True)
    console.print(f"{folder / 'frames'}: {len(written) - len(files)} pictures", soft_wrap=True)


def _score_table(summary: dict) -> Table:
    """The table of scores for the terminal."""
    from scenarios.html_page import number
    from scenarios.report import score_rows, title

    table = Table(title=f"{summary['scenario']}, seed {summary['seed']}")
    headings = (
        "estimator",
        "theta",
        "steady-state error",
        "convergence, excited [s]",
        "clock [s]",
        "excited [s]",
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "estimator" else "right")
    for name, score in score_rows(summary):
        table.add_row(
            name,
            f"{score['theta']:g}",
            number(score["steady_state_error"], 3, "not excited"),
            number(score["convergence_time_s"], 2, "not reached"),
            number(score["wall_convergence_time_s"], 2, "not reached"),
            number(score["excited_time_s"], 2),
            style="bold" if name == title(summary) else None,
        )
    return table


@app.command()
def gains() -> None:
    """Show how the gains K and gamma follow from bandwidth, noise and accuracy.

    The delivered gains are these, rounded; a test holds them to each other.
    """
    from scenarios.gain_design import SEPARATION, DesignPoint, design_gains
    from trpac_core.dife import Gains
    from trpac_core.vehicle import Vehicle

    point, delivered = DesignPoint(), Gains()
    table = Table(title=f"Designed gains (delivered: K {delivered.K:g} 1/s, gamma {delivered.gamma:g} 1/s)")
    for heading in ("C_x [kN]", "K [1/s]", "gamma [1/s]", "deviation of theta_hat [-]"):
        table.add_column(heading, justify="right")
    for stiffness_n in (20_000.0, 40_000.0, 50_000.0, 60_000.0):
        design = design_gains(point, Vehicle(longitudinal_stiffness_n=stiffness_n))
        row = (stiffness_n / 1e3, design.K, design.gamma, design.theta_deviation)
        table.add_row(f"{row[0]:g}", f"{row[1]:.1f}", f"{row[2]:.1f}", f"{row[3]:.4f}")
    console = Terminal()
    console.print(table)
    console.print(
        f"Force bandwidth {point.force_bandwidth_hz:g} Hz, loops a factor {SEPARATION:g} apart, deviation of theta_hat "
        f"at most {point.theta_deviation:g} on theta {point.theta:g} at {point.speed_m_s:g} m/s."
    )
