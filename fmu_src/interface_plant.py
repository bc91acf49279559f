"""The variables of the unit `ReferencePlant`, in the order of their value references."""

from __future__ import annotations

from trpac_core.parameters.variables import Kind, Variable

WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
SIDES = ("left", "right")
ROAD = ((0.0, 0.9, 0), (20.0, 0.3, 2), (40.0, 0.5, 1), (60.0, 0.9, 0), (80.0, 0.3, 2))
"""Start [m], theta [-] and surface class of each segment of the parameters; the first three, used by default, are the
road of Figure 16 of Tian et al. 2022."""
MOST_TORQUE_NM = 20_000.0
"""Greatest torque that is accepted: no wheel of a road car has more, so that the input is in another unit [N m]."""


def _at_each_wheel(
    name: str,
    causality: str,
    unit: str,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    nominal: float | None = None,
) -> tuple[Variable, ...]:
    return tuple(
        Variable(
            f"{name}.{wheel}",
            Kind.REAL,
            causality,
            "continuous",
            f"{wheel_name[0].upper()}{wheel_name[1:]} wheel: {description}",
            unit,
            0.0 if causality == "input" else None,
            minimum,
            maximum,
            nominal,
        )
        for wheel, wheel_name in WHEELS.items()
    )


def _output(
    name: str, unit: str, description: str, minimum: float | None = None, nominal: float | None = None
) -> Variable:
    return Variable(name, Kind.REAL, "output", "continuous", description, unit, None, minimum, None, nominal)


def _parameter(
    name: str,
    unit: str,
    description: str,
    start: float,
    minimum: float | None = None,
    maximum: float | None = None,
    source: str = "",
) -> Variable:
    return Variable(
        name, Kind.REAL, "parameter", "fixed", description, unit, start, minimum, maximum, source=source
    )


def _whole(name: str, description: str, start: int, minimum: int, maximum: int) -> Variable:
    return Variable(
        name,
        Kind.INTEGER,
        "parameter",
        "fixed",
        description,
        start=start,
        minimum=minimum,
        maximum=maximum,
    )


def _path(name: str, description: str) -> Variable:
    return Variable(name, Kind.STRING, "parameter", "fixed", description, start="")


def _road_segment(number: int, start_m: float, theta: float, surface: int) -> tuple[Variable, ...]:
    name = f"road.segment_{number}"
    return (
        _parameter(
            f"{name}.start",
            "m",
            f"Segment {number}: start; the segment ends where the next one starts",
            start_m,
        ),
        *(
            _parameter(
                f"{name}.theta_{side}", "1", f"Segment {number}: theta of the {side} side", theta, 0.02, 1.5
            )
            for side in SIDES
        ),
        *(
            _whole(
                f"{name}.class_{side}",
                f"Segment {number}: surface class of the {side} side: 0 dry, 1 wet, 2 snow or ice",
                surface,
                0,
                2,
            )
            for side in SIDES
        ),
    )


_OUTPUTS = (
    *_at_each_wheel("wheel_speed", "output", "rad/s", "Rotational speed", 0.0, nominal=100.0),
    _output("vehicle_speed", "m/s", "Longitudinal speed of the car", 0.0, 30.0),
    _output(
        "longitudinal_acceleration",
        "m/s2",
        "Acceleration that a sensor in the centre of gravity measures",
        None,
        10.0,
    ),
    _output("position", "m", "Road coordinate of the front axle's contact with the road", None, 100.0),
    *_at_each_wheel("vertical_load", "output", "N", "Vertical load", 0.0, nominal=3000.0),
    *_at_each_wheel("slip", "output", "1", "Longitudinal slip, unsigned", 0.0, 1.0),
    *_at_each_wheel("tyre_force", "output", "N", "Longitudinal tyre force, positive drives", nominal=1000.0),
    *_at_each_wheel("theta", "output", "1", "True adhesion theta under the wheel", 0.0, 1.5),
    *(
        Variable(
            f"road_class.{side}",
            Kind.INTEGER,
            "output",
            "discrete",
            f"{side.capitalize()} track: surface class preview.P_0 ahead of the axle: 0 dry, 1 wet, 2 snow or ice",
            minimum=0,
            maximum=2,
        )
        for side in SIDES
    ),
    *(
        Variable(
            f"road_class_confidence.{side}",
            Kind.REAL,
            "output",
            "continuous",
            f"{side.capitalize()} track: confidence of road_class, the parameter camera.confidence",
            "1",
            None,
            0.0,
            1.0,
        )
        for side in SIDES
    ),
)

_PARAMETERS = (
    _path("vehicle_path", "Path of the car's vehicle.yaml; empty: the parameters vehicle.* and tyre.* apply"),
    _path("road_path", "Path of a road.yaml; empty: the parameters road.* apply"),
    _parameter("vehicle.mass", "kg", "Mass of the car", 1343.8, 1.0, source="mass_kg"),
    _parameter("vehicle.wheelbase", "m", "Wheelbase", 2.305, 0.1, source="wheelbase_m"),
    _parameter("vehicle.track", "m", "Track width", 1.356, 0.1, source="track_m"),
    _parameter(
        "vehicle.cog_height", "m", "Height of the centre of gravity", 0.54, 0.0, 1.5, source="cog_height_m"
    ),
    _parameter(
        "vehicle.cog_to_rear_axle",
        "m",
        "Centre of gravity to rear axle",
        1.193,
        0.01,
        source="cog_to_rear_axle_m",
    ),
    _parameter(
        "vehicle.wheel_radius", "m", "Effective rolling radius R", 0.29, 0.01, source="wheel_radius_m"
    ),
    _parameter(
        "vehicle.wheel_inertia", "kg.m2", "Inertia I of a wheel", 1.2, 1e-3, source="wheel_inertia_kg_m2"
    ),
    _parameter("vehicle.drag_area", "m2", "Drag coefficient times frontal area", 0.65, 0.0, 5.0),
    _parameter("tyre.rolling_resistance", "1", "Rolling resistance coefficient", 0.0065, 0.0, 0.3),
    _parameter(
        "tyre.longitudinal_stiffness",
        "N",
        "Longitudinal stiffness C_x per unit slip",
        50_000.0,
        1000.0,
        source="tyre.longitudinal_stiffness_n",
    ),
    _parameter("initial.vehicle_speed", "m/s", "Speed at the start, wheels roll freely", 0.0, 0.0, 150.0),
    _parameter("initial.position", "m", "Road coordinate of the front axle at the start", 0.0),
    _parameter("preview.P_0", "m", "Distance ahead of the front axle to which road_class applies", 2.5, 0.0),
    _parameter("camera.confidence", "1", "Value of road_class_confidence", 0.95, 0.0, 1.0),
    _whole("road.segments", "Number of segments of the road", 3, 1, len(ROAD)),
    *(
        variable
        for number, segment in enumerate(ROAD, start=1)
        for variable in _road_segment(number, *segment)
    ),
)

REFERENCE_PLANT = (
    *_at_each_wheel(
        "wheel_torque",
        "input",
        "N.m",
        "Torque, positive drives, negative brakes and holds the car at rest; constant over a step",
        -MOST_TORQUE_NM,
        MOST_TORQUE_NM,
        300.0,
    ),
    *_OUTPUTS,
    *_PARAMETERS,
)
"""Variables of the unit `ReferencePlant`."""
