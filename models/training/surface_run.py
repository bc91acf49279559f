"""One training of the surface classifier: patches, classes, further heads, calibration, card."""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import Progress

from . import calibrate, cards, scores
from .annotate import sha256_of
from .data import Image, Picture, judged_groups, of_split, trained_on
from .export import export_surface
from .keeping import keep_whole, kept_or_made
from .nets import SurfaceNet, mean_of, together
from .outcomes import Outcome, Stage
from .outliers import outlier_patches
from .patches import PatchSet, joined, judged_patches, thinned, training_patches
from .progress import Steps
from .train_surface import (
    learn_classes,
    learn_disturbed,
    learn_reading,
    learn_softening,
    new_net,
    verdicts_of,
)
from .trunk import LITE0, LITE2, Kind
from .weathered import weathered

CLASS_STEPS = 1200

CUTTING_SEED = 1
CUTS = 8
"""How often the real pictures are cut, each time at other places."""
WEATHERS = 4
"""How often the dry ones among them are shown in other weather, each time in another way."""

TOWERS = {LITE0: 2.0, LITE2: 1.0}
"""What the classifier's towers begin from, and how much the logits of each count beside the others'."""

IN_OPEN_LAND, IN_STREETS = "open-land", "streets"
"""Sorts of rendered worlds that the towers learn from."""
STYLED = {(IN_STREETS, LITE0)}
"""Trainings that are done once more with mixed styles: the sort of worlds and what the tower begins from."""

READING_STEPS = 2000
OUTLIERS = {"train": 12000, "val": 1600}
LOOKS, READ_LOOKS = {"": 1500}, {"": 1500, "condition_web": 7500, "rendered": 5500}
"""Most patches of each source ("" stands for all others) for the head of disturbed patches, and for the head of
readable road, which must know many roads."""


@dataclass(frozen=True)
class Material:
    """What the classifier's heads learn from."""

    patches: PatchSet
    outliers: dict[str, Image]


def train_and_ship(
    given: argparse.Namespace,
    facts: cards.RunFacts,
    rendered: dict[str, PatchSet],
    worlds: Mapping[str, Callable[[], PatchSet]],
    progress: Progress,
    steps: Steps,
) -> None:
    """Train as the command line asks, write surface.onnx, its card and the reliability diagram.

    `worlds` gives the rendered patches that the classes are learned from, by what sort of worlds they show: each tower
    learns from each sort in a training of its own, and some in one more with mixed styles.
    """
    start = time.monotonic()
    stage = _classes(given, facts.pictures, worlds, steps)
    net = stage.net
    material = gather(given, facts.pictures, rendered)
    learn_heads(net, material, given.seed, given.effort)
    train_s = time.monotonic() - start
    outcome = judge(net, _judged_sets(facts.pictures, rendered), material.outliers["val"], given.seed)
    path = given.out / "surface.onnx"
    export_surface(net, outcome.temperature, path)
    calibrate.draw_reliability(
        *outcome.reliabilities["validation, both"], outcome.temperature, given.out / "reliability.png"
    )
    text = cards.surface_card(facts, outcome, sha256=sha256_of(path), train_s=train_s, stage=stage)
    cards.write_card(path.with_suffix(".md"), text)
    progress.console.print(cards.class_table(outcome.picture_scores), markup=False)


def gather(given: argparse.Namespace, pictures: Sequence[Picture], rendered: dict[str, PatchSet]) -> Material:
    """Patches for the heads, and outliers; sources that the command line leaves out are absent."""
    seen = trained_on(pictures, given.without)
    patches = joined([training_patches(seen, CUTTING_SEED), rendered["train"]])
    rng = np.random.default_rng(CUTTING_SEED)
    count = {split: max(80, round(min(given.effort, 1.0) * most)) for split, most in OUTLIERS.items()}
    outliers = {
        "train": outlier_patches(rng, seen, patches.patches, count["train"]),
        "val": outlier_patches(rng, of_split(pictures, "val"), rendered["val"].patches, count["val"]),
    }
    return Material(patches, outliers)


def kept_stage(
    given: argparse.Namespace,
    name: str,
    steps: Steps,
    *,
    count: int,
    what: str,
    patches: Callable[[], PatchSet],
    kind: Kind,
    styled: bool = False,
) -> Stage:
    """A net of one tower from its file in the folder of the command line, or trained on `patches()` and kept."""

    def load(file: Path) -> Stage:
        found = torch.load(file, weights_only=True)
        net = SurfaceNet([kind])
        net.load_state_dict(found.pop("weights"))
        return Stage(net.eval(), **found)

    def save(file: Path, stage: Stage) -> None:
        told = {name: value for name, value in vars(stage).items() if name != "net"}
        content = {"weights": stage.net.state_dict(), **told}
        keep_whole(file, lambda part: torch.save(content, part))

    def train() -> Stage:
        seen = patches()
        device = torch.device(given.device)
        on = torch.cuda.get_device_name() if device.type == "cuda" else f"{given.threads} processor thread(s)"
        start = time.monotonic()
        with steps(f"training the {what}", count) as report:
            net = learn_classes(
                new_net(given.seed, kind, styled=styled),
                seen,
                steps=count,
                seed=given.seed,
                device=device,
                report=report,
            )
        return Stage(net, len(seen), count, time.monotonic() - start, on)

    left_out = "".join(f"-without-{source}" for source in sorted(given.without))
    file = f"{name}-{given.seed}{left_out}.pt"
    return kept_or_made(given.kept, file, load=load, make=train, save=save)


def _classes(
    given: argparse.Namespace,
    pictures: Sequence[Picture],
    worlds: Mapping[str, Callable[[], PatchSet]],
    steps: Steps,
) -> Stage:
    """The net with its classes learned: towers side by side, each the mean of its trainings on all sorts of worlds."""
    count = max(2, round(given.effort * CLASS_STEPS))

    def trained(sort: str) -> list[tuple[Kind, Stage]]:
        @functools.cache
        def patches() -> PatchSet:
            return joined([*_cuts(given, trained_on(pictures, given.without)), worlds[sort]()])

        def of_kind(kind: Kind, styled: bool) -> Stage:
            name = f"{sort}-styled" if styled else sort
            return kept_stage(
                given,
                f"classes-{name}-{kind.name}",
                steps,
                count=count,
                what=f"surface classifier, {kind.name}, {name}",
                patches=patches,
                kind=kind,
                styled=styled,
            )

        plan = [(kind, False) for kind in TOWERS]
        plan += [(kind, True) for kind in TOWERS if (sort, kind) in STYLED]
        return [(kind, of_kind(kind, styled)) for kind, styled in plan]

    stages = [each for sort in worlds for each in trained(sort)]
    towers = [_together([stage for kind, stage in stages if kind == tower], mean_of) for tower in TOWERS]
    says = tuple(TOWERS.values())
    return replace(_together(towers, functools.partial(together, says=says)), says=says)


def _together(stages: Sequence[Stage], net_of: Callable[[list[SurfaceNet]], SurfaceNet]) -> Stage:
    """Several trainings as one, whose net is made of theirs."""
    return Stage(
        net_of([stage.net for stage in stages]),
        patches=max(stage.patches for stage in stages),
        steps=sum(stage.steps for stage in stages),
        seconds=sum(stage.seconds for stage in stages),
        device=stages[-1].device,
    )


def _cuts(given: argparse.Namespace, pictures: Sequence[Picture]) -> list[PatchSet]:
    """Patches of these pictures, cut several times, and of the dry ones in other weather."""
    share = min(given.effort, 1.0)
    seeds = [CUTTING_SEED + number for number in range(max(1, round(share * CUTS)))]
    weathers = seeds[: max(1, round(share * WEATHERS))]
    return [
        *(training_patches(pictures, seed) for seed in seeds),
        *(training_patches(weathered(pictures, seed), seed) for seed in weathers),
    ]


def learn_heads(net: SurfaceNet, material: Material, seed: int, effort: float) -> None:
    """Train the heads for readable road and disturbed patches; the rest of the net is frozen."""
    roads = _looks(material.patches, seed, READ_LOOKS, effort)
    readable = np.concatenate([roads, calibrate.noised(roads, seed + 1)])
    steps = max(2, round(effort * READING_STEPS))
    learn_reading(net, readable, material.outliers["train"], steps=steps, seed=seed)
    clear = _looks(material.patches, seed, LOOKS, effort)[::2]
    learn_disturbed(net, clear, calibrate.noised(clear, seed), seed=seed)


def _looks(patches: PatchSet, seed: int, most: dict[str, int], effort: float) -> Image:
    """Undisturbed patches of all sources, at most so many of each: for heads without classes."""
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
