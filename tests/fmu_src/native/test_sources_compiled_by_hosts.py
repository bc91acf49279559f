"""Hosts that compile the unit's sources themselves get the library that the unit has."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy.build import build_platform_binary
from fmu_unit import Unit
from long import beyond
from native_drives import drive

from fmu_src.units import ROOT
from trpac_core.estimator_data import Method

pytestmark = pytest.mark.e2e

STEPS = 400
LIBRARY = Path("binaries") / "linux64" / "TrpacEstimator.so"


def by_fmpy(folder: Path) -> None:
    """By fmpy's cmake project, which reads the files' names in modelDescription.xml and knows no flags of ours."""
    if shutil.which("cmake") is None:
        pytest.skip("fmpy compiles by cmake (Debian: apt-get install cmake)")
    build_platform_binary(folder, all_warnings=True)


def by_the_documented_command(folder: Path) -> None:
    """By the command of docs/guide/unit/native.md."""
    (command,) = re.findall(
        r"^cc .*", (ROOT / "docs" / "guide" / "unit" / "native.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    subprocess.run(
        f"{command} && mv TrpacEstimator.so {shlex.quote(str(LIBRARY))}", shell=True, check=True, cwd=folder
    )


def trace(folder: Path) -> list[dict[str, float | bool]]:
    """All outputs over a drive with faults in its signals."""
    unit = Unit(folder)
    unit.set({"estimator.method": Method.ROBUST.value})
    unit.initialise()
    made = []
    for values, step_s in drive(3, STEPS):
        unit.step(values, step_s=step_s)
        made.append(unit.outputs())
    unit.free()
    return made


@pytest.mark.parametrize("compiled", beyond(1, [by_fmpy, by_the_documented_command]))
def test_the_sources_alone_make_a_library_of_the_same_bits(
    native_folder: Path, tmp_path: Path, compiled: Callable[[Path], None]
) -> None:
    folder = tmp_path / "unit"
    shutil.copytree(native_folder, folder)
    (folder / LIBRARY).unlink()
    compiled(folder)
    found = trace(folder)
    assert found == trace(native_folder)
    assert len({outputs["slip"] for outputs in found}) > STEPS / 4
