"""Is TRPAC_std honest? Share of true values within 2 TRPAC_std over random drives; prints JSON.

.venv/bin/python -m benchmarks.accuracy.std            # judged: seeds 2000 to 2199
.venv/bin/python -m benchmarks.accuracy.std --first 1000   # those that the constants were settled on
"""

import argparse
import json
from typing import Any

import numpy as np

from benchmarks.accuracy.random_drives import CarError, estimated, make_drive, told

EVERY = 10  # rows between two that count
MOVING_M_S = 1.0
SETS: dict[str, tuple[CarError | None, bool]] = {
    "tolerances, with camera": (None, True),
    "as told, with camera": (CarError(), True),
    "tolerances, no camera": (None, False),
}


def measure(error: CarError | None, camera: bool, seeds: range) -> dict[str, Any]:
    parts = []
    for seed in seeds:
        drive = make_drive(seed, error)
        found = estimated(drive, told(drive.noise), camera)
        moving = drive.rows[:, 2] > MOVING_M_S
        rows = np.flatnonzero(moving)[::EVERY]
        shown = (
            np.diff(found[:, 1], prepend=found[0, 1]) != 0.0
        )  # without a camera only the tyre moves the estimate
        parts.append(np.column_stack([found[rows], drive.theta[rows], shown[rows]]))
    theta_hat, _, excited, std, theta, shown = np.concatenate(parts).T
    error_abs = np.abs(theta_hat - theta)
    result: dict[str, Any] = {"drives": len(seeds), "samples": len(theta)}
    masks = {
        "all": np.ones(len(theta), bool),
        "excited": excited > 0,
        "unexcited": excited == 0,
        "tyre shows theta": shown > 0,
        "tyre shows theta, snow_ice": (shown > 0) & (theta < 0.4),
        "tyre shows theta, wet": (shown > 0) & (theta >= 0.4) & (theta < 0.7),
        "dry": theta >= 0.7,
        "wet": (theta >= 0.4) & (theta < 0.7),
        "snow_ice": theta < 0.4,
    }
    for name, mask in masks.items():
        result[name] = {
            "share": round(float(mask.mean()), 3),
            "within_2_std": round(float((error_abs <= 2.0 * std)[mask].mean()), 4),
            "median_std": round(float(np.median(std[mask])), 4),
            "median_error": round(float(np.median(error_abs[mask])), 4),
        }
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--only", help="the set whose name contains this")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.drives)
    found = {
        name: measure(error, camera, seeds)
        for name, (error, camera) in SETS.items()
        if options.only is None or options.only in name
    }
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
