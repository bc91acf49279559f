"""Fixtures that several test files share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fmu_unit import Unit
from hypothesis import settings

from fmu_src.native.build import build_native
from fmu_src.native.library import CompilerError, compiler
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit

os.environ.setdefault("MPLBACKEND", "Agg")

EXIT_STATUS = pytest.StashKey[int]()


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Keep the verdict for `pytest_unconfigure`."""
    session.config.stash[EXIT_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End with the tests' verdict: pythonfmu's plain slaves, which some tests run, corrupt the heap at the end.

    See finding 10 in lab/2026-11-29_findings_on_pythonfmu.md; processes with the units alone end in order.
    """
    if EXIT_STATUS in config.stash:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash[EXIT_STATUS])


settings.register_profile("project", deadline=None)  # a busy machine is no fault of the code
settings.load_profile("project")


@pytest.fixture(autouse=True)
def same_folder(request: pytest.FixtureRequest) -> None:
    """Each test begins where pytest was called: libraries of co-simulation clients change the process's folder."""
    os.chdir(request.config.invocation_params.dir)


@pytest.fixture(scope="session")
def trpac_data() -> Path:
    """Folder of real pictures and logs."""
    folder = os.environ.get("TRPAC_DATA")
    if not folder:
        pytest.skip("needs real pictures or logs: set TRPAC_DATA to their folder")
    path = Path(folder)
    if not path.is_dir():
        pytest.skip(f"TRPAC_DATA={folder} is not a folder")
    return path


@pytest.fixture(scope="session")
def unit_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The unit TrpacEstimator, built once per test run."""
    return build_unit(UNITS["TrpacEstimator"], tmp_path_factory.mktemp("unit") / "TrpacEstimator.fmu")


@pytest.fixture(scope="session")
def unit_folder(unit_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same unit, unpacked."""
    return unpack_unit(unit_file, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture(scope="session")
def unit_folder_4w(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The unit TrpacEstimator4W, built and unpacked once per test run."""
    return _built("TrpacEstimator4W", tmp_path_factory)


@pytest.fixture(scope="session")
def plant_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The unit ReferencePlant, built and unpacked once per test run."""
    return _built("ReferencePlant", tmp_path_factory)


def _built(name: str, folders: pytest.TempPathFactory) -> Path:
    archive = build_unit(UNITS[name], folders.mktemp("unit") / f"{name}.fmu")
    return unpack_unit(archive, folders.mktemp("unpacked"))


@pytest.fixture
def open_unit(unit_folder: Path) -> Iterator[Callable[..., Unit]]:
    """Opens initialised instances of the unit, with parameters by name, and frees them after the test."""
    yield from _opener(unit_folder)


@pytest.fixture(scope="session")
def native_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native unit TrpacEstimator of this machine's compiler, built once per test run; skips where there is none."""
    try:
        compiler()
    except CompilerError as error:
        pytest.skip(str(error))
    target = tmp_path_factory.mktemp("native") / "TrpacEstimator_native.fmu"
    return build_native(UNITS["TrpacEstimator"].info, target, everywhere=False)


@pytest.fixture(scope="session")
def native_folder(native_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same unit, unpacked."""
    return unpack_unit(native_file, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture
def open_native(native_folder: Path) -> Iterator[Callable[..., Unit]]:
    """Opens instances of the native unit."""
    yield from _opener(native_folder)


@pytest.fixture(scope="session")
def native_folder_4w(native_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native unit TrpacEstimator4W, built and unpacked once per test run; skips where `native_file` does."""
    target = tmp_path_factory.mktemp("native") / "TrpacEstimator4W_native.fmu"
    build_native(UNITS["TrpacEstimator4W"].info, target, everywhere=False)
    return unpack_unit(target, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture
def open_native_4w(native_folder_4w: Path) -> Iterator[Callable[..., Unit]]:
    """Opens instances of the native unit TrpacEstimator4W."""
    yield from _opener(native_folder_4w)


@pytest.fixture(params=["python", "native"])
def open_any(request: pytest.FixtureRequest) -> Iterator[Callable[..., Unit]]:
    """The same for each kind of the unit, with Python and without."""
    folder = "unit_folder" if request.param == "python" else "native_folder"
    yield from _opener(request.getfixturevalue(folder))


@pytest.fixture
def open_4w(unit_folder_4w: Path) -> Iterator[Callable[..., Unit]]:
    """The same for TrpacEstimator4W."""
    yield from _opener(unit_folder_4w)


@pytest.fixture
def open_plant(plant_folder: Path) -> Iterator[Callable[..., Unit]]:
    """The same for ReferencePlant."""
    yield from _opener(plant_folder)


def _opener(folder: Path) -> Iterator[Callable[..., Unit]]:
    opened: list[Unit] = []

    def open_one(initialise: bool = True, **parameters: object) -> Unit:
        unit = Unit(folder)
        opened.append(unit)
        unit.set({name.replace("__", "."): value for name, value in parameters.items()})
        if initialise:
            unit.initialise()
        return unit

    yield open_one
    for unit in opened:
        unit.free()


@pytest.fixture(scope="session")
def ramp() -> np.ndarray:
    """Path of a withheld car that speeds up evenly, for its sensors; not to be changed."""
    from withheld_plant import CAR, roll

    from benchmarks.gap.withheld.generator.car import Road
    from benchmarks.gap.withheld.generator.world import nominal

    path = roll(nominal(CAR, Road()), 10.0, 16.0, 60.0)
    path.flags.writeable = False
    return path


@pytest.fixture(scope="session")
def log() -> pd.DataFrame:
    """Log of noise with all that a withheld car's has, for its loggers; not to be changed."""
    rng = np.random.default_rng(3)
    wheels = [f"wheel_speed_{place}_rad_s" for place in ("fl", "fr", "rl", "rr")]
    columns = ["wheel_torque_fl_nm", *wheels, "vehicle_speed_m_s", "accel_x_m_s2"]
    made = pd.DataFrame(rng.normal(20.0, 9.0, (6000, len(columns))), columns=columns)
    made.insert(0, "time_s", np.arange(1, 6001) / 250.0)
    return made.assign(position_m=20.0 * made["time_s"])
