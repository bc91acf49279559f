"""The pinhole camera over a flat road: ground plane to image and back, Eqs. (5) and (6).

Vehicle frame (ISO 8855): x forward, y left, z up, origin on the road below the centre of the front axle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

NEAREST_DEPTH_M = 0.05
"""Points closer to the image plane than this, or behind it, have no picture [m]."""

_UNDISTORT_STOP = (cv2.TERM_CRITERIA_MAX_ITER + cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""OpenCV's own five steps leave an error of up to a pixel in the corners of a wide lens."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics and mounting of one camera; the fields are those of camera.yaml.

    Pitch is positive nose down, yaw positive to the left, roll positive right side down.
    """

    width_px: int = 1920
    height_px: int = 1200
    fx_px: float = 1650.0
    fy_px: float = 1650.0
    cx_px: float = 960.0
    cy_px: float = 600.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    height_m: float = 1.4
    x_from_front_axle_m: float = -0.4
    y_m: float = 0.0
    pitch_rad: float = 0.10
    yaw_rad: float = 0.0
    roll_rad: float = 0.0
    fps: float = 40.0

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """Intrinsic matrix T_ci of Eq. (5), shape (3, 3) [px]."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """Rotation from vehicle axes to camera axes (x right, y down, z ahead), shape (3, 3)."""
        axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
        cy, sy = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        cp, sp = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
        cr, sr = np.cos(self.roll_rad), np.sin(self.roll_rad)
        yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        return axes @ (yaw @ pitch @ roll).T

    @cached_property
    def position_m(self) -> NDArray[np.float64]:
        """Optical centre in vehicle axes, shape (3,) [m]."""
        return np.array([self.x_from_front_axle_m, self.y_m, self.height_m])

    @cached_property
    def ground_homography(self) -> NDArray[np.float64]:
        """H_cv of Eq. (6): ground (x, y, 1) to undistorted image (u, v, 1), shape (3, 3)."""
        columns = np.column_stack((self.rotation[:, :2], -self.rotation @ self.position_m))
        return self.matrix @ columns

    @cached_property
    def widest_radius(self) -> float:
        """Distance from the optical axis, over depth, up to which the radial distortion rises [-].

        Beyond it the distortion polynomial folds back, and road far outside the field of view would appear
        inside the picture.
        """
        k1, k2, _, _, k3 = self.distortion
        roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
        turning = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
        return float(np.sqrt(turning.min())) if len(turning) else np.inf

    def ground_to_image(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels of ground points, NaN where a point is not ahead of the lens or beyond `widest_radius`.

        Parameters
        ----------
        points_m : array, shape (n, 2)
            x and y on the road in vehicle axes [m].

        Returns
        -------
        array, shape (n, 2)
            Column and row [px]; points outside the picture keep their extrapolated pixel.
        """
        points = np.column_stack((points_m, np.zeros(len(points_m))))
        camera_points = (points - self.position_m) @ self.rotation.T
        ahead = camera_points[:, 2] > NEAREST_DEPTH_M
        depth = np.where(ahead, camera_points[:, 2], 1.0)
        ahead &= np.hypot(camera_points[:, 0], camera_points[:, 1]) / depth < self.widest_radius
        pixels = np.full((len(points), 2), np.nan)
        if ahead.any():
            projected, _ = cv2.projectPoints(
                camera_points[ahead], np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion)
            )
            pixels[ahead] = projected.reshape(-1, 2)
        return pixels

    def image_to_ground(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ground points seen at pixels, NaN at and above the horizon and beyond `widest_radius`.

        Parameters
        ----------
        pixels : array, shape (n, 2)
            Column and row [px].

        Returns
        -------
        array, shape (n, 2)
            x and y on the road in vehicle axes [m].
        """
        rays = np.ones((len(pixels), 3))
        if len(pixels):
            undistorted = cv2.undistortPoints(
                np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2),
                self.matrix,
                np.array(self.distortion),
                criteria=_UNDISTORT_STOP,
            )
            rays[:, :2] = undistorted.reshape(-1, 2)
        directions = rays @ self.rotation
        ground = np.full((len(pixels), 2), np.nan)
        down = (directions[:, 2] < -1e-9) & (np.hypot(rays[:, 0], rays[:, 1]) < self.widest_radius)
        reach = -self.height_m / directions[down, 2]
        ground[down] = self.position_m[:2] + reach[:, None] * directions[down, :2]
        return ground

    def scaled(self, factor: float) -> Camera:
        """The same camera with its picture scaled by a factor (pixel centres at half integers)."""
        return replace(
            self,
            width_px=round(self.width_px * factor),
            height_px=round(self.height_px * factor),
            fx_px=self.fx_px * factor,
            fy_px=self.fy_px * factor,
            cx_px=(self.cx_px + 0.5) * factor - 0.5,
            cy_px=(self.cy_px + 0.5) * factor - 0.5,
        )
