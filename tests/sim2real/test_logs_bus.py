"""Reading raw logs of a bus with a DBC file: every format, what signals may be, and files that are damaged."""

import json
import struct
import time
import zlib

import can
import numpy as np
import pytest
from asammdf import MDF, Signal
from bus_maker import DBC, MAPPING, NONE, QUANTUM, WRITERS, described, frames_of, write
from log_maker import make_frame
from long import beyond
from typer.testing import CliRunner

import trpac
from scenarios.library import located
from sim2real.logs import LogError, load_mapping, read_log, write_log
from sim2real.logs.formats import bus_file, bus_frames, extraction
from sim2real.logs.formats.bus_signals import Catalogue, Frames, decoded
from sim2real.sources import read_source
from trpac_cli.main import app

HALF = 0.5 + 1e-6
"""A raw value is rounded by half a step."""

MAPPED = {line.split(": ")[1] for line in MAPPING.splitlines()[2:]} | {
    f"wheel_speed_{w}_rad_s" for w in ("fl", "fr", "rl", "rr")
}
"""Names of the signals that are read."""


@pytest.fixture
def frame():
    return make_frame()


@pytest.fixture
def mapping(tmp_path):
    (tmp_path / "map.yaml").write_text(MAPPING)
    return load_mapping(tmp_path / "map.yaml")


def mapped(tmp_path, **columns):
    """The mapping with other sources for some columns, or further ones."""
    kept = [line for line in MAPPING.splitlines() if line.split(":")[0].strip() not in columns]
    text = "\n".join([*kept, *(f"  {name}: {source}" for name, source in columns.items())])
    (tmp_path / "other.yaml").write_text(text)
    return load_mapping(tmp_path / "other.yaml")


def assert_same(log, frame, rows=slice(None)):
    for name in frame.columns.drop("time_s"):
        step = next(step for begin, step in QUANTUM.items() if name.startswith(begin))
        assert log.signals[name] == pytest.approx(frame[name].to_numpy()[rows], abs=HALF * step), name


@pytest.mark.parametrize("suffix", WRITERS)
def test_every_format_reads_back(tmp_path, frame, mapping, suffix):
    """Intel and Motorola, 11 and 29 bits, CAN FD, a float; each with the names of the DBC file."""
    start_s = time.time() + 1.0 if suffix == ".mf4" else 1.7e9
    path = write(tmp_path / f"drive{suffix}", frames_of(frame, start_s))
    log = read_log(path, mapping, described(tmp_path))
    assert_same(log, frame)
    assert log.time_s - log.time_s[0] == pytest.approx(frame["time_s"], abs=1e-6)
    assert suffix == ".mf4" or log.time_s[0] == 0.0
    assert log.warnings == ()
    assert log.ignored == ("Page.Which", "Page.Steer", "Page.Yaw")


def test_codes_of_a_signed_signal_that_are_written_without_its_sign(tmp_path, frame, mapping):
    messages = frames_of(frame)
    motion = [message for message in messages if message.arbitration_id == 258]
    for message in motion[50:57]:
        message.data[4:6] = b"\xff\xfe"
    dbc = described(tmp_path, DBC.replace("VAL_ 256", 'VAL_ 258 Ax 65534 "SNA" ;\nVAL_ 256', 1))
    log = read_log(write(tmp_path / "log.blf", messages), mapping, dbc)
    assert np.flatnonzero(np.isnan(log.signals["accel_x_m_s2"])).tolist() == list(range(50, 57))
    assert "signal Motion.Ax: 7 of 301 samples are lost" in log.warnings[0]


def test_frames_of_a_page_that_is_not_described_are_told(tmp_path, frame, mapping):
    messages = frames_of(frame)
    pages = [message for message in messages if message.arbitration_id == 259]
    for message in pages[::10]:
        message.data[0] = 7
    dbc = described(tmp_path, "".join(line for line in DBC.splitlines(True) if " Yaw m1 " not in line))
    page = mapped(tmp_path, yaw_rate_rad_s="{column: Page.Which, unit: rad/s}")
    log = read_log(write(tmp_path / "log.blf", messages), page, dbc)
    (told,) = (text for text in log.warnings if "multiplexer" in text)
    undescribed = sum(message.data[0] != 0 for message in pages)
    assert told.startswith(
        f"message Page: {undescribed} frames have a multiplexer that the DBC file does not"
    )


def test_what_a_multiplexer_carries_has_its_own_times(tmp_path, frame):
    mapping = mapped(tmp_path, steering_angle_rad="Steer", yaw_rate_rad_s="Page.Yaw")
    log = read_log(write(tmp_path / "log.blf", frames_of(frame)), mapping, described(tmp_path))
    even, odd = 2 * np.arange(151), 2 * np.arange(150) + 1
    assert log.signals["steering_angle_rad"][even] == pytest.approx(0.001 * (even % 100), abs=1e-4)
    assert log.signals["yaw_rate_rad_s"][odd] == pytest.approx(0.001 * (odd % 100), abs=1e-4)


def test_a_branch_that_the_file_does_not_describe_is_no_sample(tmp_path, frame):
    frames = frames_of(frame)
    for other in [f for f in frames if f.arbitration_id == 259][10:20]:
        other.data[0] = 7
    log = read_log(
        write(tmp_path / "log.blf", frames), mapped(tmp_path, yaw_rate_rad_s="Yaw"), described(tmp_path)
    )
    assert np.isnan(log.signals["yaw_rate_rad_s"][11:20]).all()
    assert np.isfinite(log.signals["yaw_rate_rad_s"][22:-1]).all()


def test_what_is_not_available_or_out_of_range_is_lost(tmp_path, frame, mapping):
    frames = frames_of(frame)
    wheels = [f for f in frames if f.arbitration_id == 256]
    for i in (40, 41):
        wheels[i].data[0:2] = NONE.to_bytes(2, "little")
    wheels[50].data[2:4] = (60_000).to_bytes(2, "little")
    log = read_log(write(tmp_path / "log.blf", frames), mapping, described(tmp_path))
    assert np.flatnonzero(np.isnan(log.signals["wheel_speed_fl_rad_s"])).tolist() == [40, 41]
    assert np.flatnonzero(np.isnan(log.signals["wheel_speed_fr_rad_s"])).tolist() == [50]
    begin = "signal Wheels.wheel_speed_"
    assert [text for text in log.warnings if text.startswith(begin)] == [
        f"{begin}fl_rad_s: 2 of 301 samples are lost, the first at 0.400 s: 2 marked as no value by the DBC file.",
        f"{begin}fr_rad_s: 1 of 301 samples are lost, the first at 0.500 s: 1 outside [0, 500] rad/s by the DBC file.",
    ]


def test_frames_of_a_wrong_length_are_left_aside(tmp_path, frame, mapping):
    frames = frames_of(frame)
    short = [f for f in frames if f.arbitration_id == 256][7]
    short.data, short.dlc = short.data[:6], 6
    log = read_log(write(tmp_path / "log.log", frames), mapping, described(tmp_path))
    assert (
        "message Wheels: 1 of 301 frames have 6 bytes; 8 by the DBC file. They are ignored." in log.warnings
    )
    assert len(log) == 300
    with pytest.raises(
        LogError, match="message Wheels: 301 of 301 frames have 6, 8 bytes; 7 by the DBC file"
    ):
        read_log(
            tmp_path / "log.log",
            mapping,
            described(
                tmp_path,
                DBC.replace("Wheels: 8", "Wheels: 7").replace(
                    " SG_ wheel_speed_rr_rad_s : 48|16@1+", " SG_ wheel_speed_rr_rad_s : 48|8@1+"
                ),
            ),
        )


def test_error_and_remote_frames_and_those_of_others_are_no_samples(tmp_path, frame, mapping):
    frames = frames_of(frame)
    first_s = frames[0].timestamp
    for i in range(0, 900, 3):
        other = {"timestamp": first_s + 0.003 * i, "channel": 1}
        frames.append(can.Message(**other, is_error_frame=True))
        frames.append(
            can.Message(**other, is_remote_frame=True, arbitration_id=256, is_extended_id=False, dlc=8)
        )
        frames.append(can.Message(**other, arbitration_id=256, is_extended_id=True, data=bytes(8)))
    frames.sort(key=lambda f: f.timestamp)
    log = read_log(write(tmp_path / "log.asc", frames), mapping, described(tmp_path))
    assert_same(log, frame)


def test_late_and_repeated_frames_are_mended_and_many_are_refused(tmp_path, frame, mapping):
    frames = frames_of(frame)
    wheels = [i for i, f in enumerate(frames) if f.arbitration_id == 256]
    frames[wheels[9]], frames[wheels[8]] = frames[wheels[8]], frames[wheels[9]]
    again = frames[wheels[20]]
    frames.insert(wheels[20], can.Message(**{**vars_of(again), "data": bytes(8)}))
    log = read_log(write(tmp_path / "log.log", frames), mapping, described(tmp_path))
    assert_same(log, frame)
    assert (
        "message Wheels: of 302 frames 1 are late and 1 repeat a time, the first at 0.080 s"
        in log.warnings[0]
    )
    with pytest.raises(
        LogError, match=r"message Wheels: of 603 frames 301 are late .* expected ascending times"
    ):
        read_log(write(tmp_path / "twice.log", [*frames, *frames_of(frame)]), mapping, described(tmp_path))


def vars_of(message):
    return {
        name: getattr(message, name)
        for name in ("timestamp", "arbitration_id", "is_extended_id", "is_fd", "channel")
    }


def test_one_id_on_two_channels(tmp_path, frame, mapping):
    """The same content is one signal; another one has to be chosen."""
    dbc, frames = described(tmp_path), frames_of(frame)
    both = sorted([*frames, *frames_of(frame, channel=4)], key=lambda f: f.timestamp)
    assert_same(read_log(write(tmp_path / "same.blf", both), mapping, dbc), frame)
    reversed_drive = frame.iloc[::-1].assign(time_s=frame["time_s"].to_numpy())
    both = sorted([*frames, *frames_of(reversed_drive, channel=4)], key=lambda f: f.timestamp)
    path = write(tmp_path / "log.blf", both)
    with pytest.raises(LogError) as error:
        read_log(path, mapping, dbc)
    assert "message Torque (ID 0x18FF0101) comes on the channels 2 and 5 with different content" in str(
        error.value
    )
    assert "expected one of them in the mapping, such as Torque.Trq_fl#2" in str(error.value)
    names = {
        "vehicle_speed_m_s": "Motion.Speed",
        "accel_x_m_s2": "Ax",
        "position_m": "Position",
        **{f"wheel_torque_{w}_nm": f"Torque.Trq_{w}" for w in ("fl", "fr", "rl", "rr")},
        **{f"wheel_speed_{w}_rad_s": f"wheel_speed_{w}_rad_s" for w in ("fl", "fr", "rl", "rr")},
    }
    chosen = mapped(tmp_path, **{name: f"{{column: '{source}#2'}}" for name, source in names.items()})
    assert_same(read_log(path, chosen, dbc), frame)
    with pytest.raises(LogError, match=r"Position#3 does not occur in the log on channel 3; it is on 2, 5"):
        read_log(path, mapped(tmp_path, position_m="{column: 'Position#3'}"), dbc)


def test_a_name_of_two_signals_is_asked_for(tmp_path, frame):
    path, dbc = write(tmp_path / "log.blf", frames_of(frame)), described(tmp_path)
    with pytest.raises(
        LogError, match=r"signal Speed stands for several: Motion\.Speed \(car\.dbc\), Other\.Speed"
    ):
        read_log(path, mapped(tmp_path, vehicle_speed_m_s="Speed"), dbc)


def test_a_message_that_is_not_there(tmp_path, frame, mapping):
    dbc = described(tmp_path)
    path = write(tmp_path / "log.blf", frames_of(frame, drop=["Motion"]))
    with pytest.raises(
        LogError, match=r"message Motion \(ID 0x102\) of Ax, .* does not occur in the log\."
    ) as error:
        read_log(path, mapping, dbc)
    assert len(str(error.value).splitlines()) == 1
    path = write(tmp_path / "page.blf", frames_of(frame, drop=["Motion", "Wheels", "Torque"]))
    with pytest.raises(
        LogError, match=r"page\.blf: has no frame .*: Motion \(0x102\).*IDs that it has: 0x103 \(301 "
    ):
        read_log(path, mapping, dbc)


def test_a_dbc_file_without_any_wanted_signal(tmp_path, frame):
    path = write(tmp_path / "log.blf", frames_of(frame))
    other = described(tmp_path, DBC.replace("wheel_speed_", "Whl_"))
    with pytest.raises(
        LogError, match=r"no signal of the DBC file has a name .*It has: Wheels\.Whl_fl_rad_s, "
    ):
        read_log(path, dbc=other)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_bus_log_without_a_dbc_file_asks_for_it(tmp_path, frame, mapping, suffix):
    path = write(tmp_path / f"log{suffix}", frames_of(frame))
    with pytest.raises(
        LogError, match=r"holds raw frames of a bus \(\w+\); expected the DBC file.*--dbc car\.dbc"
    ):
        read_log(path, mapping)


def test_two_dbc_files(tmp_path, frame, mapping):
    lines = DBC.splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if line.startswith("BO_ 258"))
    head, tail = "".join(lines[:6]), "".join(lines[at:])
    values = tail.index("VAL_")
    (tmp_path / "a.dbc").write_text("".join(lines[:at]) + tail[values:].split("SIG_")[0])
    (tmp_path / "b.dbc").write_text(head + tail[:values] + "SIG_VALTYPE_ 258 Speed : 1;\n")
    path = write(tmp_path / "log.blf", frames_of(frame))
    assert_same(read_log(path, mapping, [tmp_path / "a.dbc", tmp_path / "b.dbc"]), frame)


def test_a_dbc_file_in_cp1252(tmp_path, frame, mapping):
    """The format's first tools write no UTF-8."""
    path = write(tmp_path / "log.blf", frames_of(frame))
    (tmp_path / "car.dbc").write_bytes((DBC + 'CM_ "Räder, °C";\n').encode("cp1252"))
    assert_same(read_log(path, mapping, tmp_path / "car.dbc"), frame)


def test_an_mdf_with_frames_and_other_channels(tmp_path, frame, mapping):
    path = write(tmp_path / "log.mf4", frames_of(frame, time.time() + 1.0, drop=["Motion"]))
    with MDF(path) as mdf:
        time_s = mdf.get("CAN_DataFrame.ID").timestamps[::3]
        named = {"Motion.Speed": "vehicle_speed_m_s", "Ax": "accel_x_m_s2", "Position": "position_m"}
        mdf.append([Signal(frame[name].to_numpy(), time_s, name=column) for column, name in named.items()])
        mdf.save(tmp_path / "both.mf4")
    dbc = described(tmp_path)
    assert_same(read_log(tmp_path / "both.mf4", mapping, dbc), frame)
    with MDF(path) as mdf:
        mdf.append([Signal(frame[name].to_numpy(), time_s, name=name) for name in frame.columns[1:]])
        mdf.save(tmp_path / "all.mf4")
    log = read_log(tmp_path / "all.mf4", dbc=dbc)
    assert np.array_equal(log.signals["position_m"], frame["position_m"])


def test_an_mdf_without_frames_beside_a_dbc_file(tmp_path, frame):
    write_log(frame, tmp_path / "log.mf4")
    log = read_log(tmp_path / "log.mf4", dbc=described(tmp_path))
    assert "holds no raw frames of a bus: the DBC file is not used." in log.warnings


def test_a_dbc_file_beside_a_table_is_not_used(tmp_path, frame):
    frame.to_csv(tmp_path / "log.csv", index=False)
    log = read_log(tmp_path / "log.csv", dbc=described(tmp_path))
    assert "is a CSV file, whose columns have names: the DBC file is not used." in log.warnings


def test_names_and_contents(tmp_path, frame, mapping):
    """A table may be named .log; what is named like a format must be it."""
    dbc = described(tmp_path)
    frame.to_csv(tmp_path / "table.log", index=False)
    assert len(read_log(tmp_path / "table.log")) == len(frame)
    with pytest.raises(LogError, match=r"is named like candump and does not start like it"):
        read_log(tmp_path / "table.log", dbc=dbc)
    blf = write(tmp_path / "log.blf", frames_of(frame)).read_bytes()
    for name, kind in {"log.csv": "CSV", "log.trc": "TRC", "log.mf4": "MDF"}.items():
        (tmp_path / name).write_bytes(blf)
        with pytest.raises(LogError, match=rf"is named like {kind} and does not start like it"):
            read_log(tmp_path / name, mapping, dbc)
    asc = write(tmp_path / "log.asc", frames_of(frame)).read_bytes()
    (tmp_path / "other.blf").write_bytes(asc)
    with pytest.raises(LogError, match=r"is named like BLF"):
        read_log(tmp_path / "other.blf", mapping, dbc)


def test_trc_of_version_1(tmp_path, frame, mapping):
    """It has no CAN FD; times are whole milliseconds."""
    with can.TRCWriter(tmp_path / "log.trc") as writer:
        writer.file_version = can.io.trc.TRCFileVersion.V1_0
        for message in frames_of(frame, drop=["Motion"]):
            writer.on_message_received(message)
    unmeasured = {
        "vehicle_speed_m_s": "{column: wheel_speed_fl_rad_s, unit: m/s, scale: 0.29}",
        "accel_x_m_s2": "{constant: 0.1}",
        "position_m": "{integrate: {copy: vehicle_speed_m_s}}",
    }
    log = read_log(tmp_path / "log.trc", mapped(tmp_path, **unmeasured), described(tmp_path))
    assert log.time_s == pytest.approx(frame["time_s"], abs=1e-9)
    assert log.signals["wheel_torque_rr_nm"] == pytest.approx(frame["wheel_torque_rr_nm"], abs=HALF * 0.125)


def test_times_relative_to_the_frame_before_are_refused(tmp_path, frame, mapping):
    path = write(tmp_path / "log.asc", frames_of(frame))
    path.write_text(path.read_text().replace("timestamps absolute", "timestamps relative"))
    with pytest.raises(LogError, match="times are relative to the frame before; expected absolute ones"):
        read_log(path, mapping, described(tmp_path))


@pytest.mark.parametrize("suffix", [".blf", ".log"])
def test_a_log_cut_off_is_told(tmp_path, frame, mapping, suffix):
    path = write(tmp_path / f"log{suffix}", frames_of(frame))
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) - len(raw) // 20 - 1])
    log = read_log(path, mapping, described(tmp_path))
    assert 250 < len(log) < 301
    assert "ends within a frame: it was cut off; look at its end." in log.warnings
    assert log.signals["position_m"][:-1] == pytest.approx(frame["position_m"][: len(log) - 1], abs=1e-4)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A short drive in every format, with its DBC file and mapping."""
    folder = tmp_path_factory.mktemp("bus")
    (folder / "map.yaml").write_text(MAPPING)
    frames = frames_of(make_frame(rate_hz=50.0, duration_s=2.2))
    return (
        {s: write(folder / f"good{s}", frames) for s in WRITERS},
        described(folder),
        load_mapping(folder / "map.yaml"),
    )


def outcome(path, short):
    """The error of a file, or nothing."""
    try:
        read_log(path, short[2], short[1])
    except LogError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("seeds", [range(5), pytest.param(range(5, 40), marks=pytest.mark.long)])
@pytest.mark.parametrize("suffix", WRITERS)
def test_damage_is_a_clean_error_or_a_log(tmp_path, short, monkeypatch, capfd, suffix, seeds):
    """Files that were cut, have changed bytes, or a stretch twice."""
    monkeypatch.setattr(extraction, "LEAST_LIMIT_S", 15.0)
    raw = short[0][suffix].read_bytes()
    for seed in seeds:
        (tmp_path / f"log{suffix}").write_bytes(damaged(raw, np.random.default_rng(seed)))
        assert "within 15 s" not in outcome(tmp_path / f"log{suffix}", short)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", beyond(2, [".log", ".asc", ".trc", ".blf"]))
def test_200_damaged_files(tmp_path, short, monkeypatch, suffix):
    """The same without a process for each: python-can raises, and does not crash as the reader of MDF may."""

    def here(path, reader, kind, expected, **order):
        try:
            told, arrays = bus_frames.extract({"path": str(path), "most_numbers": 10**6, **order})
        except Exception as error:
            raise LogError(f"{path}: {error!r}") from error
        return extraction.Extract(json.loads(json.dumps(told)), arrays)

    monkeypatch.setattr(bus_file, "extract", here)
    raw = short[0][suffix].read_bytes()
    outcomes = []
    for seed in range(200):
        (tmp_path / f"log{suffix}").write_bytes(damaged(raw, np.random.default_rng(seed)))
        outcomes.append(outcome(tmp_path / f"log{suffix}", short))
    assert 20 < sum(map(bool, outcomes)) < 200


def test_200_damaged_dbc_files(tmp_path, short):
    raw, log = short[1].read_bytes(), short[0][".blf"]
    for seed in range(200):
        (tmp_path / "car.dbc").write_bytes(damaged(raw, np.random.default_rng(seed)))
        try:
            found = Catalogue([tmp_path / "car.dbc"])
            meant = found.wanted(MAPPED)
        except LogError:
            continue
        for each, _ in meant.values():
            frames = Frames(
                "1", np.arange(3.0), np.full(3, each.message.length, np.uint8), bytes(range(64)) * 3
            )
            decoded(each.message, frames, [each.signal])
        if seed < 5:
            outcome(log, (None, tmp_path / "car.dbc", short[2]))


def damaged(raw, rng):
    data = bytearray(raw)
    match rng.integers(3):
        case 0:
            return data[: rng.integers(len(data))]
        case 1:
            for at in rng.integers(len(data), size=rng.integers(1, 9)):
                data[at] = rng.integers(256)
            return data
        case _:
            at, n = rng.integers(len(data)), rng.integers(1, 200)
            return data[: at + n] + data[at:]


def test_a_length_of_nothing_does_not_hold_the_reader_up(tmp_path, short):
    """python-can would read one object of BLF without end."""
    _, dbc, mapping = short
    head = struct.pack("<4sLBBBBBBBBQQLL16H", b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, 0, 0, 0, 0, *[0] * 16)
    for version in (1, 9):
        item = struct.pack("<4sHHLL", b"LOBJ", 32, version, 0, 1) + bytes(100)
        packed = zlib.compress(item)
        box = struct.pack("<4sHHLLHxxxxxxLxxxx", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, len(item)) + packed
        (tmp_path / "log.blf").write_bytes(head.ljust(144, b"\0") + box)
        begin = time.monotonic()
        with pytest.raises(LogError, match="cannot be read as BLF"):
            read_log(tmp_path / "log.blf", mapping, dbc)
        assert time.monotonic() - begin < 10.0


def test_what_unfolds_is_refused(tmp_path, short, mapping):
    """A container of BLF that unpacks to 600 MB, and a text of one endless line."""
    head = struct.pack("<4sLBBBBBBBBQQLL16H", b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, 0, 0, 0, 0, *[0] * 16)
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(10_000_000)) for _ in range(60)) + packer.flush()
    box = struct.pack("<4sHHLLHxxxxxxLxxxx", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, 0) + packed
    (tmp_path / "log.blf").write_bytes(head.ljust(144, b"\0") + box)
    with pytest.raises(LogError, match=r"cannot be read as BLF \(MemoryError\)"):
        read_log(tmp_path / "log.blf", mapping, short[1])
    (tmp_path / "log.log").write_bytes(b"(1.0) can0 100#" + b"0" * 10_000_000)
    with pytest.raises(LogError, match=r"cannot be read as candump .*row 1 is longer than 10000 bytes"):
        read_log(tmp_path / "log.log", mapping, short[1])


def test_a_diagnosis_reads_them_with_its_road(tmp_path, frame, mapping):
    path = write(tmp_path / "log.blf", frames_of(frame))
    source = read_source(
        f"{path}@{located('road', 'paper_simulation')}", None, mapping, [described(tmp_path)]
    )
    assert_same(source.log, frame)


def test_the_front_door_and_the_command_take_a_dbc_file(tmp_path, frame):
    (tmp_path / "map.yaml").write_text(MAPPING)
    path, dbc = write(tmp_path / "log.blf", frames_of(frame)), described(tmp_path)
    assert_same(trpac.read_log(path, mapping=tmp_path / "map.yaml", dbc=dbc), frame)
    words = [
        "estimate",
        str(path),
        "--dbc",
        str(dbc),
        "--map",
        str(tmp_path / "map.yaml"),
        "--out",
        str(tmp_path / "out"),
    ]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "estimates.csv").is_file()
