"""One group of road ahead: its ground, its patches, and the share of ground that each patch represents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .classes import Surface
from .evidence import combine
from .roi_sampling import (
    Corners,
    cut_box,
    middle_ground_m,
    project,
    road_shares,
    roi_boxes,
    roi_widths_px,
    with_most_road,
)
from .trajectory import Ellipses, way_beside

LEAST_CONTRAST = 1.0
"""Standard deviation of a patch's grey levels below which it shows no road but a covered, blinded or dark camera. The
lowest value of disturbed rendered road was 3.1, of real road 1.9 [8-bit levels]."""

BODIES_OF_SECTION = 10
"""Bodies of evidence as which Eq. (7) combines the patches on one side of a line, so that each side is as sure [-]."""

CORNERS_THINNED = 20
"""One of so many corners is used to measure the ground between two lines [-]."""

Lines = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Positions of lines across the road, and of candidates seen for the first time: see `Way` [m]."""


@dataclass(frozen=True)
class Way:
    """The path of the wheels, and the lines that cross it.

    Attributes
    ----------
    tracks : tuple of Ellipses
        Of the wheels; without any, the path is straight.
    lines_m : array, shape (n,)
        Where lines cross the road, ascending [m].
    doubtful_m : array, shape (m,)
        Candidates that were seen for the first time [m].
    """

    tracks: tuple[Ellipses, ...]
    lines_m: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    doubtful_m: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def lines_from(self, way_m: float | None) -> tuple[float, ...]:
        """All lines as distances driven by the front wheels; none where the distance so far is unknown [m]."""
        return () if way_m is None else tuple((way_m + np.append(self.lines_m, self.doubtful_m)).tolist())

    def to(self, ground_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance along the path of ground points, shape (n,) [m]."""
        return way_beside(self.tracks, ground_m) if self.tracks and len(ground_m) else ground_m[:, 0]

    def section(self, places_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """Number of lines before each place on the path, shape (n,)."""
        return np.searchsorted(self.lines_m, places_m, side="right")

    def rows_of_ends_px(self, ground_m: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
        """Rows of the lines beyond and before each ground point, shape (n, 2); infinite where there is none [px]."""
        rows_px = np.full((len(ground_m), 2), (-np.inf, np.inf))
        if len(self.lines_m) and len(ground_m):
            places_m = self.to(ground_m)
            before = self.section(places_m)
            ends_m = np.concatenate(([-np.inf], self.lines_m, [np.inf]))
            for column, end_m in enumerate((ends_m[before + 1], ends_m[before])):
                known = np.isfinite(end_m)
                on_line_m = ground_m[known] + np.outer((end_m - places_m)[known], (1.0, 0.0))
                rows_px[known, column] = project(on_line_m, camera)[:, 1]
        return rows_px


@dataclass(frozen=True)
class Heard:
    """Patches that count for the class of a group, with their weights.

    Attributes
    ----------
    probabilities : array, shape (n, 3)
        Of the group's own patches, and of those of its ground that were seen before [-].
    say : array, shape (n,)
        Weight of each: see `Region.say`.
    parted : bool
        Whether a line lies between them.
    """

    probabilities: NDArray[np.float64]
    say: NDArray[np.float64]
    parted: bool


@dataclass(frozen=True)
class Region:
    """One group on its path: its corners, the patches drawn from them, and the probabilities of the readable ones.

    Attributes
    ----------
    corners : Corners
        The group's ground.
    way : Way
        On which it lies.
    ellipses : tuple of Ellipses
        Of the wheels in it.
    drawn : int
        Patches that were drawn.
    boxes : array of int, shape (n, 4)
        Of those left: left, top, right, bottom [px].
    ahead_m : array, shape (n,)
        Position of the middle of each on the path [m].
    patches : tuple of n arrays of uint8, shape (64, 96, 3)
        BGR.
    probabilities : array, shape (n, 3)
        Calibrated [-].
    """

    corners: Corners
    way: Way
    ellipses: tuple[Ellipses, ...]
    drawn: int
    boxes: NDArray[np.int64]
    ahead_m: NDArray[np.float64]
    patches: tuple[NDArray[np.uint8], ...] = ()
    probabilities: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, len(Surface))))

    @classmethod
    def around(
        cls,
        corners: Corners,
        drawn: NDArray[np.intp],
        widths_m: NDArray[np.float64],
        way: Way,
        ellipses: Sequence[Ellipses],
        camera: Camera,
        drivable: NDArray[np.bool_],
    ) -> Region:
        """A region with patches of these widths, each on its side of the lines.

        Of the corners drawn, those are taken whose patches show most drivable road.
        """
        ground_m = corners.ground_m[drawn]
        widths_px = roi_widths_px(camera, ground_m, np.resize(widths_m, len(drawn)))
        ends_px = way.rows_of_ends_px(ground_m, camera)
        boxes = roi_boxes(camera, corners.pixel[drawn], widths_px, ends_px)
        shares = road_shares(boxes, drivable, camera.width_px, camera.height_px)
        taken = with_most_road(shares, len(widths_m))
        ahead_m = way.to(middle_ground_m(camera, ground_m[taken], boxes[taken]))
        return cls(corners, way, tuple(ellipses), len(taken), boxes[taken], ahead_m)

    def seen_in(self, image: NDArray[np.uint8]) -> Region:
        """The region with the patches cut, those without contrast left out."""
        cut = tuple(cut_box(image, (left, top, right, bottom)) for left, top, right, bottom in self.boxes)
        contrast = np.array([cv2.meanStdDev(patch)[1].max() for patch in cut])
        return replace(self, patches=cut).keeping(contrast >= LEAST_CONTRAST)

    def keeping(self, kept: NDArray[np.bool_]) -> Region:
        """The region with some of its patches."""
        return replace(
            self,
            boxes=self.boxes[kept],
            ahead_m=self.ahead_m[kept],
            patches=tuple(patch for patch, keep in zip(self.patches, kept, strict=True) if keep),
        )

    @property
    def p_util(self) -> float:
        """Usable share of the road [-]: share of usable corners times share of readable patches.

        The paper has the first factor only; the second clears the flag for covered lenses, walls and night skies
        (`lab/2026-11-29_camera_scores.md` has the figures).
        """
        read = len(self.probabilities) / self.drawn if self.drawn else 1.0
        return self.corners.p_util * read

    def heard(
        self, places_m: NDArray[np.float64], probabilities: NDArray[np.float64], inside: NDArray[np.bool_]
    ) -> Heard:
        """Those of these patches, the region's own first, that count for its class; arguments as of `say`."""
        say = self.say(places_m, inside)
        parted = len(np.unique(self.way.section(places_m[say > 0.0]))) > 1
        if parted:
            probabilities = self.by_section(places_m, probabilities, say)
        kept = (say > 0.0) | (np.arange(len(say)) < len(self.ahead_m))
        return Heard(probabilities[kept], say[kept], parted)

    def say(self, places_m: NDArray[np.float64], inside: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Weight of each patch: the patches on one side of a line share the ground on that side.

        Parameters
        ----------
        places_m : array, shape (n,)
            Positions of the patches on the path, the region's own first [m].
        inside : array of bool, shape (n,)
            Which of them count as the group's. Where none lies on a side, the closest to the line does.

        Returns
        -------
        array, shape (n,)
            In corners; 0 for a patch that does not count, 1 for each of the group's without a line [-].
        """
        if not len(self.way.lines_m):
            return inside.astype(np.float64)
        thinned_m = self.way.to(self.corners.ground_m[::CORNERS_THINNED])
        ground = np.bincount(self.way.section(np.concatenate((thinned_m, self.ahead_m))))
        sections = self.way.section(places_m)
        said = np.zeros(len(places_m))
        for section in np.flatnonzero(ground).tolist():
            there = sections == section
            heard = there & inside
            if there.any() and not heard.any():
                line_m = self.way.lines_m[max(section - 1, 0)]
                heard[np.where(there, np.abs(places_m - line_m), np.inf).argmin()] = True
            said[heard] = ground[section] / max(np.count_nonzero(heard), 1)
        return said

    def by_section(
        self, places_m: NDArray[np.float64], probabilities: NDArray[np.float64], say: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Probabilities of each patch, combined with those that count on its side of a line.

        Half of the ground weighs half, also where one of two surfaces is classified with less confidence.

        Parameters
        ----------
        places_m, probabilities : array, shapes (n,), (n, 3)
            Positions of the patches on the path [m], and their probabilities [-].
        say : array, shape (n,)
            See `say`.

        Returns
        -------
        array, shape (n, 3)
            Of sum 1 each [-].
        """
        sections = self.way.section(places_m)
        combined = probabilities.copy()
        for section in np.unique(sections[say > 0.0]):
            there = sections == section
            combined[there] = combine(probabilities[there & (say > 0.0)].mean(axis=0), BODIES_OF_SECTION)
        return combined
