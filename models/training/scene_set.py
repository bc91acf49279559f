"""Patches with the pictures that they were cut from, for what a scene tells of its patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.networks import SurfaceClassifier
from trpac_core.vision.roi_sampling import PATCH_WIDTH_PX
from trpac_core.vision.scene import SCENE_HEIGHT_PX, SCENE_WIDTH_PX, scene_of

from .augment import camera_look
from .calibrate import noised
from .data import Image, Picture
from .keeping import keep_arrays
from .patches import PatchSet, camera_spreads, joined
from .rendered import Cut, patches_in, rendered_patches

AT_ONCE = 256
"""Patches that the network judges in one run."""


@dataclass(frozen=True)
class SceneSet:
    """Patches and, for each, its picture by `scene_of`, shape (n, 20, 32, 3)."""

    patches: PatchSet
    scenes: Image

    def __len__(self) -> int:
        return len(self.patches)

    def where(self, chosen: NDArray[np.bool_]) -> SceneSet:
        """The chosen patches alone."""
        return SceneSet(self.patches.where(chosen), self.scenes[chosen])

    def seen_anew(self, images: Image) -> SceneSet:
        """The set with other looks at its patches and scenes, each two as one picture by `as_one`."""
        patches, scenes = apart(images)
        old = self.patches
        return SceneSet(PatchSet(patches, old.labels, old.sources, old.pictures), scenes)

    def disturbed(self, seed: int) -> SceneSet:
        """As a disturbed camera would show both."""
        return self.seen_anew(noised(self.as_one(), seed))

    def by_other_cameras(self, rng: np.random.Generator) -> SceneSet:
        """As undisturbed cameras of another gain, gamma and white balance would show both."""
        spreads = camera_spreads(self.patches)
        looks = [camera_look(rng, *seen) for seen in zip(self.as_one(), spreads, strict=True)]
        return self.seen_anew(np.stack(looks))

    def as_one(self) -> Image:
        """Each scene, three times side by side, above its patch: what happens to a picture happens to both alike."""
        beside = PATCH_WIDTH_PX // SCENE_WIDTH_PX
        return np.concatenate([np.tile(self.scenes, (1, 1, beside, 1)), self.patches.patches], axis=1)

    def logits(self, classifier: SurfaceClassifier, *, alone: bool = False) -> NDArray[np.float64]:
        """The network's logits in the scenes, or of the patches alone, shape (n, 3)."""
        found = [
            classifier.verdicts(
                np.ascontiguousarray(self.patches.patches[first : first + AT_ONCE]),
                None if alone else self.scenes[first : first + AT_ONCE],
            ).logits
            for first in range(0, len(self), AT_ONCE)
        ]
        return np.concatenate(found) if found else np.empty((0, 3))


def apart(images: Image) -> tuple[Image, Image]:
    """Patches and scenes of `SceneSet.as_one`."""
    return images[:, SCENE_HEIGHT_PX:], images[:, :SCENE_HEIGHT_PX, :SCENE_WIDTH_PX]


def scenes_of_pictures(patches: PatchSet, pictures: Sequence[Picture]) -> SceneSet:
    """Patches that were cut from these pictures, in their scenes; the pictures in the order of their numbers."""
    scenes = np.stack([scene_of(picture.image()) for picture in pictures])
    return SceneSet(patches, scenes[patches.pictures])


def scenes_of_views(views: Sequence[tuple[Image, Cut]]) -> SceneSet:
    """Patches of rendered views in their scenes."""
    parts = [rendered_patches([cut]) for _, cut in views]
    scenes = [
        np.repeat(scene[None], len(part), axis=0) for (scene, _), part in zip(views, parts, strict=True)
    ]
    return SceneSet(joined(parts), np.concatenate(scenes))


def all_of(sets: Sequence[SceneSet]) -> SceneSet:
    """Several sets as one."""
    return SceneSet(joined([part.patches for part in sets]), np.concatenate([part.scenes for part in sets]))


def save_scenes(file: Path, scenes: SceneSet) -> None:
    """Keep a set in a .npz file."""
    keep_arrays(file, scenes=scenes.scenes, **vars(scenes.patches))


def load_scenes(file: Path) -> SceneSet:
    """A set kept by `save_scenes`."""
    with np.load(file) as kept:
        return SceneSet(patches_in(kept), kept["scenes"])
