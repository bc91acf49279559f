"""Every way in which a picture file can be good or bad."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.vision.images import ImageError, decode_image, eight_bits, raw_bgr_image

PICTURE = np.random.default_rng(0).integers(0, 256, (80, 128, 3), dtype=np.uint8)


def encoded(kind: str, image=PICTURE, settings=()) -> bytes:
    good, data = cv2.imencode(kind, image, list(settings))
    assert good
    return data.tobytes()


PNG, JPEG = encoded(".png"), encoded(".jpg")


def test_png_is_exact_and_jpeg_close(tmp_path):
    assert (decode_image(PNG) == PICTURE).all()
    smooth = cv2.GaussianBlur(PICTURE, (0, 0), 8)
    assert np.abs(decode_image(encoded(".jpg", smooth)).astype(int) - smooth).max() < 25
    file = tmp_path / "frame ü.png"
    file.write_bytes(PNG)
    assert (decode_image(file) == PICTURE).all()
    assert (decode_image(str(file)) == PICTURE).all()
    assert (decode_image(memoryview(PNG)) == PICTURE).all()


def test_grey_alpha_and_16_bit_become_8_bit_bgr():
    grey = PICTURE[..., 0]
    assert (decode_image(encoded(".png", grey)) == grey[..., None]).all()
    alpha = np.dstack((PICTURE, np.full((80, 128), 7, np.uint8)))
    assert (decode_image(encoded(".png", alpha)) == PICTURE).all()
    deep = decode_image(encoded(".png", PICTURE.astype(np.uint16) * 257))
    assert deep.dtype == np.uint8
    assert np.abs(deep.astype(int) - PICTURE).max() <= 1


@pytest.mark.parametrize("bits", [9, 10, 12, 14, 16])
def test_the_bits_that_a_picture_of_16_uses_may_be_stated(bits):
    raw = PICTURE.astype(np.uint16) << (bits - 8) | (1 << (bits - 8)) - 1
    assert (decode_image(encoded(".png", raw), bits=bits) == PICTURE).all()
    assert (eight_bits(raw, bits=bits) == PICTURE).all()


def test_12_bits_in_16_are_found_by_their_range():
    """As cameras write raw values: their upper 8 bits alone would be a black picture."""
    raw = PICTURE.astype(np.uint16) << 4
    assert (decode_image(encoded(".png", raw)) == PICTURE).all()
    dark = raw.copy()
    dark[0, 0] = 4096
    assert (decode_image(encoded(".png", dark)) == dark >> 8).all()
    assert (decode_image(encoded(".png", raw), bits=16) == raw >> 8).all()


def test_16_bits_of_another_byte_order_are_read():
    raw = PICTURE.astype(np.uint16) << 4
    assert (eight_bits(raw.astype(">u2")) == PICTURE).all()


def test_floats_from_0_to_1_are_scaled():
    assert (eight_bits(PICTURE / 255.0) == PICTURE).all()
    assert (eight_bits((PICTURE / 255.0).astype(np.float32)) == PICTURE).all()


@pytest.mark.parametrize(
    ("image", "bits", "said"),
    [
        (PICTURE.astype(float), None, "floats beyond 0 to 1"),
        (np.full((2, 2, 3), np.nan), None, "floats beyond 0 to 1, or NaN"),
        (PICTURE.astype(np.int32), None, "values of int32"),
        (PICTURE.astype(np.uint16) << 8, 12, "expected less than 4096 with 12 bits"),
        (PICTURE.astype(np.int64), None, "values of int64"),
        (PICTURE > 9, None, "values of bool"),
        (PICTURE.astype(complex), None, "values of complex128"),
        (PICTURE, 7, "bits is 7; expected 8 to 16"),
        (PICTURE, "12", "bits is '12'; expected 8 to 16"),
        (PICTURE, 12.5, "bits is 12.5; expected 8 to 16"),
    ],
)
def test_values_of_no_picture_are_refused(image, bits, said):
    with pytest.raises(ImageError, match=said):
        eight_bits(image, "frame", bits)


def tiff(turn: int) -> bytes:
    """EXIF data that note one of the eight turns."""
    return b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0" + bytes([turn]) + bytes(6)


TURNS = {
    1: lambda p: p,
    2: lambda p: p[:, ::-1],
    3: lambda p: p[::-1, ::-1],
    4: lambda p: p[::-1],
    5: lambda p: p.swapaxes(0, 1),
    6: lambda p: p.swapaxes(0, 1)[:, ::-1],
    7: lambda p: p.swapaxes(0, 1)[::-1, ::-1],
    8: lambda p: p.swapaxes(0, 1)[::-1],
}
"""What a viewer does with a picture, by the note of EXIF."""


@pytest.mark.parametrize("turn", TURNS)
def test_exif_turns_are_applied_where_they_are_asked_for(turn):
    def part(content: bytes, marker: bytes = b"\xff\xe1") -> bytes:
        return marker + struct.pack(">H", len(content) + 2) + content

    # A profile of colours may come before the note.
    profile = 2 * part(b"ICC_PROFILE\0" + bytes(40_000), b"\xff\xe2")
    jpeg = JPEG[:2] + profile + part(b"Exif\0\0" + tiff(turn)) + JPEG[2:]
    png = PNG[:33] + chunk(b"eXIf", tiff(turn)) + PNG[33:]
    for data, stored in ((jpeg, decode_image(JPEG)), (png, PICTURE)):
        assert np.array_equal(decode_image(data), stored)
        assert np.array_equal(decode_image(data, upright=True), TURNS[turn](stored))


# Kinds of PNG


GREY = PICTURE[..., 0]
RGB = PICTURE[..., ::-1]
COLOURS = np.random.default_rng(3).integers(0, 256, (256, 3), dtype=np.uint8)
ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
"""The passes of an interlaced PNG: first column and row, and the distances of both."""


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png_of(values, depth: int, kind: int, *more: bytes, interlaced: bool = False) -> bytes:
    """A PNG of values, shape (height, width) or (height, width, channels), of this many bits and this colour type."""
    header = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], depth, kind, 0, 0, interlaced)
    steps = ADAM7 if interlaced else ((0, 0, 1, 1),)
    rows = [row for x, y, dx, dy in steps for row in values[y::dy, x::dx]]
    if depth < 8:
        digits = [np.unpackbits(row[:, None].astype(np.uint8), axis=1)[:, -depth:] for row in rows]
        rows = [np.packbits(bits.reshape(-1)) for bits in digits]
    content = b"".join(b"\0" + row.astype(">u2" if depth == 16 else np.uint8).tobytes() for row in rows)
    return (
        PNG[:8]
        + chunk(b"IHDR", header)
        + b"".join(more)
        + chunk(b"IDAT", zlib.compress(content))
        + chunk(b"IEND", b"")
    )


def with_alpha(values, depth: int):
    return np.dstack((values, np.full(values.shape[:2], 7 if depth == 8 else 7000)))


def three(grey):
    return np.repeat(grey[..., None], 3, axis=2)


PALETTE = chunk(b"PLTE", COLOURS.tobytes())
KINDS = {
    "grey of 1 bit": (png_of(GREY >> 7, 1, 0), three((GREY >> 7) * 255)),
    "grey of 2 bits": (png_of(GREY >> 6, 2, 0), three((GREY >> 6) * 85)),
    "grey of 4 bits": (png_of(GREY >> 4, 4, 0), three((GREY >> 4) * 17)),
    "grey of 16 bits": (png_of(GREY.astype(int) * 257, 16, 0), three(GREY)),
    "grey of 12 bits in 16": (png_of(GREY.astype(int) << 4, 16, 0), three(GREY)),
    "grey, alpha": (png_of(with_alpha(GREY, 8), 8, 4), three(GREY)),
    "grey, alpha, 16 bits": (png_of(with_alpha(GREY.astype(int) * 257, 16), 16, 4), three(GREY)),
    "grey, alpha, 12 bits in 16": (png_of(with_alpha(GREY.astype(int) << 4, 16), 16, 4), three(GREY)),
    "grey, one transparent": (png_of(GREY, 8, 0, chunk(b"tRNS", b"\0\x20")), three(GREY)),
    "colours, alpha": (png_of(with_alpha(RGB, 8), 8, 6), PICTURE),
    "colours, alpha, 16 bits": (png_of(with_alpha(RGB.astype(int) * 257, 16), 16, 6), PICTURE),
    "colours, alpha, 12 bits in 16": (png_of(with_alpha(RGB.astype(int) << 4, 16), 16, 6), PICTURE),
    "palette of 1 bit": (
        png_of(GREY >> 7, 1, 3, chunk(b"PLTE", COLOURS[:2].tobytes())),
        COLOURS[GREY >> 7],
    ),
    "palette of 4 bits": (
        png_of(GREY >> 4, 4, 3, chunk(b"PLTE", COLOURS[:16].tobytes())),
        COLOURS[GREY >> 4],
    ),
    "palette": (png_of(GREY, 8, 3, PALETTE), COLOURS[GREY]),
    "palette, transparent": (png_of(GREY, 8, 3, PALETTE, chunk(b"tRNS", bytes(256))), COLOURS[GREY]),
    "interlaced grey": (png_of(GREY, 8, 0, interlaced=True), three(GREY)),
    "interlaced, 16 bits": (png_of(RGB.astype(int) * 257, 16, 2, interlaced=True), PICTURE),
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_png_is_read(kind):
    data, expected = KINDS[kind]
    expected = expected[..., ::-1] if kind.startswith("palette") else expected
    assert np.array_equal(decode_image(data), expected)


@pytest.mark.parametrize(
    "data",
    [png_of(GREY.astype(int) * 257, 16, 3, PALETTE), png_of(GREY, 8, 3)],
    ids=["palette of 16 bits", "no palette"],
)
def test_kinds_of_png_that_there_are_not_are_damaged(data):
    with pytest.raises(ImageError, match="damaged"):
        decode_image(data)


def test_the_first_header_of_a_png_counts_and_comes_first(monkeypatch):
    small = png_of(GREY, 8, 0)
    size = struct.pack(">IIBBBBB", 20_000, 20_000, 8, 2, 0, 0, 0)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(ImageError, match="20000 x 20000 pixels"):
        decode_image(small[:8] + chunk(b"IHDR", size) + small[8:])
    with pytest.raises(ImageError, match="does not begin with a header"):
        decode_image(small[:8] + chunk(b"tEXt", b"a\0b") + small[8:])


def test_a_jpeg_of_four_colours_is_read():
    """CMYK, as printers have it, of one even colour; made by Pillow 12."""
    import io

    image = pytest.importorskip("PIL.Image").new("CMYK", (128, 80), (0, 128, 255, 0))
    image.save(file := io.BytesIO(), "JPEG", quality=95)
    seen = decode_image(file.getvalue())
    assert np.abs(seen.reshape(-1, 3).astype(int) - (0, 127, 255)).max() <= 3


def test_progressive_jpeg_and_trailing_bytes():
    good, data = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    assert good
    assert decode_image(data.tobytes()).shape == PICTURE.shape
    assert decode_image(JPEG + b"\0" * 64).shape == PICTURE.shape


@pytest.mark.parametrize("data", [PNG, JPEG], ids=["png", "jpeg"])
@given(share=st.floats(0.05, 0.999))
def test_every_cut_is_noticed(data, share):
    with pytest.raises(ImageError, match="cut short"):
        decode_image(data[: int(len(data) * share)], "frame.bin")


@given(st.binary(max_size=400))
def test_no_bytes_lead_to_another_error(data):
    for start in (b"", b"\xff\xd8\xff", PNG[:8], JPEG[:200], PNG[:60]):
        with pytest.raises(ImageError):
            decode_image(start + data)


def test_damaged_png():
    broken = bytearray(PNG)
    broken[len(PNG) // 2] ^= 0xFF
    with pytest.raises(ImageError, match="wrong checksum"):
        decode_image(bytes(broken))


def test_missing_empty_foreign_and_unreadable_files(tmp_path):
    (tmp_path / "empty.jpg").write_bytes(b"")
    (tmp_path / "text.jpg").write_text("hello")
    with pytest.raises(ImageError, match=r"nothing\.jpg: cannot be read: No such file"):
        decode_image(tmp_path / "nothing.jpg")
    with pytest.raises(ImageError, match=r"empty\.jpg: empty"):
        decode_image(tmp_path / "empty.jpg")
    with pytest.raises(ImageError, match=r"text\.jpg: neither JPEG nor PNG"):
        decode_image(tmp_path / "text.jpg")
    with pytest.raises(ImageError, match="is a folder"):
        decode_image(tmp_path)
    with pytest.raises(ImageError, match="cannot be read"):
        decode_image("a\0b.jpg")
    with pytest.raises(ImageError, match="image: empty"):
        decode_image(b"")


def test_too_small_and_too_large_are_refused_before_decoding():
    with pytest.raises(ImageError, match="40 x 30 pixels; expected at least 64"):
        decode_image(encoded(".png", np.zeros((30, 40, 3), np.uint8)))
    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")]
    bomb = PNG[:8] + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    with pytest.raises(ImageError, match="at most 64 megapixels"):
        decode_image(bomb)


def test_raw_buffer():
    assert (raw_bgr_image(PICTURE.tobytes(), 128, 80) == PICTURE).all()
    with pytest.raises(ImageError, match="expected 30720"):
        raw_bgr_image(PICTURE.tobytes()[:-1], 128, 80)
    with pytest.raises(ImageError, match="at least 64"):
        raw_bgr_image(b"", 0, 0)


def with_scans(count: int, width: int = 4000, height: int = 3000) -> bytes:
    """A progressive JPEG whose last pass over the picture is there so often again."""
    data = encoded(".jpg", np.full((height, width, 3), 127, np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    return data[:-2] + data[data.rfind(b"\xff\xda") : -2] * count + data[-2:]


def test_a_jpeg_of_too_many_scans_is_refused_before_it_is_decoded(monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(ImageError, match="4000 x 3000 pixels in 84 scans or more; expected at most 83"):
        decode_image(with_scans(100))


def test_an_ordinary_progressive_jpeg_is_read():
    image = np.random.default_rng(0).integers(0, 256, (200, 300, 3), dtype=np.uint8)
    data = encoded(".jpg", image, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    assert np.array_equal(decode_image(data), cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
    assert decode_image(with_scans(5, 320, 240)).shape == (240, 320, 3)


@pytest.mark.parametrize(
    "settings", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 3]]
)
@pytest.mark.parametrize("grey", [False, True])
@pytest.mark.parametrize("share", [0.01, 0.3, 0.5, 0.8, 0.97])
def test_a_jpeg_cut_off_before_an_end_marker_is_cut_short(settings, grey, share):
    image = np.random.default_rng(1).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    data = encoded(".jpg", image[..., 0] if grey else image, settings)
    began = data.find(b"\xff\xda") + 20
    with pytest.raises(ImageError, match="cut short"):
        decode_image(data[: began + round(share * (len(data) - began - 2))] + b"\xff\xd9")


@pytest.mark.parametrize(
    "settings", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 1]]
)
@pytest.mark.parametrize("size", [(64, 64), (65, 71), (240, 320)])
@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_whole_jpeg_that_looks_like_one_cut_off_is_read(settings, size, level):
    image = np.full((*size, 3), level, np.uint8)
    image[:40, :40] = 17
    assert abs(int(decode_image(encoded(".jpg", image, settings))[-1, -1, 0]) - level) < 4
