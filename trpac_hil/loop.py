"""The cycle in real time: read the bus, step the unit, send."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from trpac_core.sensors import LONGEST_STEP_S
from trpac_hil.bus import Link
from trpac_hil.camera_input import CameraInput
from trpac_hil.codec import CLASS_MESSAGE, Codec
from trpac_hil.deadlines import SPIN_NS, Deadlines, SystemClock, WallWatch, wait_until
from trpac_hil.delays import Delays
from trpac_hil.events import Events
from trpac_hil.inputs import Inputs
from trpac_hil.preview_stamps import Odometer
from trpac_hil.records import LOGGED
from trpac_hil.shared import Ring
from trpac_hil.unit import Estimates, Unit

HEALTH_EVERY_NS = 100_000_000
"""Cycle time of the message Health [ns]."""
CHECK_EVERY_NS = 100_000_000
"""Time between checks of bus state, time of day and helper processes [ns]."""
LONG_NS = 5_000_000
"""Overruns beyond this are also counted as long ones [ns]."""
STARTING, RUNNING, HELD_INPUT, HELD_BUS, HELD_UNIT, ENDED = 0, 1, 2, 3, 4, 7
"""Values of the signal Status."""
NAN = math.nan


@dataclass
class Counts:
    """Counts of the loop.

    `overruns` are cycles that ended after their deadline and cycles left out; `long_overruns` those of them by more
    than 5 ms, by `trpac_hil.delays.CAUSES` in `long_causes`; `worst_ns` is the greatest time by which a deadline was
    missed. `overworked` are cycles whose own processor time was longer than a period.
    """

    cycles: int = 0
    late_ends: int = 0
    left_out: int = 0
    long_overruns: int = 0
    long_causes: dict[str, int] = field(default_factory=dict)
    worst_ns: int = 0
    overworked: int = 0
    discarded: int = 0
    starting: int = 0
    held: int = 0
    clock_jumps: int = 0
    lost: dict[str, int] = field(default_factory=dict)

    @property
    def overruns(self) -> int:
        """Number of deadlines that were missed."""
        return self.late_ends + self.left_out


class Loop:
    """One run of the loop."""

    def __init__(
        self,
        clock: SystemClock,
        deadlines: Deadlines,
        bus: Link,
        unit: Unit,
        codec: Codec,
        inputs: Inputs,
        camera_input: CameraInput,
        ring: Ring,
        events: Events,
        delays: Delays,
        check: Callable[[], None] = lambda: None,
        spin_ns: int = SPIN_NS,
    ) -> None:
        self.counts, self.odometer = Counts(), Odometer()
        self._clock, self._deadlines, self._spin_ns = clock, deadlines, spin_ns
        self._bus, self._unit, self._codec, self._inputs = bus, unit, codec, inputs
        self._camera_input, self._ring, self._events, self._check = camera_input, ring, events, check
        self._delays = delays
        self._wall = WallWatch(clock)
        self._polled_ns = clock.now_ns()
        self._unit_time_s, self._unit_slot = 0.0, -1
        self._sent = dict.fromkeys(("Estimate", "EstimateWheels", "Health"), 0)
        self._wired = dict(unit.wiring.required)
        self._supplies = codec.supplies
        self._required = codec.supplies_of(codec.roles[role] for role in self._wired.values())
        self._references = unit.references(tuple(self._wired))
        self._fresh: dict[str, bool] = {}
        self._next_check_ns = self._next_health_ns = 0

    def run(self, stop: Callable[[], bool], slots: int | None = None) -> Counts:
        """Run cycles until `stop` returns True, or for a number of slots; returns the counts."""
        deadlines, clock, done = self._deadlines, self._clock, -1
        self._polled_ns = wait_until(clock, deadlines.due_ns(-1), self._spin_ns)
        self._bus.receive()  # messages received so far may be of any age
        self._delays.start()
        while not stop() and (slots is None or done + 1 < slots):
            due_ns, longs = deadlines.due_ns(done + 1), self.counts.long_overruns
            now_ns = wait_until(clock, due_ns, self._spin_ns)
            slot = deadlines.next_slot(done, now_ns)
            left_out = (slot if slots is None else min(slot, slots)) - done - 1
            self._leave_out(done + 1, left_out, now_ns)
            if slots is None or slot < slots:
                self._cycle(slot, left_out, now_ns)
            longs = self.counts.long_overruns - longs
            self._delays.settle(due_ns - self._spin_ns, deadlines.due_ns(slot + 1), longs)
            done = slot
        self.counts.long_causes = dict(self._delays.longs)
        self._send_estimate(self._unit.last.held(), ENDED)
        return self.counts

    def _leave_out(self, first: int, number: int, now_ns: int) -> None:
        """Count cycles that were left out, each as a missed deadline."""
        if number <= 0:
            return
        counts, period_ns = self.counts, self._deadlines.period_ns
        counts.left_out += number
        missed_ns = self._deadlines.missed_by_ns(first, now_ns)
        counts.worst_ns = max(counts.worst_ns, missed_ns)
        # Each slot of a row that was left out missed its deadline by one period less than the slot before.
        counts.long_overruns += max(0, min(number, -(-(missed_ns - LONG_NS) // period_ns)))

    def _cycle(self, slot: int, left_out: int, began_ns: int) -> None:
        passed_s = (left_out + 1) * self._deadlines.period_ns * 1e-9
        cpu_began_ns = self._clock.cpu_ns()
        fresh = self._receive(began_ns)
        values = self._snapshot(began_ns)
        self.odometer.drive(began_ns, values["vehicle_speed_m_s"], passed_s if slot else 0.0)
        camera_input = self._camera_input
        camera_input.share_motion(self.odometer, values)
        heard, doubted = self._inputs.heard.get(CLASS_MESSAGE), self._inputs.doubted(began_ns)
        if camera_input.news(
            heard,
            CLASS_MESSAGE in fresh,
            CLASS_MESSAGE in doubted,
            self.odometer,
            began_ns,
            self._events.report,
        ):
            self._unit.give_class(camera_input.classes, camera_input.number)
        readings = self._readings(values)
        unit_began_ns = self._clock.now_ns()
        # The unit discards longer steps: after a longer halt its time falls behind the wall's.
        step_s = min((slot - self._unit_slot) * self._deadlines.period_ns * 1e-9, LONGEST_STEP_S)
        estimates = self._unit.step(self._unit_time_s, step_s, self._references, readings)
        unit_ended_ns = self._clock.now_ns()
        status = self._judge(estimates, readings, bool(doubted))
        if estimates is None:
            estimates, step_s = self._unit.last, 0.0
        else:
            self._unit_slot, self._unit_time_s = slot, self._unit_time_s + step_s
        if status != RUNNING:
            estimates = estimates.held()
        self._send_estimate(estimates, status)
        self._check_and_send_health(began_ns)
        ended_ns, cpu_ns = self._clock.now_ns(), self._clock.cpu_ns() - cpu_began_ns
        missed_ns = max(0, self._deadlines.missed_by_ns(slot, ended_ns))
        self._count(missed_ns, cpu_ns, status)
        timing = (
            began_ns - self._deadlines.due_ns(slot),
            ended_ns - began_ns,
            cpu_ns,
            unit_ended_ns - unit_began_ns,
            missed_ns,
        )
        self._record(slot, step_s, values, estimates, status, timing, left_out, began_ns)

    def _receive(self, now_ns: int) -> set[str]:
        """Store received messages, which came after the last poll at the earliest; returns names of new ones."""
        earliest_ns, self._polled_ns = self._polled_ns, now_ns
        take = self._inputs.take
        return {
            name
            for m in self._bus.receive()
            if (name := take(m.arbitration_id, m.is_extended_id, bytes(m.data), earliest_ns))
        }

    def _snapshot(self, now_ns: int) -> dict[str, float]:
        """Current value of all quantities, NaN where lost; reports what is required and is lost or back."""
        value = self._inputs.value
        values = {role: value(role, now_ns) for role in LOGGED}
        for supply in self._required:
            name, age_ns = supply.name, self._inputs.age_ns(supply, now_ns)
            here = 0 <= age_ns <= supply.stale_ns
            if self._fresh.get(name, False) and not here:
                self.counts.lost[name] = self.counts.lost.get(name, 0) + 1
                self._events.report(
                    f"lost {name}",
                    f"{name}: none for more than {supply.stale_ns * 1e-6:g} ms. TRPAC is held with flag 0 until it is "
                    "back.",
                )
            elif here and not self._fresh.get(name, True):
                self._events.report(f"back {name}", f"{name} is back.")
            if here or name in self._fresh:
                self._fresh[name] = here
        return values

    def _readings(self, values: dict[str, float]) -> list[float]:
        """Values of the unit's inputs; an optional one is used, and can be lost, from its first value on."""
        for variable, role in self._unit.wiring.optional.items():
            if variable not in self._wired and values[role] == values[role]:
                self._wired[variable] = role
                self._references = self._unit.references(tuple(self._wired))
        return [values[role] for role in self._wired.values()]

    def _judge(self, estimates: Estimates | None, readings: Sequence[float], doubted: bool) -> int:
        """Value of the signal Status in this cycle."""
        if not self._bus.up:
            return HELD_BUS
        if estimates is None:
            self.counts.discarded += 1
            self._events.report(
                "discarded",
                "The unit discarded a step: the last estimate is held with flag 0, and the loop continues.",
            )
            return HELD_UNIT
        if self._missing(readings):
            started = len(self._fresh) == len(self._required)
            return HELD_INPUT if started else STARTING
        return HELD_INPUT if doubted else RUNNING

    def _missing(self, readings: Sequence[float]) -> bool:
        """Whether lost signals prevent the estimate of all wheels; signals of one wheel hold that wheel alone."""
        lost = [name for name, reading in zip(self._wired, readings, strict=True) if reading != reading]
        if not lost:
            return False
        own = {name.rpartition(".")[2] for name in lost if "." in name}
        return any("." not in name for name in lost) or len(own) == len(self._unit.wiring.wheels)

    def _send_estimate(self, estimates: Estimates, status: int) -> None:
        self._send(
            "Estimate",
            {
                "TRPAC": estimates.TRPAC,
                "TRPAC_std": estimates.TRPAC_std,
                "K_v": estimates.K_v,
                "Flag": float(estimates.flag),
                "Excitation": float(estimates.excitation),
                "Status": float(status),
                "TRPAC_dynamics": estimates.TRPAC_dynamics,
            },
        )
        if estimates.wheels:
            names = [w.upper() for w in self._unit.wiring.wheels]
            thetas = {f"TRPAC_{w}": t for w, t in zip(names, estimates.wheels, strict=True)}
            flags = {f"Flag_{w}": float(f) for w, f in zip(names, estimates.wheel_flags, strict=True)}
            self._send("EstimateWheels", thetas | flags)

    def _send(self, name: str, values: dict[str, float]) -> None:
        coded = self._codec[name]
        data = coded.encode(values, self._sent[name])
        self._sent[name] += 1
        self._bus.send(coded.message.frame_id, coded.message.is_extended_frame, data)

    def _check_and_send_health(self, now_ns: int) -> None:
        """Check bus, helpers and time of day, and send the message Health, where these are due."""
        if now_ns >= self._next_check_ns:
            self._next_check_ns = now_ns + CHECK_EVERY_NS
            self._bus.check()
            self._check()
            jump_ns = self._wall.jump_ns()
            if jump_ns:
                self.counts.clock_jumps += 1
                self._events.report(
                    "clock jump",
                    f"The wall clock was set by {jump_ns * 1e-9:+.3f} s. The loop uses another clock and is not "
                    "affected.",
                )
        if now_ns >= self._next_health_ns:
            self._next_health_ns = now_ns + HEALTH_EVERY_NS
            picture_ms = self._camera_input.picture_age_ms(now_ns)
            ages_ns = [self._inputs.age_ns(supply, now_ns) for supply in self._required]
            self._send(
                "Health",
                {
                    "Overruns": float(self.counts.overruns),
                    "WorstOverrun": self.counts.worst_ns * 1e-6,
                    "InputAge": max(ages_ns, default=0) * 1e-6 if min(ages_ns, default=0) >= 0 else math.inf,
                    "PictureAge": math.inf if math.isnan(picture_ms) else picture_ms,
                    "BusLosses": float(self._bus.losses),
                },
            )

    def _count(self, missed_ns: int, cpu_ns: int, status: int) -> None:
        counts = self.counts
        counts.overworked += cpu_ns > self._deadlines.period_ns
        counts.cycles += 1
        counts.starting += status == STARTING
        counts.held += status in (HELD_INPUT, HELD_BUS, HELD_UNIT)
        if missed_ns:
            counts.late_ends += 1
            counts.long_overruns += missed_ns > LONG_NS
            counts.worst_ns = max(counts.worst_ns, missed_ns)

    def _record(
        self,
        slot: int,
        step_s: float,
        values: dict[str, float],
        estimates: Estimates,
        status: int,
        timing_ns: tuple[int, int, int, int, int],
        left_out: int,
        now_ns: int,
    ) -> None:
        """Write the cycle's row, in the order of `trpac_hil.records.columns`."""
        age_ns, camera_input = self._inputs.age_ns, self._camera_input
        self._ring.write(
            [
                slot * self._deadlines.period_ns * 1e-9,
                step_s,
                self.odometer.position_m,
                *(values[role] for role in LOGGED),
                camera_input.number,
                *(surface for surface, _ in camera_input.classes),
                *(Q_v for _, Q_v in camera_input.classes),
                estimates.TRPAC,
                estimates.TRPAC_std,
                estimates.low,
                estimates.high,
                estimates.K_v,
                estimates.flag,
                estimates.excitation,
                estimates.TRPAC_dynamics,
                *estimates.wheels,
                *estimates.wheel_flags,
                status,
                *(part * 1e-3 for part in timing_ns),
                left_out,
                self.counts.overruns,
                *(age * 1e-6 if (age := age_ns(s, now_ns)) >= 0 else NAN for s in self._supplies),
                camera_input.picture_age_ms(now_ns),
                camera_input.age_under_wheel_ms(now_ns),
            ]
        )
