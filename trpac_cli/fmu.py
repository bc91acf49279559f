"""The commands `trpac fmu`: units as other tools see them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from trpac_cli.console import refuse

if TYPE_CHECKING:
    from fmu_src.doctor import Examination
    from fmu_src.host_needs import HostNeeds

EXIT_PROBLEMS = 1
COLOURS = {"ok": "green", "note": "yellow", "problem": "red"}

app = typer.Typer(
    help="Co-simulation units: what is wrong with one, and what a host needs.", no_args_is_help=True
)


@app.callback()
def _root() -> None:
    """Group of the commands, so that `doctor` is a subcommand though it is the only one."""


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
        bool, typer.Option("--run/--no-run", help="Run the unit's own code; --no-run looks at the file only.")
    ] = True,
) -> None:
    """Examine a unit, and say what a host needs to run it.

    Looks at the archive and its checksums, at every file against the hash that the build recorded (a network that was
    damaged or exchanged is named), at modelDescription.xml with fmpy's validation, at the interpreter and its packages;
    then instantiates the unit and steps it in a process of its own, so that a crash is a line in the table. That runs
    code out of the file with your rights: give --no-run for a file that you do not trust.

    The second table tells what each kind of host needs, with this interpreter's paths filled in.

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
    for heading in ("looked at", "", "found"):
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
