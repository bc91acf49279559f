"""What a scene adds to the logits of its patches: learned last, on the network as it ships, and kept in its file."""

from __future__ import annotations

import argparse
import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from trpac_core.vision.networks import RoadSegmenter, Segmenter, SurfaceClassifier
from trpac_core.vision.scene import SceneHead, scene_numbers, scene_of

from . import calibrate, cards, scores
from .annotate import annotate, sha256_of
from .cards import SCENE_BEGIN, SCENE_END
from .data import Picture, judged_groups, trained_on
from .keeping import kept_or_made
from .night import by_night, night_scenes
from .patches import Drawn, draw_weights, judged_patches, thinned, training_patches
from .rendered import (
    FIRST_SCENE_WORLD,
    PATCHES_PER_VIEW,
    SEED_RANGES,
    STREETS,
    draw_further_worlds,
    split_views,
    view_patches,
)
from .roadside import with_roadsides
from .scene_set import SceneSet, all_of, load_scenes, save_scenes, scenes_of_pictures, scenes_of_views

WORLDS, PATCHES_PER_WORLD_VIEW = 480, 6
LOOKS = 2
"""Cameras that each patch and its scene are seen by."""
RIDGE = 3e-3
"""Half of the square of the weights counts so much in the loss [nat]."""
CUTTING_SEED = 21

Report = Callable[[int, float], None]
Steps = Callable[[str, int], AbstractContextManager[Report]]


def ship_scene(
    file: Path, given: argparse.Namespace, pictures: Sequence[Picture], worlds: dict[str, int], steps: Steps
) -> dict[str, scores.Judged]:
    """Learn the scene's head of a network file, calibrate it anew, and write both into the file and its card."""
    segmenter = Segmenter(file.parent / "segmenter.onnx", given.threads)
    train = gather(given, pictures, segmenter, steps)
    head = learn_head(patches_alone(file, given.threads), train, given.seed)
    return write_scene(file, head, None, len(train), given, judged_sets(given, pictures, worlds, steps))


def write_scene(
    file: Path,
    head: SceneHead,
    temperature: float | None,
    patches: int,
    given: argparse.Namespace,
    judged: dict[str, SceneSet],
) -> dict[str, scores.Judged]:
    """Write a scene's head, learned from so many patches, and T into a network file and its card; scores by set.

    Without a `temperature` it is that of the validation sets.
    """
    annotate(file, {"scene": head.to_text()})
    classifier = SurfaceClassifier(file, given.threads)
    temperature, reliabilities = calibrated(classifier, judged, given.seed, temperature)
    annotate(file, {"temperature": f"{temperature:.6f}"})
    calibrate.draw_reliability(
        *reliabilities["validation, both"], temperature, file.parent / "reliability.png"
    )
    found = {name: _judge(classifier, part, temperature) for name, part in judged.items()}
    card = file.with_suffix(".md")
    section = cards.scene_section(found, reliabilities, head, temperature=temperature, patches=patches)
    text = card.read_text(encoding="utf-8")
    cards.write_card(card, with_section(text, section, sha256_of(file), temperature))
    return found


def patches_alone(file: Path, threads: int) -> SurfaceClassifier:
    """A network without what a scene adds so far, which may be of numbers that are read no longer."""
    with TemporaryDirectory() as folder:
        bare = Path(shutil.copy(file, folder))
        annotate(bare, {"scene": None})
        return SurfaceClassifier(bare, threads)


def gather(
    given: argparse.Namespace, pictures: Sequence[Picture], segmenter: RoadSegmenter, steps: Steps
) -> SceneSet:
    """Patches in their scenes: of the training pictures, by night too, and of worlds that the network has not seen."""
    count = max(6, round(given.effort * WORLDS))
    first = SEED_RANGES["train"].start + FIRST_SCENE_WORLD

    def draw() -> SceneSet:
        with steps("rendering worlds for the scene", count) as report:
            done = iter(range(1, count + 1))
            views = draw_further_worlds(
                range(first, first + count),
                PATCHES_PER_WORLD_VIEW,
                given.threads,
                lambda: report(next(done), np.nan),
                STREETS,
            )
        return scenes_of_views(views)

    real = trained_on(pictures, given.without)
    cut = training_patches(real, CUTTING_SEED)
    drawn = kept_or_made(given.kept, f"scenes-{count}.npz", load=load_scenes, make=draw, save=save_scenes)
    drawn = SceneSet(drawn.patches, with_roadsides(drawn.scenes, CUTTING_SEED))
    nights = night_scenes(by_night(real, segmenter, CUTTING_SEED), CUTTING_SEED)
    return all_of([scenes_of_pictures(cut, real), nights, drawn])


def learn_head(classifier: SurfaceClassifier, train: SceneSet, seed: int) -> SceneHead:
    """Multinomial regression of the classes on the scene's numbers, beside the network's own logits."""
    rng = np.random.default_rng(seed)
    seen = all_of([train.by_other_cameras(rng) for _ in range(LOOKS)])
    numbers = scene_numbers(seen.patches.patches, seen.scenes)
    return head_beside(numbers, seen.patches, seen.logits(classifier, alone=True))


def head_beside(numbers: NDArray[np.float64], drawn: Drawn, logits: NDArray[np.float64]) -> SceneHead:
    """The head that `numbers` of scenes, shape (n, 9), give beside the logits (n, 3) of patches alone."""
    blank = np.zeros((numbers.shape[1], 3))
    head = SceneHead(numbers.mean(axis=0), numbers.std(axis=0), blank, np.zeros(3))
    weights, bias = regression(head.standardised(numbers), drawn.labels, draw_weights(drawn), logits)
    return SceneHead(head.mean, head.deviation, weights, bias)


def regression(
    x: NDArray[np.floating],
    labels: NDArray[np.int64],
    shares: NDArray[np.float64],
    logits: NDArray[np.float64],
    ridge: float = RIDGE,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights (m, k) and bias (k,) that, added to the logits, make the labels likeliest, each sample by its share.

    `ridge` is what half of the square of the weights counts in the loss [nat].
    """
    m, k = x.shape[1], logits.shape[1]
    true = np.eye(k)[labels]

    def loss(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        weights, bias = flat[: m * k].reshape(m, k), flat[m * k :]
        z = logits + x @ weights.astype(x.dtype) + bias
        off = shares[:, None] * (softmax(z, axis=1) - true)
        value = -np.sum(shares[:, None] * true * log_softmax(z, axis=1)) + 0.5 * ridge * np.sum(weights**2)
        slope = x.T @ off.astype(x.dtype) + ridge * weights
        return float(value), np.concatenate([slope.ravel(), off.sum(axis=0)])

    found = minimize(loss, np.zeros((m + 1) * k), jac=True, method="L-BFGS-B").x
    return found[: m * k].reshape(m, k), found[m * k :]


def judged_sets(
    given: argparse.Namespace, pictures: Sequence[Picture], worlds: dict[str, int], steps: Steps
) -> dict[str, SceneSet]:
    """Validation and test sets by name, as on the card."""
    judged = {
        name: scenes_of_pictures(judged_patches(some), some) for name, some in judged_groups(pictures).items()
    }
    for split in ("val", "test"):
        draw = partial(_rendered_set, split, worlds[split], steps)
        name = f"scenes-{split}-{worlds[split]}.npz"
        judged[f"rendered {split}"] = kept_or_made(
            given.kept, name, load=load_scenes, make=draw, save=save_scenes
        )
    return judged


def _rendered_set(split: str, count: int, steps: Steps) -> SceneSet:
    with steps(f"rendering {split} worlds", count) as report:
        done = iter(range(1, count + 1))
        views = split_views(split, count, lambda: report(next(done), np.nan))
        return scenes_of_views(
            [(scene_of(v.frame.image), view_patches(v, PATCHES_PER_VIEW[split])) for v in views]
        )


def calibrated(
    classifier: SurfaceClassifier, judged: dict[str, SceneSet], seed: int, temperature: float | None = None
) -> tuple[float, dict[str, tuple[calibrate.Reliability, calibrate.Reliability]]]:
    """T for patches in their scenes, and reliabilities at 1 and at T of the validation sets, undisturbed and disturbed.

    Without a `temperature` it is that of these sets.
    """
    validation = all_of([s.where(thinned(len(s), seed)) for name, s in judged.items() if " val" in name])
    sets = {"validation, undisturbed": validation, "validation, disturbed": validation.disturbed(seed)}
    for name, part in judged.items():
        if " test" in name:
            sets |= {name: part, f"{name}, disturbed": part.disturbed(seed)}
    logits = {name: part.logits(classifier) for name, part in sets.items()}
    labels = {name: part.patches.labels for name, part in sets.items()}
    both = list(sets)[:2]
    logits = {"validation, both": np.concatenate([logits[name] for name in both])} | logits
    labels["validation, both"] = np.concatenate([labels[name] for name in both])
    if temperature is None:
        temperature = calibrate.learn_temperature(logits["validation, both"], labels["validation, both"])
    return temperature, {
        name: (
            calibrate.reliability(found, labels[name]),
            calibrate.reliability(found, labels[name], temperature),
        )
        for name, found in logits.items()
    }


def with_section(card: str, section: str, sha256: str, temperature: float) -> str:
    """A card with another section on the scene, and the hash and temperature of the file that holds it."""
    before, _, rest = card.partition(SCENE_BEGIN)
    _, _, after = rest.partition(SCENE_END)
    text = f"{before}{SCENE_BEGIN}\n\n{section}\n\n{SCENE_END}{after}"
    text = re.sub(r"sha256: `[0-9a-f]{64}`", f"sha256: `{sha256}`", text)
    return re.sub(r"(Metadata: `temperature` = )[0-9.]+", rf"\g<1>{temperature:.6f}", text)


def _judge(classifier: SurfaceClassifier, part: SceneSet, temperature: float) -> scores.Judged:
    alone, in_scene = (
        scores.by_picture(part.logits(classifier, alone=alone), part.patches, temperature)
        for alone in (True, False)
    )
    return scores.Judged(alone, in_scene)
