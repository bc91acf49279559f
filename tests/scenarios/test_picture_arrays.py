"""Pictures as arrays: type, shape and channel order are checked before anything is worked out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from scenarios import vision_estimator
from scenarios.vision_estimator import picture_of
from trpac_core.errors import TrpacError

PICTURE = np.random.default_rng(0).integers(0, 256, (80, 128, 3), dtype=np.uint8)
GREY = PICTURE[..., 0]


def read(image, order="bgr", bits=None):
    return picture_of(image, order, bits, upright=False)


def test_rgb_is_asked_for_by_name():
    assert np.array_equal(read(PICTURE), PICTURE)
    assert np.array_equal(read(PICTURE[..., ::-1], "rgb"), PICTURE)


@pytest.mark.parametrize("order", ["RGB", "gbr", None])
def test_another_order_is_refused(order):
    with pytest.raises(TrpacError, match="expected 'bgr' or 'rgb'"):
        read(PICTURE, order)


@pytest.mark.parametrize(
    "array",
    [PICTURE[::-1, ::-1], np.asfortranarray(PICTURE), np.repeat(PICTURE, 2, axis=2)[..., ::2]],
    ids=["backwards", "by columns", "every other value"],
)
def test_arrays_that_do_not_lie_in_one_piece_are_read(array):
    seen = read(array)
    assert np.array_equal(seen, array)
    assert seen.flags.c_contiguous


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (GREY, r"shape \(80, 128\); expected \(height, width, 3\): repeat a grey one"),
        (GREY[..., None], "repeat a grey one"),
        (np.dstack((PICTURE, GREY)), "leave out alpha"),
        (np.moveaxis(PICTURE, 2, 0), r"shape \(3, 80, 128\).*move the channels to the end"),
        (PICTURE[None], "expected"),
        (np.zeros((0, 0, 3), np.uint8), "0 x 0 pixels"),
        (PICTURE.astype(np.int64), "values of int64; expected uint8, uint16, or floats"),
        (PICTURE.astype(object), "values of object"),
        (np.where(PICTURE > 250, np.nan, PICTURE / 255.0), "or NaN"),
        (PICTURE.astype(float), "Divide by the greatest value"),
        (PICTURE.tolist(), "image is a list; expected a path or a numpy array"),
        ([[1], [2, 3]], "image is a list"),
        (SimpleNamespace(__array_interface__={}), "image is a SimpleNamespace; .*order='rgb'"),
        (None, "image is a NoneType"),
    ],
)
def test_arrays_that_are_no_pictures_are_refused(array, said):
    with pytest.raises(TrpacError, match=said):
        read(array)


def test_a_picture_of_more_than_64_megapixels_is_refused_before_it_is_converted(monkeypatch):
    monkeypatch.setattr(vision_estimator, "eight_bits", lambda *_: pytest.fail("converted"))
    large = np.broadcast_to(np.float64(0.5), (20_000, 20_000, 3))  # of 8 bytes
    with pytest.raises(TrpacError, match="at most 64 megapixels"):
        read(large)
