"""Training of the surface classifier on undisturbed patches, in two stages, and of its reading head."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from torch import Tensor, nn
from torch.nn import functional

from .calibrate import cross_entropy
from .data import Image
from .looks import seen_anew
from .nets import SurfaceNet
from .patches import PatchSet, camera_spreads, draw_weights
from .teacher import MAP_CELLS, Teacher

BATCH, HINTED = 256, 96
"""Patches of a step, and those of them that the teacher sees too; the first stage draws these alone."""
FIRST_RATE, CLASS_RATE = 3e-3, 2.5e-3
"""Learning rates of the two stages."""
WEIGHT_DECAY = 2e-2
AVERAGING = 0.998
"""Decay of the running average of the weights; the average is what ships."""

MAP_WEIGHT, POOLED_WEIGHT = 1.0, 1.0
"""Weights of the teacher's maps and pooled features in the first stage."""
HINT_SHARE = 0.5
"""Share of both beside the cross-entropy in the second stage."""
STANDARDISED = 2048
"""Patches over which the teacher's features are standardised."""
READING_RATE = 2e-3
DISTURBED_STEPS, DISTURBED_RATE, DISTURBED_DECAY, DISTURBED_DROPOUT = 400, 2e-3, 0.5, 0.5
"""The head that tells disturbed patches must hold on roads never seen, so it is kept weak."""

Report = Callable[[int, float], None]


class Taught(NamedTuple):
    """A net with the linear maps by which its features are held against the teacher's; only the net ships."""

    net: SurfaceNet
    maps: nn.Conv2d
    pooled: nn.Linear

    def parts(self) -> nn.ModuleList:
        """All three as one module."""
        return nn.ModuleList(self)


def new_student(seed: int) -> Taught:
    """An untrained net with its maps to the teacher's features."""
    torch.manual_seed(seed)
    net = SurfaceNet()
    middle = net.STAGES[1][0]
    return Taught(net, nn.Conv2d(middle, Teacher.MAPS, 1), nn.Linear(net.EMBEDDING, Teacher.POOLED))


def learn_features(
    student: Taught,
    patches: PatchSet,
    teacher: Teacher,
    *,
    steps: int,
    seed: int,
    device: torch.device,
    report: Report,
) -> Taught:
    """First stage: the net learns to see what the teacher sees; no label is used."""
    shares = np.full(len(patches), 1.0 / len(patches))
    drawer = Drawer(patches, shares, HINTED, seed, device)
    return _train(student, drawer, teacher.to(device), steps, FIRST_RATE, report, hint=1.0, classes=0.0)


def learn_classes(
    student: Taught,
    patches: PatchSet,
    teacher: Teacher | None,
    *,
    steps: int,
    seed: int,
    device: torch.device,
    report: Report,
) -> Taught:
    """Second stage: the classes. Where there is a teacher its features are kept in view."""
    drawer = Drawer(patches, draw_weights(patches), BATCH, seed, device)
    hint = 0.0 if teacher is None else HINT_SHARE
    teacher = None if teacher is None else teacher.to(device)
    return _train(student, drawer, teacher, steps, CLASS_RATE, report, hint=hint, classes=1.0)


class Drawer:
    """Training patches on a device, drawn by their shares and seen anew each time."""

    def __init__(
        self, patches: PatchSet, shares: NDArray[np.float64], batch: int, seed: int, device: torch.device
    ):
        self.generator = torch.Generator(device).manual_seed(seed)
        self.batch = batch
        self.patches = torch.from_numpy(patches.patches).to(device)
        self.labels = torch.from_numpy(patches.labels).to(device)
        self.spreads = torch.from_numpy(camera_spreads(patches)).float().to(device)
        self.shares = torch.from_numpy(shares).to(device)

    def draw(self, count: int) -> tuple[Tensor, Tensor]:
        """Looks, uint8 (count, h, w, 3), and their class indices (count,)."""
        chosen = torch.multinomial(self.shares, count, replacement=True, generator=self.generator)
        return seen_anew(self.generator, self.patches[chosen], self.spreads[chosen]), self.labels[chosen]


def _train(
    student: Taught,
    drawer: Drawer,
    teacher: Teacher | None,
    steps: int,
    rate: float,
    report: Report,
    *,
    hint: float,
    classes: float,
) -> Taught:
    """One learning-rate cycle; the running average of the weights comes back, on the processor."""
    device = drawer.patches.device
    torch.manual_seed(drawer.generator.initial_seed())
    modules = student.parts().to(device).train()
    if device.type == "cpu":
        student.net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if teacher is not None:
        teacher.standardise(drawer.draw(STANDARDISED)[0])
    average = torch.optim.swa_utils.AveragedModel(modules, multi_avg_fn=_running_average, use_buffers=True)
    optimiser = torch.optim.AdamW(
        modules.parameters(), lr=rate, weight_decay=WEIGHT_DECAY, fused=device.type == "cuda"
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.15)
    for step in range(steps):
        loss = _loss(student, *drawer.draw(drawer.batch), teacher, hint, classes)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(modules.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        average.update_parameters(modules)
        report(step + 1, float(loss.detach()) if step % 10 == 0 else np.nan)
    net, maps, pooled = average.module.to("cpu").eval()
    return Taught(net, maps, pooled)


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


def _loss(
    student: Taught, looks: Tensor, labels: Tensor, teacher: Teacher | None, hint: float, classes: float
) -> Tensor:
    with half_precision(looks.device):
        middle, last = student.net.maps(looks)
    middle, last = middle.float(), last.float()
    embedding = student.net.pool(middle, last)
    loss = torch.zeros((), device=looks.device)
    if classes:
        logits = student.net.classifier(student.net.dropout(embedding))
        loss = loss + classes * functional.cross_entropy(logits, labels)
    if teacher is not None:
        with torch.no_grad(), half_precision(looks.device):
            pooled, maps = teacher(looks[:HINTED])
        seen = functional.adaptive_avg_pool2d(student.maps(middle[:HINTED]), MAP_CELLS)
        loss = loss + hint * MAP_WEIGHT * functional.mse_loss(seen, maps)
        loss = loss + hint * POOLED_WEIGHT * functional.mse_loss(student.pooled(embedding[:HINTED]), pooled)
    return loss


def learn_reading(net: SurfaceNet, readable: Image, outliers: Image, *, steps: int, seed: int) -> None:
    """Teach the reading head to tell readable road from all else; the rest of the net stays as it is.

    `readable` and `outliers` are patches (n, 64, 96, 3); disturbed road counts as readable. `steps` is that of the
    optimiser.
    """
    torch.manual_seed(seed)
    features = torch.cat([embeddings(net, readable), embeddings(net, outliers)])
    labels = torch.cat([torch.ones(len(readable)), torch.zeros(len(outliers))])
    weights = torch.where(labels > 0, 0.5 / len(readable), 0.5 / len(outliers))
    head = nn.ModuleList([net.reading_norm, net.reading]).train()
    optimiser = torch.optim.AdamW(head.parameters(), lr=READING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for chosen in torch.multinomial(weights, steps * 512, replacement=True).view(steps, 512):
        loss = functional.binary_cross_entropy_with_logits(net.readable(features[chosen]), labels[chosen])
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        schedule.step()
    net.eval()


def learn_disturbed(net: SurfaceNet, clear: Image, disturbed: Image, *, seed: int) -> None:
    """Teach the head that tells disturbed patches from clear ones; no class is used, the rest of the net stays."""
    torch.manual_seed(seed)
    features = torch.cat([embeddings(net, clear), embeddings(net, disturbed)])
    labels = torch.cat([torch.zeros(len(clear)), torch.ones(len(disturbed))])
    head = nn.ModuleList([net.disturbed_norm, net.disturbed]).train()
    optimiser = torch.optim.AdamW(head.parameters(), lr=DISTURBED_RATE, weight_decay=DISTURBED_DECAY)
    for _ in range(DISTURBED_STEPS):
        chosen = torch.randint(len(features), (512,))
        seen = functional.dropout(net.disturbed_norm(features[chosen]), DISTURBED_DROPOUT)
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
    """Pooled features of patches (n, 64, 96, 3), shape (n, EMBEDDING)."""
    net.eval()
    batches = [net.embed(batch) for batch in _batches(patches)]
    return torch.cat(batches) if batches else torch.empty((0, net.EMBEDDING))


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
