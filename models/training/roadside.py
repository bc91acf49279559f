"""Trees and houses painted beside the rendered roads' scenes: the renderer knows but sky, and hills far away.

Under a row of trees the upper half of a picture is darker than the road, which in rendered worlds only snow brings
about. Reduced to 20 x 32 pixels, what stands beside a road is a mass of a colour, to the left and to the right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.scene import SCENE_HEIGHT_PX, SCENE_WIDTH_PX

from .data import Image

OVERGROWN, UNDER_LEAVES = 0.7, 0.25
"""Share of the roads that have something beside them, and of those the share that leaves hang over [-]."""
FOOT_PX = SCENE_HEIGHT_PX // 2
"""Row down to which trees and houses reach, about the horizon."""
WIDEST_PX, LOWEST_TOP_PX, STEEPEST = 18.0, 8.0, 0.6
"""Most columns of one side, lowest row of its top at the picture's edge, and its most fall from there on [-]."""
MASS, LEAVES = (0.2, 1.0), (0.2, 0.8)
"""How bright it is, as a share of the ground's mean [-]."""
TINTS, GRAIN = (0.75, 1.2), (0.75, 1.25)
"""Of each channel of a mass, and of each pixel in it [-]."""
LEAF_COVER = 0.9
"""Share of the sky that leaves overhead hide [-]."""
Colours = NDArray[np.float64]


def with_roadsides(scenes: Image, seed: int) -> Image:
    """Reduced pictures (n, 20, 32, 3) of open land, most of them with trees and houses beside the road."""
    rng = np.random.default_rng(seed)
    painted = scenes.copy()
    for number in np.flatnonzero(rng.random(len(scenes)) < OVERGROWN):
        scene = scenes[number].astype(np.float64)
        ground = scene[FOOT_PX:].mean(axis=(0, 1))
        _stand(rng, scene, ground)
        _stand(rng, scene[:, ::-1], ground)
        if rng.random() < UNDER_LEAVES:
            _overhang(rng, scene, ground)
        painted[number] = np.clip(scene + 0.5, 0.0, 255.0)
    return painted


def _stand(rng: np.random.Generator, scene: Colours, ground: Colours) -> None:
    """What stands at the left edge of a scene, in place: highest there, lower towards the road's end."""
    columns = np.arange(int(rng.uniform(0.0, WIDEST_PX)))
    falling = rng.uniform(0.0, LOWEST_TOP_PX) + rng.uniform(0.0, STEEPEST) * columns
    tops = np.round(falling + rng.uniform(-1.0, 1.0, len(columns)))
    there = np.zeros(scene.shape[:2], np.bool_)
    there[:FOOT_PX, columns] = np.arange(FOOT_PX)[:, None] >= tops
    _paint(rng, scene, there, ground * rng.uniform(*MASS))


def _overhang(rng: np.random.Generator, scene: Colours, ground: Colours) -> None:
    """Leaves over the road, in place, through which some sky shows."""
    there = np.zeros(scene.shape[:2], np.bool_)
    rows = int(rng.uniform(1.0, LOWEST_TOP_PX))
    there[:rows] = rng.random((rows, SCENE_WIDTH_PX)) < LEAF_COVER
    _paint(rng, scene, there, ground * rng.uniform(*LEAVES))


def _paint(rng: np.random.Generator, scene: Colours, there: NDArray[np.bool_], colour: Colours) -> None:
    """Some pixels of a scene, in place, in a colour with a tint of its own, each brighter or darker than it."""
    scene[there] = colour * rng.uniform(*TINTS, 3) * rng.uniform(*GRAIN, (np.count_nonzero(there), 1))
