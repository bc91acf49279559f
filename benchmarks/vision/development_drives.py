"""Drives by which parameters of the camera side are chosen: on none of them is anything scored."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pandas as pd
from rich.progress import Progress

from .table4.clips import real_sequences
from .table4.drives import rendered_drives
from .table4.judge import SCENARIOS, Networks, judged
from .table4.sequences import Sequence

ROOT = Path(__file__).resolve().parents[2]
FIRST_SEED = 6_000_100
EVERY = 2
"""Of the frames of a rendered drive: neighbours are 0.5 m apart and much alike."""


def add_options(parser: argparse.ArgumentParser, drives: int) -> None:
    """The options that `verdicts` wants; by default it judges so many rendered drives."""
    parser.add_argument("--data", type=Path, help="folder of real road pictures; none: rendered drives only")
    parser.add_argument("--models", type=Path, default=ROOT / "models", help="folder of both networks")
    parser.add_argument("--drives", type=int, default=drives, help="rendered drives of 30 frames")
    parser.add_argument("--streets", action="store_true", help="their roads lie in the open shade of houses")
    parser.add_argument(
        "--out", type=Path, default=Path("out/development"), help="where the drives are kept, and figures"
    )


def verdicts(given: argparse.Namespace, variants: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Verdicts of the estimator's variants on every frame, undisturbed and with interference: see `judged`."""
    cv2.setNumThreads(1)
    networks = Networks.load(given.models)
    found = []
    with Progress() as bars:
        sequences = _sequences(given, bars)
        task = bars.add_task("judged", total=len(sequences) * len(SCENARIOS))
        for sequence in sequences:
            for scenario in SCENARIOS:
                found.append(judged(sequence, networks, scenario, variants))
                bars.advance(task)
    return pd.concat(found, ignore_index=True)


def _sequences(given: argparse.Namespace, bars: Progress) -> list[Sequence]:
    """Rendered drives, kept in the command line's folder, and the validation parts of its real clips."""
    drawing = bars.add_task("rendered drives", total=given.drives)
    kept = given.out / "streets" if given.streets else given.out
    drives, _ = rendered_drives(
        kept,
        given.drives,
        lambda done, _: bars.update(drawing, completed=done),
        FIRST_SEED,
        streets=given.streets,
    )
    rendered = [replace(drive, frames=drive.frames[::EVERY]) for drive in drives]
    real = real_sequences(given.data) if given.data else []
    return rendered + [part for part in (sequence.validation_part() for sequence in real) if part.frames]
