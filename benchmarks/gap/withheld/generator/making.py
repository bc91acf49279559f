"""One door to every kind of case."""

from __future__ import annotations

from .camera_case import make_camera_case
from .camera_family import CameraFamily
from .cases import Case
from .cases import make_case as make_car_case
from .forms import Family
from .table import Spec


def make_case(spec: Spec, seed: int, family: Family, camera: CameraFamily = CameraFamily.FIRST) -> Case:
    """Draw a case: of a car, or of the camera on one with forms of that family; as `cases.make_case`."""
    if spec.camera:
        return make_camera_case(spec, seed, family, camera)
    return make_car_case(spec, seed, family)
