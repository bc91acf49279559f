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
from trpac_hil.bus import BUS_ERRORS, BusSettings, Link, no_fd
from trpac_hil.bus_relay import RelayedBus
from trpac_hil.codec import CLASS_MESSAGE, DBC_FILE, Codec, load_codec
from trpac_hil.deadlines import Deadlines, SystemClock, wait_until
from trpac_hil.driver import EndlessDrive
from trpac_hil.errors import HilError
from trpac_hil.helper import Control, helper
from trpac_hil.message import identifier
from trpac_hil.realtime import raise_priority
from trpac_hil.roles import TRUTH
from trpac_hil.shared import Ring

PLAIN_SCENARIO = shipped("scenario")["paper_simulation"]
SENSED = (
    *(
        f"{sensor}_{w}_{unit}"
        for sensor, unit in (("wheel_speed", "rad_s"), ("wheel_torque", "nm"))
        for w in WHEELS
    ),
    "vehicle_speed_m_s",
    "accel_x_m_s2",
    *TRUTH,
)
"""Quantities that the plant gives."""
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
    dbc, signals : Path, Path or None
        DBC file of its messages, and the file that maps quantities to their signals.
    rate_hz : float
        Rate of the plant's steps; a message is sent in each, or at its cycle time where that is longer [Hz].
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
    signals: Path | None = None
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
        self._codec: Codec = load_codec(job.dbc, job.signals)
        self._noise, self._random = scenario.sensors, np.random.default_rng(scenario.seed)
        self._carried = {name: role for name, role in self._codec.roles.items() if name in SENSED}
        self._due_ns = dict.fromkeys((t.message for role in self._carried.values() for t in role.terms), 0)
        self._sent: dict[str, int] = {}
        self._pictures: deque[_Picture] = deque()
        self._link = open_link()  # last: what is refused before leaves no open bus
        if self._codec.beyond_classic and not self._link.fd:
            self._link.close()
            raise HilError(no_fd(self._codec.beyond_classic))

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
            self._send_readings(deadlines.due_ns(slot), deadlines.period_ns)
            if cameras is not None and now_ns >= cameras.due_ns(picture + 1):
                picture = cameras.next_slot(picture, now_ns)
                left, right = self.drive.surfaces_ahead(P_0_M)
                self._pictures.append(_Picture(picture, now_ns, (int(left), int(right))))
            self._send_pictures(now_ns)

    @property
    def sends(self) -> list[str]:
        """Messages that it sends, with their identifiers."""
        names = [*self._due_ns, *([CLASS_MESSAGE] if CLASS_MESSAGE in self._codec.messages else [])]
        return [f"{name} {identifier(self._codec[name])}" for name in names]

    def close(self) -> None:
        """Close the bus."""
        self._link.close()

    def _readings(self) -> dict[str, float]:
        """What the sensors read now, by quantity, and the true adhesion."""
        noise: SensorNoise = self._noise
        random = self._random.standard_normal(10).tolist()
        now = self.drive.now
        readings: dict[str, float] = {}
        for i, wheel in enumerate(WHEELS):
            speed, torque = now.wheel_speed_rad_s[i], now.wheel_torque_nm[i]
            readings[f"wheel_speed_{wheel}_rad_s"] = speed + noise.wheel_speed_noise_rad_s * random[i]
            readings[f"wheel_torque_{wheel}_nm"] = torque + noise.wheel_torque_noise_nm * random[4 + i]
            readings[f"theta_true_{wheel}"] = now.theta[i]
        readings["vehicle_speed_m_s"] = now.speed_m_s + noise.vehicle_speed_noise_m_s * random[8]
        readings["accel_x_m_s2"] = now.accel_x_m_s2 + noise.accel_x_noise_m_s2 * random[9]
        return readings

    def _send_readings(self, slot_ns: int, period_ns: int) -> None:
        """Send the messages that are due: those of a short cycle time in each step."""
        readings, values = self._readings(), dict[str, dict[str, float]]()
        for name, role in self._carried.items():
            rest = readings[name] - role.constant
            for term in role.terms:
                # Each signal takes what it can carry; the next one of a sum gets the rest.
                low, high = self._codec[term.message].bounds[term.signal]
                part = min(max(rest / term.gain, low), high)
                values.setdefault(term.message, {})[term.signal] = part
                rest -= term.gain * part
        for message, due_ns in self._due_ns.items():
            if slot_ns >= due_ns:
                cycle_ns = self._codec[message].cycle_ns
                self._due_ns[message] = 0 if cycle_ns <= period_ns else slot_ns + cycle_ns
                self._send(message, values[message])

    def _send_pictures(self, now_ns: int) -> None:
        delay_ns = round(self._job.camera_delay_s * 1e9)
        while self._pictures and now_ns - self._pictures[0].captured_ns >= delay_ns:
            picture = self._pictures.popleft()
            if CLASS_MESSAGE not in self._codec.messages:
                continue
            left, right = picture.classes
            self._send(
                CLASS_MESSAGE,
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
        job,
        lambda: Link(job.bus.open, report, name=job.bus.name) if wire is None else RelayedBus(wire),
        SystemClock(),
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
