"""Choice of the patches of road: corners in the ellipses, shadow removal, sampling (Figure 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .trajectory import CHI_SQUARE_95_2DOF, Ellipses, wheel_track

PATCH_WIDTH_PX = 96
PATCH_HEIGHT_PX = 64
LEAST_ROI_WIDTH_PX = 48
"""Narrower regions hold too little texture; they are widened to this [px]."""

ROI_ASPECT = PATCH_WIDTH_PX / PATCH_HEIGHT_PX
MOST_ASPECT = 3.0
"""Width over height up to which the network has learned from regions [-]."""
TRIES = 6
"""Corners that are drawn for each patch, of which one is taken [-]."""
LEAST_ROAD = 0.7
"""Share of drivable road from which on a region is as good as any [-]: the least from which the network has learned."""
LANE_HALF_WIDTH_M = 2.0
"""Road on either side of the car's middle that is looked at farther ahead: its lane, of usual width [m]."""
_LANE_GRID_M = 0.1
_PROBE_M = 0.1


@dataclass(frozen=True)
class Corners:
    """The grid corners of one group that lie in the picture.

    Attributes
    ----------
    ground_m, pixel : array, shape (n, 2)
        Place on the road [m] and in the picture [px].
    usable : array of bool, shape (n,)
        On drivable road, out of the shadow.
    """

    ground_m: NDArray[np.float64]
    pixel: NDArray[np.float64]
    usable: NDArray[np.bool_]

    @property
    def n_ell(self) -> int:
        """Number of corners of the group that the picture shows."""
        return len(self.usable)

    @property
    def n_rs(self) -> int:
        """Number of unusable corners of the group: shadowed, or not drivable."""
        return self.n_ell - int(np.count_nonzero(self.usable))

    @property
    def p_util(self) -> float:
        """Share of the group that can be used, 1 - n_rs / n_ell [-]; 0 if the picture shows none of it."""
        return 1.0 - self.n_rs / self.n_ell if self.n_ell else 0.0


def corners_in_ellipses(groups: Sequence[Ellipses], grid_m: float) -> NDArray[np.float64]:
    """Corners of a ground grid inside any of the ellipses, each once.

    Parameters
    ----------
    groups : sequence of Ellipses
        Ellipses of one range, of one wheel or of both.
    grid_m : float
        Grid size a [m]; the grid is anchored at the origin.

    Returns
    -------
    array, shape (n, 2)
        x and y, ordered along x [m].
    """
    centres = np.concatenate([group.centre_m for group in groups])
    covariances = np.concatenate([group.covariance_m2 for group in groups])
    if not len(centres):
        return np.empty((0, 2))
    reach = np.sqrt(CHI_SQUARE_95_2DOF * np.stack((covariances[:, 0, 0], covariances[:, 1, 1]), axis=1))
    first = np.ceil((centres - reach) / grid_m).astype(np.int64)
    last = np.floor((centres + reach) / grid_m).astype(np.int64)
    origin = first.min(axis=0)
    inside = np.zeros(last.max(axis=0) - origin + 1, dtype=np.bool_)
    for centre, inverse, low, high in zip(centres, np.linalg.inv(covariances), first, last, strict=True):
        dx = np.arange(low[0], high[0] + 1)[:, None] * grid_m - centre[0]
        dy = np.arange(low[1], high[1] + 1)[None, :] * grid_m - centre[1]
        squared = inverse[0, 0] * dx * dx + 2.0 * inverse[0, 1] * dx * dy + inverse[1, 1] * dy * dy
        window = np.s_[
            low[0] - origin[0] : high[0] - origin[0] + 1, low[1] - origin[1] : high[1] - origin[1] + 1
        ]
        inside[window] |= squared <= CHI_SQUARE_95_2DOF
    return (np.argwhere(inside) + origin) * grid_m


def corners_in_strip(from_m: float, to_m: float, half_width_m: float, grid_m: float) -> NDArray[np.float64]:
    """Corners of a ground grid across the whole road ahead, shape (n, 2) [m]: without a trajectory."""
    x = np.arange(np.ceil(from_m / grid_m), np.ceil(to_m / grid_m)) * grid_m
    y = np.arange(-np.floor(half_width_m / grid_m), np.floor(half_width_m / grid_m) + 1) * grid_m
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def corners_in_lane(
    range_m: tuple[float, float],
    across_m: tuple[float, float],
    curvature_1_m: float,
    wheelbase_m: float,
) -> NDArray[np.float64]:
    """Corners of a grid along the path of the car, ordered across it: the lane ahead, or a side of it.

    Parameters
    ----------
    range_m : pair
        Way of the rear axle from and up to which it lies [m].
    across_m : pair
        Its ends to the left of the car's middle [m].
    curvature_1_m : float
        Curvature of the rear axle's path [1/m].
    wheelbase_m : float
        [m]

    Returns
    -------
    array, shape (n, 2)
        x and y, from the right to the left [m].
    """
    way_m, offsets_m = (
        np.arange(round(low / _LANE_GRID_M), round(high / _LANE_GRID_M), dtype=np.float64) * _LANE_GRID_M
        for low, high in (range_m, across_m)
    )
    middle, beside = (wheel_track(way_m, curvature_1_m, wheelbase_m, lateral_m) for lateral_m in (0.0, 1.0))
    return (middle + offsets_m[:, None, None] * (beside - middle)).reshape(-1, 2)


def project(points_m: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Pixels of ground points, shape (n, 2), by H_cv of Eq. (6) where the lens does not distort."""
    if any(camera.distortion):
        return camera.ground_to_image(points_m)
    H = camera.ground_homography
    columns, rows, depth = H[:, :2] @ points_m.T + H[:, 2:]
    depth = np.where(depth > 0.0, depth, np.nan)
    return np.column_stack((columns / depth, rows / depth))


def look_up(
    mask: NDArray[np.bool_], pixels: NDArray[np.float64], width_px: int, height_px: int
) -> NDArray[np.bool_]:
    """Values of a reduced mask of the whole picture at pixels that lie in the picture, shape (n,)."""
    rows, columns = mask.shape
    column = ((pixels[:, 0] + 0.5) * (columns / width_px)).astype(np.intp)
    row = ((pixels[:, 1] + 0.5) * (rows / height_px)).astype(np.intp)
    return mask[np.minimum(row, rows - 1), np.minimum(column, columns - 1)]


def classify_corners(ground_m: NDArray[np.float64], camera: Camera, usable: NDArray[np.bool_]) -> Corners:
    """Corners that the picture shows, with their use.

    Parameters
    ----------
    ground_m : array, shape (n, 2)
        Grid corners [m]; those outside the picture are not counted.
    camera : Camera
        Of the picture's own size.
    usable : array of bool
        Drivable and out of the shadow, over the whole picture at any resolution. Figure 8 counts shadowed
        corners only, since its mask is already the drivable area; what is not drivable here is counted as of
        no use too.
    """
    pixel = project(ground_m, camera)
    with np.errstate(invalid="ignore"):
        shown = (
            (pixel[:, 0] >= -0.5)
            & (pixel[:, 0] < camera.width_px - 0.5)
            & (pixel[:, 1] >= -0.5)
            & (pixel[:, 1] < camera.height_px - 0.5)
        )
    pixel = pixel[shown]
    return Corners(ground_m[shown], pixel, look_up(usable, pixel, camera.width_px, camera.height_px))


def sample(corners: Corners, b: int, key: Sequence[int]) -> NDArray[np.intp]:
    """Indices of up to b usable corners, no corner twice, repeatable by key; none if not two are left."""
    candidates = np.flatnonzero(corners.usable)
    if len(candidates) <= 1:
        return np.empty(0, dtype=np.intp)
    return np.random.default_rng(list(key)).choice(candidates, min(b, len(candidates)), replace=False)


def sample_across(corners: Corners, b: int, key: Sequence[int]) -> NDArray[np.intp]:
    """Indices of usable corners for b patches, each from its own share of the ground across the path.

    `TRIES` rounds, in each of which every patch has one; corners are ordered across the path. As `sample` where there
    are too few.
    """
    candidates = np.flatnonzero(corners.usable)
    if len(candidates) < TRIES * b:
        return sample(corners, TRIES * b, key)
    rng = np.random.default_rng(list(key))
    shares = [rng.choice(share, TRIES, replace=False) for share in np.array_split(candidates, b)]
    return np.stack(shares, axis=1).ravel()


def roi_widths_px(
    camera: Camera, ground_m: NDArray[np.float64], roi_width_m: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Widths of the regions around ground points, shape (n,) [px]: see `roi_width_px`."""
    step = np.array([0.0, _PROBE_M / 2.0])
    left, right = camera.ground_to_image(ground_m + step), camera.ground_to_image(ground_m - step)
    return np.fmax(np.hypot(*(right - left).T) * (roi_width_m / _PROBE_M), LEAST_ROI_WIDTH_PX)


def roi_width_px(
    camera: Camera, ground_point_m: NDArray[np.float64] | Sequence[float], roi_width_m: float
) -> float:
    """Width in the picture of a stretch across the road at a ground point.

    Parameters
    ----------
    camera : Camera
        Of the picture's own size.
    ground_point_m : array, shape (2,)
        x and y in vehicle axes [m].
    roi_width_m : float
        Width on the road [m].

    Returns
    -------
    float
        Width, at least `LEAST_ROI_WIDTH_PX`, also where the point has no picture [px].
    """
    point = np.asarray(ground_point_m, dtype=np.float64).reshape(1, 2)
    return float(roi_widths_px(camera, point, roi_width_m)[0])


def roi_box(
    picture_width_px: int,
    picture_height_px: int,
    centre_px: Sequence[float] | NDArray[np.float64],
    width_px: float,
) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of a 3:2 region around a pixel, shifted to lie inside the picture [px]."""
    width = max(float(width_px), float(LEAST_ROI_WIDTH_PX))
    width = min(width, picture_width_px, picture_height_px * ROI_ASPECT)
    columns, rows = round(width), min(round(width / ROI_ASPECT), picture_height_px)
    left = round(float(centre_px[0]) + 0.5 - columns / 2.0)
    top = round(float(centre_px[1]) + 0.5 - rows / 2.0)
    left = min(max(left, 0), picture_width_px - columns)
    top = min(max(top, 0), picture_height_px - rows)
    return left, top, left + columns, top + rows


def roi_boxes(
    camera: Camera,
    centres_px: NDArray[np.float64],
    widths_px: NDArray[np.float64],
    rows_px: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Regions around pixels, none of them across the rows at which its road ends.

    Parameters
    ----------
    camera : Camera
        Of the picture's own size.
    centres_px : array, shape (n, 2)
        Columns and rows [px].
    widths_px : array, shape (n,)
        Widths: see `roi_widths_px` [px].
    rows_px : array, shape (n, 2)
        Rows between which each region's road lies, from above [px]. A region is shifted to lie between them, and made
        lower, and narrower in the end, where they leave no room; where they leave too little, it lies across.

    Returns
    -------
    array, shape (n, 4)
        Left, top, right, bottom [px].
    """
    boxes = [
        _between(roi_box(camera.width_px, camera.height_px, centre, width), camera.height_px, *ends)
        for centre, width, ends in zip(centres_px, widths_px, rows_px, strict=True)
    ]
    return np.array(boxes, np.int64).reshape(-1, 4)


def _between(
    box: tuple[int, int, int, int], picture_height_px: int, upper_px: float, lower_px: float
) -> tuple[int, int, int, int]:
    left, top, right, bottom = box
    first, end = int(np.ceil(max(upper_px, 0.0))), int(np.floor(min(lower_px, picture_height_px)))
    rows = min(bottom - top, end - first)
    columns = min(right - left, round(MOST_ASPECT * rows))
    if columns < LEAST_ROI_WIDTH_PX:
        return box
    top, left = min(max(top, first), end - rows), left + (right - left - columns) // 2
    return left, top, left + columns, top + rows


def road_shares(
    boxes: NDArray[np.int64], mask: NDArray[np.bool_], width_px: int, height_px: int
) -> NDArray[np.float64]:
    """Share of each box of the picture that a reduced mask of the whole picture holds, shape (n,) [-]."""
    counts = cv2.integral(mask.astype(np.uint8))
    size, whole = np.array(mask.shape[::-1]), np.array((width_px, height_px))
    (left, top), (right, bottom) = (boxes[:, :2] * size // whole).T, (-(-boxes[:, 2:] * size // whole)).T
    road = counts[bottom, right] - counts[top, right] - counts[bottom, left] + counts[top, left]
    return np.asarray(road / ((right - left) * (bottom - top)), np.float64)


def with_most_road(shares: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Of every `count`-th region the first with road enough, or else with most: indices, at most `count`."""
    if len(shares) <= count:
        return np.arange(len(shares))
    tries = len(shares) // count
    enough = np.minimum(shares[: tries * count], LEAST_ROAD).reshape(tries, count)
    return count * enough.argmax(axis=0) + np.arange(count)


def middle_ground_m(
    camera: Camera, ground_m: NDArray[np.float64], boxes: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Ground in the middle of regions, shape (n, 2); the point a region was laid around if that is no ground [m]."""
    middle_px = np.asarray(boxes[:, :2] + boxes[:, 2:] - 1, np.float64) / 2.0
    middle_m = camera.image_to_ground(middle_px)
    return np.where(np.isnan(middle_m), ground_m, middle_m)


def cut_patch(
    image: NDArray[np.uint8], centre_px: Sequence[float] | NDArray[np.float64], width_px: float
) -> NDArray[np.uint8]:
    """The input patch of the surface network.

    Parameters
    ----------
    image : array of uint8, shape (height, width, 3)
        The picture, BGR.
    centre_px : array, shape (2,)
        Column and row of the region's centre [px].
    width_px : float
        Width of the region [px]: see `roi_width_px`.

    Returns
    -------
    array of uint8, shape (64, 96, 3)
        The region of aspect 3:2, shifted to lie inside the picture, reduced by area averaging.
    """
    return cut_box(image, roi_box(image.shape[1], image.shape[0], centre_px, width_px))


def cut_box(image: NDArray[np.uint8], box: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """A box of a picture (left, top, right, bottom in pixels) at the surface network's size, by area averaging."""
    left, top, right, bottom = box
    size = (PATCH_WIDTH_PX, PATCH_HEIGHT_PX)
    return cv2.resize(image[top:bottom, left:right], size, interpolation=cv2.INTER_AREA).astype(
        np.uint8, copy=False
    )
