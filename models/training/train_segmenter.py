"""Training and scoring of the road network: decoders and surface head on the features of a frozen trunk."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax
from torch import Tensor, nn
from torch.nn import functional

from trpac_core.vision.classes import Surface
from trpac_core.vision.onnx_runtime import ort

from .data import IGNORE
from .export import export_trunk
from .nets import RoadNet, enlarged
from .night import SHOWN, shown_family
from .progress import Report
from .segmenter_data import Sample, plain_view

BATCH = 32
LEARNING_RATE = 3e-3
SHADOW_WEIGHT = 0.7
AT_ONCE = 8
"""Pictures that the trunk sees in one run."""

MASK_SHARES = {"masked": 0.25, "street": 0.25, "campus": 0.1, "weak": 0.14, "rendered": 0.2, "night": 0.15}
"""Share of each kind of view in the training of the decoders; a kind that is not there leaves its to the others."""
SURFACE_SHARES = {
    "condition_web": 3.0,
    "cws8262": 3.0,
    "bdd_day": 2.0,
    "bdd_night": 2.0,
    "rendered": 1.5,
    "drivable_lums": 0.4,
    "dry_udacity": 0.4,
    "seq_dry_yolop": 0.3,
}
"""Relative share of each family in the regression of the surface, within a class; classes are equal. Others: 1. By
night a family counts as much again."""
RIDGE = 0.01
"""Half of the square of the weights, of features of unit length, counts so much in the loss [nat]."""


@dataclass(frozen=True)
class Encoded:
    """Views and the trunk's maps of them: float16, shapes (n, c, h, w), from fine to coarse."""

    views: Sequence[Sample]
    maps: tuple[NDArray[np.float16], ...]

    def batch(self, chosen: NDArray[np.intp] | slice) -> list[Tensor]:
        """Maps of some views."""
        return [torch.from_numpy(each[chosen]).float() for each in self.maps]

    def where(self, chosen: NDArray[np.bool_]) -> Encoded:
        """Some of the views."""
        some = [view for view, kept in zip(self.views, chosen, strict=True) if kept]
        return Encoded(some, tuple(each[chosen] for each in self.maps))

    def of(self, name: str) -> NDArray:
        """An attribute of all views, shape (n, ...)."""
        return np.stack([getattr(view, name) for view in self.views])


class Encoder:
    """The frozen pretrained trunk."""

    def __init__(self, net: RoadNet, threads: int) -> None:
        options = ort.SessionOptions()
        options.intra_op_num_threads = threads
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "trunk.onnx"
            export_trunk(net.trunk, file)
            self._session = ort.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])

    def __call__(self, views: Sequence[Sample], report: Report) -> Encoded:
        """The views with their maps; `report` gets how many are done, and no loss."""
        found = []
        for at in range(0, len(views), AT_ONCE):
            images = np.stack([view.image for view in views[at : at + AT_ONCE]])
            found.append([each.astype(np.float16) for each in self._session.run(None, {"images": images})])
            report(at + len(images), np.nan)
        return Encoded(views, tuple(np.concatenate(each) for each in zip(*found, strict=True)))


@dataclass(frozen=True)
class SegmentationScore:
    """Pixel counts over a set of pictures, unknown pixels left out."""

    both: int
    either: int
    right: int
    known: int
    pictures: int

    @property
    def iou(self) -> float:
        """Intersection over union of the positive class [-]."""
        return self.both / self.either if self.either else float("nan")

    @property
    def accuracy(self) -> float:
        """Share of known pixels that are right [-]."""
        return self.right / self.known if self.known else float("nan")


def task_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Cross-entropy plus a soft Dice term over the known pixels of one task."""
    known = (labels != IGNORE).float()
    target = (labels == 1).float()
    entropy = functional.binary_cross_entropy_with_logits(logits, target, weight=known, reduction="sum")
    positive = torch.sigmoid(logits) * known
    overlap = 2.0 * (positive * target).sum() + 1.0
    dice = 1.0 - overlap / (positive.sum() + (target * known).sum() + 1.0)
    return entropy / known.sum().clamp(min=1.0) + 0.5 * dice


def learn_masks(net: RoadNet, seen: Encoded, *, steps: int, seed: int, report: Report) -> RoadNet:
    """The net with its decoders trained in one learning-rate cycle; `report` gets the step and the loss.

    Views are drawn by `MASK_SHARES`; the trunk is frozen, so its features are computed once.
    """
    kinds, drivable, shadow = seen.of("kind"), seen.of("drivable"), seen.of("shadow")
    weights = np.zeros(len(kinds))
    for kind in np.unique(kinds):
        weights[kinds == kind] = MASK_SHARES[str(kind)] / (kinds == kind).sum()
    weights /= weights.sum()
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    parts = nn.ModuleList([net.enter, net.around, net.context, net.drivable, net.shadow]).train()
    net.training = True
    optimiser = torch.optim.AdamW(parts.parameters(), lr=LEARNING_RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, total_steps=steps, pct_start=0.15
    )
    for step in range(steps):
        chosen = np.sort(rng.choice(len(weights), BATCH, p=weights))
        found = net.masks(seen.batch(chosen))
        drivable_loss, shadow_loss = (
            task_loss(enlarged(logits), torch.from_numpy(labels[chosen]))
            for logits, labels in zip(found, (drivable, shadow), strict=True)
        )
        loss = drivable_loss + SHADOW_WEIGHT * shadow_loss
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(parts.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        report(step + 1, float(loss.detach()) if step % 10 == 0 else np.nan)
    return net.eval()


@torch.no_grad()
def pooled_features(net: RoadNet, seen: Encoded) -> NDArray[np.float32]:
    """What the net's surface is read from, of each view, shape (n, features)."""
    found = []
    for at in range(0, len(seen.views), BATCH):
        maps = seen.batch(slice(at, at + BATCH))
        found.append(net.pooled(maps, net.masks(maps)[0]).numpy())
    return np.concatenate(found)


@dataclass(frozen=True)
class SurfaceHead:
    """A linear map from pooled features to logits: `mean`, `deviation` (m,), `weights` (m, 3), `bias` (3,)."""

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    weights: NDArray[np.float64]
    bias: NDArray[np.float64]

    def logits(self, features: NDArray[np.floating]) -> NDArray[np.float64]:
        """Logits (n, 3) of features (n, m)."""
        return _standardised(features, self.mean, self.deviation) @ self.weights + self.bias

    def times(self, factor: float) -> SurfaceHead:
        """The head with all logits times a factor."""
        return SurfaceHead(self.mean, self.deviation, factor * self.weights, factor * self.bias)

    def into(self, net: RoadNet) -> None:
        """Put it into the net."""
        state = {
            "mean": self.mean,
            "deviation": self.deviation,
            "surface.weight": self.weights.T,
            "surface.bias": self.bias,
        }
        net.load_state_dict({name: torch.tensor(each) for name, each in state.items()}, strict=False)


def _standardised(
    features: NDArray[np.floating], mean: NDArray[np.float64], deviation: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.clip((features - mean) / deviation, -RoadNet.LIMIT, RoadNet.LIMIT)


def surface_weights(labels: NDArray[np.int64], sources: NDArray[np.str_]) -> NDArray[np.float64]:
    """What each view counts, shape (n,) [-]: classes alike, families within a class by `SURFACE_SHARES`."""
    families = np.array([shown_family(source) for source in sources.tolist()])
    shown = np.char.startswith(sources, SHOWN)
    weights = np.zeros(len(labels))
    for label in np.unique(labels):
        of_class = labels == label
        for family in np.unique(families[of_class]):
            for by_night in (False, True):
                chosen = of_class & (families == family) & (shown == by_night)
                weights[chosen] = SURFACE_SHARES.get(str(family), 1.0) / max(chosen.sum(), 1)
        weights[of_class] /= weights[of_class].sum()
    return weights / weights.sum()


def learn_surface(
    features: NDArray[np.float32], labels: NDArray[np.int64], sources: NDArray[np.str_]
) -> SurfaceHead:
    """The head by multinomial regression with a ridge, of views whose class is known."""
    mean, deviation = features.mean(axis=0, dtype=np.float64), features.std(axis=0, dtype=np.float64) + 1e-3
    shares = surface_weights(labels, sources)
    # A ridge on features of about unit length means the same whatever their number.
    scale = np.sqrt(features.shape[1] / 100.0)
    x = (_standardised(features, mean, deviation) / scale).astype(np.float32)
    m, k = x.shape[1], len(Surface)
    true = np.eye(k)[labels]

    def loss(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        weights, bias = flat[: m * k].reshape(m, k), flat[m * k :]
        z = (x @ weights.astype(np.float32)).astype(np.float64) + bias
        off = shares[:, None] * (softmax(z, axis=1) - true)
        value = -np.sum(shares[:, None] * true * log_softmax(z, axis=1)) + 0.5 * RIDGE * np.sum(weights**2)
        slope = x.T @ off.astype(np.float32) + RIDGE * weights
        return float(value), np.concatenate([slope.ravel(), off.sum(axis=0)])

    found = minimize(loss, np.zeros((m + 1) * k), jac=True, method="L-BFGS-B", options={"maxiter": 200}).x
    return SurfaceHead(mean, deviation, found[: m * k].reshape(m, k) / scale, found[m * k :])


@torch.no_grad()
def score_segmenter(net: RoadNet, samples: Sequence[Sample], task: str) -> SegmentationScore:
    """Score one task, "drivable" or "shadow", on whole pictures at probability 0.5."""
    both = either = right = known_count = 0
    for at in range(0, len(samples), BATCH):
        views = [plain_view(sample) for sample in samples[at : at + BATCH]]
        images, true = (
            torch.from_numpy(np.stack([getattr(view, name) for view in views])) for name in ("image", task)
        )
        logits = net(images)[0 if task == "drivable" else 1]
        known = true != IGNORE
        found, positive = (logits > 0) & known, (true == 1) & known
        both += int((found & positive).sum())
        either += int((found | positive).sum())
        right += int(((found == positive) & known).sum())
        known_count += int(known.sum())
    return SegmentationScore(both, either, right, known_count, len(samples))
