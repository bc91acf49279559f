"""What pictures as wholes are worth beside their patches: T of the picture network, and scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from scenarios.stills import StillNetworks, patch_logs
from trpac_core.vision.classes import Surface
from trpac_core.vision.images import ImageError

from . import calibrate
from .data import Picture, judged_groups
from .scores import ClassScore

SHARES = (1e-3, 3.0)
"""Least and most that the picture's logits may count beside the mean log probability of its patches [-]."""


@dataclass(frozen=True)
class Verdicts:
    """What is known of the pictures of one set, aligned: those with road that can be judged.

    Attributes
    ----------
    labels : int64, shape (n,)
    patches : array, shape (n, 3)
        Mean log probabilities of the patches.
    picture : array, shape (n, 3)
        Logits of the whole.
    sequences : array of str, shape (n,)
        Series of neighbouring pictures that each belongs to.
    """

    labels: NDArray[np.int64]
    patches: NDArray[np.float64]
    picture: NDArray[np.float64]
    sequences: NDArray[np.str_]

    def together(self, share: float) -> NDArray[np.float64]:
        """Log probabilities, but for a constant, with the whole counted by a share (1 / T)."""
        return self.patches + share * self.picture

    def by_sequence(self) -> list[Verdicts]:
        """The verdicts of each sequence."""
        columns = (self.labels, self.patches, self.picture, self.sequences)
        rows = (self.sequences == name for name in np.unique(self.sequences))
        return [Verdicts(*(column[chosen] for column in columns)) for chosen in rows]


@dataclass(frozen=True)
class Scores:
    """A set by its patches, by the pictures as wholes, and by both."""

    patches: ClassScore
    picture: ClassScore
    together: ClassScore
    reliability: calibrate.Reliability
    entropies: tuple[float, float]
    """Cross-entropy of the patches alone and of both [nat]."""


def calibrated(folder: Path, pictures: Sequence[Picture]) -> tuple[dict[str, Scores], float]:
    """Scores of the judged sets, and T of the picture network beside the patches' verdicts."""
    networks = StillNetworks.load(folder)
    seen = {name: verdicts(networks, group) for name, group in judged_groups(pictures).items()}
    share = learned_share([found for name, found in seen.items() if " val" in name])
    return {name: score(found, share) for name, found in seen.items() if len(found.labels)}, 1.0 / share


def learned_share(validation: Sequence[Verdicts]) -> float:
    """1 / T that makes the true classes likeliest, every sequence counted alike [-].

    Neighbouring pictures are one observation more or less, and those of a clip whose rest was trained on are told too
    easily to say how sure a picture of a new place may be.
    """
    parts = [part for found in validation for part in found.by_sequence()]

    def entropy(share: float) -> float:
        return float(np.mean([calibrate.cross_entropy(p.together(share), p.labels) for p in parts]))

    return float(minimize_scalar(entropy, bounds=SHARES, method="bounded").x)


def verdicts(networks: StillNetworks, pictures: Sequence[Picture]) -> Verdicts:
    """What the networks say of pictures, cropped as one is asked to; those that the command refuses are left out."""
    labels, patches, whole, sequences = [], [], [], []
    for picture in pictures:
        for image in picture.clear_parts():
            masks = networks.segmenter.segment(image)
            try:
                logs = patch_logs(image, masks, networks.classifier, str(picture.path))
            except ImageError:
                continue
            labels.append(int(picture.surface))
            patches.append(logs)
            whole.append(networks.picture.logits(image))
            sequences.append(picture.sequence)
    shape = (len(labels), len(Surface))
    return Verdicts(
        np.array(labels, np.int64),
        np.reshape(patches, shape),
        np.reshape(whole, shape),
        np.array(sequences, np.str_),
    )


def score(found: Verdicts, share: float) -> Scores:
    """A set's scores, the whole counted by `share`."""
    both = found.together(share)
    return Scores(
        *(ClassScore.of(found.labels, z.argmax(axis=1)) for z in (found.patches, found.picture, both)),
        calibrate.reliability(both, found.labels),
        (
            calibrate.cross_entropy(found.patches, found.labels),
            calibrate.cross_entropy(both, found.labels),
        ),
    )
