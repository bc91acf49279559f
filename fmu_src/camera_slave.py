"""The common part of the estimators' units: networks, frames, optional inputs, the estimator's state."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, ClassVar

from pythonfmu.enums import Fmi2Status

from trpac_core.vision.images import ImageError
from trpac_core.vision.networks import ModelError, Segmenter, SurfaceClassifier

from .contents import require_as_built
from .frames import BUS, BusClass, FrameState, in_memory, next_frame
from .guarded_slave import GuardedSlave
from .settings import BUFFERS_ENABLED

SEGMENTER_FILE = "segmenter.onnx"
CLASSIFIER_FILE = "surface.onnx"


class CameraSlave(GuardedSlave):
    """A unit with sensors and camera frames as inputs and an estimate as output.

    A unit gives `bus` and `views` and overrides `build`, `sensors`, `shown` and `problems`.
    """

    bus: ClassVar[tuple[BusClass, ...]]
    """Inputs for surface classes by bus."""
    _networks: ClassVar[tuple[Segmenter, SurfaceClassifier] | None] = None

    @abstractmethod
    def build(self, values: Mapping[str, Any], networks: tuple[Segmenter, SurfaceClassifier] | None) -> Any:
        """The estimator, TrpacEstimator or FourWheels; ValueError where the parameters cannot be applied."""

    @abstractmethod
    def sensors(self) -> Any:
        """The inputs as the estimator's sensors."""

    @abstractmethod
    def problems(self, estimate: Any) -> Iterable[tuple[str, str]]:
        """Unusable readings: a key that separates them in the log, and a sentence."""

    def prepare(self) -> None:
        """Load the networks, once per process; raises ModelError, and ContentError for networks of another build.

        In the unit the name of this module holds the hash of its whole content, so that units of other builds have
        networks of their own.
        """
        if CameraSlave._networks is None:
            folder = Path(str(self.resources))
            require_as_built(folder, (SEGMENTER_FILE, CLASSIFIER_FILE))
            CameraSlave._networks = (
                Segmenter(folder / SEGMENTER_FILE),
                SurfaceClassifier(folder / CLASSIFIER_FILE),
            )

    def initialise(self) -> None:
        """Apply the parameters; ValueError where they cannot be applied."""
        self._estimator = self.build(self.values, self._networks)
        self._connected: set[str] = set()
        self._frame = FrameState()

    def step(self, step_s: float) -> None:
        """Step the estimator with the sensors and a new frame; the outputs show its last estimate."""
        sensors = self.sensors()
        if not self.values[BUFFERS_ENABLED] and in_memory(self.values):
            self._report_buffers_off()
        try:
            self._frame, frame, problem = next_frame(self._frame, self.values, self.bus)
        finally:
            self.clear_volatile()
        try:
            estimate = self._estimator.step(step_s, sensors, frame, frame_failed=self._frame.failed)
        except (ImageError, ModelError) as error:
            problem = str(error)
            self._frame = replace(self._frame, failed=True)
            estimate = self._estimator.step(step_s, sensors, frame_failed=True)
        if problem:
            sort = "class" if self._frame.source == BUS else "picture"
            self.report(f"frame {sort}", Fmi2Status.warning, f"{self.modelName}: {problem}")
        for kind, text in self.problems(estimate):
            # Each problem begins with the name of a reading, such as "wheel_speed_rad_s is ...".
            about = [part.partition(" is ")[0] for part in text.split("; ")]
            self.report(f"sensors {kind} {about}", Fmi2Status.warning, f"{self.modelName}: {text}")

    def _report_buffers_off(self) -> None:
        text = (
            f"the inputs image.* point to a picture in memory, which is not read: the parameter {BUFFERS_ENABLED} is "
            "false. Set it to true before the initialisation ends, or give pictures by image_path."
        )
        self.report("buffers off", Fmi2Status.warning, f"{self.modelName}: {text}")

    def optional(self, name: str) -> float | None:
        """An input that is connected from its first finite value other than 0; None before."""
        value: float = self.values[name]
        if not math.isfinite(value):
            return value
        if value != 0.0:
            self._connected.add(name)
        return value if name in self._connected else None

    def inner_state(self) -> dict[str, Any]:
        """Estimator, frames and connected inputs, JSON-able and exact."""
        return {
            "estimator": self._estimator.state(),
            "frame": asdict(self._frame),
            "connected": sorted(self._connected),
        }

    def restore_inner_state(self, values: dict[str, Any], state: Any) -> None:
        """Restore what `inner_state` returned under these variable values."""
        frame = FrameState(**state["frame"])
        estimator = self.build(values, self._networks)
        estimator.restore(state["estimator"])
        self._estimator, self._frame, self._connected = estimator, frame, set(state["connected"])
