"""Learns how much the builds of cars differ, and writes it to `sim2real/discrepancy/prior.json`.

Cars without a fault are drawn and recorded; what the nominal model leaves of each is a sum of the changes that
`sim2real.discrepancy.columns` knows. Their covariance over all cars is found by expectation maximisation.

python -m benchmarks.gap.builds.learn --cars 160
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from benchmarks.gap.builds.draw import COURSES, write_case
from sim2real.discrepancy.beside import Stack, stack_of
from sim2real.discrepancy.prior import PRIOR
from sim2real.discrepancy.ridge import scale_beside, weighed
from sim2real.observing.evidence import gather
from sim2real.observing.observer import Simulation
from sim2real.sources import read_sources

Array = NDArray[np.float64]

FIRST_SEED = 20_000
WIDTH = {
    "stiffness by load": 1.0,
    "relaxation": 0.05,
    "pitch": 0.03,
    "resistance": 0.02,
    "resistance over speed squared": 0.02,
    "share of acceleration": 0.01,
    "share of braking": 0.01,
    "inertia": 0.1,
    "radius": 0.002,
    "radius, front against rear": 0.002,
    "friction": 0.12,
    "fall": 0.5,
}
"""Standard deviations that the search begins with and is held to by as much as `HELD` cars, each in its unit."""
SLIP_WIDTH = {0.1: 0.18, 0.3: 0.22, 0.5: 0.38, 0.7: 0.6, 0.9: 0.9}
"""The same of the slip's share over used grip [-]."""
HELD = 10.0
"""Cars that the first guess counts as."""
ROUNDS = 60
"""Rounds of expectation and maximisation."""


@dataclass(frozen=True)
class Told:
    """What one car's logs tell of its changes: information and its product with their values, in first widths."""

    names: tuple[str, ...]
    information: Array
    product: Array


def width_of(name: str) -> float:
    """First standard deviation of a change, in its unit."""
    return SLIP_WIDTH[float(name.split()[-1])] if name.startswith("slip") else WIDTH[name]


def told_by(seed: int, course: str) -> Told | None:
    """What the logs of a drawn car tell; None where the drive could not be made."""
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        try:
            write_case(at, seed, "", course)
        except ValueError:
            return None
        files = read_sources(
            at / "vehicle.yaml",
            at / "road_fit.yaml",
            [str(at / "fit.csv")],
            f"{at / 'holdout.csv'}@{at / 'road_holdout.yaml'}",
        )
    model = Simulation(files.vehicle)
    fit_to, held = gather(model, [files.fit[0].drive]), gather(model, [files.holdout.drive])
    return _information(stack_of(model, fit_to, held))


def _information(stack: Stack) -> Told:
    width = np.array([width_of(name) for name in stack.names])
    columns = stack.changes * width
    scale, rest = scale_beside(stack.z, columns, stack.limit)
    rows = weighed(np.concatenate([columns, stack.z[..., None]], axis=-1), rest, scale.size, scale.memory)
    design, wanted = rows[:, :-1], rows[:, -1]
    return Told(stack.names, design.T @ design, -(design.T @ wanted))


def covariance_of(cars: list[Told]) -> tuple[tuple[str, ...], Array]:
    """Names of all changes, and their covariance over the cars, each in its unit."""
    names = tuple(dict.fromkeys(name for car in cars for name in car.names))
    count = len(names)
    covariance = np.eye(count)
    for _ in range(ROUNDS):
        total = HELD * np.eye(count)
        for car in cars:
            at = [names.index(name) for name in car.names]
            own = covariance[np.ix_(at, at)] + 1e-9 * np.eye(len(at))
            root = np.linalg.cholesky(own)
            left = root @ np.linalg.solve(np.eye(len(at)) + root.T @ car.information @ root, root.T)
            onto = np.linalg.solve(own, covariance[at]).T
            mean = onto @ (left @ car.product)
            spread = covariance - onto @ covariance[at] + onto @ left @ onto.T
            total += np.outer(mean, mean) + 0.5 * (spread + spread.T)
        covariance = total / (len(cars) + HELD)
    width = np.array([width_of(name) for name in names])
    return names, covariance * np.outer(width, width)


def main() -> None:
    """Draw, learn, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cars", type=int, default=160)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + asked.cars)
    work = (delayed(told_by)(seed, COURSES[seed % len(COURSES)]) for seed in seeds)
    found = [car for car in Parallel(n_jobs=asked.jobs)(work) if car is not None]
    names, covariance = covariance_of(found)
    rounded = [[float(f"{value:.4g}") for value in row] for row in covariance]
    content = {"cars": len(found), "first_seed": FIRST_SEED, "names": names, "covariance": rounded}
    PRIOR.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for name, sd in zip(names, np.sqrt(np.diag(covariance)), strict=True):
        print(f"{name:32s} {sd:.3g}")


if __name__ == "__main__":
    main()
