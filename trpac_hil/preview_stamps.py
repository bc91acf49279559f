"""Camera results stamped on the road where their pictures were taken, though results come late.

The unit stamps a class from the bus as if its picture had been taken in the step that brings it: a result that took
60 ms would be stamped 1.2 m too far at 20 m/s. So the rig stamps results itself, by Eq. (11) and the position at which
each picture was taken, and gives the unit, whose preview distance is set to 0, each result in the step in which the
front wheel reaches its near edge. A result that comes while the wheel is on its stretch is used from then on, one whose
stretch is over is not used: both are counted.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from trpac_core.estimator import RoadClass
from trpac_core.vision.preview import (
    Outcome,
    PreviewConfig,
    PreviewState,
    add_frame,
    covering,
    prune,
)

UNIT_PREVIEW = {"preview.P_0": 0.0, "preview.hold": 50.0}
"""Parameters of the unit with which a class applies to the road under the front wheel until the next one comes.

`preview.hold` only bounds what the unit remembers: the rig ends each result itself.
"""

MOST_REMEMBERED = 8192
"""Cycles whose position is remembered: 8 s at 1 kHz."""


class Odometer:
    """Distance driven, and the position at an earlier time."""

    def __init__(self) -> None:
        self.position_m = 0.0
        self._speed_m_s = 0.0
        self._way: deque[tuple[int, float]] = deque(maxlen=MOST_REMEMBERED)

    def drive(self, now_ns: int, speed_m_s: float, passed_s: float) -> None:
        """Add a time at a speed; NaN stands for the last known speed."""
        if speed_m_s == speed_m_s:
            self._speed_m_s = speed_m_s
        self.position_m += self._speed_m_s * passed_s
        self._way.append((now_ns, self.position_m))

    @property
    def speed_m_s(self) -> float:
        """The last known speed [m/s]."""
        return self._speed_m_s

    def at(self, time_ns: int) -> float | None:
        """Position at a time; None before the remembered times [m]."""
        after: tuple[int, float] | None = None
        for moment, position_m in reversed(self._way):
            if moment <= time_ns:
                if after is None:
                    return position_m
                share = (time_ns - moment) / (after[0] - moment)
                return position_m + share * (after[1] - position_m)
            after = (moment, position_m)
        return None


@dataclass(frozen=True)
class CameraResult:
    """The result of one picture.

    Attributes
    ----------
    number : int
        Number of the picture.
    captured_ns, arrived_ns : int
        When it was taken, and when its result arrived [ns].
    classes : tuple
        A RoadClass per side of the unit; None where the picture could not be used.
    """

    number: int
    captured_ns: int
    arrived_ns: int
    classes: tuple[RoadClass | None, ...]


@dataclass
class StampCounts:
    """Counts of the results.

    `late` ones came when the wheel was past the near edge of the road that they show, `in_vain` ones when it was past
    the far edge; `unplaced` ones are older than the remembered positions, or than a result that came before them.
    """

    results: int = 0
    failed: int = 0
    late: int = 0
    in_vain: int = 0
    unplaced: int = 0


class PreviewStamps:
    """Stamps of the results on the road, for each side of the unit."""

    def __init__(self, config: PreviewConfig, frame_interval_s: float, sides: int) -> None:
        self.counts = StampCounts()
        self.newest: CameraResult | None = None
        self._config, self._interval_s = config, frame_interval_s
        self._states = [PreviewState() for _ in range(sides)]
        self._failed = [False] * sides

    def take(self, result: CameraResult, odometer: Odometer, stale_ns: int) -> None:
        """Stamp a result at the position of its picture."""
        self.counts.results += 1
        captured_m = odometer.at(result.captured_ns)
        overtaken = self.newest is not None and result.captured_ns <= self.newest.captured_ns
        if captured_m is None or overtaken:
            self.counts.unplaced += 1
            return
        if self.newest is not None and result.captured_ns - self.newest.captured_ns > stale_ns:
            self.forget()
        self.newest = result
        near_m = captured_m + self._config.P_0_m
        for side, road_class in enumerate(result.classes):
            self._stamp(side, road_class, captured_m, 1e-9 * result.captured_ns, odometer)
            self._failed[side] = road_class is None
        self.counts.failed += None in result.classes
        if odometer.position_m > near_m:
            self.counts.late += 1
            self.counts.in_vain += all(self.on_road(s, odometer.position_m) is None for s in self._sides)

    @property
    def _sides(self) -> range:
        return range(len(self._states))

    def _stamp(
        self,
        side: int,
        road_class: RoadClass | None,
        captured_m: float,
        captured_s: float,
        odometer: Odometer,
    ) -> None:
        state = self._states[side]
        prune(state, self._config, odometer.position_m)
        if road_class is not None:
            # The unit decides by its own threshold whether the class is used.
            outcome = Outcome(road_class.surface, road_class.confidence, True, captured_s)
        elif state.stamps:
            outcome = Outcome(state.stamps[-1].outcome.surface, 0.0, False, captured_s)
        else:
            return
        add_frame(
            state,
            self._config,
            outcome,
            position_m=captured_m,
            speed_m_s=odometer.speed_m_s,
            frame_interval_s=self._interval_s,
        )

    def on_road(self, side: int, position_m: float) -> Outcome | None:
        """The newest result for a position of the front wheel, whether the camera fails now or not; None: none."""
        return covering(self._states[side], self._config, position_m)

    def known(self, side: int, position_m: float) -> Outcome | None:
        """The result to give the unit at a position of the front wheel; None while the camera fails."""
        return None if self._failed[side] else self.on_road(side, position_m)

    def forget(self) -> None:
        """Discard all results, because the camera is lost."""
        self._states = [PreviewState() for _ in self._states]
        self._failed = [False] * len(self._states)
