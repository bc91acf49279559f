"""One training of the picture network: looks, the second stage, T beside the patches' verdicts, card."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from . import cards
from .annotate import annotate, sha256_of
from .data import Picture, trained_on
from .export import export_picture
from .keeping import kept_or_made
from .nets import SurfaceNet
from .patches import PatchSet, joined
from .picture_card import picture_card
from .picture_looks import rendered_looks, training_looks
from .picture_scores import Scores, calibrated
from .rendered import FIRST_SCENE_WORLD, SEED_RANGES, load_patches, save_patches
from .surface_run import Steps, kept_stage
from .trunk import LITE0

PICTURE_STEPS = 375
WORLDS = 480
CUTTING_SEED = 31


def ship_picture(given: argparse.Namespace, pictures: Sequence[Picture], steps: Steps) -> dict[str, Scores]:
    """Train, calibrate beside the two others in the folder, write card."""
    start = time.monotonic()
    looks = gather(given, pictures, steps)
    count = max(2, round(given.effort * PICTURE_STEPS))
    stage = kept_stage(
        given, "picture", steps, count=count, what="picture network", patches=lambda: looks, kind=LITE0
    )
    file = given.out / "picture.onnx"
    export_picture(stage.net, 1.0, file)
    train_s = time.monotonic() - start
    found, temperature = calibrated(given.out, pictures)
    annotate(file, {"temperature": f"{temperature:.6f}"})
    text = picture_card(
        found,
        looks=looks,
        stage=stage,
        given=given,
        sha256=sha256_of(file),
        temperature=temperature,
        train_s=train_s,
        parameters=_parameters(stage.net),
    )
    cards.write_card(file.with_suffix(".md"), text)
    return found


def gather(given: argparse.Namespace, pictures: Sequence[Picture], steps: Steps) -> PatchSet:
    """Looks at the training pictures, and at worlds that the surface network has not seen."""
    count = max(6, round(given.effort * WORLDS))
    first = SEED_RANGES["train"].start + FIRST_SCENE_WORLD
    return joined(
        [
            training_looks(trained_on(pictures, given.without), CUTTING_SEED),
            _rendered(given, range(first, first + count), steps),
        ]
    )


def _rendered(given: argparse.Namespace, seeds: Sequence[int], steps: Steps) -> PatchSet:
    def draw() -> PatchSet:
        with steps("rendering worlds for whole pictures", len(seeds)) as report:
            done = iter(range(1, len(seeds) + 1))
            return rendered_looks(seeds, given.threads, lambda: report(next(done), np.nan))

    name = f"looks-{len(seeds)}.npz"
    return kept_or_made(given.kept, name, load=load_patches, make=draw, save=save_patches)


def _parameters(net: SurfaceNet) -> int:
    """Parameters that ship: the heads of the surface network are not in this file."""
    heads = ("reading", "disturbed", "softening")
    return sum(p.numel() for name, p in net.named_parameters() if not name.startswith(heads))
