"""The training run: data, both networks, calibration, export, cards."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from . import calibrate, cards, scores
from .data import Picture, check_trainable, of_split, read_manifest
from .export import export_segmenter, export_surface, sha256_of
from .nets import SurfaceNet
from .patches import PatchSet, joined, judged_patches, training_patches
from .rendered import SEED_RANGES, draw_worlds, load_worlds, save_worlds
from .segmenter_data import Sample, masked_sample, painted_views, weak_sample
from .train_segmenter import score_segmenter, train_segmenter
from .train_surface import logits_of, train_surface

WORLDS = {"train": 480, "val": 36, "test": 60}
PATCHES_PER_VIEW = {"train": 12, "val": 8, "test": 8}
SEGMENTER_STEPS = 1300
SURFACE_STEPS = 2600
CALIBRATION_PER_SOURCE = 240
"""Most validation patches that one source gives to the calibration, lest one drive decide T."""


@dataclass(frozen=True)
class Rendered:
    """Rendered pictures and patches of one split."""

    samples: list[Sample]
    patches: PatchSet


def train_all(given: argparse.Namespace, arguments: Sequence[str]) -> None:
    """Train, calibrate, export and document what the command line asks for."""
    pictures = read_manifest(given.data)
    check_trainable(pictures)
    torch.set_num_threads(given.threads)
    torch.use_deterministic_algorithms(mode=True)
    with _progress() as progress:
        worlds = {split: max(3, round(given.effort * count)) for split, count in WORLDS.items()}
        start = time.monotonic()
        rendered = _render(progress, worlds, given.worlds)
        shown = [Path(word).name if "/" in word else word for word in arguments]
        facts = cards.RunFacts(
            command=" ".join(["python -m models.training", *shown]),
            seed=given.seed,
            pictures=pictures,
            worlds=worlds,
            seeds={split: f"from {SEED_RANGES[split][0]}" for split in worlds},
            render_s=time.monotonic() - start,
            threads=given.threads,
            teacher=given.teacher and given.teacher.name,
        )
        given.out.mkdir(parents=True, exist_ok=True)
        if given.only != "surface":
            _segmenter(progress, given, facts, rendered)
        if given.only != "segmenter":
            _surface(progress, given, facts, rendered)


def _render(progress: Progress, worlds: dict[str, int], store: Path | None) -> dict[str, Rendered]:
    task = progress.add_task("rendering worlds", total=sum(worlds.values()), note="")
    rendered = {}
    for split, count in worlds.items():
        file = store / f"{split}-{count}.npz" if store else None
        if file and file.is_file():
            rendered[split] = Rendered(*load_worlds(file))
            progress.advance(task, count)
            continue
        rendered[split] = Rendered(
            *draw_worlds(split, count, PATCHES_PER_VIEW[split], lambda: progress.advance(task))
        )
        if file:
            save_worlds(file, rendered[split].samples, rendered[split].patches)
    return rendered


def _segmenter(
    progress: Progress, given: argparse.Namespace, facts: cards.RunFacts, rendered: dict[str, Rendered]
) -> None:
    start = time.monotonic()
    pools: dict[str, list[Sample]] = {
        "masked": [],
        "campus": [],
        "weak": [],
        "rendered": rendered["train"].samples,
    }
    for picture in of_split(facts.pictures, "train", masked=True):
        sample = masked_sample(picture)
        pools[sample.kind].append(sample)
    pools["weak"] = [weak_sample(picture) for picture in of_split(facts.pictures, "train", masked=False)]
    steps = max(2, round(given.effort * SEGMENTER_STEPS))
    with _steps(progress, "training the segmenter", steps) as report:
        net = train_segmenter(pools, steps=steps, seed=given.seed, report=report)
    train_s = time.monotonic() - start
    real = [masked_sample(picture) for picture in of_split(facts.pictures, "val", masked=True)]
    painted = painted_views(real, seed=given.seed)
    found = {
        "real: CamVid 0001TP (val)": {"drivable": score_segmenter(net, real, "drivable")},
        "real, painted (val)": {task: score_segmenter(net, painted, task) for task in ("drivable", "shadow")},
        "rendered (test)": {
            task: score_segmenter(net, rendered["test"].samples, task) for task in ("drivable", "shadow")
        },
    }
    path = given.out / "segmenter.onnx"
    export_segmenter(net, path)
    text = cards.segmenter_card(
        facts,
        sha256=sha256_of(path),
        parameters=sum(parameter.numel() for parameter in net.parameters()),
        train_s=train_s,
        pools={kind: len(samples) for kind, samples in pools.items()},
        scores=found,
    )
    cards.write_card(path.with_suffix(".md"), text)
    progress.console.print(cards.segmentation_table(found), markup=False)


def _surface(
    progress: Progress, given: argparse.Namespace, facts: cards.RunFacts, rendered: dict[str, Rendered]
) -> None:
    start = time.monotonic()
    real = training_patches(of_split(facts.pictures, "train"), given.seed)
    patches = joined([real, rendered["train"].patches])
    teacher = None
    if given.teacher:
        from .teacher import teacher_features

        teacher = teacher_features(given.teacher, patches.patches)
    steps = max(2, round(given.effort * SURFACE_STEPS))
    with _steps(progress, "training the surface classifier", steps) as report:
        net = train_surface(patches, steps=steps, seed=given.seed, report=report, teacher=teacher)
    train_s = time.monotonic() - start

    judged = _judged_sets(facts.pictures, rendered)
    logits = {name: logits_of(net, part.patches) for name, part in judged.items()}
    temperature, reliabilities, entropies = _calibrated(net.eval(), judged, given)
    path = given.out / "surface.onnx"
    export_surface(net, temperature, path)
    by_picture = {name: scores.by_picture(logits[name], part, temperature) for name, part in judged.items()}
    text = cards.surface_card(
        facts,
        sha256=sha256_of(path),
        parameters=sum(parameter.numel() for parameter in net.parameters()),
        train_s=train_s,
        train_patches=len(patches),
        temperature=temperature,
        reliabilities=reliabilities,
        entropies=entropies,
        picture_scores=by_picture,
        patch_scores={name: scores.by_patch(logits[name], part) for name, part in judged.items()},
    )
    cards.write_card(path.with_suffix(".md"), text)
    progress.console.print(cards.class_table(by_picture), markup=False)


def _judged_sets(pictures: Sequence[Picture], rendered: dict[str, Rendered]) -> dict[str, PatchSet]:
    """Validation and test sets by name; test pictures of other cameras apart from the stills."""
    validation, test = of_split(pictures, "val"), of_split(pictures, "test")
    sets = {
        f"real val: {source}": [p for p in validation if p.source == source]
        for source in _sources(validation)
    }
    sets["real test: stills, same search"] = [p for p in test if p.source == "condition_web"]
    sets["real test: other cameras"] = [p for p in test if p.source.startswith("other_cameras/")]
    known = {id(picture) for group in sets.values() for picture in group}
    sets["real test: other"] = [p for p in test if id(p) not in known]
    judged = {name: judged_patches(group) for name, group in sets.items() if group}
    return {**judged, "rendered val": rendered["val"].patches, "rendered test": rendered["test"].patches}


def _sources(pictures: Sequence[Picture]) -> list[str]:
    return sorted({picture.source for picture in pictures})


def _calibrated(
    net: SurfaceNet, judged: dict[str, PatchSet], given: argparse.Namespace
) -> tuple[float, dict[str, tuple[calibrate.Reliability, calibrate.Reliability]], tuple[float, float]]:
    """T from the validation sets; reliability before and after on them and, not used for T, on the test sets."""
    rng = np.random.default_rng(given.seed)
    validation = joined([_thinned(rng, part) for name, part in judged.items() if " val" in name])
    logits = {
        "undisturbed": logits_of(net, validation.patches),
        "disturbed": logits_of(net, calibrate.noised(validation.patches, given.seed)),
    }
    both = np.concatenate(list(logits.values()))
    labels = np.tile(validation.labels, 2)
    temperature = calibrate.learn_temperature(both, labels)

    def pair(
        values: NDArray[np.float64], true: NDArray[np.int64]
    ) -> tuple[calibrate.Reliability, calibrate.Reliability]:
        return calibrate.reliability(values, true), calibrate.reliability(values, true, temperature)

    reliabilities = {"validation, both": pair(both, labels)}
    for name, values in logits.items():
        reliabilities[f"validation, {name}"] = pair(values, validation.labels)
    for name, part in judged.items():
        if " test" in name:
            reliabilities[name] = pair(logits_of(net, part.patches), part.labels)
            disturbed = calibrate.noised(part.patches, given.seed)
            reliabilities[f"{name}, disturbed"] = pair(logits_of(net, disturbed), part.labels)
    calibrate.draw_reliability(*reliabilities["validation, both"], temperature, given.out / "reliability.png")
    entropies = (
        calibrate.cross_entropy(both, labels),
        calibrate.cross_entropy(both, labels, temperature),
    )
    return temperature, reliabilities, entropies


def _thinned(rng: np.random.Generator, patches: PatchSet) -> PatchSet:
    keep = np.zeros(len(patches), np.bool_)
    keep[rng.permutation(len(patches))[:CALIBRATION_PER_SOURCE]] = True
    return patches.where(keep)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )


@contextmanager
def _steps(progress: Progress, description: str, steps: int) -> Iterator:
    task = progress.add_task(description, total=steps, note="")
    smooth: list[float] = []

    def report(step: int, loss: float) -> None:
        smooth.append(loss)
        progress.update(task, completed=step, note=f"loss {np.mean(smooth[-50:]):.3f}")

    yield report
