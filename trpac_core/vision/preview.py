"""From the road seen ahead to the road under the wheel: displacement stamps, Eq. (11).

Positions are the front wheel's odometric coordinate X, the integral of the vehicle's speed [m].

A frame taken at X = P_1 applies to the road from X_lb = P_1 + P_0 on. Eq. (11) writes X_lb from the position
P_2 when the frame has been processed, less the distance driven meanwhile, which is the same place. X_ub lies one
frame interval's way further, so that successive frames tile the road. Real frames come late or not at all, so
the tiling is read as:

* A stamp's length is the distance driven since the frame before; for the first frame, speed times frame interval.
* A result holds from its X_lb until the X_lb of the next frame, at most `hold_m` beyond its X_ub; then there is a
  gap: no result. The default is the depth of the near group, the stretch of road that the result was taken from.
* Where several stamps cover a position, the newest frame wins.
* Frames less than `resolution_m` apart share one stamp, with the newest result: a standing or shunting car
  does not collect stamps. Of more than `MOST_STAMPS` the oldest goes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from .classes import Surface

MOST_STAMPS = 512
"""Most stamps that are kept; with the default settings and a class in each millisecond there are 230 at most."""


@dataclass(frozen=True)
class Outcome:
    """Class of the road ahead from a frame, or from a classifier elsewhere on the bus."""

    surface: Surface
    Q_v: float
    flag: bool
    captured_s: float


@dataclass(frozen=True)
class Stamp:
    """One outcome and the stretch [X_lb, X_ub) of road that it applies to [m]."""

    X_lb_m: float
    X_ub_m: float
    outcome: Outcome


@dataclass(frozen=True)
class PreviewConfig:
    """Settings of the stamps.

    Parameters
    ----------
    P_0_m : float
        Preview distance from the front wheel to the near edge of what is classified [m].
    hold_m : float
        How far beyond its X_ub a result holds when no newer one begins [m].
    resolution_m : float
        Distance below which two frames share a stamp [m].
    behind_m : float
        How far behind the front wheel stamps are kept: the wheelbase where rear wheels ask too [m].
    """

    P_0_m: float = 2.5
    hold_m: float = 2.0
    resolution_m: float = 0.02
    behind_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse distances that are negative or not finite; raises ValueError."""
        distances = (self.P_0_m, self.hold_m, self.resolution_m, self.behind_m)
        if not all(0.0 <= distance < math.inf for distance in distances):
            raise ValueError(
                f"Settings of the displacement stamps: distances are finite and not negative, got {self}."
            )


def _zeros() -> list[float]:
    return [0.0] * MOST_STAMPS


def _none() -> list[int]:
    return [0] * MOST_STAMPS


def _down() -> list[bool]:
    return [False] * MOST_STAMPS


Numbers = Annotated[list[float], (MOST_STAMPS,)]


@dataclass(slots=True)
class PreviewState:
    """Stamps from the oldest frame to the newest, as columns that are filled in a ring; changed in place.

    Attributes
    ----------
    captured_at_m : float or None
        Where the newest frame was captured [m].
    ascending : bool
        Whether no stamp begins before one of an older frame: so it is unless the car has rolled back.
    first, count : int
        Place of the oldest stamp, and how many there are.
    X_lb_m, X_ub_m : list of float
        Stretch of road of each stamp [m].
    surface, Q_v, flag, captured_s : list
        Its outcome.
    """

    captured_at_m: float | None = None
    ascending: bool = True
    first: int = 0
    count: int = 0
    X_lb_m: Numbers = field(default_factory=_zeros)
    X_ub_m: Numbers = field(default_factory=_zeros)
    surface: Annotated[list[int], (MOST_STAMPS,)] = field(default_factory=_none)
    Q_v: Numbers = field(default_factory=_zeros)
    flag: Annotated[list[bool], (MOST_STAMPS,)] = field(default_factory=_down)
    captured_s: Numbers = field(default_factory=_zeros)

    @property
    def stamps(self) -> tuple[Stamp, ...]:
        """The stamps from the oldest frame to the newest."""
        return tuple(
            Stamp(self.X_lb_m[place], self.X_ub_m[place], outcome_at(self, place))
            for place in (index_of(self, k) for k in range(self.count))
        )

    @classmethod
    def of(cls, stamps: Iterable[Stamp], captured_at_m: float | None) -> PreviewState:
        """The state with these stamps, from the oldest frame to the newest."""
        state = cls(captured_at_m)
        for stamp in stamps:
            _append(state, stamp.X_lb_m, stamp.X_ub_m, stamp.outcome)
        return state

    def to_json(self) -> dict[str, Any]:
        """The state as JSON-able values, exact."""
        return {
            "captured_at_m": self.captured_at_m,
            "stamps": [
                [s.X_lb_m, s.X_ub_m, int(o.surface), o.Q_v, o.flag, o.captured_s]
                for s in self.stamps
                for o in (s.outcome,)
            ],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> PreviewState:
        """The state that `to_json` wrote."""
        stamps = (
            Stamp(X_lb, X_ub, Outcome(Surface(surface), Q_v, flag, captured_s))
            for X_lb, X_ub, surface, Q_v, flag, captured_s in data["stamps"]
        )
        return cls.of(stamps, data["captured_at_m"])


def index_of(state: PreviewState, k: int) -> int:
    """Place in the ring of the k-th stamp, counted from the oldest."""
    place = state.first + k
    return place - MOST_STAMPS if place >= MOST_STAMPS else place


def outcome_at(state: PreviewState, place: int) -> Outcome:
    """Outcome of the stamp at a place in the ring."""
    return Outcome(
        Surface(state.surface[place]), state.Q_v[place], state.flag[place], state.captured_s[place]
    )


def add_frame(
    state: PreviewState,
    config: PreviewConfig,
    outcome: Outcome,
    *,
    position_m: float,
    speed_m_s: float,
    frame_interval_s: float,
) -> None:
    """Stamp a frame's outcome, Eq. (11).

    Parameters
    ----------
    state : PreviewState
        Before the frame; changed in place.
    config : PreviewConfig
        Settings.
    outcome : Outcome
        The frame's verdict.
    position_m : float
        P_1, the front wheel's coordinate when the picture was taken [m].
    speed_m_s, frame_interval_s : float
        Speed then and the camera's cycle time, for the length of a first stamp [m/s], [s].
    """
    X_lb = position_m + config.P_0_m
    driven_m = (
        speed_m_s * frame_interval_s if state.captured_at_m is None else position_m - state.captured_at_m
    )
    X_ub = X_lb + max(0.0, driven_m)
    begin_m = math.inf
    newest_m = state.X_lb_m[index_of(state, state.count - 1)] if state.count > 0 else -math.inf
    if not (state.ascending and X_lb - newest_m >= config.resolution_m):
        # Without the stamps that it shares a place with, which it reaches over.
        kept = 0
        for k in range(state.count):
            place = index_of(state, k)
            if abs(X_lb - state.X_lb_m[place]) < config.resolution_m:
                begin_m, X_ub = min(begin_m, state.X_lb_m[place]), max(X_ub, state.X_ub_m[place])
            else:
                _move(state, place, index_of(state, kept))
                kept += 1
        if kept < state.count:
            state.count = kept
            state.ascending = state.ascending or _ascend(state)
    if begin_m < math.inf:
        X_lb = begin_m
    _append(state, X_lb, X_ub, outcome)
    state.captured_at_m = position_m


def _move(state: PreviewState, place: int, to: int) -> None:
    """Copy a stamp to another place."""
    if place != to:
        state.X_lb_m[to] = state.X_lb_m[place]
        state.X_ub_m[to] = state.X_ub_m[place]
        state.surface[to] = state.surface[place]
        state.Q_v[to] = state.Q_v[place]
        state.flag[to] = state.flag[place]
        state.captured_s[to] = state.captured_s[place]


def _append(state: PreviewState, X_lb_m: float, X_ub_m: float, outcome: Outcome) -> None:
    """Put a stamp behind the newest one."""
    if state.count == MOST_STAMPS:
        state.first = index_of(state, 1)
        state.count -= 1
    if state.count > 0 and X_lb_m < state.X_lb_m[index_of(state, state.count - 1)]:
        state.ascending = False
    place = index_of(state, state.count)
    state.X_lb_m[place] = X_lb_m
    state.X_ub_m[place] = X_ub_m
    state.surface[place] = int(outcome.surface)
    state.Q_v[place] = outcome.Q_v
    state.flag[place] = outcome.flag
    state.captured_s[place] = outcome.captured_s
    state.count += 1


def _ascend(state: PreviewState) -> bool:
    """Whether each stamp begins where the one before it begins, or farther on."""
    ascending = True
    for k in range(1, state.count):
        before_m, begin_m = state.X_lb_m[index_of(state, k - 1)], state.X_lb_m[index_of(state, k)]
        ascending = ascending and before_m <= begin_m
    return ascending


def covering(state: PreviewState, config: PreviewConfig, position_m: float) -> Outcome | None:
    """Outcome for the road at a coordinate now, of the newest frame that covers it; None in a gap."""
    begun, begun_m = state.count, -math.inf
    if state.ascending:
        begun = _begun(state, position_m)
    for back in range(begun):
        place = index_of(state, begun - 1 - back)
        if begun_m < state.X_lb_m[place] <= position_m:
            if position_m < state.X_ub_m[place] + config.hold_m:
                return outcome_at(state, place)
            # A newer frame that began here has ended all older ones that began before it.
            begun_m = state.X_lb_m[place]
        if state.ascending:
            return None
    return None


def _begun(state: PreviewState, position_m: float) -> int:
    """How many of ascending stamps begin at a coordinate or before it."""
    low, high = 0, state.count
    while low < high:
        middle = (low + high) // 2
        if position_m < state.X_lb_m[index_of(state, middle)]:
            high = middle
        else:
            low = middle + 1
    return low


def prune(state: PreviewState, config: PreviewConfig, position_m: float) -> None:
    """Take away, in place, the oldest stamps that lie behind the wheels when the front wheel is at a coordinate.

    An expired stamp after one that still holds stays: it ends the older ones that began before it.
    """
    rear_m = position_m - config.behind_m
    while state.count > 0 and state.X_ub_m[state.first] + config.hold_m <= rear_m:
        state.first = index_of(state, 1)
        state.count -= 1
