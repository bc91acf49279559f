"""Two results from one picture: the road ahead of the left wheels and of the right wheels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ife import Ife, IfeState, fit_camera, usable_road
from .ife_config import IfeConfig
from .networks import PatchClassifier, RoadSegmenter
from .results import FrameResult
from .trajectory import Motion


@dataclass(frozen=True)
class SidesState:
    """State of the two estimators."""

    left: IfeState = field(default_factory=IfeState)
    right: IfeState = field(default_factory=IfeState)

    def elsewhere(self) -> SidesState:
        """The state after the position was lost: no road ahead is known."""
        return SidesState(self.left.elsewhere(), self.right.elsewhere())

    def to_json(self) -> dict[str, Any]:
        """The state as JSON-able values, exact."""
        return {"left": self.left.to_json(), "right": self.right.to_json()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SidesState:
        """The state that `to_json` wrote."""
        return cls(IfeState.from_json(data["left"]), IfeState.from_json(data["right"]))


class SidesIfe:
    """Two image estimators, one per track, over one segmentation and one run of the classifier.

    Each side has its own ellipses, corners, patches, evidence weights and Q_v, as with an `Ife` of that side alone; the
    pictures' cost that does not depend on the side is paid once.
    """

    def __init__(self, config: IfeConfig, segmenter: RoadSegmenter, classifier: PatchClassifier) -> None:
        self.config = config
        self._segmenter = segmenter
        # Only the near group's verdict reaches a wheel (section 3.4).
        self._left = Ife(replace(config, side="left", groups_looked_at=1), segmenter, classifier)
        self._right = Ife(replace(config, side="right", groups_looked_at=1), segmenter, classifier)

    def process(
        self, state: SidesState, image: NDArray[np.uint8], motion: Motion
    ) -> tuple[SidesState, FrameResult, FrameResult]:
        """The state and the results after one frame.

        Parameters
        ----------
        state : SidesState
            After the frame before; `SidesState()` at first.
        image : array of uint8, shape (height, width, 3)
            The picture, BGR, of the camera's shape.
        motion : Motion
            Of the car when the picture was taken.

        Returns
        -------
        SidesState, FrameResult, FrameResult
            The state after the frame, and the verdicts on the left and on the right track.

        Raises
        ------
        ImageError
            If the picture is not 8-bit BGR or has another shape than the camera's.
        """
        camera = fit_camera(self.config.camera, image)
        masks = self._segmenter.segment(image)
        usable = usable_road(masks, self.config.remove_shadow)
        lines = self._left.lines(state.left, image, motion, camera)
        left = self._left.look(state.left, image, motion, camera, masks, usable, lines)
        right = self._right.look(state.right, image, motion, camera, masks, usable, lines)
        read = self._left.classify([*left, *right], masks)
        after_left, seen_left = self._left.judge(state.left, motion, read[: len(left)])
        after_right, seen_right = self._right.judge(state.right, motion, read[len(left) :])
        return SidesState(after_left, after_right), seen_left, seen_right
