"""The commands `trpac fmu`: build a unit, and examine one."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from fmu_src.kinds import KINDS, PYTHON
from trpac_cli.console import refuse, require_folder
from trpac_core.errors import TrpacError

if TYPE_CHECKING:
    from fmu_src.doctor import Examination
    from fmu_src.host_needs import HostNeeds

EXIT_PROBLEMS = 1
COLOURS = {"ok": "green", "note": "yellow", "problem": "red"}

app = typer.Typer(
    help="Co-simulation units: build one, check one, and list what a host needs.", no_args_is_help=True
)


@app.command()
def build(
    unit: Annotated[
        str,
        typer.Option(help="TrpacEstimator, TrpacEstimator4W, ReferencePlant or TorquePulses."),
    ] = "TrpacEstimator",
    kind: Annotated[
        str,
        typer.Option(
            metavar="|".join(KINDS),
            help="python: with the networks; the host needs Python.\n\nnative: in C, without pictures; the host needs "
            "nothing. Only the two estimators have this kind, and building one needs a C compiler: the program in CC, "
            "else cc, or the package ziglang, which compiles for all platforms.",
        ),
    ] = PYTHON,
    fmi: Annotated[int, typer.Option(metavar="2|3", help="Version of FMI; 3 for native units only.")] = 2,
    flat: Annotated[
        bool,
        typer.Option("--flat", help="Names with _ for dots, for tools that make structures of dotted names."),
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for the unit; made where it is missing.")] = Path("dist"),
) -> None:
    """Build a co-simulation unit, validate it with fmpy, and print its path.

    The file is UNIT.fmu, with _native, _fmi3 and _flat before the dot. The same sources give the same bytes.

    Example: trpac fmu build --unit TrpacEstimator4W --out dist

    For a real-time target: trpac fmu build --kind native

    For Simulink: trpac fmu build --kind native --flat

    Exit codes: 0 done, 2 unknown unit, kind or version, no C compiler, or no place to write.
    """
    import trpac

    require_folder("trpac fmu build", out)
    try:
        print(trpac.build_fmu(out, unit=unit, kind=kind, fmi=fmi, flat=flat))
    except (TrpacError, OSError) as error:
        refuse("trpac fmu build", error)


@app.command()
def doctor(
    file: Annotated[Path, typer.Argument(help="The unit, such as dist/TrpacEstimator.fmu.")],
    python: Annotated[
        str,
        typer.Option(
            help="The interpreter that the host will use; without it the one that runs this command."
        ),
    ] = sys.executable,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
    run: Annotated[
        bool, typer.Option("--run/--no-run", help="Run the unit's own code; --no-run reads the file only.")
    ] = True,
) -> None:
    """Check a unit, and list what a host needs to run it.

    It checks the archive and its checksums, every file against the hash that the build recorded (a damaged or
    exchanged network is named), modelDescription.xml with fmpy's validation, and the interpreter with its packages.
    Then it instantiates and steps the unit in a separate process, so that a crash is a line in the table. This runs
    code from the file with your rights: give --no-run for a file that you do not trust.

    The second table lists what each kind of host needs, with the paths of this interpreter.

    Example: trpac fmu doctor dist/TrpacEstimator.fmu

    Another interpreter: trpac fmu doctor dist/ReferencePlant.fmu --python /opt/rig/bin/python3

    Without running the unit's code: trpac fmu doctor unknown.fmu --no-run

    In a script: trpac fmu doctor dist/TrpacEstimator.fmu --json > doctor.json

    Exit codes: 0 fine, 1 problems, 2 unusable input.
    """
    from fmu_src.doctor import UnusableError, examine
    from fmu_src.host_needs import host_needs

    try:
        examined = examine(file, python, run, lambda text: print(text, file=sys.stderr))
    except UnusableError as error:
        refuse("trpac fmu doctor", error)
    needs = host_needs(examined.python, examined.native)
    if as_json:
        print(json.dumps(_json(file, examined, needs), indent=2))
    else:
        _show(Console(highlight=False), file, examined, needs)
    if not examined.fine:
        raise typer.Exit(EXIT_PROBLEMS)


def _json(file: Path, examined: Examination, needs: tuple[HostNeeds, ...]) -> dict[str, Any]:
    return {
        "file": str(file),
        "unit": examined.unit,
        "ran_its_code": examined.ran,
        "verdict": "fine" if examined.fine else "problems",
        "findings": [
            {"what": f.what, "state": f.state.value, "text": f.text, "mend": f.mend}
            for f in examined.findings
        ],
        "hosts": [{"host": need.host, "needs": list(need.needs)} for need in needs],
    }


def _show(console: Console, file: Path, examined: Examination, needs: tuple[HostNeeds, ...]) -> None:
    findings = Table(title=escape(f"{examined.unit} ({file})"), title_justify="left")
    for heading in ("check", "", "result"):
        findings.add_column(heading, overflow="fold")
    for finding in examined.findings:
        state = finding.state.value
        mend = f"\n[bold]{escape(finding.mend)}[/bold]" if finding.mend else ""
        findings.add_row(finding.what, f"[{COLOURS[state]}]{state}[/]", escape(finding.text) + mend)
    console.print(findings)
    hosts = Table(title="What a host needs", title_justify="left")
    hosts.add_column("host", overflow="fold", max_width=24)
    hosts.add_column("needs", overflow="fold")
    for need in needs:
        hosts.add_row(escape(need.host), escape("\n".join(need.needs)), end_section=True)
    console.print(hosts)
    console.print(f"{escape(examined.unit)}: {'fine' if examined.fine else 'problems'}.")
