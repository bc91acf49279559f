"""The unit `TrpacEstimator4W`: the estimators of four wheels behind the FMI 2.0 co-simulation interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any, ClassVar

from trpac_core.four_wheels import CarEstimate, CarSensors, FourWheels, FourWheelsConfig
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.variables import Variable
from trpac_core.vehicle import WHEELS
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.sides import SidesIfe

from .camera_slave import CameraSlave
from .estimate_outputs import OF_ESTIMATE
from .frames import CLASS_PER_SIDE, BusClass
from .guarded_slave import Value
from .interface_4w import TRPAC_ESTIMATOR_4W

_OF_WHEEL = {
    f"{name}.{wheel}": (index, of_estimate)
    for index, wheel in enumerate(WHEELS)
    for name, of_estimate in OF_ESTIMATE.items()
}
_OF_CAR = {"TRPAC.vehicle": attrgetter("TRPAC"), "TRPAC_std.vehicle": attrgetter("TRPAC_std")}
_LOADS = tuple(f"vertical_load.{wheel}" for wheel in WHEELS)


class TrpacEstimator4W(CameraSlave):
    """The unit with sensors and frames of the car as inputs, and TRPAC of each wheel and of the car as outputs."""

    variables: ClassVar[tuple[Variable, ...]] = TRPAC_ESTIMATOR_4W
    volatile: ClassVar[frozenset[str]] = frozenset(v.name for v in TRPAC_ESTIMATOR_4W if v.binary)
    views: ClassVar[frozenset[str]] = frozenset(_OF_WHEEL) | frozenset(_OF_CAR)
    bus: ClassVar[tuple[BusClass, ...]] = CLASS_PER_SIDE

    def build(
        self, values: Mapping[str, Any], networks: tuple[Segmenter, SurfaceClassifier] | None
    ) -> FourWheels:
        """The estimators under these parameters; ValueError where they cannot be applied."""
        config = configuration(self.variables, values, FourWheelsConfig())
        return FourWheels(config, SidesIfe(config.wheel.image_settings, *networks) if networks else None)

    def sensors(self) -> CarSensors:
        """The inputs as the estimators' sensors."""
        values = self.values
        fl, fr, rl, rr = (self.optional(name) for name in _LOADS)
        return CarSensors(
            (
                values["wheel_speed.fl"],
                values["wheel_speed.fr"],
                values["wheel_speed.rl"],
                values["wheel_speed.rr"],
            ),
            (
                values["wheel_torque.fl"],
                values["wheel_torque.fr"],
                values["wheel_torque.rl"],
                values["wheel_torque.rr"],
            ),
            values["vehicle_speed"],
            (fl, fr, rl, rr),
            values["steering_angle"],
            self.optional("longitudinal_acceleration"),
            self.optional("lateral_acceleration"),
            self.optional("yaw_rate"),
        )

    def shown(self, name: str) -> Value:
        """Value of an output, from the last estimate of its wheel or of the car."""
        estimate = self._estimator.last
        if name in _OF_CAR:
            of_car: Value = _OF_CAR[name](estimate)
            return of_car
        index, of_estimate = _OF_WHEEL[name]
        of_wheel: Value = of_estimate(estimate.wheels[index])
        return of_wheel

    def problems(self, estimate: CarEstimate) -> Iterable[tuple[str, str]]:
        """Unusable readings by wheel."""
        return ((who, f"{who}: {text}") for who, text in estimate.problems)
