"""The units that can be built."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from .interface import TRPAC_ESTIMATOR
from .model_description import UnitInfo
from .packaging import Slave

MODELS = Path(__file__).parent.parent / "models"

UNITS = {
    "TrpacEstimator": Slave(
        UnitInfo(
            name="TrpacEstimator",
            description="Peak adhesion coefficient of tyre and road at one wheel, from dynamics and camera",
            version=version("trpac-fmu"),
            step_size_s=0.001,
            stop_time_s=10.0,
        ),
        module="trpac_estimator",
        variables=TRPAC_ESTIMATOR,
        resources=(MODELS / "segmenter.onnx", MODELS / "surface.onnx"),
    ),
}
"""Units by the name that `build_fmu.py --slave` takes."""
