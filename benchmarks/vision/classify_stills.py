"""How often `trpac vision classify` is right on real pictures that the networks were not trained on.

``python -m benchmarks.vision.classify_stills --data ROAD_IMAGES`` prints accuracy and recall per class with their 95 %
intervals for each set of pictures, and how often a verdict of a given confidence is right.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.report import markdown
from models.training.data import MANIFEST, DataFolderError, Picture, of_split, read_manifest
from models.training.scores import wilson_interval
from scenarios.stills import classify_pictures
from trpac_core.vision.classes import Surface

SETS = {
    "web stills, validation": ("condition_web", "val"),
    "web stills, test": ("condition_web", "test"),
    "other cameras, test": ("other_cameras/", "test"),
    "dash cameras by day, validation": ("bdd_day", "val"),
    "dash cameras by night, validation": ("bdd_night", "val"),
}
"""What the sources of each set begin with, and its split."""
CONFIDENCES = (0.0, 0.6, 0.75, 0.9, 1.0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables; one line and exit code 1 where a set has no pictures in the folder."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vision.classify_stills", description=__doc__)
    parser.add_argument(
        "--data", type=Path, required=True, help="folder of road pictures with its manifest.csv"
    )
    folder = parser.parse_args(arguments).data
    judged = {name: _judged(pictures) for name, pictures in _sets(folder).items()}
    rows = [
        (
            name,
            len(table),
            _share(table["right"]),
            *(f"{_share(own)} ({len(own)})" for own in _by_class(table)),
        )
        for name, table in judged.items()
    ]
    print(markdown(("pictures", "n", "accuracy", *(f"recall {s.label} (n)" for s in Surface)), rows))
    every, rows = pd.concat(judged.values()), []
    for low, high in pairwise(CONFIDENCES):
        right = every["right"][(every["confidence"] > low) & (every["confidence"] <= high)]
        rows.append((f"above {low} to {high}", len(right), _share(right)))
    print("\n" + markdown(("confidence", "pictures", "right"), rows))


def _sets(folder: Path) -> dict[str, list[Picture]]:
    """The pictures of each set; raises SystemExit where the folder cannot be read or lacks a set."""
    try:
        every = read_manifest(folder)
    except DataFolderError as error:
        raise SystemExit(f"classify_stills: {error}") from error
    found = {
        name: [p for p in of_split(every, split) if p.source.startswith(source)]
        for name, (source, split) in SETS.items()
    }
    for name, pictures in found.items():
        if not pictures:
            source, split = SETS[name]
            raise SystemExit(
                f"classify_stills: {folder / MANIFEST}: no {split} pictures for '{name}'; "
                f"expected rows of split {split} whose files lie in {source}"
            )
    return found


def _judged(pictures: Sequence[Picture]) -> pd.DataFrame:
    """What the command says of the pictures; one that it refuses counts as wrong."""
    found = classify_pictures([picture.path for picture in pictures])[0].set_index("file")
    table = found.reindex([str(picture.path) for picture in pictures])
    table["true"] = [picture.surface.label for picture in pictures]
    table["right"] = table["class"] == table["true"]
    return table


def _by_class(table: pd.DataFrame) -> list[pd.Series]:
    return [table["right"][table["true"] == surface.label] for surface in Surface]


def _share(right: pd.Series) -> str:
    """A share of hits with Wilson's interval [-]."""
    if not len(right):
        return "-"
    low, high = wilson_interval(int(right.sum()), len(right))
    return f"{np.mean(right):.3f} [{low:.2f}, {high:.2f}]"


if __name__ == "__main__":
    main()
