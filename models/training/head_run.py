"""The stage that learns the surface network's linear head anew: head, T of left-out sources, scene, card."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from trpac_core.vision.networks import Segmenter

from . import cards, scores
from .data import Picture
from .head import RIDGE, Towers, learn, learn_scene, training_set, with_head
from .left_out import compared
from .scene_run import Steps, judged_sets, write_scene


def ship_head(
    file: Path, given: argparse.Namespace, pictures: Sequence[Picture], worlds: dict[str, int], steps: Steps
) -> dict[str, scores.Judged]:
    """Learn the head of a network file anew, then what a scene adds; write both into the file and its card."""
    towers = Towers(file, given.threads)
    segmenter = Segmenter(file.parent / "segmenter.onnx", given.threads)
    train = training_set(towers, given, pictures, segmenter, steps)
    told = compared(file, towers, train, given, pictures)
    head = learn(train, towers.head)
    with_head(file, head)
    card = file.with_suffix(".md")
    section = cards.head_section(
        told.table,
        patches=len(train.labels),
        ridge=RIDGE,
        temperature=told.temperature,
        command="python -m models.training --only head",
    )
    text = cards.with_head(card.read_text(encoding="utf-8"), section, cards.data_table(pictures))
    cards.write_card(card, text)
    scene, judged = learn_scene(train, head), judged_sets(given, pictures, worlds, steps)
    return write_scene(file, scene, told.temperature, len(train.labels), given, judged)
