"""Every kind of file that the project reads: a good one, how it is read, which errors are clear ones, what is right."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from fmu_src.doctor import State, UnusableError, examine_file
from fmu_src.units import ROOT
from scenarios.library import networks_folder

from .forked import forked_readers
from .mutations import BINARY, TEXT, Rng, damaged

LONGEST_ERROR = 20_000
"""A longer error is no clear one [characters]."""


@dataclass(frozen=True)
class Kind:
    """One kind of file.

    Parameters
    ----------
    make : callable
        Writes a good file into a folder and returns its path.
    read : callable
        Reads a file; its value is compared with that of the good file where `exact` is set.
    errors : callable
        The classes of clear errors, imported when asked for.
    text : bool
        Whether it is damaged as text, too.
    exact : bool
        Whether the format protects its content, so that what can be read must be right.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    errors: Callable[[], tuple[type[Exception], ...]]
    text: bool = False
    exact: bool = False

    @property
    def ways(self) -> tuple[Callable[[bytes, Rng], bytes], ...]:
        """How it is damaged."""
        return TEXT if self.text else BINARY


def judge(kind: Kind, path: Path, right: Any) -> str | None:
    """What is wrong with how a damaged file is read; None where it is refused clearly, or read."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = kind.read(path)
    except kind.errors() as error:
        text = str(error)
        if not text.strip() or len(text) > LONGEST_ERROR:
            return f"an error of {len(text)} characters"
        return None
    except Exception as error:  # noqa: BLE001 - whatever else comes is the finding
        return f"{type(error).__name__}: {str(error)[:300]}"
    if kind.exact and not _same(found, right):
        return "read, with another content"
    return None


def _same(found: Any, right: Any) -> bool:
    if isinstance(right, np.ndarray):
        return found.shape == right.shape and bool(np.array_equal(found, right))
    return bool(found == right)


# Pictures


def _picture(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        rng = np.random.default_rng(3)
        image = np.full((120, 192, 3), 190, np.uint8)
        image[50:] = rng.integers(60, 140, (70, 192, 1), dtype=np.uint8)
        cv2.imwrite(str(folder / f"good{suffix}"), image)
        return folder / f"good{suffix}"

    return make


def _decode(path: Path) -> Any:
    from trpac_core.vision.images import decode_image

    return decode_image(path)


def _picture_errors() -> tuple[type[Exception], ...]:
    from trpac_core.vision.images import ImageError

    return (ImageError,)


# Configuration


def _shipped(*parts: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        return Path(shutil.copy(ROOT.joinpath(*parts), folder / parts[-1]))

    return make


def _scenario(folder: Path) -> Path:
    """A scenario among the files that it names."""
    for name in ("roads", "vehicles", "manoeuvres", "cameras"):
        shutil.copytree(ROOT / "scenarios" / name, folder / name, dirs_exist_ok=True)
    return Path(shutil.copy(ROOT / "scenarios" / "paper_simulation.yaml", folder / "scenario.yaml"))


def _load(name: str, module: str = "scenarios.files") -> Callable[[Path], Any]:
    def read(path: Path) -> Any:
        __import__(module)
        return getattr(sys.modules[module], name)(path)

    return read


def _sweep(folder: Path) -> Path:
    """A sweep beside the scenario that it names."""
    _scenario(folder)
    (folder / "sweeps").mkdir()
    shutil.copy(folder / "scenario.yaml", folder / "paper_simulation.yaml")
    return Path(shutil.copy(ROOT / "scenarios" / "sweeps" / "paper_simulation.yaml", folder / "sweeps"))


def _sweep_part(folder: Path) -> Path:
    """What a sweep that goes on finds of a finished run."""
    from scenarios.sweep.store import Parts

    row = dict.fromkeys(("run", "number", "seed", "stretch"), 0) | {"surface": "dry", "estimator": "DE"}
    parts = Parts(folder / "out", {})
    parts.open()
    parts.keep(0, [{**row, "parameter": "", "error": 0.5}] * 3, 1.5)
    return folder / "out" / "parts" / "0000000.json"


def _scenario_errors() -> tuple[type[Exception], ...]:
    from scenarios.errors import ScenarioError

    return (ScenarioError,)


def _read_part(path: Path) -> Any:
    from scenarios.sweep.store import Parts

    parts = Parts(path.parents[1], {})
    parts.open()
    return parts.table(), parts.cpu_s()


# Logs


def _drive() -> dict[str, Any]:
    """The columns of a short drive."""
    rng, n = np.random.default_rng(1), 250
    time_s = np.arange(n) * 0.01
    columns = {"time_s": time_s}
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_torque_{wheel}_nm"] = 400.0 * np.cos(2.0 * time_s) + rng.normal(size=n)
        columns[f"wheel_speed_{wheel}_rad_s"] = 52.0 + rng.normal(size=n)
    columns["vehicle_speed_m_s"] = 15.0 + 0.02 * rng.normal(size=n)
    columns["accel_x_m_s2"] = 4.0 * np.cos(2.0 * time_s)
    columns["position_m"] = 15.0 * time_s
    return columns


def _log(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import pandas as pd

        from sim2real.logs.write import write_log

        write_log(pd.DataFrame(_drive()), folder / f"good{suffix}")
        return folder / f"good{suffix}"

    return make


def _dbc(folder: Path) -> Path:
    """A message of two floats for each two columns, in no more than eight bytes: TRC is written without CAN FD."""
    names = [name for name in _drive() if name != "time_s"]
    lines = ['VERSION ""', "BS_:", "BU_: ECU"]
    for k in range(0, len(names), 2):
        lines.append(f"BO_ {256 + k} M{k}: 8 ECU")
        lines += [f' SG_ {n} : {32 * i}|32@1- (1,0) [0|0] "" ECU' for i, n in enumerate(names[k : k + 2])]
    lines += [f"SIG_VALTYPE_ {256 + i // 2 * 2} {name} : 1;" for i, name in enumerate(names)]
    (folder / "car.dbc").write_text("\n".join(lines) + "\n")
    return folder / "car.dbc"


def _bus(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import can

        drive = _drive()
        time_s, *columns = drive.values()
        frames = [np.column_stack(columns[k : k + 2]).astype("<f4") for k in range(0, len(columns), 2)]
        writers: dict[str, Any] = {
            ".blf": can.BLFWriter,
            ".asc": can.ASCWriter,
            ".log": can.CanutilsLogWriter,
            ".trc": can.TRCWriter,
            ".mf4": can.MF4Writer,
        }
        with writers[suffix](str(folder / f"good{suffix}")) as writer:
            for i, t in enumerate(time_s):
                for k, values in enumerate(frames):
                    data = values[i].tobytes().ljust(8, b"\0")
                    number = 256 + 2 * k
                    writer.on_message_received(
                        can.Message(2e9 + t, number, is_extended_id=False, data=data, channel=1)
                    )
        _dbc(folder)
        return folder / f"good{suffix}"

    return make


def _read_bus(path: Path) -> Any:
    from sim2real.logs import read_log

    return read_log(path, dbc=path.with_name("car.dbc")).to_frame().to_numpy(dtype=float)


def _described(folder: Path) -> Path:
    """A DBC file beside a log of the bus."""
    _bus(".blf")(folder)
    return folder / "car.dbc"


def _read_described(path: Path) -> Any:
    return _read_bus(path.with_name("good.blf"))


def _mat5(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "good.mat", {"drive": _drive()}, do_compression=True)
    return folder / "good.mat"


def _mat73(folder: Path) -> Path:
    """HDF5 behind 512 bytes, with MATLAB's classes as attributes."""
    import h5py

    path = folder / "good.mat"
    with h5py.File(path, "w", userblock_size=512) as root:
        group = root.create_group("drive")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in _drive().items():
            group.create_dataset(name, data=values[None, :], compression="gzip")
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


def _read_log(path: Path) -> Any:
    from sim2real.logs import read_log

    return read_log(path).to_frame().to_numpy(dtype=float)


# Networks, units, buses


def _network(name: str) -> Callable[[Path], Path]:
    return lambda folder: Path(shutil.copy(networks_folder() / name, folder / name))


def _segment(path: Path) -> Any:
    """Loaded and used. ONNX protects nothing: that the numbers are right is for the unit's hash to say."""
    from trpac_core.vision.networks import Segmenter

    return Segmenter(path, 1).segment(np.full((160, 256, 3), 90, np.uint8)).drivable


def _classify(path: Path) -> Any:
    from trpac_core.vision.networks import SurfaceClassifier

    return SurfaceClassifier(path, 1).verdicts(np.full((1, 64, 96, 3), 90, np.uint8)).logits


def _network_errors() -> tuple[type[Exception], ...]:
    from trpac_core.vision.networks import ModelError

    return (ModelError,)


def _unit(folder: Path) -> Path:
    from fmu_src.packaging import build_unit
    from fmu_src.units import UNITS

    return build_unit(UNITS["ReferencePlant"], folder / "good.fmu")


def _read_unit(path: Path) -> Any:
    """Unpacked as our tools do it; the files' content counts."""
    from scenarios.fmu_client.unpacking import unpack_unit

    folder = Path(tempfile.mkdtemp(prefix="trpac-fuzz-unit-"))
    try:
        unpack_unit(path, folder)
        return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    finally:
        shutil.rmtree(folder)


class ProblemFoundError(Exception):
    """What the doctor says of a damaged unit."""


def _examine(path: Path) -> Any:
    """What a unit holds that the doctor finds nothing in."""
    problems = [found.text for found in examine_file(path)[1] if found.state is State.PROBLEM]
    if problems:
        raise ProblemFoundError("; ".join(problems))
    return _read_unit(path)


KINDS = {
    "picture_jpeg": Kind(_picture(".jpg"), _decode, _picture_errors),
    "picture_png": Kind(_picture(".png"), _decode, _picture_errors, exact=True),
    "camera_yaml": Kind(
        _shipped("scenarios", "cameras", "paper.yaml"),
        _load("load_camera", "scenarios.camera.files"),
        _scenario_errors,
        text=True,
    ),
    "vehicle_yaml": Kind(
        _shipped("scenarios", "vehicles", "four_in_wheel_motor_ev.yaml"),
        _load("load_vehicle"),
        _scenario_errors,
        text=True,
    ),
    "road_yaml": Kind(
        _shipped("scenarios", "roads", "paper_simulation.yaml"),
        _load("load_road"),
        _scenario_errors,
        text=True,
    ),
    "scenario_yaml": Kind(_scenario, _load("load_scenario"), _scenario_errors, text=True),
    "manoeuvre_yaml": Kind(
        _shipped("scenarios", "manoeuvres", "road_test_brakes.yaml"),
        _load("load_manoeuvre"),
        _scenario_errors,
        text=True,
    ),
    "sweep_yaml": Kind(_sweep, _load("load_sweep", "scenarios.sweep.files"), _scenario_errors, text=True),
    "sweep_part_json": Kind(_sweep_part, _read_part, _scenario_errors, text=True),
    "mapping_yaml": Kind(
        _shipped("sim2real", "mappings", sorted(os.listdir(ROOT / "sim2real" / "mappings"))[0]),
        _load("load_mapping", "sim2real.logs.mapping"),
        _scenario_errors,
        text=True,
    ),
    "log_csv": Kind(_log(".csv"), _read_log, _scenario_errors, text=True),
    "log_parquet": Kind(_log(".parquet"), _read_log, _scenario_errors, exact=True),
    "log_mf4": Kind(_log(".mf4"), _read_log, _scenario_errors),
    "log_blf": Kind(_bus(".blf"), _read_bus, _scenario_errors),
    "log_asc": Kind(_bus(".asc"), _read_bus, _scenario_errors, text=True),
    "log_candump": Kind(_bus(".log"), _read_bus, _scenario_errors, text=True),
    "log_trc": Kind(_bus(".trc"), _read_bus, _scenario_errors, text=True),
    "log_bus_mf4": Kind(_bus(".mf4"), _read_bus, _scenario_errors),
    "log_dbc": Kind(_described, _read_described, _scenario_errors, text=True),
    "log_mat5": Kind(_mat5, _read_log, _scenario_errors),
    "log_mat73": Kind(_mat73, _read_log, _scenario_errors),
    "bus_dbc": Kind(
        _shipped("trpac_hil", "trpac.dbc"),
        _load("load_codec", "trpac_hil.codec"),
        _scenario_errors,
        text=True,
    ),
    "segmenter_onnx": Kind(_network("segmenter.onnx"), _segment, _network_errors),
    "surface_onnx": Kind(_network("surface.onnx"), _classify, _network_errors),
    "unit_fmu": Kind(_unit, _read_unit, lambda: (ValueError, OSError), exact=True),
    "unit_examined": Kind(_unit, _examine, lambda: (ProblemFoundError, UnusableError), exact=True),
}
"""By short name. A serialised state is no file of ours, but the host's: see `states`."""


@contextmanager
def workplace(kind: Kind) -> Iterator[tuple[Path, bytes, Any]]:
    """Where damaged files lie, the good one's bytes, and what it reads as."""
    with tempfile.TemporaryDirectory(prefix="trpac-fuzz-") as name:
        good = kind.make(Path(name))
        yield good, good.read_bytes(), kind.read(good)


FORKED = {
    f"log_{kind}" for kind in ("mf4", "blf", "asc", "candump", "trc", "bus_mf4", "dbc", "mat5", "mat73")
}
"""Kinds whose readers run in processes of their own."""


def damaged_files(name: str, seed: int, numbers: range) -> Iterator[tuple[int, str | None]]:
    """Number and finding of each damaged file; the file of a number depends on the seed alone."""
    kind = KINDS[name]
    with (
        forked_readers() if name in FORKED else nullcontext(),
        workplace(kind) as (path, good, right),
    ):
        for number in numbers:
            yield number, None
            path.write_bytes(damaged(kind.ways, good, np.random.default_rng([seed, number])))
            finding = judge(kind, path, right)
            if finding:
                yield number, finding
