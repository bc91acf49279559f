"""What does the camera add to TRPAC when a cruising car brakes on another road, over many seeds?

    python -m benchmarks.accuracy.cruise_and_brake [--seeds 10] [--first 1] [--out FILE.json]

Each seed is another world, other disturbances of the pictures and other sensor noise, with the built unit under fmpy.
The first table holds TRPAC at the onset of braking as median (least to greatest) over the seeds, the medians of its
interval's ends, in how many runs the interval holds the true friction, and the stopping distance planned from TRPAC at
15 m/s. The second table holds the median of TRPAC by distance after the border.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from benchmarks.report import markdown
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.brake_onset import Comparison, compare
from scenarios.files import Scenario, load_scenario

SCENARIOS = ("cruise_onto_snow", "cruise_onto_wet")
RUNS = ("with_camera", "without_camera")
END_S = 7.6
"""End of the drive, just after the onset of braking at 7.5 s [s]."""
AFTER_BORDER_M = (0.5, 2.0, 4.0, 6.0, 10.0, 15.0)
"""Distances of the wheel after the border in the second table [m]."""
ONSET_HEADS = (
    "road",
    "true",
    "run",
    "TRPAC",
    "interval",
    "holds the truth",
    "planned stop [m]",
    "road allows [m]",
)


def compared(scenario: Scenario, seed: int, unit: Path) -> Comparison:
    """One seed of a scenario, up to the onset of braking."""
    short = replace(scenario, seed=seed, end=scenario.end.model_copy(update={"time_s": END_S}))
    with tempfile.TemporaryDirectory(prefix="trpac_") as folder:
        return compare(short, unit, Path(folder))


def spread(values: Sequence[float], digits: int) -> str:
    """Median, least and greatest."""
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def onset_line(found: Sequence[Comparison], run: str) -> list[str]:
    """A row of the first table."""
    first, plans = found[0].onset, [getattr(c.onset, run) for c in found]
    low, high = ([getattr(p, end) for p in plans] for end in ("TRPAC_low", "TRPAC_high"))
    held = sum(p.TRPAC_low <= first.true_friction <= p.TRPAC_high for p in plans)
    return [
        first.surface,
        f"{first.true_friction:.2f}",
        run.replace("_", " "),
        spread([p.TRPAC for p in plans], 2),
        f"{np.median(low):.2f} to {np.median(high):.2f}",
        f"{held} of {len(plans)}",
        spread([p.planned_stop_m for p in plans], 0),
        f"{first.shortest_stop_m:.0f}",
    ]


def distance_line(found: Sequence[Comparison], run: str) -> list[str]:
    """A row of the second table."""
    medians = [
        np.median([np.interp(x, c.table["after_border_m"], c.table[f"TRPAC_{run}"]) for c in found])
        for x in AFTER_BORDER_M
    ]
    return [found[0].onset.surface, run.replace("_", " "), *(f"{value:.2f}" for value in medians)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10, help="seeds of each road")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--out", type=Path, help="JSON file for what every seed gave")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    onsets: list[list[str]] = []
    distances: list[list[str]] = []
    raw: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="trpac_") as folder:
        unit = build_unit(UNITS["TrpacEstimator"], Path(folder) / "TrpacEstimator.fmu")
        for name in SCENARIOS:
            scenario = load_scenario(name)
            found = [
                compared(scenario, seed, unit) for seed in track(seeds, name, disable=not sys.stderr.isatty())
            ]
            onsets += [onset_line(found, run) for run in RUNS]
            distances += [distance_line(found, run) for run in RUNS]
            raw += [comparison.onset.summary() for comparison in found]
    print(markdown(ONSET_HEADS, onsets))
    print()
    print(markdown(("road", "run", *(f"{x:g} m" for x in AFTER_BORDER_M)), distances))
    if options.out is not None:
        options.out.write_text(json.dumps(raw, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
