"""Pictures in every form that the units take, through fmpy: what is the same, and what is refused unread."""

from __future__ import annotations

import ctypes
import re
import struct
import subprocess
import sys
import textwrap
import zlib
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from fmu_unit import DRIVING, Unit
from picture_memory import pointing_to
from road_picture import road_picture

from trpac_core.vision.images import decode_image

pytestmark = pytest.mark.e2e

Open = Callable[..., Unit]
WARNING = 1
WHEELS = ("fl", "fr", "rl", "rr")
DRIVING_4W = {"vehicle_speed": DRIVING["vehicle_speed"]} | {
    f"{name}.{wheel}": DRIVING[name] for name in ("wheel_speed", "wheel_torque") for wheel in WHEELS
}


def scene(seed: int = 1, grey: bool = False) -> np.ndarray:
    """A road below a bright sky, half the default camera's size, 8-bit BGR."""
    return road_picture(960, 600, seed=seed, colour=not grey)


def encoded(suffix: str, image: np.ndarray) -> bytes:
    done, data = cv2.imencode(suffix, image)
    assert done
    return data.tobytes()


PICTURES = {
    "colour.png": encoded(".png", scene()),
    "colour.jpg": encoded(".jpg", scene()),
    "grey.png": encoded(".png", scene(grey=True)[:, :, 0]),
    "grey.jpg": encoded(".jpg", scene(grey=True)[:, :, 0]),
    "sixteen_bit.png": encoded(".png", scene().astype(np.uint16) * 257),
    "a_png_named.jpg": encoded(".png", scene()),
}


class Memory:
    """Bytes at an address that stays, and the inputs that point there."""

    def __init__(self, content: bytes) -> None:
        self.buffer = ctypes.create_string_buffer(content, len(content))
        self.inputs = pointing_to(ctypes.addressof(self.buffer), len(content))

    def overwrite(self, content: bytes) -> None:
        assert len(content) <= len(self.buffer)
        ctypes.memmove(self.buffer, content, len(content))


def raw(image: np.ndarray) -> tuple[Memory, dict[str, int]]:
    memory = Memory(image.tobytes())
    return memory, {**memory.inputs, "image_width": image.shape[1], "image_height": image.shape[0]}


def trace(unit: Unit, driving: dict[str, float], picture: dict[str, object]) -> list[dict[str, float | bool]]:
    """Outputs while the picture's road comes under the wheel."""
    unit.step({**driving, **picture})
    seen = []
    for _ in range(6):
        unit.step(count=50)
        seen.append(unit.outputs())
    return seen


@pytest.mark.parametrize("name", PICTURES)
def test_path_encoded_buffer_and_raw_buffer_give_the_same_result(
    open_unit: Open, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(PICTURES[name])
    in_memory = Memory(PICTURES[name])
    kept, pixels = raw(decode_image(path))
    by_path, by_buffer, by_pixels = (
        trace(unit, DRIVING, picture)
        for unit, picture in (
            (open_unit(), {"image_path": str(path)}),
            (open_unit(), in_memory.inputs),
            (open_unit(), pixels),
        )
    )
    assert by_path == by_buffer == by_pixels
    assert by_path[-1]["image_confidence"] > 0.0, "the picture has been used"
    assert len(kept.buffer) == 3 * 960 * 600


def test_the_same_holds_for_four_wheels(open_4w: Open, tmp_path: Path) -> None:
    path = tmp_path / "colour.jpg"
    path.write_bytes(PICTURES["colour.jpg"])
    in_memory = Memory(PICTURES["colour.jpg"])
    kept, pixels = raw(decode_image(path))
    traces = [
        trace(open_4w(), DRIVING_4W, picture)
        for picture in ({"image_path": str(path)}, in_memory.inputs, pixels)
    ]
    assert traces[0] == traces[1] == traces[2]
    assert traces[0][-1]["image_confidence.fl"] > 0.0
    del kept


@pytest.mark.parametrize("numbered", [False, True])
def test_another_picture_at_the_same_address_is_seen(open_unit: Open, numbered: bool) -> None:
    first, second = scene(1), scene(2)
    unit, alike, other = open_unit(), open_unit(), open_unit()
    memory, inputs = raw(first)
    for one in (unit, alike):
        one.step({**DRIVING, **inputs, "frame_id": int(numbered)}, count=200)
    unchanged = trace(alike, DRIVING, {**inputs, "frame_id": 2 * int(numbered)})
    memory.overwrite(second.tobytes())
    changed = trace(unit, DRIVING, {**inputs, "frame_id": 2 * int(numbered)})
    assert changed != unchanged
    kept, elsewhere = raw(first)
    other.step({**DRIVING, **elsewhere, "frame_id": int(numbered)}, count=200)
    kept.overwrite(b"\0" * len(kept.buffer))
    moved, there = raw(second)
    assert trace(other, DRIVING, {**there, "frame_id": 2 * int(numbered)}) == changed
    del moved


def test_an_unchanged_number_is_no_new_frame_whatever_lies_there_now(open_unit: Open) -> None:
    unit, alike = open_unit(), open_unit()
    memory, inputs = raw(scene(1))
    for one in (unit, alike):
        one.step({**DRIVING, **inputs, "frame_id": 1}, count=200)
    unchanged = trace(alike, DRIVING, {})
    memory.overwrite(b"\0" * len(memory.buffer))
    assert trace(unit, DRIVING, {**inputs, "frame_id": 1}) == unchanged


def png_of(width: int, height: int) -> bytes:
    """A small file that says it is a picture of this size."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


UNUSABLE = {
    "text": b"no picture at all",
    "cut.png": PICTURES["colour.png"][:20_000],
    "cut.jpg": PICTURES["colour.jpg"][:20_000],
    "flipped.png": PICTURES["colour.png"][:5000] + b"\xff" + PICTURES["colour.png"][5001:],
    "huge.png": png_of(100_000, 100_000),
    "one_pixel.png": encoded(".png", np.zeros((1, 1, 3), np.uint8)),
    "another_shape.png": encoded(".png", np.zeros((400, 400, 3), np.uint8)),
    "gif": b"GIF89a" + bytes(100),
}


@pytest.mark.parametrize("name", UNUSABLE)
@pytest.mark.parametrize("form", ["path", "buffer"])
def test_what_is_no_picture_lowers_the_flag_with_one_warning_and_a_good_one_lifts_it(
    open_unit: Open, tmp_path: Path, name: str, form: str
) -> None:
    by_bus = {"road_class": 2, "road_class_confidence": 0.9}
    unit, memory = open_unit(), Memory(UNUSABLE[name])
    unit.step({**DRIVING, **by_bus}, count=250)
    assert unit.get("flag")
    (tmp_path / name).write_bytes(UNUSABLE[name])
    bad = {"image_path": str(tmp_path / name)} if form == "path" else memory.inputs
    unit.step({"road_class": -1, **bad}, count=5)
    assert not unit.get("flag")
    assert [line.status for line in unit.log] == [WARNING]
    unit.step(by_bus)
    assert unit.get("flag")


UNREADABLE = 4096
"""An address that no process may read: who follows it without asking the system dies."""
REFUSED_UNREAD = {
    "negative size": {"image.size": -1},
    "least size": {"image.size": -(2**31)},
    "size beyond the limit": {"image.size": 3 * 64_000_000 + 1},
    "greatest size": {"image.size": 2**31 - 1},
    "size of another picture": {"image.size": 100, "image_width": 960, "image_height": 600},
    "a byte too many": {"image.size": 3 * 960 * 600 + 1, "image_width": 960, "image_height": 600},
    "a byte short": {"image.size": 3 * 960 * 600 - 1, "image_width": 960, "image_height": 600},
    "two negative sides": {"image.size": 3 * 960 * 600, "image_width": -960, "image_height": -600},
    "a negative side": {"image.size": 3 * 960 * 600, "image_width": 960, "image_height": -600},
    "width alone": {"image.size": 3 * 960, "image_width": 960},
    "one pixel": {"image.size": 3, "image_width": 1, "image_height": 1},
    "a narrow strip": {"image.size": 3 * 63 * 600, "image_width": 63, "image_height": 600},
    "too many pixels": {"image.size": 3, "image_width": 2**31 - 1, "image_height": 2**31 - 1},
    "address alone": {"image.size": 0},
    "size alone": {"image.base.lo": 0, "image.size": 1000},
}
SUPPORT = Path(__file__).parents[1] / "support"
HARMLESS = ("address alone", "size alone")
CHILD = """
import os, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from picture_memory import pointing_to
from fmu_unit import DRIVING, Unit
unit = Unit(Path(sys.argv[1]))
unit.set(PARAMETERS)
unit.initialise()
unit.step({**DRIVING, "image.base.lo": ADDRESS, **INPUTS})
print(unit.get("TRPAC"), "|", *(line.text for line in unit.log), sep="")
sys.stdout.flush()
os._exit(0)
"""


def in_child(folder: Path, inputs: dict[str, int], **parameters: object) -> subprocess.CompletedProcess[str]:
    """One step with these inputs, in a process that may die."""
    code = textwrap.dedent(CHILD).replace("PARAMETERS", repr(parameters)).replace("INPUTS", repr(inputs))
    command = [sys.executable, "-c", code.replace("ADDRESS", str(UNREADABLE)), folder, SUPPORT]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def test_sizes_that_cannot_be_are_refused_before_the_address_is_followed(unit_folder: Path) -> None:
    cases = [{"image.base.lo": UNREADABLE, **inputs} for inputs in REFUSED_UNREAD.values()]
    code = textwrap.dedent(CHILD).split("unit = ")[0] + textwrap.dedent(
        f"""
        for inputs in {cases!r}:
            unit = Unit(Path(sys.argv[1]))
            unit.initialise()
            unit.step({{**DRIVING, **inputs}})
            print(*(line.text for line in unit.log))
        sys.stdout.flush()
        os._exit(0)
        """
    )
    done = subprocess.run(
        [sys.executable, "-c", code, unit_folder, SUPPORT],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    said = dict(zip(REFUSED_UNREAD, done.stdout.splitlines(), strict=True))
    for case, text in said.items():
        assert (text == "") == (case in HARMLESS), case
        assert text == "" or "image" in text, case
    assert "expected at least 64 on each side" in said["one pixel"]
    assert "expected 1728000" in said["a byte too many"]


def test_an_address_that_would_kill_who_follows_it_is_a_warning(unit_folder: Path) -> None:
    command = [sys.executable, "-c", f"import ctypes; ctypes.string_at({UNREADABLE}, 1000)"]
    assert subprocess.run(command, capture_output=True, check=False, timeout=60).returncode < 0
    done = in_child(unit_folder, {"image.size": 1000})
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("cannot be read") == 1


def test_with_buffers_off_no_address_is_followed_and_the_log_says_so_once(unit_folder: Path) -> None:
    done = in_child(unit_folder, {"image.size": 1000}, **{"image.buffers_enabled": False})
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("image.buffers_enabled is false") == 1


def test_with_buffers_off_paths_count_as_before(open_unit: Open, tmp_path: Path) -> None:
    path = tmp_path / "colour.jpg"
    path.write_bytes(PICTURES["colour.jpg"])
    memory = Memory(encoded(".png", scene(2)))
    plain, closed = open_unit(), open_unit(image__buffers_enabled=False)
    expected = trace(plain, DRIVING, {"image_path": str(path)})
    assert trace(closed, DRIVING, {"image_path": str(path), **memory.inputs}) == expected
    closed.step(memory.inputs)
    assert [line.status for line in closed.log] == [WARNING]


def test_the_description_tells_of_wrong_addresses(unit_folder: Path) -> None:
    unit = Unit(unit_folder)
    for part in ("base.lo", "base.hi", "size"):
        assert "An address that cannot be read gives a warning" in unit.variables[f"image.{part}"].description
    unit.free()


MIME_TYPE = r"[A-Za-z0-9][A-Za-z0-9!#$&^_.+-]*/[A-Za-z0-9][A-Za-z0-9!#$&^_.+-]*"
"""Type and subtype as RFC 6838 allows them."""


@pytest.mark.parametrize("folder", ["unit_folder", "unit_folder_4w"])
def test_the_annotations_keep_the_rules_of_the_sensor_model_packaging(
    request: pytest.FixtureRequest, folder: str
) -> None:
    root = ElementTree.parse(request.getfixturevalue(folder) / "modelDescription.xml").getroot()
    osmp = "{http://xsd.pmsf.net/OSISensorModelPackaging}"
    scalars = {scalar.attrib["name"]: scalar for scalar in root.iter("ScalarVariable")}
    parts = [scalars[f"image.{role}"] for role in ("base.lo", "base.hi", "size")]
    annotations = [
        part.find(f"Annotations/Tool[@name='net.pmsf.osmp']/{osmp}osmp-binary-variable") for part in parts
    ]
    assert "image" not in scalars, "no other variable may have the binary variable's name"
    assert [a.attrib["role"] for a in annotations] == ["base.lo", "base.hi", "size"]
    assert {a.attrib["name"] for a in annotations} == {"image"}
    (mime_type,) = {a.attrib["mime-type"] for a in annotations}
    assert re.fullmatch(MIME_TYPE, mime_type)
    assert {(part.attrib["causality"], part.attrib["variability"]) for part in parts} == {
        ("input", "discrete")
    }
    assert [part.find("Integer").attrib["start"] for part in parts] == ["0", "0", "0"]
