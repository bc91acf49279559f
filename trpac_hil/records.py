"""The columns of the log, one row per cycle; names are those of the project's log format where it has one."""

from __future__ import annotations

from dataclasses import dataclass

from trpac_core.vehicle import WHEELS
from trpac_hil.unit import Wiring

TIME = "time_s"


@dataclass(frozen=True)
class Column:
    """A column: name, unit, meaning and stored type."""

    name: str
    unit: str
    meaning: str
    kind: str = "f8"


LOGGED = {
    **{f"wheel_speed_{w}_rad_s": f"WheelSpeed_{w.upper()}" for w in WHEELS},
    **{f"wheel_torque_{w}_nm": f"WheelTorque_{w.upper()}" for w in WHEELS},
    "vehicle_speed_m_s": "VehicleSpeed",
    "accel_x_m_s2": "AccelX",
    "accel_y_m_s2": "AccelY",
    "yaw_rate_rad_s": "YawRate",
    "steering_angle_rad": "SteeringAngle",
    **{f"vertical_load_{w}_n": f"VerticalLoad_{w.upper()}" for w in WHEELS},
    **{f"theta_true_{w}": f"Theta_{w.upper()}" for w in WHEELS},
}
"""Signal of the bus by log column; NaN where it is lost."""
AGED = ("WheelSpeeds", "WheelTorques", "VehicleMotion", "Chassis", "RoadClass")
"""Messages whose age is recorded."""

_UNITS = {"_rad_s": "rad/s", "_nm": "N.m", "_m_s": "m/s", "_m_s2": "m/s2", "_rad": "rad", "_n": "N"}


def _unit(name: str) -> str:
    fitting = [unit for ending, unit in _UNITS.items() if name.endswith(ending)]
    return fitting[-1] if fitting else "1"


def columns(wiring: Wiring) -> tuple[Column, ...]:
    """The columns of a run, in the order in which the loop writes them."""
    sides = [("", "")] if len(wiring.sides) == 1 else [("_left", ", left track"), ("_right", ", right track")]
    wheels = WHEELS if len(wiring.wheels) > 1 else ()
    return (
        Column(TIME, "s", "start of the cycle's slot"),
        Column("step_s", "s", "step of the unit; 0 where it discarded the step"),
        Column("position_m", "m", "way driven, integrated from the vehicle speed"),
        *(Column(name, _unit(name), f"signal {signal}; NaN: lost") for name, signal in LOGGED.items()),
        Column("frame_id", "", "number of what the unit was told of the road", "i4"),
        *(Column(f"image_class{s}", "", f"0 dry, 1 wet, 2 snow_ice, -1 none{t}", "i1") for s, t in sides),
        *(Column(f"image_confidence{s}", "1", f"Q_v{t}") for s, t in sides),
        Column("TRPAC", "1", "fused estimate, as sent"),
        Column("TRPAC_std", "1", "its standard deviation"),
        Column("K_v", "1/s", "visual gain"),
        Column("flag", "", "visual confidence flag", "u1"),
        Column("excitation_flag", "", "the fused estimate runs", "u1"),
        Column("TRPAC_dynamics", "1", "estimate without the camera"),
        *(Column(f"TRPAC_{w}", "1", "estimate at this wheel") for w in wheels),
        *(Column(f"flag_{w}", "", "flag at this wheel", "u1") for w in wheels),
        Column("status", "", "0 starting, 1 running, 2 held: input, 3 held: bus, 4 held: unit", "u1"),
        Column("lateness_us", "us", "begin of the cycle after its due time", "f4"),
        Column("work_us", "us", "from the cycle's begin until all is sent", "f4"),
        Column("cpu_us", "us", "processor time of the loop's thread in that", "f4"),
        Column("unit_us", "us", "setting, stepping and reading the unit", "f4"),
        Column("missed_us", "us", "end of the cycle after its deadline; 0 where kept", "f4"),
        Column("left_out", "", "cycles left out before this one", "u4"),
        Column("overruns", "", "overruns so far", "u4"),
        *(Column(f"age_{m}_ms", "ms", "age of the newest such message; NaN: none yet", "f4") for m in AGED),
        Column("age_picture_ms", "ms", "since the newest picture was taken; NaN: none", "f4"),
        Column("age_under_wheel_ms", "ms", "since the picture of the road under the wheel; NaN: none", "f4"),
    )
