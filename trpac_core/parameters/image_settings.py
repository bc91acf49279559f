"""Parameters of the camera side: lens and mounting, and the image estimator's settings."""

from __future__ import annotations

from trpac_core.parameters.estimator_parameter import parameter
from trpac_core.vision.ife_config import (
    FARTHEST_CENTRE,
    LEAST_GRID_M,
    LEAST_STEP_M,
    MOST_DEVIATION_M,
    MOST_GROWTH_M_S,
    MOST_PATCHES,
    MOST_WAY_M,
    MOST_WIDTH_M,
    STEEPEST_SIGMOID,
)

CAMERA_PARAMETERS = (
    parameter("camera.width", "", "vision.camera.width_px", "Width of the picture in pixels", 64),
    parameter("camera.height", "", "vision.camera.height_px", "Height of the picture in pixels", 64),
    parameter("camera.fx", "px", "vision.camera.fx_px", "Focal length, horizontal", 1.0),
    parameter("camera.fy", "px", "vision.camera.fy_px", "Focal length, vertical", 1.0),
    parameter("camera.cx", "px", "vision.camera.cx_px", "Principal point, horizontal"),
    parameter("camera.cy", "px", "vision.camera.cy_px", "Principal point, vertical"),
    *(
        parameter(f"camera.{term}", "1", f"vision.camera.distortion.{index}", f"Lens distortion {term}")
        for index, term in enumerate(("k1", "k2", "p1", "p2", "k3"))
    ),
    parameter("camera.height_above_road", "m", "vision.camera.height_m", "Height above the road", 0.01),
    parameter(
        "camera.x_from_front_axle",
        "m",
        "vision.camera.x_from_front_axle_m",
        "Position from the front axle, positive forward",
    ),
    parameter("camera.y", "m", "vision.camera.y_m", "Lateral position, positive to the left"),
    parameter("camera.pitch", "rad", "vision.camera.pitch_rad", "Pitch, positive nose down", -1.5, 1.5),
    parameter("camera.yaw", "rad", "vision.camera.yaw_rad", "Yaw, positive to the left", -1.5, 1.5),
    parameter("camera.roll", "rad", "vision.camera.roll_rad", "Roll, positive right side down", -1.5, 1.5),
    parameter("camera.fps", "1/s", "vision.camera.fps", "Pictures per second", 0.01),
)

_GROUPS = ("near", "middle", "far")

IMAGE_PARAMETERS = (
    parameter(
        "image.flag_threshold",
        "1",
        "vision.flag_threshold",
        "Confidence Q_v above which the flag can be set",
        0.0,
        1.0,
    ),
    parameter(
        "image.least_mass",
        "1",
        "vision.least_mass",
        "Smallest evidence mass m_0 of the class for which the flag can be set",
        0.0,
        1.0,
    ),
    *(
        parameter(
            f"image.{group}_{end}",
            "m",
            f"vision.ranges_m.{number}.{index}",
            f"Distance ahead at which the {group} group of patches {verb}",
            0.0,
            MOST_WAY_M,
        )
        for number, group in enumerate(_GROUPS)
        for index, (end, verb) in enumerate((("from", "starts"), ("to", "ends")))
    ),
    *(
        parameter(
            f"image.patches_{group}",
            "",
            f"vision.b.{number}",
            f"Number of patches of the {group} group",
            2,
            MOST_PATCHES,
        )
        for number, group in enumerate(_GROUPS)
    ),
    parameter("image.grid", "m", "vision.a_m", "Grid size a", LEAST_GRID_M),
    parameter(
        "image.roi_width",
        "m",
        "vision.roi_width_m",
        "Geometric mean of the width of road that a patch shows",
        0.05,
        MOST_WIDTH_M,
    ),
    parameter(
        "image.roi_spread",
        "1",
        "vision.roi_spread",
        "Widest patch of a group divided by the mean width, and mean width divided by the narrowest",
        1.0,
    ),
    parameter(
        "image.track_step",
        "m",
        "vision.step_m",
        "Distance between two uncertainty ellipses of the predicted wheel track",
        LEAST_STEP_M,
    ),
    parameter(
        "image.k1",
        "m/s",
        "vision.k1",
        "Growth of the longitudinal uncertainty of the wheel track; less than image.k2",
        1e-12,
    ),
    parameter(
        "image.k2",
        "m/s",
        "vision.k2",
        "Growth of the lateral uncertainty of the wheel track",
        1e-12,
        MOST_GROWTH_M_S,
    ),
    parameter(
        "image.start_deviation",
        "m",
        "vision.start_deviation_m",
        "Standard deviation of the wheel's position at the start of the track",
        1e-3,
        MOST_DEVIATION_M,
    ),
    parameter(
        "image.sigma", "1", "vision.weight_law.sigma", "Relaxation factor of the evidence weights", 0.0, 1.0
    ),
    parameter(
        "image.sigmoid_centre",
        "1",
        "vision.weight_law.sigmoid_centre",
        "Centre of the sigmoid of the evidence weights",
        -FARTHEST_CENTRE,
        FARTHEST_CENTRE,
    ),
    parameter(
        "image.sigmoid_slope",
        "1",
        "vision.weight_law.sigmoid_slope",
        "Slope of the sigmoid of the evidence weights",
        0.0,
        STEEPEST_SIGMOID,
    ),
    parameter("image.seed", "", "vision.seed", "Seed of the random choice of patches", 0),
)
