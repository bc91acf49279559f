"""The unit `TrpacEstimator`: the estimator of one wheel behind the FMI 2.0 co-simulation interface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar

from pythonfmu.enums import Fmi2Status

from trpac_core.estimator import Estimate
from trpac_core.estimator import TrpacEstimator as Estimator
from trpac_core.readings import Sensors
from trpac_core.vision.ife import Ife
from trpac_core.vision.images import ImageError
from trpac_core.vision.networks import ModelError, Segmenter, SurfaceClassifier

from .frames import FrameState, next_frame
from .guarded_slave import GuardedSlave
from .interface import TRPAC_ESTIMATOR
from .parameters import configuration
from .variables import Variable

SEGMENTER_FILE = "segmenter.onnx"
CLASSIFIER_FILE = "surface.onnx"


class TrpacEstimator(GuardedSlave):
    """Sensors and camera frames of one wheel in, TRPAC, flag and K_v out."""

    variables: ClassVar[tuple[Variable, ...]] = TRPAC_ESTIMATOR
    volatile: ClassVar[frozenset[str]] = frozenset(v.name for v in TRPAC_ESTIMATOR if v.binary)

    _networks: ClassVar[tuple[Segmenter, SurfaceClassifier] | None] = None

    def prepare(self) -> None:
        """Load the networks, once per process; raises ModelError.

        In the unit this module's name holds the hash of all that the unit carries, networks included:
        those of another unit cannot be meant.
        """
        if TrpacEstimator._networks is None:
            folder = Path(str(self.resources))
            TrpacEstimator._networks = (
                Segmenter(folder / SEGMENTER_FILE),
                SurfaceClassifier(folder / CLASSIFIER_FILE),
            )

    def _build(self, values: Mapping[str, Any]) -> Estimator:
        config = configuration(self.variables, values)
        return Estimator(config, Ife(config.image_settings, *self._networks) if self._networks else None)

    def initialise(self) -> None:
        """Apply the parameters; ValueError where they cannot be applied."""
        self._estimator = self._build(self.values)
        self._connected: set[str] = set()
        self._frame = FrameState()
        self._publish(self._estimator.last)

    def step(self, step_s: float) -> None:
        """Hand sensors and a new frame to the estimator, and publish its estimate."""
        sensors = self._sensors()
        self._frame, frame, problem = next_frame(self._frame, self.values)
        self.clear_volatile()
        try:
            estimate = self._estimator.step(step_s, sensors, frame, frame_failed=self._frame.failed)
        except (ImageError, ModelError) as error:
            problem = str(error)
            self._frame = replace(self._frame, failed=True)
            estimate = self._estimator.step(step_s, sensors, frame_failed=True)
        self._publish(estimate)
        for kind, text in (("frame", problem), ("sensors", estimate.problem)):
            if text:
                self.report(kind, Fmi2Status.warning, f"{self.modelName}: {text}")

    def _sensors(self) -> Sensors:
        values = self.values
        return Sensors(
            values["wheel_speed"],
            values["wheel_torque"],
            values["vehicle_speed"],
            self._optional("vertical_load"),
            values["steering_angle"],
            self._optional("longitudinal_acceleration"),
            self._optional("yaw_rate"),
        )

    def _optional(self, name: str) -> float | None:
        """An input that counts as connected from its first value other than 0; None before."""
        value: float = self.values[name]
        if value != 0.0:
            self._connected.add(name)
        elif name not in self._connected:
            return None
        return value

    def _publish(self, estimate: Estimate) -> None:
        self.values.update(zip(OUTPUTS, OF_ESTIMATE(estimate), strict=True))

    def inner_state(self) -> dict[str, Any]:
        """Estimator, frames and connected inputs, JSON-able and exact."""
        return {
            "estimator": self._estimator.state(),
            "frame": asdict(self._frame),
            "connected": sorted(self._connected),
        }

    def restore_inner_state(self, values: dict[str, Any], state: Any) -> None:
        """Take back what `inner_state` gave under these variable values."""
        frame = FrameState(**state["frame"])
        estimator = self._build(values)
        estimator.restore(state["estimator"])
        self._estimator, self._frame, self._connected = estimator, frame, set(state["connected"])


OUTPUT_NAMES = {"tyre_force_n": "tyre_force", "frame_age_s": "frame_age"}
"""Fields of the estimate whose unit is in the name; the FMI variable states it as an attribute."""

_FIELDS = [field.name for field in fields(Estimate) if field.name != "problem"]
OUTPUTS = tuple(OUTPUT_NAMES.get(name, name) for name in _FIELDS)
OF_ESTIMATE = attrgetter(*_FIELDS)
