"""A run resumed from a saved state is the run that was not interrupted, bit for bit, pictures included."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from long import beyond

from benchmarks.robustness.conformance.cases import CASES, write_pictures
from benchmarks.robustness.conformance.operations import Unit
from benchmarks.robustness.conformance.transports import Fmpy, fmpy_apart

pytestmark = pytest.mark.e2e

STEPS, FRAME_STEPS = 300, 50
CUTS = (1, 150, 237)
"""After the first step, at a picture and between two."""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two roads that look different; they take turns."""
    return write_pictures(tmp_path_factory.mktemp("pictures"))


def inputs_at(unit: str, step: int, pictures: tuple[Path, Path]) -> dict[str, Any]:
    """A car that is driven and braked in turn, with a new picture every 50 ms."""
    factor = 1.0 + 0.1 * math.sin(0.05 * step)
    drive = {n: v if n == "vehicle_speed" else v * factor for n, v in CASES[unit].drive.items()}
    frame = step // FRAME_STEPS
    return drive | ({"image_path": str(pictures[frame % 2])} if step % FRAME_STEPS == 0 else {})


@contextmanager
def client(folder: Path, apart: bool = False) -> Iterator[Unit]:
    """An initialised instance in fmpy, in this process or its own."""
    transport = fmpy_apart(folder) if apart else Fmpy(folder)
    unit = Unit(transport, folder)
    unit.initialise()
    yield unit
    unit.call("free")
    transport.close()


def drive(unit: Unit, name: str, pictures: tuple[Path, Path], start: int, stop: int) -> list[dict[str, Any]]:
    outputs = tuple(n for n, v in unit.variables.items() if v.causality == "output")
    trace = []
    for step in range(start, stop):
        unit.step(inputs_at(name, step, pictures), count=1)
        trace.append(unit.read(outputs))
    return trace


@pytest.mark.parametrize("name", beyond(1, ["TrpacEstimator", "TrpacEstimator4W"]))
def test_resumed_in_another_process_it_goes_on_as_if_nothing_had_been(
    name: str, pictures: tuple[Path, Path], unit_folder: Path, unit_folder_4w: Path
) -> None:
    folder = unit_folder_4w if name.endswith("4W") else unit_folder
    states = {}
    with client(folder) as unit:
        whole = []
        for start, stop in zip((0, *CUTS), (*CUTS, STEPS), strict=True):
            whole += drive(unit, name, pictures, start, stop)
            unit.call("save", "0")
            states[stop] = unit.call("serialise", "0").value
            unit.call("drop", "0")
    with client(folder) as unit:
        assert drive(unit, name, pictures, 0, STEPS) == whole, "saving changes nothing"
    confidence = [v for n, v in whole[-1].items() if n.split(".")[0] == "image_confidence"]
    assert max(confidence) > 0.0, "pictures count in this run"
    for cut in CUTS:
        with client(folder, apart=True) as unit:
            unit.call("deserialise", "0", states[cut])
            unit.call("restore", "0")
            assert drive(unit, name, pictures, cut, STEPS) == whole[cut:]
