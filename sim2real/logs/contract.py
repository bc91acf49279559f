"""The columns of a log: names, units, and which of them must be there."""

from __future__ import annotations

from dataclasses import dataclass

from trpac_core.vehicle import WHEELS


@dataclass(frozen=True)
class Column:
    """One column of the log format.

    Attributes
    ----------
    name, unit, meaning : str
        What it is called, in which unit it must be after the mapping, what it holds.
    required : bool
        Whether a log without it is refused.
    held : bool
        Whether the value holds until the next one (classes, numbers of frames) and must never be averaged.
    """

    name: str
    unit: str
    meaning: str
    required: bool = False
    held: bool = False


TIME, POSITION = "time_s", "position_m"
IMAGE_PATH = "image_path"
"""The only column that holds text; relative to the log's folder."""

_ALL = (
    Column(TIME, "s", "time, ascending", required=True),
    *(Column(f"wheel_torque_{w}_nm", "N m", "commanded torque, brakes included", True) for w in WHEELS),
    *(Column(f"wheel_speed_{w}_rad_s", "rad/s", "wheel speed", True) for w in WHEELS),
    Column("vehicle_speed_m_s", "m/s", "speed over ground", True),
    Column("accel_x_m_s2", "m/s2", "longitudinal acceleration as the accelerometer reads it", True),
    Column(POSITION, "m", "distance of the centre of gravity from the road's zero"),
    Column("steering_angle_rad", "rad", "steering angle at the wheels"),
    Column("yaw_rate_rad_s", "rad/s", "yaw rate"),
    Column("accel_y_m_s2", "m/s2", "lateral acceleration"),
    Column("mu_reference", "-", "peak friction under the front wheels, from whatever reference"),
    Column("frame_id", "-", "number of the camera's result: a new value is a new result", held=True),
    Column("image_class", "-", "0 dry, 1 wet, 2 snow_ice, -1 none", held=True),
    Column("image_confidence", "-", "visual information confidence Q_v", held=True),
    Column("image_from_m", "m", "near end of the stretch that the result is for", held=True),
    Column("image_to_m", "m", "its far end", held=True),
    Column(IMAGE_PATH, "text", "picture, relative to the log", held=True),
)

COLUMNS: dict[str, Column] = {column.name: column for column in _ALL}
"""All columns of a log by name."""


def is_optional(name: str) -> bool:
    """Whether a name is a column of the log format that a log can do without."""
    return name in COLUMNS and not COLUMNS[name].required


REQUIRED = tuple(column.name for column in _ALL if column.required)
WHEEL_SPEEDS = tuple(f"wheel_speed_{w}_rad_s" for w in WHEELS)
