"""The newest values received from the bus, and their ages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from trpac_core.files import quoted
from trpac_hil.codec import Codec, Coded

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
    values : dict
        By signal, NaN where not available.
    senders : Senders
        Whether more than one device sends it.
    new : bool
        Whether the counter of the last message had changed.
    received, lost, frozen, broken : int
        Messages received; missing by the counter; with an unchanged counter; of a wrong length.
    """

    coded: Coded
    senders: Senders
    at_ns: int = -1
    count: int = -1
    data: bytes = b""
    new: bool = False
    values: dict[str, float] = field(default_factory=dict)
    received: int = 0
    lost: int = 0
    frozen: int = 0
    broken: int = 0


class Inputs:
    """The newest value of each signal that comes by bus.

    Parameters
    ----------
    codec : Codec
        Messages.
    names : tuple of str
        Messages that are received.
    report : callable
        Called with what is wrong with messages.
    counters : bool
        Whether a message with an unchanged counter is ignored; False for senders that do not count.
    """

    def __init__(
        self, codec: Codec, names: tuple[str, ...], report: ReportEvent, counters: bool = True
    ) -> None:
        self.heard: Mapping[str, Heard] = {
            name: Heard(codec[name], Senders(codec[name].cycle_ns)) for name in names
        }
        self._by_id = {key: self.heard[c.message.name] for key, c in codec.by_id(names).items()}
        self._message_of = {signal: h for h in self.heard.values() for signal in h.coded.signals}
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
        try:
            values, count = heard.coded.decode(data)
        except ValueError as error:
            heard.broken += 1
            self._report(f"broken {name}", f"A message was left aside: {quoted(error)}")
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
                f"{HELD_NS * 1e-9:g} s after the last sign of it. Take one off the bus, or correct its cycle time.",
            )
        if ahead == 0:
            heard.frozen += 1
            self._report(
                f"frozen {name}",
                f"{name}: its counter stood still at {count}, so the message is old news. "
                "A sender that does not count needs --no-counters.",
            )
            return ""
        heard.lost += ahead - 1
        heard.values, heard.count, heard.at_ns, heard.data = values, count, at_ns, data
        return name

    def value(self, signal: str, now_ns: int) -> float:
        """The newest value of a signal; NaN where there is none, it is too old, or two devices send it."""
        heard = self._message_of[signal]
        limit_ns = heard.coded.stale_ns.get(signal)
        if heard.at_ns < 0 or (limit_ns is not None and now_ns - heard.at_ns > limit_ns):
            return math.nan
        return math.nan if now_ns < heard.senders.until_ns else heard.values[signal]

    def doubted(self, now_ns: int) -> list[str]:
        """Names of the messages that two devices send."""
        return [name for name, heard in self.heard.items() if now_ns < heard.senders.until_ns]

    def age_ns(self, message: str, now_ns: int) -> int:
        """Age of the newest message of a kind, -1 where none has come [ns]."""
        at_ns = self.heard[message].at_ns
        return now_ns - at_ns if at_ns >= 0 else -1
