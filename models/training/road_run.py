"""One training of the road network: views, decoders, the surface of the road, its scale."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax

from .data import CLEAR_PARTS, Image, Picture, family_of
from .nets import RoadNet, enlarged
from .night import shown_family
from .progress import Steps
from .segmenter_data import Sample, night_view, plain_views, sample_of, training_views
from .train_segmenter import (
    Encoded,
    Encoder,
    SurfaceHead,
    learn_masks,
    learn_surface,
    pooled_features,
)

MASK_STEPS = 900
VIEW_SEED, NIGHT_SEED = 3, 5
SCALES = (0.05, 5.0)
"""Least and most that logits of sources left out are multiplied by, to be calibrated [-]."""
LEAST_OF_A_CLASS = 10
"""Pictures of a class that a source must have for it to count as much as others there [-]."""
SOURCES: dict[str, tuple[str, ...]] = {
    "cws8262": ("cws8262",),
    "BDD": ("bdd_day", "bdd_night"),
    "web": ("condition_web",),
    "CamVid": ("drivable_camvid",),
    "LUMS": ("drivable_lums",),
    "clips": ("seq_extreme", "seq_dry_yolop", "dry_udacity"),
    "other cameras": ("other_cameras",),
}
"""What is left out together, and its families."""


@dataclass(frozen=True)
class RoadMaterial:
    """What the network learns from and is judged on.

    Attributes
    ----------
    training : Encoded
        Random views of the training pictures and of rendered worlds.
    plain : Encoded
        All pictures as at run time.
    pictures : int64, shape (n,), number of the picture of each of `plain`
    learned, night : bool, shape (n,), whether that is a training picture, and whether it was taken by night
    """

    training: Encoded
    plain: Encoded
    pictures: NDArray[np.int64]
    learned: NDArray[np.bool_]
    night: NDArray[np.bool_]


@dataclass(frozen=True)
class Surfaces:
    """Pooled features of views with their classes and sources, aligned; and the same of the plain pictures."""

    features: NDArray[np.float32]
    labels: NDArray[np.int64]
    sources: NDArray[np.str_]
    plain: NDArray[np.float32]
    plain_labels: NDArray[np.int64]
    plain_families: NDArray[np.str_]

    def head(self, without: Sequence[str] = ()) -> SurfaceHead:
        """The head that is learned from all but some families."""
        families = np.array([shown_family(source) for source in self.sources.tolist()])
        kept = ~np.isin(families, without)
        return learn_surface(self.features[kept], self.labels[kept], self.sources[kept])

    def left_out(self) -> NDArray[np.float64]:
        """Logits of the plain pictures, each by the head that was learned without its source, shape (n, 3)."""
        logits = np.zeros((len(self.plain), 3))
        known = {family for families in SOURCES.values() for family in families}
        others = [(str(family),) for family in np.unique(self.plain_families) if family not in known]
        for families in (*SOURCES.values(), *others):
            own = np.isin(self.plain_families, families)
            if own.any():
                logits[own] = self.head(families).logits(self.plain[own])
        return logits


def gather(
    encoder: Encoder, shown: Sequence[Picture], rendered: Sequence[Sample], steps: Steps
) -> RoadMaterial:
    """Views of the pictures, and what the trunk makes of them."""
    views: list[Sample] = []
    plain: list[Sample] = []
    numbers: list[int] = []
    with steps("drawing views of pictures", len(shown)) as report:
        for number, picture in enumerate(shown):
            sample = sample_of(picture)
            own = plain_views(picture, sample)
            plain += own
            numbers += [number] * len(own)
            if picture.split == "train":
                views += training_views([sample], VIEW_SEED + number)
            report(number + 1, np.nan)
    views += training_views(rendered, VIEW_SEED)
    with steps("seeing training views", len(views)) as report:
        training = encoder(views, report)
    with steps("seeing pictures", len(plain)) as report:
        seen = encoder(plain, report)
    learned = np.array([shown[number].split == "train" for number in numbers])
    night = np.array([shown[number].night for number in numbers])
    return RoadMaterial(training, seen, np.array(numbers, np.int64), learned, night)


def surfaces(
    net: RoadNet, encoder: Encoder, material: RoadMaterial, shown: Sequence[Picture], steps: Steps
) -> Surfaces:
    """What the surface is read from: training pictures by day and by night, rendered ones, and all plain ones.

    `shown` are the pictures that the material was gathered from.
    """
    plain, training = material.plain, material.training
    features = pooled_features(net, plain)
    days = [
        at
        for at in np.flatnonzero(material.learned)
        if not material.night[at] and shown[material.pictures[at]].family not in CLEAR_PARTS
    ]  # fmt: skip
    nights: list[Sample] = []
    with steps("drawing nights", len(days)) as report:
        for done, at in enumerate(days, start=1):
            sample = sample_of(shown[material.pictures[at]])
            road = found_by(net, plain, int(at), sample.image.shape[:2])
            rng = np.random.default_rng([NIGHT_SEED, int(at)])
            nights.append(night_view(rng, replace(sample, drivable=road)))
            report(done, np.nan)
    with steps("seeing nights", len(nights)) as report:
        dark = encoder(nights, report)
    rendered = training.where((training.of("kind") == "rendered") & (training.of("surface") >= 0))
    learned = plain.where(material.learned)
    parts = [learned, dark, rendered]
    return Surfaces(
        np.concatenate([features[material.learned], *(pooled_features(net, part) for part in parts[1:])]),
        np.concatenate([part.of("surface") for part in parts]),
        np.concatenate([part.of("source") for part in parts]),
        features,
        plain.of("surface"),
        np.array([family_of(view.source) for view in plain.views]),
    )


@torch.no_grad()
def found_by(net: RoadNet, seen: Encoded, at: int, size: tuple[int, int]) -> Image:
    """The road that the net finds in one of the pictures, uint8 of a size (rows, columns)."""
    logits = enlarged(net.masks(seen.batch(slice(at, at + 1)))[0])[0].numpy()
    found = (logits > 0.0).astype(np.uint8)
    return np.asarray(cv2.resize(found, size[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)


def scale_of(logits: NDArray[np.float64], labels: NDArray[np.int64], families: NDArray[np.str_]) -> float:
    """Factor of logits of sources left out that makes the true classes likeliest, sources and classes alike [-]."""
    weights = np.zeros(len(labels))
    for family in np.unique(families):
        for label in np.unique(labels):
            chosen = (families == family) & (labels == label)
            weights[chosen] = 1.0 / max(chosen.sum(), LEAST_OF_A_CLASS)
    true = np.eye(logits.shape[1])[labels]

    def entropy(factor: float) -> float:
        return float(-np.sum(weights[:, None] * true * log_softmax(factor * logits, axis=1)))

    return float(minimize_scalar(entropy, bounds=SCALES, method="bounded").x)


@dataclass(frozen=True)
class Road:
    """The trained net and what it was made of.

    Attributes
    ----------
    net : RoadNet
    material : RoadMaterial
    surfaces : Surfaces
    left_out : array, shape (n, 3)
        Logits of the plain pictures, each from the head that was learned without its source.
    scale : float
        By which all logits are multiplied, in the net too [-].
    """

    net: RoadNet
    material: RoadMaterial
    surfaces: Surfaces
    left_out: NDArray[np.float64]
    scale: float


def teach_masks(net: RoadNet, seen: Encoded, given: argparse.Namespace, steps: Steps, what: str) -> None:
    """Teach the decoders for the share of `MASK_STEPS` that the command line asks for."""
    count = max(2, round(given.effort * MASK_STEPS))
    with steps(what, count) as report:
        learn_masks(net, seen, steps=count, seed=given.seed, report=report)


def trained(
    given: argparse.Namespace,
    pictures: Sequence[Picture],
    rendered: Sequence[Sample],
    steps: Steps,
) -> Road:
    """One training of the net."""
    torch.manual_seed(given.seed)
    net = RoadNet(pretrained=True).eval()
    encoder = Encoder(net, given.threads)
    shown = [picture for picture in pictures if picture.split != "gap"]
    material = gather(encoder, shown, rendered, steps)
    teach_masks(net, material.training, given, steps, "training the masks")
    seen = surfaces(net, encoder, material, shown, steps)
    left_out = seen.left_out()
    scale = scale_of(left_out, seen.plain_labels, seen.plain_families)
    seen.head().times(scale).into(net)
    return Road(net, material, seen, scale * left_out, scale)
