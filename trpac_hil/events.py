"""Events of the loop: each kind is said once and counted ever after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Event:
    """One kind: when it first happened [s], what was said, and how often it happened."""

    time_s: float
    text: str
    count: int = 1


class Events:
    """Said once, counted always.

    Parameters
    ----------
    show : callable
        Given the time [s] and the sentence of a kind's first event.
    now_s : callable
        Time since the start [s].
    """

    def __init__(self, show: Callable[[float, str], None], now_s: Callable[[], float]) -> None:
        self.kinds: dict[str, Event] = {}
        self._show, self._now_s = show, now_s

    def report(self, kind: str, text: str) -> None:
        """An event happened."""
        known = self.kinds.get(kind)
        if known is None:
            self.kinds[kind] = Event(self._now_s(), text)
            self._show(self.kinds[kind].time_s, text)
        else:
            known.count += 1

    def summary(self) -> list[dict[str, float | str | int]]:
        """All kinds, as summary.json has them."""
        return [
            {"kind": kind, "first_s": round(e.time_s, 3), "count": e.count, "said": e.text}
            for kind, e in self.kinds.items()
        ]
