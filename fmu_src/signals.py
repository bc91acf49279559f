"""Inputs and outputs of the estimator's unit."""

from __future__ import annotations

from functools import partial

from trpac_core.estimator_data import Source
from trpac_core.parameters.variables import Kind, Variable
from trpac_core.tyre import GREATEST_THETA
from trpac_core.vision.classes import Surface

NO_ROAD_CLASS = -1
"""Value of `road_class` that means: no class by bus, use the picture."""


def _signal(
    causality: str,
    name: str,
    unit: str,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    nominal: float | None = None,
) -> Variable:
    start = 0.0 if causality == "input" else None
    return Variable(
        name, Kind.REAL, causality, "continuous", description, unit, start, minimum, maximum, nominal
    )


_input, _output = partial(_signal, "input"), partial(_signal, "output")

WRONG_ADDRESS = "An address that cannot be read gives a warning and no frame; not available on macOS"

INPUTS = (
    _input("wheel_speed", "rad/s", "Rotational speed of the wheel, positive forwards", nominal=100.0),
    _input(
        "wheel_torque", "N.m", "Drive torque minus brake torque at the wheel, positive drives", nominal=300.0
    ),
    _input("vehicle_speed", "m/s", "Longitudinal speed of the car, positive forwards", nominal=30.0),
    Variable(
        "image_path",
        Kind.STRING,
        "input",
        "discrete",
        "Path of the newest camera picture; a new path or a new frame_id marks a new frame; empty: no picture",
        start="",
    ),
    Variable(
        "frame_id",
        Kind.INTEGER,
        "input",
        "discrete",
        "Number of the newest frame; 0: frames have no numbers",
        start=0,
    ),
    *(
        Variable(
            f"image.{part}",
            Kind.INTEGER,
            "input",
            "discrete",
            f"{meaning} of the newest picture in memory, set for one step; 0: no picture. {WRONG_ADDRESS}",
            start=0,
            binary="image",
        )
        for part, meaning in (
            ("base.lo", "Lower 32 bits of the address"),
            ("base.hi", "Upper 32 bits of the address"),
            ("size", "Size in bytes"),
        )
    ),
    *(
        Variable(
            f"image_{side}",
            Kind.INTEGER,
            "input",
            "discrete",
            f"{side.capitalize()} in pixels of a raw BGR picture in memory, 8 bits a channel; 0: it is JPEG or PNG",
            start=0,
            minimum=0,
        )
        for side in ("width", "height")
    ),
    Variable(
        "road_class",
        Kind.INTEGER,
        "input",
        "discrete",
        "Road surface class as a number, used instead of a picture: 0 dry, 1 wet, 2 snow or ice; -1: no class",
        start=NO_ROAD_CLASS,
        minimum=NO_ROAD_CLASS,
        maximum=int(max(Surface)),
    ),
    _input("road_class_confidence", "1", "Confidence of road_class", 0.0, 1.0),
    _input(
        "vertical_load",
        "N",
        "Vertical load; not connected (always 0): the load is computed from mass and acceleration",
        nominal=3000.0,
    ),
    _input("steering_angle", "rad", "Steering angle of the front wheels, positive to the left"),
    _input(
        "longitudinal_acceleration",
        "m/s2",
        "Longitudinal acceleration; not connected (always 0): the vehicle speed is differentiated",
        nominal=10.0,
    ),
    _input(
        "yaw_rate",
        "rad/s",
        "Yaw rate, positive to the left; not connected (always 0): computed from the steering angle",
    ),
)

OUTPUTS = (
    _output(
        "TRPAC",
        "1",
        "Peak adhesion coefficient of tyre and road, fused estimate theta_hat",
        0.0,
        GREATEST_THETA,
    ),
    Variable(
        "flag",
        Kind.BOOLEAN,
        "output",
        "discrete",
        "Visual information confidence flag epsilon: the class of the road under the wheel is used",
    ),
    _output("K_v", "1/s", "Auxiliary gain of the visual term in form (18); without unit in form (17)", 0.0),
    Variable(
        "excitation_flag",
        Kind.BOOLEAN,
        "output",
        "discrete",
        "Slip is above the excitation threshold, the estimate is updated",
    ),
    _output("excitation_threshold", "1", "Slip above which the estimate is updated", 0.0, 1.0),
    _output("slip", "1", "Longitudinal slip, unsigned", 0.0, 1.0),
    _output("tyre_force", "N", "Observed longitudinal tyre force, positive drives", nominal=1000.0),
    _output(
        "TRPAC_image", "1", "Adhesion that belongs to the camera's class of the road under the wheel", 0.0
    ),
    _output("TRPAC_dynamics", "1", "Adhesion estimated from the dynamics alone", 0.0, GREATEST_THETA),
    _output(
        "TRPAC_peak",
        "1",
        "Maximum of the tyre's friction curve at TRPAC, as a friction tester measures it",
        0.0,
    ),
    _output(
        "image_confidence",
        "1",
        "Confidence Q_v of the class of the road under the wheel; 0: no class",
        0.0,
        1.0,
    ),
    _output(
        "frame_age",
        "s",
        "Time since the picture of the road under the wheel was taken; -1: no picture",
        -1.0,
    ),
    _output("TRPAC_std", "1", "Standard deviation of TRPAC", 0.0),
)

INTERVAL_OUTPUTS = (
    _output(
        "TRPAC_low",
        "1",
        "Lower bound of the interval that contains the road's TRPAC with 95 % probability",
        0.0,
    ),
    _output(
        "TRPAC_high",
        "1",
        "Upper bound of the interval that contains the road's TRPAC with 95 % probability",
        0.0,
    ),
    _output("TRPAC_expected", "1", "Mean of the probability distribution of the road's TRPAC", 0.0),
    _output(
        "TRPAC_expected_std",
        "1",
        "Standard deviation of the probability distribution of the road's TRPAC",
        0.0,
    ),
    Variable(
        "TRPAC_source",
        Kind.INTEGER,
        "output",
        "discrete",
        "Sources of TRPAC: 0 none on this road, 1 tyre force and slip, 2 camera class with the flag set, 3 both",
        minimum=min(Source),
        maximum=max(Source),
    ),
)
"""Further outputs; they follow the parameters, so that value references stay as they were."""
