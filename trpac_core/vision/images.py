"""Encoded pictures to BGR arrays, with one clear error for each way in which a picture can be unusable."""

from __future__ import annotations

import stat
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_SIDE_PX = 64
MOST_PIXELS = 64_000_000
"""Larger pictures are refused before they are decoded: 64 megapixels."""
MOST_FILE_BYTES = 3 * MOST_PIXELS
"""Larger files are refused unread: no picture needs more than its pixels do [bytes]."""

_JPEG_START = b"\xff\xd8\xff"
_JPEG_END = b"\xff\xd9"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_SCAN = 0xDA


class ImageError(ValueError):
    """A picture that cannot be used; the text names it and what was expected."""


def decode_image(
    source: str | Path | bytes | bytearray | memoryview, name: str = "image"
) -> NDArray[np.uint8]:
    """Read a JPEG or PNG as 8-bit BGR.

    Grey pictures get three equal channels, 16-bit ones their upper 8 bits, and an alpha channel is dropped. A
    turn noted in the file's EXIF data is not applied: the camera file describes the pixels as they are
    stored.

    Parameters
    ----------
    source : path or bytes
        A file, or the content of one.
    name : str
        What error messages call a source given as bytes.

    Returns
    -------
    array of uint8, shape (height, width, 3)
        The picture, BGR.

    Raises
    ------
    ImageError
        If the file is missing, empty, cut short, damaged, of another format, or outside the limits on size.
    """
    if isinstance(source, (str, Path)):
        name = str(source)
        data = _read(Path(source))
    else:
        data = bytes(source)
    if not data:
        raise ImageError(f"{name}: empty. Expected a JPEG or PNG picture.")
    if data.startswith(_JPEG_START):
        width, height = _check_jpeg(data, name)
    elif data.startswith(_PNG_START):
        width, height = _check_png(data, name)
    else:
        raise ImageError(
            f"{name}: neither JPEG nor PNG (starts with {data[:8].hex(' ')}). Convert the picture."
        )
    check_size(width, height, name)
    how = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how)
    except cv2.error as error:
        raise ImageError(f"{name}: damaged; the picture cannot be decoded ({error.err}).") from error
    if image is None:
        raise ImageError(f"{name}: damaged; the picture cannot be decoded. Copy or record it again.")
    return image.astype(np.uint8, copy=False)


def raw_bgr_image(
    data: bytes | bytearray | memoryview, width_px: int, height_px: int, name: str = "image buffer"
) -> NDArray[np.uint8]:
    """A buffer of 8-bit BGR as a picture of shape (height, width, 3), not copied; raises ImageError."""
    check_size(width_px, height_px, name)
    expected = width_px * height_px * 3
    if len(data) != expected:
        raise ImageError(
            f"{name}: {len(data)} bytes; expected {expected} for {width_px} x {height_px} of 8-bit BGR."
        )
    return np.frombuffer(data, np.uint8).reshape(height_px, width_px, 3)


def _read(path: Path) -> bytes:
    try:
        there = path.stat()
        regular = stat.S_ISREG(there.st_mode)
        data = path.read_bytes() if regular and there.st_size <= MOST_FILE_BYTES else b""
    except FileNotFoundError:
        raise ImageError(f"{path}: no such file. Expected a JPEG or PNG picture; correct the path.") from None
    except (OSError, ValueError) as error:
        raise ImageError(f"{path}: cannot be read ({error}). Expected a JPEG or PNG picture.") from error
    if not regular:
        raise ImageError(f"{path}: cannot be read (no file of its own). Expected a JPEG or PNG picture.")
    if there.st_size > MOST_FILE_BYTES:
        raise ImageError(
            f"{path}: {there.st_size / 1e6:.0f} MB; expected a JPEG or PNG picture of at most "
            f"{MOST_FILE_BYTES / 1e6:.0f} MB."
        )
    return data


def check_size(width: int, height: int, name: str) -> None:
    """Raise ImageError if a picture of this size [px] is refused, whatever it shows."""
    if min(width, height) < LEAST_SIDE_PX or width * height > MOST_PIXELS:
        raise ImageError(
            f"{name}: {width} x {height} pixels; expected at least {LEAST_SIDE_PX} on each side and at most "
            f"{MOST_PIXELS // 1_000_000} megapixels."
        )


def _cut_short(name: str) -> ImageError:
    return ImageError(f"{name}: cut short; the end of the picture is missing. Copy or record it again.")


def _check_jpeg(data: bytes, name: str) -> tuple[int, int]:
    """Width and height of a JPEG whose end is there; raises ImageError."""
    at, size = 2, None
    while True:
        while data[at : at + 2] == b"\xff\xff":
            at += 1
        if at + 4 > len(data):
            raise _cut_short(name)
        if data[at] != 0xFF:
            raise ImageError(f"{name}: damaged JPEG, no marker at byte {at}. Copy or record it again.")
        marker, (length,) = data[at + 1], struct.unpack_from(">H", data, at + 2)
        if marker in _JPEG_FRAMES:
            if at + 9 > len(data):
                raise _cut_short(name)
            height, width = struct.unpack_from(">HH", data, at + 5)
            size = width, height
        at += 2 + length
        if marker == _JPEG_SCAN:
            break
    # Within a scan FF is followed by 00 or a restart marker, so that FF D9 can only be the picture's end.
    if data.find(_JPEG_END, at) < 0:
        raise _cut_short(name)
    if size is None:
        raise ImageError(f"{name}: damaged JPEG without a frame header. Copy or record it again.")
    return size


def _check_png(data: bytes, name: str) -> tuple[int, int]:
    """Width and height of a PNG whose chunks are whole; raises ImageError."""
    at, size = len(_PNG_START), None
    while True:
        if at + 12 > len(data):
            raise _cut_short(name)
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 12 + length
        if end > len(data):
            raise _cut_short(name)
        if zlib.crc32(data[at + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise ImageError(f"{name}: damaged PNG, wrong checksum of the chunk at byte {at}. Copy it again.")
        if kind == b"IHDR" and length == 13:
            size = struct.unpack_from(">II", data, at + 8)
        if kind == b"IEND":
            break
        at = end
    if size is None:
        raise ImageError(f"{name}: damaged PNG without a header. Copy or record it again.")
    return size[0], size[1]
