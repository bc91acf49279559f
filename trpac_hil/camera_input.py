"""Camera results as the loop uses them: from the camera's process or the bus to the inputs of the unit."""

from __future__ import annotations

import math
from collections.abc import Mapping

from trpac_core.estimator import RoadClass
from trpac_core.vision.classes import Surface
from trpac_core.vision.preview import Outcome
from trpac_hil.camera import FAILED, HEAD
from trpac_hil.inputs import Heard, ReportEvent
from trpac_hil.preview_stamps import CameraResult, Odometer, PreviewStamps
from trpac_hil.shared import Numbers, Ring
from trpac_hil.unit import NO_CLASS

SURFACES = {float(surface.value): surface for surface in Surface}
STEEPEST_RAD = 1.5
"""Steering angles of this size or more are not used [rad]."""


class CameraInput:
    """The road class under the front wheel.

    Parameters
    ----------
    stamps : PreviewStamps
        Stamps of the results.
    stale_ns : int
        Time without a result after which the camera counts as lost [ns].
    side_names : tuple of str
        Tracks of the unit: 'left', 'right', or both.
    results, motion : Ring, Numbers
        Memory shared with the camera's process; None where results come by bus.

    Attributes
    ----------
    classes : list of (int, float)
        Class and confidence per side for the unit; confidence 0 where there is no result any more.
    number : int
        How often these have changed.
    losses, left_out, work_ms : int, int, list of float
        How often the camera was lost, pictures that its process left out, and its time for each [ms].
    """

    def __init__(
        self,
        stamps: PreviewStamps,
        stale_ns: int,
        side_names: tuple[str, ...],
        results: Ring | None = None,
        motion: Numbers | None = None,
    ) -> None:
        self.stamps, self.number, self.losses, self.left_out = stamps, 0, 0, 0
        self.classes = [(NO_CLASS, 0.0)] * len(side_names)
        self.work_ms: list[float] = []
        self._stale_ns, self._side_names = stale_ns, side_names
        self._results, self._motion = results, motion
        self._given: tuple[Outcome | None, ...] = (None,) * len(side_names)
        self._number_by_bus = math.nan

    def share_motion(self, odometer: Odometer, values: Mapping[str, float]) -> None:
        """Share the car's motion with the camera's process; lost signals are 0, a lost yaw rate is NaN."""
        if self._motion is not None:
            accel, steering = values["accel_x_m_s2"], values["steering_angle_rad"]
            self._motion.set(
                (
                    odometer.speed_m_s,
                    accel if math.isfinite(accel) else 0.0,
                    steering if abs(steering) < STEEPEST_RAD else 0.0,
                    values["yaw_rate_rad_s"],
                    odometer.position_m,
                )
            )

    def news(
        self,
        heard: Heard | None,
        fresh: bool,
        doubted: bool,
        odometer: Odometer,
        now_ns: int,
        report: ReportEvent,
    ) -> bool:
        """Stamp new results; returns whether the classes for the unit have changed.

        `heard` is the newest message RoadClass, None where the bus has none, `fresh` whether it has just come, and
        `doubted` whether two devices send it: then no result of the bus is used.
        """
        stamps = self.stamps
        by_bus = self._results is None
        if by_bus and doubted:
            fresh = False
            stamps.forget()
        for result in self._by_bus(heard, fresh, now_ns, report) if by_bus else self._shared(now_ns):
            stamps.take(result, odometer, self._stale_ns)
        newest = stamps.newest
        if newest is not None and now_ns - newest.arrived_ns > self._stale_ns:
            stamps.newest = None
            stamps.forget()
            self.losses += 1
            report(
                "lost camera",
                f"No result of a picture for {self._stale_ns * 1e-6:g} ms: the loop continues without the camera.",
            )
        known = tuple(stamps.known(side, odometer.position_m) for side in range(len(self._given)))
        if known == self._given:
            return False
        self.classes = [
            (before[0], 0.0) if outcome is None else (int(outcome.surface), outcome.Q_v)
            for outcome, before in zip(known, self.classes, strict=True)
        ]
        self._given, self.number = known, self.number + 1
        return True

    def _shared(self, now_ns: int) -> list[CameraResult]:
        """New results of the camera's process."""
        if self._results is None or not self._results.waiting:
            return []
        rows = self._results.read()
        self.left_out = int(rows[-1, 3]) if len(rows) else self.left_out
        self.work_ms.extend(rows[:, 4].tolist())
        return [
            CameraResult(
                int(row[0]),
                int(row[1]),
                now_ns,
                tuple(
                    None if row[at] == FAILED else RoadClass(SURFACES[row[at]], float(row[at + 1]))
                    for at in range(HEAD, len(row), 2)
                ),
            )
            for row in rows
        ]

    def _by_bus(
        self, heard: Heard | None, fresh: bool, now_ns: int, report: ReportEvent
    ) -> list[CameraResult]:
        """The result in the message RoadClass where it is new; its picture was taken `RoadClass_Age` before."""
        if heard is None or not fresh or heard.values["RoadClass_Number"] == self._number_by_bus:
            return []
        values = heard.values
        self._number_by_bus = values["RoadClass_Number"]
        age_ms = values["RoadClass_Age"]
        if math.isnan(age_ms):
            age_ms = 0.0
            report(
                "class without age",
                "RoadClass_Age is not available: the time of arrival is taken as the time of the picture.",
            )
        classes = []
        for side in self._side_names:
            surface = SURFACES.get(values[f"RoadClass_{side.capitalize()}"])
            Q_v = values[f"RoadClassConfidence_{side.capitalize()}"]
            classes.append(RoadClass(surface, Q_v) if surface is not None and 0.0 <= Q_v <= 1.0 else None)
        captured_ns = now_ns - round(age_ms * 1e6)
        return [CameraResult(int(self._number_by_bus), captured_ns, now_ns, tuple(classes))]

    def picture_age_ms(self, now_ns: int) -> float:
        """Time since the newest picture was taken, NaN without one [ms]."""
        newest = self.stamps.newest
        return math.nan if newest is None else (now_ns - newest.captured_ns) * 1e-6

    def age_under_wheel_ms(self, now_ns: int) -> float:
        """Time since the picture of the road under the front wheel was taken, the older of two [ms]; NaN: none."""
        ages = [now_ns * 1e-6 - outcome.captured_s * 1e3 for outcome in self._given if outcome is not None]
        return max(ages) if ages else math.nan
