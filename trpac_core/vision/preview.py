"""From the road seen ahead to the road under the wheel: displacement stamps, Eq. (11).

Positions are the front wheel's odometric coordinate X, the integral of the vehicle's speed [m].

A frame taken at X = P_1 speaks of the road from X_lb = P_1 + P_0 on. Eq. (11) writes X_lb from the position
P_2 when the frame has been processed, less the way driven meanwhile, which is the same place. X_ub lies one
frame interval's way further, so that successive frames tile the road. Real frames come late or not at all, so
the tiling is read as:

* A stamp's length is the way driven since the frame before; for the first frame, speed times frame interval.
* A result holds from its X_lb until the X_lb of the next frame, at most `hold_m` beyond its X_ub; then there is a
  gap: no result. The default is the depth of the near group, the stretch of road that the result was taken from.
* Where several stamps cover a position, the newest frame wins.
* Frames less than `resolution_m` apart share one stamp, with the newest result: a car that stands, or shunts to and
  fro, does not pile up stamps.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

from .classes import Surface

_begin = attrgetter("X_lb_m")


@dataclass(frozen=True)
class Outcome:
    """What a frame, or a classifier elsewhere on the bus, says of the road ahead."""

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
        Way below which two frames share a stamp [m].
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


@dataclass(frozen=True)
class PreviewState:
    """Stamps from the oldest frame to the newest, and where the newest was captured [m]."""

    stamps: tuple[Stamp, ...] = ()
    captured_at_m: float | None = None
    ascending: bool = field(default=True, compare=False)
    """Whether no stamp begins before one of an older frame: so it is unless the car has rolled back."""

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
        stamps = tuple(
            Stamp(X_lb, X_ub, Outcome(Surface(surface), Q_v, flag, captured_s))
            for X_lb, X_ub, surface, Q_v, flag, captured_s in data["stamps"]
        )
        return cls(stamps, data["captured_at_m"], _ascend(stamps))


def add_frame(
    state: PreviewState,
    config: PreviewConfig,
    outcome: Outcome,
    *,
    position_m: float,
    speed_m_s: float,
    frame_interval_s: float,
) -> PreviewState:
    """Stamp a frame's outcome, Eq. (11).

    Parameters
    ----------
    state : PreviewState
        Before the frame.
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
    if state.captured_at_m is None:
        length = max(0.0, speed_m_s * frame_interval_s)
    else:
        length = max(0.0, position_m - state.captured_at_m)
    newest = Stamp(X_lb, X_lb + length, outcome)
    kept, shared = _apart(state, X_lb, config.resolution_m)
    if shared:
        begin_m = min(stamp.X_lb_m for stamp in shared)
        newest = Stamp(begin_m, max(newest.X_ub_m, *(stamp.X_ub_m for stamp in shared)), outcome)
    ascending = state.ascending or (bool(shared) and _ascend(kept))
    ascending = ascending and (not kept or kept[-1].X_lb_m <= newest.X_lb_m)
    return PreviewState((*kept, newest), position_m, ascending)


def _apart(
    state: PreviewState, X_lb_m: float, resolution_m: float
) -> tuple[tuple[Stamp, ...], tuple[Stamp, ...]]:
    """The stamps that begin elsewhere than a new one, and those that it shares a place with."""
    if state.ascending and (not state.stamps or X_lb_m - state.stamps[-1].X_lb_m >= resolution_m):
        return state.stamps, ()
    shared = tuple(s for s in state.stamps if abs(X_lb_m - s.X_lb_m) < resolution_m)
    return tuple(s for s in state.stamps if abs(X_lb_m - s.X_lb_m) >= resolution_m), shared


def _ascend(stamps: tuple[Stamp, ...]) -> bool:
    return all(older.X_lb_m <= newer.X_lb_m for older, newer in pairwise(stamps))


def covering(state: PreviewState, config: PreviewConfig, position_m: float) -> Outcome | None:
    """Outcome for the road at a coordinate now, of the newest frame that covers it; None in a gap."""
    if state.ascending:
        begun = bisect_right(state.stamps, position_m, key=_begin)
        newest = state.stamps[begun - 1] if begun else None
        return newest.outcome if newest and position_m < newest.X_ub_m + config.hold_m else None
    begun_m = -math.inf
    for stamp in reversed(state.stamps):
        if begun_m < stamp.X_lb_m <= position_m:
            if position_m < stamp.X_ub_m + config.hold_m:
                return stamp.outcome
            # A newer frame that began here has ended all older ones that began before it.
            begun_m = stamp.X_lb_m
    return None


def prune(state: PreviewState, config: PreviewConfig, position_m: float) -> PreviewState:
    """The state without the oldest stamps that lie behind the wheels when the front wheel is at a coordinate.

    An expired stamp after one that still holds stays: it ends the older ones that began before it.
    """
    rear_m = position_m - config.behind_m
    expired = 0
    for stamp in state.stamps:
        if stamp.X_ub_m + config.hold_m > rear_m:
            break
        expired += 1
    return replace(state, stamps=state.stamps[expired:]) if expired else state
