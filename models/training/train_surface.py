"""Training of the surface classifier on undisturbed patches, in two stages, and of its reading head."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from torch import Tensor, nn
from torch.nn import functional

from .calibrate import cross_entropy
from .data import Image
from .nets import SurfaceNet
from .patches import PatchSet, augmented, camera_spreads, draw_weights
from .teacher import MAP_CELLS, TeacherFeatures

BATCH = 96
LEARNING_RATE = 3e-3
WEIGHT_DECAY = 2e-2
AVERAGING = 0.998
"""Decay of the running average of the weights; the average is what ships."""

MAP_WEIGHT, POOLED_WEIGHT = 1.0, 1.0
"""Weights of the teacher's maps and pooled features in the first stage."""
HINT_SHARE = 0.5
"""Share of both beside the cross-entropy in the second stage."""
HALF_PRECISION = torch.backends.cpu.get_cpu_capability() == "AVX512"
"""Whether maps are computed in bfloat16: there it saves a third of a step's time. Weights and losses keep 32 bits."""
FIRST_LAYERS_UNTIL = 0.5
"""Share of the second stage after which the first layers stay as they are; a quarter of a step's time is saved then."""
AHEAD = 3
"""Batches drawn while the net still learns from earlier ones."""
READING_RATE = 2e-3
DISTURBED_STEPS, DISTURBED_RATE, DISTURBED_DECAY, DISTURBED_DROPOUT = 400, 2e-3, 0.5, 0.5
"""The head that tells disturbed patches must hold on roads never seen, so it is kept weak."""

Report = Callable[[int, float], None]


class Taught(NamedTuple):
    """A net with the linear maps by which its features are held against the teacher's; only the net ships."""

    net: SurfaceNet
    maps: nn.Conv2d
    pooled: nn.Linear

    def parameters(self) -> list[nn.Parameter]:
        """All that is trained."""
        return [parameter for part in self for parameter in part.parameters() if parameter.requires_grad]

    def train(self) -> nn.ModuleList:
        """All modules, in training."""
        return nn.ModuleList(self).train()


@dataclass(frozen=True)
class Batch:
    """Drawn patches and what is known of them.

    `taught` are the places of those that the teacher has seen; `pooled` and `maps` are its features of these.
    """

    patches: Tensor
    labels: Tensor
    taught: Tensor
    pooled: Tensor
    maps: Tensor


def new_student(seed: int) -> Taught:
    """An untrained net with its maps to the teacher's features."""
    torch.manual_seed(seed)
    net = SurfaceNet()
    middle = net.STAGES[1][0]
    return Taught(
        net, nn.Conv2d(middle, TeacherFeatures.MAPS, 1), nn.Linear(net.EMBEDDING, TeacherFeatures.POOLED)
    )


def learn_features(
    student: Taught, patches: PatchSet, teacher: TeacherFeatures, *, steps: int, seed: int, report: Report
) -> Taught:
    """First stage: the net learns to see what the teacher sees; no label is used."""
    shares = np.full(len(patches), 1.0 / len(patches))
    return _train(student, patches, teacher, shares, steps, seed, report, hint=1.0, classes=0.0)


def learn_classes(
    student: Taught,
    patches: PatchSet,
    teacher: TeacherFeatures | None,
    *,
    steps: int,
    seed: int,
    report: Report,
) -> Taught:
    """Second stage: the classes.

    Where there is a teacher its features of the patches that it has seen, the first ones, are kept in view.
    """
    hint = 0.0 if teacher is None else HINT_SHARE
    return _train(
        student, patches, teacher, draw_weights(patches), steps, seed, report, hint=hint, classes=1.0
    )


def _train(
    student: Taught,
    patches: PatchSet,
    teacher: TeacherFeatures | None,
    shares: NDArray[np.float64],
    steps: int,
    seed: int,
    report: Report,
    *,
    hint: float,
    classes: float,
) -> Taught:
    """One learning-rate cycle; the running average of the weights comes back."""
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    student.net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    modules = student.train()
    average = torch.optim.swa_utils.AveragedModel(modules, avg_fn=_running_average, use_buffers=True)
    rate = LEARNING_RATE if hint == 1.0 or teacher is None else LEARNING_RATE / 2
    optimiser = torch.optim.AdamW(student.parameters(), lr=rate, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.15)
    spreads = camera_spreads(patches)
    batches = _drawn_ahead(lambda: _draw(rng, patches, teacher, shares, spreads), steps)
    for step, batch in enumerate(batches):
        if classes and step == round(FIRST_LAYERS_UNTIL * steps):
            student.net.first_layers.requires_grad_(requires_grad=False).eval()
        loss = _loss(student, batch, hint if teacher is not None else 0.0, classes)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(student.parameters(), 5.0)
        optimiser.step()
        schedule.step()
        average.update_parameters(modules)
        report(step + 1, float(loss.detach()))
    net, maps, pooled = average.module.eval()
    return Taught(net, maps, pooled)


def _drawn_ahead(draw: Callable[[], Batch], count: int) -> Iterator[Batch]:
    """Batches in order, drawn by a thread of their own."""
    with ThreadPoolExecutor(1) as drawer:
        waiting = deque(drawer.submit(draw) for _ in range(min(AHEAD, count)))
        for number in range(count):
            batch = waiting.popleft().result()
            if number + AHEAD < count:
                waiting.append(drawer.submit(draw))
            yield batch


def _draw(
    rng: np.random.Generator,
    patches: PatchSet,
    teacher: TeacherFeatures | None,
    shares: NDArray[np.float64],
    spreads: NDArray[np.float64],
) -> Batch:
    chosen = rng.choice(len(patches), size=BATCH, p=shares)
    mirrored = rng.random(BATCH) < 0.5
    views = [
        augmented(rng, patches.patches[index], mirror, spreads[index])
        for index, mirror in zip(chosen, mirrored, strict=True)
    ]
    if teacher is None:
        taught = pooled = maps = torch.empty(0)
    else:
        seen = chosen < len(teacher)
        taught = torch.from_numpy(np.flatnonzero(seen))
        pooled = torch.from_numpy(teacher.pooled[chosen[seen]].astype(np.float32))
        maps = torch.from_numpy(teacher.maps[chosen[seen]].astype(np.float32))
        maps = torch.where(torch.from_numpy(mirrored[seen])[:, None, None, None], maps.flip(3), maps)
    labels = torch.from_numpy(patches.labels[chosen])
    return Batch(torch.from_numpy(np.stack(views)), labels, taught, pooled, maps)


def _loss(student: Taught, batch: Batch, hint: float, classes: float) -> Tensor:
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=HALF_PRECISION):
        middle, last = student.net.maps(batch.patches)
    middle, last = middle.float(), last.float()
    embedding = student.net.pool(middle, last)
    loss = torch.zeros(())
    if classes:
        logits = student.net.classifier(student.net.dropout(embedding))
        loss = loss + classes * functional.cross_entropy(logits, batch.labels)
    if hint and len(batch.taught):
        middle, embedding = middle[batch.taught], embedding[batch.taught]
        seen = functional.adaptive_avg_pool2d(student.maps(middle), MAP_CELLS)
        loss = loss + hint * MAP_WEIGHT * functional.mse_loss(seen, batch.maps)
        loss = loss + hint * POOLED_WEIGHT * functional.mse_loss(student.pooled(embedding), batch.pooled)
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


def _running_average(average: Tensor, current: Tensor, steps: Tensor | int) -> Tensor:
    """Exponential running average that forgets the first steps faster."""
    decay = min(AVERAGING, (1.0 + int(steps)) / (10.0 + int(steps)))
    return decay * average + (1.0 - decay) * current


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
