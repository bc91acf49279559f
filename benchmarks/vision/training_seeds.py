"""How much the surface network's scores hang on the seed of its training: real test pictures, several networks.

``python -m benchmarks.vision.training_seeds --data ROAD_IMAGES NETWORK NETWORK NETWORK`` judges every test picture by
each network, as the model card does, and prints accuracy and recall per class: of each network, and their mean with a
95 % interval over pictures and seeds, drawn anew together.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.training.data import MANIFEST, DataFolderError, Picture, of_split, read_manifest
from models.training.patches import judged_patches
from models.training.scene_set import SceneSet, scenes_of_pictures
from models.training.scores import picture_verdicts, wilson_interval
from trpac_core.vision.classes import Surface
from trpac_core.vision.networks import SurfaceClassifier

DRAWS = 10_000
SETS = {"stills, same search": ("condition_web", "test"), "other cameras": ("other_cameras/", "test")}
"""What the sources of each set begin with, and its split."""

Hits = NDArray[np.bool_]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table; one line and exit code 1 where a set has no pictures in the folder."""
    given = _options(arguments)
    test = sets_of_pictures(given.data, SETS, "training_seeds")
    networks = [SurfaceClassifier(path) for path in given.networks]
    numbers = " | ".join(str(i + 1) for i in range(len(networks)))
    print(f"| set | score | pictures | {numbers} | mean [95 %] |")
    print("|---" * (4 + len(networks)) + "|")
    for name, pictures in test.items():
        for line in rows(name, pictures, networks):
            print(line)


def rows(name: str, pictures: Sequence[Picture], networks: Sequence[SurfaceClassifier]) -> list[str]:
    """A set's lines of the table: accuracy, then the recall of each class that it holds."""
    seen = scenes_of_pictures(judged_patches(pictures), pictures)
    labels = np.array([int(picture.surface) for picture in pictures])
    right = np.array([_right(network, seen) for network in networks])
    scores = {"accuracy": np.ones(len(labels), np.bool_)}
    scores |= {f"recall {surface.label}": labels == surface for surface in Surface}
    return [
        " | ".join(
            [
                f"| {name}",
                score,
                str(int(chosen.sum())),
                *(f"{share:.3f}" for share in right[:, chosen].mean(axis=1)),
                "{:.3f} [{:.3f}, {:.3f}] |".format(right[:, chosen].mean(), *interval(right[:, chosen])),
            ]
        )
        for score, chosen in scores.items()
        if chosen.any()
    ]


def interval(right: Hits, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the mean of hits, shape (networks, pictures), by a bootstrap over both [-].

    Where all or none are hits it is Wilson's, of one network's pictures.
    """
    if right.all() or not right.any():
        return wilson_interval(int(right[0].sum()), right.shape[1])
    rng = np.random.default_rng(seed)
    networks, pictures = right.shape
    means = [
        right[np.ix_(rng.integers(networks, size=networks), rng.integers(pictures, size=pictures))].mean()
        for _ in range(DRAWS)
    ]
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)


def _right(network: SurfaceClassifier, seen: SceneSet) -> Hits:
    """Whether each picture's class is found."""
    true, found = picture_verdicts(seen.logits(network), seen.patches, network.temperature)
    return true == found


def sets_of_pictures(
    folder: Path, sets: Mapping[str, tuple[str, str]], command: str
) -> dict[str, list[Picture]]:
    """The pictures of each set; raises SystemExit where the folder cannot be read or lacks a set."""
    try:
        every = read_manifest(folder)
    except DataFolderError as error:
        raise SystemExit(f"{command}: {error}") from error
    found = {
        name: [p for p in of_split(every, split) if p.source.startswith(source)]
        for name, (source, split) in sets.items()
    }
    for name, pictures in found.items():
        if not pictures:
            source, split = sets[name]
            raise SystemExit(
                f"{command}: {folder / MANIFEST}: no {split} pictures for '{name}'; "
                f"expected rows of split {split} whose files lie in {source}"
            )
    return found


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vision.training_seeds", description=__doc__)
    parser.add_argument(
        "--data", type=Path, required=True, help="folder of road pictures with its manifest.csv"
    )
    parser.add_argument(
        "networks", type=Path, nargs="+", help="surface networks, one per seed of the training"
    )
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
