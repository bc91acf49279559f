"""Requirements of a unit on the Python that runs it."""

from __future__ import annotations

import ctypes
import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

CACHE_FOLDER = "trpac-fmu"
"""Folder of compiled code in the user's cache."""

LEAST_PYTHON = (3, 11)
"""Oldest Python that reads the unit's code."""

_KEPT: list[dict[str, Any]] = []
_ENDING_IN_ORDER: set[str] = set()


def keep(namespace: dict[str, Any]) -> None:
    """Keep a reference to the entry script's namespace.

    The wrapper runs the script once per instance and releases its namespace, of which it holds a borrowed reference.
    Without this the namespace is freed under the module, and a later instance fails or crashes.
    """
    _KEPT.append(namespace)


def end_in_order(resources: str) -> None:
    """Have the wrapper's state end before the wrapper does; once per unpacked unit, and on Linux only.

    At the process's end the C library first destroys the wrapper's shared pointer to its state, and then calls the
    wrapper's `finalizePythonInterpreter`, which assigns to the destroyed pointer and so corrupts the heap ("corrupted
    double-linked list"). Exit handlers run last in, first out: a handler that calls the same function and is
    registered now runs before the pointer is destroyed, and leaves it empty.
    """
    if resources in _ENDING_IN_ORDER or not sys.platform.startswith("linux"):
        return
    _ENDING_IN_ORDER.add(resources)
    for library in (Path(resources).parent / "binaries" / "linux64").glob("*.so"):
        try:
            # Only where the host has loaded it from here; it must then stay loaded until its exit handler has run.
            wrapper = ctypes.CDLL(str(library), os.RTLD_NOW | os.RTLD_NOLOAD | os.RTLD_NODELETE)
            at_exit = ctypes.CDLL(None).__cxa_atexit
            at_exit.argtypes = (ctypes.c_void_p,) * 3
            at_exit(ctypes.cast(wrapper.finalizePythonInterpreter, ctypes.c_void_p), None, None)
        except (OSError, AttributeError):
            continue  # another host, wrapper or C library: the exit is left as it is


class HostError(ImportError):
    """The host's Python cannot run the unit; the text says why, names this Python and says what to do."""


def interpreter() -> str:
    """The command of this Python; `sys.executable` may be the program that embeds it."""
    if Path(sys.executable).name.lower().startswith("python"):
        return sys.executable
    found = (Path(sys.prefix) / path for path in ("bin/python3", "python.exe"))
    return next((str(path) for path in found if path.is_file()), f"python{LEAST_PYTHON[0]}.{LEAST_PYTHON[1]}")


def require_packages(unit: str, modules: Mapping[str, str]) -> None:
    """Import the modules that the unit needs, or raise one error with all problems of this Python.

    A per cent sign is doubled: the wrapper hands the text to a printf-like logger.

    Raises
    ------
    HostError
        Where Python is too old, or packages are missing: names each package, the interpreter and the command that
        installs them. The text is also printed to standard error, because hosts show no log of a unit that could not
        be instantiated.
    """
    if sys.version_info < LEAST_PYTHON:
        _refuse(
            f"{unit} needs Python {LEAST_PYTHON[0]}.{LEAST_PYTHON[1]} or newer, and {_this_python()} runs it. Start "
            "the host with another Python: see 'What the host needs' in the unit's documentation."
        )
    problems, packages = [], []
    for module, package in modules.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            problems.append(f"{package} ({error})")
            packages.append(package)
    if problems:
        _refuse(
            f"{unit} needs Python packages that {_this_python()} cannot import: {'; '.join(problems)}. "
            f"Install them with: {interpreter()} -m pip install {' '.join(packages)}"
        )


def _this_python() -> str:
    version = ".".join(map(str, sys.version_info[:3]))
    return f"{interpreter()} (Python {version}, prefix {sys.prefix})"


def _refuse(message: str) -> None:
    print(message, file=sys.stderr)
    end_in_order(sys.path[0])  # where the wrapper has put its resources
    raise HostError(message.replace("%", "%%"))


def import_kept(package: str) -> None:
    """Import a package of the unit from a copy in the user's cache, where numba keeps its compiled code.

    Hosts unpack a unit to a new temporary folder for each run, and numba would compile for half a minute each time. The
    package's name holds the hash of its content, so that a copy never changes. Where the cache cannot be written the
    package is imported from the unit's folder.
    """
    if package in sys.modules:
        return
    carried = Path(__file__).parent.parent / package
    try:
        folder = _kept(carried)
    except OSError:
        folder = carried.parent
    sys.path.insert(0, str(folder))
    try:
        importlib.import_module(package)
    finally:
        sys.path.remove(str(folder))


def _kept(carried: Path) -> Path:
    """Folder of the copy; it is made elsewhere and then moved, because several processes may start at once."""
    root = Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache")
    folder = root / CACHE_FOLDER / carried.name
    if not (folder / carried.name).is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=folder.parent))
        try:
            shutil.copytree(carried, made / carried.name)
            os.replace(made, folder)
        except OSError:
            shutil.rmtree(made, ignore_errors=True)
            if not (folder / carried.name).is_dir():
                raise
    return folder
