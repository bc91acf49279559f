"""The surface of single road pictures, of any camera."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.library import networks_folder
from scenarios.progress import Progress, silent
from scenarios.whole_files import written_whole
from trpac_core.files import quoted
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import LEAST_READABLE, usable_road
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import (
    PatchClassifier,
    RoadMasks,
    Segmenter,
    SurfaceClassifier,
    calibrated_probabilities,
)
from trpac_core.vision.region import LEAST_CONTRAST
from trpac_core.vision.roi_sampling import cut_box, road_shares

CLASSIFY_COLUMNS = ("file", "class", "confidence", "p_dry", "p_wet", "p_snow_ice")
PICTURE_ENDINGS = frozenset((".jpg", ".jpeg", ".png", ".bmp", ".gif", ".heic", ".tif", ".tiff", ".webp"))
"""Endings of picture files in a folder; those of unsupported formats are reported."""

LOWER_CENTRE = (0.20, 0.60, 0.80, 0.95)
"""Region of the road in pictures of an unknown camera: left, top, right, bottom [of the size]."""
WIDE = (0.08, 0.55, 0.92, 0.96)
"""A wider region with the sides of the road, whose reflections show water."""
PART = 0.6
"""Size of the four overlapping parts of the lower centre, of its width and height [-]."""
LEAST_USABLE = 0.7
"""Least share of road out of the shadow in a crop [-]."""
LEAST_ROAD = 0.05
"""Least probability of readable road of the best crop: the lowest of validation stills was 0.08 [-]."""
LEAST_CROPS = 2
"""Least number of crops on usable road; with fewer, all readable crops are used."""
PICTURE_WEIGHT, PATCHES_WEIGHT = 0.6, 0.3
"""How much the logits of the picture as a whole count, and the mean log probability of its patches [-].

Of 1152 pictures of three sources that neither network had learned from, fitted on two to judge the third, 0.50 to 0.76
and 0.28 to 0.30 made the true classes likeliest.
"""
_LEAST_PROBABILITY = 1e-12


def find_pictures(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Picture files among the paths and in folders among them, in counting order, each once; and problems."""
    found: dict[Path, None] = {}
    problems = []
    for path in paths:
        inside = pictures_in(path) if path.is_dir() else [path]
        if not inside:
            problems.append(
                f"{path}: no pictures in this folder. Expected JPEG or PNG files; name subfolders too."
            )
        found.update(dict.fromkeys(inside))
    return list(found), problems


def pictures_in(folder: Path) -> list[Path]:
    """Pictures of a folder in counting order; raises OSError."""
    files = (
        p for p in folder.iterdir() if p.suffix.lower() in PICTURE_ENDINGS and not p.name.startswith(".")
    )
    # A broken link is reported when it is read, not ignored.
    return sorted((p for p in files if not p.is_dir()), key=counting_order)


def cell_of(name: str | Path) -> str:
    """A file's name as a table cell: valid text, and no formula.

    A spreadsheet runs cells that begin with one of = + - @; with ./ before it the name is of the same file.
    """
    text = os.fsencode(name).decode("utf-8", "replace")
    return f"./{text}" if text.lstrip().startswith(("=", "+", "-", "@")) else text


def counting_order(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """Sorting key in which frame_2 comes before frame_10."""
    parts = re.findall(r"(\d+)|(\D+)", path.name)
    return [(0, int(digits), "") if digits else (1, 0, text) for digits, text in parts], path.name


def classify_pictures(
    files: Sequence[Path], progress: Progress = silent, bits: int | None = None
) -> tuple[pd.DataFrame, list[str]]:
    """Table of the surface in each picture, and problems; `bits` are those that files of 16 bits use.

    Returns
    -------
    DataFrame, list of str
        Columns `CLASSIFY_COLUMNS`, one row per classified picture; one sentence per other picture.

    Raises
    ------
    ModelError
        If a network file cannot be used.
    """
    networks = StillNetworks.load(networks_folder())
    rows, problems = [], []
    for done, file in enumerate(files, start=1):
        try:
            probabilities = networks.probabilities(decode_image(file, upright=True, bits=bits), quoted(file))
            surface = Surface(int(probabilities.argmax()))
            rows.append((cell_of(file), surface.label, float(probabilities.max()), *probabilities.tolist()))
        except ImageError as error:
            problems.append(str(error))
        progress(done, len(files))
    return pd.DataFrame(rows, columns=list(CLASSIFY_COLUMNS)), problems


def patch_logs(
    image: NDArray[np.uint8], masks: RoadMasks, classifier: PatchClassifier, name: str = "image"
) -> NDArray[np.float64]:
    """Mean log probability of dry, wet, snow and ice over the patches of one picture, shape (3,).

    Patches of one picture share light, camera and road, so that they are not the independent evidence that Dempster's
    rule requires.

    Raises ImageError where the lower centre has no contrast or no readable road: a covered, blinded or dark camera, a
    picture without road.
    """
    boxes = _crops(image.shape[1], image.shape[0])
    patches = np.stack([cut_box(image, box) for box in boxes])
    contrast = patches.std(axis=(1, 2)).max(axis=1) >= LEAST_CONTRAST
    if not contrast.any():
        raise ImageError(
            f"{name}: one even colour where the road should be. Is the lens covered, or the picture dark?"
        )
    judged = classifier.verdicts(patches)
    if judged.readable[contrast].max() < LEAST_ROAD:
        raise ImageError(
            f"{name}: no road that could be read where it should be, the lower centre. Is it a picture of a road, in "
            "focus and lit?"
        )
    usable = usable_road(masks, remove_shadow=True)
    share = road_shares(np.array(boxes), usable, image.shape[1], image.shape[0])
    readable = contrast & (judged.readable >= LEAST_READABLE)
    on_road = readable & (share >= LEAST_USABLE)
    best = next(
        (chosen for chosen, least in ((on_road, LEAST_CROPS), (readable, 1)) if chosen.sum() >= least),
        contrast,
    )
    probabilities = calibrated_probabilities(judged.logits[best], classifier.temperature)
    return np.asarray(np.log(np.maximum(probabilities, _LEAST_PROBABILITY)).mean(axis=0))


@dataclass(frozen=True)
class StillNetworks:
    """The networks that classify single pictures."""

    segmenter: Segmenter
    classifier: SurfaceClassifier

    @classmethod
    def load(cls, folder: Path) -> StillNetworks:
        """From segmenter.onnx and surface.onnx of a folder; raises ModelError."""
        return cls(Segmenter(folder / "segmenter.onnx"), SurfaceClassifier(folder / "surface.onnx"))

    def probabilities(self, image: NDArray[np.uint8], name: str = "image") -> NDArray[np.float64]:
        """Probabilities of dry, wet, snow and ice of one BGR picture, shape (3,) [-].

        What the picture as a whole says, and its patches.

        Raises ImageError as `patch_logs` does.
        """
        masks = self.segmenter.segment(image)
        logs = patch_logs(image, masks, self.classifier, name)
        both = PICTURE_WEIGHT * masks.surface + PATCHES_WEIGHT * logs
        return calibrated_probabilities(both[None], 1.0)[0]


def _crops(width_px: int, height_px: int) -> list[tuple[int, int, int, int]]:
    """The wide region, the lower centre and its four parts: left, top, right, bottom of each [px]."""
    left, top, right, bottom = LOWER_CENTRE
    columns, rows = PART * (right - left), PART * (bottom - top)
    parts = [(x, y, x + columns, y + rows) for x in (left, right - columns) for y in (top, bottom - rows)]
    size = np.array([width_px, height_px, width_px, height_px])
    return [tuple(int(edge) for edge in np.round(box * size)) for box in (WIDE, LOWER_CENTRE, *parts)]  # type: ignore[misc]


def write_classes(table: pd.DataFrame, out: Path) -> None:
    """Write the table of `classify_pictures`, complete or not at all; raises OSError."""
    with written_whole(out.parent) as made:
        table.to_csv(made / out.name, index=False, float_format="%.6f")
