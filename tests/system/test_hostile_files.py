"""Files that were made to do harm, given to the commands as a user would: refused in a line, or read harmlessly.

Each is handled within 5 s and 500 MB by a process that has everything loaded, as the first command of a session has
after its start. `benchmarks.robustness.fuzz` does the same with files that were damaged by chance.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from log_maker import make_frame
from long import long
from road_picture import road_picture

ROOT = Path(__file__).parents[2]
MOST_S, MOST_MB, LONGEST = 5.0, 500.0, 1000
Arguments = list[str]
Make = Callable[[Path], Arguments]


# How files come to a command


def scenario(folder: Path) -> Path:
    """A scenario among the files that it names."""
    for name in ("roads", "vehicles", "manoeuvres", "cameras"):
        shutil.copytree(ROOT / "scenarios" / name, folder / name)
    return Path(shutil.copy(ROOT / "scenarios" / "paper_simulation.yaml", folder / "scenario.yaml"))


def in_place_of(name: str, make: Callable[[Path], Any]) -> Make:
    """`trpac run` on a scenario of which one file is the hostile one."""

    def arguments(folder: Path) -> Arguments:
        path = folder / name if name == "scenario.yaml" else folder / name.replace("*", "paper_simulation")
        scenario(folder)
        path.unlink()
        make(path)
        return ["run", "scenario.yaml", "--out", "out"]

    return arguments


def as_vehicle(make: Callable[[Path], Any]) -> Make:
    return in_place_of("vehicles/four_in_wheel_motor_ev.yaml", make)


def text(content: str | bytes) -> Callable[[Path], Any]:
    data = content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass")
    return lambda path: path.write_bytes(data)


def vehicle(**changes: str) -> Callable[[Path], Any]:
    """The shipped vehicle with other text behind some keys."""

    def make(path: Path) -> None:
        shipped = (ROOT / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml").read_text()
        for key, value in changes.items():
            shipped, count = re.subn(
                rf"(?m)^(\s*{key}:).*$", lambda found, value=value: f"{found[1]} {value}", shipped
            )
            assert count == 1, key
        path.write_bytes(shipped.encode("utf-8", "surrogatepass"))

    return make


def as_log(name: str, make: Callable[[Path], Any], *more: str) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / name)
        return ["estimate", name, "--out", "out", *more]

    return arguments


def as_mapping(make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make_frame().to_csv(folder / "good.csv", index=False)
        make(folder / "map.yaml")
        return ["estimate", "good.csv", "--map", "map.yaml", "--out", "out"]

    return arguments


def as_picture(name: str, make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / name)
        return ["vision", "classify", name, "--out", "classes.csv"]

    return arguments


def as_video(make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / "drive.mp4")
        camera = str(ROOT / "scenarios" / "cameras" / "paper.yaml")
        return [
            "vision",
            "run",
            "drive.mp4",
            "--camera",
            camera,
            "--speed-m-s",
            "9",
            "--fps",
            "9",
            "--out",
            "out",
        ]

    return arguments


def as_unit(make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / "unit.fmu")
        return ["run", str(scenario(folder)), "--fmu", "unit.fmu", "--out", "out"]

    return arguments


def examined(make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / "unit.fmu")
        return ["fmu", "doctor", "unit.fmu"]

    return arguments


def on_the_rig(*option: str, make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        make(folder / option[-1])
        return ["hil", "--duration-s", "0.1", "--no-log", "--quiet", "--out", "out", *option]

    return arguments


def as_sweep(make: Callable[[Path], Any]) -> Make:
    def arguments(folder: Path) -> Arguments:
        scenario(folder)
        make(folder / "sweep.yaml")
        return ["sweep", "sweep.yaml", "--jobs", "1", "--out", "out"]

    return arguments


def sweep(**changes: Any) -> Callable[[Path], Any]:
    content = {"schema": 1, "name": "s", "scenario": "scenario.yaml", "runs": 1, "estimators": ["DIFE"]}
    return text(json.dumps(content | changes))


# Files that are none


def pipe(path: Path) -> None:
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def large(path: Path, size: int = 6_000_000_000) -> None:
    """A file of holes."""
    with path.open("wb") as file:
        file.truncate(size)


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as there:
        there.bind(os.path.relpath(path))


# Hostile contents


def unfolding(depth: int = 12) -> str:
    """A billion laughs: each line is nine times the one before."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, depth)]
    return "\n".join(lines)


def merging(depth: int = 25) -> str:
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{i}: &a{i}\n  <<: [*a{i - 1}, *a{i - 1}]" for i in range(1, depth)]
    return "\n".join(lines)


def csv_of(**columns: Any) -> Callable[[Path], Any]:
    return lambda path: make_frame().assign(**columns).to_csv(path, index=False)


def wide(count: int) -> Callable[[Path], Any]:
    return lambda path: path.write_text(
        ",".join(f"wheel_sped_{i}" for i in range(count)) + "\n" + "1," * (count - 1) + "1\n"
    )


def renamed(name: str) -> Callable[[Path], Any]:
    return lambda path: make_frame().rename(columns={"vehicle_speed_m_s": name}).to_csv(path, index=False)


def long_parquet(path: Path) -> None:
    """Constant columns take next to nothing in the file, and 5 GB out of it."""
    rows = 40_000_000
    schema = pa.schema([(name, pa.float64()) for name in make_frame().columns])
    batch = pa.table({name: pa.array(np.zeros(1_000_000)) for name in schema.names})
    with pq.ParquetWriter(path, schema, compression="zstd") as file:
        for _ in range(rows // 1_000_000):
            file.write_table(batch)


def wordy_parquet(path: Path) -> None:
    """One word of 1 MB, and 20,000 rows that point to it."""
    frame = pd.concat([make_frame()] * 70)
    frame["image_path"] = pd.Categorical.from_codes(np.zeros(len(frame), int), ["x" * 1_000_000])
    frame.to_parquet(path)


def mdf(formula: str) -> Callable[[Path], Any]:
    def make(path: Path) -> None:
        frame = make_frame()
        signals = [
            Signal(
                frame[name].to_numpy(),
                frame["time_s"].to_numpy(),
                name=name,
                conversion={"formula": formula} if name == "vehicle_speed_m_s" else None,
            )
            for name in frame.columns[1:]
        ]
        with MDF(version="4.10") as file:
            file.append(signals)
            file.save(path)

    return make


QUOTED = "(lambda: [c for c in ().__class__.__base__.__subclasses__()])() or X1"
NESTED = """(c for c in "".join(['o','s'])) and __import__("os").system("touch ran") or X1"""


def noise(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)


def scans(count: int) -> Callable[[Path], Any]:
    """A progressive JPEG whose last pass over the picture is there so often."""

    def make(path: Path) -> None:
        flat = np.full((3000, 4000, 3), 127, np.uint8)
        data = cv2.imencode(".jpg", flat, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
        scan = data[data.rfind(b"\xff\xda") : -2]
        path.write_bytes(data[:-2] + scan * count + data[-2:])

    return make


def half_jpeg(*settings: int) -> Callable[[Path], Any]:
    def make(path: Path) -> None:
        data = cv2.imencode(".jpg", noise(240, 320), list(settings))[1].tobytes()
        path.write_bytes(data[: len(data) // 2] + b"\xff\xd9")

    return make


def png(width: int, height: int, packed: bytes = b"") -> Callable[[Path], Any]:
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", packed),
        (b"IEND", b""),
    ]
    return text(
        b"\x89PNG\r\n\x1a\n"
        + b"".join(
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
            for kind, body in chunks
        )
    )


def archive(*entries: tuple[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> Callable[[Path], Any]:
    def make(path: Path) -> None:
        with zipfile.ZipFile(path, "w", compression) as file:
            for name, data in entries:
                file.writestr(name, data)

    return make


def packed_zeros(path: Path) -> None:
    """An archive of 1 MB that unpacks to 1 GB."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file,
        file.open("resources/zeros", "w", force_zip64=True) as entry,
    ):
        for _ in range(64):
            entry.write(bytes(16_000_000))


def link_out(path: Path) -> None:
    entry = zipfile.ZipInfo("resources/link")
    entry.external_attr = 0o120777 << 16
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(entry, "/etc")


def described(doctype: str) -> bytes:
    """A description that says what an entity of this document type stands for."""
    return f'<?xml version="1.0"?><!DOCTYPE b [{doctype}]><fmiModelDescription>&a;</fmiModelDescription>'.encode()


BOMB = described('<!ENTITY b "bbbbbbbbbb"><!ENTITY a "&b;&b;&b;">')
FILE_ENTITY = described('<!ENTITY a SYSTEM "file:///etc/passwd">')
RECORD = json.dumps(
    {
        "schema": 1,
        "unit": "X",
        "version": "1",
        "build": "1",
        "packages": {"hostile": "x; touch ran"},
        "files": {},
    }
).encode()


def shadowing(path: Path) -> None:
    """A unit whose record asks for a module that lies beside it."""
    path.with_name("hostile.py").write_text("open('ran', 'w').close()\n")
    path.with_name("numpy.py").write_text("open('ran', 'w').close()\n")
    archive(("modelDescription.xml", b"<fmiModelDescription/>"), ("resources/contents.json", RECORD))(path)


def part(content: bytes | None, name: str = "0000000.json") -> Make:
    """A sweep that is gone on with, in whose folder a part lies."""

    def arguments(folder: Path) -> Arguments:
        made = as_sweep(sweep())(folder)
        code = "import sys; from pathlib import Path; from scenarios.sweep.files import load_sweep; "
        code += "from scenarios.sweep.store import Parts, identity; "
        code += "Parts(Path('out'), identity(load_sweep('sweep.yaml'))).open()"
        subprocess.run(
            [sys.executable, "-c", code], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=True
        )
        place = folder / "out" / "parts" / name
        pipe(place) if content is None else place.write_bytes(content)
        return made

    return arguments


DEEP = b"[" * 100_000

REFUSED: dict[str, Make] = {
    # no files
    "vehicle is a pipe": as_vehicle(pipe),
    "vehicle is endless": as_vehicle(endless),
    "vehicle is a folder": as_vehicle(lambda path: path.mkdir()),
    "vehicle is a socket": as_vehicle(listening),
    "vehicle is 6 GB": as_vehicle(large),
    "scenario is a pipe": in_place_of("scenario.yaml", pipe),
    "road is endless": in_place_of("roads/*.yaml", endless),
    "mapping is a pipe": as_mapping(pipe),
    "sweep is a pipe": as_sweep(pipe),
    "log is a pipe": as_log("log.csv", pipe),
    "log is endless": as_log("log.mf4", endless),
    "log is 6 GB of holes": as_log("log.csv", large),
    "picture is a pipe": as_picture("a.jpg", pipe),
    "picture is endless": as_picture("a.png", endless),
    "picture is 6 GB": as_picture("a.png", large),
    "video is a pipe": as_video(pipe),
    "unit is a pipe": as_unit(pipe),
    "unit is endless": as_unit(endless),
    "unit is 3.8 GB": as_unit(lambda path: large(path, 3_800_000_000)),
    "unit is 900 MB": as_unit(lambda path: large(path, 900_000_000)),
    "bus is a pipe": on_the_rig("--dbc", "bus.dbc", make=pipe),
    "rig's vehicle is a pipe": on_the_rig("--vehicle", "car.yaml", make=pipe),
    "rig's unit is a pipe": on_the_rig("--fmu", "unit.fmu", make=pipe),
    # YAML
    "aliases unfold": as_vehicle(text(unfolding())),
    "merge keys unfold": as_vehicle(text(merging())),
    "alias of itself": as_vehicle(text("a: &a [*a]")),
    "nested lists": as_vehicle(text("[" * 400_000)),
    "nested mappings": as_vehicle(text("{a: " * 200_000)),
    "nested sums": as_mapping(text("position_m: " + "{sum: [" * 5_000 + "x" + "]}" * 5_000)),
    "many keys": as_vehicle(text("\n".join(f"key_{i}: 1" for i in range(45_000)))),
    "one long key": as_vehicle(text("k" * 900_000 + ": 1")),
    "python object": as_vehicle(text('!!python/object/apply:os.system ["touch ran"]')),
    **{
        f"tag {tag} of {value!r}": as_vehicle(vehicle(mass_kg=f"!!{tag} {value}"))
        for tag, value in (
            ("bool", "foo"),
            ("int", '""'),
            ("float", '""'),
            ("int", '"_"'),
            ("timestamp", "foo"),
            ("binary", "x"),
            ("set", "{a, b}"),
        )
    },
    "5,000 digits": as_vehicle(vehicle(mass_kg="9" * 5_000)),
    "sexagesimal": as_vehicle(vehicle(mass_kg=":".join(["59"] * 50_000))),
    "mass 1e308": as_vehicle(vehicle(mass_kg="1e308")),
    "mass 5e-324": as_vehicle(vehicle(mass_kg="5e-324")),
    "mass .nan": as_vehicle(vehicle(mass_kg=".nan")),
    "half a surrogate pair": as_vehicle(vehicle(name='"a\\ud800"')),
    "escape codes in a name": as_vehicle(vehicle(name='"\\e[2J"')),
    "not UTF-8": as_vehicle(text(b"name: \xff\xfe\xfa")),
    "zeros": as_vehicle(text(bytes(900_000))),
    "a secret by its path": in_place_of(
        "roads/*.yaml", text("root:secret:0:0::/root:/bin/sh\nalso secret\n")
    ),
    "code in a sweep": as_sweep(sweep(estimators=["DIFE", "os:abort"])),
    "sweep without end": as_sweep(sweep(runs=10**9)),
    # resumed sweeps
    "part is nested": part(DEEP),
    "part is empty": part(b'{"cpu_s": 1.0, "rows": []}'),
    "part is a pipe": part(None),
    "part of another number": part(b"{}", "9999999.json"),
    # logs
    "a million columns": as_log("log.csv", wide(1_000_000)),
    "one row of 100 MB": as_log("log.csv", lambda path: path.write_bytes(b"," * 100_000_000)),
    "quote without end": as_log("log.csv", text('time_s,"' + "a\n" * 2_000_000)),
    "escape codes in a column": as_log("log.csv", renamed("\x1b[31mspeed\x1b]0;x\x07")),
    "a column's name of 100 kB": as_log("log.csv", renamed("v" * 100_000)),
    "Parquet of 5 GB": as_log("log.parquet", long_parquet),
    "Parquet of one long word": as_log("log.parquet", wordy_parquet),
    "Parquet cut": as_log("log.parquet", text(b"PAR1" + b"\xff" * 1_000)),
    "formula runs a command": as_log("log.mf4", mdf(NESTED)),
    "formula of Python": as_log("log.mf4", mdf(QUOTED)),
    "formula's power": as_log("log.mf4", mdf("X1 * 0 + 9**9**9**9**9**9")),
    "formula nested": as_log("log.mf4", mdf("(" * 400 + "X1" + ")" * 400)),
    "MDF of zeros": as_log("log.mf4", text(b"MDF     4.10    " + bytes(100_000))),
    # pictures
    "4,000 scans": as_picture("a.jpg", scans(4_000)),
    "half a JPEG": as_picture("a.jpg", half_jpeg()),
    "half a progressive JPEG": as_picture("a.jpg", half_jpeg(cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
    "half a JPEG with restarts": as_picture("a.jpg", half_jpeg(cv2.IMWRITE_JPEG_RST_INTERVAL, 1)),
    "PNG of 4 gigapixels": as_picture("a.png", png(65_500, 65_500)),
    "PNG that unfolds": as_picture(
        "a.png", png(5_000, 6_000, zlib.compress(bytes(6_000 * (1 + 3 * 5_000)), 9))
    ),
    "JPEG without an end": as_picture("a.jpg", text(b"\xff\xd8" + b"\xff\xe0\x00\x02" * 200_000)),
    "video is a list of files": as_video(text("ffconcat version 1.0\nfile /etc/passwd\n")),
    "video is an address": as_video(text("#EXTM3U\n#EXTINF:9,\nhttp://127.0.0.1:9/a.ts\n")),
    # units
    "unit leaves its folder": as_unit(archive(("../../ran", b"x"))),
    "unit with a link": as_unit(link_out),
    "unit of a million entries": as_unit(archive(*((f"e{i}", b"") for i in range(50_000)))),
    "unit that unfolds": as_unit(packed_zeros),
    "unit's description unfolds": as_unit(archive(("modelDescription.xml", BOMB))),
    "unit's description reads files": as_unit(archive(("modelDescription.xml", FILE_ENTITY))),
    "examined unit unfolds": examined(packed_zeros),
    "examined unit's description unfolds": examined(archive(("modelDescription.xml", BOMB))),
    # buses
    "DBC of rubbish": on_the_rig("--dbc", "bus.dbc", make=text(os.urandom(200_000))),
    "DBC nested": on_the_rig(
        "--dbc", "bus.dbc", make=text("BO_ 1 M: 8 X\n" + ' SG_ S m0M : 0|8@1+ (1,0) [0|0] "" X\n' * 20_000)
    ),
}
"""What a command refuses: exit code 2, one line."""

READ: dict[str, Make] = {
    "markup and mathematics in names": as_log(
        "[bold]$x<i>.csv", lambda path: make_frame().to_csv(path, index=False)
    ),
    "a file name that is a formula": as_picture(
        "=cmd|A0.png", lambda path: cv2.imwrite(str(path), road_picture(640, 480))
    ),
    "a record that asks for modules": examined(shadowing),
    "a formula in a log": as_log("log.mf4", mdf("1.0 * X1 ^ 1 + 0 * sin(X1)")),
}
"""What a command reads and lives with."""


@pytest.fixture(scope="module")
def command() -> Iterator[Callable[[Arguments, Path], dict[str, Any]]]:
    """Runs a command in a folder, in a fork of a process that has everything loaded."""
    host = subprocess.Popen(
        [sys.executable, str(ROOT / "tests" / "support" / "hostile_host.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200"},
    )
    assert host.stdin is not None
    assert host.stdout is not None

    def run(arguments: Arguments, folder: Path) -> dict[str, Any]:
        print(json.dumps({"arguments": arguments, "folder": str(folder)}), file=host.stdin, flush=True)
        return json.loads(host.stdout.readline())

    yield run
    host.stdin.close()
    host.wait(timeout=60)


SLOW = (
    "examined unit unfolds",
    "unit of a million entries",
    "part is nested",
    "part of another number",
    "part is empty",
    "DBC nested",
    "Parquet of 5 GB",
)
"""Kinds that take many seconds and have a neighbour of the same reader in the list."""


def made(make: Make, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Arguments:
    monkeypatch.chdir(folder)  # a socket's address must be short
    return make(folder)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=long) if name in SLOW else name for name in REFUSED]
)
def test_is_refused_in_a_line(
    name: str, command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = command(made(REFUSED[name], tmp_path, monkeypatch), tmp_path)
    assert told["exit"] == 2, told
    assert told["seconds"] < MOST_S
    assert told["megabytes"] < MOST_MB
    # libjpeg has its own word for a JPEG that ends early.
    lines = [line for line in told["err"].splitlines() if not line.startswith("Corrupt JPEG data")]
    assert len(lines) == 1, told["err"]
    assert len(lines[0]) < LONGEST
    assert lines[0].isprintable()
    assert "secret" not in told["err"]
    assert not (tmp_path / "ran").exists()
    assert not list(tmp_path.glob("out/*.html"))


@pytest.mark.parametrize("name", READ)
def test_is_read_harmlessly(name: str, command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = command(made(READ[name], tmp_path, monkeypatch), tmp_path)
    assert told["exit"] in (0, 1), told
    assert told["megabytes"] < MOST_MB
    assert "Traceback" not in told["err"]
    assert not (tmp_path / "ran").exists()
    for report in tmp_path.glob("out/report.html"):
        assert "<i>" not in report.read_text()
    if (tmp_path / "classes.csv").exists():
        assert pd.read_csv(tmp_path / "classes.csv")["file"].tolist() == ["./=cmd|A0.png"]
