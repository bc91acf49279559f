"""The units that can be built."""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from pathlib import Path

from scenarios.library import networks_folder

from .interface import TRPAC_ESTIMATOR
from .interface_4w import TRPAC_ESTIMATOR_4W
from .interface_plant import REFERENCE_PLANT
from .interface_pulses import TORQUE_PULSES
from .model_description import UnitInfo
from .packaging import Slave

ROOT = Path(__file__).parent.parent
CORE_FILES = {
    path: ROOT / path
    for path in (
        "trpac_core/__init__.py",
        "trpac_core/errors.py",
        "trpac_core/files.py",
        "trpac_core/parameters/__init__.py",
        "trpac_core/parameters/configuration.py",
        "trpac_core/parameters/fields.py",
        "trpac_core/parameters/variables.py",
        "trpac_core/sensors.py",
    )
}
"""Files of the core in every unit."""
NETWORKS = (networks_folder() / "segmenter.onnx", networks_folder() / "surface.onnx")
STEP_S, STOP_S = 0.001, 10.0
"""Step and end of the default experiment [s]."""

ESTIMATOR_PACKAGES = {"numpy": "numpy", "cv2": "opencv-python-headless", "onnxruntime": "onnxruntime"}
ESTIMATOR_FILES = (
    "camera_slave.py",
    "estimate_outputs.py",
    "frames.py",
    "memory.py",
    "settings.py",
    "signals.py",
)

PLANT_PACKAGES = {"numpy": "numpy", "numba": "numba", "pydantic": "pydantic", "yaml": "PyYAML"}
PLANT_MODULES = (
    "trpac_core/vehicle.py",
    "trpac_core/vision/__init__.py",
    "trpac_core/vision/classes.py",
    "scenarios/__init__.py",
    "scenarios/errors.py",
    "scenarios/files.py",
    "scenarios/library.py",
    "scenarios/strict.py",
    "scenarios/yaml_text.py",
    "scenarios/effects",
    "scenarios/plant/__init__.py",
    "scenarios/plant/dynamics.py",
    "scenarios/plant/parameters.py",
    "scenarios/plant/pipeline.py",
)
"""Files of the plant in its unit, without its sensors and their imports."""


def _info(name: str, description: str) -> UnitInfo:
    return UnitInfo(
        name=name,
        description=description,
        version=version("trpac-fmu"),
        step_size_s=STEP_S,
        stop_time_s=STOP_S,
    )


_estimator = partial(
    Slave, modules={"trpac_core": ROOT / "trpac_core"}, packages=ESTIMATOR_PACKAGES, resources=NETWORKS
)

UNITS = {
    "TrpacEstimator": _estimator(
        _info(
            "TrpacEstimator",
            "Peak adhesion coefficient of tyre and road at one wheel, from dynamics and camera",
        ),
        files=(*ESTIMATOR_FILES, "interface.py", "trpac_estimator.py"),
        variables=TRPAC_ESTIMATOR,
    ),
    "TrpacEstimator4W": _estimator(
        _info(
            "TrpacEstimator4W",
            "Peak adhesion coefficient of tyre and road at four wheels and of the car, from dynamics and camera",
        ),
        files=(*ESTIMATOR_FILES, "interface_4w.py", "trpac_estimator_4w.py"),
        variables=TRPAC_ESTIMATOR_4W,
    ),
    "ReferencePlant": Slave(
        _info(
            "ReferencePlant", "A car on a road of known friction: four driven or braked wheels, straight on"
        ),
        files=("interface_plant.py", "reference_plant.py"),
        variables=REFERENCE_PLANT,
        modules=CORE_FILES | {path: ROOT / path for path in PLANT_MODULES},
        packages=PLANT_PACKAGES,
        resources=(),
        compiled="scenarios",
    ),
    "TorquePulses": Slave(
        _info("TorquePulses", "Driving and braking torque by the clock, for systems without a driver"),
        files=("interface_pulses.py", "torque_pulses.py"),
        variables=TORQUE_PULSES,
        modules=CORE_FILES,
        packages={},
        resources=(),
    ),
}
"""Units by the name for `build_fmu.py --slave`."""
