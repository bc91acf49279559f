"""Which output of a unit holds which field of a wheel's estimate."""

from __future__ import annotations

from dataclasses import fields
from operator import attrgetter

from trpac_core.estimator import Estimate

OUTPUT_NAMES = {"tyre_force_n": "tyre_force", "frame_age_s": "frame_age"}
"""Fields of the estimate whose unit is in the name; the FMI variable states it as an attribute."""

_FIELDS = [field.name for field in fields(Estimate) if field.name != "problem"]
OUTPUTS = tuple(OUTPUT_NAMES.get(name, name) for name in _FIELDS)
OF_ESTIMATE = attrgetter(*_FIELDS)
"""The values of `OUTPUTS` of an estimate."""
