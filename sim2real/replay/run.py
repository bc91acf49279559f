"""The estimators of four wheels over the rows of a log."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim2real.replay.camera import NO_CAMERA, CameraSide
from sim2real.replay.inputs import Inputs
from sim2real.replay.vehicle_level import vehicle_level
from trpac_core.estimator import Estimate, EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.robust.messages import WRONG_INPUT
from trpac_core.sensors import Sensors
from trpac_core.tyre import peak_friction
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OURS, DYNAMICS = EstimatorConfig().method.title, "DE"
TOLD_EVERY = 2000
"""Rows between two reports of progress."""

Told = Callable[[str, int, int], None]


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody is told."""


@dataclass(frozen=True)
class Trace:
    """One estimator along a log.

    Attributes
    ----------
    theta, std, peak : array, shape (n, 4)
        TRPAC, its standard deviation (NaN where it has none) and TRPAC_peak of fl, fr, rl, rr [-].
    excited : array of bool, shape (n, 4)
        Its own excitation flag.
    load_n : array, shape (n, 4)
        Vertical loads [N].
    """

    theta: Array
    std: Array
    peak: Array
    excited: Mask
    load_n: Array

    @cached_property
    def of_the_car(self) -> tuple[Array, Array, Array]:
        """TRPAC, its deviation and TRPAC_peak for the car, shape (n,) each [-]."""
        known = np.isfinite(self.std).all()
        std = self.std if known else np.ones_like(self.theta)
        theta, of_theta = vehicle_level(self.theta, std, self.load_n)
        peak, _ = vehicle_level(self.peak, std, self.load_n)
        return theta, of_theta if known else np.full(len(theta), np.nan), peak

    @property
    def peak_std(self) -> Array:
        """Standard deviation of TRPAC_peak, shape (n, 4): the curve's maximum is nearly proportional to theta [-]."""
        return self.std * self.peak / self.theta


@dataclass(frozen=True)
class Replay:
    """All estimators along a log; wheel columns are fl, fr, rl, rr.

    Attributes
    ----------
    inputs, camera : Inputs, CameraSide
        What they were told.
    traces : dict
        By name: ours by its method's title, DE, and the peers that were asked for.
    flag, seen, usable : array of bool, shape (n, 4)
        The camera's verdict is used; the tyre moved the estimate; the readings were usable.
    K_v, slip, used_friction : array, shape (n, 4)
        Of ours.
    low, high, expected, expected_std : array, shape (n, 4)
        Bounds of the interval, mean and deviation of what the road's TRPAC may be, of ours [-].
    source : array of int, shape (n, 4)
        `Source` of ours.
    method : Method
        Of ours.
    messages : tuple of str
        Warnings about a car that differs from its description.
    """

    inputs: Inputs
    camera: CameraSide
    traces: dict[str, Trace]
    flag: Mask
    seen: Mask
    usable: Mask
    K_v: Array
    slip: Array
    used_friction: Array
    low: Array
    high: Array
    expected: Array
    expected_std: Array
    source: NDArray[np.int_]
    method: Method
    messages: tuple[str, ...]

    @property
    def ours(self) -> Trace:
        """Our estimator."""
        return self.traces[self.method.title]

    @cached_property
    def of_the_car(self) -> dict[str, Array]:
        """Interval, mean and deviation for the car by column of estimates.csv, shape (n,) each [-]."""
        std, load_n = self.ours.std, self.ours.load_n
        expected, expected_std = vehicle_level(self.expected, self.expected_std, load_n)
        return {
            "TRPAC_low": vehicle_level(self.low, std, load_n)[0],
            "TRPAC_high": vehicle_level(self.high, std, load_n)[0],
            "TRPAC_expected": expected,
            "TRPAC_expected_std": expected_std,
        }

    @cached_property
    def source_of_the_car(self) -> NDArray[np.int_]:
        """`Source` of all wheels together, shape (n,)."""
        return np.bitwise_or.reduce(self.source, axis=1)


def replay(
    inputs: Inputs,
    camera: CameraSide = NO_CAMERA,
    peers: bool = False,
    told: Told = silent,
    method: Method = Method.ROBUST,
) -> Replay:
    """Run our estimator and DE, and the peers where asked for, on all four wheels.

    Parameters
    ----------
    inputs, camera : Inputs, CameraSide
        From `make_inputs` and `camera_side`.
    peers : bool
        Whether the estimators of the literature run as well.
    told : callable
        Told the stage, and how many of how many rows are done.
    method : Method
        Of our estimator.
    """
    wheels = [_our_wheel(inputs, camera, i, told, method) for i in range(len(WHEELS))]
    columns = [said for said, _ in wheels]
    messages: dict[str, str] = {}
    for _, of_wheel in wheels:
        for about, text in of_wheel.items():
            messages.setdefault(about, text)

    def of(name: str) -> Array:
        return np.array([[getattr(e, name) for e in column] for column in columns], dtype=np.float64).T

    load_n = inputs.load_n()
    theta, alone, excited = of("TRPAC"), of("TRPAC_dynamics"), of("excitation_flag") > 0.0
    ours = Trace(theta, of("TRPAC_std"), of("TRPAC_peak"), excited, load_n)
    dynamics = ours
    if camera.left or camera.right or method is Method.ROBUST:
        peak = _peaks(alone, load_n, inputs.vehicle.longitudinal_stiffness_n)
        dynamics = Trace(alone, np.full_like(alone, np.nan), peak, excited, load_n)
    traces = {method.title: ours, DYNAMICS: dynamics}
    if peers:
        traces |= _peer_traces(inputs, load_n, told)
    moved = np.diff(alone, axis=0, prepend=EstimatorConfig.theta_initial) != 0.0
    return Replay(
        inputs=inputs,
        camera=camera,
        traces=traces,
        flag=of("flag") > 0.0,
        seen=excited & moved,
        usable=np.array([[e.problem is None for e in column] for column in columns]).T,
        K_v=of("K_v"),
        slip=of("slip"),
        used_friction=np.abs(of("tyre_force_n")) / load_n,
        low=of("TRPAC_low"),
        high=of("TRPAC_high"),
        expected=of("TRPAC_expected"),
        expected_std=of("TRPAC_expected_std"),
        source=of("source").astype(int),
        method=method,
        messages=_trusted(messages),
    )


def _our_wheel(
    inputs: Inputs, camera: CameraSide, wheel: int, told: Told, method: Method
) -> tuple[list[Estimate], dict[str, str]]:
    """Our estimator on one wheel, and the last of its messages by what they concern."""
    name = WHEELS[wheel]
    config = EstimatorConfig(
        vehicle=inputs.vehicle,
        front_axle=name.startswith("f"),
        left_side=name.endswith("l"),
        preview=camera.preview,
        sliding_speed_noise_m_s=float(inputs.noise.sliding_speed_m_s[wheel]),
        method=method,
    )
    estimator, frames, said = TrpacEstimator(config), camera.of(name.endswith("l")), []
    messages: dict[str, str] = {}
    step_s = inputs.step_s
    for row, sensors in enumerate(readings(inputs, wheel)):
        frame = frames.get(row)
        said.append(estimator.step(step_s, sensors, frame, frame_failed=row in frames and frame is None))
        messages |= estimator.messages()
        _tell(told, f"estimator {name}", row + 1, len(inputs))
    return said, messages


def _trusted(messages: dict[str, str]) -> tuple[str, ...]:
    """The messages without those that name values of an axle whose readings are said to be wrong."""
    wrong = {about.split()[0] for about, text in messages.items() if text.endswith(WRONG_INPUT)}
    return tuple(
        text
        for about, text in messages.items()
        if text.endswith(WRONG_INPUT) or about.split()[0] not in wrong
    )


def _peer_traces(inputs: Inputs, load_n: Array, told: Told) -> dict[str, Trace]:
    """All peers on all wheels."""
    from scenarios.peers import PEER_NAMES, PeerSetup, make_peers  # their filters are an extra

    said = np.zeros((len(PEER_NAMES), len(WHEELS), len(inputs), 3))
    noise = inputs.noise
    for wheel, name in enumerate(WHEELS):
        setup = PeerSetup(
            inputs.vehicle,
            front_axle=name.startswith("f"),
            wheel_speed_noise_rad_s=noise.wheel_speed_rad_s,
            vehicle_speed_noise_m_s=noise.vehicle_speed_m_s,
        )
        peers = make_peers(setup)
        for row, sensors in enumerate(readings(inputs, wheel)):
            for i, peer in enumerate(peers):
                e = peer.step(inputs.step_s, sensors)
                said[i, wheel, row] = e.TRPAC, e.TRPAC_std, e.excited
            _tell(told, f"peers {name}", row + 1, len(inputs))
    stiffness_n = inputs.vehicle.longitudinal_stiffness_n
    return {
        name: Trace(
            theta=of[:, :, 0].T,
            std=of[:, :, 1].T,
            peak=_peaks(of[:, :, 0].T, load_n, stiffness_n),
            excited=of[:, :, 2].T > 0.0,
            load_n=load_n,
        )
        for name, of in zip(PEER_NAMES, said, strict=True)
    }


def readings(inputs: Inputs, wheel: int) -> Sequence[Sensors]:
    """What a wheel's sensors read, row by row, the speed that of the road under the wheel; NaN is a lost sample."""
    accel = [None] * len(inputs) if inputs.accel_m_s2 is None else inputs.accel_m_s2.tolist()
    columns = (
        inputs.wheel_speed_rad_s[:, wheel].tolist(),
        inputs.wheel_torque_nm[:, wheel].tolist(),
        inputs.local_speed_m_s[:, wheel].tolist(),
        inputs.steering_angle_rad.tolist(),
        accel,
        [None if math.isnan(yaw) else yaw for yaw in inputs.yaw_rate_rad_s.tolist()],
    )
    return [
        Sensors(omega, torque, speed, None, steering, acceleration, yaw)
        for omega, torque, speed, steering, acceleration, yaw in zip(*columns, strict=True)
    ]


def _peaks(theta: Array, load_n: Array, stiffness_n: float) -> Array:
    """TRPAC_peak of estimates, shape of `theta` [-]."""
    flat = zip(theta.ravel().tolist(), load_n.ravel().tolist(), strict=True)
    return np.array([peak_friction(t, z, stiffness_n) for t, z in flat]).reshape(theta.shape)


def _tell(told: Told, stage: str, done: int, total: int) -> None:
    if done % TOLD_EVERY == 0 or done == total:
        told(stage, done, total)
