"""Parameters of the estimator's unit.

A parameter's start is the default of the estimator's own configuration, so that no number is stated twice.
"""

from __future__ import annotations

from enum import Enum

from trpac_core.dife import GREATEST_THETA, VisualTerm
from trpac_core.estimator import EstimatorConfig
from trpac_core.excitation import K_V_LIMIT
from trpac_core.vision.classes import Surface
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

from .fields import field_value
from .variables import Kind, Variable

BUFFERS_ENABLED = "image.buffers_enabled"
"""Parameter of the unit itself, not of the estimator."""

_DEFAULTS = EstimatorConfig()


def _parameter(
    name: str,
    unit: str,
    source: str,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
) -> Variable:
    start = field_value(_DEFAULTS, source)
    if isinstance(start, Enum):
        start = start.value
    if isinstance(start, bool):
        return Variable(name, Kind.BOOLEAN, "parameter", "fixed", description, start=start, source=source)
    if isinstance(start, int):
        return Variable(
            name,
            Kind.INTEGER,
            "parameter",
            "fixed",
            description,
            None,
            start,
            minimum,
            maximum,
            source=source,
        )
    if not isinstance(start, float):
        raise TypeError(f"'{source}' of the configuration is {start!r}: a parameter is a bool, int or float")
    return Variable(
        name, Kind.REAL, "parameter", "fixed", description, unit, start, minimum, maximum, source=source
    )


_VEHICLE_PARAMETERS = (
    _parameter("wheel.front", "", "front_axle", "The wheel is on the front axle"),
    _parameter(
        "wheel.left", "", "left_side", "The wheel is on the left side: whose track the camera looks at"
    ),
    _parameter("vehicle.mass", "kg", "vehicle.mass_kg", "Mass of the car", 1.0, 1e6),
    _parameter("vehicle.wheelbase", "m", "vehicle.wheelbase_m", "Wheelbase", 0.1, 100.0),
    _parameter("vehicle.track", "m", "vehicle.track_m", "Track width", 0.1, 100.0),
    _parameter(
        "vehicle.cog_height", "m", "vehicle.cog_height_m", "Height of the centre of gravity", 0.0, 100.0
    ),
    _parameter(
        "vehicle.cog_to_rear_axle",
        "m",
        "vehicle.cog_to_rear_axle_m",
        "Centre of gravity to rear axle",
        0.0,
        100.0,
    ),
    _parameter("vehicle.wheel_radius", "m", "vehicle.wheel_radius_m", "Rolling radius R", 0.01, 10.0),
    _parameter(
        "vehicle.wheel_inertia",
        "kg.m2",
        "vehicle.wheel_inertia_kg_m2",
        "Inertia I of a wheel",
        1e-3,
        1e6,
    ),
    _parameter(
        "tyre.rolling_resistance",
        "1",
        "vehicle.rolling_resistance",
        "Rolling resistance coefficient",
        0.0,
        1.0,
    ),
    _parameter(
        "tyre.longitudinal_stiffness",
        "N",
        "vehicle.longitudinal_stiffness_n",
        "Longitudinal stiffness C_x per unit slip",
        10_000.0,
        1e9,
    ),
)

_ESTIMATOR_PARAMETERS = (
    _parameter("estimator.K", "1/s", "gains.K", "Bandwidth of the force observer", 1e-3, 1e6),
    _parameter("estimator.gamma", "1/s", "gains.gamma", "Rate of the estimator", 0.0, 1e6),
    _parameter(
        "estimator.visual_term",
        "",
        "gains.visual_term",
        "Form of the visual term: that of Eq. (17) or (18)",
        min(form.value for form in VisualTerm),
        max(form.value for form in VisualTerm),
    ),
    _parameter(
        "estimator.tyre_first",
        "",
        "gains.tyre_first",
        "The visual term never pulls against what the tyre shows; false: Eqs. (17) and (18) as printed",
    ),
    _parameter(
        "estimator.theta_initial",
        "1",
        "theta_initial",
        "Estimate at the start",
        0.02,
        GREATEST_THETA,
    ),
    _parameter("estimator.floor_speed", "m/s", "floor_m_s", "Speed below which slip says nothing", 0.01),
    _parameter(
        "estimator.sensor_filter", "s", "sensor_filter_s", "Time constant of the filter on the sensors", 1e-9
    ),
    _parameter(
        "estimator.sliding_speed_noise",
        "m/s",
        "sliding_speed_noise_m_s",
        "Standard deviation of the sliding speed omega R - v per sample",
        0.0,
    ),
    _parameter(
        "estimator.acceleration_filter",
        "s",
        "acceleration_filter_s",
        "Time constant for the acceleration that the load follows",
        1e-6,
    ),
    *(
        _parameter(
            f"estimator.theta_{surface.label}",
            "1",
            f"class_theta.{surface.value}",
            f"Adhesion of the class {surface.label}",
            0.02,
            GREATEST_THETA,
        )
        for surface in Surface
    ),
    *(
        _parameter(
            f"scheduler.theta_{size}",
            "1",
            f"scheduler.theta_sets.{size}",
            f"Camera's adhesion at which the set '{size}' is full",
            0.0,
            GREATEST_THETA,
        )
        for size in ("small", "medium", "big")
    ),
    *(
        _parameter(
            f"scheduler.difference_{size}",
            "1",
            f"scheduler.difference_sets.{size}",
            f"Difference of camera and estimate at which the set '{size}' is full",
            0.0,
            GREATEST_THETA,
        )
        for size in ("small", "medium", "big")
    ),
    *(
        _parameter(
            f"scheduler.K_v_{size}",
            "1/s",
            f"scheduler.K_v_values.{place}",
            f"K_v of the set '{size}', in 1/s as the visual term is in form (18)",
            0.0,
            K_V_LIMIT,
        )
        for place, size in enumerate(("small", "medium", "big"))
    ),
    _parameter(
        "scheduler.class_scatter",
        "1",
        "scheduler.class_scatter",
        "How much more slippery than its class a road may be and still be seen",
        0.0,
        1.0,
    ),
    _parameter(
        "scheduler.onset_sensitivity",
        "1",
        "scheduler.onset_sensitivity",
        "Sensitivity d mu / d theta from which the tyre shows theta",
        0.0,
        1.0,
    ),
    _parameter(
        "scheduler.noise_factor",
        "1",
        "scheduler.noise_factor",
        "Noise deviations that the threshold stays above",
        0.0,
    ),
    _parameter("preview.P_0", "m", "preview.P_0_m", "Preview distance P_0", 0.0),
    _parameter("preview.hold", "m", "preview.hold_m", "How far beyond its end a frame holds", 0.0),
    _parameter(
        "preview.resolution",
        "m",
        "preview.resolution_m",
        "Way below which frames share a stamp",
        0.0,
    ),
    _parameter(
        "confidence.torque_noise",
        "N.m",
        "confidence.torque_noise_nm",
        "Standard deviation of the torque",
        0.0,
        1e6,
    ),
    _parameter(
        "confidence.tyre_share",
        "1",
        "confidence.tyre_share",
        "Error of the tyre model, as a share of the used friction",
        0.0,
        10.0,
    ),
    _parameter(
        "confidence.road_change",
        "1/m0.5",
        "confidence.road_change",
        "Wander of the adhesion per root of a metre driven unseen",
        0.0,
        10.0,
    ),
    _parameter(
        "confidence.car_share",
        "1",
        "confidence.car_share",
        "Error of load and torque, as a share of the adhesion that no driving can tell",
        0.0,
        10.0,
    ),
    _parameter(
        "confidence.class_change",
        "m",
        "confidence.class_change_m",
        "Way driven unseen that a change of the camera's class counts as",
        0.0,
        1e6,
    ),
    _parameter(
        "confidence.class_scatter",
        "1",
        "confidence.class_scatter",
        "Standard deviation of a road from the value of the class that the camera gave it",
        0.0,
        10.0,
    ),
    _parameter(
        "tolerance.speed_bias",
        "m/s",
        "elastic.speed_bias_m_s",
        "Standard deviation of a constant error of the sliding speed, learnt while the tyre adheres",
        0.0,
        100.0,
    ),
    _parameter(
        "tolerance.speed_drift",
        "m/s1.5",
        "elastic.speed_drift_m_s",
        "How far that error wanders per root of a second",
        0.0,
        100.0,
    ),
    _parameter(
        "tolerance.rolling_radius",
        "1",
        "elastic.ratio",
        "Standard deviation of the rolling radius as a share of it, learnt while the tyre adheres",
        0.0,
        1.0,
    ),
    _parameter(
        "tolerance.longitudinal_stiffness",
        "1",
        "elastic.compliance",
        "Standard deviation of the tyre's compliance as a share of it, learnt while the tyre adheres",
        0.0,
        10.0,
    ),
    _parameter(
        "confidence.unknown",
        "1",
        "confidence.unknown",
        "Standard deviation where nothing is known",
        0.0,
        10.0,
    ),
)

_CAMERA_PARAMETERS = (
    _parameter("camera.width", "", "vision.camera.width_px", "Width of the picture in pixels", 64),
    _parameter("camera.height", "", "vision.camera.height_px", "Height of the picture in pixels", 64),
    _parameter("camera.fx", "px", "vision.camera.fx_px", "Focal length, horizontal", 1.0),
    _parameter("camera.fy", "px", "vision.camera.fy_px", "Focal length, vertical", 1.0),
    _parameter("camera.cx", "px", "vision.camera.cx_px", "Principal point, column"),
    _parameter("camera.cy", "px", "vision.camera.cy_px", "Principal point, row"),
    *(
        _parameter(f"camera.{term}", "1", f"vision.camera.distortion.{place}", f"Lens distortion {term}")
        for place, term in enumerate(("k1", "k2", "p1", "p2", "k3"))
    ),
    _parameter("camera.height_above_road", "m", "vision.camera.height_m", "Height above the road", 0.01),
    _parameter(
        "camera.x_from_front_axle", "m", "vision.camera.x_from_front_axle_m", "Position, forward positive"
    ),
    _parameter("camera.y", "m", "vision.camera.y_m", "Position, left positive"),
    _parameter("camera.pitch", "rad", "vision.camera.pitch_rad", "Pitch, nose down positive", -1.5, 1.5),
    _parameter("camera.yaw", "rad", "vision.camera.yaw_rad", "Yaw, left positive", -1.5, 1.5),
    _parameter("camera.roll", "rad", "vision.camera.roll_rad", "Roll, right side down positive", -1.5, 1.5),
    _parameter("camera.fps", "1/s", "vision.camera.fps", "Pictures per second", 0.01),
)

_GROUPS = ("near", "middle", "far")

_IMAGE_PARAMETERS = (
    _parameter(
        "image.flag_threshold", "1", "vision.flag_threshold", "Q_v above which the flag is set", 0.0, 1.0
    ),
    _parameter(
        "image.least_mass",
        "1",
        "vision.least_mass",
        "Least mass m_0 of the class for the flag to be set",
        0.0,
        1.0,
    ),
    *(
        _parameter(
            f"image.{group}_{end}",
            "m",
            f"vision.ranges_m.{place}.{index}",
            f"The {group} group looks {end} this way ahead",
            0.0,
            MOST_WAY_M,
        )
        for place, group in enumerate(_GROUPS)
        for index, end in enumerate(("from", "to"))
    ),
    *(
        _parameter(
            f"image.patches_{group}",
            "",
            f"vision.b.{place}",
            f"Patches of the {group} group",
            2,
            MOST_PATCHES,
        )
        for place, group in enumerate(_GROUPS)
    ),
    _parameter("image.grid", "m", "vision.a_m", "Grid size a", LEAST_GRID_M),
    _parameter(
        "image.roi_width",
        "m",
        "vision.roi_width_m",
        "Width of road that a patch shows, in the mean",
        0.05,
        MOST_WIDTH_M,
    ),
    _parameter(
        "image.roi_spread",
        "1",
        "vision.roi_spread",
        "A group's widest patch is wider by this, its narrowest narrower",
        1.0,
    ),
    _parameter(
        "image.track_step", "m", "vision.step_m", "Distance between the track's ellipses", LEAST_STEP_M
    ),
    _parameter("image.k1", "m/s", "vision.k1", "Growth of the track's uncertainty along, below k2", 1e-12),
    _parameter(
        "image.k2", "m/s", "vision.k2", "Growth of the track's uncertainty across", 1e-12, MOST_GROWTH_M_S
    ),
    _parameter(
        "image.start_deviation",
        "m",
        "vision.start_deviation_m",
        "Standard deviation of the wheel's place",
        1e-3,
        MOST_DEVIATION_M,
    ),
    _parameter("image.sigma", "1", "vision.weight_law.sigma", "Relaxation of the evidence weights", 0.0, 1.0),
    _parameter(
        "image.sigmoid_centre",
        "1",
        "vision.weight_law.sigmoid_centre",
        "Centre of the weights' sigmoid",
        -FARTHEST_CENTRE,
        FARTHEST_CENTRE,
    ),
    _parameter(
        "image.sigmoid_slope",
        "1",
        "vision.weight_law.sigmoid_slope",
        "Slope of the weights' sigmoid",
        0.0,
        STEEPEST_SIGMOID,
    ),
    _parameter("image.seed", "", "vision.seed", "Seed of the drawing of patches", 0),
)

_UNIT_PARAMETERS = (
    Variable(
        BUFFERS_ENABLED,
        Kind.BOOLEAN,
        "parameter",
        "fixed",
        "Pictures in memory are read; false: the inputs image.* are never followed, so that no wrong address can crash",
        start=True,
    ),
)

PARAMETERS = (
    *_VEHICLE_PARAMETERS,
    *_ESTIMATOR_PARAMETERS,
    *_CAMERA_PARAMETERS,
    *_IMAGE_PARAMETERS,
    *_UNIT_PARAMETERS,
)
