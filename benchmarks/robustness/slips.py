"""Slips of unit, sign, scale and time base in one column of a log: is each refused, or warned of by name?

python -m benchmarks.robustness.slips [--slips 500] [--clean 100] [--seed 1]

The clean logs are drives of the reference plant as cars of a drawn build (`benchmarks.gap.builds`); of none of them may
there be a warning. Prints a table, and each slip that passed and each warning of a clean log.
"""

from __future__ import annotations

import argparse
from collections import Counter
from math import pi

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.gap.builds.draw import (
    COURSES,
    draw_build,
    draw_noise,
    draw_nominal,
    draw_road,
    draw_torque,
    real_car,
    record,
)
from sim2real.logs import LogError, log_of_frame
from trpac_core.vehicle import WHEELS

SECONDS = 20.0
UNITS = (
    {
        "time_s": {"ms": 1e3, "us": 1e6, "min": 1 / 60, "ns": 1e9},
        "vehicle_speed_m_s": {"km/h": 3.6, "mph": 2.23694, "kn": 1.94384, "ft/s": 3.28084},
        "accel_x_m_s2": {"g": 1 / 9.80665, "ft/s2": 3.28084, "cm/s2": 100.0, "mg": 1e3 / 9.80665},
        "position_m": {"km": 1e-3, "ft": 3.28084, "mi": 1 / 1609.344, "cm": 100.0},
    }
    | {f"wheel_torque_{w}_nm": {"kNm": 1e-3, "lbf ft": 0.737562, "lbf in": 8.85075} for w in WHEELS}
    | {
        f"wheel_speed_{w}_rad_s": {"rpm": 30 / pi, "deg/s": 180 / pi, "rev/s": 0.5 / pi, "m/s": 0.3}
        for w in WHEELS
    }
)
"""Columns, and units that they may be in, each with the factor from the log format's unit."""
LEAST = 1.5
"""Least factor of a slip, or one over it."""


def clean_log(seed: int) -> pd.DataFrame:
    """The log of one drive of a drawn car."""
    rng = np.random.default_rng(seed)
    nominal = draw_nominal(rng)
    build, noise = draw_build(rng, nominal), draw_noise(rng)
    course = COURSES[seed % len(COURSES)]
    road = draw_road(rng, course)
    drive = draw_torque(rng, course, nominal, road, SECONDS)
    return record(real_car(nominal, build, None), road, drive, build, noise, seed)


def slipped(frame: pd.DataFrame, rng: np.random.Generator) -> tuple[pd.DataFrame, str, str]:
    """A log with a slip in one column, the column, and the slip."""
    column = str(rng.choice(list(UNITS)))
    kinds = ["unit", "scale"] if column == "time_s" else ["unit", "sign", "scale"]
    kind = str(rng.choice(kinds))
    if kind == "sign":
        factor, what = -1.0, "sign"
    elif kind == "unit":
        units = {unit: f for unit, f in UNITS[column].items() if not 1.0 / LEAST < f < LEAST}
        what = str(rng.choice(list(units)))
        factor = units[what]
    else:
        factor = float(np.exp(rng.uniform(np.log(LEAST), np.log(10.0)))) ** float(rng.choice([-1.0, 1.0]))
        what = f"times {factor:.3g}"
    return frame.assign(**{column: frame[column] * factor}), column, f"{kind}: {what}"


def told(frame: pd.DataFrame) -> tuple[str, ...]:
    """The warnings of a log, or the problems for which it is refused."""
    try:
        return log_of_frame(frame).warnings
    except LogError as error:
        return tuple(str(error).splitlines())


def main() -> None:
    """Run the slips and the clean logs, and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--slips", type=int, default=500)
    parser.add_argument("--clean", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    console = Console()
    alarms = []
    counts: dict[str, Counter[str]] = {}
    per_log = -(-asked.slips // asked.clean)
    left = asked.slips
    for i in track(range(asked.clean), "logs"):
        frame = clean_log(1000 * asked.seed + i)
        alarms += [f"clean log {i}: {text}" for text in told(frame)]
        for _ in range(min(per_log, left)):
            left -= 1
            wrong, column, slip = slipped(frame, rng)
            texts = told(wrong)
            every = column == "time_s" and any(
                "comes at" in text or "long; expected" in text for text in texts
            )
            how = "named" if every or any(column in text for text in texts) else "told" if texts else "passed"
            counts.setdefault(column, Counter())[how] += 1
            if how != "named":
                console.print(f"log {i}, {column}, {slip}: {how} {texts}", markup=False)
    table = Table("column", "named", "told without its name", "passed")
    for column, count in counts.items():
        table.add_row(column, *(str(count[how]) for how in ("named", "told", "passed")))
    console.print(table)
    for text in alarms:
        console.print(text, markup=False)
    console.print(f"{len(alarms)} warnings of {asked.clean} clean logs")


if __name__ == "__main__":
    main()
