"""The reference plant as the car on the bus, in real time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.files import SensorNoise, load_scenario
from scenarios.library import shipped
from trpac_core.vehicle import WHEELS
from trpac_hil.bus import BUS_ERRORS, BusSettings, Link
from trpac_hil.bus_relay import RelayedBus
from trpac_hil.codec import DBC_FILE, Codec, load_codec
from trpac_hil.deadlines import Deadlines, SystemClock, wait_until
from trpac_hil.driver import EndlessDrive
from trpac_hil.helper import Control, helper
from trpac_hil.realtime import raise_priority
from trpac_hil.shared import Ring

PLAIN_SCENARIO = shipped("scenario")["paper_simulation"]
SLOW_NS = 10_000_000
"""Cycle of the messages Chassis and PlantTruth [ns]."""
P_0_M = 2.5
"""Distance ahead of the front axle whose surface the plant's camera reports [m]."""
CONFIDENCE = 0.9
"""Q_v that the plant's camera reports [-]."""


@dataclass(frozen=True)
class PlantJob:
    """Settings of the plant on the bus.

    Attributes
    ----------
    scenario : Path
        Car, road and sensor noise.
    bus : BusSettings
        Its bus.
    dbc : Path
        DBC file of its messages.
    rate_hz : float
        Rate of the plant's steps and of the fast messages [Hz].
    camera_fps, camera_delay_s : float
        Results per second of a camera on the bus, 0 for none [1/s], and their delay [s].
    core : int or None
        The loop's core, which this process does not use.
    realtime : bool
        Whether to ask for real-time priority: a car on another machine would not be delayed by the camera either.
    """

    scenario: Path = PLAIN_SCENARIO
    bus: BusSettings = BusSettings()  # noqa: RUF009 - frozen
    dbc: Path = DBC_FILE
    rate_hz: float = 1000.0
    camera_fps: float = 20.0
    camera_delay_s: float = 0.06
    core: int | None = None
    realtime: bool = False


@dataclass(frozen=True)
class _Picture:
    number: int
    captured_ns: int
    classes: tuple[int, int]


class PlantNode:
    """The plant with its sensors and camera, and their messages; raises ScenarioError and HilError."""

    def __init__(self, job: PlantJob, open_link: Callable[[], Any], clock: SystemClock) -> None:
        scenario = load_scenario(job.scenario)
        self.drive = EndlessDrive(scenario, 1.0 / job.rate_hz)
        self.left_out = 0
        self._job, self._clock = job, clock
        self._codec: Codec = load_codec(job.dbc)
        self._noise, self._random = scenario.sensors, np.random.default_rng(scenario.seed)
        self._sent: dict[str, int] = {}
        self._pictures: deque[_Picture] = deque()
        self._next_slow_ns = 0
        self._link = open_link()  # last: what is refused before leaves no open bus

    def run(self, start_ns: int, stop: Callable[[], bool], slots: int | None = None) -> None:
        """Drive in real time until `stop` returns True, or for a number of slots."""
        deadlines = Deadlines(start_ns, round(1e9 / self._job.rate_hz))
        done, picture = -1, -1
        cameras = Deadlines(start_ns, round(1e9 / self._job.camera_fps)) if self._job.camera_fps else None
        while not stop() and (slots is None or done + 1 < slots):
            now_ns = wait_until(self._clock, deadlines.due_ns(done + 1), 0)
            slot = deadlines.next_slot(done, now_ns)
            self.left_out += slot - done - 1
            self.drive.advance(slot - done)
            done = slot
            self._link.receive()
            self._send_fast()
            if now_ns >= self._next_slow_ns:
                self._next_slow_ns = now_ns + SLOW_NS
                self._send_slow()
            if cameras is not None and now_ns >= cameras.due_ns(picture + 1):
                picture = cameras.next_slot(picture, now_ns)
                left, right = self.drive.surfaces_ahead(P_0_M)
                self._pictures.append(_Picture(picture, now_ns, (int(left), int(right))))
            self._send_pictures(now_ns)

    def close(self) -> None:
        """Close the bus."""
        self._link.close()

    def _send_fast(self) -> None:
        noise: SensorNoise = self._noise
        random = self._random.standard_normal(10).tolist()
        now = self.drive.now
        speeds, torques = now.wheel_speed_rad_s, now.wheel_torque_nm
        self._send(
            "WheelSpeeds",
            {
                f"WheelSpeed_{w.upper()}": speeds[i] + noise.wheel_speed_noise_rad_s * random[i]
                for i, w in enumerate(WHEELS)
            },
        )
        self._send(
            "WheelTorques",
            {
                f"WheelTorque_{w.upper()}": torques[i] + noise.wheel_torque_noise_nm * random[4 + i]
                for i, w in enumerate(WHEELS)
            },
        )
        self._send(
            "VehicleMotion",
            {
                "VehicleSpeed": now.speed_m_s + noise.vehicle_speed_noise_m_s * random[8],
                "AccelX": now.accel_x_m_s2 + noise.accel_x_noise_m_s2 * random[9],
            },
        )

    def _send_slow(self) -> None:
        theta = self.drive.now.theta
        self._send("PlantTruth", {f"Theta_{w.upper()}": theta[i] for i, w in enumerate(WHEELS)})

    def _send_pictures(self, now_ns: int) -> None:
        delay_ns = round(self._job.camera_delay_s * 1e9)
        while self._pictures and now_ns - self._pictures[0].captured_ns >= delay_ns:
            picture = self._pictures.popleft()
            left, right = picture.classes
            self._send(
                "RoadClass",
                {
                    "RoadClass_Left": left,
                    "RoadClass_Right": right,
                    "RoadClassConfidence_Left": CONFIDENCE,
                    "RoadClassConfidence_Right": CONFIDENCE,
                    "RoadClass_Age": (now_ns - picture.captured_ns) * 1e-6,
                    "RoadClass_Number": picture.number % 256,
                },
            )

    def _send(self, name: str, values: dict[str, float]) -> None:
        coded, count = self._codec[name], self._sent.get(name, 0)
        self._sent[name] = count + 1
        message = coded.message
        self._link.send(message.frame_id, message.is_extended_frame, coded.encode(values, count))


def open_plant_node(job: PlantJob, report: Callable[[str, str], None], wire: Ring | None = None) -> PlantNode:
    """The plant on its own link to the bus, or relayed through `wire`; raises ScenarioError and HilError."""
    return PlantNode(
        job, lambda: Link(job.bus.open, report) if wire is None else RelayedBus(wire), SystemClock()
    )


def play(job: PlantJob, wire: Ring | None, control: Control) -> None:
    """Body of a process that drives until the loop ends; without `wire` it opens the bus itself."""
    with helper(job.core):
        try:
            node = open_plant_node(job, control.send, wire)
        except (ScenarioError, *BUS_ERRORS) as error:
            control.refuse(str(error))
            return
        if job.realtime:
            raise_priority()
        control.ready()
        if control.wait_for_start():
            node.run(control.start_ns, lambda: control.stopped)
        node.close()
