"""All parameters of the estimator.

A parameter's start is the default of the estimator's own configuration, so that no number is stated twice.
"""

from __future__ import annotations

from trpac_core.dife import VisualTerm
from trpac_core.estimator_data import Method
from trpac_core.fuzzy import K_V_LIMIT
from trpac_core.parameters.estimator_parameter import parameter
from trpac_core.parameters.image_settings import CAMERA_PARAMETERS, IMAGE_PARAMETERS
from trpac_core.tyre import GREATEST_THETA
from trpac_core.vision.classes import Surface

_VEHICLE_PARAMETERS = (
    parameter("wheel.front", "", "front_axle", "The wheel is on the front axle"),
    parameter("wheel.left", "", "left_side", "The wheel is on the left side of the car"),
    parameter("vehicle.mass", "kg", "vehicle.mass_kg", "Mass of the car", 1.0, 1e6),
    parameter("vehicle.wheelbase", "m", "vehicle.wheelbase_m", "Wheelbase", 0.1, 100.0),
    parameter("vehicle.track", "m", "vehicle.track_m", "Track width", 0.1, 100.0),
    parameter(
        "vehicle.cog_height", "m", "vehicle.cog_height_m", "Height of the centre of gravity", 0.0, 100.0
    ),
    parameter(
        "vehicle.cog_to_rear_axle",
        "m",
        "vehicle.cog_to_rear_axle_m",
        "Centre of gravity to rear axle",
        0.0,
        100.0,
    ),
    parameter(
        "vehicle.wheel_radius", "m", "vehicle.wheel_radius_m", "Effective rolling radius R", 0.01, 10.0
    ),
    parameter(
        "vehicle.wheel_inertia",
        "kg.m2",
        "vehicle.wheel_inertia_kg_m2",
        "Inertia I of a wheel",
        1e-3,
        1e6,
    ),
    parameter(
        "tyre.rolling_resistance",
        "1",
        "vehicle.rolling_resistance",
        "Rolling resistance coefficient",
        0.0,
        1.0,
    ),
    parameter(
        "tyre.longitudinal_stiffness",
        "N",
        "vehicle.longitudinal_stiffness_n",
        "Longitudinal stiffness C_x per unit slip",
        10_000.0,
        1e9,
    ),
)

_FUSION_PARAMETERS = (
    parameter(
        "estimator.method",
        "",
        "method",
        "Estimation method: 0 as_printed, 1 dife, 2 robust",
        min(method.value for method in Method),
        max(method.value for method in Method),
    ),
    parameter("estimator.K", "1/s", "gains.K", "Bandwidth of the force observer", 1e-3, 1e6),
    parameter("estimator.gamma", "1/s", "gains.gamma", "Adaptation rate of the estimate", 0.0, 1e6),
    parameter(
        "estimator.visual_term",
        "",
        "gains.visual_term",
        "Form of the visual term: Eq. (17) or Eq. (18) of the paper",
        min(form.value for form in VisualTerm),
        max(form.value for form in VisualTerm),
    ),
    parameter(
        "estimator.theta_initial",
        "1",
        "theta_initial",
        "Estimate at the start",
        0.02,
        GREATEST_THETA,
    ),
    parameter(
        "estimator.floor_speed",
        "m/s",
        "floor_m_s",
        "Speed of wheel and car below which the slip is set to 0",
        0.01,
    ),
    parameter(
        "estimator.sensor_filter",
        "s",
        "sensor_filter_s",
        "Time constant of the filter on all sensor signals",
        1e-9,
    ),
    parameter(
        "estimator.sliding_speed_noise",
        "m/s",
        "sliding_speed_noise_m_s",
        "Standard deviation of the noise of the sliding speed omega R - v, per sample",
        0.0,
    ),
    parameter(
        "estimator.torque_noise",
        "N.m",
        "torque_noise_nm",
        "Standard deviation of the noise of the wheel torque, per sample",
        0.0,
        1e6,
    ),
    parameter(
        "estimator.acceleration_filter",
        "s",
        "acceleration_filter_s",
        "Time constant of the filter on the acceleration from which the load is computed",
        1e-6,
    ),
    *(
        parameter(
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
        parameter(
            f"scheduler.difference_{size}",
            "1",
            f"gains.difference_sets.{size}",
            f"Difference of camera and estimate at which membership of the fuzzy set {size} is 1",
            0.0,
            GREATEST_THETA,
        )
        for size in ("small", "medium", "big")
    ),
    *(
        parameter(
            f"scheduler.K_v_{size}",
            "1/s",
            f"gains.K_v_values.{index}",
            f"K_v of the fuzzy set {size} (in 1/s for form (18))",
            0.0,
            K_V_LIMIT,
        )
        for index, size in enumerate(("small", "medium", "big"))
    ),
    parameter("preview.P_0", "m", "preview.P_0_m", "Preview distance P_0", 0.0),
    parameter(
        "preview.hold",
        "m",
        "preview.hold_m",
        "Distance beyond the end of a frame's stretch of road for which its class stays valid",
        0.0,
    ),
    parameter(
        "preview.resolution",
        "m",
        "preview.resolution_m",
        "Travelled distance below which two frames share one stretch of road",
        0.0,
    ),
    parameter(
        "tolerance.speed_bias",
        "m/s",
        "tolerance.speed_bias_m_s",
        "Standard deviation of a constant error of the sliding speed omega R - v",
        0.0,
        100.0,
    ),
    parameter(
        "tolerance.rolling_radius",
        "1",
        "tolerance.ratio",
        "Relative standard deviation of the rolling radius",
        0.0,
        1.0,
    ),
    parameter(
        "tolerance.longitudinal_stiffness",
        "1",
        "tolerance.compliance",
        "Relative standard deviation of the longitudinal stiffness",
        0.0,
        10.0,
    ),
)

ESTIMATOR_PARAMETERS = (
    *_VEHICLE_PARAMETERS,
    *_FUSION_PARAMETERS,
    *CAMERA_PARAMETERS,
    *IMAGE_PARAMETERS,
)
"""In the order in which units have them."""
