"""The clients of the matrix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from . import transports
from .cases import Case
from .cosim import Cosim
from .ecos import Ecos
from .operations import Host


class Runner(Protocol):
    """A client on one unit."""

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError or NotAsExpectedError."""


class Client(NamedTuple):
    """A column of the matrix; `open` takes case, archive, folder of the unpacked unit, and two pictures."""

    title: str
    package: str
    open: Callable[[Case, Path, Path, tuple[Path, Path]], Runner]


CLIENTS = {
    "fmpy": Client("fmpy", "fmpy", lambda c, _, f, p: Host(transports.Fmpy, c, f, p)),
    "fmpy_apart": Client(
        "fmpy, own process", "fmpy", lambda c, _, f, p: Host(transports.fmpy_apart, c, f, p)
    ),
    "c": Client(
        "C program",
        "fmpy",
        lambda c, _, f, p: Host(transports.c_alone if c.native else transports.c_program, c, f, p),
    ),
    "libcosimpy": Client("libcosimpy", "libcosimpy", lambda c, a, _, p: Cosim(c, a, p)),
    "ecospy": Client("ecospy", "ecospy", lambda c, a, _, p: Ecos(c, a, p)),
    "proxyfmu": Client("ecospy, proxyfmu", "ecospy", lambda c, a, _, p: Ecos(c, a, p, apart=True)),
}
"""By short name."""
