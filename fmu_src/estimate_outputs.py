"""Which output of a unit shows which field of a wheel's estimate."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from .signals import INTERVAL_OUTPUTS, OUTPUTS

FIELDS = {"tyre_force": "tyre_force_n", "frame_age": "frame_age_s", "TRPAC_source": "source"}
"""Fields of the estimate that have another name there: their unit is in it, or they are of nothing but TRPAC."""

OF_ESTIMATE: dict[str, Callable[[Any], Any]] = {
    v.name: attrgetter(FIELDS.get(v.name, v.name)) for v in (*OUTPUTS, *INTERVAL_OUTPUTS)
}
"""Reads each output, by its name, from a wheel's estimate."""
