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
from trpac_core.vision.scene import SceneHead, scene_numbers

from .data import Picture, family_of
from .keeping import keep_arrays, kept_or_made
from .night import SHOWN
from .patches import draw_weights, judged_patches
from .scene_run import Steps, gather, head_beside, regression
from .scene_set import AT_ONCE, SceneSet, scenes_of_pictures

WEIGHT, BIAS = "classifier.weight", "classifier.bias"
"""The head's arrays in the network's file: shapes (3, m) and (3,)."""
RIDGE = 0.06
"""Half of the square of how far the weights go from what they were counts so much in the loss [nat]."""


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
    numbers : float64, shape (n, 9), of the scenes, see `scene_numbers`
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
        return np.array([family_of(str(name).removeprefix(SHOWN)) for name in names])[index]


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

    def embed(self, seen: SceneSet) -> Embedded:
        """Patches as the towers see them, with the numbers of their scenes."""
        patches = seen.patches
        found = [
            self._session.run(self._outputs, {"patches": np.ascontiguousarray(part)})
            for part in np.split(patches.patches, range(AT_ONCE, len(patches), AT_ONCE))
        ]
        embeddings, softness = (np.concatenate(columns) for columns in zip(*found, strict=True))
        return Embedded(
            embeddings,
            softness.reshape(-1).astype(np.float64),
            scene_numbers(patches.patches, seen.scenes),
            patches.labels,
            patches.sources,
            patches.pictures,
        )


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
    """What scenes add to a head's logits."""
    return head_beside(train.numbers, train, logits_of(train, head))


def logits_of(seen: Embedded, head: Linear, scene: SceneHead | None = None) -> NDArray[np.float64]:
    """Logits (n, 3), as the network gives them, of patches alone or in their scenes."""
    alone = seen.softness[:, None] * head.logits(seen.embeddings)
    return alone if scene is None else alone + scene.standardised(seen.numbers) @ scene.weights + scene.bias


def training_set(
    towers: Towers, given: argparse.Namespace, pictures: Sequence[Picture], segmenter: Segmenter, steps: Steps
) -> Embedded:
    """The patches of `scene_run.gather` as they are: seen by other cameras they taught less of a source left out."""

    def make() -> Embedded:
        return towers.embed(gather(given, pictures, segmenter, steps))

    name = f"embedded-{towers.name}-{given.effort:g}{''.join(f'-without-{s}' for s in sorted(given.without))}.npz"
    return kept_or_made(given.kept, name, load=_load, make=make, save=_save)


def judged_set(towers: Towers, given: argparse.Namespace, pictures: Sequence[Picture]) -> Embedded:
    """The fixed patches of pictures, whatever their split, in their scenes; pictures by their place in the sequence."""
    make = partial(_judged, towers, pictures)
    return kept_or_made(given.kept, f"embedded-{towers.name}-judged.npz", load=_load, make=make, save=_save)


def _judged(towers: Towers, pictures: Sequence[Picture]) -> Embedded:
    return towers.embed(scenes_of_pictures(judged_patches(pictures), pictures))


def _save(file: Path, embedded: Embedded) -> None:
    keep_arrays(file, **vars(embedded))


def _load(file: Path) -> Embedded:
    with np.load(file) as kept:
        return Embedded(**kept)
