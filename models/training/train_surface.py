"""Training of the surface classifier on undisturbed patches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from .nets import SurfaceNet
from .patches import PatchSet, augmented, draw_weights

BATCH = 96
LEARNING_RATE = 3e-3
WEIGHT_DECAY = 2e-2
AVERAGING = 0.995
"""Decay of the running average of the weights; the average is what ships."""

HINT_WEIGHT = 0.5
"""Weight of the teacher's features beside the cross-entropy, if there is a teacher."""


def train_surface(
    patches: PatchSet,
    *,
    steps: int,
    seed: int,
    report: Callable[[int, float], None],
    teacher: NDArray[np.float32] | None = None,
) -> SurfaceNet:
    """Train for a number of steps under one learning-rate cycle; `report` gets the step and the loss.

    `teacher`, shape (n, features), holds standardised features of each patch from a larger network: a linear map of
    the embedding learns to match them and is then thrown away.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = SurfaceNet()
    hint = nn.Linear(SurfaceNet.EMBEDDING, 1 if teacher is None else teacher.shape[1])
    average = torch.optim.swa_utils.AveragedModel(net, avg_fn=_running_average, use_buffers=True)
    parameters = [*net.parameters(), *hint.parameters()]
    optimiser = torch.optim.AdamW(parameters, lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, total_steps=steps, pct_start=0.15
    )
    weights = draw_weights(patches)
    net.train()
    for step in range(steps):
        chosen = rng.choice(len(patches), size=BATCH, p=weights)
        batch = torch.from_numpy(np.stack([augmented(rng, patches.patches[index]) for index in chosen]))
        embedding = net.embed(batch)
        logits = net.classifier(net.dropout(embedding))
        loss = functional.cross_entropy(logits, torch.from_numpy(patches.labels[chosen]))
        if teacher is not None:
            target = torch.from_numpy(teacher[chosen])
            loss = loss + HINT_WEIGHT * functional.mse_loss(hint(embedding), target)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(parameters, 5.0)
        optimiser.step()
        schedule.step()
        average.update_parameters(net)
        report(step + 1, float(loss.detach()))
    trained = average.module.eval()
    assert isinstance(trained, SurfaceNet)
    return trained


def _running_average(average: Tensor, current: Tensor, steps: Tensor | int) -> Tensor:
    """Exponential running average that forgets the first steps faster."""
    decay = min(AVERAGING, (1.0 + int(steps)) / (10.0 + int(steps)))
    return decay * average + (1.0 - decay) * current


@torch.no_grad()
def logits_of(net: SurfaceNet, patches: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Logits of patches (n, 64, 96, 3), shape (n, 3)."""
    batches = [
        net(torch.from_numpy(np.ascontiguousarray(patches[start : start + 256])))
        for start in range(0, len(patches), 256)
    ]
    return torch.cat(batches).double().numpy() if batches else np.empty((0, 3))
