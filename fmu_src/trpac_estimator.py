"""The unit `TrpacEstimator`: the estimator of one wheel behind the FMI 2.0 co-simulation interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from trpac_core.estimator import Estimate, EstimatorConfig
from trpac_core.estimator import TrpacEstimator as Estimator
from trpac_core.local_speed import local_speeds
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.variables import Variable
from trpac_core.readings import Sensors
from trpac_core.vision.ife import Ife
from trpac_core.vision.networks import Segmenter, SurfaceClassifier

from .camera_slave import CameraSlave
from .estimate_outputs import OF_ESTIMATE
from .frames import ONE_CLASS, BusClass
from .guarded_slave import Value
from .interface import TRPAC_ESTIMATOR


class TrpacEstimator(CameraSlave):
    """The unit with sensors and frames of one wheel as inputs, and TRPAC, flag and K_v as outputs."""

    variables: ClassVar[tuple[Variable, ...]] = TRPAC_ESTIMATOR
    volatile: ClassVar[frozenset[str]] = frozenset(v.name for v in TRPAC_ESTIMATOR if v.binary)
    views: ClassVar[frozenset[str]] = frozenset(OF_ESTIMATE)
    bus: ClassVar[tuple[BusClass, ...]] = ONE_CLASS

    def build(
        self, values: Mapping[str, Any], networks: tuple[Segmenter, SurfaceClassifier] | None
    ) -> Estimator:
        """The estimator under these parameters; ValueError where they cannot be applied."""
        self._config = config = configuration(self.variables, values, EstimatorConfig())
        return Estimator(config, Ife(config.image_settings, *networks) if networks else None)

    def sensors(self) -> Sensors:
        """The inputs as the estimator's sensors; in a curve the speed is that of the wheel's contact."""
        values, config = self.values, self._config
        speed, steering, yaw = values["vehicle_speed"], values["steering_angle"], self.optional("yaw_rate")
        if steering or yaw:
            fl, fr, rl, rr = local_speeds(config.vehicle, speed, steering, yaw)
            left, right = (fl, fr) if config.front_axle else (rl, rr)
            speed = left if config.left_side else right
        return Sensors(
            values["wheel_speed"],
            values["wheel_torque"],
            speed,
            self.optional("vertical_load"),
            steering,
            self.optional("longitudinal_acceleration"),
            yaw,
        )

    def shown(self, name: str) -> Value:
        """Value of an output, from the last estimate."""
        value: Value = OF_ESTIMATE[name](self._estimator.last)
        return value

    def problems(self, estimate: Estimate) -> Iterable[tuple[str, str]]:
        """Unusable readings."""
        return (("", estimate.problem),) if estimate.problem else ()
