"""The cycle under a clock, a bus and a unit that the test holds: what happens when things go wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hil_bench import Bench, driving
from hil_fakes import MS, FakeUnit

from trpac_core.vision.classes import Surface
from trpac_hil.loop import (
    ENDED,
    HELD_BUS,
    HELD_INPUT,
    HELD_UNIT,
    RUNNING,
    STARTING,
)
from trpac_hil.unit import Wiring


def test_each_cycle_steps_the_unit_by_a_period_and_sends_what_it_says() -> None:
    bench = Bench()
    counts = bench.run(50)
    assert (counts.cycles, counts.overruns, counts.held) == (50, 0, 0)
    times, steps, values = zip(*bench.unit.steps, strict=True)
    assert times == pytest.approx(np.arange(50) * 1e-3)
    assert steps == pytest.approx([1e-3] * 50)
    assert values[0] == pytest.approx([20.0 / 0.29, 100.0, 20.0], abs=0.01)
    assert bench.sent("Status") == [RUNNING] * 50 + [ENDED]
    assert bench.sent("Flag") == [1.0] * 50 + [0.0]
    assert [count for name, _, count in bench.bus.sent if name == "Estimate"] == list(range(51))
    assert bench.table["lateness_us"].max() == 0.0
    assert bench.table["age_WheelSpeeds_ms"] == pytest.approx([1.0] * 50), (
        "an age counts from the look before"
    )


def test_a_cycle_that_takes_too_long_is_counted_and_the_slots_that_passed_are_left_out() -> None:
    bench = Bench()

    def slow(number: int) -> None:
        if number == 10:
            bench.clock.time_ns += int(7.5 * MS)

    bench.unit.during_step = slow
    counts = bench.run(40)
    # Slot 10 ends 6.5 ms late; 11 to 16 are over by then, of which 11 missed its deadline by more than 5 ms, too.
    assert (counts.late_ends, counts.left_out, counts.overruns) == (1, 6, 7)
    assert counts.worst_ns == int(6.5 * MS)
    assert counts.long_overruns == 2
    assert counts.cycles == 34
    assert bench.unit.steps[11][1] == pytest.approx(7e-3), "the unit's time stays the wall's"
    assert bench.unit.steps[11][0] + bench.unit.steps[11][1] == pytest.approx(0.018)
    assert bench.table["left_out"].max() == 6
    assert bench.table["lateness_us"][11] == pytest.approx(500.0)


def test_of_cycles_that_take_too_long_those_count_as_overworked_whose_thread_worked_all_the_time() -> None:
    bench = Bench()

    def slow(number: int) -> None:
        bench.clock.worked_ns += MS // 5
        if number in (10, 30):
            bench.clock.time_ns += 3 * MS
            bench.clock.worked_ns += 2 * MS if number == 30 else 0

    bench.unit.during_step = slow
    counts = bench.run(60)
    assert (counts.late_ends, counts.overworked) == (2, 1)
    assert bench.table["cpu_us"].max() == pytest.approx(2200.0)
    assert np.median(bench.table["cpu_us"]) == pytest.approx(200.0)


def test_each_long_overrun_is_put_down_to_what_took_most_of_its_time() -> None:
    bench = Bench()

    def slow(number: int) -> None:
        clock = bench.clock
        clock.worked_ns += MS // 5
        clock.time_ns += MS // 5
        if number in (10, 20, 30, 40):
            clock.time_ns += 8 * MS
        if number == 20:
            clock.worked_ns += 7 * MS
        if number == 30:
            clock.queued_ns += 7 * MS
        if number == 40:
            clock.blocked += 1

    bench.unit.during_step = slow
    bench.clock.overshoot_ns = {60: 12 * MS}
    counts = bench.run(100)
    # 8.2 ms from its begin: the cycle misses its deadline by 7.2 ms, those left out after it by 6.2 and 5.2 ms. A sleep
    # that lasts 12 ms too long leaves out 12 slots, of which the first six are late by 11 to 6 ms.
    assert counts.long_causes == {"own_work": 3, "other_work": 3, "waiting": 3, "machine": 3 + 6, "untold": 0}
    assert sum(counts.long_causes.values()) == counts.long_overruns


def test_a_sleep_that_overshoots_is_an_overrun_of_the_slots_that_it_slept_through() -> None:
    bench = Bench()
    bench.clock.overshoot_ns = {6: int(3.2 * MS)}
    counts = bench.run(20)
    assert (counts.late_ends, counts.left_out, counts.cycles) == (0, 3, 17)
    assert counts.worst_ns == int(2.2 * MS)


def test_after_a_halt_of_more_than_the_units_longest_step_the_unit_goes_on() -> None:
    bench = Bench()
    bench.clock.overshoot_ns = {6: 12_000 * MS}
    bench.run(12_030)
    times, steps, _ = zip(*bench.unit.steps, strict=True)
    assert max(steps) == 10.0
    assert np.diff(times) == pytest.approx(steps[:-1]), "each step begins where the last one ended"
    assert bench.sent("Status")[-2] == RUNNING


def test_slots_that_pass_at_the_very_end_are_counted_and_none_beyond_it() -> None:
    bench = Bench()
    bench.clock.overshoot_ns = {9: 50 * MS}
    counts = bench.run(10)
    assert (counts.cycles, counts.left_out) == (8, 2)


def test_lost_messages_hold_the_estimate_with_flag_0_until_they_are_back() -> None:
    bench = Bench()
    bench.bus.messages = lambda cycle: {} if 20 <= cycle < 120 else driving()
    counts = bench.run(160)
    status = bench.sent("Status")
    # An age counts from the look before: 30 ms after the last message the signals are lost.
    first = status.index(HELD_INPUT)
    assert 20 + 28 <= first <= 20 + 31
    assert status[first:120] == [HELD_INPUT] * (120 - first)
    assert status[120:160] == [RUNNING] * 40
    assert set(bench.sent("Flag")[first:120]) == {0.0}
    assert set(bench.sent("TRPAC")[first:120]) == {0.5}
    assert math.isnan(bench.unit.steps[first][2][0])
    assert counts.held == 120 - first
    assert counts.lost == {"WheelSpeeds": 1, "WheelTorques": 1, "VehicleMotion": 1}
    assert len(bench.told) == 6, "each of three messages: lost, and back"
    assert np.isnan(bench.table["vehicle_speed_m_s"][first:119]).all()


def test_before_the_first_messages_it_is_starting_and_holds() -> None:
    bench = Bench()
    bench.bus.messages = lambda cycle: {} if cycle < 10 else driving()
    counts = bench.run(20)
    assert bench.sent("Status")[:20] == [STARTING] * 10 + [RUNNING] * 10
    assert counts.lost == {}
    assert bench.told == [], "what comes for the first time is not back"


def test_a_lost_bus_holds_and_a_recovered_one_goes_on() -> None:
    bench = Bench()

    def messages(cycle: int) -> dict[str, dict[str, float]]:
        bench.bus.up = not 5 <= cycle < 8
        return driving() if bench.bus.up else {}

    bench.bus.messages = messages
    bench.run(12)
    assert bench.table["status"].tolist() == [RUNNING] * 5 + [HELD_BUS] * 3 + [RUNNING] * 4
    assert bench.table["flag"].tolist() == [1.0] * 5 + [0.0] * 3 + [1.0] * 4


def test_a_step_that_the_unit_discards_is_held_said_once_and_made_up_for() -> None:
    bench = Bench()
    bench.unit.discards = {4, 5}
    counts = bench.run(10)
    assert bench.sent("Status")[:10] == [RUNNING] * 4 + [HELD_UNIT] * 2 + [RUNNING] * 4
    assert bench.sent("Flag")[4:6] == [0.0, 0.0]
    assert bench.unit.steps[4][1] == pytest.approx(3e-3)
    assert bench.table["step_s"] == pytest.approx([1e-3] * 4 + [0.0] * 2 + [3e-3] + [1e-3] * 3)
    assert sum(step for _, step, _ in bench.unit.steps) == pytest.approx(0.010)
    assert counts.discarded == 2
    assert len([text for text in bench.told if "discarded" in text]) == 1


def test_a_wall_clock_that_is_set_is_counted_and_changes_nothing_else() -> None:
    bench = Bench()

    def set_back(number: int) -> None:
        if number == 150:
            bench.clock.wall_offset_ns -= 7_200_000 * MS

    bench.unit.during_step = set_back
    counts = bench.run(400)
    assert (counts.clock_jumps, counts.overruns, counts.held, counts.cycles) == (1, 0, 0, 400)
    assert any("-7200.000 s" in text for text in bench.told)


def test_an_optional_signal_counts_from_its_first_value_and_is_missed_from_then_on() -> None:
    bench = Bench()

    def messages(cycle: int) -> dict[str, dict[str, float]]:
        accelerating = {"AccelX": 1.5} if 5 <= cycle < 8 else {}
        return driving() | {"VehicleMotion": {"VehicleSpeed": 20.0} | accelerating}

    bench.bus.messages = messages
    bench.run(10)
    assert [len(values) for _, _, values in bench.unit.steps] == [3] * 5 + [4] * 5
    assert bench.unit.steps[6][2][3] == pytest.approx(1.5)
    assert bench.sent("Status")[8:10] == [HELD_INPUT] * 2


def road(age_ms: float, number: int, left: float = 1.0) -> dict[str, dict[str, float]]:
    """A camera's message: wet on the left, a given time after the picture."""
    return {
        "RoadClass": {
            "RoadClass_Left": left,
            "RoadClassConfidence_Left": 0.9,
            "RoadClass_Right": 7.0,
            "RoadClass_Age": age_ms,
            "RoadClass_Number": float(number),
        }
    }


@pytest.mark.parametrize("age_ms", [0.0, 50.0, 110.0])
def test_a_class_by_bus_reaches_the_unit_when_the_wheel_reaches_what_the_camera_saw(age_ms: float) -> None:
    bench = Bench()
    at = 200
    bench.bus.messages = lambda cycle: driving() | (road(age_ms, 7) if cycle == at else {})
    bench.run(600)
    taken_m = (at - age_ms) * 0.020
    given, classes, number = bench.unit.classes[0]
    assert classes == [(int(Surface.WET), pytest.approx(0.9))]
    assert number == 1
    assert given * 0.020 == pytest.approx(taken_m + 2.5, abs=0.03)
    ended, classes, _ = bench.unit.classes[1]
    assert classes == [(int(Surface.WET), 0.0)], "where the result ends it is taken back"
    assert ended * 0.020 == pytest.approx(taken_m + 2.5 + 20.0 * 0.05 + 2.0, abs=0.03)


def test_a_camera_that_falls_silent_is_lost_and_one_that_sees_nothing_is_believed() -> None:
    bench = Bench()
    bench.bus.messages = lambda cycle: driving(1.0) | (road(0.0, cycle) if cycle == 100 else {})
    bench.run(1500)
    assert bench.camera_input.losses == 1
    assert [text for text in bench.told if text.startswith("No result of a picture for ")]
    assert bench.table["age_picture_ms"][-1] != bench.table["age_picture_ms"][-1]
    blind = Bench()
    blind.bus.messages = lambda cycle: (
        driving() | (road(0.0, cycle // 20, 1.0 if cycle < 400 else 7.0) if cycle % 20 == 0 else {})
    )
    blind.run(600)
    called, classes, _ = blind.unit.classes[-1]
    assert called == 400
    assert classes == [(int(Surface.WET), 0.0)]


@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_a_confidence_at_either_end_is_no_failed_picture(confidence: float) -> None:
    bench = Bench()
    said = road(0.0, 7)
    said["RoadClass"]["RoadClassConfidence_Left"] = confidence
    bench.bus.messages = lambda cycle: driving() | (said if cycle == 50 else {})
    bench.run(60)
    assert (bench.stamps.counts.results, bench.stamps.counts.failed) == (1, 0)


def test_of_four_wheels_one_without_its_signals_holds_alone_and_each_has_its_own_estimate_on_the_bus() -> (
    None
):
    bench = Bench(unit=FakeUnit(Wiring.of_four()))
    whole = driving()
    lame = driving()
    lame["WheelSpeeds"]["WheelSpeed_RL"] = math.nan
    deaf = driving()
    del deaf["VehicleMotion"]["VehicleSpeed"]
    bench.bus.messages = lambda cycle: [whole, lame, deaf][min(cycle // 10, 2)]
    bench.run(30)
    assert bench.sent("Status")[:30] == [RUNNING] * 20 + [HELD_INPUT] * 10
    names = list(bench.unit.wiring.required)
    assert math.isnan(bench.unit.steps[15][2][names.index("wheel_speed.rl")])
    wheels = bench.bus.named("EstimateWheels")
    assert len(wheels) == 31
    assert wheels[0]["TRPAC_RR"] == pytest.approx(0.5)
    assert (wheels[15]["Flag_FL"], wheels[25]["Flag_FL"]) == (1.0, 0.0)


def test_health_tells_overruns_and_ages_ten_times_a_second() -> None:
    bench = Bench()
    bench.bus.messages = lambda cycle: driving() if cycle < 950 else {}
    bench.run(1000)
    health = bench.bus.named("Health")
    assert len(health) == 10
    assert health[0]["InputAge"] <= 2.0
    assert health[0]["PictureAge"] == 4095.0
    assert {entry["Overruns"] for entry in health} == {0.0}
