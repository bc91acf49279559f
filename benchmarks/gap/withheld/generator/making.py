"""One door to every kind of case."""

from __future__ import annotations

from .camera_case import make_camera_case
from .cases import Case
from .cases import make_case as make_car_case
from .forms import PLAIN, Edition
from .table import Spec


def make_case(spec: Spec, seed: int, edition: Edition = PLAIN) -> Case:
    """Draw a case: of a car, or of the camera on one; as `cases.make_case`."""
    if spec.camera:
        return make_camera_case(spec, seed, edition)
    return make_car_case(spec, seed, edition)
