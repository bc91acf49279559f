"""What strangers send and write: datagrams that are no messages, a second sender, odd lengths, damaged DBC files."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterable, Iterator
from pathlib import Path

import can
import msgpack
import pytest
from hil_bench import Bench, driving
from hil_fakes import MS, RaisingBus, unsaid
from long import long

from trpac_hil.bus import MOST_AT_ONCE, BusSettings, Link
from trpac_hil.codec import DBC_FILE, INPUT_MESSAGES, OUTPUT_MESSAGES, Codec, load_codec
from trpac_hil.errors import HilError
from trpac_hil.inputs import HELD_NS, Inputs
from trpac_hil.loop import HELD_INPUT, RUNNING

CODEC = load_codec()
TEXT = DBC_FILE.read_text(encoding="utf-8")


# Datagrams


class Datagrams:
    """In place of python-can's socket: what has come over the network."""

    waiting: list[bytes]
    taken: int

    def __init__(self, *_: object) -> None:
        Datagrams.waiting, Datagrams.taken = [], 0

    def recv(self, timeout: float | None) -> tuple[bytes, tuple[str, int], float] | None:
        if not self.waiting:
            return None
        Datagrams.taken += 1
        return self.waiting.pop(0), ("", 0), 1.0

    def shutdown(self) -> None:
        return None


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Iterator[Link]:
    monkeypatch.setattr("can.interfaces.udp_multicast.bus.GeneralPurposeUdpMulticastBus", Datagrams)
    said.clear()
    made = Link(
        BusSettings("udp_multicast", "239.74.163.2").open, lambda kind, text: said.append((kind, text))
    )
    yield made
    made.close()


said: list[tuple[str, str]] = []


def fields(**changed: object) -> dict[str, object]:
    """What python-can sends of a message."""
    return {
        "timestamp": 1.0,
        "arbitration_id": 256,
        "is_extended_id": False,
        "is_remote_frame": False,
        "is_error_frame": False,
        "channel": None,
        "dlc": 8,
        "data": bytes(8),
        "is_fd": False,
        "bitrate_switch": False,
        "error_state_indicator": False,
    } | changed


GOOD = msgpack.packb(fields(), use_bin_type=True)


def test_a_datagram_that_is_no_message_is_left_aside_and_the_rest_is_read_in_the_same_cycle(
    link: Link,
) -> None:
    Datagrams.waiting += [b"\xc1garbage", GOOD, b"", b"\x93\x01", GOOD]
    assert len(link.receive()) == 2
    assert (link.up, link.losses, link.garbled, link.backlogs) == (True, 0, 3, 0)
    assert {kind for kind, _ in said} == {"garbled"}
    assert "is ignored" in said[0][1]


def test_a_flood_of_garbage_holds_a_cycle_up_for_no_more_than_so_many_reads(link: Link) -> None:
    Datagrams.waiting += [b"\xc1"] * (MOST_AT_ONCE + 5) + [GOOD]
    assert link.receive() == []
    assert (Datagrams.taken, link.garbled, link.backlogs) == (MOST_AT_ONCE, MOST_AT_ONCE, 1)
    assert len(link.receive()) == 1
    Datagrams.waiting += [b"\xc1"] * MOST_AT_ONCE * 2 + [GOOD] * 3
    link.drain()
    assert not Datagrams.waiting, "what waits behind garbage is of unknown age, too"


def test_a_number_in_place_of_the_data_makes_no_room_for_so_many_bytes(link: Link) -> None:
    Datagrams.waiting += [msgpack.packb(fields(data=2**27)), msgpack.packb(fields(data=2**63)), GOOD]
    tracemalloc.start()
    assert len(link.receive()) == 1
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1_000_000
    assert link.garbled == 2


def test_a_message_of_can_fd_does_not_hide_what_comes_behind_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.interfaces.udp_multicast.bus.GeneralPurposeUdpMulticastBus", Datagrams)
    link = Link(BusSettings("udp_multicast", "239.74.163.2", {"fd": False}).open, unsaid)
    Datagrams.waiting += [msgpack.packb(fields(is_fd=True)), GOOD]
    assert len(link.receive()) == 1
    assert link.garbled == 1


def test_a_socket_that_fails_is_still_a_lost_bus() -> None:
    bus = RaisingBus()
    link = Link(lambda: bus, unsaid)
    bus.failing = can.CanOperationError("Failed to wait for IP/UDP socket")
    bus.failing.__cause__ = OSError("Network is down")
    assert link.receive() == []
    assert (link.up, link.losses, link.garbled) == (False, 1, 0)
    link.close()


STRANGE: list[object] = [
    *(
        None,
        True,
        -1,
        0,
        255,
        256,
        2**11,
        2**29,
        2**32,
        2**63,
        256.0,
        0.5,
        float("nan"),
        float("inf"),
        "",
        "x",
    ),
    *(b"", bytes(7), bytes(9), bytes(64), bytes(65), [], [0] * 8, [300], {}, {"a": 1}, [[[]]], "\x1b[2J"),
    *(msgpack.ExtType(5, b"x"), msgpack.Timestamp(0)),
]


def hostile(random_: random.Random) -> bytes:
    """A datagram that no sender of the rig's would send."""
    kind = random_.randrange(6)
    if kind == 0:
        return random_.randbytes(random_.choice([0, 1, 2, 20, 200, 4096]))
    if kind == 1:
        return b"\x91" * random_.choice([10, 600, 4000]) + random_.randbytes(3)
    if kind == 2:
        return GOOD[: random_.randrange(len(GOOD))]
    if kind == 3:
        flipped = bytearray(GOOD)
        for _ in range(random_.choice([1, 3, 10])):
            flipped[random_.randrange(len(flipped))] = random_.randrange(256)
        return bytes(flipped)
    made = fields(arbitration_id=random_.choice([256, 257, 272, 999]))
    for _ in range(random_.choice([1, 1, 2, 4])):
        made[random_.choice([*made, "check", "more"])] = random_.choice(STRANGE)
    if kind == 4:
        del made[random_.choice(list(made))]
    return bytes(msgpack.packb(made))


def test_whatever_comes_by_network_ends_in_the_counts(link: Link) -> None:
    random_, inputs = random.Random(4), Inputs(CODEC, unsaid)
    Datagrams.waiting += [hostile(random_) for _ in range(4000)]
    while Datagrams.waiting:
        for message in link.receive():
            inputs.take(message.arbitration_id, message.is_extended_id, bytes(message.data), 0)
    assert (link.up, link.losses) == (True, 0)
    assert link.garbled > 1000
    assert max(len(text) for _, text in said) < 500
    assert all(text.isprintable() for _, text in said)


@pytest.mark.parametrize(
    "wrong",
    [
        {"arbitration_id": 2**29},
        {"arbitration_id": 2**11, "is_extended_id": False},
        {"arbitration_id": [1]},
        {"arbitration_id": -1},
        {"is_extended_id": {}},
        {"is_extended_id": "yes"},
    ],
)
def test_a_message_of_wrong_kinds_is_left_aside_whatever_interface_made_it(wrong: dict[str, object]) -> None:
    bus = RaisingBus()
    link = Link(lambda: bus, unsaid)
    bus.waiting = [can.Message(**wrong), can.Message(arbitration_id=256, is_extended_id=False)]
    assert [m.arbitration_id for m in link.receive()] == [256]
    assert link.garbled == 1


# Two senders

DUE_MS = {"WheelSpeeds": 1, "Chassis": 10, "RoadClass": 50}
Sent = tuple[float, str, int, float]
"""When a message comes [ms], its name, count and content."""


def one(
    name: str,
    seconds: float,
    every_ms: float = 0.0,
    phase_ms: float = 0.0,
    count: int = 0,
    value: float = 1.0,
    jitter_ms: float = 0.0,
    seed: int = 1,
) -> list[Sent]:
    """What a sender sends; at its cycle time where nothing else is said."""
    random_, every_ms = random.Random(seed), every_ms or DUE_MS[name]
    return [
        (phase_ms + k * every_ms + random_.random() * jitter_ms, name, count + k, value)
        for k in range(round(seconds * 1e3 / every_ms))
    ]


def heard(
    sent: Iterable[Sent], counters: bool = True, codec: Codec = CODEC, poll_ms: float = 1.0
) -> tuple[Inputs, list[tuple[int, str]]]:
    """Messages taken in by a loop that looks once per poll, and when it said what [ms]."""
    told: list[tuple[int, str]] = []
    at_ns = 0
    inputs = Inputs(codec, lambda kind, _: told.append((at_ns // MS, kind)), counters)
    packed: dict[tuple[str, int, float], bytes] = {}
    for at_ms, name, count, value in sorted(sent, key=lambda each: each[0]):
        coded = codec[name]
        key = (name, count % (coded.counts or 1), value)
        if key not in packed:
            packed[key] = coded.encode(dict.fromkeys(coded.signals, value), count)
        at_ns = int(at_ms // poll_ms * poll_ms) * MS
        inputs.take(coded.message.frame_id, False, packed[key], at_ns)
    return inputs, [(at, kind) for at, kind in told if kind.startswith("two senders")]


@pytest.mark.parametrize("name", DUE_MS)
@pytest.mark.parametrize("phase", [0.02, 0.3, 0.9])
@pytest.mark.parametrize("ahead", [0, 1, 2, 5, 8, 9, 15])
def test_a_second_sender_that_counts_is_noticed_within_half_a_second(
    name: str, phase: float, ahead: int
) -> None:
    other = one(name, 2.0, phase_ms=phase * DUE_MS[name], count=ahead, value=0.0)
    inputs, told = heard([*one(name, 2.0), *other])
    assert told
    assert told[0] == (pytest.approx(0, abs=500), f"two senders {name}")
    assert inputs.heard[name].senders.noticed == 1


@pytest.mark.parametrize("name", DUE_MS)
@pytest.mark.parametrize("phase", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("counters", [True, False])
def test_a_second_sender_that_says_the_same_or_does_not_count_is_noticed_by_how_often_it_comes(
    name: str, phase: float, counters: bool
) -> None:
    other = one(name, 2.0, phase_ms=phase * DUE_MS[name], count=1)
    _, told = heard([*one(name, 2.0), *other], counters)
    assert told
    assert told[0][0] <= 500


def test_one_that_fills_all_counts_between_two_true_messages_is_noticed() -> None:
    other = [
        (at_ms + part, name, count + part, 0.0)
        for at_ms, name, count, _ in one("RoadClass", 2.0)
        for part in range(1, 17)
    ]
    _, told = heard([*one("RoadClass", 2.0), *other])
    assert told
    assert told[0][0] <= 500


def without_cycle_times(tmp_path: Path) -> Codec:
    plain = tmp_path / "plain.dbc"
    plain.write_text(re.sub(r'BA_ "GenMsgCycleTime".*\n', "", TEXT), encoding="utf-8")
    return load_codec(plain)


def test_without_a_cycle_time_counters_tell_and_rates_do_not(tmp_path: Path) -> None:
    codec = without_cycle_times(tmp_path)
    for ahead in (0, 1, 2, 8, 15):
        other = one("WheelSpeeds", 1.0, phase_ms=0.4, count=ahead, value=0.0)
        assert heard([*one("WheelSpeeds", 1.0), *other], codec=codec)[1][0][0] <= 500
        # A sender ten times slower than the file says counts as well.
        slow = [one("WheelSpeeds", 2.0, 10.0, phase, c, v) for phase, c, v in ((0, 0, 1.0), (1, ahead, 0.0))]
        assert heard([*slow[0], *slow[1]])[1][0][0] <= 500
    assert heard(one("WheelSpeeds", 2.0, every_ms=0.1), False, codec)[1] == []


@pytest.mark.parametrize("counters", [True, False])
@pytest.mark.parametrize("poll_ms", [1.0, 10.0])
@pytest.mark.parametrize("every", [1.0, 0.97, 2.0, 10.0])
@pytest.mark.parametrize("name", DUE_MS)
def test_one_sender_at_half_or_just_the_due_rate_is_one(
    name: str, every: float, poll_ms: float, counters: bool
) -> None:
    sent = one(name, 20.0, every * DUE_MS[name], jitter_ms=0.9 * DUE_MS[name])
    assert heard(sent, counters, poll_ms=poll_ms)[1] == []


def test_one_sender_that_counts_may_be_faster_than_the_file_says() -> None:
    assert heard(one("RoadClass", 20.0, every_ms=10.0))[1] == []


def stalled(sent: list[Sent], every_ms: float, stall_ms: float) -> list[Sent]:
    """Now and then all is held up, and comes at once afterwards."""
    return [(max(t, t // every_ms * every_ms + stall_ms), *rest) for t, *rest in sent]


def ordinary(name: str, seconds: float, seed: int = 1) -> list[Sent]:
    """A sender that keeps no real time: jitter, stalls of up to 200 ms, lost messages, a restart every minute."""
    random_ = random.Random(seed)
    sent = one(name, seconds, jitter_ms=0.8 * DUE_MS[name])
    sent = stalled(stalled(sent, 1000.0, 200.0), 370.0, 60.0)
    starts = [random_.randrange(16) for _ in range(int(seconds // 60) + 1)]
    kept = [m for m in sent if random_.random() > 0.05 and int(m[0]) % 7000 > 90]
    return [(t, n, count + starts[int(t // 60_000) % len(starts)], v) for t, n, count, v in kept]


@pytest.mark.parametrize("counters", [True, False])
@pytest.mark.parametrize(
    "seconds", [pytest.param(20.0, id="20 s"), pytest.param(600.0, id="10 min", marks=long)]
)
def test_ordinary_traffic_is_no_second_sender(seconds: float, counters: bool) -> None:
    sent = [message for name in DUE_MS for message in ordinary(name, seconds)]
    inputs, told = heard(sent, counters)
    assert told == []
    assert inputs.doubted(10**15) == []


def test_half_of_all_messages_lost_and_one_that_stands_still_are_one_sender() -> None:
    random_ = random.Random(3)
    assert heard(m for m in one("WheelSpeeds", 60.0) if random_.random() < 0.5)[1] == []
    still = [(t, name, 3, t % 7) for t, name, _, _ in one("WheelSpeeds", 5.0)]
    inputs, told = heard(still)
    assert told == []
    assert inputs.heard["WheelSpeeds"].frozen == 4999


def test_a_loop_that_was_held_up_finds_all_at_once_and_no_second_sender() -> None:
    sent = one("WheelSpeeds", 5.0)
    # The look that finds them all was due a second before.
    late = [(1000.0 if 1000.0 < t < 1900.0 else t, *rest) for t, *rest in sent]
    assert heard(late, counters=False)[1] == []


def test_what_two_send_counts_as_lost_until_a_second_after_the_last_sign() -> None:
    inputs, told = heard(
        [*one("WheelSpeeds", 3.0), *one("WheelSpeeds", 1.0, phase_ms=0.5, count=5, value=9.0)]
    )
    since = told[0][0]
    assert inputs.heard["WheelSpeeds"].senders.noticed == 1
    until_ns = inputs.heard["WheelSpeeds"].senders.until_ns
    assert 1000 * MS <= until_ns - HELD_NS <= 1100 * MS
    assert since < 100
    now_ns = 2999 * MS
    assert inputs.doubted(now_ns) == []
    assert inputs.value("wheel_speed_fl_rad_s", now_ns) == pytest.approx(1.0)
    assert inputs.doubted(until_ns - 1) == ["WheelSpeeds"]
    assert inputs.value("wheel_speed_fl_rad_s", until_ns - 1) != inputs.value("WheelSpeed_FL", until_ns - 1)


@pytest.mark.parametrize("name", ["WheelSpeeds", "RoadClass", "Chassis"])
def test_the_loop_holds_with_flag_0_while_two_send_and_goes_on_afterwards(name: str) -> None:
    bench = Bench()
    receive, coded = bench.bus.receive, CODEC[name]

    def both() -> list[can.Message]:
        cycle, came = bench.bus.polls, receive()
        number, due = divmod(cycle, DUE_MS[name])
        true = [(number, 0.0)] if due == 0 and name != "WheelSpeeds" else []
        others = true + ([(number + 9, 1.0)] if due == 0 and 200 <= cycle < 800 else [])
        data = [coded.encode(dict.fromkeys(coded.signals, v), c) for c, v in others]
        return came + [
            can.Message(arbitration_id=coded.message.frame_id, is_extended_id=False, data=d) for d in data
        ]

    bench.bus.receive = both  # type: ignore[method-assign]
    bench.bus.messages = lambda cycle: driving()
    bench.run(2400)
    status = bench.sent("Status")[:2400]
    first = status.index(HELD_INPUT)
    assert 200 <= first < 700
    assert set(status[first:1750]) == {HELD_INPUT}
    assert set(status[2200:]) == {RUNNING}
    assert set(bench.sent("Flag")[first:1750]) == {0.0}
    assert bench.events.kinds[f"two senders {name}"].count == 1
    assert "Remove one from the bus" in bench.events.kinds[f"two senders {name}"].text


# Lengths


@pytest.mark.parametrize("length", range(65))
def test_a_message_has_the_length_of_the_file_or_that_filled_up_to_one_of_can_fd(
    length: int, tmp_path: Path
) -> None:
    shorter = tmp_path / "shorter.dbc"
    shorter.write_text(TEXT.replace("WheelTorques: 8", "WheelTorques: 9"), encoding="utf-8")
    codec = load_codec(shorter)
    inputs = Inputs(codec, unsaid)
    assert (inputs.take(256, False, bytes(length), 1) == "WheelSpeeds") == (length == 8)
    assert (inputs.take(257, False, bytes(length), 1) == "WheelTorques") == (length in (9, 12))
    assert (inputs.heard["WheelSpeeds"].broken, inputs.heard["WheelTorques"].broken) == (
        length != 8,
        length not in (9, 12),
    )


# DBC files


def changed(old: str, new: str) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, 1)


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(changed("(0.01,-20)", "(0,-20)"), id="scale 0"),
        pytest.param(changed("(0.01,-20)", "(1e999,-20)"), id="endless scale"),
        pytest.param(changed("(0.01,-20)", f"({'9' * 1000},-20)"), id="1000 digits"),
        pytest.param(changed("0|15@1+", "0|0@1+"), id="no bits"),
        pytest.param(changed("0|15@1+", "0|16@1+"), id="overlapping"),
        pytest.param(changed("0|15@1+", "999999999999|15@1+"), id="far beyond"),
        pytest.param(changed("WheelSpeeds: 8", "WheelSpeeds: 99999999999"), id="endless message"),
        pytest.param(changed("WheelSpeeds: 8", "WheelSpeeds: //\n 99999999999"), id="endless behind a comment"),
        pytest.param(changed("WheelSpeeds: 8", "WheelSpeeds: 65"), id="longer than CAN FD"),
        pytest.param(changed("Estimate: 8", "Estimate: 12"), id="longer than is sent"),
        pytest.param(changed("BO_ 257 ", "BO_ 256 "), id="identifier twice"),
        pytest.param(changed("WheelTorques: 8", "WheelSpeeds: 8"), id="name twice"),
        pytest.param(changed("WheelSpeed_FR :", "WheelSpeed_FL :"), id="signal twice"),
        pytest.param(changed(" TRPAC :", " TRPAC M :").replace("TRPAC_std :", "TRPAC_std m1 :"), id="multiplexed"),
        pytest.param(changed("VAL_ 256 WheelSpeed_FL 32767", "VAL_ 256 WheelSpeed_FL 99999"), id="choice too large"),
        pytest.param(changed("VAL_ 256 WheelSpeed_FL 32767", "VAL_ 256 WheelSpeed_FL 1.5"), id="choice no number"),
        pytest.param(changed('"StaleAfterMs" INT 0 60000', '"StaleAfterMs" STRING ').replace(
            'SG_ 256 WheelSpeed_FL 30;', 'SG_ 256 WheelSpeed_FL "soon";'), id="limit no number"),
        pytest.param(changed("WheelSpeed_FL 30;", "WheelSpeed_FL -30;"), id="limit below 0"),
        pytest.param(changed('"GenMsgCycleTime" BO_ 256 1;', '"GenMsgCycleTime" BO_ 256 -1;'), id="cycle below 0"),
        pytest.param(changed("60|4@1+ (1,0)", "60|4@1- (1,0)"), id="counter below 0"),
        pytest.param(changed("60|4@1+ (1,0)", "60|4@1+ (2,0)"), id="counter by two"),
        pytest.param(changed("[-20|307.66]", "[400|500]"), id="range out of reach"),
        pytest.param(TEXT + "SG_MUL_VAL_ 256 WheelSpeed_FL WheelSpeed_FR 0-99999999999;\n", id="endless branches"),
        pytest.param(TEXT.replace("WheelSpeeds", "W" * 1_000_000), id="endless name"),
        pytest.param(TEXT[:3000], id="cut off"),
        pytest.param(TEXT.replace("0.01", "\x00"), id="zeros"),
    ],
)  # fmt: skip
def test_a_dbc_file_that_cannot_be_used_is_refused_in_a_sentence(text: str, tmp_path: Path) -> None:
    path = tmp_path / "strange.dbc"
    path.write_text(text, encoding="utf-8")
    begun = time.monotonic()
    with pytest.raises(HilError, match=r"strange\.dbc") as refused:
        load_codec(path)
    assert time.monotonic() - begun < 5.0
    assert len(str(refused.value)) < 1500
    assert str(refused.value).isprintable()


def test_a_dbc_file_is_a_regular_one_of_bounded_size(tmp_path: Path) -> None:
    pipe, large = tmp_path / "pipe.dbc", tmp_path / "large.dbc"
    os.mkfifo(pipe)
    with pytest.raises(HilError, match=r"pipe\.dbc: is no regular file"):
        load_codec(pipe)
    with large.open("wb") as file:
        file.truncate(16_000_001)
    with pytest.raises(HilError, match=r"large\.dbc: 16\.0 MB"):
        load_codec(large)


def test_signals_as_floats_are_cut_to_what_their_bits_hold(tmp_path: Path) -> None:
    path = tmp_path / "floats.dbc"
    text = re.sub(
        r" SG_ TRPAC : (.*\n SG_ .*)+",
        ' SG_ TRPAC : 0|32@1- (1,0) [0|0] "1" Car\n'
        + "".join(
            f' SG_ {name} : {32 + k}|1@1+ (1,0) [0|0] "" Car\n'
            for k, name in enumerate(("TRPAC_std", "K_v", "Flag", "Excitation", "TRPAC_dynamics"))
        )
        + ' SG_ Status : 40|3@1+ (1,0) [0|7] "" Car\n SG_ LifeCounter : 48|8@1+ (1,0) [0|255] "" Car\n',
        TEXT,
        count=1,
    )
    path.write_text(text + "SIG_VALTYPE_ 512 TRPAC : 1;\n", encoding="utf-8")
    coded = load_codec(path)["Estimate"]
    assert coded.decode(coded.encode({"TRPAC": 1e300}))[0]["TRPAC"] == pytest.approx(3.4028234e38)


NUMBERS = (
    "0",
    "-1",
    "1",
    "nan",
    "1e999",
    "1e-320",
    "1e308",
    "9" * 1000,
    "99999999999",
    "4294967295",
    "65",
    "1.5",
)


def damaged(random_: random.Random) -> bytes:
    """The shipped file with some damage."""
    kind, lines = random_.randrange(6), TEXT.splitlines()
    if kind == 0:
        return TEXT[: random_.randrange(len(TEXT))].encode()
    if kind == 1:
        flipped = bytearray(TEXT.encode())
        for _ in range(random_.choice([1, 3, 30])):
            flipped[random_.randrange(len(flipped))] = random_.randrange(256)
        return bytes(flipped)
    if kind == 2:
        lines.insert(random_.randrange(len(lines)), random_.choice(lines))
    elif kind == 3:
        del lines[random_.randrange(len(lines))]
    elif kind == 4:
        places = [k for k, line in enumerate(lines) if line.startswith(" SG_")]
        for place in random_.sample(places, 3):
            marks = (" M :", " m0 :", " m1M :", " mX :", f" m{'9' * 12} :")
            lines[place] = lines[place].replace(" :", random_.choice(marks), 1)
        lines += ["SG_MUL_VAL_ 256 WheelSpeed_FL WheelSpeed_FR 0-1;"] * random_.randrange(2)
        lines += ["SG_MUL_VAL_ 256 WheelSpeed_FR WheelSpeed_FL 0-1;"] * random_.randrange(2)
    else:
        places = [k for k, line in enumerate(lines) if re.search(r"\d", line)]
        for place in random_.sample(places, random_.choice([1, 1, 3])):
            found = random_.choice(list(re.finditer(r"[-+]?\d+\.?\d*", lines[place])))
            lines[place] = (
                lines[place][: found.start()] + random_.choice(NUMBERS) + lines[place][found.end() :]
            )
    return "\n".join(lines).encode()


@pytest.mark.parametrize("files", [pytest.param(150, id="150"), pytest.param(2000, id="2000", marks=long)])
def test_a_damaged_dbc_file_is_refused_or_its_messages_can_be_sent_and_read(
    files: int, tmp_path: Path
) -> None:
    random_, path, loaded = random.Random(files), tmp_path / "damaged.dbc", 0
    for _ in range(files):
        path.write_bytes(damaged(random_))
        try:
            codec = load_codec(path)
        except HilError:
            continue
        loaded += 1
        inputs = Inputs(codec, unsaid)
        for name in INPUT_MESSAGES + OUTPUT_MESSAGES:
            coded = codec[name]
            for value in (0.3, 1e300, -1e300, float("nan"), float("inf")):
                coded.decode(coded.encode(dict.fromkeys(coded.signals, value), random_.randrange(1000)))
            for _ in range(5 * (name in INPUT_MESSAGES)):
                data = random_.randbytes(coded.message.length)
                inputs.take(coded.message.frame_id, coded.message.is_extended_frame, data, 1)
    assert loaded > files // 20


# A loop's process that is killed


PARENT = """
import sys, time
sys.path[:0] = [{support!r}, {root!r}, {folder!r}]
if __name__ == "__main__":
    import hil_bodies, slow_to_load
    from trpac_hil.rig import Rig
    rig = Rig()
    rig.add("plant", hil_bodies.deaf, ...)
    rig.add("camera", slow_to_load.body, ...)
    print(*(process.pid for _, process in rig._helpers), flush=True)
    time.sleep(600.0)
"""
SLOW_TO_LOAD = """
import multiprocessing, time
if multiprocessing.parent_process() is not None:
    time.sleep(600.0)
def body(control): ...
"""


def test_helpers_end_with_the_process_of_the_loop_at_whatever_they_are_even_while_they_load(
    tmp_path: Path,
) -> None:
    (tmp_path / "slow_to_load.py").write_text(SLOW_TO_LOAD, encoding="utf-8")
    root = Path(__file__).parents[2]
    support = str(root / "tests" / "support")
    program = PARENT.format(support=support, root=str(root), folder=str(tmp_path))
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    assert parent.stdout
    helpers = [int(number) for number in parent.stdout.readline().split()]
    time.sleep(1.0)  # for them to come as far as that
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    until_s = time.monotonic() + 2.0
    while time.monotonic() < until_s and any(map(_runs, helpers)):
        time.sleep(0.05)
    running = [number for number in helpers if _runs(number)]
    for number in running:
        os.kill(number, signal.SIGKILL)
    assert running == []
    assert len(helpers) == 2


def _runs(process: int) -> bool:
    """Whether it is there and no mere entry of one that has ended."""
    try:
        return "Z" not in Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
