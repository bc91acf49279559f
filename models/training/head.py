"""The classifier's linear head, learned anew on the towers of a network that has been trained: minutes on two cores."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.networks import Segmenter
from trpac_core.vision.onnx_runtime import ort
from trpac_core.vision.scene import NUMBERS, SceneHead, scene_numbers

from .augment import camera_look
from .data import Image, Picture, family_of, trained_on
from .keeping import keep_arrays, kept_or_made
from .patches import PatchSet, camera_spreads, draw_weights, judged_patches, training_patches
from .scene_run import Steps, gather, head_beside, regression
from .scene_set import AT_ONCE, SceneSet, scenes_of_pictures
from .weathered import weathered

WEIGHT, BIAS = "classifier.weight", "classifier.bias"
"""The head's arrays in the network's file: shapes (3, m) and (3,)."""
RIDGE = 0.06
"""Half of the square of how far the weights go from what they were counts so much in the loss [nat]."""
CUTTING_SEED = 41
SHOWN_ANEW = ("weathered/", "night/")
"""What the origin of pictures shown in other weather or light begins with."""


@dataclass(frozen=True)
class Linear:
    """A linear head: `weights` (m, 3) and `bias` (3,)."""

    weights: NDArray[np.float64]
    bias: NDArray[np.float64]

    def logits(self, embeddings: NDArray[np.float32]) -> NDArray[np.float64]:
        """Logits (n, 3) of embeddings (n, m)."""
        return (embeddings @ self.weights.astype(np.float32)).astype(np.float64) + self.bias


@dataclass(frozen=True)
class Embedded:
    """Patches by what the towers make of them, aligned along the first axis.

    Attributes
    ----------
    embeddings : float32, shape (n, m)
    softness : float64, shape (n,), factor of the logits of patches that look disturbed [-]
    numbers : float64, shape (n, 9), of the scenes; NaN where a patch came without its picture
    labels : int64, shape (n,), class index
    sources : str, shape (n,), see `Picture.origin`
    pictures : int64, shape (n,), number of the picture that the patch was cut from
    """

    embeddings: NDArray[np.float32]
    softness: NDArray[np.float64]
    numbers: NDArray[np.float64]
    labels: NDArray[np.int64]
    sources: NDArray[np.str_]
    pictures: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> Embedded:
        """The chosen patches alone."""
        return Embedded(*(column[chosen] for column in vars(self).values()))

    @property
    def families(self) -> NDArray[np.str_]:
        """Family of the camera that took each patch, however it is shown, shape (n,)."""
        names, index = np.unique(self.sources, return_inverse=True)
        return np.array([family_of(taken_by(str(name))) for name in names])[index]


def taken_by(origin: str) -> str:
    """The source of pictures of an origin, however they are shown."""
    for shown in SHOWN_ANEW:
        origin = origin.removeprefix(shown)
    return origin


class Towers:
    """The towers of a surface network's file, and the head on them."""

    def __init__(self, file: Path, threads: int) -> None:
        """Load a file that `export.export_surface` has written."""
        import onnx

        model = onnx.load(str(file))
        arrays = {array.name: onnx.numpy_helper.to_array(array) for array in model.graph.initializer}
        self.head = Linear(arrays[WEIGHT].T.astype(np.float64), arrays[BIAS].astype(np.float64))
        (product,) = (node for node in model.graph.node if WEIGHT in node.input)
        (softened,) = (node for node in model.graph.node if product.output[0] in node.input)
        (softness,) = (name for name in softened.input if name != product.output[0])
        self._outputs = [product.input[0], softness]
        for name in self._outputs:
            model.graph.output.append(onnx.helper.make_empty_tensor_value_info(name))
        for array in model.graph.initializer:
            if array.name in (WEIGHT, BIAS):
                array.CopyFrom(onnx.numpy_helper.from_array(np.zeros_like(arrays[array.name]), array.name))
        del model.metadata_props[:]
        content = model.SerializeToString()
        self.name = hashlib.sha256(content).hexdigest()[:12]
        """Of the towers, whatever head stands on them."""
        options = ort.SessionOptions()
        options.intra_op_num_threads = threads
        self._session = ort.InferenceSession(content, options, providers=["CPUExecutionProvider"])

    def embed(self, patches: PatchSet, numbers: NDArray[np.float64] | None = None) -> Embedded:
        """Patches as the towers see them, with the numbers of their scenes where there are some."""
        found = [
            self._session.run(self._outputs, {"patches": np.ascontiguousarray(part)})
            for part in np.split(patches.patches, range(AT_ONCE, len(patches), AT_ONCE))
        ]
        embeddings, softness = (np.concatenate(columns) for columns in zip(*found, strict=True))
        blank = np.full((len(patches), len(NUMBERS)), np.nan)
        return Embedded(
            embeddings,
            softness.reshape(-1).astype(np.float64),
            blank if numbers is None else numbers,
            patches.labels,
            patches.sources,
            patches.pictures,
        )

    def embed_in_scenes(self, seen: SceneSet) -> Embedded:
        """Patches as the towers see them, with the numbers of their scenes."""
        return self.embed(seen.patches, scene_numbers(seen.patches.patches, seen.scenes))


def with_head(file: Path, head: Linear) -> None:
    """Put a head into a network's file, in place of the one that is there."""
    import onnx

    model = onnx.load(str(file))
    for array in model.graph.initializer:
        if array.name in (WEIGHT, BIAS):
            new = head.weights.T if array.name == WEIGHT else head.bias
            array.CopyFrom(onnx.numpy_helper.from_array(new.astype(np.float32), array.name))
    onnx.save(model, str(file))


def learn(train: Embedded, head: Linear) -> Linear:
    """The head that makes the labels likeliest, drawn towards the one that is there by a ridge."""
    weights, bias = regression(
        train.embeddings, train.labels, draw_weights(train), head.logits(train.embeddings), RIDGE
    )
    return Linear(head.weights + weights, head.bias + bias)


def learn_scene(train: Embedded, head: Linear) -> SceneHead:
    """What scenes add to a head's logits, of the patches that came with their pictures."""
    beside = train.where(~np.isnan(train.numbers[:, 0]))
    return head_beside(beside.numbers, beside, logits_of(beside, head))


def logits_of(seen: Embedded, head: Linear, scene: SceneHead | None = None) -> NDArray[np.float64]:
    """Logits (n, 3), as the network gives them, of patches alone or in their scenes."""
    alone = seen.softness[:, None] * head.logits(seen.embeddings)
    return alone if scene is None else alone + scene.standardised(seen.numbers) @ scene.weights + scene.bias


def training_set(
    towers: Towers, given: argparse.Namespace, pictures: Sequence[Picture], segmenter: Segmenter, steps: Steps
) -> Embedded:
    """Training patches as other cameras show them: those of `scene_run.gather`, and dry ones in other weather."""

    def make() -> Embedded:
        rng = np.random.default_rng(CUTTING_SEED)
        real = trained_on(pictures, given.without)
        anew = _by_other_cameras(rng, training_patches(weathered(real, CUTTING_SEED), CUTTING_SEED))
        beside = gather(given, pictures, segmenter, steps).by_other_cameras(rng)
        return together([towers.embed(anew), towers.embed_in_scenes(beside)])

    name = f"embedded-{towers.name}-{given.effort:g}{''.join(f'-without-{s}' for s in sorted(given.without))}.npz"
    return kept_or_made(given.kept, name, load=_load, make=make, save=_save)


def judged_set(towers: Towers, given: argparse.Namespace, pictures: Sequence[Picture]) -> Embedded:
    """The fixed patches of pictures, whatever their split, in their scenes; pictures by their place in the sequence."""
    make = partial(_judged, towers, pictures)
    return kept_or_made(given.kept, f"embedded-{towers.name}-judged.npz", load=_load, make=make, save=_save)


def _judged(towers: Towers, pictures: Sequence[Picture]) -> Embedded:
    return towers.embed_in_scenes(scenes_of_pictures(judged_patches(pictures), pictures))


def together(parts: Sequence[Embedded]) -> Embedded:
    """Several sets as one, picture numbers kept apart."""
    offsets = np.cumsum([0] + [int(part.pictures.max(initial=-1)) + 1 for part in parts])
    columns = [np.concatenate(same) for same in zip(*(vars(p).values() for p in parts), strict=True)]
    shifted = [part.pictures + offset for part, offset in zip(parts, offsets[:-1], strict=True)]
    return Embedded(*columns[:-1], np.concatenate(shifted))


def _by_other_cameras(rng: np.random.Generator, patches: PatchSet) -> PatchSet:
    looks: list[Image] = [
        camera_look(rng, *seen) for seen in zip(patches.patches, camera_spreads(patches), strict=True)
    ]
    return PatchSet(np.stack(looks), patches.labels, patches.sources, patches.pictures)


def _save(file: Path, embedded: Embedded) -> None:
    keep_arrays(file, **vars(embedded))


def _load(file: Path) -> Embedded:
    with np.load(file) as kept:
        return Embedded(**kept)
