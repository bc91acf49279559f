"""Which camera frame is new, and what a motion is made of, without a unit around them."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest

from fmu_src import frames
from fmu_src.frames import BUFFER, FrameState, _picture_in_memory, next_frame
from sim2real.replay.camera import _motion
from trpac_core.vehicle import Vehicle
from trpac_core.vision.images import MOST_FILE_BYTES, ImageError, decode_image

NOTHING = {"frame_id": 0, "image_path": "", "image.size": 0, "image.base.lo": 0, "image.base.hi": 0}
NOTHING |= {frames.BUFFERS_ENABLED: True}
IN_MEMORY = {"image.size": 10, "image.base.lo": 1}


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.full((80, 120, 3), 90, np.uint8))
    return path


@pytest.fixture(autouse=True)
def _no_addresses_followed(monkeypatch):
    monkeypatch.setattr(frames, "_picture_in_memory", lambda values: np.zeros((80, 120, 3), np.uint8))


def taken(steps):
    """Source of each step's new frame, None where there was none."""
    seen, sources = FrameState(), []
    for step in steps:
        seen, frame, problem = next_frame(seen, NOTHING | step, ())
        assert problem is None
        sources.append(None if frame is None else seen.source)
    return sources


@pytest.mark.parametrize("numbered", [False, True])
def test_a_path_that_stays_set_is_no_new_frame_after_a_picture_in_memory(picture, numbered):
    held = {"image_path": str(picture)}
    steps = [held]
    for number in range(1, 4):
        named = held | {"frame_id": number if numbered else 0}
        steps += [named | IN_MEMORY, named]
    assert taken(steps) == [str(picture), *[BUFFER, None] * 3]


def test_a_path_is_a_new_frame_with_a_new_number_or_after_none(picture):
    held = {"image_path": str(picture)}
    assert taken([held, held, held | {"frame_id": 1}, {"frame_id": 1}, held | {"frame_id": 1}]) == [
        str(picture), None, str(picture), None, str(picture),
    ]  # fmt: skip


@pytest.mark.parametrize(
    "address",
    [0x1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x1_00000000, 0x7FFE_80000010, 0x80000000_00000000,
     0xB400_7F12_3456_7890, 0xFFFF8000_7FFF0000, 2**64 - 1],
)  # fmt: skip
def test_an_address_is_put_together_of_its_signed_halves_bit_by_bit(monkeypatch, address):
    """An FMI integer has a sign: what the host's address has in its 32nd or its 64th bit comes as a negative half."""
    low, high = struct.unpack("<ii", struct.pack("<Q", address))
    asked = []

    def read(address, size):
        asked.append((address, size))
        return bytearray(size)

    monkeypatch.setattr(frames, "read_memory", read)
    raw = {"image_width": 80, "image_height": 80, "image.size": 3 * 80 * 80}
    _picture_in_memory({**raw, "image.base.lo": low, "image.base.hi": high})
    assert asked == [(address, 3 * 80 * 80)]


@pytest.mark.parametrize(("low", "high"), [(0, 1), (0, -1), (-1, 0), (1, 0)])
def test_half_an_address_is_one(low, high):
    here = {"image.size": 10, "image.base.lo": low, "image.base.hi": high}
    assert taken([here]) == [BUFFER]


def test_what_is_no_file_or_far_too_large_is_refused_unread(tmp_path):
    large = tmp_path / "large.png"
    with large.open("wb") as file:
        file.truncate(MOST_FILE_BYTES + 1)
    with pytest.raises(ImageError, match=r"large\.png: 192.*MB; expected"):
        decode_image(large)
    with pytest.raises(ImageError, match="no regular file"):
        decode_image("/dev/zero")
    with pytest.raises(ImageError, match="a folder"):
        decode_image(tmp_path)


@pytest.mark.parametrize("cog_m", [0.0, 2.305, 3.0, -0.1])
def test_a_centre_of_gravity_outside_the_axles_is_refused(cog_m):
    with pytest.raises(ValueError, match=r"cog_to_rear_axle_m is .*between the axles"):
        Vehicle(cog_to_rear_axle_m=cog_m)


@pytest.mark.parametrize("yaw_rate", [np.nan, 0.2])
def test_a_yaw_rate_that_was_not_measured_is_none(yaw_rate):
    class Row:
        accel_m_s2 = None
        speed_m_s, position_m = np.array([10.0]), np.array([5.0])
        steering_angle_rad, yaw_rate_rad_s = np.array([0.1]), np.array([yaw_rate])

    told = _motion(Row, 0).yaw_rate_rad_s
    assert told is None if np.isnan(yaw_rate) else told == 0.2
