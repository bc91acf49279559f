"""Surface classes of the camera side."""

from __future__ import annotations

from enum import IntEnum


class Surface(IntEnum):
    """Road surface class; the values are those of the class index in logs and networks."""

    DRY = 0
    WET = 1
    SNOW_ICE = 2

    @property
    def label(self) -> str:
        """Name as in files: dry, wet or snow_ice."""
        return self.name.lower()


CLASS_THETA = {Surface.DRY: 0.8, Surface.WET: 0.6, Surface.SNOW_ICE: 0.2}
"""Empirical adhesion of each class [-] (section 4.1 of Tian et al. 2022)."""
