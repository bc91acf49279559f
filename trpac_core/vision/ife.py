"""The image-based fusion estimator (IFE): surface class and confidence from a picture and the motion of the car."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .classes import Surface
from .evidence import EvidenceState, basic_probability, combine, update_weights, visual_confidence
from .ife_config import GROUP_NAMES, SIDES, IfeConfig
from .images import ImageError
from .lookahead import BEHIND_M, Look, due, recalled, road_passed, within_reach
from .networks import (
    PatchClassifier,
    RoadMasks,
    RoadSegmenter,
    Segmenter,
    SurfaceClassifier,
    calibrated_probabilities,
)
from .region import Heard, Lines, Region, Way
from .results import FrameResult, FrameView, GroupResult, GroupView
from .roi_sampling import (
    LANE_HALF_WIDTH_M,
    TRIES,
    classify_corners,
    corners_in_ellipses,
    corners_in_lane,
    corners_in_strip,
    sample,
    sample_across,
)
from .surface_edges import KNOWN_WITHIN_M, ends_m, lines_across
from .surface_hmm import Passed, among_neighbours
from .trajectory import Ellipses, Motion, path_curvature, reckon

MASK_THRESHOLD = 0.5
"""Probability above which a mask's cell counts as drivable, or as shadow [-]."""

LEAST_READABLE = 0.5
"""Probability of readable road below which a patch is left out [-]."""

BEFORE_NEAR_M, HIDDEN_M = 0.5, 0.3
"""Road before the near group on which lines are looked for, and road of its own up to which the picture's end may hide
one that was seen before [m]."""

PICTURE_SAY = 0.5
"""Weight of the logits of the whole picture beside those of a patch [-]."""

PATCHES_AHEAD = 6
"""Number of remembered patches per frame [-]."""


@dataclass(frozen=True)
class IfeState:
    """State of the estimator: evidence weights per group, number of frames, remembered patches of road ahead (looks).

    `lines_m` are distances driven by the front wheels at lines across the road; `passed` has the class probabilities
    at the end of the road passed.
    """

    evidence: tuple[EvidenceState, ...] = (EvidenceState(),) * len(GROUP_NAMES)
    frame_count: int = 0
    looks: tuple[Look, ...] = ()
    lines_m: tuple[float, ...] = ()
    passed: Passed | None = None

    def elsewhere(self) -> IfeState:
        """The state after the position was lost: no road ahead or passed is known."""
        return replace(self, looks=(), lines_m=(), passed=None)

    def to_json(self) -> dict[str, Any]:
        """The state as JSON-able values, exact."""
        return {
            "weights": [list(group.weights) for group in self.evidence],
            "frame_count": self.frame_count,
            "looks": [look.to_json() for look in self.looks],
            "lines_m": list(self.lines_m),
            "passed": None if self.passed is None else self.passed.to_json(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> IfeState:
        """The state that `to_json` wrote."""
        evidence = tuple(EvidenceState((dry, wet, snow_ice)) for dry, wet, snow_ice in data["weights"])
        looks = tuple(Look.from_json(look) for look in data["looks"])
        passed = None if data["passed"] is None else Passed.from_json(data["passed"])
        return cls(evidence, int(data["frame_count"]), looks, tuple(data["lines_m"]), passed)


class Ife:
    """The estimator with its networks; it stores nothing, all memory is in the state."""

    def __init__(self, config: IfeConfig, segmenter: RoadSegmenter, classifier: PatchClassifier) -> None:
        self.config = config
        self._segmenter = segmenter
        self._classifier = classifier

    @classmethod
    def load(cls, config: IfeConfig, folder: Path) -> Ife:
        """The estimator with segmenter.onnx and surface.onnx of a folder; raises ModelError."""
        return cls(config, Segmenter(folder / "segmenter.onnx"), SurfaceClassifier(folder / "surface.onnx"))

    def process(
        self,
        state: IfeState,
        image: NDArray[np.uint8],
        motion: Motion,
        *,
        masks: RoadMasks | None = None,
        with_view: bool = False,
    ) -> tuple[IfeState, FrameResult]:
        """The state and the result after one frame.

        Parameters
        ----------
        state : IfeState
            After the frame before; `IfeState()` at first.
        image : array of uint8, shape (height, width, 3)
            The picture, BGR, of the camera's shape.
        motion : Motion
            Of the car when the picture was taken.
        masks : RoadMasks, optional
            Of this picture, where several estimators share it (left and right wheels).
        with_view : bool
            Whether the result also has the regions and masks, for drawing.

        Returns
        -------
        IfeState, FrameResult
            The state after the frame, and its verdict.

        Raises
        ------
        ImageError
            If the picture is not 8-bit BGR or has another shape than the camera's.
        """
        camera = fit_camera(self.config.camera, image)
        masks = self._segmenter.segment(image) if masks is None else masks
        usable = usable_road(masks, self.config.remove_shadow)
        regions = self.look(state, image, motion, camera, masks, usable)
        regions = self.classify(regions, masks)
        state, result = self.judge(state, motion, regions)
        if with_view:
            curvature, wheelbase_m = path_curvature(motion, self.config.wheelbase_m), self.config.wheelbase_m
            lines_m = ends_m(regions[0].way.lines_m, curvature, wheelbase_m)
            result = replace(
                result, view=_view(camera, masks, usable, regions[: len(result.groups)], lines_m)
            )
        return state, result

    def look(
        self,
        state: IfeState,
        image: NDArray[np.uint8],
        motion: Motion,
        camera: Camera,
        masks: RoadMasks,
        usable: NDArray[np.bool_],
        lines: Lines | None = None,
    ) -> list[Region]:
        """Corners and patches in a picture of this camera's size.

        One region for each group that has a verdict, and a last one of the middle group's range where a look at it is
        to be remembered. `lines` are those of this picture, where several estimators share it.
        """
        groups, ahead = self.config.groups_looked_at, self._remembers(state, motion)
        tracks = self._tracks(motion, max(groups, 1 + ahead)) if self.config.use_trajectory else []
        way = Way(tuple(tracks), *(self.lines(state, image, motion, camera) if lines is None else lines))
        drivable = masks.drivable > MASK_THRESHOLD
        regions = [
            self._region(index, state.frame_count, way, camera, drivable, usable) for index in range(groups)
        ]
        if ahead:
            regions.append(self._lane_ahead(state.frame_count, motion, way, camera, drivable, usable))
        return [region.seen_in(image) for region in regions]

    def judge(self, state: IfeState, motion: Motion, regions: list[Region]) -> tuple[IfeState, FrameResult]:
        """The state and the result after a frame, from the classified regions of `look`."""
        looks, passed = self._remembered(state, motion, regions[-1])
        verdicts = [
            self._fuse(
                0, state.evidence[0], regions[0], self._along_the_road(regions[0], looks, passed, motion)
            )
        ]
        for index in range(1, self.config.groups_looked_at):
            own = regions[index]
            heard = own.heard(own.ahead_m, own.probabilities, np.ones(len(own.ahead_m), np.bool_))
            verdicts.append(self._fuse(index, state.evidence[index], own, heard))
        after = (*(weights for weights, _ in verdicts), *state.evidence[len(verdicts) :])
        result = FrameResult(tuple(verdict for _, verdict in verdicts), state.frame_count)
        lines_m = regions[0].way.lines_from(motion.way_m)
        return IfeState(after, state.frame_count + 1, looks, lines_m, passed), result

    def _remembers(self, state: IfeState, motion: Motion) -> bool:
        """Whether patches of the lane ahead are remembered from this frame."""
        return self.config.use_foresight and motion.way_m is not None and due(state.looks, motion.way_m)

    def _remembered(
        self, state: IfeState, motion: Motion, last: Region
    ) -> tuple[tuple[Look, ...], Passed | None]:
        """The looks that still count, with that of this frame (`last`) if it is remembered; the road passed."""
        at_m = motion.way_m
        if at_m is None or not self.config.use_foresight:
            return (), None
        looks = state.looks
        if self._remembers(state, motion):
            looks = (*looks, Look.of(at_m, last.ahead_m, last.probabilities))
        passed = road_passed(
            state.passed, state.looks, state.lines_m, at_m, self._reach_m[0], self.config.ranges_m[0][0]
        )
        return within_reach(looks, at_m, self._reach_m), passed

    @property
    def _reach_m(self) -> tuple[float, float]:
        """Range in which remembered patches count [m]."""
        return self.config.ranges_m[0][0] - BEHIND_M, self.config.ranges_m[1][1]

    def _along_the_road(
        self, near: Region, looks: tuple[Look, ...], passed: Passed | None, motion: Motion
    ) -> Heard:
        """The near group's patches, and what was seen before of its ground, each among its neighbours on the road."""
        at_m = motion.way_m or 0.0
        passed = None if passed is None else passed.seen_from(at_m)
        ahead_m, before = recalled(looks, at_m, self._reach_m)
        places_m = np.concatenate((near.ahead_m, ahead_m))
        probabilities = np.concatenate((near.probabilities, before))
        if looks or passed is not None:
            lines_m = near.way.lines_m
            probabilities = among_neighbours(places_m, probabilities, lines_m, passed, len(before))
        low, high = self.config.ranges_m[0]
        inside = (low <= places_m) & (places_m < high)
        inside[: len(near.ahead_m)] = True
        return near.heard(places_m, probabilities, inside)

    def _region(
        self,
        index: int,
        frame: int,
        way: Way,
        camera: Camera,
        drivable: NDArray[np.bool_],
        usable: NDArray[np.bool_],
    ) -> Region:
        config, count = self.config, self.config.b[index]
        low, high = config.ranges_m[index]
        ellipses = tuple(track.within(low, high) for track in way.tracks)
        if config.use_trajectory:
            corners = classify_corners(corners_in_ellipses(ellipses, config.a_m), camera, usable)
        else:
            ground = _strip(low, high, config.strip_half_width_m, config.a_m)
            # Without ellipses the group is the drivable road: what lies beside it is no loss of usable area.
            road = classify_corners(ground, camera, drivable)
            corners = classify_corners(road.ground_m[road.usable], camera, usable)
        drawn = sample(corners, TRIES * count, self._key(frame, index))
        return Region.around(corners, drawn, self._widths_m(count, drawn), way, ellipses, camera, drivable)

    def _lane_ahead(
        self,
        frame: int,
        motion: Motion,
        way: Way,
        camera: Camera,
        drivable: NDArray[np.bool_],
        usable: NDArray[np.bool_],
    ) -> Region:
        """What is to be remembered: patches all across the lane, or across a wheel's side of it.

        Those of the wheels' tracks alone overlap, share their gloss and hence their mistakes.
        """
        config = self.config
        inner_m = config.roi_width_m / 2.0
        across_m = {
            "left": (inner_m, LANE_HALF_WIDTH_M),
            "right": (-LANE_HALF_WIDTH_M, -inner_m),
            "both": (-LANE_HALF_WIDTH_M, LANE_HALF_WIDTH_M),
        }[config.side]
        curvature = path_curvature(motion, config.wheelbase_m)
        ground = corners_in_lane(config.ranges_m[1], across_m, curvature, config.wheelbase_m)
        corners = classify_corners(ground, camera, usable)
        drawn = sample_across(corners, PATCHES_AHEAD, self._key(frame, len(GROUP_NAMES)))
        return Region.around(corners, drawn, self._widths_m(PATCHES_AHEAD, drawn), way, (), camera, drivable)

    def _key(self, frame: int, draw: int) -> tuple[int, ...]:
        return self.config.seed, frame, draw, list(SIDES).index(self.config.side)

    def _widths_m(self, count: int, drawn: NDArray[np.intp]) -> NDArray[np.float64]:
        config, count = self.config, min(count, len(drawn))
        return config.roi_width_m * config.roi_spread ** np.linspace(-1.0, 1.0, count)

    def lines(self, state: IfeState, image: NDArray[np.uint8], motion: Motion, camera: Camera) -> Lines:
        """The lines across the road up to the middle group's end, seen now or passed since; and doubtful ones.

        They are the same whichever wheels are looked at. A line is one of the road where it was seen before at the same
        place: the rear of a car ahead is not.
        """
        config = self.config
        if not config.use_lines or motion.way_m is None:
            return np.empty(0), np.empty(0)
        known_m = np.array(state.lines_m) - motion.way_m
        near_m, end_m = config.ranges_m[0][0], config.ranges_m[1][1]
        curvature = path_curvature(motion, config.wheelbase_m)
        searched_m = (max(near_m - BEFORE_NEAR_M, 0.0), end_m)
        seen_m = lines_across(image, camera, searched_m, curvature, config.wheelbase_m, known_m)
        same = np.abs(seen_m[:, None] - known_m) <= KNOWN_WITHIN_M
        again = same.any(axis=1)
        hidden_m = known_m[~same.any(axis=0) & (known_m >= self._reach_m[0]) & (known_m < near_m + HIDDEN_M)]
        return np.sort(np.append(hidden_m, seen_m[again])), seen_m[~again]

    def _tracks(self, motion: Motion, groups: int) -> list[Ellipses]:
        config = self.config
        return [
            reckon(
                motion,
                wheelbase_m=config.wheelbase_m,
                lateral_m=sign * config.track_m / 2.0,
                horizon_m=max(high for _, high in config.ranges_m[:groups]),
                step_m=config.step_m,
                k1=config.k1,
                k2=config.k2,
                start_deviation_m=config.start_deviation_m,
            )
            for sign in SIDES[config.side]
        ]

    def classify(self, regions: list[Region], masks: RoadMasks) -> list[Region]:
        """The regions with what their readable patches show, all in one run of the network; others are left out.

        `masks` are those of the picture that they were cut from.
        """
        patches = [patch for region in regions for patch in region.patches]
        if not patches:
            return regions
        temperature = self._classifier.temperature if self.config.calibrate else 1.0
        verdicts = self._classifier.verdicts(np.stack(patches))
        logits = verdicts.logits / temperature
        if self.config.use_scene:
            logits = logits + PICTURE_SAY * masks.surface
        probabilities = calibrated_probabilities(logits, 1.0)
        readable = verdicts.readable >= LEAST_READABLE
        ends = np.cumsum([len(region.patches) for region in regions])[:-1]
        return [
            replace(region.keeping(kept), probabilities=own[kept])
            for region, kept, own in zip(
                regions, np.split(readable, ends), np.split(probabilities, ends), strict=True
            )
        ]

    def _fuse(
        self, index: int, before: EvidenceState, region: Region, heard: Heard
    ) -> tuple[EvidenceState, GroupResult]:
        """Evidence weights and verdict of one group, Eqs. (7) to (10).

        Patches that were seen before count in the weights and the mass, but Eq. (7) combines no more bodies
        of evidence for them: they show the same road again. Where a line parts the group its ground decides, not the
        weights, which know the surface up to the line.
        """
        config, corners, n_roi = self.config, region.corners, len(region.probabilities)
        if n_roi > 1:
            after = update_weights(before, heard.probabilities.argmax(axis=1), config.weight_law)
            weighted = config.weight_evidence and not heard.parted
            weights = after.weights if weighted else EvidenceState().weights
            mass = basic_probability(heard.probabilities, weights, heard.say)
            m_0, fused = float(mass.max()), combine(mass, n_roi)
        else:
            m_0 = 0.0
            after, fused = before, np.array(before.weights)
        surface = Surface(int(fused.argmax()))
        Q_v = visual_confidence(region.p_util, float(fused[surface]))
        dry, wet, snow_ice = fused.tolist()
        return after, GroupResult(
            name=GROUP_NAMES[index],
            range_m=config.ranges_m[index],
            surface=surface,
            probabilities=(dry, wet, snow_ice),
            P_fusion=float(fused[surface]),
            p_util=region.p_util,
            Q_v=Q_v,
            m_0=m_0,
            flag=Q_v > config.flag_threshold and m_0 >= config.least_mass and n_roi > 1,
            n_roi=n_roi,
            n_ell=corners.n_ell,
            n_rs=corners.n_rs,
        )


def fit_camera(camera: Camera, image: NDArray[np.uint8]) -> Camera:
    """The camera at the picture's size; raises ImageError if the picture is not of the camera's shape."""
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise ImageError(
            f"Picture of shape {image.shape} and type {image.dtype}: expected (height, width, 3) of uint8."
        )
    height, width = image.shape[:2]
    factor = width / camera.width_px
    if abs(camera.height_px * factor - height) > 1.0:
        raise ImageError(
            f"Picture of {width} x {height} pixels: the camera file says {camera.width_px} x "
            f"{camera.height_px}. Expected that size, or the same shape at another scale: do not crop, or "
            "correct the camera file."
        )
    return camera if factor == 1.0 else _scaled(camera, factor)


def usable_road(masks: RoadMasks, remove_shadow: bool) -> NDArray[np.bool_]:
    """Drivable road out of the shadow, at the masks' resolution."""
    drivable = masks.drivable > MASK_THRESHOLD
    return drivable & ~(masks.shadow > MASK_THRESHOLD) if remove_shadow else drivable


_scaled = lru_cache(maxsize=8)(Camera.scaled)
_strip = lru_cache(maxsize=8)(corners_in_strip)


def _view(
    camera: Camera,
    masks: RoadMasks,
    usable: NDArray[np.bool_],
    regions: list[Region],
    lines_m: NDArray[np.float64],
) -> FrameView:
    groups = []
    for region in regions:
        outlines = [ellipses.outlines_m() for ellipses in region.ellipses]
        stacked = np.concatenate(outlines) if outlines else np.empty((0, 32, 2))
        groups.append(
            GroupView(
                camera.ground_to_image(stacked.reshape(-1, 2)).reshape(stacked.shape),
                region.boxes,
                region.probabilities,
            )
        )
    lines_px = camera.ground_to_image(lines_m.reshape(-1, 2)).reshape(lines_m.shape)
    return FrameView(masks, usable, tuple(groups), lines_px)
