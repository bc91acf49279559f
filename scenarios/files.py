"""The YAML files that describe a scenario: vehicle, road, manoeuvre, and the scenario that names them.

Every loader raises one ScenarioError with all problems of its file.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenarios.effects import EFFECTS, FORMS, Effect, make_effect, problems_of
from scenarios.errors import ScenarioError
from scenarios.library import located
from scenarios.strict import Model, load_strict
from trpac_core.vehicle import WHEELS, Vehicle
from trpac_core.vision.classes import Surface

WheelName = Literal["fl", "fr", "rl", "rr"]
SurfaceName = Literal["dry", "wet", "snow_ice"]
Friction = Annotated[float, Field(ge=0.001, le=1.5)]
Name = Annotated[str, Field(max_length=200)]
Description = Annotated[str, Field(max_length=5_000)]

# Bounds from a model car to a mining truck [kg, m, kg m^2, N m, N], and from a pulse of 1 ms to a day's drive [s].
Mass = Annotated[float, Field(ge=1.0, le=1e6)]
Length = Annotated[float, Field(ge=0.01, le=100.0)]
Height = Annotated[float, Field(ge=0.0, le=100.0)]
Radius = Annotated[float, Field(ge=0.01, le=10.0)]
Inertia = Annotated[float, Field(ge=1e-4, le=1e6)]
PeakTorque = Annotated[float, Field(ge=0.01, le=1e6)]
Torque = Annotated[float, Field(ge=-1e6, le=1e6)]
Stiffness = Annotated[float, Field(ge=100.0, le=1e9)]
Position = Annotated[float, Field(ge=-1e7, le=1e7)]
Time = Annotated[float, Field(ge=0.0, le=1e5)]
Duration = Annotated[float, Field(ge=1e-3, le=1e5)]
Noise = Annotated[float, Field(ge=0.0, le=1e5)]
LONGEST_RUN_S = 3600.0
"""Longest simulated drive [s]."""


class _FileModel(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class TyreSection(_FileModel):
    """The tyre in vehicle.yaml."""

    model: Literal["modified_dugoff"]
    longitudinal_stiffness_n: Stiffness


class VehicleFile(_FileModel):
    """vehicle.yaml: the vehicle, and its effects in the simulation."""

    schema_: Literal[1] = Field(alias="schema")
    name: Name
    mass_kg: Mass
    wheelbase_m: Length
    track_m: Length
    cog_height_m: Height
    cog_to_rear_axle_m: Length
    wheel_radius_m: Radius
    wheel_inertia_kg_m2: Inertia
    motor_peak_torque_nm: PeakTorque
    tyre: TyreSection
    effects: dict[str, dict[str, float]] = Field(default_factory=dict)
    forms: dict[str, str] = Field(default_factory=dict)
    """Form of an effect by its id, where there are several; by default the plant's own."""

    @model_validator(mode="after")
    def _check(self) -> VehicleFile:
        problems = [text for key, form in self.forms.items() for text in self._problems_of_form(key, form)]
        try:
            core = self.to_core()
        except ValueError as error:  # bounds of effects depend on the car
            problems.append(str(error))
        else:
            problems += [
                text
                for key, values in self.effects.items()
                for text in problems_of(key, values, core, self.forms.get(key, ""))
            ]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def to_core(self) -> Vehicle:
        """The vehicle of the estimator."""
        return Vehicle(
            mass_kg=self.mass_kg,
            wheelbase_m=self.wheelbase_m,
            track_m=self.track_m,
            cog_height_m=self.cog_height_m,
            cog_to_rear_axle_m=self.cog_to_rear_axle_m,
            wheel_radius_m=self.wheel_radius_m,
            wheel_inertia_kg_m2=self.wheel_inertia_kg_m2,
            motor_peak_torque_nm=self.motor_peak_torque_nm,
            longitudinal_stiffness_n=self.tyre.longitudinal_stiffness_n,
            rolling_resistance=self._rolling_moment(),
        )

    def _rolling_moment(self) -> float:
        """Coefficient of the rolling resistance that acts as a moment on the wheels [-]."""
        key = "rolling_resistance"
        at_the_wheels = self.forms.get(key, "") in ("", EFFECTS[key].form)
        return self.effects.get(key, {}).get("coefficient", 0.0) if at_the_wheels else 0.0

    def _problems_of_form(self, effect_id: str, form: str) -> list[str]:
        if effect_id not in self.effects:
            return [
                f"forms names {effect_id!r}, which effects does not switch on; remove it there or add it here."
            ]
        known = [kind.form for kind in FORMS.get(effect_id, ())]
        if form in known:
            return []
        return [f"forms.{effect_id} is {form!r}; expected one of {', '.join(map(repr, known))}."]

    def make_effects(self) -> tuple[Effect, ...]:
        """The effects of the file, in the order in which they act."""
        core, order = self.to_core(), list(EFFECTS)
        made = [
            make_effect(key, values, core, self.forms.get(key, "")) for key, values in self.effects.items()
        ]
        return tuple(sorted(made, key=lambda effect: order.index(effect.id)))


class RoadSegment(_FileModel):
    """A stretch of road up to the next one's start; its sides may have other surfaces than `surface`."""

    start_m: Position
    mu_left: Friction
    mu_right: Friction
    surface: SurfaceName
    surface_left: SurfaceName | None = None
    surface_right: SurfaceName | None = None

    @property
    def surface_class(self) -> Surface:
        """The surface as class index."""
        return Surface[self.surface.upper()]

    @property
    def surface_classes(self) -> tuple[Surface, Surface]:
        """The surfaces of the left and of the right side."""
        left, right = (name or self.surface for name in (self.surface_left, self.surface_right))
        return Surface[left.upper()], Surface[right.upper()]


class RoadFile(_FileModel):
    """road.yaml: friction (theta) and surface along the road; the first segment also holds before it."""

    schema_: Literal[1] = Field(alias="schema")
    segments: Annotated[list[RoadSegment], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> RoadFile:
        starts = [s.start_m for s in self.segments]
        problems = [
            f"segments[{i + 1}].start_m is {b:g} after {a:g}; expected ascending starts."
            for i, (a, b) in enumerate(pairwise(starts))
            if b <= a
        ]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def segment_at(self, position_m: float) -> RoadSegment:
        """The segment at a position on the road [m]."""
        return next((s for s in reversed(self.segments) if s.start_m <= position_m), self.segments[0])


class Pulse(_FileModel):
    """A trapezoidal torque pulse that rises from start_s and falls to 0 at end_s, over ramp_s each [N m, s]."""

    start_s: Time
    end_s: Duration
    torque_nm: Torque
    ramp_s: Duration
    wheels: Annotated[list[WheelName], Field(min_length=1)] = ["fl", "fr", "rl", "rr"]

    @model_validator(mode="after")
    def _check(self) -> Pulse:
        if self.end_s - self.start_s < 2.0 * self.ramp_s:
            raise ValueError(
                f"the pulse from {self.start_s:g} to {self.end_s:g} s is shorter than its two ramps of "
                f"{self.ramp_s:g} s; expected end_s >= start_s + 2 ramp_s."
            )
        return self

    def torque(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torque of the pulse at these times, same shape [N m]."""
        rise = (time_s - self.start_s) / self.ramp_s
        fall = (self.end_s - time_s) / self.ramp_s
        return self.torque_nm * np.clip(np.minimum(rise, fall), 0.0, 1.0)


class Manoeuvre(_FileModel):
    """manoeuvre.yaml: torque pulses per wheel; where pulses of one wheel overlap they add up."""

    schema_: Literal[1] = Field(alias="schema")
    name: Name
    description: Description = ""
    pulses: list[Pulse]

    def torque(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commanded torque of the four wheels, shape (n, 4) [N m]."""
        total = np.zeros((len(time_s), len(WHEELS)))
        for pulse in self.pulses:
            columns = [WHEELS.index(w) for w in WHEELS if w in pulse.wheels]
            total[:, columns] += pulse.torque(np.asarray(time_s, dtype=np.float64))[:, None]
        return total

    def peak_torque_nm(self) -> float:
        """Largest driving torque of any wheel [N m]."""
        corners = [(p.start_s, p.start_s + p.ramp_s, p.end_s - p.ramp_s, p.end_s) for p in self.pulses]
        return float(self.torque(np.array(corners).ravel()).max(initial=0.0))


class End(_FileModel):
    """The end of a drive: a position of the front axle or a time, whichever is first."""

    position_m: Annotated[float, Field(gt=0.0, le=1e6)]
    time_s: Annotated[float, Field(gt=0.0, le=LONGEST_RUN_S)]


class SensorNoise(_FileModel):
    """Standard deviations of the sensors' white Gaussian noise; the defaults are ideal sensors."""

    wheel_speed_noise_rad_s: Noise = 0.0
    wheel_torque_noise_nm: Noise = 0.0
    vehicle_speed_noise_m_s: Noise = 0.0
    accel_x_noise_m_s2: Noise = 0.0


class Pictures(_FileModel):
    """Disturbance and storage of the camera's pictures."""

    disturbance: Literal["paper", "none"] = "none"
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 90
    fps: Annotated[float, Field(ge=0.1, le=1000.0)] = 20.0


class ScenarioFile(_FileModel):
    """The content of scenario.yaml; paths are relative to it."""

    schema_: Literal[1] = Field(alias="schema")
    name: Name
    description: Description = ""
    vehicle: Name
    road: Name
    camera: Name | None = None
    manoeuvre: Name
    step_s: Annotated[float, Field(ge=1e-4, le=0.02)]
    end: End
    sensors: SensorNoise = Field(default_factory=SensorNoise)
    pictures: Pictures = Field(default_factory=Pictures)
    wheel: WheelName = "fl"
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0


@dataclass(frozen=True)
class Scenario:
    """A scenario with the content of its files; camera_path is None without camera."""

    path: Path
    name: str
    description: str
    vehicle: VehicleFile
    road: RoadFile
    manoeuvre: Manoeuvre
    camera_path: Path | None
    step_s: float
    end: End
    sensors: SensorNoise
    pictures: Pictures
    wheel: WheelName
    seed: int


def load_vehicle(path: str | Path) -> VehicleFile:
    """The vehicle of a vehicle.yaml, or the shipped one of a name; raises ScenarioError."""
    return load_strict(located("vehicle", path), VehicleFile)


def load_road(path: str | Path) -> RoadFile:
    """The road of a road.yaml, or the shipped one of a name; raises ScenarioError."""
    return load_strict(located("road", path), RoadFile)


def load_manoeuvre(path: str | Path) -> Manoeuvre:
    """The manoeuvre of a manoeuvre.yaml, or the shipped one of a name; raises ScenarioError."""
    return load_strict(located("manoeuvre", path), Manoeuvre)


def load_scenario(path: str | Path) -> Scenario:
    """The scenario of a scenario.yaml, or the shipped one of a name, with its files; raises ScenarioError."""
    path = located("scenario", path)
    file = load_strict(path, ScenarioFile)
    problems: list[str] = []

    def resolve(key: str, relative: str, model: type[Model]) -> Model | None:
        try:
            return load_strict(path.parent / relative, model)
        except ScenarioError as error:
            problems.append(f"{path}: {key}: {error}")
            return None

    vehicle = resolve("vehicle", file.vehicle, VehicleFile)
    road = resolve("road", file.road, RoadFile)
    manoeuvre = resolve("manoeuvre", file.manoeuvre, Manoeuvre)
    camera_path = None if file.camera is None else path.parent / file.camera
    if camera_path is not None and not camera_path.is_file():
        problems.append(f"{path}: camera: {camera_path}: no such file; expected the camera's YAML file.")
    if vehicle and manoeuvre and manoeuvre.peak_torque_nm() > vehicle.motor_peak_torque_nm * (1.0 + 1e-9):
        problems.append(
            f"{path}: manoeuvre: drives a wheel with {manoeuvre.peak_torque_nm():g} N m; "
            f"expected at most the motor's peak of {vehicle.motor_peak_torque_nm:g} N m."
        )
    if problems or vehicle is None or road is None or manoeuvre is None:
        raise ScenarioError("\n".join(problems))
    return Scenario(
        path=path,
        name=file.name,
        description=file.description,
        vehicle=vehicle,
        road=road,
        manoeuvre=manoeuvre,
        camera_path=camera_path,
        step_s=file.step_s,
        end=file.end,
        sensors=file.sensors,
        pictures=file.pictures,
        wheel=file.wheel,
        seed=file.seed,
    )
