"""Damaged serialised states, given to a unit that drives: each must be refused and told, or be the state as it was."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.robustness.conformance.cases import CASES, write_pictures
from benchmarks.robustness.conformance.operations import Unit
from benchmarks.robustness.conformance.outcome import NotAsExpectedError
from benchmarks.robustness.conformance.transports import Fmpy

from .mutations import TEXT, Rng, damaged

UNIT_OF = {f"state_{unit}": unit for unit in CASES}
"""Unit by the kind's name."""
REFUSED = "the state was not restored"
BEFORE, AFTER = 40, 5
"""Steps of the saved run, and of each run that goes on."""


class Patient:
    """A unit with a saved state, and what it gives before and after it."""

    def __init__(self, folder: Path, work: Path) -> None:
        self._case, self._folder, self._transport = CASES[folder.name], folder, Fmpy(folder)
        unit = self._fresh(0)
        unit.step(self._case.inputs(write_pictures(work)[0]), BEFORE)
        unit.call("save", "0")
        self.good = bytes.fromhex(unit.call("serialise", "0").value)
        unit.call("drop", "0")
        self._saved, self._gone_on = self._run_on(unit)
        unit.call("free")

    def _fresh(self, slot: int) -> Unit:
        unit = Unit(self._transport, self._folder, slot)
        unit.initialise()
        return unit

    def _run_on(self, unit: Unit) -> tuple[dict[str, Any], dict[str, Any]]:
        """All variables now and after a few steps of what the unit has as inputs."""
        names = tuple(unit.variables)
        now = unit.read(names)
        unit.step(count=AFTER)
        return now, unit.read(names)

    def judge(self, state: bytes) -> str | None:
        """What is wrong after such a state; None where all is as it must be."""
        unit = self._fresh(1)
        try:
            return self._judge(unit, state)
        except NotAsExpectedError as error:
            return str(error)
        finally:
            unit.call("free")

    def _judge(self, unit: Unit, state: bytes) -> str | None:
        unit.step(self._case.drive, AFTER)
        before = unit.read(tuple(unit.variables))
        unit.call("deserialise", "1", state.hex())
        unit.call("restore", "1")
        unit.call("drop", "1")
        refused = any(REFUSED in line for line in unit.log)
        now, gone_on = self._run_on(unit)
        if refused:
            return None if now == before else "refused, and the unit is another than before"
        if now != self._saved or gone_on != self._gone_on:
            return "restored, and not what was saved"
        return None


def damaged_states(folder: Path, work: Path, seed: int, numbers: range) -> Iterator[tuple[int, str | None]]:
    """Number and finding of each damaged state of the unit unpacked in `folder`."""
    patient = Patient(folder, work)
    right = patient.judge(patient.good)
    if right:
        raise RuntimeError(f"the state as it was saved: {right}")
    for number in numbers:
        yield number, None
        rng: Rng = np.random.default_rng([seed, number])
        finding = patient.judge(damaged(TEXT, patient.good, rng))
        if finding:
            yield number, finding
