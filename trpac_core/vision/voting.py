"""The baseline that the paper compares with [20]: a majority vote over patches of the whole drivable area.

No trajectory, no shadow removal, no history, no calibration; the networks are the estimator's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .classes import Surface
from .ife import MASK_THRESHOLD, PICTURE_SAY, fit_camera
from .networks import PatchClassifier, RoadMasks, RoadSegmenter
from .roi_sampling import cut_patch, roi_widths_px


@dataclass(frozen=True)
class VotingConfig:
    """Settings of the baseline.

    Parameters
    ----------
    camera : Camera
        The camera file.
    n_roi : int
        Patches per frame; the default is the fusion estimator's 4 + 6 + 8.
    roi_width_m : float
        Width of road that a patch shows [m].
    farthest_m : float
        Way ahead beyond which drivable road is not sampled: patches there are a few pixels of road [m].
    seed : int
        Of the drawing of patches.
    """

    camera: Camera = field(default_factory=Camera)
    n_roi: int = 18
    roi_width_m: float = 1.2
    farthest_m: float = 40.0
    seed: int = 0


@dataclass(frozen=True)
class VotingResult:
    """The class with most votes (None without drivable road), its share of the votes, and their number."""

    surface: Surface | None
    share: float
    n_roi: int


class Voting:
    """Majority vote over patches drawn evenly from the drivable area of the picture."""

    def __init__(self, config: VotingConfig, segmenter: RoadSegmenter, classifier: PatchClassifier) -> None:
        self.config = config
        self._segmenter = segmenter
        self._classifier = classifier

    def process(
        self, frame: int, image: NDArray[np.uint8], *, masks: RoadMasks | None = None
    ) -> VotingResult:
        """Vote on one BGR picture; `frame` counts the frames and seeds the drawing; raises ImageError."""
        camera = fit_camera(self.config.camera, image)
        masks = self._segmenter.segment(image) if masks is None else masks
        pixels, ground_m = self._drivable_cells(camera, masks)
        if not len(pixels):
            return VotingResult(None, 0.0, 0)
        generator = np.random.default_rng([self.config.seed, frame])
        drawn = generator.choice(len(pixels), min(self.config.n_roi, len(pixels)), replace=False)
        widths = roi_widths_px(camera, ground_m[drawn], self.config.roi_width_m)
        patches = [cut_patch(image, pixel, width) for pixel, width in zip(pixels[drawn], widths, strict=True)]
        logits = self._classifier.verdicts(np.stack(patches)).logits / self._classifier.temperature
        classes = (logits + PICTURE_SAY * masks.surface).argmax(axis=1)
        votes = np.bincount(classes, minlength=len(Surface))
        return VotingResult(Surface(int(votes.argmax())), float(votes.max() / votes.sum()), int(votes.sum()))

    def _drivable_cells(
        self, camera: Camera, masks: RoadMasks
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pixels and ground points of the mask's drivable cells within reach."""
        rows, columns = masks.drivable.shape
        cells = np.argwhere(masks.drivable > MASK_THRESHOLD)[:, ::-1]
        pixels = (cells + 0.5) * [camera.width_px / columns, camera.height_px / rows] - 0.5
        ground_m = camera.image_to_ground(pixels)
        with np.errstate(invalid="ignore"):
            within = (ground_m[:, 0] > 0.0) & (ground_m[:, 0] <= self.config.farthest_m)
        return pixels[within], ground_m[within]
