"""Training of the surface classifier on undisturbed patches, and of its further heads."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from torch import Tensor
from torch.nn import functional

from .calibrate import cross_entropy
from .data import Image
from .looks import seen_anew
from .nets import SurfaceNet
from .patches import PatchSet, camera_spreads, draw_weights
from .progress import Report
from .trunk import LITE0, Kind, MixedStyle

BATCH = 256
"""Patches of a step."""
TRUNK_RATE, RATE = 1e-3, 2.5e-3
"""Learning rates of what has learned before, and of the rest."""
WEIGHT_DECAY = 2e-2
AVERAGING = 0.998
"""Decay of the running average of the weights; the average is exported."""
READING_RATE = 2e-3
DISTURBED_STEPS, DISTURBED_RATE, DISTURBED_DECAY, DISTURBED_DROPOUT = 400, 2e-3, 0.5, 0.5
"""Regularisation of the head for disturbed patches, which must generalise to roads never seen."""


def new_net(seed: int, kind: Kind = LITE0, *, styled: bool = False) -> SurfaceNet:
    """A net of one tower with its pretrained trunk, the rest untrained; it may learn from mixed styles."""
    torch.manual_seed(seed)
    net = SurfaceNet([kind], pretrained=True)
    if styled:
        net.towers[0].trunk.style = MixedStyle()
    return net


def learn_classes(
    net: SurfaceNet, patches: PatchSet, *, steps: int, seed: int, device: torch.device, report: Report
) -> SurfaceNet:
    """The net after training of the classes in one learning-rate cycle: running average of its weights, on the CPU.

    `patches` are drawn by `draw_weights`, each time as another camera sees them.
    """
    drawer = Drawer(patches, seed, device)
    torch.manual_seed(seed)
    net = net.to(device).train()
    if device.type == "cpu":
        net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    average = torch.optim.swa_utils.AveragedModel(net, multi_avg_fn=_running_average, use_buffers=True)
    parts = {name: p for name, p in net.named_parameters() if p.requires_grad}
    learned = [p for name, p in parts.items() if ".trunk." in name]
    new = [p for name, p in parts.items() if ".trunk." not in name]
    rates = [TRUNK_RATE, RATE]
    optimiser = torch.optim.AdamW(
        [{"params": part, "lr": rate} for part, rate in zip((learned, new), rates, strict=True)],
        weight_decay=WEIGHT_DECAY,
        fused=device.type == "cuda",
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rates, total_steps=steps, pct_start=0.15)
    for step in range(steps):
        loss = _loss(net, *drawer.draw(BATCH))
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        average.update_parameters(net)
        report(step + 1, float(loss.detach()) if step % 10 == 0 else np.nan)
    return average.module.to("cpu").eval()


class Drawer:
    """Training patches on a device, drawn by `draw_weights` and seen anew each time."""

    def __init__(self, patches: PatchSet, seed: int, device: torch.device):
        self.generator = torch.Generator(device).manual_seed(seed)
        self.patches = torch.from_numpy(patches.patches).to(device)
        self.labels = torch.from_numpy(patches.labels).to(device)
        self.spreads = torch.from_numpy(camera_spreads(patches)).float().to(device)
        self.shares = torch.from_numpy(draw_weights(patches)).to(device)

    def draw(self, count: int) -> tuple[Tensor, Tensor]:
        """Looks, uint8 (count, h, w, 3), and their class indices (count,)."""
        chosen = torch.multinomial(self.shares, count, replacement=True, generator=self.generator)
        return seen_anew(self.generator, self.patches[chosen], self.spreads[chosen]), self.labels[chosen]


@torch.no_grad()
def _running_average(averages: list[Tensor], current: list[Tensor], steps: Tensor | int) -> None:
    """Exponential running average in place, which forgets the first steps faster: short trainings have no others."""
    decay = min(AVERAGING, (1.0 + int(steps)) / (10.0 + int(steps)))
    if torch.is_floating_point(averages[0]):
        torch._foreach_lerp_(averages, current, 1.0 - decay)
    else:
        torch._foreach_copy_(averages, current)


def half_precision(device: torch.device) -> torch.autocast:
    """Maps in bfloat16 where that is faster; weights and losses keep 32 bits."""
    faster = device.type == "cuda" or torch.backends.cpu.get_cpu_capability() == "AVX512"
    return torch.autocast(device.type, dtype=torch.bfloat16, enabled=faster)


def _loss(net: SurfaceNet, looks: Tensor, labels: Tensor) -> Tensor:
    with half_precision(looks.device):
        maps = net.maps(looks)
    embedding = net.pool([each.float() for each in maps])
    return functional.cross_entropy(net.classifier(net.dropout(embedding)), labels)


def learn_reading(net: SurfaceNet, readable: Image, outliers: Image, *, steps: int, seed: int) -> None:
    """Train the head that separates readable road from all else; the rest of the net is frozen.

    `readable` and `outliers` are patches (n, 64, 96, 3); disturbed road counts as readable. `steps` is that of the
    optimiser.
    """
    torch.manual_seed(seed)
    features = torch.cat([embeddings(net, readable), embeddings(net, outliers)])
    labels = torch.cat([torch.ones(len(readable)), torch.zeros(len(outliers))])
    weights = torch.where(labels > 0, 0.5 / len(readable), 0.5 / len(outliers))
    optimiser = torch.optim.AdamW(net.reading.parameters(), lr=READING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for chosen in torch.multinomial(weights, steps * 512, replacement=True).view(steps, 512):
        loss = functional.binary_cross_entropy_with_logits(net.readable(features[chosen]), labels[chosen])
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        schedule.step()
    net.eval()


def learn_disturbed(net: SurfaceNet, clear: Image, disturbed: Image, *, seed: int) -> None:
    """Train the head for disturbed patches, without classes; the rest of the net is frozen."""
    torch.manual_seed(seed)
    features = torch.cat([embeddings(net, clear), embeddings(net, disturbed)])
    labels = torch.cat([torch.zeros(len(clear)), torch.ones(len(disturbed))])
    optimiser = torch.optim.AdamW(net.disturbed.parameters(), lr=DISTURBED_RATE, weight_decay=DISTURBED_DECAY)
    for _ in range(DISTURBED_STEPS):
        chosen = torch.randint(len(features), (512,))
        seen = functional.dropout(features[chosen], DISTURBED_DROPOUT)
        loss = functional.binary_cross_entropy_with_logits(net.disturbed(seen)[:, 0], labels[chosen])
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
    net.eval()


def learn_softening(net: SurfaceNet, patches: Image, labels: NDArray[np.int64]) -> Tensor:
    """Slope of the softening by how disturbed a patch looks, by the validation cross-entropy.

    Temperature scaling whose T depends on the picture (parameterised as in Tomani et al. 2022), T = T0 exp(slope d).
    """
    net.softening.data = torch.tensor(0.0)
    logits = verdicts_of(net, patches)[0]
    with torch.no_grad():
        looks = net.disturbance(embeddings(net, patches)).double().numpy()
    looks = looks.clip(-net.MOST_DISTURBED, net.MOST_DISTURBED)[:, None]

    def entropy(values: NDArray[np.float64]) -> float:
        return cross_entropy(logits * np.exp(-values[0] * looks), labels, float(np.exp(values[1])))

    found = minimize(entropy, (0.0, 0.0), method="Nelder-Mead")
    return torch.tensor(max(float(found.x[0]), 0.0))


@torch.no_grad()
def embeddings(net: SurfaceNet, patches: NDArray[np.uint8]) -> Tensor:
    """Pooled features of patches (n, 64, 96, 3), shape (n, embedding)."""
    net.eval()
    batches = [net.embed(batch) for batch in _batches(patches)]
    return torch.cat(batches) if batches else torch.empty((0, net.embedding))


@torch.no_grad()
def verdicts_of(
    net: SurfaceNet, patches: NDArray[np.uint8]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Logits (n, 3), and probability of readable road (n,), of patches (n, 64, 96, 3)."""
    net.eval()
    logits, readings = zip(*[net(batch) for batch in _batches(patches)], strict=True)
    return torch.cat(logits).double().numpy(), torch.cat(readings).double().numpy()


def _batches(patches: NDArray[np.uint8]) -> list[Tensor]:
    starts = range(0, len(patches), 256)
    return [torch.from_numpy(np.ascontiguousarray(patches[start : start + 256])) for start in starts]
