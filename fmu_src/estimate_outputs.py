"""Which output of a unit shows which field of a wheel's estimate."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from trpac_core import estimator_data

OUTPUT_NAMES = {"tyre_force_n": "tyre_force", "frame_age_s": "frame_age"}
"""Fields of the estimate whose unit is in the name; the FMI variable states it as an attribute."""

OF_ESTIMATE: dict[str, Callable[[Any], Any]] = {
    OUTPUT_NAMES.get(name, name): attrgetter(name) for name in estimator_data.OUTPUTS
}
"""What reads an output, by its name, from a wheel's estimate."""
