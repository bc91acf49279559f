"""Training and scoring of the segmenter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from .data import IGNORE
from .nets import Segmenter
from .segmenter_data import Sample, draw_batch, plain_view

BATCH = 16
LEARNING_RATE = 3e-3
SHADOW_WEIGHT = 0.7


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


def batch_tensors(samples: Sequence[Sample]) -> tuple[Tensor, Tensor, Tensor]:
    """Pictures, drivable labels and shadow labels of samples of one size, stacked."""
    planes = [
        np.stack([getattr(sample, name) for sample in samples]) for name in ("image", "drivable", "shadow")
    ]
    return tuple(torch.from_numpy(plane) for plane in planes)  # type: ignore[return-value]


def train_segmenter(
    pools: dict[str, list[Sample]], *, steps: int, seed: int, report: Callable[[int, float], None]
) -> Segmenter:
    """Train for a number of steps under one learning-rate cycle; `report` gets the step and the loss."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = Segmenter().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimiser = torch.optim.AdamW(net.parameters(), lr=LEARNING_RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, total_steps=steps, pct_start=0.15
    )
    net.train()
    for step in range(steps):
        images, drivable, shadow = batch_tensors(draw_batch(rng, pools, BATCH))
        drivable_logits, shadow_logits = net(images)
        loss = task_loss(drivable_logits, drivable) + SHADOW_WEIGHT * task_loss(shadow_logits, shadow)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        report(step + 1, float(loss.detach()))
    return net.eval()


@torch.no_grad()
def score_segmenter(net: Segmenter, samples: Sequence[Sample], task: str) -> SegmentationScore:
    """Score one task, "drivable" or "shadow", on whole pictures at probability 0.5."""
    both = either = right = known_count = 0
    for start in range(0, len(samples), BATCH):
        views = [plain_view(sample) for sample in samples[start : start + BATCH]]
        images, drivable, shadow = batch_tensors(views)
        logits = net(images)[0 if task == "drivable" else 1]
        labels = drivable if task == "drivable" else shadow
        known = labels != IGNORE
        found, true = (logits > 0) & known, (labels == 1) & known
        both += int((found & true).sum())
        either += int((found | true).sum())
        right += int(((found == true) & known).sum())
        known_count += int(known.sum())
    return SegmentationScore(both, either, right, known_count, len(samples))
