"""Encoded pictures to BGR arrays, with one clear error for each way in which a picture can be unusable."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.errors import TrpacError
from trpac_core.files import FileError, quoted, read_bytes

LEAST_SIDE_PX = 64
MOST_PIXELS = 64_000_000
"""Larger pictures are refused before they are decoded: 64 megapixels."""
MOST_FILE_BYTES = 3 * MOST_PIXELS
"""Larger files are refused unread: no picture needs more than its pixels do [bytes]."""
MOST_SCANNED_PIXELS = 1_000_000_000
"""Pixels of a JPEG times its scans, each of which is a pass over all of them: 15 passes over the largest picture."""

RAW_BITS = 12
"""Bits of a camera's raw values, which it writes into 16."""

_JPEG_START = b"\xff\xd8\xff"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_SCAN, _JPEG_RESTARTS, _JPEG_END = 0xDA, 0xDD, b"\xff\xd9"
_JPEG_MARKER = re.compile(b"\xff[^\x00\xd0-\xd7\xff]")
"""Within a scan FF is followed by 00 or a restart marker; whatever else follows ends it."""
_JPEG_RESTART = re.compile(b"\xff[\xd0-\xd7]")
_JPEG_MORE = bytes(range(1, 255))
"""What a scan that was cut off would go on to decode."""
_JPEG_UNDECODED = 128
"""Value of each channel where the decoder had no data."""


class ImageError(TrpacError):
    """A picture that cannot be used; the text names it and what was expected."""


def decode_image(
    source: str | Path | bytes | bytearray | memoryview,
    name: str = "image",
    *,
    upright: bool = False,
    bits: int | None = None,
) -> NDArray[np.uint8]:
    """Read a JPEG or PNG as 8-bit BGR.

    Grey pictures get three equal channels, those of 16 bits the upper 8 of what is used, and an alpha channel is
    dropped.

    Parameters
    ----------
    source : path or bytes
        A file, or the content of one.
    name : str
        What error messages call a source given as bytes.
    upright : bool
        Whether a turn noted in the file's EXIF data is applied, as a viewer does; not by default, since a camera
        file describes the pixels as they are stored.
    bits : int, optional
        How many bits a file of 16 uses, see `eight_bits`.

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
        name = quoted(source)
        try:
            data = read_bytes(source, MOST_FILE_BYTES, "a JPEG or PNG picture")
        except FileError as error:
            raise ImageError(str(error)) from error
    else:
        data = bytes(source)
    if not data:
        raise ImageError(f"{name}: empty. Expected a JPEG or PNG picture.")
    if data.startswith(_JPEG_START):
        image = _jpeg(data, name)
    elif data.startswith(_PNG_START):
        width, height = _check_png(data, name)
        check_size(width, height, name)
        image = _decoded(data, name, bits=bits)
    else:
        raise ImageError(
            f"{name}: neither JPEG nor PNG (starts with {data[:8].hex(' ')}). Convert the picture."
        )
    turned = upright and (b"Exif\0" in data or b"eXIf" in data)
    return _decoded(data, name, cv2.IMREAD_COLOR_BGR, bits) if turned else image


def eight_bits(image: NDArray[np.generic], name: str = "image", bits: int | None = None) -> NDArray[np.uint8]:
    """A picture's values as 8 bits, shape as given.

    Parameters
    ----------
    image : array of uint8, uint16 or float
        Floats lie within 0 and 1.
    name : str
        What error messages call it.
    bits : int, optional
        How many of 16 bits are used, 8 to 16. By default 12 where all values are below 4096, as cameras of 12 bits
        write them, else 16; state 16 for a picture of 16 bits that is nearly black.

    Raises
    ------
    ImageError
        If the values are of another type or range.
    """
    if bits is not None and bits not in range(8, 17):
        raise ImageError(f"{name}: bits is {bits!r}; expected 8 to 16.")
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    if image.dtype.newbyteorder("=") == np.uint16:
        most = int(image.max(initial=0))
        used = int(bits or 0) or (RAW_BITS if most < 1 << RAW_BITS else 16)
        if most >= 1 << used:
            raise ImageError(f"{name}: a value of {most}; expected less than {1 << used} with {used} bits.")
        return (image.astype(np.uint16, copy=False) >> (used - 8)).astype(np.uint8)
    if np.issubdtype(image.dtype, np.floating):
        shares = image.astype(np.float64, copy=False)
        if not ((shares >= 0.0) & (shares <= 1.0)).all():
            raise ImageError(
                f"{name}: floats beyond 0 to 1, or NaN; expected shares of white. Divide by the greatest value."
            )
        return np.rint(shares * 255.0).astype(np.uint8)
    raise ImageError(f"{name}: values of {image.dtype}; expected uint8, uint16, or floats from 0 to 1.")


def _decoded(
    data: bytes,
    name: str,
    how: int = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_IGNORE_ORIENTATION,
    bits: int | None = None,
) -> NDArray[np.uint8]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how | cv2.IMREAD_ANYDEPTH)
    except cv2.error as error:
        raise ImageError(f"{name}: damaged; the picture cannot be decoded ({error.err}).") from error
    if image is None:
        raise ImageError(f"{name}: damaged; the picture cannot be decoded. Copy or record it again.")
    return eight_bits(image, name, bits)


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


def check_size(width: int, height: int, name: str) -> None:
    """Raise ImageError if a picture of this size [px] is refused, whatever it shows."""
    if min(width, height) < LEAST_SIDE_PX or width * height > MOST_PIXELS:
        raise ImageError(
            f"{name}: {width} x {height} pixels; expected at least {LEAST_SIDE_PX} on each side and at most "
            f"{MOST_PIXELS // 1_000_000} megapixels."
        )


def _cut_short(name: str) -> ImageError:
    return ImageError(f"{name}: cut short; the end of the picture is missing. Copy or record it again.")


def _jpeg(data: bytes, name: str) -> NDArray[np.uint8]:
    """The picture of a JPEG that is whole and of a bounded size; raises ImageError."""
    at, frame, scans, interval = 2, None, 0, 0
    while True:
        while data[at : at + 2] == b"\xff\xff":
            at += 1
        if data[at : at + 2] == _JPEG_END:
            break
        if at + 4 > len(data):
            raise _cut_short(name)
        if data[at] != 0xFF:
            raise ImageError(f"{name}: damaged JPEG, no marker at byte {at}. Copy or record it again.")
        marker, (length,) = data[at + 1], struct.unpack_from(">H", data, at + 2)
        header = data[at + 4 : at + 2 + length]
        at += 2 + length
        if marker in _JPEG_FRAMES:
            frame = _JpegFrame.of(header, name)
            check_size(frame.width, frame.height, name)
        elif marker == _JPEG_RESTARTS and len(header) == 2:
            (interval,) = struct.unpack(">H", header)
        elif marker == _JPEG_SCAN:
            following = _JPEG_MARKER.search(data, at)
            if following is None:
                raise _cut_short(name)
            if frame is None or not header:
                raise ImageError(f"{name}: damaged JPEG without a frame header. Copy or record it again.")
            scans += 1
            if scans * frame.width * frame.height > MOST_SCANNED_PIXELS:
                raise ImageError(
                    f"{name}: a JPEG of {frame.width} x {frame.height} pixels in {scans} scans or more; expected at "
                    f"most {MOST_SCANNED_PIXELS // (frame.width * frame.height)}. Save it anew."
                )
            began, at = at, following.start()
            restarts = (frame.units(header[1 : 1 + 2 * header[0] : 2]) - 1) // interval if interval else 0
            if len(_JPEG_RESTART.findall(data, began, at)) < restarts:
                raise _cut_short(name)
    if not scans:
        raise ImageError(f"{name}: damaged JPEG without a picture. Copy or record it again.")
    image = _decoded(data, name)
    # Bytes that follow a whole scan are passed over; one that was cut off before the end marker goes on with them.
    # Where the data of a single scan end early, the last pixel was never decoded.
    doubtful = scans > 1 or bool((image[-1, -1] == _JPEG_UNDECODED).all())
    if doubtful and not np.array_equal(_decoded(data[:at] + _JPEG_MORE + data[at:], name), image):
        raise _cut_short(name)
    return image


@dataclass(frozen=True)
class _JpegFrame:
    """Size of a JPEG [px], and how many blocks of 8 x 8 each component has in a unit of all: across and down."""

    width: int
    height: int
    sampling: dict[int, tuple[int, int]]

    @classmethod
    def of(cls, header: bytes, name: str) -> _JpegFrame:
        """From the content of a frame header; raises ImageError where that is cut short."""
        if len(header) < 6 or len(header) < 6 + 3 * header[5]:
            raise _cut_short(name)
        height, width = struct.unpack_from(">HH", header, 1)
        parts = [header[at : at + 2] for at in range(6, 6 + 3 * header[5], 3)]
        return cls(width, height, {part[0]: (part[1] >> 4 or 1, part[1] & 15 or 1) for part in parts})

    def units(self, components: bytes) -> int:
        """Units that a scan of these components has: of all blocks of a place, or blocks of one component alone."""
        across, down = (max((s[i] for s in self.sampling.values()), default=1) for i in (0, 1))
        if len(components) == 1:
            own = self.sampling.get(components[0], (across, down))
            columns, rows = -(-self.width * own[0] // across), -(-self.height * own[1] // down)
            return -(-columns // 8) * -(-rows // 8)
        return -(-self.width // (8 * across)) * -(-self.height // (8 * down))


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
        if size is None:
            if kind != b"IHDR" or length != 13:
                raise ImageError(
                    f"{name}: damaged PNG that does not begin with a header. Copy or record it again."
                )
            size = struct.unpack_from(">II", data, at + 8)
        if kind == b"IEND":
            return size[0], size[1]
        at = end
