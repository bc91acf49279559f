"""What the command line says: units survive, a missing package is one sentence, the version is told."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import click
import pytest
import typer
from rich.text import Text
from typer.testing import CliRunner

from fmu_src.kinds import KINDS
from trpac_cli.main import app
from trpac_core.estimator_data import Method


def commands(command: click.Command, path: str = "trpac"):
    """Every command with its path."""
    yield path, command
    for name, below in getattr(command, "commands", {}).items():
        yield from commands(below, f"{path} {name}")


WORDS = [
    pytest.param(text, id=f"{path} {parameter.name if parameter else ''}".strip())
    for path, command in commands(typer.main.get_command(app))
    for parameter, text in (
        (None, command.help),
        *((parameter, getattr(parameter, "help", None)) for parameter in command.params),
    )
    if text and "[" in text
]


@pytest.mark.parametrize("text", WORDS)
def test_units_in_brackets_are_no_markup(text):
    assert Text.from_markup(text).plain == text.replace("\\[", "[")


def test_units_in_tables_are_no_markup():
    shown = CliRunner().invoke(app, ["gains"]).output
    assert "C_x [kN]" in shown
    assert "K [1/s]" in shown


@pytest.mark.parametrize("command", ["run", "estimate", "hil"])
def test_each_command_explains_the_methods_and_refuses_another(command, tmp_path):
    runner = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"})
    text = " ".join(runner.invoke(app, [command, "--help"]).output.split())
    for method in Method:
        assert f"{method.label}: " in text
    given = {"run": ["paper_simulation"], "estimate": ["drive.csv"], "hil": []}[command]
    done = runner.invoke(app, [command, *given, "--method", "printed", "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert done.stderr.strip() == (
        f"trpac {command}: estimator method is 'printed'; expected one of as_printed, dife, robust."
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("command", "given"), [("run", ["paper_simulation"]), ("hil", [])])
def test_the_kinds_of_the_unit_are_explained_and_another_or_a_file_beside_it_is_refused(
    command, given, tmp_path
):
    runner = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"})
    text = " ".join(runner.invoke(app, [command, "--help"]).output.split())
    for kind in KINDS:
        assert f"{kind}: " in text
    for more, words in (
        (["--unit", "rust"], "--unit rust: expected python or native."),
        (["--unit", "native", "--fmu", "any.fmu"], "--unit is for a unit that is built, and --fmu names one"),
    ):
        done = runner.invoke(app, [command, *given, *more, "--out", str(tmp_path / "out")])
        assert done.exit_code == 2
        assert words in done.stderr
        assert not (tmp_path / "out").exists()


def test_the_version_is_told():
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.output) == (0, f"trpac {version('trpac-fmu')}\n")


@pytest.mark.parametrize(
    ("missing", "arguments"), [("typer", ["--help"]), ("dask", ["sweep", "no.yaml", "--out", "no"])]
)
def test_a_missing_package_is_one_sentence(missing, arguments, tmp_path):
    code = f"import sys; sys.modules[{missing!r}] = None; from trpac_cli.entry import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert run.stderr.startswith(
        f"trpac: needs the package '{missing}', which is not installed: pip install "
    )
    assert run.stderr.count("\n") == 1


def test_a_command_that_is_ended_from_outside_leaves_its_folder_as_it_was(tmp_path):
    code = (
        "import os, signal, sys, time\nfrom pathlib import Path\nimport trpac_cli.main\n"
        "from scenarios.whole_files import written_whole\nfrom trpac_cli.entry import main\n"
        "def app():\n"
        "    with written_whole(Path(sys.argv[1])) as made:\n"
        "        (made / 'log.csv').write_text('half')\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n        time.sleep(60)\n"
        "trpac_cli.main.app = app\nmain()"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "new" / "out"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 143, run.stderr
    assert not list(tmp_path.iterdir())
    assert run.stderr == ""
