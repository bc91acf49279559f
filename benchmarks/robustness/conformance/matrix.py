"""Runs the matrix: each client on each unit in a child process; a crash is a cell, and the next operation goes on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from fmu_src.kinds import NATIVE, PYTHON, build
from scenarios.fmu_client.unpacking import unpack_unit

from .cases import TITLES, Case, write_pictures
from .clients import CLIENTS
from .operations import OPERATIONS
from .outcome import Cell, Outcome

LONGEST_S = 240.0
"""A client that takes longer for one operation hangs: on a busy machine the plant alone compiles for a minute [s]."""
SLICE_S = 1.0
ROOT = Path(__file__).parents[3]


class Place(NamedTuple):
    """One cell's place."""

    client: str
    unit: str
    operation: str


class Bench(NamedTuple):
    """The built units and the pictures."""

    archives: Mapping[str, Path]
    folders: Mapping[str, Path]
    pictures: tuple[Path, Path]


def prepare(folder: Path, units: Iterable[str] = TITLES) -> Bench:
    """Build and unpack the units, and write the pictures."""
    archives = {unit: built(TITLES[unit], folder) for unit in units}
    folders = {unit: unpack_unit(archive, folder / archive.stem) for unit, archive in archives.items()}
    return Bench(archives, folders, write_pictures(folder))


def built(case: Case, folder: Path) -> Path:
    """The archive of a unit; that of the native one has the library of this machine only."""
    return build(case.unit, folder, kind=NATIVE if case.native else PYTHON, everywhere=False)


def run_cells(bench: Bench, client: str, unit: str, operations: Iterable[str]) -> dict[Place, Cell]:
    """The cells of one client and one unit, in one child or, after crashes, several."""
    left, cells = list(operations), {}
    while left:
        done, begun, end = _child(bench, client, unit, left)
        cells.update({Place(client, unit, operation): cell for operation, cell in done.items()})
        left = [operation for operation in left if operation not in done]
        if left:
            crashed = begun if begun in left else left[0]
            cells[Place(client, unit, crashed)] = Cell(Outcome.FAILED, end)
            left.remove(crashed)
    return cells


def _child(
    bench: Bench, client: str, unit: str, operations: list[str]
) -> tuple[dict[str, Cell], str | None, str]:
    """Cells, the operation that began last, and how the child ended."""
    pictures = map(str, bench.pictures)
    command = [sys.executable, "-m", f"{__package__}.cell", client, unit]
    command += [str(bench.archives[unit]), str(bench.folders[unit]), *pictures, *operations]
    with tempfile.TemporaryFile("w+") as said:
        # A session of its own, so that what a crashed client leaves running can be ended with it.
        child = subprocess.Popen(
            command, stdout=said, stderr=subprocess.DEVNULL, cwd=ROOT, start_new_session=True
        )
        code = _wait(child, said.fileno())
        end = f"hangs for {LONGEST_S:g} s" if code is None else f"the process ended with exit code {code}"
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        said.seek(0)
        lines = [json.loads(line) for line in said]
    cells = {line["ends"]: Cell(Outcome[line["outcome"]], line["reason"]) for line in lines if "ends" in line}
    begun = [line["begins"] for line in lines if "begins" in line]
    return cells, begun[-1] if begun else None, end


def _wait(child: subprocess.Popen[bytes], said: int) -> int | None:
    """Exit code; None where nothing more is said for too long. Time in which the machine stood still does not count."""
    size, waited_s = 0, 0.0
    while waited_s < LONGEST_S:
        with suppress(subprocess.TimeoutExpired):
            return child.wait(SLICE_S)
        waited_s += SLICE_S
        if os.fstat(said).st_size != size:
            size, waited_s = os.fstat(said).st_size, 0.0
    return None


def run(
    clients: Iterable[str] = CLIENTS, units: Iterable[str] = TITLES, operations: Iterable[str] = OPERATIONS
) -> dict[Place, Cell]:
    """All cells of these clients, units and operations."""
    units, operations = list(units), list(operations)
    cells: dict[Place, Cell] = {}
    with tempfile.TemporaryDirectory(prefix="trpac-conformance-") as name:
        bench = prepare(Path(name), units)
        for client in clients:
            for unit in units:
                cells |= run_cells(bench, client, unit, operations)
    return cells
