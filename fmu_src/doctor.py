"""What is wrong with a unit's file, or with the Python that shall run it, found out without risk to the caller."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

from .contents import CONTENTS_FILE, ContentError, Contents, deviations, read_contents
from .host import LEAST_PYTHON
from .packaging import DAMAGED, SAFE_PATH, brief, damage, unpack_unit

RECORD = f"resources/{CONTENTS_FILE}"
DESCRIPTION = "modelDescription.xml"
MOST_UNPACKED_BYTES = 1 << 30
"""Archives that unpack to more are not opened [bytes]."""
PROBE_LIMIT_S, TRIAL_LIMIT_S = 60.0, 300.0
"""How long the interpreter may take to import the packages, and the unit to start: the plant compiles first [s]."""
MOST_NAMED = 5
"""Problems of one kind that a finding names; the rest are counted."""
TESTED_PYTHON = (3, 11)

PROBE = """
import importlib, json, sys, sysconfig
packages = {}
for module in sys.argv[1:]:
    try:
        packages[module] = [True, str(getattr(importlib.import_module(module), "__version__", ""))]
    except Exception as error:
        packages[module] = [False, str(error)]
library = "%s/%s" % (sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME"))
print(json.dumps({"executable": sys.executable, "version": list(sys.version_info[:3]), "prefix": sys.prefix,
                  "libpython": library, "packages": packages}))
"""


class State(Enum):
    """What a finding means."""

    OK = "ok"
    NOTE = "note"
    PROBLEM = "problem"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: what it is, how it is, and what to do about it."""

    what: str
    state: State
    text: str
    mend: str = ""


@dataclass(frozen=True)
class Python:
    """The interpreter that shall run the unit."""

    command: str
    version: tuple[int, ...] = ()
    prefix: str = ""
    libpython: str = ""
    packages: dict[str, tuple[bool, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Examination:
    """All findings on a unit, in the order in which they were made."""

    unit: str
    findings: tuple[Finding, ...]
    python: Python

    @property
    def fine(self) -> bool:
        """Whether no finding is a problem."""
        return all(finding.state is not State.PROBLEM for finding in self.findings)


class UnusableError(ValueError):
    """What was given is no unit, or no Python; the text says what was expected."""


def examine(path: Path, python: str = sys.executable) -> Examination:
    """Look at a unit's file and try it out in a child process.

    Parameters
    ----------
    path : Path
        The unit's archive.
    python : str
        The interpreter that shall run it.

    Raises
    ------
    UnusableError
        If the file is not an FMU, or the interpreter cannot be started.
    """
    contents, (*of_file, described) = look_at_file(path)
    intact = all(finding.state is not State.PROBLEM for finding in of_file)
    findings = [*of_file, described]
    modules = dict(contents.packages) if contents else None
    probed = _probe(python, sorted(modules or {}))
    findings += _python(probed, modules)
    if intact:
        findings.append(_trial(path, python))
    else:
        findings.append(Finding("trial", State.NOTE, "not run: the file is not what was built"))
    return Examination(contents.unit if contents else path.stem, tuple(findings), probed)


def look_at_file(path: Path) -> tuple[Contents | None, tuple[Finding, ...]]:
    """The record of the build, if it can be read, and findings on archive, contents and description.

    Raises
    ------
    UnusableError
        If the file is not an FMU.
    """
    with _opened(path) as archive:
        whole = _archive(archive)
        contents, recorded = _contents(archive)
    return contents, (whole, recorded, _description(path))


def _opened(path: Path) -> zipfile.ZipFile:
    try:
        archive = zipfile.ZipFile(path)
    except FileNotFoundError:
        raise UnusableError(
            f"{path}: no such file. Expected a unit: python build_fmu.py makes one."
        ) from None
    except (OSError, *DAMAGED) as error:
        raise UnusableError(
            f"{path}: cannot be opened as an FMU, which is a zip archive ({brief(error)})."
        ) from error
    size = sum(entry.file_size for entry in archive.infolist())
    if DESCRIPTION not in archive.namelist() or size > MOST_UNPACKED_BYTES:
        archive.close()
        why = f"unpacks to {size / 1e9:.1f} GB" if size > MOST_UNPACKED_BYTES else f"holds no {DESCRIPTION}"
        raise UnusableError(f"{path}: no FMU, it {why}.")
    return archive


def _archive(archive: zipfile.ZipFile) -> Finding:
    if damaged := damage(archive):
        return Finding("archive", State.PROBLEM, f"damaged at {damaged}", "Copy or build the unit again.")
    return Finding("archive", State.OK, f"{len(archive.namelist())} files, all checksums right")


def _contents(archive: zipfile.ZipFile) -> tuple[Contents | None, Finding]:
    """The record of the build, and whether the files are those of the record: networks first."""
    names = archive.namelist()
    if RECORD not in names:
        text = f"no {RECORD}: another tool's unit, or one of an older version; nothing to compare with"
        return None, Finding("contents", State.NOTE, text)
    try:
        contents = read_contents(archive.read(RECORD))
        there = {name for name in names if name != RECORD and not name.endswith("/")}
        every = sorted(there | set(contents.files), key=lambda name: (not name.endswith(".onnx"), name))
        problems = deviations(contents, every, archive.read)
    except (ContentError, *DAMAGED) as error:
        return None, Finding("contents", State.PROBLEM, brief(error), "Copy or build the unit again.")
    if problems:
        return contents, Finding("contents", State.PROBLEM, _some(problems), "Copy or build the unit again.")
    networks = [name for name in every if name.endswith(".onnx")]
    text = f"all {len(every)} files are those of build {contents.build}, version {contents.version}"
    return contents, Finding("contents", State.OK, f"{text}; networks: {len(networks)}")


def _some(problems: Sequence[str]) -> str:
    more = f"; and {len(problems) - MOST_NAMED} more" if len(problems) > MOST_NAMED else ""
    return "; ".join(problems[:MOST_NAMED]) + more


def _description(path: Path) -> Finding:
    from fmpy.validation import validate_fmu

    try:
        problems = [str(problem) for problem in validate_fmu(str(path))]
    except Exception as error:  # noqa: BLE001 - fmpy raises bare Exceptions, and a damaged file may raise anything
        problems = [brief(error)]
    if problems:
        return Finding("description", State.PROBLEM, _some(problems), "Build the unit again.")
    return Finding("description", State.OK, f"fmpy's validation finds nothing in {DESCRIPTION}")


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
    """What the interpreter is and can import; raises UnusableError if it cannot be started."""
    try:
        done = _run([python, "-c", PROBE, *modules], PROBE_LIMIT_S)
        said: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (OSError, ValueError, IndexError, subprocess.TimeoutExpired) as error:
        raise UnusableError(f"{python}: cannot be run as a Python interpreter ({error}).") from error
    packages = {module: (bool(good), str(text)) for module, (good, text) in said["packages"].items()}
    return Python(
        said["executable"] or python, tuple(said["version"]), said["prefix"], said["libpython"], packages
    )


def _python(python: Python, modules: dict[str, str] | None) -> list[Finding]:
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
        return [found, Finding("packages", State.NOTE, "the file does not say what it needs")]
    missing = [f"{modules[m]} ({why})" for m, (good, why) in python.packages.items() if not good]
    if missing:
        names = " ".join(modules[module] for module, (good, _) in python.packages.items() if not good)
        mend = f"{python.command} -m pip install {names}"
        return [found, Finding("packages", State.PROBLEM, f"cannot be imported: {'; '.join(missing)}", mend)]
    if not modules:
        return [found, Finding("packages", State.OK, "it needs none")]
    there = ", ".join(f"{modules[module]} {text}".strip() for module, (_, text) in python.packages.items())
    return [found, Finding("packages", State.OK, there)]


def _trial(path: Path, python: str) -> Finding:
    """Instantiate the unit and take steps, in a child process that may die."""
    temporary = tempfile.gettempdir()
    if not SAFE_PATH.fullmatch(str(Path(temporary).resolve())):
        text = f"hosts unpack to {temporary}, a path that crashes the unit's wrapper"
        mend = "Set TMPDIR to a path of letters, digits, spaces and . _ - only."
        return Finding("trial", State.PROBLEM, text, mend)
    folder = None
    try:
        folder = unpack_unit(path)
        done = _run([python, str(Path(__file__).with_name("trial.py")), str(folder)], TRIAL_LIMIT_S)
    except subprocess.TimeoutExpired:
        return Finding(
            "trial", State.PROBLEM, f"no answer within {TRIAL_LIMIT_S:g} s", "Report this as a fault."
        )
    except (OSError, ValueError) as error:
        return Finding(
            "trial", State.PROBLEM, f"cannot be unpacked: {error}", "Free or choose another TMPDIR."
        )
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
    return _judged(done)


def _judged(done: subprocess.CompletedProcess[str]) -> Finding:
    last_words = next((line for line in reversed(done.stderr.splitlines()) if line.strip()), "")
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        return Finding("trial", State.PROBLEM, f"the process died of {name}; {last_words}".strip("; "))
    try:
        said: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        text = f"the process ended with {done.returncode}: {last_words or 'nothing said'}"
        return Finding("trial", State.PROBLEM, text)
    if not said["ran"]:
        return Finding(
            "trial", State.PROBLEM, "; ".join(filter(None, [said["error"], *said["log"], last_words]))
        )
    if said["not_finite"] or done.returncode:
        return Finding(
            "trial", State.PROBLEM, f"outputs not finite: {said['not_finite']}; exit {done.returncode}"
        )
    if said["log"]:
        return Finding("trial", State.NOTE, f"runs, and says: {_some(said['log'])}")
    return Finding(
        "trial", State.OK, f"instantiates and steps, {said['step_us']:.0f} us a step; ends in order"
    )
