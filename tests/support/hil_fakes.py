"""Clock, bus and unit of the rig's tests: time passes when the test says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import can

from trpac_hil.codec import Codec
from trpac_hil.delays import Spent
from trpac_hil.unit import Estimates, Wiring

MS = 1_000_000


class FakeClock:
    """Time goes on by sleeping alone; `hold_up` lets one sleep overshoot."""

    def __init__(self) -> None:
        self.time_ns = 1_000 * MS
        self.wall_offset_ns = 5_000_000 * MS
        self.overshoot_ns: dict[int, int] = {}
        self.worked_ns = self.queued_ns = self.blocked = 0
        self.sleeps = 0

    def now_ns(self) -> int:
        return self.time_ns

    def wall_ns(self) -> int:
        return self.time_ns + self.wall_offset_ns

    def cpu_ns(self) -> int:
        return self.worked_ns

    def spent(self) -> Spent:
        return Spent(self.time_ns, self.worked_ns, self.queued_ns, self.blocked)

    def sleep_ns(self, duration_ns: int) -> None:
        self.sleeps += 1
        self.blocked += 1
        self.time_ns += duration_ns + self.overshoot_ns.pop(self.sleeps, 0)


class FakeBus:
    """A bus whose messages a function of the cycle makes; what is sent is kept, decoded."""

    def __init__(self, codec: Codec, messages: Callable[[int], dict[str, dict[str, float]]]) -> None:
        self.codec, self.messages = codec, messages
        self.up, self.losses = True, 0
        self.polls = -1  # the first look is thrown away, before the first cycle
        self.counts: dict[str, int] = {}
        self.sent: list[tuple[str, dict[str, float], int]] = []

    def receive(self) -> list[can.Message]:
        made = []
        for name, values in (self.messages(self.polls) if self.polls >= 0 else {}).items():
            self.counts[name] = self.counts.get(name, 0) + 1
            coded = self.codec[name]
            data = coded.encode(values, self.counts[name])
            made.append(can.Message(arbitration_id=coded.message.frame_id, is_extended_id=False, data=data))
        self.polls += 1
        return made

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        coded = self.codec.by_id(self.codec.messages)[frame_id, extended]
        self.sent.append((coded.message.name, *coded.decode(data)))

    def check(self) -> None:
        return None

    def named(self, name: str) -> list[dict[str, float]]:
        return [values for sent, values, _ in self.sent if sent == name]


class FakeUnit:
    """Keeps what it is given; discards the steps whose number is in `discards`."""

    def __init__(self, wiring: Wiring | None = None) -> None:
        self.wiring = wiring or Wiring.of_one("fl")
        self.steps: list[tuple[float, float, list[float]]] = []
        self.classes: list[tuple[int, list[tuple[int, float]], int]] = []
        self.discards: set[int] = set()
        self.calls = 0
        self.during_step: Callable[[int], None] = lambda number: None
        wheels = len(self.wiring.wheels) if len(self.wiring.wheels) > 1 else 0
        self.last = Estimates(0.5, 0.1, 1.0, True, True, 0.6, (0.5,) * wheels, (True,) * wheels)

    def references(self, variables: Sequence[str]) -> list[int]:
        return list(range(len(variables)))

    def give_class(self, classes: Sequence[tuple[int, float]], number: int) -> None:
        self.classes.append((self.calls, list(classes), number))

    def step(
        self, time_s: float, step_s: float, references: Sequence[int], values: Sequence[float]
    ) -> Estimates | None:
        self.during_step(self.calls)
        self.calls += 1
        if self.calls - 1 in self.discards:
            return None
        self.steps.append((time_s, step_s, list(values)))
        return self.last


def unsaid(kind: str, text: str) -> None:
    """For what a test does not look at."""


class RaisingBus:
    """A bus that fails when told to."""

    def __init__(self) -> None:
        self.waiting: list[can.Message] = []
        self.failing: Exception | None = None
        self.state = can.BusState.ACTIVE
        self.shut = False

    def recv(self, timeout: float) -> can.Message | None:
        if self.failing:
            raise self.failing
        return self.waiting.pop(0) if self.waiting else None

    def send(self, message: can.Message) -> None:
        if self.failing:
            raise self.failing

    def shutdown(self) -> None:
        self.shut = True
