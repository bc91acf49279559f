"""Examination of a unit's file and of the Python that runs it; the unit's code runs in a child process."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from inspect import getsource
from pathlib import Path
from typing import Any

from scenarios.fmu_client.archives import Archive, UnitFileError, opened_archive
from scenarios.fmu_client.unpacking import SAFE_PATH, unpack_unit
from trpac_core.files import parse_json, quoted

from .contents import CONTENTS_FILE, ContentError, Contents, deviations, read_contents
from .host import LEAST_PYTHON
from .trial import end_with_parent
from .units import UNITS

RECORD = f"resources/{CONTENTS_FILE}"
DESCRIPTION = "modelDescription.xml"
ENTRY = "resources/slavemodule.txt"
"""File that names the script of a unit with Python."""
BUILD_3 = "sources/buildDescription.xml"
"""File of a unit for FMI 3.0; this project's are all native."""
KNOWN_PACKAGES = {module: package for slave in UNITS.values() for module, package in slave.packages.items()}
"""Modules that units of this project need, and their packages; no other module that a file names is imported."""
PROBE_LIMIT_S, TRIAL_LIMIT_S = 60.0, 300.0
"""Longest time to import the packages, and to start the unit, where the plant compiles first [s]."""
MOST_NAMED, LONGEST_PROBLEM = 5, 400
"""Problems of one kind that a finding names, and characters of one; further problems are counted."""
TESTED_PYTHON = (3, 11)
ISOLATED = ("-I",)
"""Python's isolated mode: without the current folder, PYTHONPATH and the user's own packages. It includes -P, which
Pythons before 3.11 do not have."""
UNREADABLE_ANSWER = (ValueError, IndexError, KeyError, TypeError, AttributeError)
"""Exceptions where the answer of a child process cannot be read."""

PROBE = f"""
import ctypes, importlib, json, sys, sysconfig
{getsource(end_with_parent)}
end_with_parent()
packages = {{}}
for module in sys.argv[1:]:
    try:
        packages[module] = [True, str(getattr(importlib.import_module(module), "__version__", ""))]
    except Exception as error:
        packages[module] = [False, str(error)]
library = "%s/%s" % (sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME"))
print(json.dumps({{"executable": sys.executable, "version": list(sys.version_info[:3]), "prefix": sys.prefix,
                  "libpython": library, "packages": packages}}))
"""
"""Program of the child process: prints the interpreter, and which of the modules in its arguments it can import."""


class State(Enum):
    """Severity of a finding."""

    OK = "ok"
    NOTE = "note"
    PROBLEM = "problem"


@dataclass(frozen=True)
class Finding:
    """A result of the examination: subject, state, text and remedy."""

    what: str
    state: State
    text: str
    mend: str = ""


@dataclass(frozen=True)
class Python:
    """The interpreter that runs the unit."""

    command: str
    version: tuple[int, ...] = ()
    prefix: str = ""
    libpython: str = ""
    packages: dict[str, tuple[bool, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Examination:
    """All findings on a unit, in their order."""

    unit: str
    findings: tuple[Finding, ...]
    python: Python
    ran: bool
    """Whether the unit's code has been run."""
    native: bool = False
    """Whether the unit needs no Python."""

    @property
    def fine(self) -> bool:
        """Whether no finding is a problem."""
        return all(finding.state is not State.PROBLEM for finding in self.findings)


class UnusableError(ValueError):
    """The file is no unit, or the command no Python; the text says what was expected."""


def examine(
    path: Path,
    python: str = sys.executable,
    run: bool = True,
    notify: Callable[[str], None] = lambda _: None,
) -> Examination:
    """Findings on a unit's file, and on a trial in a child process, which runs the unit's own code.

    Parameters
    ----------
    path : Path
        The unit's archive.
    python : str
        The interpreter that runs it.
    run : bool
        Whether to make the trial; without it the unit's code is not run.
    notify : callable
        Called with a sentence before the unit's code is run.

    Raises
    ------
    UnusableError
        If the file is not an FMU, or the interpreter cannot be started.
    """
    contents, (*of_file, described) = examine_file(path)
    findings = [*of_file, described]
    named = set(contents.packages) if contents else set()
    if unknown := sorted(named - set(KNOWN_PACKAGES)):
        text = (
            f"names modules that no unit of this project needs, and that were not imported: {_some(unknown)}"
        )
        of_file.append(Finding("record", State.PROBLEM, text, "Build the unit again."))
        findings.append(of_file[-1])
    modules = sorted(named & set(KNOWN_PACKAGES))
    native = contents is not None and ENTRY not in contents.files
    probed = _probe(python, modules)
    fmi_3 = contents is not None and BUILD_3 in contents.files
    if native:
        text = f"it needs none: it is native code for FMI {'3.0' if fmi_3 else '2.0'}"
        findings.append(Finding("python", State.OK, text))
    else:
        findings += _python(probed, modules if contents else None)
    intact = all(finding.state is not State.PROBLEM for finding in of_file)
    if intact and run:
        notify(
            f"The unit's own code now runs with your rights: {quoted(path)}. Use --no-run to prevent this."
        )
        findings.append(_trial(path, python))
    else:
        why = "the file is not what was built" if run else "--no-run was given"
        findings.append(Finding("trial", State.NOTE, f"not run: {why}"))
    name = contents.unit if contents else path.stem
    return Examination(quoted(name), tuple(findings), probed, intact and run, native)


def examine_file(path: Path) -> tuple[Contents | None, tuple[Finding, ...]]:
    """The record of the build, None where it cannot be read, and findings on archive, contents and description.

    Raises
    ------
    UnusableError
        If the file is not an FMU.
    """
    try:
        with opened_archive(path) as archive:
            if DESCRIPTION not in archive.names:
                raise UnusableError(f"{archive.name}: no FMU, it holds no {DESCRIPTION}.")
            whole = _archive(archive)
            contents, recorded = _contents(archive)
    except UnitFileError as error:
        raise UnusableError(str(error)) from error
    if whole.state is State.PROBLEM:
        return contents, (
            whole,
            recorded,
            Finding("description", State.NOTE, "not checked: see archive"),
        )
    return contents, (whole, recorded, _description(path))


def _archive(archive: Archive) -> Finding:
    if damaged := archive.damage():
        return Finding("archive", State.PROBLEM, f"damaged at {damaged}", "Copy or build the unit again.")
    return Finding("archive", State.OK, f"{len(archive.names)} files, all checksums correct")


def _contents(archive: Archive) -> tuple[Contents | None, Finding]:
    """The record of the build, and the finding on whether the files are those of the record, networks first."""
    names = archive.names
    if RECORD not in names:
        text = f"no {RECORD}: another tool's unit, or one of an older version; nothing to compare with"
        return None, Finding("contents", State.NOTE, text)
    try:
        contents = read_contents(archive.read(RECORD))
        there = {name for name in names if name != RECORD and not name.endswith("/")}
        every = sorted(there | set(contents.files), key=lambda name: (not name.endswith(".onnx"), name))
        problems = deviations(contents, every, archive.sha256)
    except (ContentError, UnitFileError) as error:
        return None, Finding("contents", State.PROBLEM, str(error), "Copy or build the unit again.")
    if problems:
        return contents, Finding("contents", State.PROBLEM, _some(problems), "Copy or build the unit again.")
    networks = [name for name in every if name.endswith(".onnx")]
    text = f"all {len(every)} files are those of build {quoted(contents.build)}, version {quoted(contents.version)}"
    return contents, Finding("contents", State.OK, f"{text}; networks: {len(networks)}")


def _some(problems: Sequence[str]) -> str:
    more = f"; and {len(problems) - MOST_NAMED} more" if len(problems) > MOST_NAMED else ""
    return "; ".join(quoted(problem, LONGEST_PROBLEM) for problem in problems[:MOST_NAMED]) + more


def _description(path: Path) -> Finding:
    from fmpy.validation import validate_fmu

    try:
        problems = [str(problem) for problem in validate_fmu(str(path))]
    except Exception as error:  # noqa: BLE001 - fmpy raises bare Exceptions, and a damaged file may raise anything
        problems = [quoted(error)]
    if problems:
        return Finding("description", State.PROBLEM, _some(problems), "Build the unit again.")
    return Finding("description", State.OK, f"fmpy's validation finds no problem in {DESCRIPTION}")


def _run(command: list[str], limit_s: float) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
        timeout=limit_s,
        stdin=subprocess.DEVNULL,
    )


def _probe(python: str, modules: list[str]) -> Python:
    """Version, paths and importable modules of the interpreter; raises UnusableError if it cannot be started."""
    try:
        done = _run([python, *ISOLATED, "-c", PROBE, *modules], PROBE_LIMIT_S)
        answer = parse_json(done.stdout.splitlines()[-1], "its answer")
        packages = {module: (bool(good), quoted(text)) for module, (good, text) in answer["packages"].items()}
        return Python(
            answer["executable"] or python,
            tuple(answer["version"]),
            answer["prefix"],
            answer["libpython"],
            packages,
        )
    except (OSError, *UNREADABLE_ANSWER, subprocess.TimeoutExpired) as error:
        raise UnusableError(
            f"{quoted(python)}: cannot be run as a Python interpreter ({quoted(error)})."
        ) from error


def _python(python: Python, modules: list[str] | None) -> list[Finding]:
    version = ".".join(map(str, python.version))
    text = f"{python.command}, version {version}, prefix {python.prefix}"
    least, tested = (".".join(map(str, v)) for v in (LEAST_PYTHON, TESTED_PYTHON))
    if python.version < LEAST_PYTHON:
        found = Finding("python", State.PROBLEM, text, f"The unit needs Python {least} or newer.")
    elif python.version[:2] != TESTED_PYTHON:
        found = Finding("python", State.NOTE, f"{text}; the unit was tested with {tested} alone")
    else:
        found = Finding("python", State.OK, text)
    if modules is None:
        return [found, Finding("packages", State.NOTE, "the file has no list of the packages that it needs")]
    missing = {KNOWN_PACKAGES[m]: why for m, (good, why) in python.packages.items() if not good}
    if missing:
        mend = f"{python.command} -m pip install {' '.join(missing)}"
        reasons = "; ".join(f"{package} ({why})" for package, why in missing.items())
        text = f"cannot be imported without PYTHONPATH and the user's own packages: {reasons}"
        return [found, Finding("packages", State.PROBLEM, text, mend)]
    if not modules:
        return [found, Finding("packages", State.OK, "it needs none")]
    there = ", ".join(
        f"{KNOWN_PACKAGES[module]} {text}".strip() for module, (_, text) in python.packages.items()
    )
    return [found, Finding("packages", State.OK, there)]


def _trial(path: Path, python: str) -> Finding:
    """The finding on instantiating and stepping the unit in a child process."""
    temporary = tempfile.gettempdir()
    if not SAFE_PATH.fullmatch(str(Path(temporary).resolve())):
        text = f"hosts unpack to {temporary}, a path that crashes the unit's wrapper"
        mend = "Set TMPDIR to a path of letters, digits, spaces and . _ - only."
        return Finding("trial", State.PROBLEM, text, mend)
    folder = None
    try:
        folder = unpack_unit(path)
        script = str(Path(__file__).with_name("trial.py"))
        done = _run([python, *ISOLATED, script, str(folder)], TRIAL_LIMIT_S)
    except subprocess.TimeoutExpired:
        return Finding(
            "trial", State.PROBLEM, f"no answer within {TRIAL_LIMIT_S:g} s", "Report this as a fault."
        )
    except (OSError, UnitFileError) as error:
        return Finding("trial", State.PROBLEM, quoted(error), "Free or choose another TMPDIR.")
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
    return _judged(done)


def _judged(done: subprocess.CompletedProcess[str]) -> Finding:
    last_words = quoted(next((line for line in reversed(done.stderr.splitlines()) if line.strip()), ""))
    if done.returncode < 0:
        names = (one.name for one in signal.Signals if one == -done.returncode)
        text = f"the process died of {next(names, f'signal {-done.returncode}')}; {last_words}".strip("; ")
        return Finding("trial", State.PROBLEM, text)
    try:
        answer: dict[str, Any] = parse_json(done.stdout.splitlines()[-1], "its answer")
        log = _some(answer["log"])
        if not answer["ran"]:
            text = "; ".join(filter(None, [quoted(answer["error"], LONGEST_PROBLEM), log, last_words]))
            return Finding("trial", State.PROBLEM, text)
        if answer["not_finite"] or done.returncode:
            text = f"outputs not finite: {quoted(answer['not_finite'])}; exit {done.returncode}"
            return Finding("trial", State.PROBLEM, text)
        text = f"instantiates and steps, {answer['step_us']:.0f} us a step; ends in order"
    except UNREADABLE_ANSWER:
        text = f"the process ended with {done.returncode}: {last_words or 'no message'}"
        return Finding("trial", State.PROBLEM, text)
    if log:
        return Finding("trial", State.NOTE, f"runs, with messages: {log}")
    return Finding("trial", State.OK, text)
