"""What the head is worth on sources that it has not learned from: `python -m models.training.left_out --data DIR`.

Each real source is left out of the head's training in turn, as it is and in every other light or weather, and judged.
Only the head is learned anew: the towers have seen web, CamVid, LUMS and the clips, so that for these the figures are
kind; cws8262, BDD and the other cameras they have never seen.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.networks import ModelError, Segmenter, SurfaceClassifier, calibrated_probabilities

from . import calibrate
from .cards import CLASSES, table
from .data import DataFolderError, Picture, read_manifest
from .found_roads import with_found_roads
from .head import Embedded, Towers, judged_set, learn, learn_scene, logits_of, training_set
from .patches import thinned
from .progress import bars, steps_of
from .scene_run import Steps
from .scores import wilson_interval

SOURCES: dict[str, tuple[str, ...]] = {
    "cws8262": ("cws8262",),
    "BDD": ("bdd_day", "bdd_night"),
    "web": ("condition_web",),
    "CamVid": ("drivable_camvid",),
    "LUMS": ("drivable_lums",),
    "clips": ("seq_extreme", "seq_dry_yolop", "dry_udacity"),
    "other cameras": ("other_cameras",),
}
"""What is left out together, and its families."""
SURE = 0.9
"""Confidence from which a wrong verdict misleads [-]."""
FLAG_ERROR = 0.02
"""Share of wrong pictures that is allowed where the flag is up [-]."""
CALIBRATION_SEED = 1


@dataclass(frozen=True)
class Verdicts:
    """Judged pictures, aligned: class and what is found.

    Attributes
    ----------
    labels : int64, shape (n,), class index
    logs : array, shape (n, 3), log probabilities: normalised mean of the patches'
    night : bool, shape (n,), whether the picture was taken by night
    """

    labels: NDArray[np.int64]
    logs: NDArray[np.float64]
    night: NDArray[np.bool_]

    @property
    def right(self) -> NDArray[np.bool_]:
        """Whether the likeliest class is the true one, shape (n,)."""
        return self.logs.argmax(axis=1) == self.labels

    @property
    def confidence(self) -> NDArray[np.float64]:
        """Probability of the likeliest class, shape (n,) [-]."""
        return np.exp(self.logs.max(axis=1))

    def where(self, chosen: NDArray[np.bool_]) -> Verdicts:
        """The chosen pictures alone."""
        return Verdicts(self.labels[chosen], self.logs[chosen], self.night[chosen])


def left_out_logits(towers: Towers, train: Embedded, judged: Embedded) -> dict[str, NDArray[np.float64]]:
    """Logits of each source's judged patches, in their scenes, from a head that was learned without the source."""
    found = {}
    for name, families in SOURCES.items():
        seen = train.where(~np.isin(train.families, families))
        head = learn(seen, towers.head)
        own = judged.where(np.isin(judged.families, families))
        found[name] = logits_of(own, head, learn_scene(seen, head))
    return found


def temperature_of(logits: Mapping[str, NDArray[np.float64]], judged: Embedded) -> float:
    """T of these sources' logits, each source counted by as many patches at most [-]."""
    chosen, labels = [], []
    for name, found in logits.items():
        keep = thinned(len(found), CALIBRATION_SEED)
        chosen.append(found[keep])
        labels.append(judged.where(np.isin(judged.families, SOURCES[name])).labels[keep])
    return calibrate.learn_temperature(np.concatenate(chosen), np.concatenate(labels))


def verdicts_of(
    logits: NDArray[np.float64], seen: Embedded, pictures: Sequence[Picture], temperature: float
) -> Verdicts:
    """Verdicts on pictures from the logits of their patches."""
    logs = np.log(np.maximum(calibrated_probabilities(logits, temperature), 1e-12))
    numbers, first, index = np.unique(seen.pictures, return_index=True, return_inverse=True)
    mean = np.zeros((len(numbers), logs.shape[1]))
    np.add.at(mean, index, logs)
    mean /= np.bincount(index)[:, None]
    mean -= np.log(np.exp(mean).sum(axis=1, keepdims=True))
    return Verdicts(seen.labels[first], mean, np.array([pictures[n].night for n in numbers]))


def risk_threshold(
    confidence: NDArray[np.float64], right: NDArray[np.bool_], shares: NDArray[np.float64]
) -> float:
    """Least confidence from which on at most `FLAG_ERROR` are wrong; 1 where there is none.

    The form of conformal risk control (Angelopoulos et al. 2022): one wrong picture more is counted than was seen.
    `shares` weigh the pictures, 1 on the average.
    """
    order = np.argsort(-confidence)
    wrong, flagged = np.cumsum((shares * ~right)[order]), np.cumsum(shares[order])
    safe = np.flatnonzero((wrong + 1.0) / (flagged + 1.0) <= FLAG_ERROR)
    return float(confidence[order][safe[-1]]) if len(safe) else 1.0


def judge(
    logits: Mapping[str, NDArray[np.float64]],
    judged: Embedded,
    pictures: Sequence[Picture],
    temperature: float | None,
) -> dict[str, Verdicts]:
    """Verdicts by source: each at the T of the other sources, or all at a T that is given."""
    found = {}
    for name, own in logits.items():
        others = {other: each for other, each in logits.items() if other != name}
        used = temperature_of(others, judged) if temperature is None else temperature
        seen = judged.where(np.isin(judged.families, SOURCES[name]))
        found[name] = verdicts_of(own, seen, pictures, used)
    return found


def flagged(verdicts: Mapping[str, Verdicts], name: str) -> tuple[Verdicts, NDArray[np.bool_]]:
    """A source's verdicts, and where the flag is up by the threshold of the other sources, each counted alike."""
    others = [v for other, v in verdicts.items() if other != name]
    count = sum(len(v.labels) for v in others)
    shares = np.concatenate([np.full(len(v.labels), count / len(others) / len(v.labels)) for v in others])
    threshold = risk_threshold(
        np.concatenate([v.confidence for v in others]), np.concatenate([v.right for v in others]), shares
    )
    own = verdicts[name]
    return own, own.confidence >= threshold


def rows(name: str, head: str, own: Verdicts, flag: NDArray[np.bool_]) -> list[list[str]]:
    """Rows of the table for one source: by day and by night where it has both."""
    parts = {name: np.ones(len(flag), np.bool_)}
    if 5 < own.night.sum() < len(flag):
        parts = {f"{name}, by day": ~own.night, f"{name}, by night": own.night}
    return [[part, head, *_row(own.where(chosen), flag[chosen])] for part, chosen in parts.items()]


def _row(own: Verdicts, flag: NDArray[np.bool_]) -> list[str]:
    right, n = own.right, len(flag)
    recalls = []
    for label in range(len(CLASSES)):
        of = own.labels == label
        low, high = wilson_interval(int(right[of].sum()), int(of.sum()))
        recalls.append(f"{right[of].mean():.2f} [{low:.2f}, {high:.2f}] ({of.sum()})" if of.any() else "-")
    sure = ~right & (own.confidence >= SURE)
    ece = calibrate.reliability(own.logs, own.labels).ece
    error = f"{100 * (~right[flag]).mean():.1f}" if flag.any() else "-"
    return [
        str(n),
        *recalls,
        f"{100 * sure.mean():.1f}",
        f"{ece:.3f}",
        error,
        f"{100 * flag[right].mean():.0f}",
    ]


HEADER = [
    "source left out", "head", "n", *(f"recall {name} [95 %] (n)" for name in CLASSES),
    f"wrong at {SURE:g} [%]", "ECE", "error at flag 1 [%]", "flag 1 of right [%]",
]  # fmt: skip


@dataclass(frozen=True)
class Comparison:
    """The heads beside each other: a Markdown table, T of all left-out sources, pictures without road to judge by."""

    table: str
    temperature: float
    unread: int


def compared(
    file: Path, towers: Towers, train: Embedded, given: argparse.Namespace, pictures: Sequence[Picture]
) -> Comparison:
    """The head in a network's file and those learned anew, each judged on the source that it was learned without."""
    shown = [picture for picture in pictures if picture.split != "gap"]
    judged = judged_set(towers, given, shown)
    classifier = SurfaceClassifier(file, given.threads)
    parts = {name: judged.where(np.isin(judged.families, families)) for name, families in SOURCES.items()}
    before = {name: logits_of(part, towers.head, classifier.scene_head) for name, part in parts.items()}
    after = left_out_logits(towers, train, judged)
    heads = {
        "in the file": judge(before, judged, shown, classifier.temperature),
        "learned anew": judge(after, judged, shown, None),
    }
    lines = [
        row
        for name in SOURCES
        for head, found in heads.items()
        for row in rows(name, head, *flagged(found, name))
    ]
    unread = len(shown) - len(np.unique(judged.pictures))
    return Comparison(table(HEADER, lines), temperature_of(after, judged), unread)


def report(given: argparse.Namespace, steps: Steps) -> str:
    """The comparison as text, for the network in the folder that the command line names."""
    file = given.out / "surface.onnx"
    segmenter = Segmenter(given.out / "segmenter.onnx", given.threads)
    pictures = with_found_roads(read_manifest(given.data), segmenter)
    towers = Towers(file, given.threads)
    train = training_set(towers, given, pictures, segmenter, steps)
    found = compared(file, towers, train, given, pictures)
    return (
        f"{found.table}\n\nT of all left-out sources: {found.temperature:.3f}. "
        f"Pictures in which too little road is found to judge them: {found.unread}."
    )


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one clear line when the data folder lacks something."""
    parser = argparse.ArgumentParser(
        prog="python -m models.training.left_out", description=__doc__.splitlines()[0]
    )
    parser.add_argument(
        "--data", type=Path, required=True, help="folder of road pictures with its manifest.csv"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("models"), help="where the networks lie (default: models)"
    )
    parser.add_argument(
        "--effort", type=float, default=1.0, help="share of the usual rendered worlds (default: 1)"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--kept", type=Path, help="folder that keeps what takes long: worlds and embeddings")
    given = parser.parse_args(arguments)
    given.without = ()
    try:
        with bars() as progress:
            told = report(given, partial(steps_of, progress))
    except (DataFolderError, ModelError) as error:
        print(f"models.training.left_out: {error}", file=sys.stderr)
        return 2
    print(told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
