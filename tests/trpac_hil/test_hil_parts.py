"""The rig's parts: messages, deadlines, ages, places of results, lost bus, log."""

from __future__ import annotations

import ctypes
import gc
import math
import os
import re
import signal as signals
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import can
import hil_bodies
import numpy as np
import pytest
from asammdf import MDF
from hil_fakes import MS, FakeClock, RaisingBus, unsaid
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import ScenarioError
from trpac_core.estimator import RoadClass
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.preview import PreviewConfig
from trpac_hil import helper
from trpac_hil.bus import BusSettings, Link, bus_options
from trpac_hil.bus_relay import BusRelay, RelayedBus, relay_ring
from trpac_hil.camera import FAILED, MOTION, result_columns
from trpac_hil.camera_input import CameraInput
from trpac_hil.codec import DBC_FILE, INPUT_MESSAGES, OUTPUT_MESSAGES, load_codec
from trpac_hil.dbc_table import TARGET, document
from trpac_hil.deadlines import Deadlines, SystemClock, WallWatch, wait_until
from trpac_hil.errors import HilError
from trpac_hil.events import Events
from trpac_hil.figures import TIMING_COLUMNS, Figures
from trpac_hil.inputs import Inputs
from trpac_hil.mdf import MdfLog
from trpac_hil.plant_node import PLAIN_SCENARIO, PlantJob, PlantNode
from trpac_hil.preview_stamps import CameraResult, Odometer, PreviewStamps
from trpac_hil.quantile_sketch import QuantileSketch
from trpac_hil.realtime import as_before, loop_core, pin, undisturbed
from trpac_hil.records import columns
from trpac_hil.rig import Rig, Stopper, _vision
from trpac_hil.settings import HilSettings
from trpac_hil.shared import Numbers, Ring
from trpac_hil.unit import NO_CLASS, Wiring

CODEC = load_codec()


# Messages


@given(st.data())
def test_every_message_brings_back_what_was_sent_to_half_a_step(data: st.DataObject) -> None:
    coded = CODEC[data.draw(st.sampled_from(INPUT_MESSAGES + OUTPUT_MESSAGES))]
    scales = {s.name: float(s.scale) for s in coded.message.signals}
    values = {s: data.draw(st.floats(*coded.bounds[s]), label=s) for s in coded.signals}
    count = data.draw(st.integers(0, 1000))
    back, counted = coded.decode(coded.encode(values, count))
    assert counted == count % coded.counts
    for name in coded.signals:
        if not math.isnan(back[name]):
            assert back[name] == pytest.approx(values[name], abs=0.5001 * scales[name])
        else:
            assert name in coded.absent


@given(st.sampled_from(INPUT_MESSAGES), st.floats())
def test_any_number_can_be_sent_and_comes_back_within_bounds_or_not_at_all(name: str, value: float) -> None:
    coded = CODEC[name]
    back, _ = coded.decode(coded.encode(dict.fromkeys(coded.signals, value)))
    for signal, got in back.items():
        low, high = coded.bounds[signal]
        if math.isnan(value) and signal in coded.absent:
            assert math.isnan(got)
        else:
            assert low - 1e-9 <= got <= high + 1e-9


def test_each_signal_has_a_unit_or_is_a_count_a_class_or_a_share_and_each_input_a_limit() -> None:
    for name in (*INPUT_MESSAGES[:-1], *OUTPUT_MESSAGES):
        message = CODEC[name].message
        assert message.comment
        assert message.cycle_time
        assert all(s.comment for s in message.signals)
        if name in INPUT_MESSAGES:
            assert set(CODEC[name].stale_ns) == set(CODEC[name].signals)


def test_the_messages_page_is_that_of_the_dbc_file() -> None:
    assert TARGET.read_text(encoding="utf-8") == document(), "run python -m trpac_hil.dbc_table"


def test_a_dbc_file_of_ones_own_may_move_everything_but_must_have_all_signals(tmp_path: Path) -> None:
    text = DBC_FILE.read_text(encoding="utf-8")
    moved = tmp_path / "moved.dbc"
    moved.write_text(text.replace(" 256 ", " 1300 ").replace("(0.002,-20)", "(0.004,-20)"), encoding="utf-8")
    assert load_codec(moved)["WheelSpeeds"].message.frame_id == 1300
    lacking = tmp_path / "lacking.dbc"
    lacking.write_text(text.replace("YawRate", "GierRate"), encoding="utf-8")
    with pytest.raises(HilError, match=r"lacking\.dbc: lacks VehicleMotion\.YawRate\. Expected"):
        load_codec(lacking)
    broken = tmp_path / "broken.dbc"
    broken.write_text("BO_ nonsense", encoding="utf-8")
    with pytest.raises(HilError, match="cannot be read as DBC"):
        load_codec(broken)


def test_a_dbc_file_without_ranges_leaves_what_the_bits_can_hold(tmp_path: Path) -> None:
    plain = tmp_path / "plain.dbc"
    plain.write_text(re.sub(r"\[[-0-9.e+]+\|[-0-9.e+]+\]", "[0|0]", DBC_FILE.read_text(encoding="utf-8")))
    codec = load_codec(plain)
    for name in INPUT_MESSAGES + OUTPUT_MESSAGES:
        coded = codec[name]
        for value in (math.inf, -math.inf, 1e9, -1e9):
            back, _ = coded.decode(coded.encode(dict.fromkeys(coded.signals, value)))
            assert not any(math.isnan(got) for got in back.values())
        for signal, (low, high) in coded.bounds.items():
            stated = CODEC[name].bounds[signal]
            assert low <= stated[0] <= stated[1] <= high


def test_a_message_without_a_counter_is_new_each_time(tmp_path: Path) -> None:
    uncounted = tmp_path / "uncounted.dbc"
    text = DBC_FILE.read_text(encoding="utf-8")
    uncounted.write_text(
        re.sub(r"^ SG_ WheelSpeeds_?Counter .*\n", "", text, flags=re.MULTILINE), encoding="utf-8"
    )
    codec = load_codec(uncounted)
    coded = codec["WheelSpeeds"]
    assert not coded.counter
    data = coded.encode(dict.fromkeys(coded.signals, 50.0), 3)
    assert coded.decode(data)[1] == -1
    inputs = Inputs(codec, unsaid)
    assert [inputs.take(256, False, data, at) for at in (0, 20 * MS, 40 * MS)] == ["WheelSpeeds"] * 3
    assert inputs.heard["WheelSpeeds"].lost == 0


# Time


@given(st.integers(1, 10 * MS), st.integers(0, 10**6), st.integers(0, 10**12))
def test_the_next_slot_is_one_further_or_the_one_that_is_on_now(
    period_ns: int, done: int, late_ns: int
) -> None:
    deadlines = Deadlines(123, period_ns)
    now_ns = deadlines.due_ns(done) + late_ns
    slot = deadlines.next_slot(done, now_ns)
    assert slot > done
    assert slot == done + 1 or deadlines.due_ns(slot) <= now_ns < deadlines.due_ns(slot + 1)
    assert (deadlines.missed_by_ns(done, now_ns) > 0) == (now_ns > deadlines.due_ns(done + 1))


def test_waiting_sleeps_most_of_the_way_and_ends_at_the_time_or_after() -> None:
    clock = FakeClock()
    due_ns = clock.now_ns() + 10 * MS
    clock.overshoot_ns = {1: 3}
    assert wait_until(clock, due_ns, spin_ns=0) == due_ns + 3
    assert clock.sleeps == 1
    assert wait_until(clock, due_ns - MS) == due_ns + 3
    assert clock.sleeps == 1


def test_a_wall_clock_that_is_set_is_noticed_once_and_one_that_is_slewed_is_not() -> None:
    clock = FakeClock()
    watch = WallWatch(clock)
    clock.wall_offset_ns += 20 * MS
    assert watch.jump_ns() == 0
    clock.wall_offset_ns -= 3_600_000 * MS
    assert watch.jump_ns() == -3_600_000 * MS
    assert watch.jump_ns() == 0


# Inputs


def speeds(count: int, value: float = 50.0) -> tuple[int, bool, bytes]:
    coded = CODEC["WheelSpeeds"]
    return 256, False, coded.encode(dict.fromkeys(coded.signals, value), count)


def test_a_signal_is_lost_when_it_is_older_than_its_limit_and_back_with_the_next_message() -> None:
    inputs = Inputs(CODEC, unsaid)
    assert math.isnan(inputs.value("wheel_speed_fl_rad_s", 0))
    assert inputs.take(*speeds(0), at_ns=0) == "WheelSpeeds"
    assert inputs.value("wheel_speed_fl_rad_s", 30 * MS) == pytest.approx(50.0)
    assert math.isnan(inputs.value("wheel_speed_fl_rad_s", 30 * MS + 1))
    inputs.take(*speeds(1, 60.0), at_ns=40 * MS)
    assert inputs.value("wheel_speed_fl_rad_s", 41 * MS) == pytest.approx(60.0)
    assert inputs.age_ns(CODEC.supplies[0], 41 * MS) == MS


def test_a_counter_that_stands_still_is_old_news_and_one_that_jumps_counts_the_missing() -> None:
    said: list[str] = []
    inputs = Inputs(CODEC, lambda kind, text: said.append(kind))
    inputs.take(*speeds(14), at_ns=0)
    assert inputs.take(*speeds(14), at_ns=20 * MS) == ""
    assert inputs.age_ns(CODEC.supplies[0], 20 * MS) == 20 * MS
    assert inputs.take(*speeds(1), at_ns=21 * MS) == "WheelSpeeds"
    heard = inputs.heard["WheelSpeeds"]
    assert (heard.received, heard.frozen, heard.lost) == (3, 1, 2)
    assert said == ["frozen WheelSpeeds"]
    without = Inputs(CODEC, unsaid, counters=False)
    assert [without.take(*speeds(0), at_ns=at) for at in (0, 1)] == ["WheelSpeeds"] * 2


def test_what_is_not_available_is_lost_alone_and_what_is_too_short_is_left_aside() -> None:
    said: list[str] = []
    inputs = Inputs(CODEC, lambda kind, text: said.append(text))
    coded = CODEC["WheelSpeeds"]
    values = dict.fromkeys(coded.signals, 50.0) | {"WheelSpeed_RL": math.nan}
    inputs.take(256, False, coded.encode(values), at_ns=0)
    assert math.isnan(inputs.value("wheel_speed_rl_rad_s", 1))
    assert inputs.value("wheel_speed_rr_rad_s", 1) == pytest.approx(50.0)
    assert inputs.take(256, False, b"\x00\x01", at_ns=1) == ""
    assert inputs.take(999, False, b"", at_ns=1) == ""
    assert "2 bytes; expected 8" in said[0]


# Places


def driven(speed_m_s: float, seconds: float, odometer: Odometer, from_ns: int = 0) -> int:
    """Drive in steps of a millisecond; returns the time at the end."""
    now_ns = from_ns
    for _ in range(round(seconds * 1e3)):
        now_ns += MS
        odometer.drive(now_ns, speed_m_s, 1e-3)
    return now_ns


def result(number: int, captured_ns: int, arrived_ns: int, surface: Surface | None) -> CameraResult:
    road_class = None if surface is None else RoadClass(surface, 0.9)
    return CameraResult(number, captured_ns, arrived_ns, (road_class,))


def preview_stamps() -> PreviewStamps:
    return PreviewStamps(PreviewConfig(P_0_m=2.5, hold_m=2.0), 0.05, sides=1)


@pytest.mark.parametrize("late_s", [0.0, 0.06, 0.12])
def test_a_result_is_placed_where_its_picture_was_taken_however_late_it_comes(late_s: float) -> None:
    odometer, places = Odometer(), preview_stamps()
    captured_ns = driven(20.0, 1.0, odometer)
    captured_m = odometer.position_m
    now_ns = driven(20.0, late_s, odometer, captured_ns)
    places.take(result(1, captured_ns, now_ns, Surface.WET), odometer, 1000 * MS)
    near_m = captured_m + 2.5
    assert places.known(0, near_m - 0.01) is None
    seen = places.known(0, near_m + 0.01)
    assert seen is not None
    assert seen.surface is Surface.WET
    assert places.known(0, near_m + 20.0 * 0.05 + 2.01) is None
    assert (places.counts.late, places.counts.in_vain) == (0, 0)


def test_a_result_that_comes_on_its_stretch_acts_from_then_on_and_one_beyond_it_never() -> None:
    odometer, places = Odometer(), preview_stamps()
    captured_ns = driven(20.0, 1.0, odometer)
    now_ns = driven(20.0, 0.2, odometer, captured_ns)
    places.take(result(1, captured_ns, now_ns, Surface.WET), odometer, 1000 * MS)
    assert places.known(0, odometer.position_m) is not None
    assert (places.counts.late, places.counts.in_vain) == (1, 0)
    captured_ns = now_ns
    now_ns = driven(20.0, 0.6, odometer, captured_ns)
    places.take(result(2, captured_ns, now_ns, Surface.DRY), odometer, 1000 * MS)
    assert places.known(0, odometer.position_m) is None
    assert (places.counts.late, places.counts.in_vain) == (2, 1)


def test_a_result_that_was_overtaken_or_is_older_than_the_memory_is_not_placed() -> None:
    odometer, places = Odometer(), preview_stamps()
    now_ns = driven(10.0, 1.0, odometer)
    places.take(result(1, now_ns - 50 * MS, now_ns, Surface.DRY), odometer, 1000 * MS)
    places.take(result(0, now_ns - 90 * MS, now_ns, Surface.WET), odometer, 1000 * MS)
    places.take(result(2, -5, now_ns, Surface.WET), odometer, 1000 * MS)
    assert (places.counts.results, places.counts.unplaced) == (3, 2)


def test_while_pictures_fail_nothing_is_known_and_after_a_good_one_it_is_again() -> None:
    odometer, places = Odometer(), preview_stamps()
    now_ns = driven(10.0, 1.0, odometer)
    places.take(result(1, now_ns, now_ns, Surface.DRY), odometer, 1000 * MS)
    now_ns = driven(10.0, 0.3, odometer, now_ns)
    assert places.known(0, odometer.position_m) is not None
    places.take(result(2, now_ns, now_ns, None), odometer, 1000 * MS)
    assert places.known(0, odometer.position_m) is None
    places.take(result(3, now_ns + 1, now_ns + 1, Surface.DRY), odometer, 1000 * MS)
    assert places.known(0, odometer.position_m) is not None
    assert places.counts.failed == 1


def test_results_of_the_cameras_process_come_with_its_work_and_what_it_left_out() -> None:
    results, motion = Ring(result_columns(2), 8), Numbers(len(MOTION))
    camera = CameraInput(
        PreviewStamps(PreviewConfig(P_0_m=2.5, hold_m=2.0), 0.05, 2),
        1000 * MS,
        ("left", "right"),
        results,
        motion,
    )
    odometer, heard = Odometer(), Inputs(CODEC, unsaid).heard["RoadClass"]
    captured_ns = driven(20.0, 1.0, odometer)
    camera.share_motion(
        odometer, {"accel_x_m_s2": math.nan, "steering_angle_rad": 1.6, "yaw_rate_rad_s": 0.2}
    )
    assert motion.get() == pytest.approx([20.0, 0.0, 0.0, 0.2, 20.0])
    camera.share_motion(odometer, {"accel_x_m_s2": 1.5, "steering_angle_rad": -0.1, "yaw_rate_rad_s": 0.2})
    assert motion.get()[1:3] == pytest.approx([1.5, -0.1])
    assert not camera.news(heard, False, False, odometer, captured_ns, unsaid)
    results.write([4, captured_ns, captured_ns, 2, 17.5, FAILED, 0.0, 1.0, 0.8])
    results.write([5, captured_ns + 1, captured_ns, 3, 18.5, FAILED, 0.0, 1.0, 0.9])
    now_ns = driven(20.0, 0.14, odometer, captured_ns)
    assert camera.news(heard, False, False, odometer, now_ns, unsaid)
    assert camera.classes == [(NO_CLASS, 0.0), (int(Surface.WET), 0.9)]
    assert (camera.left_out, camera.work_ms, camera.number) == (3, [17.5, 18.5], 1)
    assert camera.picture_age_ms(now_ns) == pytest.approx(140.0)
    assert camera.age_under_wheel_ms(now_ns) == pytest.approx(140.0, abs=1e-3)


def test_the_place_between_two_looks_is_interpolated() -> None:
    odometer = Odometer()
    odometer.drive(70 * MS, 0.0, 0.0)
    odometer.drive(80 * MS, 10.0, 0.01)
    assert odometer.at(74 * MS) == pytest.approx(0.04)
    odometer.drive(90 * MS, math.nan, 0.01)
    assert odometer.position_m == pytest.approx(0.2), "without a speed the last one counts"
    assert [odometer.at(at * MS) for at in (70, 80, 85, 90, 99)] == pytest.approx([0.0, 0.1, 0.15, 0.2, 0.2])
    assert odometer.at(70 * MS - 1) is None


@pytest.mark.parametrize(("silent_s", "believed"), [(0.9, True), (1.1, False)])
def test_after_a_camera_was_lost_what_it_said_before_no_longer_counts(
    silent_s: float, believed: bool
) -> None:
    odometer, places = Odometer(), preview_stamps()
    first_ns = driven(1.0, 1.0, odometer)
    first_m = odometer.position_m
    places.take(result(1, first_ns, first_ns, Surface.WET), odometer, 1000 * MS)
    now_ns = driven(1.0, silent_s, odometer, first_ns)
    places.take(result(2, now_ns, now_ns, Surface.DRY), odometer, 1000 * MS)
    assert (places.known(0, first_m + 3.0) is not None) == believed
    ahead = places.known(0, odometer.position_m + 3.0)
    assert ahead is not None
    assert ahead.surface is Surface.DRY


# Bus


def until_back(link: Link) -> None:
    assert link._seeker is not None
    link._seeker.join(10.0)
    link.receive()


@pytest.mark.parametrize("why", [OSError("gone"), ValueError("no such channel"), NotImplementedError()])
def test_a_lost_bus_is_tried_again_whatever_opening_it_raises(why: Exception) -> None:
    bus, back = RaisingBus(), RaisingBus()
    answers: list[RaisingBus | Exception] = [bus, why, why, back]

    def opened() -> RaisingBus:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    link = Link(opened, unsaid, retry_s=0.0)
    bus.failing = OSError("Network is down")
    link.receive()
    until_back(link)
    assert link.up
    assert not answers


@pytest.mark.parametrize(("key", "value"), [("scenario", "nowhere.yaml"), ("dbc", "nowhere.dbc")])
def test_what_a_plant_on_the_bus_refuses_leaves_no_open_bus(key: str, value: str, tmp_path: Path) -> None:
    job = PlantJob(PLAIN_SCENARIO, BusSettings("virtual", "none"), DBC_FILE, 1000.0)
    opened: list[int] = []
    with pytest.raises((ScenarioError, HilError), match="nowhere"):
        PlantNode(replace(job, **{key: tmp_path / value}), lambda: opened.append(1), SystemClock())
    assert not opened


@pytest.mark.parametrize("error", [OSError("Network is down"), can.CanInitializationError("gone")])
def test_a_bus_that_raises_is_lost_said_once_and_opened_again(error: Exception) -> None:
    said: list[str] = []
    buses = [RaisingBus(), RaisingBus(), RaisingBus()]
    opened = iter(buses)
    link = Link(lambda: next(opened), lambda kind, text: said.append(kind), retry_s=0.0)
    buses[0].failing = error
    assert link.receive() == []
    assert not link.up
    assert link.losses == 1
    link.send(1, False, b"")
    until_back(link)
    assert link.up
    assert buses[0].shut
    buses[1].state = can.BusState.ERROR
    link.check()
    assert link.losses == 2
    until_back(link)
    assert link.up
    assert said == ["bus lost", "bus back"] * 2
    link.close()
    assert buses[2].shut


def test_a_full_transmit_buffer_is_no_lost_bus() -> None:
    bus = RaisingBus()
    link = Link(lambda: bus, unsaid)
    bus.failing = can.CanOperationError("Transmit buffer full")
    link.send(1, False, b"")
    assert link.up
    assert link.unsent == 1


def test_error_frames_are_counted_and_a_flood_is_read_in_parts() -> None:
    bus = RaisingBus()
    link = Link(lambda: bus, unsaid)
    bus.waiting = [can.Message(is_error_frame=True)] + [can.Message(arbitration_id=1)] * 700
    assert len(link.receive()) == 511
    assert len(link.receive()) == 189
    assert (link.error_frames, link.backlogs) == (1, 1)


def test_a_bus_that_is_not_there_at_the_start_is_one_sentence() -> None:
    with pytest.raises(HilError, match=r"cannot be opened.*--interface"):
        Link(BusSettings("no_such_interface", "x").open, unsaid)
    assert bus_options(["bitrate=500000", "fd=true", "name=x"]) == {
        "bitrate": 500000,
        "fd": True,
        "name": "x",
    }
    with pytest.raises(HilError, match="expected NAME=VALUE"):
        bus_options(["bitrate"])


# A process beside the loop, and what the system grants


@given(
    st.lists(
        st.tuples(st.integers(0, 2**29 - 1), st.booleans(), st.binary(max_size=8)),
        max_size=30,
        unique_by=lambda m: m[0],
    )
)
def test_what_goes_into_the_wire_comes_out_of_the_bus_in_order(
    messages: list[tuple[int, bool, bytes]],
) -> None:
    sent = [
        (frame_id if extended else frame_id % 2**11, extended, data) for frame_id, extended, data in messages
    ]
    settings, ring = BusSettings("virtual", "test-ferry"), relay_ring()
    wire, link, listener = RelayedBus(ring), Link(settings.open, unsaid), settings.open()
    for message in sent:
        wire.send(*message)
    assert wire.receive() == []
    BusRelay(ring, link, FakeClock()).take_over()
    heard = []
    while (message := listener.recv(0.0)) is not None:
        heard.append((message.arbitration_id, message.is_extended_id, bytes(message.data)))
    listener.shutdown()
    link.close()
    assert heard == sent


def test_with_real_time_priority_the_loop_has_the_last_core_where_the_rest_has_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cores = {0, 2, 3}
    monkeypatch.setattr("os.sched_getaffinity", lambda process: cores, raising=False)
    assert loop_core(None, realtime=True) == 3
    assert loop_core(0, realtime=True) == 0
    assert loop_core(None, realtime=False) is None
    cores = {1}
    assert loop_core(None, realtime=True) is None


# Figures and files


def test_a_reader_that_is_too_slow_loses_the_oldest_rows_and_knows_how_many() -> None:
    ring = Ring(2, 4)
    assert not ring.waiting
    for number in range(3):
        ring.write([number, -number])
    assert ring.read().tolist() == [[0, 0], [1, -1], [2, -2]]
    for number in range(3, 10):
        ring.write([number, -number])
    assert ring.read()[:, 0].tolist() == [6, 7, 8, 9]
    assert (ring.lost, ring.written) == (3, 10)
    assert len(ring.read()) == 0


def test_quantiles_are_right_to_half_a_per_cent_and_the_greatest_is_exact() -> None:
    values = np.random.default_rng(1).lognormal(3.0, 1.0, 20_000)
    sketch = QuantileSketch()
    for part in np.array_split(values, 7):
        sketch.add([*part, math.nan])
    assert sketch.count == len(values)
    assert sketch.greatest == values.max()
    for share in (0.5, 0.99):
        assert sketch.quantile(share) == pytest.approx(np.quantile(values, share), rel=0.006)
    assert QuantileSketch().summary() is None


def test_figures_are_those_of_all_rows_and_the_newest_one_counts() -> None:
    kinds = columns(Wiring.of_one("fl"))
    places = {column.name: place for place, column in enumerate(kinds)}
    rows = np.random.default_rng(2).uniform(1.0, 9.0, (900, len(kinds)))
    figures = Figures(kinds)
    assert math.isnan(figures.now("TRPAC"))
    for part in (rows[:0], rows[:400], rows[400:]):
        figures.add(part)
    for name, column in TIMING_COLUMNS.items():
        assert figures.summary()[name]["max"] == pytest.approx(rows[:, places[column]].max(), rel=1e-3)
        assert figures.summary()[name]["median"] == pytest.approx(
            np.median(rows[:, places[column]]), rel=0.01
        )
    assert figures.rows == 900
    assert figures.now("TRPAC") == rows[-1, places["TRPAC"]]
    assert math.isnan(figures.now("no such column"))


def test_events_are_said_once_and_counted_always() -> None:
    told: list[tuple[float, str]] = []
    events = Events(lambda time_s, text: told.append((time_s, text)), lambda: 1.5)
    for _ in range(3):
        events.report("a", "first")
    assert told == [(1.5, "first")]
    assert events.summary() == [{"kind": "a", "first_s": 1.5, "count": 3, "said": "first"}]


def test_the_log_appears_whole_and_nothing_else_is_left(tmp_path: Path) -> None:
    kinds = columns(Wiring.of_one("fl"))
    rows = np.arange(6.0 * len(kinds)).reshape(6, len(kinds)) % 100.0
    rows[:, 0] = np.arange(6) * 0.001
    log = MdfLog(tmp_path / "log.mf4", kinds, "a test")
    log.add(rows[:2])
    log.add(rows[2:])
    assert not (tmp_path / "log.mf4").exists()
    assert log.rows == 6
    log.finish()
    assert [p.name for p in tmp_path.iterdir()] == ["log.mf4"]
    with MDF(tmp_path / "log.mf4") as mdf:
        for column in ("TRPAC", "status", "vehicle_speed_m_s"):
            place = [c.name for c in kinds].index(column)
            assert mdf.get(column).samples.tolist() == rows[:, place].tolist()
            assert mdf.get(column).timestamps.tolist() == rows[:, 0].tolist()
        assert mdf.get("wheel_torque_fl_nm").unit == "N.m"


def test_priority_and_cores_are_given_back():
    """Another run of the same process chooses anew, and its helpers keep off its own core only."""
    cores = os.sched_getaffinity(0)
    with as_before():
        pin(min(cores))
        assert os.sched_getaffinity(0) == {min(cores)}
    assert os.sched_getaffinity(0) == cores
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_a_process_beside_the_loop_is_over_when_it_is_told_so_or_its_parent_is_gone(monkeypatch):
    now_s, alive, looks = [100.0], [True], []
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    parent = SimpleNamespace(is_alive=lambda: looks.append(now_s[0]) or alive[0])
    monkeypatch.setattr(helper, "parent_process", lambda: parent)
    control = helper.Control("camera")
    assert [control.stopped for _ in range(5)] == [False] * 5
    assert len(looks) == 1, "a look at the parent each second is enough"
    alive[0] = False
    now_s[0] += 1.5 * helper.PARENT_EVERY_S
    assert control.stopped
    monkeypatch.setattr(helper, "parent_process", lambda: None)
    now_s[0] += 1.5 * helper.PARENT_EVERY_S
    assert not control.stopped, "the loop's own process has no parent to lose"
    control.stop()
    assert control.stopped
    assert not control.wait_for_start()


@pytest.mark.parametrize("number", [signals.SIGINT, signals.SIGTERM])
def test_a_signal_stops_the_loop_not_the_program_and_means_what_it_meant_afterwards(number):
    before, stopper = signals.getsignal(number), Stopper()
    with stopper.by_signal():
        assert stopper() is False
        signals.raise_signal(number)
        assert stopper() is True
    assert signals.getsignal(number) is before


@pytest.mark.skipif(sys.platform != "linux", reason="timer slack is Linux's")
def test_undisturbed_the_garbage_collector_rests_and_sleeps_end_on_time_and_then_all_is_as_before():
    timer_slack = ctypes.CDLL(None).prctl
    gc.enable()
    interval_s = sys.getswitchinterval()
    with undisturbed():
        assert not gc.isenabled()
        assert sys.getswitchinterval() == pytest.approx(2e-4)
        assert timer_slack(30, 0, 0, 0, 0) == 1000, "PR_GET_TIMERSLACK [ns]"
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval_s
    gc.disable()
    with undisturbed():
        pass
    assert not gc.isenabled(), "what was off stays off"
    gc.enable()


def test_a_helper_that_does_not_stop_is_ended():
    rig = Rig()
    rig.add("camera", hil_bodies.deaf, ...)
    rig.wait_until_ready()
    begun = time.monotonic()
    rig.end(patience_s=0.3)
    assert time.monotonic() - begun < 30.0


def test_pictures_are_judged_by_the_units_parameters(tmp_path):
    told = {
        "image.least_mass": 0.9,
        "image.patches_near": 6.0,
        "image.flag_threshold": 0.4,
        "vehicle.track": 1.7,
    }
    settings = HilSettings(tmp_path, BusSettings("virtual", "none"), parameters=told)
    camera = Camera()
    vision = _vision(settings, camera)
    assert (vision.least_mass, vision.b[0], vision.flag_threshold) == (0.9, 6, 0.4)
    assert (vision.track_m, vision.camera) == (1.7, camera)
    assert _vision(replace(settings, parameters={}), camera) == IfeConfig(
        camera=camera, groups_looked_at=1, side="left"
    )


def test_the_recorder_is_given_the_time_that_a_long_log_takes():
    rig = Rig()
    recorder = rig.add("recorder", hil_bodies.slow, ...)
    rig.wait_until_ready()
    rig.start(0)
    assert rig.end(recorder, patience_s=0.2) == {"done": "written"}
