"""A drive towards a border across the road, picture by picture."""

from __future__ import annotations

import numpy as np
from ife_scene import CAMERA, DRY, SNOW, WET, Masks, paint

from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.trajectory import Motion

CONFIG = IfeConfig(camera=CAMERA, groups_looked_at=1)


def at(way_m: float | None) -> Motion:
    return Motion(10.0, way_m=way_m)


def road(border_m: float, before=DRY, beyond=SNOW):
    """A picture with a border across the road, so far ahead of the front axle."""
    return paint(lambda x, y: np.where(x < border_m, before, beyond))


def drive(config, classifier, ways_m, border_m=100.0, before=WET):
    ife, state, results = Ife(config, Masks(), classifier), IfeState(), []
    for way_m in ways_m:
        state, result = ife.process(state, road(border_m - way_m, before), at(way_m))
        results.append(result)
    return state, results
