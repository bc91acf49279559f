"""Events of the loop: the first of each kind is shown, all are counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Event:
    """A kind of event: time of its first occurrence [s], text, and number of occurrences."""

    time_s: float
    text: str
    count: int = 1


class Events:
    """Events by kind.

    Parameters
    ----------
    show : callable
        Called with time [s] and text of the first event of a kind.
    now_s : callable
        Returns the time since the start [s].
    """

    def __init__(self, show: Callable[[float, str], None], now_s: Callable[[], float]) -> None:
        self.kinds: dict[str, Event] = {}
        self._show, self._now_s = show, now_s

    def report(self, kind: str, text: str) -> None:
        """Count an event; show the first of its kind."""
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
