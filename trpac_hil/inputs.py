"""The newest values received from the bus, and their ages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from trpac_core.files import quoted
from trpac_hil.codec import Codec, Supply
from trpac_hil.message import Coded

MOST_OFTEN = 1.2
"""Greatest lasting rate of a message over the rate of its cycle time [-]; clocks of nodes differ by less."""
LONGEST_STALL_NS = 270_000_000
"""Longest time for which messages may be held up and then come at once [ns]; senders without real time take 200 ms."""
MOST_ODD, ODD_LEAK = 5.0, 0.25
"""Odd counts that mean a second sender, and by how much each other message lowers their number [-].

Two senders of one rate make every second count odd and are noticed after 14 messages. A sender that restarts makes
one odd count; one of which seven in ten messages are lost at random makes one in twenty.
"""
ORDERLY, ORDERLY_WEIGHT = 4, 0.125
"""Messages in sequence after which further ones in sequence count for one sender, and their weight then [-].

A sender that counts may so be eight times too fast; an attacker that fills the gap between two true messages with all
counts must be faster.
"""
OVERFULL = 1.1
"""Limit of both counts over the number that means a second sender [-], so that they fall soon after it is gone."""
HELD_NS = 1_000_000_000
"""Time after the last sign of a second sender for which the message is not used [ns]."""
ReportEvent = Callable[[str, str], None]
"""Called with the kind of an event and a sentence."""


@dataclass
class Senders:
    """Detector of a second device that sends the same message.

    Attributes
    ----------
    cycle_ns : int
        Cycle time of the message; 0 where it is not known [ns].
    until_ns : int
        Time until which two senders are assumed [ns].
    noticed : int
        How often a second sender was detected.
    """

    cycle_ns: int
    until_ns: int = -1
    noticed: int = 0
    _surplus: float = 0.0
    _odd: float = 0.0
    _orderly: int = 0
    _at_ns: int = 0

    def count(self, at_ns: int, went_on: bool, odd: bool) -> str:
        """Count a message; returns the sign of a second sender where one is newly detected, else "".

        `went_on` is whether the counter rose by one, `odd` whether its value cannot be of a single sender.
        """
        self._orderly = self._orderly + 1 if went_on else 0
        often = self._often(at_ns, ORDERLY_WEIGHT if self._orderly > ORDERLY else 1.0)
        self._odd = min(max(0.0, self._odd + (1.0 if odd else -ODD_LEAK)), OVERFULL * MOST_ODD)
        if not often and self._odd < MOST_ODD:
            return ""
        begins, self.until_ns = at_ns >= self.until_ns, at_ns + HELD_NS
        self.noticed += begins
        if not begins:
            return ""
        return (
            f"it comes more often than every {self.cycle_ns * 1e-6:g} ms"
            if often
            else "its counter runs back"
        )

    def _often(self, at_ns: int, weight: float) -> bool:
        """Whether more messages came than the cycle time and `LONGEST_STALL_NS` allow."""
        if not self.cycle_ns:
            return False
        most, often = LONGEST_STALL_NS / self.cycle_ns + 1.0, False
        if at_ns > self._at_ns:
            self._surplus = max(0.0, self._surplus - MOST_OFTEN * (at_ns - self._at_ns) / self.cycle_ns)
            self._at_ns, often = at_ns, self._surplus > most
        self._surplus = min(self._surplus + weight, OVERFULL * most + 2.0)
        return often


@dataclass
class Heard:
    """The newest message of one kind, with counts.

    Attributes
    ----------
    coded : Coded
        Its layout.
    at_ns : int
        Earliest time at which it can have come; -1 before the first [ns].
    count : int
        Its counter.
    data : bytes
        Its bytes.
    values, times : dict
        Newest value by signal, NaN where not available or out of range; and when it came, as `at_ns`. Of a multiplexed
        message they are of several messages.
    senders : Senders
        Whether more than one device sends it.
    new : bool
        Whether the counter of the last message had changed.
    received, lost, frozen, broken : int
        Messages received; missing by the counter; with an unchanged counter; of a wrong length.
    outside : dict
        How often a signal was outside its stated range.
    """

    coded: Coded
    senders: Senders
    at_ns: int = -1
    count: int = -1
    data: bytes = b""
    new: bool = False
    values: dict[str, float] = field(default_factory=dict)
    times: dict[str, int] = field(default_factory=dict)
    received: int = 0
    lost: int = 0
    frozen: int = 0
    broken: int = 0
    outside: dict[str, int] = field(default_factory=dict)


class Inputs:
    """The newest value of each quantity that comes by bus.

    Parameters
    ----------
    codec : Codec
        Messages and quantities.
    report : callable
        Called with what is wrong with messages.
    counters : bool
        Whether a message with an unchanged counter is ignored; False for senders that do not count.
    """

    def __init__(self, codec: Codec, report: ReportEvent, counters: bool = True) -> None:
        self.heard: Mapping[str, Heard] = {
            name: Heard(codec[name], Senders(codec[name].cycle_ns)) for name in codec.received
        }
        self._by_id = {key: self.heard[c.message.name] for key, c in codec.by_id(codec.received).items()}
        self._sums = {
            name: (
                role.constant,
                tuple(
                    (self.heard[t.message], t.signal, t.gain, codec[t.message].stale_ns[t.signal])
                    for t in role.terms
                ),
            )
            for name, role in codec.roles.items()
        }
        self._report, self._counters = report, counters

    def take(self, frame_id: int, extended: bool, data: bytes, at_ns: int) -> str:
        """Store a message; returns its name where it is new, else "".

        `at_ns` is the earliest time at which it can have come: ages are never understated.
        """
        heard = self._by_id.get((frame_id, extended))
        if heard is None:
            return ""
        name = heard.coded.message.name
        heard.received += 1
        outside: dict[str, int] = {}
        try:
            values, count = heard.coded.decode(data, outside)
        except ValueError as error:
            heard.broken += 1
            self._report(f"broken {name}", f"A message was ignored: {quoted(error)}")
            return ""
        ahead, went_on, odd = 1, False, False
        if self._counters and count >= 0 and heard.count >= 0:
            ahead = (count - heard.count) % heard.coded.counts
            went_on = ahead == 1
            # Counts of two senders run back, or are the same with other content.
            odd = 2 * ahead > heard.coded.counts or (ahead == 0 and heard.new and data != heard.data)
        heard.new = ahead > 0
        seen = heard.senders.count(at_ns, went_on, odd)
        if seen:
            self._report(
                f"two senders {name}",
                f"{name}: {seen}, so two devices send it. TRPAC is held with flag 0 until "
                f"{HELD_NS * 1e-9:g} s after the last sign of it. Remove one from the bus, or correct the "
                "cycle time in the DBC file.",
            )
        if ahead == 0:
            heard.frozen += 1
            self._report(
                f"frozen {name}",
                f"{name}: its counter stays at {count}, so the message counts as old. "
                "A sender that does not count needs --no-counters.",
            )
            return ""
        if outside:
            self._count_outside(heard, outside)
        heard.lost += ahead - 1
        heard.values.update(values)
        heard.times.update(dict.fromkeys(values, at_ns))
        heard.count, heard.at_ns, heard.data = count, at_ns, data
        return name

    def _count_outside(self, heard: Heard, outside: Mapping[str, int]) -> None:
        for signal, number in outside.items():
            heard.outside[signal] = heard.outside.get(signal, 0) + number
            name = f"{heard.coded.message.name}.{signal}"
            low, high = heard.coded.bounds[signal]
            self._report(
                f"out of range {name}",
                f"{name} is outside {low:g} ... {high:g}, its range in the DBC file, and counts as lost.",
            )

    def value(self, role: str, now_ns: int) -> float:
        """The newest value of a quantity; NaN where a signal of it is missing, too old, or sent by two devices."""
        made = self._sums.get(role)
        if made is None:
            return math.nan
        total, terms = made
        for heard, signal, gain, limit_ns in terms:
            at_ns = heard.times.get(signal, -1)
            if at_ns < 0 or now_ns - at_ns > limit_ns or now_ns < heard.senders.until_ns:
                return math.nan
            total += gain * heard.values[signal]
        return total

    def doubted(self, now_ns: int) -> list[str]:
        """Names of the messages that two devices send."""
        return [name for name, heard in self.heard.items() if now_ns < heard.senders.until_ns]

    def age_ns(self, supply: Supply, now_ns: int) -> int:
        """Age of what a supply brought last, -1 where it never has [ns]."""
        heard = self.heard[supply.message]
        at_ns = heard.times.get(supply.signal, -1) if supply.signal else heard.at_ns
        return now_ns - at_ns if at_ns >= 0 else -1
