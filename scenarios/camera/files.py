"""camera.yaml: intrinsics and mounting of a camera."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from scenarios.strict import load_strict
from trpac_core.vision.camera import Camera

Pixels = Annotated[int, Field(ge=16, le=16384)]
Positive = Annotated[float, Field(gt=0.0)]
Angle = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class CameraFile(BaseModel):
    """camera.yaml as written."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    schema_: Literal[1] = Field(alias="schema")
    width_px: Pixels
    height_px: Pixels
    fx_px: Positive
    fy_px: Positive
    cx_px: float
    cy_px: float
    distortion: Annotated[list[float], Field(min_length=5, max_length=5)]
    height_m: Positive
    x_from_front_axle_m: float
    y_m: float
    pitch_rad: Angle
    yaw_rad: Angle
    roll_rad: Angle
    fps: Positive


def load_camera(path: str | Path) -> Camera:
    """Read camera.yaml; raises one ScenarioError that lists all problems of the file."""
    values = load_strict(path, CameraFile).model_dump(exclude={"schema_"})
    k1, k2, p1, p2, k3 = values.pop("distortion")
    return Camera(distortion=(k1, k2, p1, p2, k3), **values)
