"""What the road network is worth on sources that it has not learned from.

`python -m models.training.left_out --data DIR`: each real source is left out in turn and judged.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import log_softmax

from . import calibrate
from .cards import CLASSES, table
from .data import DataFolderError, Picture, read_manifest
from .nets import RoadNet
from .night import shown_family
from .progress import Steps, bars, steps_of
from .rendered import PATCHES_PER_VIEW, WORLDS, draw_worlds
from .road_run import SOURCES, Road, teach_masks, trained
from .scores import wilson_interval
from .segmenter_data import masked_sample
from .train_segmenter import score_segmenter

SURE = 0.9
"""Confidence from which a wrong verdict misleads [-]."""
FLAG_ERROR = 0.02
"""Share of wrong pictures that is allowed where a flag is up [-]."""
LEAST = 6
"""Pictures of a source by day, or by night, that are judged apart [-]."""


@dataclass(frozen=True)
class Verdicts:
    """Judged pictures, aligned.

    Attributes
    ----------
    labels : int64, shape (n,), class index
    logs : array, shape (n, 3), log probabilities
    """

    labels: NDArray[np.int64]
    logs: NDArray[np.float64]

    @property
    def right(self) -> NDArray[np.bool_]:
        """Whether the likeliest class is the true one, shape (n,)."""
        return self.logs.argmax(axis=1) == self.labels

    @property
    def confidence(self) -> NDArray[np.float64]:
        """Probability of the likeliest class, shape (n,) [-]."""
        return np.exp(self.logs.max(axis=1))


def judged(road: Road) -> dict[str, Verdicts]:
    """Verdicts on the pictures of each source by day and by night, from a surface learned without the source."""
    logs = log_softmax(road.left_out, axis=1)
    labels, families = road.surfaces.plain_labels, road.surfaces.plain_families
    night = road.material.night
    found = {}
    for name, own in SOURCES.items():
        for part, when in ((name, ~night), (f"{name}, night", night)):
            chosen = np.isin(families, own) & when
            if chosen.sum() >= LEAST:
                found[part] = Verdicts(labels[chosen], logs[chosen])
    return found


def flag_threshold(others: Sequence[Verdicts]) -> float:
    """Least confidence from which on at most `FLAG_ERROR` are wrong of the worst of some sources; 1 if there is none.

    The form of conformal risk control (Angelopoulos et al. 2022), the source that is not known taken to be no worse
    than the worst that is.
    """
    least = 0.0
    for verdicts in others:
        order = np.argsort(-verdicts.confidence)
        allowed = FLAG_ERROR * np.arange(1, len(order) + 1)
        safe = np.flatnonzero(np.cumsum(~verdicts.right[order]) <= allowed)
        least = max(least, float(verdicts.confidence[order][safe[-1]]) if len(safe) else 1.0)
    return least


HEADER = [
    "source left out", "n", *(f"recall {name} [95 %] (n)" for name in CLASSES),
    f"wrong at {SURE:g} [%]", "ECE", "wrong at flag 1 [%]", "flag 1 of right [%]",
]  # fmt: skip


def left_out_table(road: Road) -> str:
    """A Markdown table of sources, each judged by what was learned from the others."""
    found = judged(road)
    rows = []
    for name, own in found.items():
        source = name.partition(",")[0]
        flag = own.confidence >= flag_threshold(
            [each for other, each in found.items() if other.partition(",")[0] != source]
        )
        rows.append([name, *_row(own, flag)])
    return table(HEADER, rows)


def _row(own: Verdicts, flag: NDArray[np.bool_]) -> list[str]:
    right = own.right
    recalls = []
    for label in range(len(CLASSES)):
        of = own.labels == label
        low, high = wilson_interval(int(right[of].sum()), int(of.sum()))
        recalls.append(f"{right[of].mean():.2f} [{low:.2f}, {high:.2f}] ({of.sum()})" if of.any() else "-")
    sure = ~right & (own.confidence >= SURE)
    return [
        str(len(right)),
        *recalls,
        f"{100 * sure.mean():.1f}",
        f"{calibrate.reliability(own.logs, own.labels).ece:.3f}",
        f"{100 * (~right[flag]).mean():.1f}" if flag.any() else "-",
        f"{100 * flag[right].mean():.0f}",
    ]


def masks_table(road: Road, pictures: Sequence[Picture], given: argparse.Namespace, steps: Steps) -> str:
    """IoU of the masks of each source that has some, from decoders that were trained without the source."""
    training = road.material.training
    families = np.array([shown_family(view.source) for view in training.views])
    rows = []
    for name, own in SOURCES.items():
        masked = [masked_sample(p) for p in pictures if p.family in own and p.mask is not None]
        if not masked:
            continue
        torch.manual_seed(given.seed)
        net = RoadNet(pretrained=True)
        kept = training.where(~np.isin(families, own))
        teach_masks(net, kept, given, steps, f"training masks without {name}")
        score = score_segmenter(net, masked, "drivable")
        rows.append([name, str(score.pictures), f"{score.iou:.3f}"])
    return table(["source left out", "pictures with a mask", "IoU of drivable area"], rows)


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one clear line when the data folder lacks something."""
    parser = argparse.ArgumentParser(prog="python -m models.training.left_out", description=__doc__)
    parser.add_argument(
        "--data", type=Path, required=True, help="folder of road pictures with its manifest.csv"
    )
    parser.add_argument(
        "--effort", type=float, default=1.0, help="share of the usual steps and rendered worlds (default: 1)"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--seed", type=int, default=1, help="seed of every random choice (default: 1)")
    given = parser.parse_args(arguments)
    torch.set_num_threads(given.threads)
    try:
        pictures = read_manifest(given.data)
        with bars() as progress:
            steps = partial(steps_of, progress)
            count = max(3, round(given.effort * WORLDS["train"]))
            with steps("rendering worlds", count) as report:
                done = iter(range(1, count + 1))
                rendered, _ = draw_worlds(
                    "train",
                    count,
                    PATCHES_PER_VIEW["train"],
                    given.threads,
                    lambda: report(next(done), np.nan),
                )
            road = trained(given, pictures, rendered, steps)
            told = [left_out_table(road), masks_table(road, pictures, given, steps)]
    except DataFolderError as error:
        print(f"models.training.left_out: {error}", file=sys.stderr)
        return 2
    print("\n\n".join(told))
    return 0


if __name__ == "__main__":
    sys.exit(main())
