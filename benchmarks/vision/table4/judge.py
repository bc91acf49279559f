"""The estimator, each of its parts switched off in turn, and the voting baseline over sequences of pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.camera.disturbances import NONE, PAPER, Disturbance, disturb
from trpac_core.vision.ife import Ife, IfeState, fit_camera, usable_road
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import PatchVerdicts, RoadMasks, Segmenter, SurfaceClassifier
from trpac_core.vision.voting import Voting, VotingConfig

from .sequences import Image, Sequence, majority

SCENARIOS: dict[str, Disturbance] = {"normal": NONE, "w/ interference": PAPER}
Changes = Mapping[str, Any]
"""Fields of `IfeConfig` with other values."""
VARIANTS: dict[str, Changes] = {
    "IFE": {},
    "no trajectory": {"use_trajectory": False},
    "shadow kept": {"remove_shadow": False},
    "not calibrated": {"calibrate": False},
    "equal weights": {"weight_evidence": False},
    "several widths": {"roi_spread": 1.7},
    "patches alone": {"use_scene": False},
    "no foresight": {"use_foresight": False},
    "no lines": {"use_lines": False},
}
VOTING = "voting"
DISTURBANCE_SEED = 5_000_000
NO_ROAD = -1
"""Class of a vote without drivable road; it counts as wrong."""


@dataclass
class Kept:
    """A classifier that answers the last patches from memory: variants that differ after it share its work."""

    classifier: SurfaceClassifier

    def __post_init__(self) -> None:
        self._asked = np.empty(0, np.uint8)
        self._verdicts = PatchVerdicts(np.empty((0, 3)), np.empty(0))

    @property
    def temperature(self) -> float:
        return self.classifier.temperature

    def verdicts(self, patches: NDArray[np.uint8]) -> PatchVerdicts:
        if not np.array_equal(patches, self._asked):
            self._asked, self._verdicts = patches, self.classifier.verdicts(patches)
        return self._verdicts


@dataclass(frozen=True)
class Networks:
    """Both networks of one folder."""

    segmenter: Segmenter
    classifier: SurfaceClassifier

    @classmethod
    def load(cls, folder: Path, threads: int = 1) -> Networks:
        """From segmenter.onnx and surface.onnx; raises ModelError."""
        return cls(
            Segmenter(folder / "segmenter.onnx", threads), SurfaceClassifier(folder / "surface.onnx", threads)
        )


def judged(
    sequence: Sequence, networks: Networks, scenario: str, variants: Mapping[str, Changes] = VARIANTS
) -> pd.DataFrame:
    """Verdicts on every frame of a sequence.

    Parameters
    ----------
    sequence : Sequence
        The pictures and what is true of them.
    networks : Networks
        That classify.
    scenario : str
        Key of `SCENARIOS`.
    variants : mapping
        Name to what differs from the units' estimator.

    Returns
    -------
    DataFrame
        One row per frame and method: sequence, source, part, frame, scenario, method, truth, share (of the near
        group's corners that are of the true class), found, flag, Q_v, m_0.
    """
    kept = Kept(networks.classifier)
    base = _config(sequence, {})
    estimators = {
        name: Ife(_config(sequence, changes), networks.segmenter, kept) for name, changes in variants.items()
    }
    voting = Voting(
        VotingConfig(camera=sequence.camera, roi_width_m=base.roi_width_m),
        networks.segmenter,
        networks.classifier,
    )
    states = dict.fromkeys(estimators, IfeState())
    corners_m = near_corners(base, networks, sequence)
    rows = []
    for number, frame in enumerate(sequence.frames):
        image = disturb(sequence.picture(frame), SCENARIOS[scenario], DISTURBANCE_SEED + number)
        masks = within(networks.segmenter.segment(image), sequence)
        truth, share = majority(frame.truth(corners_m))
        common = (sequence.name, sequence.source, frame.part, number, scenario)
        for name, ife in estimators.items():
            states[name], result = ife.process(states[name], image, sequence.motion_at(number), masks=masks)
            verdict = (int(result.surface), result.flag, result.Q_v, result.near.m_0)
            rows.append((*common, name, int(truth), share, *verdict))
        vote = voting.process(number, image, masks=masks)
        found = NO_ROAD if vote.surface is None else int(vote.surface)
        rows.append((*common, VOTING, int(truth), share, found, True, np.nan, np.nan))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _config(sequence: Sequence, changes: Changes) -> IfeConfig:
    """Of the near group alone, as in the units, with regions of the sequence's scale."""
    config = replace(IfeConfig(camera=sequence.camera, groups_looked_at=1), **changes)
    return replace(config, roi_width_m=sequence.roi_scale * config.roi_width_m)


COLUMNS = (
    "sequence",
    "source",
    "part",
    "frame",
    "scenario",
    "method",
    "truth",
    "share",
    "found",
    "flag",
    "Q_v",
    "m_0",
)


def near_corners(config: IfeConfig, networks: Networks, sequence: Sequence) -> NDArray[np.float64]:
    """Ground points of the near group that the camera shows, ordered along the way, shape (n, 2) [m]."""
    blank: Image = np.zeros((sequence.camera.height_px, sequence.camera.width_px, 3), np.uint8)
    masks = RoadMasks(np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32))
    ife = Ife(config, networks.segmenter, networks.classifier)
    camera = fit_camera(config.camera, blank)
    (near,) = ife.look(IfeState(), blank, sequence.motion, camera, masks, usable_road(masks, True))
    return near.corners.ground_m


def within(masks: RoadMasks, sequence: Sequence) -> RoadMasks:
    """Masks without the parts of the picture that may not be judged."""
    rows, columns = masks.drivable.shape
    allowed = np.zeros((rows, columns), np.bool_)
    for left, top, right, bottom in sequence.usable:
        allowed[round(top * rows) : round(bottom * rows), round(left * columns) : round(right * columns)] = (
            True
        )
    return replace(masks, drivable=np.where(allowed, masks.drivable, np.float32(0.0)))
