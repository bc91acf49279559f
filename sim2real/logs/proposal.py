"""A mapping file to correct by hand: which columns of a file may be those of the log format, by names and units."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping as Pairs
from dataclasses import dataclass
from itertools import pairwise

from sim2real.logs.contract import COLUMNS, POSITION, REQUIRED, TIME
from sim2real.logs.table import Table, split_unit
from sim2real.logs.units import plain_unit, quantities
from trpac_core.vehicle import WHEELS

WHEEL_WORDS = {
    "fl": "fl lf vl frontleft leftfront l1 1l",
    "fr": "fr rf vr frontright rightfront r1 1r",
    "rl": "rl lr hl bl rearleft leftrear l2 2l",
    "rr": "rr hr br rearright rightrear r2 2r",
}
"""What tools call the wheels; vl, vr, hl and hr are German, L1 to R2 CarSim's."""
QUANTITY_WORDS = {
    TIME: ("time t zeit timestamp timestamps clock stamp", "sec s log rel", ""),
    "wheel_torque": (
        "torque trq tq moment drehmoment my m",
        "motor wheel whl brake drive feedback act actual",
        "",
    ),
    "wheel_speed": (
        "omega avy rotation rot drehzahl n w raddrehzahl speed spd velocity geschw v",
        "wheel whl rad motor",
        "",
    ),
    "vehicle_speed_m_s": (
        "v vx speed spd velocity vel geschw geschwindigkeit vehspd",
        "vehicle veh car fahrzeug fzg x long gnss ground",
        "y z limit target wheel whl engine motor",
    ),
    "accel_x_m_s2": (
        "ax accelx accel acc acceleration beschl beschleunigung a",
        "x longitudinal long laengs",
        "y z lat lateral quer",
    ),
    "accel_y_m_s2": (
        "ay accely accel acc acceleration beschl beschleunigung a",
        "y lateral lat quer",
        "x z long longitudinal",
    ),
    "yaw_rate_rad_s": ("yaw yawrate avz gier gierrate psidot", "rate z", "angle acc"),
    "steering_angle_rad": (
        "steer steering steerangle lenk lenkwinkel delta",
        "angle road wheel",
        "torque rate",
    ),
    POSITION: (
        "position pos distance dist station weg s odometer odo way",
        "x road travelled",
        "y z trq torque limit angle steer",
    ),
    "mu_reference": ("mu friction reibwert", "peak reference", "torque"),
}
"""Words in the names of columns, by column of the log format, of a wheel's without the wheel: those that speak for it,
those that do so beside one of them, and those that speak against it."""
SUM_WORDS = (
    "torque trq tq moment drehmoment",
    "engine eng motor brake brk drive powertrain axle bremse antrieb achse",
    "limit max min steer steering loss friction",
)
"""Words of a torque that several wheels share: of a torque, of what makes it, and those that speak against it."""
SHARES = (
    "  # SHARE is the wheel's share; those of one column add up to 1 over the four wheels. It is negative for a brake",
    "  # whose torque is positive where it brakes.",
)
"""What to fill in for SHARE."""
_PER_WORD, _PER_UNIT = 1.0, 1.0
"""Evidence of a word, of which the share of a name's words that are known counts as one more, and of a fitting unit."""
_WORDS = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+|\d+")


@dataclass(frozen=True)
class Candidate:
    """A column of a file that may be one of the log format's: its name, its unit as stated, how much speaks for it."""

    column: str
    unit: str
    evidence: float


def candidates(table: Table) -> dict[str, Candidate]:
    """Columns of the log format that are missing, each with the file's column that most speaks for; each used once."""
    absent = [name for name in COLUMNS if name not in table.names and name in _TARGETS]
    found = sorted(
        (
            (_evidence(column, table.units.get(column, ""), name), name, column)
            for name in absent
            for column in table.names
            if column not in COLUMNS
        ),
        key=lambda one: -one[0],
    )
    chosen: dict[str, Candidate] = {}
    used: set[str] = set()
    for evidence, name, column in found:
        if evidence > 0.0 and name not in chosen and column not in used:
            chosen[name] = Candidate(column, table.units.get(column, "") or split_unit(column)[1], evidence)
            used.add(column)
    return {name: chosen[name] for name in COLUMNS if name in chosen}


def proposed_mapping(table: Table, file: str) -> str:
    """The text of a mapping file with the candidates of a table; what it could not find stands in comments."""
    chosen = candidates(table)
    lines = [
        f"# Proposed for {file} by the names and units of its columns. Check every line: these are guesses.",
        "schema: 1",
        "columns:",
    ]
    shared = shared_torques(table, chosen)
    for name in COLUMNS:
        if name in chosen:
            lines.append(f"  {name}: {_source(name, chosen[name])}")
        elif name == POSITION and name not in table.names:
            where = "{integrate: {copy: vehicle_speed_m_s}}   # no column found; only needed for a road of"
            lines.append(f"  # {name}: {where} several stretches")
        elif name in REQUIRED and name not in table.names:
            sums = shared if name in _TARGETS and _TARGETS[name][0] == "wheel_torque" else []
            if sums and not set(SHARES) & set(lines):
                lines += SHARES
            where = _sum_of(sums, table) if sums else "{column: NAME, unit: UNIT}   # no column found"
            lines.append(f"  # {name}: {where}")
    return "\n".join(lines) + "\n"


def shared_torques(table: Table, chosen: Pairs[str, Candidate]) -> list[str]:
    """Columns that may be torques of an engine or a brake, which several wheels share."""
    used = {one.column for one in chosen.values()}
    strong, parts, against = (set(text.split()) for text in SUM_WORDS)
    found = []
    for column in table.names:
        bare, unit = split_unit(column)
        words = [word.lower() for word in _WORDS.findall(bare)]
        unit = table.units.get(column, "") or unit
        fits = not unit or _becomes(unit, f"wheel_torque_{WHEELS[0]}_nm")
        if column in used or column in COLUMNS or not fits or _wheel_of(words) or against & set(words):
            continue
        if strong & set(words) and parts & set(words):
            found.append(column)
    return found


def _sum_of(columns: list[str], table: Table) -> str:
    """A sum of shares of these columns, to be filled in."""
    terms = []
    for column in columns:
        stated = table.units.get(column, "") or split_unit(column)[1]
        unit = "" if stated else ", unit: Nm"
        terms.append(f"{{column: {json.dumps(column, ensure_ascii=False)}{unit}, scale: SHARE}}")
    return f"{{sum: [{', '.join(terms)}]}}"


def _source(name: str, candidate: Candidate) -> str:
    column = json.dumps(candidate.column, ensure_ascii=False)
    unit = COLUMNS[name].unit.replace(" ", "")
    if _is_rim_speed(name, candidate.unit):
        return (
            f"{{column: {column}, radius_m: RADIUS}}   # in {candidate.unit}, a speed at the rim: its radius?"
        )
    if candidate.unit:
        return f"{{column: {column}}}   # in {candidate.unit}, as the file states"
    return f"{{column: {column}, unit: {unit}}}   # the file states no unit: is it {unit}?"


def _evidence(column: str, stated: str, name: str) -> float:
    """How much a column's name and unit speak for a column of the log format; 0 where something speaks against it."""
    bare, unit = split_unit(column)
    unit = stated or unit
    words = [word.lower() for word in _WORDS.findall(bare.rpartition(".")[2] or bare)]
    kind, wheel = _TARGETS[name]
    seen = _wheel_of(words)
    strong, weak, against = (set(text.split()) for text in QUANTITY_WORDS[kind])
    if wheel != seen or (unit and not _becomes(unit, name)) or against & set(words):
        return 0.0
    rest = [word for word in words if word not in WHEEL_WORDS.get(seen, "").split()]
    known = [word for word in rest if word in strong]
    if not known:
        return 0.0
    known += [word for word in rest if word in weak]
    return _PER_WORD * (len(known) + len(known) / max(len(rest), 1)) + _PER_UNIT * bool(unit)


def _wheel_of(words: list[str]) -> str:
    """The wheel that a name is of, "" where of none."""
    pairs = [*words, *("".join(pair) for pair in pairwise(words))]
    return next((wheel for wheel, known in WHEEL_WORDS.items() if set(known.split()) & set(pairs)), "")


def _becomes(unit: str, name: str) -> bool:
    if plain_unit(unit) in ("", "-"):
        return True
    return COLUMNS[name].unit in quantities(unit) or _is_rim_speed(name, unit)


def _is_rim_speed(name: str, unit: str) -> bool:
    return _TARGETS[name][0] == "wheel_speed" and bool(unit) and "m/s" in quantities(unit)


def _targets() -> Pairs[str, tuple[str, str]]:
    """Columns of the log format that are proposed, each with its kind of quantity and its wheel."""
    targets = {name: (name, "") for name in QUANTITY_WORDS if name in COLUMNS}
    for wheel in WHEELS:
        targets[f"wheel_torque_{wheel}_nm"] = ("wheel_torque", wheel)
        targets[f"wheel_speed_{wheel}_rad_s"] = ("wheel_speed", wheel)
    return targets


_TARGETS = _targets()
