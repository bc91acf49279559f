"""One training of the surface classifier: patches, teacher, both stages, calibration, reading head, card."""

from __future__ import annotations

import argparse
import copy
import hashlib
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import Progress

from . import calibrate, cards, scores
from .annotate import sha256_of
from .data import Image, Picture, family_of, judged_groups, of_split
from .export import export_surface
from .nets import SurfaceNet
from .outliers import outlier_patches
from .patches import PatchSet, joined, judged_patches, thinned, training_patches
from .teacher import TeacherError, TeacherFeatures, teacher_features
from .train_surface import (
    Report,
    Taught,
    learn_classes,
    learn_disturbed,
    learn_features,
    learn_reading,
    learn_softening,
    new_student,
    verdicts_of,
)

TRUNK_STEPS, CLASS_STEPS = 1500, 4000
TRUNK_SOURCES = ("condition_web", "dry_udacity", "rendered")
"""Sources of the first stage: none on which a leave-one-out score is taken, so that one trunk serves all of those."""

CUTTING_SEED = 1
FURTHER_CUTS = 2
"""How often real pictures are cut anew, at other places, for the second stage: the teacher is not asked about these."""

READING_STEPS = 2000
OUTLIERS = {"train": 12000, "val": 1600}
LOOKS, READ_LOOKS = {"": 1500}, {"": 1500, "condition_web": 7500, "rendered": 5500}
"""Most patches of each source ("" stands for all others) for the head that tells disturbed patches, and for the one
that tells readable road, which must know many roads."""

Steps = Callable[[str, int], AbstractContextManager[Report]]


@dataclass(frozen=True)
class Material:
    """What the classifier learns from; the teacher's features are those of the first patches."""

    patches: PatchSet
    teacher: TeacherFeatures | None
    outliers: dict[str, Image]


@dataclass(frozen=True)
class Outcome:
    """A trained and calibrated classifier with its scores on the judged sets."""

    net: SurfaceNet
    temperature: float
    reliabilities: dict[str, tuple[calibrate.Reliability, calibrate.Reliability]]
    entropies: tuple[float, float]
    picture_scores: dict[str, scores.ClassScore]
    patch_scores: dict[str, scores.ClassScore]
    readings: dict[str, float]


def train_and_ship(
    given: argparse.Namespace,
    facts: cards.RunFacts,
    rendered: dict[str, PatchSet],
    progress: Progress,
    steps: Steps,
) -> Taught:
    """Train as the command line asks, write surface.onnx, its card and the reliability diagram.

    Returns
    -------
    Taught
        The net after its first stage.
    """
    start = time.monotonic()
    material = gather(given, facts.pictures, rendered, steps)
    trunk = _trunk(given, material, steps)
    student = copy.deepcopy(trunk)
    count = max(2, round(given.effort * CLASS_STEPS))
    with steps("training the surface classifier", count) as report:
        taught = learn_classes(
            student, material.patches, material.teacher, steps=count, seed=given.seed, report=report
        )
    net = taught.net
    learn_heads(net, material, given.seed, given.effort)
    train_s = time.monotonic() - start
    outcome = judge(net, _judged_sets(facts.pictures, rendered), material.outliers["val"], given.seed)
    path = given.out / "surface.onnx"
    export_surface(net, outcome.temperature, path)
    calibrate.draw_reliability(
        *outcome.reliabilities["validation, both"], outcome.temperature, given.out / "reliability.png"
    )
    text = cards.surface_card(
        facts, outcome, sha256=sha256_of(path), train_s=train_s, train_patches=len(material.patches)
    )
    cards.write_card(path.with_suffix(".md"), text)
    progress.console.print(cards.class_table(outcome.picture_scores), markup=False)
    return trunk


def gather(
    given: argparse.Namespace, pictures: Sequence[Picture], rendered: dict[str, PatchSet], steps: Steps
) -> Material:
    """Training patches with the teacher's features, and outliers; sources that the command line leaves out are absent.

    What is cut does not depend on the seed of the training, so that the teacher need be asked once only.
    """
    every = of_split(pictures, "train")
    patches = joined([training_patches(every, CUTTING_SEED), rendered["train"]])
    teacher = ask_teacher(given, patches, steps) if given.teacher else None
    cuts = round(min(given.effort, 1.0) * FURTHER_CUTS)
    further = [training_patches(every, CUTTING_SEED + 1 + number) for number in range(cuts)]
    patches = joined([patches, *further, *([rendered["further"]] if "further" in rendered else [])])
    kept = np.array([family_of(str(source)) not in given.without for source in patches.sources])
    rng = np.random.default_rng(CUTTING_SEED)
    seen = [picture for picture in every if picture.family not in given.without]
    count = {split: max(80, round(min(given.effort, 1.0) * most)) for split, most in OUTLIERS.items()}
    outliers = {
        "train": outlier_patches(rng, seen, patches.patches[kept], count["train"]),
        "val": outlier_patches(rng, of_split(pictures, "val"), rendered["val"].patches, count["val"]),
    }
    if teacher is not None:
        teacher = teacher.where(kept[: len(teacher)])
    return Material(patches.where(kept), teacher, outliers)


def ask_teacher(given: argparse.Namespace, patches: PatchSet, steps: Steps) -> TeacherFeatures:
    """The teacher's features, kept beside the rendered worlds where there is a folder for those."""
    if not given.teacher.is_file():
        raise TeacherError(f"{given.teacher}: not found; leave --teacher out to train without one")
    digest = hashlib.sha256(patches.patches.tobytes() + given.teacher.read_bytes()).hexdigest()[:12]
    file = given.worlds / f"teacher-{digest}.npz" if given.worlds else None
    if file and file.is_file():
        with np.load(file) as kept:
            return TeacherFeatures(kept["pooled"], kept["maps"])
    with steps("asking the teacher", len(patches)) as report:
        features = teacher_features(given.teacher, patches.patches, lambda done: report(done, np.nan))
    if file:
        part = file.with_suffix(".part.npz")
        np.savez(part, pooled=features.pooled, maps=features.maps)
        part.replace(file)
    return features


def _trunk(given: argparse.Namespace, material: Material, steps: Steps) -> Taught:
    """The first stage's net: read from its file where there is one, else trained (and kept)."""
    if material.teacher is None or (given.trunk and given.trunk.is_file()):
        return kept_trunk(given)
    student = new_student(given.seed)
    seen = np.arange(len(material.patches)) < len(material.teacher)
    chosen = seen & np.isin(material.patches.sources, TRUNK_SOURCES)
    count = max(2, round(given.effort * TRUNK_STEPS))
    with steps("learning the teacher's features", count) as report:
        trunk = learn_features(
            student,
            material.patches.where(chosen),
            material.teacher.where(chosen[seen]),
            steps=count,
            seed=given.seed,
            report=report,
        )
    if given.trunk:
        part = given.trunk.with_suffix(".part")
        torch.save(torch.nn.ModuleList(trunk).state_dict(), part)
        part.replace(given.trunk)
    return trunk


def kept_trunk(given: argparse.Namespace) -> Taught:
    """The first stage's net from its file; without a teacher an untrained one.

    Raises
    ------
    TeacherError
        There is a teacher but no such file.
    """
    student = new_student(given.seed)
    if given.teacher is None:
        return student
    if not (given.trunk and given.trunk.is_file()):
        raise TeacherError(
            "with a teacher the picture network starts from the first stage of the surface network: name its file, "
            f"which `--only surface --trunk FILE` keeps, with --trunk (given: {given.trunk})"
        )
    kept = torch.load(given.trunk, weights_only=True)
    heads = ("0.softening", "0.reading", "0.disturbed")  # learned last, in other forms at times
    kept = {name: value for name, value in kept.items() if not name.startswith(heads)}
    torch.nn.ModuleList(student).load_state_dict(kept, strict=False)
    return student


def learn_heads(net: SurfaceNet, material: Material, seed: int, effort: float) -> None:
    """Teach the heads that tell readable road and disturbed patches; the rest of the net stays."""
    roads = _looks(material.patches, seed, READ_LOOKS, effort)
    readable = np.concatenate([roads, calibrate.noised(roads, seed + 1)])
    steps = max(2, round(effort * READING_STEPS))
    learn_reading(net, readable, material.outliers["train"], steps=steps, seed=seed)
    clear = _looks(material.patches, seed, LOOKS, effort)[::2]
    learn_disturbed(net, clear, calibrate.noised(clear, seed), seed=seed)


def _looks(patches: PatchSet, seed: int, most: dict[str, int], effort: float) -> Image:
    """Undisturbed patches of all sources, at most so many of each: for heads that tell no class."""
    rng = np.random.default_rng(seed)
    count = {source: max(8, round(min(effort, 1.0) * looks)) for source, looks in most.items()}
    keep = np.concatenate(
        [
            rng.permutation(np.flatnonzero(patches.sources == source))[: count.get(str(source), count[""])]
            for source in np.unique(patches.sources)
        ]
    )
    return patches.patches[keep]


def judge(net: SurfaceNet, judged: dict[str, PatchSet], outliers: Image, seed: int) -> Outcome:
    """Calibration on the validation sets, then scores of all sets."""
    validation = joined(
        [part.where(thinned(len(part), seed)) for name, part in judged.items() if " val" in name]
    )
    noised = calibrate.noised(validation.patches, seed)
    labels = np.tile(validation.labels, 2)
    net.softening.data = learn_softening(net, np.concatenate([validation.patches, noised]), labels)
    plain = {"undisturbed": verdicts_of(net, validation.patches)[0], "disturbed": verdicts_of(net, noised)[0]}
    both = np.concatenate(list(plain.values()))
    temperature = calibrate.learn_temperature(both, labels)

    def pair(values: NDArray[np.float64], true: NDArray[np.int64]) -> tuple:
        return calibrate.reliability(values, true), calibrate.reliability(values, true, temperature)

    reliabilities = {"validation, both": pair(both, labels)}
    reliabilities |= {
        f"validation, {name}": pair(values, validation.labels) for name, values in plain.items()
    }
    logits = {name: verdicts_of(net, part.patches)[0] for name, part in judged.items()}
    readings = {"readable road kept: validation": _share_read(net, validation.patches)}
    readings["readable road kept: validation, disturbed"] = _share_read(net, noised)
    for name, part in judged.items():
        if " test" in name:
            reliabilities[name] = pair(logits[name], part.labels)
            disturbed = calibrate.noised(part.patches, seed)
            reliabilities[f"{name}, disturbed"] = pair(verdicts_of(net, disturbed)[0], part.labels)
            readings[f"readable road kept: {name}"] = _share_read(net, part.patches)
    readings["no readable road, let through: validation"] = _share_read(net, outliers)
    return Outcome(
        net,
        temperature,
        reliabilities,
        (calibrate.cross_entropy(both, labels), calibrate.cross_entropy(both, labels, temperature)),
        {name: scores.by_picture(logits[name], part, temperature) for name, part in judged.items()},
        {name: scores.by_patch(logits[name], part) for name, part in judged.items()},
        readings,
    )


def _share_read(net: SurfaceNet, patches: Image) -> float:
    return float((verdicts_of(net, patches)[1] > 0.5).mean())


def _judged_sets(pictures: Sequence[Picture], rendered: dict[str, PatchSet]) -> dict[str, PatchSet]:
    """Validation and test sets by name."""
    judged = {name: judged_patches(group) for name, group in judged_groups(pictures).items()}
    return {**judged, "rendered val": rendered["val"], "rendered test": rendered["test"]}
