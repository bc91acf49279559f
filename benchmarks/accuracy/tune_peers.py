"""Tune the peers on drives of the paper's simulation: ``python -m benchmarks.accuracy.tune_peers``.

It writes scenarios/peers/tuning.yaml. The sweep `peers` judges the peers on other drives, see
lab/2026-11-29_fusion_over_many_drives.md.

A drive is the paper's (0.9 / 0.3 / 0.5, seed of the noise) or one with three frictions drawn by the seed. The objective
is the mean absolute error of theta where the front left tyre truly shows it (d mu / d theta of at least 0.1 at its true
slip), over the two slippery stretches, plus half of the mean absolute error on the grippy first one: an estimate
that sinks there because noise looks like sliding is worth as little as one that is late.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.optimize import minimize

from scenarios.files import RoadFile, RoadSegment, Scenario, load_scenario
from scenarios.peers import (
    EkfPeer,
    PeerSetup,
    SlipSlopePeer,
    SlipSlopeTuning,
    Tuning,
    UkfPeer,
    load_tuning,
)
from scenarios.peers.base import Peer
from scenarios.peers.tuning import TUNING_FILE, write_tuning
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from trpac_core.dife import LEAST_SENSITIVITY
from trpac_core.estimator import EstimatorConfig
from trpac_core.sensors import Sensors
from trpac_core.slip import GREATEST_SLIP
from trpac_core.tyre import friction_by_theta

Array = NDArray[np.float64]

SCENARIO = Path(__file__).parents[2] / "scenarios" / "paper_simulation.yaml"
COLUMNS = ["wheel_speed_fl_rad_s", "wheel_torque_fl_nm", "vehicle_speed_m_s", "accel_x_m_s2"]
TUNING_SEEDS = (3000, 3001, 3002, 3003)
"""Even seeds are the paper's road, odd ones draw their frictions."""
EVERY = 4
"""Of the 1 kHz log each so many samples while tuning (250 Hz)."""
GRIPPY_WEIGHT = 0.5
MOST_RUNS = 90
"""Of the objective, per peer."""
NOISE = ("torque_share", "acceleration_noise_m_s2", "theta_walk", "measurement_share")
BOUNDS = {
    "filter_s": (0.005, 0.05),
    "memory_s": (0.02, 2.0),
    "least_slip": (0.002, 0.02),
    "sliding_slip": (0.03, 0.2),
    "torque_share": (0.1, 100.0),
    "acceleration_noise_m_s2": (0.001, 1.0),
    "theta_walk": (0.002, 1.0),
    "measurement_share": (0.3, 10.0),
    "spread": (0.01, 4.0),
}
"""Where a value still means what it is called. Without bounds slip-slope goes to a filter of 1.1 s: it then
tells roads apart by when this one manoeuvre crosses them."""
TUNED = {
    SlipSlopePeer.name: ("slip_slope", ("filter_s", "memory_s", "least_slip", "sliding_slip"), SlipSlopePeer),
    EkfPeer.name: ("ekf", NOISE, EkfPeer),
    UkfPeer.name: ("ukf", (*NOISE, "spread"), UkfPeer),
}
"""By peer: its part of the tuning file, what is searched in it, its class."""
RANGES = {"dry": (0.7, 1.0), "snow_ice": (0.15, 0.35), "wet": (0.45, 0.65)}
"""Friction that each class is drawn from [-]."""


@dataclass(frozen=True)
class Drive:
    """A drive's readings, and the truth under the front left wheel; shape (n, 4), then (n,) each."""

    setup: PeerSetup
    step_s: float
    readings: Array
    theta: Array
    shown: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    segment: NDArray[np.int64]


def scenario_of(seed: int) -> Scenario:
    """The paper's scenario; with an odd seed its frictions are drawn."""
    scenario = replace(load_scenario(SCENARIO), seed=seed)
    if seed % 2 == 0:
        return scenario
    generator = np.random.default_rng(seed)
    order = ["dry", *generator.permutation(["snow_ice", "wet"])]
    segments = []
    for i, surface in enumerate(order):
        mu = round(float(generator.uniform(*RANGES[surface])), 3)
        segments.append(RoadSegment(start_m=20.0 * i, mu_left=mu, mu_right=mu, surface=surface))
    return replace(scenario, road=RoadFile(schema=1, segments=segments))


@lru_cache
def driven(seed: int, every: int) -> Drive:
    scenario = scenario_of(seed)
    trajectory = drive(scenario)
    log = make_scenario_log(scenario, trajectory).iloc[::every]
    car, noise = scenario.vehicle.to_core(), scenario.sensors
    theta, slip, load = (
        values[::every, 0] for values in (trajectory.theta, trajectory.slip, trajectory.vertical_load_n)
    )
    sensitivity = [
        friction_by_theta(t, min(s, GREATEST_SLIP), z, car.longitudinal_stiffness_n) if s > 0.0 else 0.0
        for t, s, z in zip(theta.tolist(), slip.tolist(), load.tolist(), strict=True)
    ]
    moving = trajectory.speed_m_s[::every] > EstimatorConfig.floor_m_s
    setup = PeerSetup(
        car,
        wheel_speed_noise_rad_s=noise.wheel_speed_noise_rad_s,
        vehicle_speed_noise_m_s=noise.vehicle_speed_noise_m_s,
        wheel_torque_noise_nm=noise.wheel_torque_noise_nm,
    )
    segment = np.cumsum(np.diff(theta, prepend=theta[0]) != 0.0)
    shown = (np.array(sensitivity) >= LEAST_SENSITIVITY) & moving
    return Drive(setup, every * scenario.step_s, log[COLUMNS].to_numpy(), theta, shown, moving, segment)


def run_peer(peer: Peer, d: Drive) -> Array:
    """Estimate over a drive [-]."""
    said = []
    for omega, torque, speed, acceleration in d.readings.tolist():
        sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        said.append(peer.step(d.step_s, sensors).TRPAC)
    return np.array(said)


def objective(theta: Array, d: Drive) -> float:
    error = np.abs(theta - d.theta)
    slippery = [
        error[d.shown & (d.segment == i)].mean() for i in (1, 2) if (d.shown & (d.segment == i)).any()
    ]
    return float(np.mean(slippery) + GRIPPY_WEIGHT * error[d.moving & (d.segment == 0)].mean())


def calibrated(tuning: SlipSlopeTuning, drives: Sequence[Drive]) -> SlipSlopeTuning:
    """The tuning with the line through slopes and frictions of these drives; each stretch counts the same."""
    slopes, thetas, weights = [], [], []
    for d in drives:
        peer, rows = SlipSlopePeer(d.setup, tuning), []
        for k, (omega, torque, speed, acceleration) in enumerate(d.readings.tolist()):
            sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
            if peer.step(d.step_s, sensors).excited and peer.slope is not None:
                rows.append((k, peer.slope))
        if not rows:
            continue
        index, slope = np.array(rows).T
        segment = d.segment[index.astype(int)]
        slopes.append(slope)
        thetas.append(d.theta[index.astype(int)])
        weights.append(1.0 / np.bincount(segment)[segment])
    if not slopes:
        return tuning
    slope, theta, weight = (np.concatenate(parts) for parts in (slopes, thetas, weights))
    gain, intercept = np.polyfit(slope, theta, 1, w=np.sqrt(weight))
    rest = theta - intercept - gain * slope
    deviation = float(np.sqrt(np.average(rest**2, weights=weight)))
    return replace(tuning, gain=float(gain), intercept=float(intercept), map_deviation=deviation)


def tune(
    name: str,
    start: object,
    free: Sequence[str],
    finish: Callable,
    drives: Sequence[Drive],
    peer: type,
):
    """Nelder-Mead on the logarithms of the free values; also the objective at the start, at the end, and the runs."""
    best: list = [np.inf, start]
    first: list[float] = []

    def cost(logs: Array) -> float:
        tuning = finish(replace(start, **dict(zip(free, np.exp(logs).tolist(), strict=True))))
        try:
            value = float(np.mean([objective(run_peer(peer(d.setup, tuning), d), d) for d in drives]))
        except np.linalg.LinAlgError:  # sigma points of a covariance that is none any more
            value = 10.0
        first.append(value)
        if value < best[0]:
            best[:] = [value, tuning]
        print(f"\r{name}: {len(first)} runs, objective {best[0]:.4f} ", end="", file=sys.stderr, flush=True)
        return value

    logs = np.log([getattr(start, n) for n in free])
    simplex = np.vstack([logs, *(logs + 0.8 * row for row in np.eye(len(free)))])
    bounds = [tuple(np.log(BOUNDS[n])) for n in free]
    options = {"maxfev": MOST_RUNS, "initial_simplex": simplex, "fatol": 1e-4, "xatol": 0.02}
    minimize(cost, logs, method="Nelder-Mead", bounds=bounds, options=options)
    print(file=sys.stderr)
    return best[1], {"start": round(first[0], 4), "end": round(best[0], 4), "runs": len(first)}


def tune_peers(path: Path) -> None:
    """Tune the peers from where the file stands, or from the defaults; the file is written after each."""
    drives = [driven(seed, EVERY) for seed in TUNING_SEEDS]
    known = load_tuning(path) if path.is_file() else Tuning()
    how = yaml.safe_load(path.read_text(encoding="utf-8"))["how"] if path.is_file() else {}
    how |= {
        "scenario": SCENARIO.name,
        "seeds": list(TUNING_SEEDS),
        "rate_hz": round(1.0 / drives[0].step_s),
        "method": "Nelder-Mead on logarithms (scipy.optimize.minimize)",
        "objective": "mean abs error where the tyre shows theta, mean of both slippery stretches, "
        f"plus {GRIPPY_WEIGHT} times that on the grippy one",
    }
    for name, (attribute, free, peer) in TUNED.items():
        finish = (lambda t: calibrated(t, drives)) if name == SlipSlopePeer.name else (lambda t: t)
        start = time.process_time()
        tuned, found = tune(name, getattr(known, attribute), free, finish, drives, peer)
        known = replace(known, **{attribute: tuned})
        found["cpu_s"] = round(time.process_time() - start)
        how.setdefault("runs_by_peer", {}).setdefault(attribute, []).append(found)
        write_tuning(path, known, how)
    print(path.read_text())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=TUNING_FILE, help="file to write (default: %(default)s)")
    tune_peers(parser.parse_args().out)


if __name__ == "__main__":
    main()
