"""Whether what the unit needs comes by the bus, listened for before the first cycle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from sim2real.logs.contract import COLUMNS
from trpac_hil.bus import Link
from trpac_hil.camera_input import SURFACES
from trpac_hil.codec import CLASS_MESSAGE, Codec
from trpac_hil.deadlines import SystemClock
from trpac_hil.inputs import Heard, Inputs
from trpac_hil.message import identifier
from trpac_hil.roles import Role
from trpac_hil.unit import Wiring

MEASURED_NS = 300_000_000
"""Time for which it listens on once all is there, to count rates: 30 messages of 10 ms [ns]."""
WAIT_REPORTED_NS = 1_000_000_000
"""Time after which it is said what is waited for [ns]."""
POLL_NS = 1_000_000
"""Time between two polls of the bus [ns]."""


@dataclass(frozen=True)
class Line:
    """What was heard of a quantity.

    Attributes
    ----------
    name, unit, source : str
        Quantity, its unit, and the signals that it is made of.
    frame_ids : str
        Identifiers of their messages.
    required : bool
        Whether the unit gives no estimate without it.
    value : float
        Its value at the end; NaN without one.
    rate : str
        Messages per second, and those due by the cycle time.
    counter : str
        Whether the message counter goes on.
    problem : str
        Why there is no value; empty where there is one.
    """

    name: str
    unit: str
    source: str
    frame_ids: str
    required: bool
    value: float
    rate: str
    counter: str
    problem: str


@dataclass(frozen=True)
class Readiness:
    """What was heard before the first cycle.

    Attributes
    ----------
    lines : tuple of Line
        One per quantity that the unit takes or that the file of signals names, and one for the class of the road.
    sent, notes : tuple of str
        Messages that the rig sends, with their identifiers; what is not used, and why.
    listened_s : float
        For how long it listened [s].
    """

    lines: tuple[Line, ...]
    sent: tuple[str, ...]
    notes: tuple[str, ...]
    listened_s: float

    @property
    def missing(self) -> list[str]:
        """What is required and has no value, with the reason."""
        return [
            f"{line.name} ({line.source}): {line.problem}"
            for line in self.lines
            if line.required and line.problem
        ]


def listen(
    link: Link,
    codec: Codec,
    wiring: Wiring,
    wait_s: float,
    counters: bool,
    clock: SystemClock,
    stop: Callable[[], bool],
    classes: bool,
    report_wait: Callable[[str], None] = lambda text: None,
) -> Readiness:
    """Listen until all that is required is there and its rate is counted, but no longer than `wait_s`.

    `counters` is whether message counters are checked, `classes` whether classes of the road come by the bus;
    `report_wait` is called once where something is still missing after a second.
    """
    link.drain()
    inputs, required = Inputs(codec, lambda kind, text: None, counters), set(wiring.required.values())
    first: dict[str, tuple[int, int]] = {}
    began_ns = now_ns = clock.now_ns()
    ready_ns, reported = None, False
    while not stop() and now_ns - began_ns < wait_s * 1e9:
        clock.sleep_ns(POLL_NS)
        now_ns = clock.now_ns()
        for message in link.receive():
            inputs.take(message.arbitration_id, message.is_extended_id, bytes(message.data), now_ns)
        for name, heard in inputs.heard.items():
            if heard.received and name not in first:
                first[name] = (now_ns, heard.received)
        missing = [role for role in required if math.isnan(inputs.value(role, now_ns))]
        if missing:
            ready_ns = None
            if not reported and now_ns - began_ns > WAIT_REPORTED_NS:
                reported = True
                report_wait(f"waiting up to {wait_s:g} s for {', '.join(sorted(missing))}; Ctrl-C ends.")
        elif ready_ns is None:
            ready_ns = now_ns
        elif now_ns - ready_ns >= MEASURED_NS:
            break
    state = _Listened(inputs, first, now_ns, counters)
    used = {*required, *wiring.optional.values()}
    lines = [
        state.line(role, role.name in required)
        for role in codec.roles.values()
        if role.name in used or (codec.signals is not None and role.name in COLUMNS)
    ]
    if classes:
        lines.append(state.class_line(codec))
    return Readiness(tuple(lines), sent(codec, wiring), codec.notes, (now_ns - began_ns) * 1e-9)


def sent(codec: Codec, wiring: Wiring) -> tuple[str, ...]:
    """Messages that the rig sends, each with its identifier and the file that has its layout."""
    names = ["Estimate", *(["EstimateWheels"] if len(wiring.wheels) > 1 else []), "Health"]
    return tuple(
        f"{name} {identifier(codec[name])} ({'trpac.dbc' if name in codec.ours else codec.path.name})"
        for name in names
    )


@dataclass(frozen=True)
class _Listened:
    """What has been heard by `now_ns`; `first` are time and number of the first messages of each kind."""

    inputs: Inputs
    first: dict[str, tuple[int, int]]
    now_ns: int
    counters: bool

    def line(self, role: Role, required: bool) -> Line:
        """What is known of a quantity."""
        names = list(dict.fromkeys(term.message for term in role.terms))
        heard = [self.inputs.heard[name] for name in names]
        value = self.inputs.value(role.name, self.now_ns)
        problems = (self._problem(self.inputs.heard[term.message], term.signal) for term in role.terms)
        problem = next(filter(None, problems), "") if math.isnan(value) else ""
        return Line(
            role.name,
            role.unit,
            role.text,
            ", ".join(identifier(each.coded) for each in heard),
            required,
            value,
            ", ".join(self._rate(each) for each in heard),
            ", ".join(dict.fromkeys(self._counter(each) for each in heard)),
            problem,
        )

    def class_line(self, codec: Codec) -> Line:
        """What is known of the camera's message."""
        heard = self.inputs.heard.get(CLASS_MESSAGE)
        if heard is None:
            return Line("road class", "", CLASS_MESSAGE, "", False, math.nan, "", "", "not on this bus")
        left = heard.values.get("RoadClass_Left", math.nan)
        surface = SURFACES[left].name.lower() if left in SURFACES else ""
        problem = "" if heard.at_ns >= 0 else self._problem(heard, "RoadClass_Left")
        frame_id, rate, counter = identifier(heard.coded), self._rate(heard), self._counter(heard)
        return Line("road class", surface, CLASS_MESSAGE, frame_id, False, left, rate, counter, problem)

    def _rate(self, heard: Heard) -> str:
        """Messages per second, and how many are due."""
        due = f"{1e9 / heard.coded.cycle_ns:.4g}" if heard.coded.cycle_ns else "?"
        began = self.first.get(heard.coded.message.name)
        if began is None or self.now_ns <= began[0]:
            return f"- of {due}"
        return f"{(heard.received - began[1]) / (self.now_ns - began[0]) * 1e9:.0f} of {due}"

    def _counter(self, heard: Heard) -> str:
        if not heard.received:
            return "-"
        if not heard.coded.counts:
            return "none"
        if not self.counters or heard.received < 2:
            return "not checked"
        if heard.frozen >= heard.received - 1:
            return "stands still"
        return f"{heard.lost} missing" if heard.lost else "counts"

    def _problem(self, heard: Heard, signal: str) -> str:
        """Why a signal has no value; empty where it has one."""
        name = heard.coded.message.name
        if not heard.received:
            return f"no message {name} ({identifier(heard.coded)}) came"
        if heard.broken == heard.received:
            return f"{name} came with a length other than {heard.coded.message.length} bytes"
        if self.now_ns < heard.senders.until_ns:
            return f"two devices send {name}"
        if self._counter(heard) == "stands still":
            return f"the counter {heard.coded.counter} stands still (--no-counters where the sender does not count)"
        if signal not in heard.values:
            selection = " ".join(f"{m} = {v}" for m, v in heard.coded.selections.get(signal, ()))
            return f"no {name} with {selection} came"
        age_ns = self.now_ns - heard.times[signal]
        if age_ns > heard.coded.stale_ns[signal]:
            return f"came last {age_ns * 1e-6:.0f} ms ago"
        if heard.outside.get(signal):
            low, high = heard.coded.bounds[signal]
            return f"is outside {low:g} ... {high:g}, its range in the DBC file"
        return "is marked as not available" if math.isnan(heard.values[signal]) else ""
