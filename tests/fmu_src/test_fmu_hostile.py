"""Units, archives and hosts that mean harm, or are badly broken: one short refusal, nothing left behind, no hang."""

from __future__ import annotations

import ctypes
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import textwrap
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from doctored_units import RECORD, changed, command, crashing, findings
from fmpy.fmi1 import FMICallException
from fmu_unit import DRIVING, Unit
from picture_memory import edge

from fmu_src.ssp_client import problems, simulate
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.unpacking import require_whole, unpack_unit

pytestmark = pytest.mark.e2e

Open = Callable[..., Unit]
WARNING, ERROR = 1, 3
LONGEST_LOG = 1100
DESCRIPTION = "modelDescription.xml"
SUPPORT = Path(__file__).parents[1] / "support"


# The doctor


def naming(unit_file: Path, target: Path, packages: dict[str, str]) -> Path:
    """The unit, whose record names these packages besides."""
    with zipfile.ZipFile(unit_file) as archive:
        record = json.loads(archive.read(RECORD))
    record["packages"] |= packages
    return changed(unit_file, target, {RECORD: json.dumps(record).encode()})


def test_modules_that_only_the_file_names_are_not_imported_and_no_command_repeats_them(
    unit_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    for name in ("evil", "numpy"):
        code = f"open({str(tmp_path / 'was_here')!r}, 'w').close()\nraise ImportError\n"
        (tmp_path / "here" / f"{name}.py").write_text(code)
    monkeypatch.chdir(tmp_path / "here")
    named = {"evil": "x; rm -rf ~", "also": "--index-url=http://evil", "numpy": "numpy; reboot"}
    done = command(naming(unit_file, tmp_path / "TrpacEstimator.fmu", named), "--json")
    assert done.exit_code == 1
    assert not (tmp_path / "was_here").exists()
    found = findings(done)
    assert "also; evil" in found["record"]["text"]
    assert found["packages"]["state"] == "ok", found["packages"]
    assert found["trial"]["text"] == "not run: the file is not what was built"
    assert not any(word in done.stdout for word in ("rm -rf", "index-url", "reboot"))


def test_the_doctor_says_that_it_runs_the_units_code_and_can_leave_it_out(
    unit_file: Path, tmp_path: Path
) -> None:
    trace = tmp_path / "was_here"
    unit = crashing(unit_file, tmp_path / "TrpacEstimator.fmu", f"open({str(trace)!r}, 'w').close()")
    looked = command(unit, "--json", "--no-run")
    assert (looked.exit_code, looked.stderr) == (0, "")
    assert not json.loads(looked.stdout)["ran_its_code"]
    assert findings(looked)["trial"]["text"] == "not run: --no-run was given"
    assert not trace.exists()
    ran = command(unit, "--json")
    assert "the unit's own code now runs" in ran.stderr.lower()
    assert json.loads(ran.stdout)["ran_its_code"]
    assert trace.exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux for it")
def test_a_trial_that_hangs_ends_with_a_doctor_that_is_killed(unit_file: Path, tmp_path: Path) -> None:
    told = tmp_path / "pid"
    code = f"import os, time; open({str(told)!r}, 'w').write(str(os.getpid())); time.sleep(300)"
    unit = crashing(unit_file, tmp_path / "TrpacEstimator.fmu", code)
    doctor = subprocess.Popen(
        [Path(sys.executable).with_name("trpac"), "fmu", "doctor", unit],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    pid = int(within(60.0, lambda: told.exists() and told.read_text()))
    doctor.kill()
    doctor.wait()
    try:
        within(5.0, lambda: not alive(pid))
    finally:
        if alive(pid):
            os.kill(pid, signal.SIGKILL)


def within(limit_s: float, look: Callable[[], object]) -> object:
    """What `look` gives as soon as that is true."""
    end_s = time.monotonic() + limit_s
    while not (seen := look()):
        assert time.monotonic() < end_s, "in vain"
        time.sleep(0.02)
    return seen


def alive(pid: int) -> bool:
    state = Path(f"/proc/{pid}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.parametrize("last", ["1", "[]", '{"ran": 1}', '{"ran": true, "log": 5}', "[" * 100_000])
def test_a_unit_that_writes_answers_of_its_own_is_a_problem(
    unit_file: Path, tmp_path: Path, last: str
) -> None:
    say = f"import atexit; atexit.register(print, {last[:1]!r} * {len(last)})" if len(last) > 99 else (
        f"import atexit; atexit.register(print, {last!r})"
    )  # fmt: skip
    done = command(crashing(unit_file, tmp_path / "TrpacEstimator.fmu", say), "--json")
    assert done.exit_code == 1, done.output
    assert findings(done)["trial"]["state"] == "problem"


@pytest.mark.parametrize(
    "record",
    [
        b"[" * 200_000,
        b"[]",
        b"7",
        b'{"schema": 1, "unit": 1, "version": [], "build": null, "packages": {}, "files": {}}',
        b'{"schema": 1, "unit": "a", "version": "", "build": "", "packages": [], "files": {}}',
        b'{"schema": ' + b"9" * 10_000 + b"}",
        b'{"schema": 1, "' + b"\x1b[2J" * 50_000 + b'": 1}',
        b" " * (17 << 20),
    ],
    ids=["deep", "list", "number", "types", "packages", "digits", "long", "huge"],
)
def test_a_record_that_is_none_is_told_in_short(unit_file: Path, tmp_path: Path, record: bytes) -> None:
    done = command(changed(unit_file, tmp_path / "TrpacEstimator.fmu", {RECORD: record}), "--no-run")
    assert done.exit_code == 1
    assert isinstance(done.exception, SystemExit)
    assert len(done.output) < 8000
    assert "\x1b[2J" not in done.output


# Archives


def zip_of(target: Path, entries: dict[str | zipfile.ZipInfo, bytes], how: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(target, "w", how) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return target


def linked(name: str, mode: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)
    entry.external_attr = mode << 16
    return entry


def huge(target: Path, size: int, compressed: bool) -> Path:
    how = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with (
        zipfile.ZipFile(target, "w", how, compresslevel=1) as archive,
        archive.open("resources/x.bin", "w", force_zip64=True) as file,
    ):
        for _ in range(size >> 24):
            file.write(bytes(1 << 24))
    return target


def lying(target: Path) -> Path:
    """An entry of 64 MB that says in both places that it has 10 bytes."""
    data = bytearray(zip_of(target, {"a.bin": bytes(64 << 20)}, zipfile.ZIP_DEFLATED).read_bytes())
    for start, at in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        place = data.index(start) + at
        data[place : place + 4] = (10).to_bytes(4, "little")
    target.write_bytes(data)
    return target


def overlapping(target: Path) -> Path:
    """A directory of 2000 entries that all name the same megabyte."""
    data = zip_of(target, {"aaaa": bytes(1 << 20)}, zipfile.ZIP_DEFLATED).read_bytes()
    at, end = data.index(b"PK\x01\x02"), data.index(b"PK\x05\x06")
    entry = data[at:end]
    directory = b"".join(entry.replace(b"aaaa", b"%04d" % n) for n in range(2000))
    tail = bytearray(data[end:])
    tail[8:12] = (2000).to_bytes(2, "little") * 2
    tail[12:16] = len(directory).to_bytes(4, "little")
    target.write_bytes(data[:at] + directory + bytes(tail))
    return target


def flagged(target: Path, at: int, value: int) -> Path:
    """An entry whose header in the directory says something else."""
    data = bytearray(zip_of(target, {"a.bin": b"text"}).read_bytes())
    data[data.index(b"PK\x01\x02") + at] = value
    target.write_bytes(data)
    return target


BAD_ARCHIVES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "bomb": (lambda target: huge(target, 3 << 30, compressed=True), "unpacks to 3.2 GB"),
    "lying": (lying, "a.bin"),
    "overlapping": (overlapping, "unpacks to 2.1 GB"),
    "many": (lambda t: zip_of(t, {f"{n}": b"" for n in range(10_001)}), "10001 entries"),
    "directory": (lambda t: zip_of(t, {f"{n}".zfill(250): b"" for n in range(20_000)}), "directory"),
    "leaves": (lambda t: zip_of(t, {"a/../../b": b"x"}), "outside"),
    "absolute": (lambda t: zip_of(t, {"/tmp/b": b"x"}), "outside"),
    "drive": (lambda t: zip_of(t, {"C:b": b"x"}), "outside"),
    "backslash": (lambda t: zip_of(t, {"..\\b": b"x"}), "outside"),
    "link": (lambda t: zip_of(t, {linked("a", 0o120777): b"/etc/passwd"}), "link or a device"),
    "device": (lambda t: zip_of(t, {linked("a", 0o020666): b""}), "link or a device"),
    "capitals": (lambda t: zip_of(t, {"A.py": b"1", "a.py": b"2"}), "stands twice"),
    "file and folder": (lambda t: zip_of(t, {"a": b"1", "a/b": b"2"}), "file and a folder"),
    "folder and file": (lambda t: zip_of(t, {"a/b": b"2", "a": b"1"}), "twice"),
    "escapes": (lambda t: zip_of(t, {"a\x1b[2Jb": b"1"}), "no printable path"),
    "long name": (lambda t: zip_of(t, {"a" * 256: b"1"}), "more than 255 bytes"),
    "deep": (lambda t: zip_of(t, {"a/" * 5000 + "b": b"1"}), "cannot be unpacked"),
    "encrypted": (lambda t: flagged(t, 8, 1), "encrypted"),
    "method": (lambda t: zip_of(t, {"a": bytes(999)}, zipfile.ZIP_LZMA), "compressed otherwise"),
    "doctype": (lambda t: zip_of(t, {DESCRIPTION: b"<!DOCTYPE a><a/>"}), "document type"),
    "doctype in UTF-16": (
        lambda t: zip_of(t, {DESCRIPTION: "\ufeff<!DOCTYPE a><a/>".encode("utf-16-le")}), "document type",
    ),
    "large description": (
        lambda t: zip_of(t, {DESCRIPTION: bytes(17 << 20)}, zipfile.ZIP_DEFLATED), "text of more than 16 MB",
    ),
    "large": (lambda t: sparse(t, 3_800_000_000), "3800.0 MB"),
}  # fmt: skip


def sparse(target: Path, size: int) -> Path:
    with target.open("wb") as file:
        file.truncate(size)
    return target


@pytest.mark.parametrize("case", BAD_ARCHIVES)
def test_archives_that_could_harm_are_refused_in_a_sentence_and_nothing_is_left(
    tmp_path: Path, case: str
) -> None:
    make, said = BAD_ARCHIVES[case]
    archive = make(tmp_path / "bad.fmu")
    before_kb, started_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    with pytest.raises(UnitFileError, match=r"bad\.fmu") as told:
        unpack_unit(archive, tmp_path / "inside")
    assert said in str(told.value)
    assert len(str(told.value)) < 800
    assert time.monotonic() - started_s < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 300_000
    assert [path.name for path in tmp_path.iterdir()] == ["bad.fmu"]
    if case != "deep":
        with pytest.raises(UnitFileError):
            require_whole(archive)
    done = command(archive, "--no-run")
    assert (done.exit_code, done.stdout) == (2, "")


def test_a_pipe_or_a_device_in_the_place_of_a_unit_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.fmu")
    (tmp_path / "zero.fmu").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe.fmu", tmp_path / "zero.fmu"):
        with pytest.raises(UnitFileError, match="no regular file"):
            unpack_unit(path)
        assert command(path).exit_code == 2


def test_packages_whose_texts_or_units_could_harm_are_refused(tmp_path: Path) -> None:
    entities = b'<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a>&x;</a>'
    with pytest.raises(UnitFileError, match="document type"):
        problems(zip_of(tmp_path / "a.ssp", {"SystemStructure.ssd": entities}))
    assert problems(zip_of(tmp_path / "b.ssp", {"SystemStructure.ssd": b"<a"}))[0].startswith("System")
    within_it = zip_of(tmp_path / "bad.fmu", {"../escaped": b"x"}).read_bytes()
    package = zip_of(tmp_path / "c.ssp", {"SystemStructure.ssd": b"<a/>", "resources/bad.fmu": within_it})
    with pytest.raises(UnitFileError, match="outside"):
        simulate(package, 0.1)


# Pictures in memory


WRONG_ADDRESS = """
import ctypes, mmap, os, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from fmu_unit import DRIVING, Unit
from picture_memory import edge, pointing_to
unit = Unit(Path(sys.argv[1]))
unit.initialise()
unit.step({**DRIVING, "road_class": 0, "road_class_confidence": 0.9}, count=300)
for address, size in ((4096, 1000), (2**64 - 4096, 4096), (2**63, 100), (edge() - 100, 200)):
    unit.step({"road_class": -1, **pointing_to(address, size)})
    assert not unit.get("flag")
print(*(f"{line.status} {line.text}" for line in unit.log), sep="\\n")
sys.stdout.flush()
os._exit(0)
"""


def test_a_wrong_address_is_a_warning_and_the_host_lives(unit_folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WRONG_ADDRESS, unit_folder, SUPPORT],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{WARNING} TrpacEstimator: the 1000 bytes at address 0x1000 cannot be")
    assert len(done.stdout.splitlines()) == 1


def test_memory_is_read_up_to_where_it_ends_and_not_beyond() -> None:
    from fmu_src.memory import read_memory
    from trpac_core.vision.images import ImageError

    end = edge()
    ctypes.memmove(end - 4, b"last", 4)
    assert read_memory(end - 4, 4) == b"last"
    for address, size in ((end - 4, 5), (end, 1), (0, 10), (2**64 - 1, 1), (2**64 - 8, 100), (2**63, 8)):
        with pytest.raises(ImageError, match="cannot be read"):
            read_memory(address, size)
    picture = np.random.default_rng(1).integers(0, 256, 6_912_000, np.uint8)
    assert read_memory(picture.ctypes.data, picture.size) == picture.tobytes()


def test_where_the_system_reads_no_memory_its_reason_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from fmu_src import memory
    from trpac_core.vision.images import ImageError

    monkeypatch.setattr(memory, "_copy", lambda *_: (0, "Operation not permitted"))
    with pytest.raises(ImageError, match="Operation not permitted"):
        memory.read_memory(4096, 10)


# What a host gives


@pytest.mark.parametrize("value", ["x" * 10_000_000, "\x1b[2J" + "y" * 70_000, "a/" * 35_000])
def test_texts_without_end_are_handled_fast_and_not_repeated(
    open_unit: Open, capfd: pytest.CaptureFixture[str], value: str
) -> None:
    unit = open_unit()
    started_s = time.monotonic()
    unit.step({**DRIVING, "image_path": value}, count=5)
    assert time.monotonic() - started_s < 1.0
    (line,) = unit.log
    assert line.status == WARNING
    assert len(line.text) < LONGEST_LOG
    assert line.text.isprintable()
    assert not unit.get("flag")
    assert len(capfd.readouterr().err) < 2 * LONGEST_LOG


def saved(unit: Unit) -> dict[str, object]:
    """The state's content, without its checksum."""
    content: dict[str, object] = json.loads(unit.slave.serializeFMUstate(unit.slave.getFMUstate()))
    del content["crc32"]
    return content


def sealed(content: object) -> bytes:
    """A state of this content with the checksum that is right for it."""
    text = json.dumps(content)
    return f'{text[:-1]}, "crc32": {zlib.crc32(text.encode())}}}'.encode()


def with_value(name: str, value: object) -> Callable[[dict], bytes]:
    return lambda content: sealed({**content, "values": {**content["values"], name: value}})


BAD_STATES: dict[str, Callable[[dict], bytes]] = {
    "deep": lambda _: b"[" * 1_000_000,
    "deep within": lambda content: json.dumps({**content, "inner": 5}).encode().replace(
        b'"inner": 5', b'"inner": ' + b"[" * 900 + b"]" * 900
    ),
    "long": lambda _: b" " * (17 << 20),
    "number": lambda _: b"7",
    "digits": lambda _: b"9" * 10_000,
    "nan": lambda _: b"NaN",
    "unit": lambda content: sealed({**content, "unit": "\x1b[2J" * 1_000_000}),
    "values": lambda content: sealed({**content, "values": list(content["values"])}),
    "ready": lambda content: sealed({**content, "ready": "yes"}),
    "inner": lambda content: sealed({**content, "inner": None}),
    "inner list": lambda content: sealed({**content, "inner": [1, 2]}),
    "inner words": lambda content: sealed({**content, "inner": dict.fromkeys(content["inner"], "x")}),
    "more": lambda content: sealed({**content, "also": 1}),
    "text for a number": with_value("wheel_speed", "fast"),
    "none for a number": with_value("wheel_speed", None),
    "a number without end": with_value("wheel_speed", 10**400),
    "an integer without end": with_value("frame_id", 2**31),
    "a share for an integer": with_value("frame_id", 0.5),
    "a number for a text": with_value("image_path", 1),
    "half a surrogate pair": with_value("image_path", "\ud800"),
    "a mass below nothing": with_value("vehicle.mass", -1.0),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_STATES)
def test_a_state_that_a_host_has_made_up_changes_nothing_and_is_told_once(
    open_unit: Open, case: str, capfd: pytest.CaptureFixture[str]
) -> None:
    unit = open_unit()
    unit.step(DRIVING, count=20)
    before = saved(unit)
    bad = BAD_STATES[case](before)
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(bad))
    assert saved(unit) == before
    (line,) = unit.log
    assert line.status == ERROR
    assert "the state was not restored" in line.text
    assert len(line.text) < LONGEST_LOG
    assert len(capfd.readouterr().err) < 2 * LONGEST_LOG
    unit.step()
    assert unit.get("TRPAC") > 0.0


ODD_ERRORS = [
    "RecursionError('x')",
    "MemoryError()",
    "SystemExit(3)",
    "Odd()",
    "UnicodeError('\\ud800' * 10**6)",
]


@pytest.mark.parametrize("error", ODD_ERRORS)
def test_no_error_of_any_kind_leaves_a_callback(unit_folder: Path, tmp_path: Path, error: str) -> None:
    folder = shutil.copytree(unit_folder, tmp_path / "unit")
    (script,) = (folder / "resources").glob("fmu_src_*/trpac_estimator.py")
    odd = """
    class Odd(BaseException):
        def __str__(self):
            raise RuntimeError("no words")
    def fail(*_):
        raise ERROR
    TrpacEstimator.step = TrpacEstimator.shown = TrpacEstimator.inner_state = fail
    """
    script.write_text(script.read_text() + textwrap.dedent(odd).replace("ERROR", error))
    code = """
    import os, sys
    sys.path.insert(0, sys.argv[2])
    from pathlib import Path
    from fmu_unit import Unit
    unit = Unit(Path(sys.argv[1]))
    unit.initialise()
    sys.stderr.close()
    try:
        unit.step()
    except Exception:
        pass
    unit.outputs()
    unit.slave.getFMUstate()
    print(len(unit.log), max((len(line.text) for line in unit.log), default=0))
    sys.stdout.flush()
    os._exit(0)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), folder, SUPPORT],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[1]) < LONGEST_LOG


# Files that a host names to the plant


@pytest.mark.parametrize("parameter", ["vehicle_path", "road_path"])
@pytest.mark.parametrize("kind", ["pipe", "zero", "long"])
def test_what_is_no_file_does_not_hold_the_plant(
    open_plant: Open, tmp_path: Path, parameter: str, kind: str
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    path = "n" * 5_000_000 if kind == "long" else str(tmp_path / kind)
    started_s = time.monotonic()
    unit = open_plant(**{parameter: path})
    assert time.monotonic() - started_s < 5.0
    with pytest.raises(FMICallException):
        unit.step()
    (line,) = unit.log
    assert line.status == ERROR
    assert len(line.text) < LONGEST_LOG


@pytest.mark.parametrize("parameter", ["vehicle_path", "road_path"])
@pytest.mark.parametrize("start", ["", "a: &b\n", "- x\n", "{", "schema: 1\nname: "])
def test_the_log_repeats_no_line_of_a_wrong_file(
    open_plant: Open, tmp_path: Path, parameter: str, start: str
) -> None:
    lines = [f"user{number}:x:{number}:0:secret {number}:/root:/bin/sh" for number in range(20)]
    (tmp_path / "passwd").write_text(start + "\n".join(lines) + "\n")
    unit = open_plant(**{parameter: str(tmp_path / "passwd")})
    (line,) = unit.log
    assert line.status == ERROR
    assert "secret" not in line.text
