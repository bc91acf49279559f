"""Effect of a wrong description, noisier sensors or a biased speed on DE, DIFE and TRPAC_std. Prints JSON.

.venv/bin/python -m benchmarks.accuracy.wrong_cars
"""

import argparse
import json

import numpy as np

from benchmarks.accuracy.random_drives import CarError, estimated, make_drive, told

CASES: dict[str, tuple[CarError, float]] = {
    "as told": (CarError(), 1.0),
    **{f"mass {s:+.0%}": (CarError(mass=s), 1.0) for s in (-0.1, -0.05, 0.05, 0.1)},
    **{f"radius {s:+.0%}": (CarError(radius=s), 1.0) for s in (-0.1, -0.05, 0.05, 0.1)},
    **{f"stiffness {s:+.0%}": (CarError(stiffness=s), 1.0) for s in (-0.1, -0.05, 0.05, 0.1)},
    **{f"torque {s:+.0%}": (CarError(torque=s), 1.0) for s in (-0.1, -0.05, 0.05, 0.1)},
    **{f"noise x {n:g}": (CarError(), n) for n in (3.0, 10.0)},
    **{f"speed {b:+.3f} m/s": (CarError(speed_bias_m_s=b), 1.0) for b in (-0.05, -0.014, 0.014, 0.05)},
}


def measure(error: CarError, noise: float, seeds: range) -> dict[str, float | None]:
    """Mean error over the last third of what the tyre shows on each slippery stretch, and the coverage of all rows."""
    late: dict[str, list[float]] = {"DE": [], "DIFE": []}
    within, shares = [], []
    for seed in seeds:
        drive = make_drive(seed, error, noise)
        theta_hat, alone, _, std = estimated(drive, told(noise)).T
        shown = np.diff(alone, prepend=alone[0]) != 0.0
        moving = drive.rows[:, 2] > 1.0
        within.append((np.abs(theta_hat - drive.theta) <= 2.0 * std)[moving].mean())
        for theta in np.unique(drive.theta[drive.theta < 0.7]):
            here = np.flatnonzero((drive.theta == theta) & shown)
            shares.append(len(here) / max(1, np.count_nonzero(drive.theta == theta)))
            last = here[-(len(here) // 3) :] if len(here) >= 30 else here[:0]
            for name, found in (("DE", alone), ("DIFE", theta_hat)):
                late[name] += [float(np.abs(found[last] - theta).mean())] if len(last) else []
    errors = {name: round(float(np.mean(values)), 4) if values else None for name, values in late.items()}
    return {
        **errors,
        "shown_share": round(float(np.mean(shares)), 3),
        "within_2_std": round(float(np.mean(within)), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--drives", type=int, default=10)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.drives)
    for name, (error, noise) in CASES.items():
        print(json.dumps({"case": name, **measure(error, noise, seeds)}), flush=True)


if __name__ == "__main__":
    main()
