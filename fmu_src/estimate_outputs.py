"""Which output of a unit shows which field of a wheel's estimate."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from .signals import OUTPUTS

FIELDS = {"tyre_force": "tyre_force_n", "frame_age": "frame_age_s"}
"""Fields of the estimate whose unit is in the name; the FMI variable states it as an attribute."""

OF_ESTIMATE: dict[str, Callable[[Any], Any]] = {
    v.name: attrgetter(FIELDS.get(v.name, v.name)) for v in OUTPUTS
}
"""Reads each output, by its name, from a wheel's estimate."""
