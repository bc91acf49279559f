"""How the pictures that a log names are exposed: their light, and what is clipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sim2real.perception.frames import Results
from trpac_core.vision.images import ImageError, decode_image

Array = NDArray[np.float64]

MOST_PICTURES = 24
"""Pictures that are read per log, evenly spread."""
FEWEST_PICTURES = 4
ROAD_BOX = (0.2, 0.55, 0.8, 0.95)
"""Where road is in the picture of a forward camera: left, top, right, bottom [of its size]."""
DISPLAY_GAMMA = 2.2
NORMAL_LIGHT_EV = -0.4
"""Normal mean light of the road in a picture, against 18 % grey: over eleven cameras' road pictures -0.5 [stops]."""
LIGHT_SPREAD_EV = 1.1
"""Standard deviation of it from camera to camera, road to road [stops]."""
MOST_LIGHT_EV = 2.3
"""Mean light of a picture that is nearly white: exposure cannot raise it further [stops]."""
WHITE, BLACK = 250, 5
"""Grey levels from which on, and up to which, a pixel is clipped [8-bit levels]."""
USUAL_WHITE, USUAL_BLACK = 0.0128, 0.025
"""Scale of the clipped share of well exposed road: 2 % of pictures have more than 5 % white, or 10 % black [-]."""
MOST_NATS = 5.0
"""What clipping may say at most: a bright sky in the box, or a dark bonnet, clip too [nats]."""


@dataclass(frozen=True)
class Light:
    """Exposure of some pictures: mean light against 18 % grey [stops], shares of clipped pixels [-], how many."""

    level_ev: float
    white_share: float
    black_share: float
    count: int

    def log_likelihood(self, stops: Array) -> Array:
        """Of the pictures under exposure errors, same shape [nats], but for a constant."""
        expected = np.minimum(NORMAL_LIGHT_EV + stops, MOST_LIGHT_EV)
        level = -0.5 * ((self.level_ev - expected) / LIGHT_SPREAD_EV) ** 2
        white = min(self.white_share / USUAL_WHITE, MOST_NATS) * np.exp(-(np.maximum(stops, 0.0) ** 2))
        black = min(self.black_share / USUAL_BLACK, MOST_NATS) * np.exp(-(np.minimum(stops, 0.0) ** 2))
        return level - white - black


def read_light(results: Sequence[Results], folders: Sequence[Path]) -> tuple[Light | None, tuple[str, ...]]:
    """Exposure of the pictures of some drives, each relative to its folder; None where too few can be read."""
    levels, white, black, warnings = [], [], [], []
    for one, folder in zip(results, folders, strict=True):
        named = np.flatnonzero(one.picture != "")
        chosen = named[
            np.unique(np.linspace(0, len(named) - 1, min(MOST_PICTURES, len(named))).astype(np.intp))
        ]
        unread = []
        for k in chosen:
            try:
                grey = _road_grey(folder / str(one.picture[k]))
            except ImageError as error:
                unread.append(str(error))
                continue
            levels.append(np.log2(max(float(((grey / 255.0) ** DISPLAY_GAMMA).mean()), 1e-4) / 0.18))
            white.append(float((grey >= WHITE).mean()))
            black.append(float((grey <= BLACK).mean()))
        if unread:
            warnings.append(f"{one.log}: {len(unread)} of {len(chosen)} pictures looked at: {unread[0]}")
    if len(levels) < FEWEST_PICTURES:
        return None, tuple(warnings)
    return Light(float(np.mean(levels)), float(np.mean(white)), float(np.mean(black)), len(levels)), tuple(
        warnings
    )


def _road_grey(path: Path) -> NDArray[np.uint8]:
    """Grey levels of a picture's road; raises ImageError."""
    image = decode_image(path)
    height, width = image.shape[:2]
    left, top, right, bottom = (np.array(ROAD_BOX) * [width, height, width, height]).astype(int)
    return cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
