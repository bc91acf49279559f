"""Wrong friction value of a surface class."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarios.effects.base import Effect, parameter
from scenarios.effects.frames import Frames
from trpac_core.vision.classes import CLASS_THETA, Surface


@dataclass(frozen=True)
class ClassFrictionOffset(Effect):
    """The friction values of the surface classes differ from dry 0.8, wet 0.6, snow and ice 0.2.

    The positions of the classes do not change; a friction reference differs from the usual value.
    """

    id = "class_friction_offset"
    stage = "perception"
    subsystem = "camera"
    equation = "mu_reference = value of the class on this road"
    source = "class values: section 4.1 of Tian et al. (2022), doi:10.3390/rs14215583"
    excited_by = "driving on every class with a friction reference"
    confounders = ("friction_offset",)

    dry: float = parameter(
        "-",
        "friction of the dry class",
        neutral=CLASS_THETA[Surface.DRY],
        low=0.1,
        high=1.5,
        starts=(0.5, 0.7, 0.9),
    )
    wet: float = parameter(
        "-",
        "friction of the wet class",
        neutral=CLASS_THETA[Surface.WET],
        low=0.1,
        high=1.3,
        starts=(0.4, 0.8),
    )
    snow_ice: float = parameter(
        "-",
        "friction of the snow and ice class",
        neutral=CLASS_THETA[Surface.SNOW_ICE],
        low=0.05,
        high=0.9,
        starts=(0.1, 0.3, 0.5),
    )

    def perceive(self, frames: Frames) -> Frames:
        """The road has another friction than its class says."""
        return replace(frames, class_friction=np.array([self.dry, self.wet, self.snow_ice]))
