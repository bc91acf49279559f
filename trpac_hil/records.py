"""The columns of the log, one row per cycle; names are those of the project's log format where it has one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from trpac_core.vehicle import WHEELS
from trpac_hil.codec import Supply
from trpac_hil.roles import SHIPPED
from trpac_hil.unit import Wiring

TIME = "time_s"


@dataclass(frozen=True)
class Column:
    """A column: name, unit, meaning and stored type."""

    name: str
    unit: str
    meaning: str
    kind: str = "f8"


LOGGED = tuple(SHIPPED)
"""Quantities by their log column; NaN where lost, or where the bus does not carry them."""

_UNITS = {"_rad_s": "rad/s", "_nm": "N.m", "_m_s": "m/s", "_m_s2": "m/s2", "_rad": "rad", "_n": "N"}


def _unit(name: str) -> str:
    fitting = [unit for ending, unit in _UNITS.items() if name.endswith(ending)]
    return fitting[-1] if fitting else "1"


def age_column(supply: Supply) -> str:
    """Column of the age of what a supply brings."""
    return f"age_{supply.name}_ms"


def columns(wiring: Wiring, supplies: Sequence[Supply] = ()) -> tuple[Column, ...]:
    """The columns of a run whose inputs have these supplies, in the order in which the loop writes them."""
    sides = [("", "")] if len(wiring.sides) == 1 else [("_left", ", left track"), ("_right", ", right track")]
    wheels = WHEELS if len(wiring.wheels) > 1 else ()
    return (
        Column(TIME, "s", "start of the cycle's slot"),
        Column("step_s", "s", "step of the unit; 0 where it discarded the step"),
        Column("position_m", "m", "distance driven, integrated from the vehicle speed"),
        *(Column(name, _unit(name), "as received; NaN: lost") for name in LOGGED),
        Column("frame_id", "", "number of the camera result that the unit was given", "i4"),
        *(Column(f"image_class{s}", "", f"0 dry, 1 wet, 2 snow_ice, -1 none{t}", "i1") for s, t in sides),
        *(Column(f"image_confidence{s}", "1", f"Q_v{t}") for s, t in sides),
        Column("TRPAC", "1", "fused estimate, as sent"),
        Column("TRPAC_std", "1", "its standard deviation"),
        Column("TRPAC_low", "1", "lower end of its interval; NaN: the unit gives none"),
        Column("TRPAC_high", "1", "upper end of its interval"),
        Column("K_v", "1/s", "visual gain"),
        Column("flag", "", "visual confidence flag", "u1"),
        Column("excitation_flag", "", "slip above the threshold", "u1"),
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
        *(
            Column(age_column(s), "ms", "age of the newest such message; NaN: none yet", "f4")
            for s in supplies
        ),
        Column("age_picture_ms", "ms", "since the newest picture was taken; NaN: none", "f4"),
        Column("age_under_wheel_ms", "ms", "since the picture of the road under the wheel; NaN: none", "f4"),
    )
