"""Wrong friction value of a surface class."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenarios.effects.base import Effect, parameter

if TYPE_CHECKING:
    from scenarios.perception import Frames


@dataclass(frozen=True)
class ClassFrictionOffset(Effect):
    """The road's friction differs from the value of its class (dry 0.8, wet 0.6, snow and ice 0.2), per class.

    The places of the classes stay; a friction reference lies beside the class's value.
    """

    id = "class_friction_offset"
    stage = "perception"
    subsystem = "camera"
    equation = "mu_reference = class value + offset of the class"
    source = "class values: section 4.1 of Tian et al. (2022), doi:10.3390/rs14215583"
    excited_by = "driving on each class with a friction reference"
    look_alikes = ("friction_offset",)

    dry: float = parameter(
        "-",
        "road's friction minus the dry class's",
        neutral=0.0,
        low=-0.7,
        high=0.7,
        starts=(-0.3, -0.1, 0.1),
    )
    wet: float = parameter(
        "-",
        "road's friction minus the wet class's",
        neutral=0.0,
        low=-0.5,
        high=0.7,
        starts=(-0.2, 0.2),
    )
    snow_ice: float = parameter(
        "-",
        "road's friction minus the snow and ice class's",
        neutral=0.0,
        low=-0.15,
        high=0.7,
        starts=(-0.1, 0.1, 0.3),
    )

    def perceive(self, frames: Frames) -> Frames:
        """The road has another friction than its class says."""
        offset = np.array([self.dry, self.wet, self.snow_ice])
        return replace(frames, class_friction=frames.class_friction + offset)
