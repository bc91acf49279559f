"""The commands `trpac gap`: why a simulation and recorded logs differ."""

from __future__ import annotations

import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from trpac_cli.console import Terminal, bars, refuse, require_folder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sim2real.demo import Case, Truth
    from sim2real.result import Cause, Diagnosis

MOST_CAUSES = 5
"""Greatest number of causes in the summary."""
COLOURS = {
    "identified": "cyan",
    "partial": "cyan",
    "compound": "cyan",
    "ambiguous": "yellow",
    "unknown": "red",
    "no_gap": "green",
}


class By(StrEnum):
    """The quantity by which rows of two logs are matched."""

    TIME = "time"
    POSITION = "position"


app = typer.Typer(
    help="Diagnosis of the sim-to-real gap: location, cause, remaining gap.",
    no_args_is_help=True,
)


@app.command()
def diagnose(
    vehicle: Annotated[Path, typer.Option(help="The simulated car: vehicle.yaml.")],
    fit: Annotated[
        list[str],
        typer.Option(
            help="Log to fit to (table, MDF, MAT-file, bus log): LOG, LOG@ROAD.yaml, LOG@FROM:TO in seconds, or "
            "LOG@ROAD.yaml@FROM:TO; may be repeated."
        ),
    ],
    holdout: Annotated[
        str,
        typer.Option(help="Log on which the gap is measured; nothing is fitted to it. As --fit."),
    ],
    out: Annotated[Path, typer.Option(help="Folder for diagnosis.json and report.html.")],
    road: Annotated[
        Path | None, typer.Option(help="Road of the logs that do not name one: road.yaml.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--map", help="Names and units of the logs' columns: mapping.yaml, or the name of a shipped one."
        ),
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(help="What the frames of bus logs mean: car.dbc; may be repeated."),
    ] = None,
    baseline: Annotated[
        list[str] | None,
        typer.Option(help="Log of the same car without the fault, any manoeuvre; may be repeated."),
    ] = None,
    paired: Annotated[
        list[str] | None,
        typer.Option(
            help="Log of the same manoeuvre without the fault, one for each --fit in their order and, last, the "
            "--holdout's; LOG or LOG@ROAD.yaml."
        ),
    ] = None,
    simulated: Annotated[
        list[str] | None,
        typer.Option(
            help="Log of your own simulation over a log's torques; as many as --paired, in its place."
        ),
    ] = None,
    by: Annotated[
        By,
        typer.Option(
            help="Rows of a log and its --paired log are the same point at equal time_s or position_m."
        ),
    ] = By.TIME,
    model: Annotated[
        Path | None,
        typer.Option(
            help="Your own vehicle model as an FMU for co-simulation: it is run over the logs, in place of --simulated."
        ),
    ] = None,
    signals: Annotated[
        Path | None, typer.Option(help="Which variable of --model is which signal of the logs: signals.yaml.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same diagnosis.")] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Parallel fits; default: one per processor.")
    ] = None,
) -> None:
    """Diagnose the gap between a simulation and recorded logs.

    Runs the simulated car along the logs, fits every effect of the
    library to the fit logs and compares the fits on the hold-out. Reports
    where the gap lies, which effect causes it, how much of it disappears
    with that effect, and what to drive next if the logs do not separate
    several effects. Guide: docs/guide/gap.md.

    Example: trpac gap diagnose --vehicle car.yaml --road track.yaml
    --fit monday.csv --fit tuesday.mf4 --holdout friday.csv@wet_track.yaml
    --map mapping.yaml --out out/gap

    With one log only, fit to some windows of it and hold another one out:
    --fit drive.csv@0:6 --fit drive.csv@10: --holdout drive.csv@6:10

    A mapping file translates other column names and units: schema: 1, and
    under columns: lines such as vehicle_speed_m_s: {column: VehSpd, unit: km/h}.
    docs/guide/logs.md has all options and the names of the shipped ones.

    A car that differs from the simulated one leaves a gap without any
    fault. --baseline before.csv, any drive before the fault, shows how it
    differs. A second log of the same manoeuvre, recorded before the fault,
    cancels the difference:
    --fit after_1.csv --holdout after_2.csv --paired before_1.csv
    --paired before_2.csv. So does your own simulation of the same drive:
    --simulated sim_1.csv --simulated sim_2.csv. The logs' time_s must
    start at the same point; otherwise use --by position.

    Your own vehicle model as an FMU does the same, and its parameters are
    fitted. It needs a file of signals, such as this one; docs/guide/gap_own_model.md
    describes it:
    schema: 1; inputs: {motor.fl: {signal: wheel_torque_fl_nm}, ...};
    outputs: {vehicle_speed_m_s: {column: v, unit: km/h}, ...};
    initial: {v0: {signal: vehicle_speed_m_s}};
    parameters: {car.m: {unit: kg, low: 1200, high: 1900,
    effect: mass_offset.mass_kg}}.
    Then: --model plant.fmu --signals signals.yaml

    No logs yet? trpac gap demo --out out/gap_demo makes some.

    Exit codes: 0 with a diagnosis, whatever its verdict; 2 unusable input.
    """
    from joblib import cpu_count

    from scenarios.errors import ScenarioError
    from sim2real.diagnose import diagnose_files
    from sim2real.reporting.report import rated, write_diagnosis

    command = "trpac gap diagnose"
    require_folder(command, out)
    try:
        with bars() as progress:
            diagnosis = diagnose_files(
                vehicle,
                road,
                fit,
                holdout,
                mapping=mapping,
                dbc=dbc or (),
                baseline=baseline or (),
                paired=paired or (),
                simulated=simulated or (),
                by=by.value,
                model=model,
                signals=signals,
                seed=seed,
                jobs=jobs or cpu_count(),
                progress=progress,
            )
            progress("report", 0, 1)
            written = write_diagnosis(rated(diagnosis), out)
            progress("report", 1, 1)
    except (ScenarioError, OSError) as error:
        refuse(command, error)
    console = Terminal()
    _summarise(console, diagnosis)
    if put := _how_to_apply(diagnosis, vehicle, written[0]):
        console.print(put, soft_wrap=True)
    console.print("  ".join(str(path) for path in written), soft_wrap=True)


@app.command()
def apply(
    diagnosis: Annotated[Path, typer.Argument(help="The diagnosis.json of trpac gap diagnose.")],
    vehicle: Annotated[Path, typer.Option(help="The vehicle.yaml that the diagnosis was made with.")],
    out: Annotated[Path, typer.Option(help="Vehicle file to write, with the effects.")],
    effect: Annotated[
        str | None,
        typer.Option(metavar="ID", help="The effect to put in if the verdict is ambiguous."),
    ] = None,
) -> None:
    """Write a vehicle.yaml with the effects that a diagnosis found.

    Effects replace those of the same name in the file. Everything else stays
    except comments. The old file is not changed.

    Example: trpac gap apply out/gap/diagnosis.json --vehicle car.yaml
    --out car_with_effect.yaml

    Exit codes: 0 written; 2 unusable input, a verdict that names no effect,
    or another vehicle file than the diagnosis was made with.
    """
    from sim2real.apply import apply_file, load_diagnosis
    from trpac_core.errors import TrpacError

    command = "trpac gap apply"
    try:
        found = load_diagnosis(diagnosis)
        causes = apply_file(found, vehicle, out, effect)
    except (TrpacError, OSError) as error:
        refuse(command, error)
    console = Terminal()
    for line in _applied(found, causes, out):
        console.print(line, soft_wrap=True)


def _applied(diagnosis: Diagnosis, causes: tuple[Cause, ...], out: Path) -> Iterator[str]:
    """Lines on the effects in the car, the remaining gap, and the next step."""
    from scenarios.effects import EFFECTS
    from sim2real.apply import gap_left

    gap, names = diagnosis.gap, " and ".join(cause.effect for cause in causes)
    for cause in causes:
        form = f", {cause.form}" if cause.form else ""
        values = ", ".join(f"{name} {estimate.value:.4g}" for name, estimate in cause.parameters.items())
        yield f"{cause.effect}{form}: {values}"
    yield (
        f"Gap on the hold-out: {gap.before.total:.2f} before, {gap_left(diagnosis, causes):.2f} with {names}; "
        f"noise alone leaves {gap.noise_floor:.2f}."
    )
    budget = diagnosis.budget.shares if diagnosis.budget else {}
    if "structure" in budget and diagnosis.verdict == "partial":
        yield (
            f"{100.0 * budget['structure'].value:.0f} % of the squared gap is a model difference that no effect "
            "describes; it remains."
        )
    for cause in causes:
        if EFFECTS[cause.effect].stage == "perception":
            yield (
                f"{cause.effect} acts in the camera chain: a diagnosis takes it from the vehicle file; the simulated "
                "motion does not change, and trpac run renders pictures by its scenario."
            )
    if not (diagnosis.provenance.get("vehicle") or {}).get("sha256"):
        yield "The diagnosis does not name its vehicle file, so the file was not checked."
    yield (
        f"Simulate: `vehicle: {out}` in a scenario and trpac run SCENARIO.yaml --out DIR, or trpac.simulate in Python. "
        f"What is left: trpac gap diagnose --vehicle {out} with the same logs."
    )
    yield str(out)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the case, its sealed solution and the report.")],
    seed: Annotated[int, typer.Option(min=0, help="Draws the hidden effect, road, drives and noise.")] = 1,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Parallel fits; default: one per processor.")
    ] = None,
) -> None:
    """Demonstrate a diagnosis: hide an effect, diagnose the logs, show what was hidden.

    The effect is drawn from: accelerometer_bias, brake_drag,
    friction_offset, mass_offset, road_grade, torque_delay, torque_gain,
    torque_lag, tyre_relaxation, tyre_stiffness_offset, vehicle_speed_scale,
    wheel_radius_offset, wheel_speed_delay.

    Example: trpac gap demo --out out/gap_demo --seed 4

    Exit codes: 0 done, whether the diagnosis is right or not; 2 the folder cannot be used.
    """
    from joblib import cpu_count

    from scenarios.errors import ScenarioError
    from sim2real.demo import make_case, open_seal
    from sim2real.diagnose import diagnose_files
    from sim2real.reporting.report import rated, write_diagnosis

    command = "trpac gap demo"
    require_folder(command, out)
    console = Terminal()
    try:
        case = make_case(out, seed)
        _print_case(console, case)
        with bars() as progress:
            diagnosis = diagnose_files(
                case.vehicle,
                case.road,
                [str(path) for path in case.fit],
                str(case.holdout),
                seed=seed,
                jobs=jobs or cpu_count(),
                progress=progress,
            )
            _, report = write_diagnosis(rated(diagnosis), out)
        _print_step(console, "\n4. Result.", "A gap of 1 is sensor noise alone.")
        _summarise(console, diagnosis)
        _print_truth(console, case, open_seal(case), diagnosis)
    except (ScenarioError, OSError) as error:
        refuse(command, error)
    console.print(f"Report: {report}", soft_wrap=True)


def _print_step(console: Terminal, step: str, *sentences: str) -> None:
    """Print a step of the demonstration."""
    console.print(f"[bold]{step}[/bold] {' '.join(sentences)}\n", markup=True)


def _print_case(console: Terminal, case: Case) -> None:
    """Print what is hidden and what the diagnosis gets."""
    _print_step(
        console,
        "1. The hidden effect.",
        "One effect and its size are drawn at random and built into a car. The simulation of that car does not",
        "contain it. The car is driven three times over a road of dry, wet and icy stretches: accelerating, coasting,",
        "braking up to the friction limit. Its sensors are noisy.",
    )
    _print_step(
        console,
        "2. What the diagnosis gets:",
        f"the simulation's {case.vehicle.name} and {case.road.name}, two logs to fit to",
        f"({', '.join(path.name for path in case.fit)}), and {case.holdout.name}, to which no parameter is fitted.",
        f"Not {case.truth.name}: it is sealed with SHA-256 {case.seal}. All lie in {escape(str(case.truth.parent))}.",
    )
    _print_step(
        console,
        "3. The diagnosis",
        "runs the simulation along each log. Prediction errors beyond the sensor noise are the gap. Every effect of",
        "the library is fitted: how much of the gap does it explain, also on the hold-out?",
    )


def _print_truth(console: Terminal, case: Case, truth: Truth, diagnosis: Diagnosis) -> None:
    """Print the hidden effect beside the diagnosis."""
    from sim2real.reporting.report import estimate

    hidden = ", ".join(f"{name} {value:g}" for name, value in truth.parameters.items())
    _print_step(
        console,
        "\n5. Opening the seal.",
        f"{case.truth.name} is unchanged. Hidden was [bold]{truth.effect}[/bold] ({hidden}).",
        judge(truth.effect, diagnosis),
    )
    found = next((c for c in diagnosis.causes if c.effect == truth.effect), None)
    for name, interval in found.parameters.items() if found else ():
        if name not in truth.parameters:  # a form of the effect with more to it than was hidden
            continue
        value = truth.parameters[name]
        side = "inside" if interval.low <= value <= interval.high else "outside"
        console.print(
            f"   {name}: hidden {value:g}, found {estimate(interval)}; the truth is {side} the interval."
        )


def judge(hidden: str, diagnosis: Diagnosis) -> str:
    """The sentence, with markup, on whether the diagnosis found the hidden effect."""
    from scenarios.html_page import percent

    ranked = [c.effect for c in diagnosis.causes]
    if hidden not in ranked:
        return "The diagnosis did [red]not[/red] fit it."
    rank = ranked.index(hidden) + 1
    probability = diagnosis.causes[rank - 1].probability
    if rank == 1 and diagnosis.verdict in ("identified", "partial"):
        return f"The diagnosis is [green]right[/green], with a probability of {percent(probability)}."
    if any(hidden in group for group in diagnosis.ambiguous_with):
        return "The diagnosis has it among the effects that it [yellow]cannot separate[/yellow]."
    return (
        f"The diagnosis is [red]not right[/red]: it says '{diagnosis.verdict}' and ranks the hidden effect {rank} of "
        f"{len(ranked)}, with a probability of {percent(probability)}."
    )


def _summarise(console: Terminal, diagnosis: Diagnosis) -> None:
    """Print outcome, gap and first causes."""
    from scenarios.html_page import percent
    from sim2real.reporting.report import budget_parts, leading
    from sim2real.result import added

    gap = diagnosis.gap
    sizes = f"In units of the sensor noise: gap {gap.before.total:.2f}"
    if added(diagnosis):
        sizes += f", with {' and '.join(c.effect for c in added(diagnosis))} {gap.after.total:.2f}"
    sizes += f"; noise alone leaves {gap.noise_floor:.2f}"
    if parts := budget_parts(diagnosis):
        sizes += (
            f"\nof the squared gap: {', '.join(f'{part.name} {percent(part.share.value)}' for part in parts)}"
        )
    text = Text.assemble(diagnosis.sentence, "\n", (sizes, "dim"))
    colour = COLOURS[diagnosis.verdict]
    console.print(
        Panel(text, title=diagnosis.verdict.replace("_", " "), title_align="left", border_style=colour)
    )
    if leading(diagnosis):
        console.print(_cause_table(diagnosis))
    if diagnosis.next_manoeuvre is not None:
        console.print(f"To separate them: {diagnosis.next_manoeuvre.sentence}")
    if diagnosis.advice:
        console.print(f"To try: {diagnosis.advice}")
    for warning in diagnosis.warnings:
        console.print(warning, style="yellow")


def _how_to_apply(diagnosis: Diagnosis, vehicle: Path, written: Path) -> str:
    """The command that puts what was found into the car; empty where nothing is named."""
    from sim2real.apply import choices
    from sim2real.result import Verdict

    known = choices(diagnosis)
    if not known:
        return ""
    new = vehicle.with_name(f"{vehicle.stem}_with_effect.yaml")
    words = ["trpac", "gap", "apply", str(written), "--vehicle", str(vehicle), "--out", str(new)]
    pick = f" --effect {'|'.join(known)}" if diagnosis.verdict is Verdict.AMBIGUOUS else ""
    return f"To put it into the simulation: {shlex.join(words)}{pick}"


def _cause_table(diagnosis: Diagnosis) -> Table:
    from scenarios.html_page import number, percent
    from sim2real.reporting.report import estimate

    table = Table(title="Causes, most probable first", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("effect", no_wrap=True)
    table.add_column("prob.", justify="right", no_wrap=True)
    table.add_column("estimate (95 % interval)")
    table.add_column("gap", justify="right", no_wrap=True)
    table.add_column("decrease", justify="right", no_wrap=True)
    for cause in diagnosis.causes[:MOST_CAUSES]:
        values = "\n".join(f"{name} {estimate(value)}" for name, value in cause.parameters.items())
        table.add_row(
            cause.effect,
            percent(cause.probability),
            values,
            number(cause.gap_after, 2),
            percent(0.01 * cause.shrink_percent.value),
        )
    return table
