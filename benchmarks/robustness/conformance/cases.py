"""What is done to each unit, and what the unit answers where no client stands between."""

from __future__ import annotations

import atexit
import math
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from fmu_src.contents import CONTENTS_FILE, Contents, sha256_of
from fmu_src.guarded_slave import GuardedSlave
from fmu_src.native.build import NATIVE_UNITS
from fmu_src.units import ROOT
from scenarios.library import networks_folder
from trpac_core.vehicle import WHEELS

from .outcome import NotOfferedError

STEP_S = 0.001
STEPS = 200

Values = Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One unit as the clients drive it.

    Parameters
    ----------
    unit : str
        Its name.
    drive : mapping
        Real inputs of a driven car, constant.
    rubbish : mapping
        A Real input without a number.
    too_much : mapping
        A Real input that the unit refuses with a warning, by which a host sees its log.
    integers, booleans, texts : mapping
        Variables of these types that can be set, with values other than the start; empty where the unit has none.
    parameter : tuple
        A Real parameter and a value other than its start.
    missing : tuple
        The variable that names a file, and whether it is a parameter.
    watched : tuple of str
        Real outputs that are compared bit for bit.
    classes : mapping
        The road's class by number, for the native unit, which takes no pictures.
    native : bool
        Whether it is the native unit.
    """

    unit: str
    drive: Values
    rubbish: Values
    too_much: Values
    integers: Values
    booleans: Values
    texts: Values
    parameter: tuple[str, float]
    missing: tuple[str, bool]
    watched: tuple[str, ...]
    classes: Values = field(default_factory=dict)
    native: bool = False

    @property
    def title(self) -> str:
        """Its name in the matrix."""
        return f"{self.unit} native" if self.native else self.unit

    @property
    def takes_pictures(self) -> bool:
        """Whether pictures are among its inputs."""
        return self.missing[0] == "image_path" and not self.native

    def missing_file(self) -> tuple[str, bool]:
        """The variable that names a file, and whether it is a parameter; NotOfferedError where the unit opens none."""
        if self.native:
            raise NotOfferedError("the unit opens no files")
        return self.missing

    def inputs(self, picture: Path) -> dict[str, Any]:
        """What it is driven with: a picture, or the class by number where the native unit stands."""
        seen = {"image_path": str(picture)} if self.takes_pictures else self.classes if self.native else {}
        return {**self.drive, **seen}


def _each(name: str, *values: float) -> dict[str, float]:
    return {f"{name}.{wheel}": value for wheel, value in zip(WHEELS, values, strict=True)}


_OF_A_WHEEL = ("TRPAC", "tyre_force", "slip", "TRPAC_dynamics", "image_confidence", "TRPAC_std", "K_v")

CASES = {
    case.unit: case
    for case in (
        Case(
            "TrpacEstimator",
            {"wheel_speed": 52.0, "wheel_torque": 150.0, "vehicle_speed": 14.2},
            {"wheel_speed": math.nan},
            {"wheel_speed": 1e6},
            {"frame_id": 7},
            {"wheel.left": False},
            {"image_path": "nothing.png"},
            ("estimator.theta_initial", 0.3),
            ("image_path", False),
            _OF_A_WHEEL,
            {"road_class": 1, "road_class_confidence": 0.9},
        ),
        Case(
            "TrpacEstimator4W",
            {
                **_each("wheel_speed", 52.0, 52.1, 52.2, 51.9),
                **_each("wheel_torque", 150.0, 160.0, 140.0, 155.0),
                "vehicle_speed": 14.2,
            },
            {"vehicle_speed": math.nan},
            {"vehicle_speed": 1e6},
            {"frame_id": 7},
            {"image.buffers_enabled": False},
            {"image_path": "nothing.png"},
            ("estimator.theta_initial", 0.3),
            ("image_path", False),
            (*(f"{name}.{wheel}" for name in _OF_A_WHEEL for wheel in WHEELS), "TRPAC.vehicle"),
            {
                f"road_class{part}.{side}": value
                for side in ("left", "right")
                for part, value in (("", 1), ("_confidence", 0.9))
            },
        ),
        Case(
            "ReferencePlant",
            _each("wheel_torque", 250.0, 240.0, 230.0, 220.0),
            {"wheel_torque.fl": math.nan},
            {"wheel_torque.fl": 1e6},
            {},
            {},
            {"road_path": str(ROOT / "scenarios" / "roads" / "paper_simulation.yaml")},
            ("initial.vehicle_speed", 12.5),
            ("road_path", True),
            ("vehicle_speed", "position", "wheel_speed.fl", "tyre_force.rr", "slip.fl", "theta.fr"),
        ),
    )
}
"""Units that need Python, by name."""
TITLES = CASES | {case.title: case for case in (replace(CASES[unit], native=True) for unit in NATIVE_UNITS)}
"""All units of the matrix, by title."""


def write_pictures(folder: Path) -> tuple[Path, Path]:
    """Two pictures of a road below a bright sky, of the default camera's shape: fine grain and coarse, as of snow."""
    paths = folder / "first.png", folder / "second.png"
    for seed, path in enumerate(paths):
        image = np.full((600, 960, 3), 190, np.uint8)
        grain = np.random.default_rng(seed).normal(0.0, 1.0, (350, 960))
        coarse = cv2.GaussianBlur(grain, (0, 0), 0.8 + 5.2 * seed)
        image[250:] = np.clip(105.0 + 8.0 * coarse / coarse.std(), 0, 255)[..., None]
        cv2.imwrite(str(path), image)
    return paths


@cache
def _networks() -> Path:
    """A folder like a built unit's resources: the networks, and the record of their hashes."""
    from fmu_src.camera_slave import CLASSIFIER_FILE, SEGMENTER_FILE

    unpacked = Path(tempfile.mkdtemp(prefix="trpac-direct-"))
    atexit.register(shutil.rmtree, unpacked, ignore_errors=True)
    resources = unpacked / "resources"
    resources.mkdir()
    files = {}
    for name in (SEGMENTER_FILE, CLASSIFIER_FILE):
        data = (networks_folder() / name).read_bytes()
        (resources / name).write_bytes(data)
        files[f"resources/{name}"] = sha256_of(data)
    record = Contents(unit="direct", version="", build="", packages={}, files=files)
    (resources / CONTENTS_FILE).write_bytes(record.to_bytes())
    return resources


def _slave(case: Case) -> GuardedSlave:
    from fmu_src.reference_plant import ReferencePlant
    from fmu_src.trpac_estimator import TrpacEstimator
    from fmu_src.trpac_estimator_4w import TrpacEstimator4W

    classes = {c.__name__: c for c in (TrpacEstimator, TrpacEstimator4W, ReferencePlant)}
    resources = _networks() if case.missing[0] == "image_path" else ROOT / "scenarios" / "roads"
    return classes[case.unit](instance_name="direct", resources=str(resources), visible=False)


class Direct:
    """The unit's own code, called without FMI; the yardstick of every client."""

    def __init__(self, case: Case, parameters: Values | None = None) -> None:
        self._case, self._slave, self._time_s = case, _slave(case), 0.0
        self._slave.values.update(parameters or {})
        self._slave.exit_initialization_mode()

    def step(
        self, inputs: Values | None = None, count: int = STEPS, step_s: float = STEP_S
    ) -> dict[str, float]:
        """The watched outputs after these steps."""
        self._slave.values.update(inputs or {})
        for _ in range(count):
            self._slave.do_step(self._time_s, step_s)
            self._time_s += step_s
        return {name: self._slave.values[name] for name in self._case.watched}


def differences(expected: Values, found: Values, relative: float = 0.0) -> list[str]:
    """Names and values that are not the same, within a relative tolerance where a client rounds."""
    return [
        f"{name} is {found[name]!r}, expected {value!r}"
        for name, value in expected.items()
        if not math.isclose(found[name], value, rel_tol=relative, abs_tol=relative)
    ]


def not_finite(values: Values, names: Sequence[str]) -> list[str]:
    """Those of the values that are no number."""
    return [f"{name} is {values[name]}" for name in names if not math.isfinite(values[name])]
