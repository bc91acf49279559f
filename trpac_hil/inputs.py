"""What the bus last said, and how old it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from trpac_hil.codec import Codec, Coded

Say = Callable[[str, str], None]
"""Told a kind of event and a sentence; each kind is said once."""


@dataclass
class Heard:
    """The newest message of one kind.

    Attributes
    ----------
    coded : Coded
        Its layout.
    at_ns : int
        When it was there at the earliest; -1 before the first [ns].
    count : int
        Its counter.
    values : dict
        By signal, NaN where not available.
    received, lost, frozen, broken : int
        Messages that came; that the counter says are missing; whose counter stood still; that were too short.
    """

    coded: Coded
    at_ns: int = -1
    count: int = -1
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
        Those that are listened to.
    say : callable
        Told what is wrong with messages.
    counters : bool
        Whether a message whose counter stands still is old news; False for senders that do not count.
    """

    def __init__(self, codec: Codec, names: tuple[str, ...], say: Say, counters: bool = True) -> None:
        self.heard: Mapping[str, Heard] = {name: Heard(codec[name]) for name in names}
        self._by_id = {key: self.heard[c.message.name] for key, c in codec.by_id(names).items()}
        self._message_of = {signal: h for h in self.heard.values() for signal in h.coded.signals}
        self._say, self._counters = say, counters

    def take(self, frame_id: int, extended: bool, data: bytes, at_ns: int) -> str:
        """Take a message in; returns its name if it brought something new, else "".

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
            self._say(f"broken {name}", f"A message was left aside: {error}")
            return ""
        if self._counters and count >= 0 and heard.count >= 0:
            ahead = (count - heard.count) % heard.coded.counts
            if ahead == 0:
                heard.frozen += 1
                self._say(
                    f"frozen {name}",
                    f"{name}: its counter stood still at {count}, so the message is old news. "
                    "A sender that does not count needs --no-counters.",
                )
                return ""
            heard.lost += ahead - 1
        heard.values, heard.count, heard.at_ns = values, count, at_ns
        return name

    def value(self, signal: str, now_ns: int) -> float:
        """The newest value of a signal, NaN where there is none or it is too old."""
        heard = self._message_of[signal]
        limit_ns = heard.coded.stale_ns.get(signal)
        if heard.at_ns < 0 or (limit_ns is not None and now_ns - heard.at_ns > limit_ns):
            return math.nan
        return heard.values[signal]

    def age_ns(self, message: str, now_ns: int) -> int:
        """Age of the newest message of a kind, -1 where none has come [ns]."""
        at_ns = self.heard[message].at_ns
        return now_ns - at_ns if at_ns >= 0 else -1
