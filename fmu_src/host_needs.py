"""Requirements of each kind of host to run a unit, with the paths of a given interpreter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .doctor import Python


@dataclass(frozen=True)
class HostNeeds:
    """A kind of host, and its requirements, one sentence each."""

    host: str
    needs: tuple[str, ...]


def host_needs(python: Python, native: bool = False) -> tuple[HostNeeds, ...]:
    """Requirements by kind of host; those of Windows and of vendors' tools are from documents, not tested.

    A native unit has none, whatever the interpreter.
    """
    if native:
        return (HostNeeds("every host", ("Nothing but the C library of its system.",)),)
    programs = Path(python.command).parent
    return (
        HostNeeds(
            "every host",
            (
                "A temporary folder (TMPDIR, on Windows TMP) whose path has letters, digits, spaces and . _ - only: "
                "the wrapper crashes on others.",
            ),
        ),
        HostNeeds(
            "Python host (fmpy)",
            (f"Run it with {python.command}: the host's interpreter and packages are the unit's.",),
        ),
        HostNeeds(
            "C or C++ host on Linux (libcosim, ecos, own)",
            (
                _preload(python),
                f"PATH={programs}:$PATH (or PYTHONPATH to its packages), so that the embedded interpreter finds them.",
            ),
        ),
        HostNeeds(
            "OpenModelica, Simulink on Linux",
            (
                "The same two variables: start the program from a shell that has them set.",
                "Where Simulink crashes at a second run: "
                "set_param(model, 'DebugExecutionForFMUViaOutOfProcess', 'on').",
            ),
        ),
        HostNeeds(
            "Simulink, CarSim, OpenModelica on Windows",
            (
                "64 bits; the folder of python3.dll first on PATH, and PYTHONHOME or PYTHONPATH to the environment "
                "with the packages.",
            ),
        ),
        HostNeeds("any host on macOS", ("Not possible: the unit holds no library for macOS.",)),
    )


def _preload(python: Python) -> str:
    library = Path(python.libpython)
    if ".so" in library.name and library.is_file():
        return f"LD_PRELOAD={library}, since the wrapper links no libpython."
    return (
        f"LD_PRELOAD of a shared libpython, and {python.command} has none: install a Python that was built with "
        "--enable-shared."
    )
