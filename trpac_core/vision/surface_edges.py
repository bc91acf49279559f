"""Lines across the road: a surface often ends at one, and no patch that lies on it shows a single surface.

Brightness or tint steps over the whole width of the car at one place, while grain, puddles and tyre tracks step here
and there, up and down. Wet road may be as bright as dry road, and still has something of the sky's colour. A line is no
change of class yet: shade ends so, and the slabs of a bridge.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .roi_sampling import project
from .trajectory import wheel_track

SAMPLE_M = 0.025
"""Way between the rows that are read [m]."""
HALF_WIDTH_M, BANDS, COLUMNS_OF_BAND = 1.2, 12, 4
"""Road to each side of the car's middle that is read [m], in bands along the road, each the mean of some columns."""
SIDE_M = 0.15
"""Road before and behind a place that are compared [m]."""
SLANTS = (-0.08, -0.04, 0.0, 0.04, 0.08)
"""Angles at which a line may lie across the path [rad]."""
DARK = 8.0
"""Grey levels added before the logarithm, so that noise in the dark does not count as a step [8-bit levels]."""
NOISE, TINT_NOISE = 0.01, 0.004
"""Scatter of a step between bands that is never undercut, of brightness and of tint, which scatters less [-]."""
LEAST_PLAINNESS = 4.0
"""Least step of a line, in standard errors over the bands [-]."""
KNOWN_PLAINNESS, KNOWN_WITHIN_M = 2.0, 0.15
"""That of a line so close to where one was seen before [-], [m]."""
APART_M = 0.3
"""Of steps within this distance the largest is the line [m]."""


def lines_across(
    image: NDArray[np.uint8],
    camera: Camera,
    reach_m: tuple[float, float],
    curvature_1_m: float,
    wheelbase_m: float,
    known_m: NDArray[np.float64] | Sequence[float] = (),
) -> NDArray[np.float64]:
    """Distances ahead at which lines cross the path of the car, in ascending order.

    Parameters
    ----------
    image : array of uint8, shape (height, width, 3)
        The picture, BGR.
    camera : Camera
        Of the picture's own size.
    reach_m : pair of floats
        Stretch of the path that is searched [m].
    curvature_1_m, wheelbase_m : float
        Of the path, see `wheel_track` [1/m], [m].
    known_m : array, shape (m,)
        Where lines are expected that were seen before [m].

    Returns
    -------
    array, shape (n,)
        Way of the rear axle at which the front one is on the line [m].
    """
    first, end = np.ceil(np.array(reach_m) / SAMPLE_M).astype(int)
    ways_m = SAMPLE_M * np.arange(first - _rows(SIDE_M), end + _rows(SIDE_M))
    bright, tint = _bands(image, camera, ways_m, curvature_1_m, wheelbase_m)
    plain = np.maximum(plainness(bright, NOISE), plainness(tint, TINT_NOISE))
    highest = cv2.dilate(plain[:, None], np.ones((2 * _rows(APART_M) + 1, 1), np.uint8))[:, 0]
    least = np.full(len(ways_m), LEAST_PLAINNESS)
    for known in known_m:
        least[np.abs(ways_m - known) <= KNOWN_WITHIN_M] = KNOWN_PLAINNESS
    found_m = ways_m[(plain >= least) & (plain >= highest)]
    return found_m[(reach_m[0] <= found_m) & (found_m < reach_m[1])]


def plainness(logarithm: NDArray[np.float64], noise: float) -> NDArray[np.float64]:
    """Size of the step at each row, at the slant with the largest one [standard errors].

    Parameters
    ----------
    logarithm : array, shape (rows, bands)
        Of the brightness or the tint, rows in the order of the path, `SAMPLE_M` apart [-].
    noise : float
        Standard error that is never undercut [-].

    Returns
    -------
    array, shape (rows,)
        0 where the rows end.
    """
    side = _rows(SIDE_M)
    rows, bands = logarithm.shape
    aside = (np.arange(bands) - (bands - 1) / 2.0) * (2.0 * HALF_WIDTH_M / bands / SAMPLE_M)
    inner = np.arange(side, rows - side)[:, None]
    plainest = np.zeros(rows)
    summed = np.vstack((np.zeros((1, bands)), np.cumsum(logarithm, axis=0)))
    column = np.arange(bands)
    for slant in SLANTS:
        at = np.clip(inner + np.round(slant * aside).astype(int), side, rows - side)
        steps = (summed[at + side, column] - 2.0 * summed[at, column] + summed[at - side, column]) / side
        error = steps.std(axis=1) / np.sqrt(bands) + noise
        plainest[inner[:, 0]] = np.maximum(plainest[inner[:, 0]], np.abs(steps.mean(axis=1)) / error)
    return plainest


def ends_m(lines_m: NDArray[np.float64], curvature_1_m: float, wheelbase_m: float) -> NDArray[np.float64]:
    """Ground points at which lines end to the left and to the right of what is read of them, shape (n, 2, 2) [m]."""
    sides = (wheel_track(lines_m, curvature_1_m, wheelbase_m, y) for y in (HALF_WIDTH_M, -HALF_WIDTH_M))
    return np.stack(tuple(sides), axis=1)


def _bands(
    image: NDArray[np.uint8],
    camera: Camera,
    ways_m: NDArray[np.float64],
    curvature_1_m: float,
    wheelbase_m: float,
) -> list[NDArray[np.float64]]:
    """Logarithms of the road's brightness, and of its blue over its red, along the way, shape (n, BANDS) each [-]."""
    columns = BANDS * COLUMNS_OF_BAND
    aside_m = ((np.arange(columns) + 0.5) / columns * 2.0 - 1.0) * HALF_WIDTH_M
    middle_m, left_m = (wheel_track(ways_m, curvature_1_m, wheelbase_m, y)[:, None] for y in (0.0, 1.0))
    ground_m = middle_m + aside_m[:, None] * (left_m - middle_m)
    pixels = project(ground_m.reshape(-1, 2), camera).reshape(len(ways_m), columns, 2).astype(np.float32)
    road = cv2.remap(image, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    blue, red = (np.log(road[..., channel] + np.float32(DARK)) for channel in (0, 2))
    bright = np.log(road.mean(axis=2, dtype=np.float32) + np.float32(DARK))
    bands = (len(ways_m), BANDS, COLUMNS_OF_BAND)
    return [read.reshape(bands).mean(axis=2, dtype=np.float64) for read in (bright, blue - red)]


def _rows(way_m: float) -> int:
    return round(way_m / SAMPLE_M)
