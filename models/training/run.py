"""The training run: data, networks, calibration, export, cards."""

from __future__ import annotations

import argparse
import ctypes
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import torch
from rich.progress import Progress

from scenarios.library import networks_folder
from trpac_core.vision.networks import Segmenter

from . import cards
from .annotate import sha256_of
from .data import Picture, check_trainable, of_split, read_manifest
from .export import export_segmenter
from .found_roads import with_found_roads
from .keeping import kept_or_made
from .left_out import left_out_table
from .patches import PatchSet, joined
from .progress import Steps, bars, steps_of
from .rendered import (
    OPEN_LAND,
    PATCHES_PER_VIEW,
    SEED_RANGES,
    STREETS,
    WORLDS,
    draw_further_worlds,
    draw_worlds,
    load_patches,
    load_worlds,
    rendered_patches,
    save_patches,
    save_worlds,
)
from .road_run import trained
from .segmenter_data import Sample, masked_sample, painted_views
from .surface_run import IN_OPEN_LAND, IN_STREETS, train_and_ship
from .train_segmenter import score_segmenter

FURTHER_WORLDS, FURTHER_PATCHES_PER_VIEW = 3078, 6
"""Worlds after the first training ones, for the surface classifier alone: many looks, few patches of each."""

MALLOPT = {"trim threshold": (-1, 2**31 - 1), "top pad": (-2, 2**29), "most mapped blocks": (-4, 0)}
"""Parameters of glibc's mallopt and their values here."""


@dataclass(frozen=True)
class Rendered:
    """Rendered pictures and patches of one split."""

    samples: list[Sample]
    patches: PatchSet


def train_all(given: argparse.Namespace, arguments: Sequence[str]) -> None:
    """Train, calibrate, export and document what the command line asks for."""
    pictures = read_manifest(given.data)
    check_trainable(pictures, masks=given.only != "surface")
    _keep_memory()
    torch.set_num_threads(given.threads)
    torch.use_deterministic_algorithms(mode=given.device == "cpu")
    # Filling what is about to be written would take a fifth of the time of a step.
    torch.utils.deterministic.fill_uninitialized_memory = False
    with bars() as progress:
        worlds = {split: max(3, round(given.effort * count)) for split, count in WORLDS.items()}
        given.out.mkdir(parents=True, exist_ok=True)
        _networks(progress, given, arguments, pictures, worlds, partial(steps_of, progress))


def _networks(
    progress: Progress,
    given: argparse.Namespace,
    arguments: Sequence[str],
    pictures: Sequence[Picture],
    worlds: dict[str, int],
    steps: Steps,
) -> None:
    """Both networks, which learn from the same rendered worlds."""
    further = max(3, round(given.effort * FURTHER_WORLDS))
    start = time.monotonic()
    rendered = _render(progress, worlds, given)
    patches = {split: part.patches for split, part in rendered.items()}
    shown = [Path(word).name if "/" in word else word for word in arguments]
    facts = cards.RunFacts(
        command=" ".join(["python -m models.training", *shown]),
        seed=given.seed,
        pictures=pictures,
        worlds={**worlds, "train": worlds["train"] + (0 if given.only == "segmenter" else further)},
        seeds={split: f"from {SEED_RANGES[split][0]}" for split in worlds},
        render_s=time.monotonic() - start,
        threads=given.threads,
        without=tuple(given.without),
    )
    if given.only in (None, "segmenter"):
        _segmenter(progress, given, facts, rendered, steps)
    if given.only in (None, "surface"):
        facts.pictures = _seen(given, pictures)
        streets = _render_streets(progress, worlds["train"], given)
        draw = partial(_render_further, progress, worlds["train"], further, given)
        roads = {
            IN_OPEN_LAND: lambda: joined([patches["train"], draw(OPEN_LAND)]),
            IN_STREETS: lambda: joined([streets, draw(STREETS)]),
        }
        train_and_ship(given, facts, patches | {"train": streets}, roads, progress, steps)


def _seen(given: argparse.Namespace, pictures: Sequence[Picture]) -> list[Picture]:
    """The pictures with the roads that the segmenter in the folder finds; the package's is put there if none is."""
    path = given.out / "segmenter.onnx"
    if not path.is_file():
        shutil.copy(networks_folder() / path.name, path)
    return with_found_roads(pictures, Segmenter(path, given.threads))


def _keep_memory() -> None:
    """Keep freed memory in the process: else every step gets its maps from the system anew, a fifth of its time."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for parameter, value in MALLOPT.values():
            mallopt(parameter, value)


def _render(progress: Progress, counts: dict[str, int], given: argparse.Namespace) -> dict[str, Rendered]:
    task = progress.add_task("rendering worlds", total=sum(counts.values()), note="")
    rendered, done = {}, 0
    for split, count in counts.items():
        report = partial(progress.advance, task)
        draw = partial(draw_worlds, split, count, PATCHES_PER_VIEW[split], given.threads, report)
        worlds = kept_or_made(
            given.kept, f"{split}-{count}.npz", load=load_worlds, make=draw, save=save_worlds
        )
        rendered[split] = Rendered(*worlds)
        done += count
        progress.update(task, completed=done)
    return rendered


def _render_streets(progress: Progress, count: int, given: argparse.Namespace) -> PatchSet:
    """Patches of the first training worlds, a share of which lies in streets: the segmenter does not see them."""

    def draw() -> PatchSet:
        task = progress.add_task("rendering worlds in streets", total=count, note="")
        report = partial(progress.advance, task)
        return draw_worlds("train", count, PATCHES_PER_VIEW["train"], given.threads, report, STREETS)[1]

    name = f"train-{count}-streets.npz"
    return kept_or_made(given.kept, name, load=load_patches, make=draw, save=save_patches)


def _render_further(
    progress: Progress, first: int, count: int, given: argparse.Namespace, streets: float
) -> PatchSet:
    """Patches of `count` training worlds from the `first` on."""

    def draw() -> PatchSet:
        task = progress.add_task("rendering further worlds", total=count, note="")
        seen = draw_further_worlds(
            SEED_RANGES["train"][first : first + count],
            FURTHER_PATCHES_PER_VIEW,
            given.threads,
            lambda: progress.advance(task),
            streets,
        )
        return rendered_patches(seen)

    name = f"further-{first}-{count}{'-streets' if streets else ''}.npz"
    return kept_or_made(given.kept, name, load=load_patches, make=draw, save=save_patches)


def _segmenter(
    progress: Progress,
    given: argparse.Namespace,
    facts: cards.RunFacts,
    rendered: dict[str, Rendered],
    steps: Steps,
) -> None:
    start = time.monotonic()
    road = trained(given, facts.pictures, rendered["train"].samples, steps)
    train_s = time.monotonic() - start
    real = [masked_sample(picture) for picture in of_split(facts.pictures, "val", masked=True)]
    painted = painted_views(real, seed=given.seed)
    found = {
        "real (val)" if facts.own else "real: CamVid 0001TP (val)": {
            "drivable": score_segmenter(road.net, real, "drivable")
        },
        "real, painted (val)": {
            task: score_segmenter(road.net, painted, task) for task in ("drivable", "shadow")
        },
        "rendered (test)": {
            task: score_segmenter(road.net, rendered["test"].samples, task) for task in ("drivable", "shadow")
        },
    }
    path = given.out / "segmenter.onnx"
    export_segmenter(road.net, path)
    text = cards.segmenter_card(
        facts, road, sha256=sha256_of(path), train_s=train_s, scores=found, left_out=left_out_table(road)
    )
    cards.write_card(path.with_suffix(".md"), text)
    progress.console.print(cards.segmentation_table(found), markup=False)
