"""The folder of real road pictures: its manifest, its splits and where the road is in each picture."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.classes import Surface

Image = NDArray[np.uint8]
Box = tuple[float, float, float, float]

MANIFEST, FURTHER_MANIFESTS = "manifest.csv", "manifest_*.csv"
COLUMNS = ("file", "split", "task", "label", "mask", "sequence_id", "licence", "width", "height")
SPLITS = ("train", "val", "test", "gap")
LABELS = {"dry": Surface.DRY, "wet": Surface.WET, "snow": Surface.SNOW_ICE}
IGNORE = 255
"""Mask value of pixels whose label is unknown."""

STREETS = "street_conditions/"
"""Folder of street pictures, sorted by class: which source one is of stands in its file's name."""
STREET_SOURCES = {"cws8262": ("cws8262", "cws8262"), "sidhardha36": ("bdd_day", "bdd_night")}
"""Source by day and by night of a street picture, by the first word of its file's name."""
ROAD_IS_FOUND = frozenset(name for names in STREET_SOURCES.values() for name in names)
"""Families whose patches are cut where the segmenter finds road, of all classes alike: of cws8262 only wet and snowy
pictures have a mask, so that masks would tell the class."""
FAMILIES = ROAD_IS_FOUND | {
    "condition_web",
    "drivable_camvid",
    "drivable_lums",
    "dry_udacity",
    "other_cameras",
    "seq_dry_yolop",
    "seq_extreme",
}
"""Families that the shipped networks were trained and judged on: what cards say of data holds for these alone."""
SQUASHED = ("condition_web", "cws8262")
"""Sources that have squeezed their pictures to squares."""

ROAD_BOXES: dict[str, tuple[Box, ...]] = {
    "condition_web": ((0.20, 0.60, 0.80, 0.95),),
    "seq_extreme": (
        (170 / 640, 250 / 360, 290 / 640, 315 / 360),
        (380 / 640, 255 / 360, 470 / 640, 315 / 360),
    ),
    "seq_dry_yolop": ((0.35, 0.78, 0.70, 0.98),),
    "dry_udacity": ((0.30, 0.72, 0.75, 0.93),),
    "other_cameras": ((0.30, 0.66, 0.65, 0.88),),
    "other_cameras/bdd": ((0.35, 0.52, 0.62, 0.68),),
    "other_cameras/ntnu_iphone": ((0.25, 0.75, 0.65, 0.98),),
    "other_cameras/rdd_norway": ((0.12, 0.70, 0.52, 0.95),),
}
"""Where the road is in pictures without a mask: left, top, right, bottom as fractions of the picture.

Set by looking at the pictures (burnt-in text, bonnets, verges), never by a network's score.
"""

WIDE_BOXES: dict[str, Box] = {
    "condition_web": (0.08, 0.55, 0.92, 0.96),
    "seq_extreme": (120 / 640, 200 / 360, 560 / 640, 315 / 360),
    "seq_dry_yolop": (0.12, 0.72, 0.88, 0.98),
    "dry_udacity": (0.15, 0.66, 0.88, 0.95),
}
"""Road and its close surroundings (verges, kerbs, vehicles, drawn paths), nearly from side to side."""

EXTREME_LIMITS: tuple[Box, ...] = (
    (120 / 640, 200 / 360, 290 / 640, 315 / 360),
    (380 / 640, 200 / 360, 560 / 640, 315 / 360),
)
"""Parts of the overlaid clips that are free of text, path dots and bonnet; their road boxes lie inside."""

CLEAR_PARTS: dict[str, tuple[Box, ...]] = {
    "seq_extreme": ((0.07, 0.43, 0.55, 0.87), (0.45, 0.43, 0.93, 0.87)),
}
"""Parts of a picture below what an instrument has written into it and above the bonnet, to which one would crop it;
other families are shown whole."""

MIN_EACH_CLASS = 1
"""Pictures of each class that the training and the validation split must hold at least."""


class DataFolderError(ValueError):
    """The data folder cannot be trained on; the message lists every problem found."""


@dataclass(frozen=True)
class Picture:
    """One row of the manifest.

    `source` is the camera or clip (a folder), `sequence` the series of neighbouring pictures in it.
    """

    path: Path
    split: str
    surface: Surface
    mask: Path | None
    source: str
    sequence: str
    licence: str
    night: bool = False

    def image(self) -> Image:
        """The picture, BGR uint8 of shape (height, width, 3)."""
        image = cv2.imread(str(self.path), cv2.IMREAD_COLOR)
        if image is None:
            raise DataFolderError(f"{self.path}: not a readable picture; fetch the data folder again")
        return np.asarray(image, dtype=np.uint8)

    def road_mask(self) -> Image:
        """The road mask, uint8 of shape (height, width): 0 not road, 1 road, 255 unknown."""
        if self.mask is None:
            raise DataFolderError(f"{self.path}: the manifest names no road mask for this picture")
        mask = cv2.imread(str(self.mask), cv2.IMREAD_GRAYSCALE)
        if mask is None:
            raise DataFolderError(f"{self.mask}: not a readable mask; fetch the data folder again")
        return np.asarray(mask, dtype=np.uint8)

    def road(self) -> Image | None:
        """The mask that patches are cut by, as of `road_mask`; None where they are cut in `boxes`."""
        return None if self.mask is None else self.road_mask()

    @property
    def origin(self) -> str:
        """What it counts as among the sources of its class."""
        return self.source

    @property
    def family(self) -> str:
        """See `family_of`."""
        return family_of(self.source)

    @property
    def road_is_found(self) -> bool:
        """Whether the segmenter finds the road that patches are cut on: no mask and no road box says where it is."""
        return self.family in ROAD_IS_FOUND or (self.mask is None and _road_boxes(self.source) is None)

    def clear_parts(self) -> list[Image]:
        """What one would show of the picture: all of it, or its parts without text and bonnet."""
        image = self.image()
        found = []
        for box in CLEAR_PARTS.get(self.family, ((0.0, 0.0, 1.0, 1.0),)):
            left, top, right, bottom = pixel_box(box, image)
            found.append(np.ascontiguousarray(image[top:bottom, left:right]))
        return found

    @property
    def wide_box(self) -> Box | None:
        """The wide look at a picture of this source, if there is one."""
        return WIDE_BOXES.get(self.family)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """Road boxes of a picture without a mask, as fractions of its width and height."""
        boxes = _road_boxes(self.source)
        if boxes is None:
            raise DataFolderError(f"{self.path}: no road box is known for source '{self.source}'")
        return boxes


def source_of(file: str, night: bool = False) -> str:
    """Camera or clip of a file of the manifest: its folder; web stills are one source, street pictures by name."""
    folder, _, name = file.rpartition("/")
    if file.startswith(STREETS):
        return STREET_SOURCES[name.partition("_")[0]][night]
    return "condition_web" if folder.startswith("condition_web/") else folder


def family_of(source: str) -> str:
    """Folder of a source; the three clips of one car are one family."""
    folder = source.split("/")[0]
    return "seq_extreme" if folder.startswith("seq_") and folder.endswith("_extreme") else folder


def read_manifest(folder: Path) -> list[Picture]:
    """All pictures of a data folder, in the order of its manifests.

    Raises
    ------
    DataFolderError
        If a manifest or files that it names are missing or a row is malformed; all problems in one message.
    """
    manifest = folder / MANIFEST
    if not manifest.is_file():
        raise DataFolderError(
            f"{manifest}: not found; --data must name the folder of road pictures that holds it"
        )
    problems: list[str] = []
    pictures: list[Picture] = []
    for each in (manifest, *sorted(folder.glob(FURTHER_MANIFESTS))):
        for line, row in enumerate(_rows(each), start=2):
            found = list(_row_problems(folder, row))
            problems += [f"{each.name}, line {line}: {problem}" for problem in found]
            if not found:
                pictures.append(_picture(folder, row))
    problems += _shared_sequences(pictures)
    if problems:
        shown = "\n  ".join(problems[:20])
        more = f"\n  and {len(problems) - 20} more" if len(problems) > 20 else ""
        raise DataFolderError(f"{folder}: {len(problems)} problem(s)\n  {shown}{more}")
    return pictures


def _rows(manifest: Path) -> list[dict[str, str]]:
    with manifest.open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
        if missing:
            raise DataFolderError(f"{manifest}: columns missing: {', '.join(missing)}")
        return list(reader)


def _picture(folder: Path, row: dict[str, str]) -> Picture:
    night = "night" in (row.get("notes") or "")
    return Picture(
        path=folder / row["file"],
        split=row["split"],
        surface=LABELS[row["label"]],
        mask=folder / row["mask"] if row["task"] == "seg" else None,
        source=source_of(row["file"], night),
        sequence=row["sequence_id"],
        licence=row["licence"],
        night=night,
    )


def _row_problems(folder: Path, row: dict[str, str]) -> Iterator[str]:
    if row["split"] not in SPLITS:
        yield f"split is '{row['split']}', expected one of {', '.join(SPLITS)}"
    if row["label"] not in LABELS:
        yield f"label is '{row['label']}', expected one of {', '.join(LABELS)}"
    if row["task"] not in ("cls", "seg"):
        yield f"task is '{row['task']}', expected cls or seg"
    if row["file"].startswith(STREETS) and Path(row["file"]).name.partition("_")[0] not in STREET_SOURCES:
        yield f"file {row['file']} begins with the name of no source, expected one of {', '.join(STREET_SOURCES)}"
    if not (folder / row["file"]).is_file():
        yield f"file {row['file']} is not in the folder"
    if row["task"] == "seg" and not (row["mask"] and (folder / row["mask"]).is_file()):
        yield f"mask '{row['mask']}' of {row['file']} is not in the folder"


def _shared_sequences(pictures: Iterable[Picture]) -> list[str]:
    """Sequences whose pictures stand in more than one split, clips cut in time with a gap excepted."""
    splits: dict[str, set[str]] = {}
    for picture in pictures:
        splits.setdefault(picture.sequence, set()).add(picture.split)
    return [
        f"sequence '{name}' is in the splits {', '.join(sorted(found))}: neighbouring pictures would leak"
        for name, found in sorted(splits.items())
        if len(found) > 1 and "gap" not in found
    ]


def of_split(pictures: Iterable[Picture], split: str, *, masked: bool | None = None) -> list[Picture]:
    """Pictures of one split; with `masked`, only those with (True) or without (False) a road mask."""
    return [
        picture
        for picture in pictures
        if picture.split == split and (masked is None or (picture.mask is not None) == masked)
    ]


def trained_on(pictures: Iterable[Picture], without: Sequence[str]) -> list[Picture]:
    """The training pictures but for the families that are left out."""
    return [picture for picture in of_split(pictures, "train") if picture.family not in without]


def judged_groups(pictures: Sequence[Picture]) -> dict[str, list[Picture]]:
    """Validation and test pictures by the set that they are judged in; test pictures of other cameras apart."""
    validation, test = of_split(pictures, "val"), of_split(pictures, "test")
    groups = {
        f"real val: {source}": [p for p in validation if p.source == source]
        for source in sorted({picture.source for picture in validation})
    }
    groups["real test: stills, same search"] = [p for p in test if p.source == "condition_web"]
    groups["real test: other cameras"] = [p for p in test if p.source.startswith("other_cameras/")]
    known = {id(picture) for group in groups.values() for picture in group}
    groups["real test: other"] = [p for p in test if id(p) not in known]
    return {name: group for name, group in groups.items() if group}


def _road_boxes(source: str) -> tuple[Box, ...] | None:
    """Boxes of a source, or of its family; None where neither is known."""
    return ROAD_BOXES.get(source, ROAD_BOXES.get(family_of(source)))


def check_trainable(pictures: list[Picture], *, masks: bool = True) -> None:
    """Raise DataFolderError with all that is lacking for a training run; `masks` are what the segmenter learns from."""
    lacking = []
    for split in ("train", "val"):
        if masks and not of_split(pictures, split, masked=True):
            lacking.append(
                f"split {split} holds no picture with a road mask (task seg), from which the segmenter learns; "
                "--only surface needs none"
            )
        for label, surface in LABELS.items():
            count = sum(picture.surface == surface for picture in of_split(pictures, split))
            if count < MIN_EACH_CLASS:
                lacking.append(f"split {split} holds no picture labelled {label}")
    if lacking:
        raise DataFolderError("the data folder lacks what training needs:\n  " + "\n  ".join(lacking))


def pixel_box(box: Box, image: Image) -> tuple[int, int, int, int]:
    """A box given in fractions as whole pixels of an image: left, top, right, bottom (exclusive)."""
    height, width = image.shape[:2]
    return (round(box[0] * width), round(box[1] * height), round(box[2] * width), round(box[3] * height))
