"""camera.yaml: intrinsics and mounting of a camera."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from scenarios.library import located
from scenarios.strict import load_strict
from trpac_core.vision.camera import Camera

Pixels = Annotated[int, Field(ge=16, le=16384)]
Focal = Annotated[float, Field(ge=10.0, le=1e6)]
Point = Annotated[float, Field(ge=-1e5, le=1e5)]
Distortion = Annotated[float, Field(ge=-1e3, le=1e3)]
Height = Annotated[float, Field(ge=0.1, le=20.0)]
Offset = Annotated[float, Field(ge=-50.0, le=50.0)]
Rate = Annotated[float, Field(ge=0.01, le=1e4)]
Angle = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class CameraFile(BaseModel):
    """The content of camera.yaml."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    schema_: Literal[1] = Field(alias="schema")
    width_px: Pixels
    height_px: Pixels
    fx_px: Focal
    fy_px: Focal
    cx_px: Point
    cy_px: Point
    distortion: Annotated[list[Distortion], Field(min_length=5, max_length=5)]
    height_m: Height
    x_from_front_axle_m: Offset
    y_m: Offset
    pitch_rad: Angle
    yaw_rad: Angle
    roll_rad: Angle
    fps: Rate


def load_camera(path: str | Path) -> Camera:
    """The camera of camera.yaml, or the shipped one of a name; raises ScenarioError with all problems of the file."""
    values = load_strict(located("camera", path), CameraFile).model_dump(exclude={"schema_"})
    k1, k2, p1, p2, k3 = values.pop("distortion")
    return Camera(distortion=(k1, k2, p1, p2, k3), **values)
