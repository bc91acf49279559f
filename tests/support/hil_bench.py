"""The rig's loop on a clock, a bus and a unit that the test holds."""

from __future__ import annotations

from dataclasses import dataclass, field

from hil_fakes import MS, FakeBus, FakeClock, FakeUnit

from trpac_core.vision.preview import PreviewConfig
from trpac_hil.camera_input import CameraInput
from trpac_hil.codec import load_codec
from trpac_hil.deadlines import Deadlines
from trpac_hil.delays import Delays
from trpac_hil.events import Events
from trpac_hil.inputs import Inputs
from trpac_hil.loop import Counts, Loop
from trpac_hil.preview_stamps import PreviewStamps
from trpac_hil.records import columns
from trpac_hil.shared import Ring

CODEC = load_codec()
PERIOD_NS = MS
WHEELS = ("FL", "FR", "RL", "RR")


def driving(speed_m_s: float = 20.0) -> dict[str, dict[str, float]]:
    """The three messages that the unit needs."""
    return {
        "WheelSpeeds": {f"WheelSpeed_{w}": speed_m_s / 0.29 for w in WHEELS},
        "WheelTorques": {f"WheelTorque_{w}": 100.0 for w in WHEELS},
        "VehicleMotion": {"VehicleSpeed": speed_m_s},
    }


@dataclass
class Bench:
    """A loop on fakes, and what it left behind."""

    clock: FakeClock = field(default_factory=FakeClock)
    unit: FakeUnit = field(default_factory=FakeUnit)
    told: list[str] = field(default_factory=list)
    spin_ns: int = 0

    def __post_init__(self) -> None:
        self.bus = FakeBus(CODEC, lambda cycle: driving())
        self.ring = Ring(len(columns(self.unit.wiring, CODEC.supplies)), 5000)
        self.stamps = PreviewStamps(PreviewConfig(), 0.05, len(self.unit.wiring.sides))
        self.camera_input = CameraInput(self.stamps, 1000 * MS, self.unit.wiring.side_names)
        self.events = Events(lambda time_s, text: self.told.append(text), lambda: 0.0)
        self.inputs = Inputs(CODEC, self.events.report)

    def run(self, slots: int) -> Counts:
        start_ns = self.clock.now_ns() + PERIOD_NS
        self.loop = Loop(
            self.clock,
            Deadlines(start_ns, PERIOD_NS),
            self.bus,
            self.unit,
            CODEC,
            self.inputs,
            self.camera_input,
            self.ring,
            self.events,
            Delays(self.clock),
            spin_ns=self.spin_ns,
        )
        counts = self.loop.run(lambda: False, slots)
        names = [c.name for c in columns(self.unit.wiring, CODEC.supplies)]
        rows = self.ring.read()
        self.table = {name: rows[:, place] for place, name in enumerate(names)}
        return counts

    def sent(self, signal: str) -> list[float]:
        return [values[signal] for values in self.bus.named("Estimate")]
