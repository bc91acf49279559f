"""Which result of the camera is for the road under the wheel now, though results come late.

The unit stamps a class that comes by bus as if its picture had been taken in the step that brings it: a result that
took 60 ms would be placed 1.2 m too far at 20 m/s. So the rig places results itself, by the library's own stamps,
Eq. (11): it knows at which way driven each picture was taken, and gives the unit, whose preview distance is set to 0,
each result in the very step in which the front wheel reaches its near edge. A result that comes while the wheel is
already on its stretch acts from then on, one whose stretch is over never acts: both are counted.
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
"""Parameters of the unit under which it takes a class as one of the road under the front wheel, until the next one.

The way is only a bound on what the unit remembers: the rig itself takes each result back where it ends.
"""

MOST_REMEMBERED = 8192
"""Cycles of which the place is remembered: 8 s at 1 kHz."""


class Odometer:
    """The way driven, and where the car was at a time."""

    def __init__(self) -> None:
        self.position_m = 0.0
        self._speed_m_s = 0.0
        self._way: deque[tuple[int, float]] = deque(maxlen=MOST_REMEMBERED)

    def drive(self, now_ns: int, speed_m_s: float, passed_s: float) -> None:
        """Go on with a speed for a time; without a speed (NaN) with the last one."""
        if speed_m_s == speed_m_s:
            self._speed_m_s = speed_m_s
        self.position_m += self._speed_m_s * passed_s
        self._way.append((now_ns, self.position_m))

    @property
    def speed_m_s(self) -> float:
        """The last speed that was known [m/s]."""
        return self._speed_m_s

    def at(self, time_ns: int) -> float | None:
        """Where the car was at a time; None before what is remembered [m]."""
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
    """What came of one picture.

    Attributes
    ----------
    number : int
        Of the picture.
    captured_ns, arrived_ns : int
        When it was taken, and when its result was there [ns].
    classes : tuple
        One per side that the unit asks for; None where the picture could not be used.
    """

    number: int
    captured_ns: int
    arrived_ns: int
    classes: tuple[RoadClass | None, ...]


@dataclass
class StampCounts:
    """How the results fared.

    `late` came when the wheel was past the near edge of what they show, `in_vain` when it was past the far edge;
    `unplaced` are older than what is remembered of the way, or than a result that came before them.
    """

    results: int = 0
    failed: int = 0
    late: int = 0
    in_vain: int = 0
    unplaced: int = 0


class PreviewStamps:
    """Stamps of the results on the road, for each side that the unit asks for."""

    def __init__(self, config: PreviewConfig, frame_interval_s: float, sides: int) -> None:
        self.counts = StampCounts()
        self.newest: CameraResult | None = None
        self._config, self._interval_s = config, frame_interval_s
        self._states = [PreviewState()] * sides
        self._failed = [False] * sides

    def take(self, result: CameraResult, odometer: Odometer, stale_ns: int) -> None:
        """Stamp a result where its picture was taken."""
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
            self._states[side] = self._stamped(
                side, road_class, captured_m, 1e-9 * result.captured_ns, odometer
            )
            self._failed[side] = road_class is None
        self.counts.failed += None in result.classes
        if odometer.position_m > near_m:
            self.counts.late += 1
            self.counts.in_vain += all(self.on_road(s, odometer.position_m) is None for s in self._sides)

    @property
    def _sides(self) -> range:
        return range(len(self._states))

    def _stamped(
        self,
        side: int,
        road_class: RoadClass | None,
        captured_m: float,
        captured_s: float,
        odometer: Odometer,
    ) -> PreviewState:
        state = prune(self._states[side], self._config, odometer.position_m)
        if road_class is not None:
            # Whether it counts says the unit, by its own threshold.
            outcome = Outcome(road_class.surface, road_class.confidence, True, captured_s)
        elif state.stamps:
            outcome = Outcome(state.stamps[-1].outcome.surface, 0.0, False, captured_s)
        else:
            return state
        return add_frame(
            state,
            self._config,
            outcome,
            position_m=captured_m,
            speed_m_s=odometer.speed_m_s,
            frame_interval_s=self._interval_s,
        )

    def on_road(self, side: int, position_m: float) -> Outcome | None:
        """What is known of the road at a place of the front wheel, whether the camera is well or not."""
        return covering(self._states[side], self._config, position_m)

    def known(self, side: int, position_m: float) -> Outcome | None:
        """What the unit is to be told of the road under the front wheel; None while the camera fails."""
        return None if self._failed[side] else self.on_road(side, position_m)

    def forget(self) -> None:
        """The camera is gone: what it said no longer counts."""
        self._states = [PreviewState()] * len(self._states)
        self._failed = [False] * len(self._states)
