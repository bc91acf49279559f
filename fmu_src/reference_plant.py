"""The unit `ReferencePlant`: the Python plant behind the FMI 2.0 co-simulation interface."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError
from pythonfmu.enums import Fmi2Status

from scenarios.files import RoadFile, VehicleFile, load_road, load_vehicle
from scenarios.plant.parameters import Wheels
from scenarios.plant.pipeline import PlantState, advance, initial_state
from trpac_core.parameters.configuration import check_parameters
from trpac_core.parameters.variables import Variable
from trpac_core.vision.classes import Surface

from .guarded_slave import GuardedSlave
from .interface_plant import MOST_TORQUE_NM, REFERENCE_PLANT, SIDES, WHEELS

File = TypeVar("File", bound=BaseModel)

_TORQUES = tuple(f"wheel_torque.{wheel}" for wheel in WHEELS)
_PER_WHEEL = {
    name: tuple(f"{name}.{wheel}" for wheel in WHEELS)
    for name in ("wheel_speed", "vertical_load", "slip", "tyre_force", "theta")
}


@dataclass(frozen=True)
class Setting:
    """Car, road and distances of the parameters."""

    vehicle: VehicleFile
    road: RoadFile
    to_front_m: float
    preview_m: float


class ReferencePlant(GuardedSlave):
    """Four wheel torques in, the car's true motion and the road under and ahead of it out."""

    variables: ClassVar[tuple[Variable, ...]] = REFERENCE_PLANT

    def initialise(self) -> None:
        """Apply the parameters and compile the plant; ValueError where they cannot be applied."""
        setting = self._setting(self.values)
        start_m = self.values["initial.position"] - setting.to_front_m
        state = initial_state(setting.vehicle, setting.road, self.values["initial.vehicle_speed"], start_m)
        moved = advance(state, (0.0,) * 4, 1e-3)  # compiles now rather than in the first step
        if not (_finite(state) and _finite(moved)):
            raise ValueError("The parameters describe a car whose loads or motion are no finite numbers.")
        self._set_up, self._state, self._torque = setting, state, (0.0,) * 4
        self._publish()

    def step(self, step_s: float) -> None:
        """Move the car under the torques that are set now."""
        given = tuple(self.values[name] for name in _TORQUES)
        if all(abs(torque) <= MOST_TORQUE_NM for torque in given):
            self._torque = given
        else:
            wrong = ", ".join(
                f"{name} is {torque:g}"
                for name, torque in zip(_TORQUES, given, strict=True)
                if not abs(torque) <= MOST_TORQUE_NM
            )
            self._warn(
                "torque", f"{wrong}, expected within +-{MOST_TORQUE_NM:g} N.m. The last good torques act on."
            )
        moved = advance(replace(self._state, wheel_torque_nm=self._torque), self._torque, step_s)
        if _finite(moved):
            self._state = moved
            self._publish()
        else:
            self._warn("motion", "the motion is no finite number any more. The car stays where it was.")

    def _warn(self, kind: str, text: str) -> None:
        self.report(kind, Fmi2Status.warning, f"{self.modelName}: {text}")

    def _setting(self, values: Mapping[str, Any]) -> Setting:
        check_parameters(self.variables, values)
        vehicle = load_vehicle(values["vehicle_path"]) if values["vehicle_path"] else _vehicle(values)
        road = load_road(values["road_path"]) if values["road_path"] else _road(values)
        to_front_m = vehicle.wheelbase_m - vehicle.cog_to_rear_axle_m
        return Setting(vehicle, road, to_front_m, values["preview.P_0"])

    def _publish(self) -> None:
        state, values = self._state, self.values
        wheels = state.wheels
        for name, numbers in (
            ("wheel_speed", state.wheel_speed_rad_s),
            ("vertical_load", wheels.load_n.tolist()),
            ("slip", wheels.slip.tolist()),
            ("tyre_force", wheels.force_n.tolist()),
            ("theta", wheels.theta.tolist()),
        ):
            values.update(zip(_PER_WHEEL[name], numbers, strict=True))
        front_m = state.position_m + self._set_up.to_front_m
        ahead = self._set_up.road.segment_at(front_m + self._set_up.preview_m)
        values["vehicle_speed"], values["position"] = state.speed_m_s, front_m
        values["longitudinal_acceleration"] = float(state.accel_x_m_s2)
        for side, surface in zip(SIDES, ahead.surface_classes, strict=True):
            values[f"road_class.{side}"] = int(surface)
            values[f"road_class_confidence.{side}"] = values["camera.confidence"]

    def inner_state(self) -> dict[str, Any]:
        """The plant's state, JSON-able and exact."""
        state = self._state
        return {
            "time_s": state.time_s,
            "accel_x_m_s2": float(state.accel_x_m_s2),
            "y": state.y.tolist(),
            "wheel_torque_nm": list(state.wheel_torque_nm),
            "wheels": [array.tolist() for array in state.wheels],
            "torque": list(self._torque),
        }

    def restore_inner_state(self, values: dict[str, Any], state: Any) -> None:
        """Restore what `inner_state` returned under these variable values; ScenarioError where a file has changed."""
        setting = self._setting(values)
        setup = initial_state(setting.vehicle, setting.road).setup
        self._state = PlantState(
            setup,
            state["time_s"],
            state["accel_x_m_s2"],
            np.array(state["y"]),
            tuple(state["wheel_torque_nm"]),
            Wheels(*map(np.array, state["wheels"])),
        )
        self._set_up, self._torque = setting, tuple(state["torque"])


def _finite(state: PlantState) -> bool:
    """Whether motion, loads and forces are finite."""
    parts = (state.y, *state.wheels)
    return math.isfinite(state.accel_x_m_s2) and all(bool(np.isfinite(part).all()) for part in parts)


def _vehicle(values: Mapping[str, Any]) -> VehicleFile:
    """The car that the parameters vehicle.* and tyre.* describe; raises ValueError."""
    content: dict[str, Any] = {
        "schema": 1,
        "name": "parameters",
        "motor_peak_torque_nm": MOST_TORQUE_NM,
        "tyre": {"model": "modified_dugoff"},
        "effects": {
            "load_transfer": {"cog_height_m": values["vehicle.cog_height"]},
            "aero_drag": {"drag_area_m2": values["vehicle.drag_area"]},
            "rolling_resistance": {"coefficient": values["tyre.rolling_resistance"]},
        },
    }
    for variable in REFERENCE_PLANT:
        section, _, field = variable.source.rpartition(".")
        if field:
            (content[section] if section else content)[field] = values[variable.name]
    return _described(VehicleFile, "car", content)


def _road(values: Mapping[str, Any]) -> RoadFile:
    """The road that the parameters road.* describe; raises ValueError."""
    segments = []
    for number in range(1, values["road.segments"] + 1):
        of_it = f"road.segment_{number}"
        left, right = (Surface(values[f"{of_it}.class_{side}"]).label for side in SIDES)
        segments.append(
            {
                "start_m": values[f"{of_it}.start"],
                "mu_left": values[f"{of_it}.theta_left"],
                "mu_right": values[f"{of_it}.theta_right"],
                "surface": left,
                "surface_right": None if right == left else right,
            }
        )
    return _described(RoadFile, "road", {"schema": 1, "segments": segments})


def _described(kind: type[File], what: str, content: dict[str, Any]) -> File:
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, one['loc']))} {one['msg']}".strip() for one in error.errors()
        )
        raise ValueError(f"The parameters describe no {what}: {problems}") from error
