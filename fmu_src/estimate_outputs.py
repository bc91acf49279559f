"""Which output of a unit holds which field of a wheel's estimate."""

from __future__ import annotations

from operator import attrgetter

from trpac_core import estimator_data

OUTPUT_NAMES = {"tyre_force_n": "tyre_force", "frame_age_s": "frame_age"}
"""Fields of the estimate whose unit is in the name; the FMI variable states it as an attribute."""

OUTPUTS = tuple(OUTPUT_NAMES.get(name, name) for name in estimator_data.OUTPUTS)
OF_ESTIMATE = attrgetter(*estimator_data.OUTPUTS)
"""The values of `OUTPUTS` of an estimate."""
