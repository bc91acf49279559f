"""Buses that others described: their names, units, layouts and codes, and what of them is refused by name."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import can
import cantools
import numpy as np
import pandas as pd
import pytest
from asammdf import MDF
from hil_fakes import MS, FakeClock, unsaid
from hil_foreign import DBC, SIGNALS, foreign_car
from hypothesis import given
from hypothesis import strategies as st
from long import long
from typer.testing import CliRunner

import trpac
from sim2real.logs.mapping import load_mapping
from trpac_cli.main import app
from trpac_hil.bus import BusSettings, Link
from trpac_hil.bus_file import FORMATS, BusFile
from trpac_hil.bus_relay import packed, unpacked
from trpac_hil.codec import DBC_FILE, Codec, load_codec
from trpac_hil.errors import HilError
from trpac_hil.inputs import Inputs
from trpac_hil.message import NO_COUNTER, Coded
from trpac_hil.plant_node import PlantJob, PlantNode
from trpac_hil.readiness import Readiness, listen
from trpac_hil.rig import Stopper, run_hil
from trpac_hil.settings import HilSettings
from trpac_hil.unit import Wiring
from trpac_hil.verdict import verdict

SHIPPED_TEXT = DBC_FILE.read_text(encoding="utf-8")
WIRING = Wiring.of_one("fl")


def changed(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def codec_of(folder: Path, dbc: str = DBC, signals: str = SIGNALS) -> Codec:
    return load_codec(*foreign_car(folder, dbc, signals))


def said(inputs: Inputs, codec: Codec, name: str, at_ns: int, count: int = 0, **values: float) -> str:
    """Take a message in, encoded by cantools."""
    coded = codec[name]
    whole = {s.name: 0 for s in coded.message.signals} | values
    if coded.counter:
        whole[coded.counter] = count % coded.counts
    data = coded.message.encode(whole, strict=False)
    return inputs.take(coded.message.frame_id, coded.message.is_extended_frame, bytes(data), at_ns)


# Layouts


@st.composite
def layouts(draw: st.DrawFn) -> tuple[str, dict[str, int]]:
    """A message of random signals of either byte order, one after the other, and raw values of them."""
    size = draw(st.sampled_from([8, 12, 64]))
    little, at, lines, raws = draw(st.booleans()), 0, [], {}
    while at < 8 * size:
        bits = min(draw(st.integers(1, 40)), 8 * size - at)
        signed = draw(st.booleans())
        name = f"S{len(lines)}"
        start = at if little else 8 * (at // 8) + 7 - at % 8
        lines.append(f' SG_ {name} : {start}|{bits}@{little:d}{"-" if signed else "+"} (1,0) [0|0] "" X\n')
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        raws[name] = draw(st.integers(low, high))
        at += bits + draw(st.integers(0, 20))
    text = f'VERSION ""\n\nBU_: X\n\nBO_ 5 M: {size} X\n{"".join(lines)}\n'
    return text, raws


@given(layouts())
def test_bits_are_read_and_written_as_cantools_does(layout: tuple[str, dict[str, int]]) -> None:
    text, raws = layout
    message = cantools.database.load_string(text, "dbc").messages[0]
    coded = Coded.of(message, raws.keys())
    data = bytes(message.encode(raws))
    assert coded.decode(data) == (raws, -1)
    assert coded.encode(raws) == data


def test_floats_are_read_in_both_byte_orders(tmp_path: Path) -> None:
    text = (
        'VERSION ""\n\nBU_: X\n\nBO_ 5 M: 16 X\n SG_ A : 0|32@1- (2,1) [0|0] "" X\n SG_ B : 39|32@0- (1,0) [0|0] "" X\n'
        ' SG_ C : 64|64@1- (1,0) [0|0] "" X\n\nSIG_VALTYPE_ 5 A : 1;\nSIG_VALTYPE_ 5 B : 1;\nSIG_VALTYPE_ 5 C : 2;\n'
    )
    message = cantools.database.load_string(text, "dbc").messages[0]
    values = {"A": 4.0, "B": -0.25, "C": 1e200}
    coded = Coded.of(message, values.keys())
    assert coded.decode(bytes(message.encode(values)))[0] == values
    assert coded.encode(values) == bytes(message.encode(values))
    broken = coded.decode(bytes(message.encode(values | {"A": math.nan, "B": math.inf})))[0]
    assert math.isnan(broken["A"])
    assert math.isnan(broken["B"])


def test_multiplexers_within_multiplexers_select_what_cantools_selects() -> None:
    text = (
        'VERSION ""\n\nBU_: X\n\nBO_ 5 M: 8 X\n SG_ A M : 0|4@1+ (1,0) [0|0] "" X\n'
        ' SG_ B m2M : 4|4@1+ (1,0) [0|0] "" X\n'
        ' SG_ C m1 : 8|8@1+ (1,0) [0|0] "" X\n SG_ D m3 : 8|8@1- (1,0) [0|0] "" X\n SG_ E : 16|8@1+ (1,0) [0|0] "" X\n'
        "\nSG_MUL_VAL_ 5 B A 2-2, 5-6;\nSG_MUL_VAL_ 5 C A 1-1;\nSG_MUL_VAL_ 5 D B 3-4, 9-9;\n"
    )
    message = cantools.database.load_string(text, "dbc").messages[0]
    coded = Coded.of(message, {"C", "D", "E"})
    found = set()
    for first in range(256):
        data = bytes([first, 200, 7, 0, 0, 0, 0, 0])
        values, _ = coded.decode(data)
        try:
            expected = message.decode(data, allow_truncated=False)
        except cantools.database.DecodeError:
            expected = {name: values[name] for name in values if name == "E"}
        assert values == {name: expected[name] for name in ("C", "D", "E") if name in expected}
        found.add(tuple(values))
    assert found == {("E",), ("C", "E"), ("D", "E")}
    for count in range(2):
        back, _ = coded.decode(coded.encode({"C": 11.0, "D": -5.0, "E": 3.0}, count))
        assert back in ({"C": 11.0, "E": 3.0}, {"D": -5.0, "E": 3.0})


# Quantities


def test_units_signs_sums_and_radii_are_those_of_both_files(tmp_path: Path) -> None:
    codec = codec_of(tmp_path)
    inputs = Inputs(codec, unsaid)
    said(inputs, codec, "Motion", 0, VehSpd=90.0, LongAcc=0.5, YawRate=18.0)
    said(inputs, codec, "ABS_Wheels", 0, 0, Page=0, WhlSpdFL=600.0, WhlSpdFR=1200.0)
    said(inputs, codec, "ABS_Wheels", MS, 1, Page=1, WhlSpdRL=36.0, WhlSpdRR=72.0)
    said(inputs, codec, "Drive", 0, MotFL=100.0, MotR=300.0)
    said(inputs, codec, "Brakes", 0, BrkFL=0.5, BrkRL=0.1)
    expected = {
        "vehicle_speed_m_s": 25.0,
        "accel_x_m_s2": 0.5 * 9.80665,
        "yaw_rate_rad_s": -math.radians(18.0),
        "wheel_speed_fl_rad_s": 20.0 * math.pi,
        "wheel_speed_fr_rad_s": 40.0 * math.pi,
        "wheel_speed_rl_rad_s": 10.0 / 0.29,
        "wheel_speed_rr_rad_s": 20.0 / 0.29,
        "wheel_torque_fl_nm": 100.0 - 500.0,
        "wheel_torque_rl_nm": 150.0 - 100.0,
        "steering_angle_rad": 0.0,
    }
    assert {name: inputs.value(name, 2 * MS) for name in expected} == pytest.approx(expected)
    assert math.isnan(inputs.value("accel_y_m_s2", MS)), "no line of the file says where it is"


def test_a_multiplexed_signal_has_the_age_of_the_newest_message_that_selects_it(tmp_path: Path) -> None:
    codec = codec_of(tmp_path)
    inputs = Inputs(codec, unsaid)
    for at_ms in range(0, 100, 5):
        said(
            inputs,
            codec,
            "ABS_Wheels",
            at_ms * MS,
            at_ms // 5,
            Page=int(at_ms > 0),
            WhlSpdFL=600.0,
            WhlSpdRL=36.0,
        )
    front, rear = (s for s in codec.supplies if s.message == "ABS_Wheels")
    assert (front.name, rear.name) == ("ABS_Wheels_Page_0", "ABS_Wheels_Page_1")
    assert (inputs.age_ns(front, 95 * MS), inputs.age_ns(rear, 95 * MS)) == (95 * MS, 0)
    assert front.stale_ns == 3 * 2 * 5 * MS, "three cycles of two pages"
    assert math.isnan(inputs.value("wheel_speed_fl_rad_s", 95 * MS))
    assert inputs.value("wheel_speed_rl_rad_s", 95 * MS) == pytest.approx(10.0 / 0.29)
    assert inputs.value("wheel_speed_fl_rad_s", front.stale_ns) == pytest.approx(20.0 * math.pi)
    assert said(inputs, codec, "ABS_Wheels", 100 * MS, 20, Page=1) == "ABS_Wheels"


def test_codes_of_no_value_and_values_out_of_range_are_lost_and_the_latter_counted(tmp_path: Path) -> None:
    codec = codec_of(tmp_path)
    kinds: list[str] = []
    inputs = Inputs(codec, lambda kind, text: kinds.append(kind))
    for count, (speed, lost) in enumerate([(655.35, True), (655.34, True), (300.0, False), (300.02, True)]):
        said(inputs, codec, "Motion", count * MS, count, VehSpd=speed)
        assert math.isnan(inputs.value("vehicle_speed_m_s", count * MS)) == lost
    assert inputs.heard["Motion"].outside == {"VehSpd": 1}
    assert kinds == ["out of range Motion.VehSpd"]
    assert inputs.value("accel_x_m_s2", 4 * MS) == 0.0


def test_values_that_the_mapping_names_as_invalid_are_lost(tmp_path: Path) -> None:
    named = 'invalid: {"*": [300.0], Motion.LongAcc: [-4.0], YawRate: [0.0]}\ncounters:'
    codec = codec_of(tmp_path, signals=changed(SIGNALS, ("counters:", named)))
    inputs = Inputs(codec, unsaid)
    names = ("vehicle_speed_m_s", "accel_x_m_s2", "yaw_rate_rad_s")
    for count, (values, lost) in enumerate(
        [((300.0, -4.0, 0.0), (True, True, True)), ((299.99, -3.999, 0.01), (False, False, False))]
    ):
        said(
            inputs,
            codec,
            "Motion",
            count * MS,
            count,
            **dict(zip(("VehSpd", "LongAcc", "YawRate"), values, strict=True)),
        )
        assert tuple(math.isnan(inputs.value(name, count * MS)) for name in names) == lost
    assert inputs.heard["Motion"].outside == {}


def test_a_stated_counter_counts_over_its_stated_range_and_what_only_sounds_like_one_does_not(
    tmp_path: Path,
) -> None:
    codec = codec_of(tmp_path)
    assert (codec["Motion"].counter, codec["Motion"].counts) == ("AliveCnt", 15)
    assert (codec["ABS_Wheels"].counter, codec["ABS_Wheels"].counts) == ("ABS_Cnt", 16)
    inputs = Inputs(codec, unsaid)
    for count in range(40):
        said(inputs, codec, "Motion", count * MS, count)
    assert (inputs.heard["Motion"].lost, inputs.heard["Motion"].frozen) == (0, 0)
    assert not inputs.heard["Motion"].senders.noticed
    uncounted = codec_of(tmp_path, signals=SIGNALS.replace("ABS_Cnt", NO_COUNTER))
    assert uncounted["ABS_Wheels"].counts == 0


def test_a_name_without_a_message_is_that_of_the_only_one_that_has_it_and_channels_are_for_logs(
    tmp_path: Path,
) -> None:
    plain = changed(SIGNALS, ("Motion.VehSpd", "VehSpd"), ("Drive.MotFL", '"Drive.MotFL#2"'))
    assert codec_of(tmp_path, signals=plain).roles == codec_of(tmp_path).roles


def test_without_age_limits_they_follow_from_cycle_times(tmp_path: Path) -> None:
    codec = codec_of(tmp_path, changed(DBC, ("BO_ 1001 10", "BO_ 1001 20")))
    assert codec["Motion"].stale_ns["VehSpd"] == 60 * MS
    assert codec["Drive"].stale_ns["MotFL"] == 30 * MS
    assert codec["Brakes"].stale_ns["BrkFL"] == 100 * MS, "no cycle time"


# Units of one's own file with the shipped names


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("km/h", 1 / 3.6), ("mph", 0.44704), ("kn", 1852.0 / 3600.0), ("m/s", 1.0), ("", 1.0)],
)
def test_the_unit_that_a_file_with_the_shipped_names_states_counts(
    unit: str, factor: float, tmp_path: Path
) -> None:
    path = tmp_path / "own.dbc"
    path.write_text(
        changed(SHIPPED_TEXT, ('(0.002,-20) [-20|111.068] "m/s"', f'(0.01,-20) [-20|500] "{unit}"'))
    )
    codec = load_codec(path)
    inputs = Inputs(codec, unsaid)
    coded = codec["VehicleMotion"]
    inputs.take(258, False, coded.encode({"VehicleSpeed": 72.0}, 1), 0)
    assert inputs.value("vehicle_speed_m_s", 0) == pytest.approx(72.0 * factor)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '[-20|111.068] "m/s"',
            '[-20|111.068] "furlong"',
            "vehicle_speed_m_s: {column: VehicleMotion.VehicleSpeed, u",
        ),
        ('[0|20460] "N"', '[0|20460] "lbf"', "vertical_load_fl_n: Chassis.VerticalLoad_FL of"),
        ('[0|4094] "ms"', '[0|4094] "s"', "RoadClass.RoadClass_Age is in [s]; expected [ms]"),
        ('[0|10.235] "1/s"', '[0|10.235] "1/min"', "Estimate.K_v is in [1/min]; expected [1/s]"),
    ],
)
def test_a_unit_that_cannot_be_converted_is_refused_by_name(
    old: str, new: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "own.dbc"
    path.write_text(changed(SHIPPED_TEXT, (old, new)))
    with pytest.raises(HilError) as refused:
        load_codec(path)
    assert words in str(refused.value)


@pytest.mark.parametrize("rest", ["", "values"])
@pytest.mark.parametrize("signal", ["WheelSpeed_RR", "WheelTorque_FL", "RoadClass_Age"])
def test_a_signal_that_is_missing_is_named_also_where_its_table_of_values_is_still_there(
    signal: str, rest: str, tmp_path: Path
) -> None:
    path = tmp_path / "own.dbc"
    lines = [
        line
        for line in SHIPPED_TEXT.splitlines()
        if signal not in line or (rest and "SG_ " + signal not in line)
    ]
    path.write_text("\n".join(lines))
    with pytest.raises(HilError, match=rf"lacks \w+\.{signal}\. Expected all .* or a file that maps"):
        load_codec(path)


# What is refused of a file of signals


@pytest.mark.parametrize(
    ("dbc", "signals", "words"),
    [
        ([], [("Motion.VehSpd", "Motoin.VehSpd")], "has no message Motoin; did you mean Motion?"),
        ([], [("Motion.VehSpd", "Motion.VehSpeed")], "has no signal Motion.VehSpeed; did you mean VehSpd?"),
        ([], [("Motion.VehSpd", "Speed")], "Speed is no Message.Signal, such as"),
        ([("MotR", "BrkRR")], [("Brakes.BrkRR", "BrkRR")], "BrkRR is no Message.Signal: Drive, Brakes have it"),
        ([('"km/h" Tool\n SG_ LongAcc', '"" Tool\n SG_ LongAcc')], [],
         "Motion.VehSpd has no unit in"),
        ([('"rpm"', '"ticks"')], [], "`wheel_speed_fl_rad_s: {column: ABS_Wheels.WhlSpdFL, unit: UNIT}`"),
        ([], [("  vehicle_speed_m_s: Motion.VehSpd", "  vehicle_speed_m_s: {integrate: Motion.LongAcc}")],
         "vehicle_speed_m_s: integrate is for logs"),
        ([], [("{constant: 0.0}", "{copy: accel_y_m_s2}")], "copy: 'accel_y_m_s2' is in [m/s2]"),
        ([], [("counters: {Motion: AliveCnt", "counters: {Motion: Alive")], "has no Motion.Alive."),
        ([], [("counters:", "invalid: {Motion.Speed: [1.0]}\ncounters:")], "has no signal Motion.Speed."),
        ([], [("counters:", "checksums: {Motion: Crc}\ncounters:")], "checksums"),
        ([], [("Motion: AliveCnt", "Motion: VehSpd")], "VehSpd does not count by one from 0"),
        ([("BO_ 700 ", "BO_ 512 ")], [], "Estimate is sent with the identifier 0x200 of trpac.dbc, which is that of"),
        ([("BO_ 701 Brakes", "BO_ 700 Brakes")], [], "occurs twice: Drive 0x2BC, Brakes 0x2BC"),
        ([("BO_ 900 Health", "BO_ 900 Drive")], [], "Drive cannot be used"),
        ([("(0.001,0) [-4|4]", "(0,0) [-4|4]")], [], "Motion cannot be used"),
        ([("VehSpd 65535", "VehSpd 165535")], [], "Motion cannot be used"),
    ],
)  # fmt: skip
def test_what_a_foreign_bus_does_not_have_is_named_with_what_mends_it(
    dbc: list[tuple[str, str]], signals: list[tuple[str, str]], words: str, tmp_path: Path
) -> None:
    with pytest.raises(HilError) as refused:
        codec_of(tmp_path, changed(DBC, *dbc), changed(SIGNALS, *signals))
    assert words in str(refused.value)
    assert len(str(refused.value)) < 1500


def test_all_problems_of_a_file_are_told_at_once_and_what_the_unit_needs_is_required(tmp_path: Path) -> None:
    with pytest.raises(HilError) as refused:
        codec_of(tmp_path, signals=SIGNALS.replace("Motion.", "Moving."))
    assert str(refused.value).count("has no message Moving") == 3
    speedless = (
        ("  vehicle_speed_m_s: Motion.VehSpd\n", ""),
        ("  position_m: {integrate: {copy: vehicle_speed_m_s}}\n", ""),
    )
    lacking = codec_of(tmp_path, signals=changed(SIGNALS, *speedless))
    with pytest.raises(HilError, match=r"signals\.yaml: lacks vehicle_speed_m_s\. Expected lines such as"):
        lacking.require(WIRING.required.values())


def test_messages_of_ours_have_the_shipped_layout_where_their_identifiers_are_free(tmp_path: Path) -> None:
    codec = codec_of(tmp_path)
    assert codec.ours == {"Estimate", "EstimateWheels", "Health", "RoadClass", "PlantTruth"}, (
        "Health is the car's own"
    )
    assert codec["Health"].message.frame_id == 514
    taken = codec_of(tmp_path, changed(DBC, ("BO_ 700 ", "BO_ 272 ")))
    assert "RoadClass" not in taken.messages
    assert taken.notes == ("RoadClass is not received: its identifier 0x110 is that of Drive.",)
    whole = SHIPPED_TEXT[SHIPPED_TEXT.index("BO_ 512 Estimate") : SHIPPED_TEXT.index("BO_ 513")]
    theirs = codec_of(tmp_path, changed(DBC, ("BO_ 700 ", whole.replace("BO_ 512", "BO_ 1500") + "BO_ 700 ")))
    assert "Estimate" not in theirs.ours
    assert theirs["Estimate"].message.frame_id == 1500


# CAN FD


LONG = [
    ("VehicleMotion: 8", "VehicleMotion: 64"),
    ("Chassis: 8", "Chassis: 24"),
    ("WheelSpeeds: 8", "WheelSpeeds: 12"),
]


@pytest.mark.parametrize("longer", LONG)
def test_a_message_of_can_fd_wants_a_bus_of_can_fd_and_works_there(
    longer: tuple[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "long.dbc"
    path.write_text(changed(SHIPPED_TEXT, longer))
    name, _, length = longer[1].partition(": ")
    command = [
        "hil",
        "--dbc",
        str(path),
        "--out",
        str(tmp_path / "out"),
        "--channel",
        f"fd-{name}",
        "--no-wait",
    ]
    command += ["--duration-s", "0.2", "--rate-hz", "100"]
    job = PlantJob(dbc=path, bus=BusSettings("virtual", f"fd-{name}"))
    with pytest.raises(HilError, match=f"{name} has {length} bytes, which is CAN FD"):
        PlantNode(job, lambda: Link(job.bus.open, unsaid), FakeClock())
    fd = BusSettings("virtual", f"fd-{name}", {"fd": True})
    listener = fd.open()
    clock = FakeClock()
    node = PlantNode(job, lambda: Link(fd.open, unsaid), clock)
    node.run(clock.now_ns(), lambda: False, 2)
    node.close()
    inputs = Inputs(load_codec(path), unsaid)
    while (message := listener.recv(0.0)) is not None:
        assert message.is_fd == (len(message.data) > 8)
        inputs.take(message.arbitration_id, message.is_extended_id, bytes(message.data), 0)
    listener.shutdown()
    assert inputs.value("vehicle_speed_m_s", 0) == pytest.approx(4.0, abs=0.2)
    assert inputs.value("wheel_speed_fl_rad_s", 0) > 5.0
    if length == "64":
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 2
        assert f"{name} has 64 bytes, which is CAN FD" in done.stderr
        assert not (tmp_path / "out").exists()


# The plant


def test_the_plant_speaks_a_foreign_bus_and_is_understood(tmp_path: Path) -> None:
    dbc, signals = foreign_car(tmp_path)
    clock, codec = FakeClock(), load_codec(dbc, signals)
    inputs = Inputs(codec, unsaid)

    def send(frame_id: int, extended: bool, data: bytes) -> None:
        inputs.take(frame_id, extended, data, clock.now_ns())

    bus = SimpleNamespace(send=send, receive=list, close=lambda: None, fd=False)
    node = PlantNode(PlantJob(dbc=dbc, signals=signals, rate_hz=200.0, bus=BusSettings()), lambda: bus, clock)
    drive = node.drive
    compared = 0

    def stop() -> bool:
        nonlocal compared
        now, at_ns = drive.now, clock.now_ns()
        if at_ns > 1100 * MS:
            true = {
                "vehicle_speed_m_s": (now.speed_m_s, 0.1),
                "wheel_torque_fl_nm": (now.wheel_torque_nm[0], 40.0),
                "wheel_torque_rr_nm": (now.wheel_torque_nm[3], 40.0),
                "wheel_speed_fl_rad_s": (now.wheel_speed_rad_s[0], 1.0),
                "wheel_speed_rr_rad_s": (now.wheel_speed_rad_s[3], 1.0),
            }
            for name, (value, tolerance) in true.items():
                assert inputs.value(name, at_ns) == pytest.approx(value, abs=tolerance), name
            compared += 1
        return at_ns > 9000 * MS

    node.run(clock.now_ns(), stop)
    assert compared > 1000
    received = {name: heard.received for name, heard in inputs.heard.items()}
    assert received["ABS_Wheels"] == received["Drive"] == received["Brakes"] > 1000
    assert received["Motion"] == pytest.approx(received["Drive"] / 2, abs=2), "every 10 ms"
    assert inputs.heard["ABS_Wheels"].lost == inputs.heard["Motion"].lost == 0


# Before the first cycle


class Sending:
    """A bus on which messages wait; the clock's sleeps pass the time."""

    def __init__(
        self, codec: Codec, clock: FakeClock, quiet: tuple[str, ...] = (), still: tuple[str, ...] = ()
    ) -> None:
        self.codec, self.clock, self.quiet, self.still = codec, clock, quiet, still
        self.sent: dict[str, int] = {}
        self.values: dict[str, float] = {}
        self.up = True

    def drain(self) -> None:
        return None

    def receive(self) -> list[can.Message]:
        made = []
        for name in self.codec.received:
            coded = self.codec[name]
            due = (self.clock.now_ns() - 1000 * MS) // (coded.cycle_ns or 10 * MS)
            if name in self.quiet or due <= self.sent.get(name, 0):
                continue
            self.sent[name] = due
            values = dict.fromkeys(coded.signals, 10.0) | self.values
            data = coded.encode(values, 3 if name in self.still else due)
            identifier, extended = coded.message.frame_id, coded.message.is_extended_frame
            made.append(can.Message(arbitration_id=identifier, is_extended_id=extended, data=data))
        return made


def heard_in(codec: Codec, wait_s: float = 2.0, **sending: object) -> Readiness:
    clock = FakeClock()
    values, said_of = sending.pop("values", {}), sending.pop("said", [])
    bus = Sending(codec, clock, **sending)  # type: ignore[arg-type]
    bus.values = values  # type: ignore[assignment]
    return listen(bus, codec, WIRING, wait_s, True, clock, lambda: False, True, said_of.append)  # type: ignore


def test_when_all_is_there_it_begins_after_rates_were_counted(tmp_path: Path) -> None:
    readiness = heard_in(codec_of(tmp_path))
    assert readiness.missing == []
    assert 0.3 <= readiness.listened_s < 0.4
    lines = {line.name: line for line in readiness.lines}
    speed = lines["vehicle_speed_m_s"]
    assert (speed.source, speed.frame_ids, speed.counter) == ("Motion.VehSpd x 0.2778", "0x3E9", "counts")
    assert speed.value == pytest.approx(10.0 / 3.6)
    assert speed.rate in ("99 of 100", "100 of 100", "101 of 100")
    torque = lines["wheel_torque_fl_nm"]
    assert torque.source == "Drive.MotFL + Brakes.BrkFL x -1000"
    assert torque.frame_ids == "0x2BC, 0x2BD"
    assert torque.rate.endswith("of ?")
    assert lines["wheel_speed_fl_rad_s"].frame_ids == "0x18FEF100x"
    assert readiness.sent == ("Estimate 0x200 (trpac.dbc)", "Health 0x202 (trpac.dbc)")


@pytest.mark.parametrize(
    ("sending", "words"),
    [
        (
            {"quiet": ("Motion",)},
            ["vehicle_speed_m_s (Motion.VehSpd x 0.2778): no message Motion (0x3E9) came"],
        ),
        ({"still": ("Motion",)}, ["the counter AliveCnt stands still"]),
        ({"values": {"VehSpd": math.nan}}, ["is marked as not available"]),
        ({"quiet": ("Brakes", "Motion")}, ["no message Motion", "no message Brakes (0x2BD) came"]),
    ],
)
def test_what_is_required_and_has_no_value_is_named_with_the_reason(
    sending: dict[str, object], words: list[str], tmp_path: Path
) -> None:
    readiness = heard_in(codec_of(tmp_path), wait_s=0.5, **sending)
    assert readiness.listened_s == pytest.approx(0.5, abs=0.01)
    assert len(readiness.missing) == len(words)
    assert all(any(word in text for text in readiness.missing) for word in words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--interface", "virtul", "--channel", "x"], "virtul: unknown to python-can; did you mean 'virtual'?"),
        (["--interface", "socketcan", "--channel", "can7"], "socketcan can7 cannot be opened: "),
        (["--wait-s", "0.2"], "these had no value: wheel_torque_fl_nm (Drive.MotFL + Brakes.BrkFL x -1000): no "),
        (["--record-bus", "bus.txt"], "--record-bus bus.txt: expected a name that ends in .blf"),
    ],
)  # fmt: skip
def test_before_the_first_cycle_each_problem_is_one_line_and_exit_code_2(
    options: list[str], words: str, unit_file: Path, tmp_path: Path
) -> None:
    dbc, signals = foreign_car(tmp_path)
    command = ["hil", "--fmu", str(unit_file), "--dbc", str(dbc), "--signals", str(signals)]
    command += ["--out", str(tmp_path / "out"), "--duration-s", "0.1"]
    done = CliRunner().invoke(app, [*command, *options])
    assert done.exit_code == 2, done.output
    assert words in done.stderr.replace("\n", " ")
    assert not list(tmp_path.glob("out/*"))


# The recording, and the verdict


@pytest.mark.parametrize("ending", FORMATS)
def test_a_recording_has_all_messages_with_their_times(ending: str, tmp_path: Path) -> None:
    sent = [
        can.Message(
            timestamp=1.7e9 + 0.001 * number,
            arbitration_id=number if number % 2 else 0x18FF0200 + number,
            is_extended_id=number % 2 == 0,
            data=bytes([number % 256] * (64 if number % 7 == 6 else number % 9)),
            is_fd=number % 7 == 6,
            is_rx=number % 3 > 0,
        )
        for number in range(1, 200)
    ]
    file = BusFile(tmp_path / f"bus{ending}")
    rows = [packed(message) for message in sent]
    assert [bytes(unpacked(row).data) for row in rows] == [bytes(message.data) for message in sent]
    file.add(np.array(rows))
    assert not file.path.exists()
    file.finish()
    assert [path.name for path in tmp_path.iterdir()] == [f"bus{ending}"]
    with can.LogReader(tmp_path / f"bus{ending}") as reader:
        back = list(reader)
    assert [(m.arbitration_id, bytes(m.data)) for m in back] == [
        (m.arbitration_id, bytes(m.data)) for m in sent
    ]
    steps = np.diff([message.timestamp for message in back])
    assert steps == pytest.approx(np.full(len(sent) - 1, 0.001), abs=2e-4)


def summary_of(**changes: object) -> dict[str, object]:
    overruns = {"count": 0, "left_out": 0, "beyond_5_ms": 0, "worst_ms": 0.0, "beyond_5_ms_by": {}}
    bus = {"messages": {}, "required": [], "losses": 0, "unsent": 0, "error_frames": 0, "garbled": 0}
    log = {"file": "log.mf4", "rows": 100, "rows_lost": 0, "problem": None}
    plain = {
        "ended": "the set duration is over",
        "cycles": 100,
        "held_cycles": 0,
        "starting_cycles": 0,
        "signals_lost": {},
    }
    return plain | {"overruns": overruns, "bus": bus, "log": log} | changes


def test_the_verdict_says_in_words_what_was_kept_and_what_was_not() -> None:
    assert verdict(summary_of()) == [
        "Ended: the set duration is over.",
        "Deadlines kept: yes, all 100.",
        "Estimate: live in 100 % of the cycles.",
        "Inputs: all came, none was lost.",
        "Bus: never lost.",
        "Log: complete, 100 rows.",
    ]
    counts = {
        "received": 900,
        "lost": 3,
        "frozen": 2,
        "broken": 0,
        "two_senders": 1,
        "out_of_range": {"VehSpd": 4},
    }
    silent = dict.fromkeys(("received", "lost", "frozen", "broken", "two_senders"), 0) | {"out_of_range": {}}
    told = verdict(
        summary_of(
            cycles=588_000,
            overruns={
                "count": 24_541,
                "left_out": 12_000,
                "beyond_5_ms": 936,
                "worst_ms": 34.0,
                "beyond_5_ms_by": {"own_work": 100, "other_work": 800, "machine": 36},
            },
            held_cycles=1176,
            starting_cycles=588,
            signals_lost={"Motion": 1, "camera": 2},
            bus={
                **{
                    "messages": {"Motion": counts, "Drive": silent},
                    "required": ["Motion", "Drive"],
                    "losses": 1,
                },
                **{"unsent": 12, "error_frames": 0, "garbled": 0},
            },
            log={"file": "log.mf4", "rows": 500, "rows_lost": 88, "problem": None},
            bus_recording={
                "file": None,
                "rows": 0,
                "rows_lost": 0,
                "problem": "bus.blf: cannot be written (full).",
            },
        )
    )
    assert told[1:] == [
        "Deadlines kept: no. 24,541 of 600,000 cycles were late, the worst by 34.00 ms; 936 by more than 5 ms, most "
        "(800) of them because the processor was given to other programs.",
        "Estimate: live in 99.7 % of the cycles, waiting for the first signals in 588 and held in 1,176.",
        "Inputs: Motion lost once; camera lost 2 times; 3 of Motion missing by its counter; 2 of Motion with a counter "
        "that stood still; Motion sent by two devices once; Motion.VehSpd out of range 4 times; Drive never came.",
        "Bus: 1 times lost, 12 messages could not be sent.",
        "Log: not complete, 88 rows of 588 lost.",
        "Recording of the bus: none, bus.blf: cannot be written (full).",
    ]


# All of it


def test_a_foreign_car_drives_the_unit_and_the_recording_of_its_bus_says_the_same(
    unit_file: Path, tmp_path: Path
) -> None:
    dbc, signals = foreign_car(tmp_path)
    command = ["hil", "--with-plant", "--fmu", str(unit_file), "--dbc", str(dbc), "--signals", str(signals)]
    command += [
        "--rate-hz",
        "200",
        "--duration-s",
        "4",
        "--out",
        str(tmp_path / "out"),
        "--channel",
        "foreign",
    ]
    done = CliRunner().invoke(app, [*command, "--record-bus", str(tmp_path / "bus.blf"), "--quiet"])
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "Motion.VehSpd x 0.2778" in done.stderr
    assert load_mapping(signals).sources("vehicle_speed_m_s") == ["Motion.VehSpd"], (
        "a recording's mapping, too"
    )
    assert "Recording of the bus: complete" in done.stdout
    assert summary["bus"]["signals"]["vehicle_speed_m_s"] == "Motion.VehSpd x 0.2778"
    assert summary["bus"]["messages"]["Motion"]["frozen"] == 0
    with MDF(tmp_path / "out" / "log.mf4") as mdf:
        log = {
            name: mdf.get(name).samples
            for name in (
                "vehicle_speed_m_s",
                "wheel_speed_fl_rad_s",
                "status",
                "TRPAC",
                "TRPAC_low",
                "TRPAC_high",
            )
        }
        assert "age_ABS_Wheels_Page_1_ms" in mdf
    assert (log["status"] == 1).mean() > 0.5
    assert 3.0 < np.nanmin(log["vehicle_speed_m_s"]) < np.nanmax(log["vehicle_speed_m_s"]) < 16.0
    assert np.ptp(log["TRPAC"]) > 0.02
    assert (log["TRPAC_low"] <= log["TRPAC_high"]).all()
    database = cantools.database.load_file(dbc)
    speeds, estimates = [], 0
    with can.LogReader(tmp_path / "bus.blf") as reader:
        for message in reader:
            estimates += message.arbitration_id == 0x200 and not message.is_rx
            if message.arbitration_id == 1001:
                speeds.append(database.decode_message(1001, message.data)["VehSpd"] / 3.6)
    assert estimates == summary["cycles"] + 1
    assert np.nanmean(log["vehicle_speed_m_s"]) == pytest.approx(np.mean(speeds), abs=0.3)
    known = log["vehicle_speed_m_s"][np.isfinite(log["vehicle_speed_m_s"])]
    assert np.isin(np.round(known * 360.0), np.round(np.array(speeds) * 360.0)).mean() > 0.99
    assert summary["bus_recording"]["rows"] > 4 * 600
    # `trpac estimate` reads the recording by the same two files; cantools' own values as a table give the same.
    # Messages are on the times that they were due at: how late they come depends on the machine.
    evenly_timed(tmp_path / "bus.blf", tmp_path / "even.blf")
    table = decoded_rows(tmp_path / "even.blf", database)
    table.to_csv(tmp_path / "rows.csv", index=False)
    found, expected = (
        trpac.estimate(trpac.read_log(log, mapping=signals, dbc=file), "four_in_wheel_motor_ev").frame[
            "TRPAC"
        ]
        for log, file in ((tmp_path / "even.blf", dbc), (tmp_path / "rows.csv", None))
    )
    assert len(found) > 300
    # Times since 1970 hold 0.2 us, which moves TRPAC by some 1e-6; its step in the message Estimate is 1e-4.
    assert np.abs(found - expected).max() < 1e-4


def evenly_timed(recording: Path, path: Path) -> None:
    """A recording's messages of the car at their cycle times, from 1 s on."""
    cycles = {1001: 0.01, 0x18FEF100: 0.005, 700: 0.005, 701: 0.005}
    count = Counter[int]()
    messages = []
    with can.LogReader(recording) as reader:
        for message in reader:
            number = message.arbitration_id
            if number in cycles:
                message.timestamp = 1.0 + count[number] * cycles[number]
                count[number] += 1
                messages.append(message)
    with can.BLFWriter(path) as writer:
        for message in sorted(messages, key=lambda each: each.timestamp):
            writer.on_message_received(message)


def decoded_rows(path: Path, database: cantools.database.Database) -> pd.DataFrame:
    """A recording as a table of one row per message, units in the names, without what is not available."""
    rows = []
    with can.LogReader(path) as reader:
        for message in reader:
            try:
                known = database.get_message_by_frame_id(message.arbitration_id)
            except KeyError:
                continue
            values = known.decode(message.data, decode_choices=False)
            rows.append({"time_s": message.timestamp} | {f"{known.name}.{s}": v for s, v in values.items()})
    table = pd.DataFrame(rows)
    table["time_s"] -= table["time_s"].iloc[0]
    names = {f"{m.name}.{s.name}": s.unit for m in database.messages for s in m.signals if s.unit}
    return table.assign(**{"Motion.YawRate": np.nan}).rename(
        columns={n: f"{n} [{unit}]" for n, unit in names.items()}
    )


@pytest.mark.long
def test_a_foreign_car_of_another_process_comes_over_udp(unit_file: Path, tmp_path: Path) -> None:
    dbc, signals = foreign_car(tmp_path)
    bus = ["--interface", "udp_multicast", "--channel", "239.74.163.9", "--bus-option", "port=43991"]
    bus += ["--dbc", str(dbc), "--signals", str(signals), "--rate-hz", "100"]
    code = "from trpac_cli.entry import main; main()"
    plant = subprocess.Popen(
        [sys.executable, "-c", code, "hil-plant", *bus, "--duration-s", "120"],
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path.cwd())},
    )
    try:
        command = ["hil", *bus, "--fmu", str(unit_file), "--wait-s", "60", "--duration-s", "2", "--quiet"]
        done = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "out")])
    finally:
        plant.terminate()
        plant.communicate(timeout=30.0)
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["starting_cycles"] < 20
    assert summary["bus"]["messages"]["Motion"]["received"] > 20


def test_a_long_wait_says_once_what_it_waits_for(tmp_path: Path) -> None:
    told: list[str] = []
    heard_in(codec_of(tmp_path), wait_s=5.0, quiet=("Motion",), said=told)
    assert told == ["waiting up to 5 s for vehicle_speed_m_s; Ctrl-C ends."]


@long
def test_ctrl_c_while_it_waits_ends_it_with_a_summary_of_no_cycles(unit_file: Path, tmp_path: Path) -> None:
    stopper = Stopper()
    threading.Timer(1.0, stopper.ask).start()
    bus = BusSettings("virtual", "waits")
    summary = run_hil(HilSettings(tmp_path / "out", unit_file, bus=bus, rate_hz=100.0, wait_s=600.0), stopper)
    assert (summary["ended"], summary["cycles"]) == ("a stop was requested", 0)
    assert summary["verdict"][1:3] == ["Deadlines: none, no cycle ran.", "Estimate: none, no cycle ran."]
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["summary.json"]
