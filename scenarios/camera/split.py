"""Pictures of a road with different sides: two worlds of one scene, joined along the car's middle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.camera import Camera

from .renderer import Renderer, ground_beside
from .scene import RenderedFrame, Scene, SurfaceSegment


class _Side(Renderer):
    """The world of one side, with the exposure of both."""

    other: Renderer | None = None

    def _gains(self, position_m: float) -> NDArray[np.float32]:
        own = super()._gains(position_m)
        if self.other is None:
            return own
        return np.sqrt(own * Renderer._gains(self.other, position_m)).astype(np.float32)


class SplitRenderer:
    """Like `Renderer`, with a list of surfaces for each side of the lane's middle.

    The picture has one exposure: the geometric mean of those of the two sides.
    """

    def __init__(
        self,
        camera: Camera,
        left: Sequence[SurfaceSegment],
        right: Sequence[SurfaceSegment],
        scene: Scene,
    ) -> None:
        self._left, self._right = _Side(camera, left, scene), _Side(camera, right, scene)
        self._left.other, self._right.other = self._right, self._left
        self._on_left = ground_beside(camera) > 0.0

    def frame(self, front_axle_position_m: float) -> RenderedFrame:
        """The picture and labels from a car in its lane's middle; see `Renderer.frame`."""
        left, right = (side.frame(front_axle_position_m) for side in (self._left, self._right))
        on_left = self._on_left
        return RenderedFrame(
            np.where(on_left[..., None], left.image, right.image),
            np.where(on_left, left.drivable, right.drivable),
            np.where(on_left, left.shadow, right.shadow),
            np.where(on_left, left.surface, right.surface),
        )
