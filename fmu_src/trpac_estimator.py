"""The unit `TrpacEstimator`: the estimator of one wheel behind the FMI 2.0 co-simulation interface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, ClassVar

from pythonfmu.enums import Fmi2Status

from trpac_core.estimator import Estimate, Sensors
from trpac_core.estimator import TrpacEstimator as Estimator
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
OPTIONAL_INPUTS = ("vertical_load", "longitudinal_acceleration", "yaw_rate")
"""Inputs that count as connected from the first value other than 0."""


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
        values = self.values
        self._connected.update(name for name in OPTIONAL_INPUTS if values[name] != 0.0)
        sensors = self._sensors(values)
        self._frame, frame, problem = next_frame(self._frame, values)
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

    def _sensors(self, values: Mapping[str, Any]) -> Sensors:
        optional = {name: values[name] if name in self._connected else None for name in OPTIONAL_INPUTS}
        return Sensors(
            wheel_speed_rad_s=values["wheel_speed"],
            wheel_torque_nm=values["wheel_torque"],
            vehicle_speed_m_s=values["vehicle_speed"],
            vertical_load_n=optional["vertical_load"],
            steering_angle_rad=values["steering_angle"],
            longitudinal_acceleration_m_s2=optional["longitudinal_acceleration"],
            yaw_rate_rad_s=optional["yaw_rate"],
        )

    def _publish(self, estimate: Estimate) -> None:
        for output, field in OUTPUT_FIELDS:
            self.values[output] = getattr(estimate, field)

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

OUTPUT_FIELDS = tuple(
    (OUTPUT_NAMES.get(field.name, field.name), field.name)
    for field in fields(Estimate)
    if field.name != "problem"
)
