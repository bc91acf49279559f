"""What the picture around a patch adds to its logits: the numbers, the head, and who uses it."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_onnx import write_classifier

from trpac_core.vision.networks import ModelError, SurfaceClassifier
from trpac_core.vision.scene import DARK, FLAT, LIMIT, NUMBERS, SceneHead, scene_numbers, scene_of

CLASSES = {"temperature": "1.5", "classes": "dry,wet,snow_ice"}
PATCH = np.full((1, 64, 96, 3), 100, np.uint8)


def head(seed=0, scale=1.0):
    rng = np.random.default_rng(seed)
    weights = scale * rng.standard_normal((len(NUMBERS), 3))
    return SceneHead(
        rng.uniform(0.0, 0.5, len(NUMBERS)), rng.uniform(0.1, 1.0, len(NUMBERS)), weights, np.ones(3)
    )


def number(name, patches, scene):
    return scene_numbers(patches, scene)[:, NUMBERS.index(name)]


# --- the picture reduced


@pytest.mark.parametrize("shape", [(1200, 1920), (480, 640), (250, 250), (64, 64), (20, 32)])
def test_a_picture_of_any_size_is_reduced_to_its_areas_means(shape):
    rng = np.random.default_rng(1)
    coarse = rng.integers(30, 220, (5, 8, 3)).astype(np.uint8)
    picture = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    noisy = np.clip(picture + rng.normal(0.0, 8.0, picture.shape), 0, 255).astype(np.uint8)
    scene = scene_of(noisy)
    assert scene.shape == (20, 32, 3)
    assert scene.dtype == np.uint8
    areas = cv2.resize(noisy, (32, 20), interpolation=cv2.INTER_AREA)
    # of a large picture every fourth or so row and column is looked at: some 60 pixels a cell, noise of 8 levels
    assert np.abs(scene.astype(float) - areas).mean() < 2.0
    assert np.abs(scene.mean(axis=(0, 1)) - noisy.mean(axis=(0, 1))).max() < 1.5


# --- its numbers


def test_numbers_of_a_scene_of_known_parts():
    scene = np.full((20, 32, 3), 60, np.uint8)
    scene[:10] = 200
    scene[10:, :6] = scene[10:, -6:] = 120
    scene[8:10, :6] = scene[8:10, -6:] = 120
    found = dict(zip(NUMBERS, scene_numbers(PATCH, scene)[0], strict=True))
    spread = scene[..., 0].std() / 255 + FLAT
    assert found["patch_brightness"] == pytest.approx(100 / 255)
    assert found["scene_deviation"] == pytest.approx(spread - FLAT)
    assert found["patch_beyond_brightest"] == pytest.approx(-100 / 255 / spread)
    assert found["patch_beyond_sides"] == pytest.approx(-20 / 255 / spread)
    assert found["patch_contrast"] == pytest.approx(0.0, abs=1e-12)
    assert [found[k] for k in ("patch_blue", "patch_red", "scene_blue", "scene_red")] == pytest.approx(
        [0.0] * 4
    )


def test_contrast_is_the_patchs_deviation_in_those_of_its_scene():
    rng = np.random.default_rng(1)
    patch, scene = rng.integers(0, 255, (1, 64, 96, 1)), rng.integers(100, 140, (20, 32, 1))
    grey = [np.repeat(image, 3, axis=-1).astype(np.uint8) for image in (patch, scene)]
    assert number("patch_contrast", *grey) == pytest.approx(patch.std() / 255 / (scene.std() / 255 + FLAT))


def test_tints_are_beyond_the_mean_of_the_channels_and_over_it():
    blue = PATCH.copy()
    blue[..., 0] += 30  # BGR: 130, 100, 100
    mean = 110 / 255 + DARK
    assert number("patch_blue", blue, PATCH[0, :20, :32]) == pytest.approx(20 / 255 / mean)
    assert number("patch_red", blue, PATCH[0, :20, :32]) == pytest.approx(-10 / 255 / mean)
    assert number("scene_blue", PATCH, blue[0, :20, :32]) == pytest.approx(20 / 255 / mean)
    assert number("scene_blue", blue, PATCH[0, :20, :32]) == pytest.approx(0.0)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), gain=st.floats(0.7, 1.15), offset=st.integers(-20, 12))
def test_gain_and_offset_of_a_camera_hardly_move_what_a_patch_is_beside_its_scene(seed, gain, offset):
    rng = np.random.default_rng(seed)
    patches, scene = rng.integers(40, 150, (3, 64, 96, 3)), rng.integers(40, 150, (20, 32, 3))
    scene[:10] += 60
    plain = scene_numbers(patches.astype(np.uint8), scene.astype(np.uint8))
    looks = [np.clip(gain * image + offset, 0, 255).astype(np.uint8) for image in (patches, scene)]
    other = scene_numbers(*looks)
    beside = [
        NUMBERS.index(name) for name in ("patch_beyond_brightest", "patch_beyond_sides", "patch_contrast")
    ]
    # what is left is FLAT beside a deviation of some 0.15 times the gain, and what clips
    assert other[:, beside] == pytest.approx(plain[:, beside], rel=0.15, abs=0.08)
    assert np.isfinite(other).all()
    mirrored = scene_numbers(patches.astype(np.uint8), scene[:, ::-1].astype(np.uint8))
    assert mirrored == pytest.approx(plain)


def test_one_scene_for_all_patches_or_one_for_each():
    rng = np.random.default_rng(3)
    patches = rng.integers(0, 255, (4, 64, 96, 3)).astype(np.uint8)
    scenes = rng.integers(0, 255, (4, 20, 32, 3)).astype(np.uint8)
    each = scene_numbers(patches, scenes)
    for i in range(4):
        assert scene_numbers(patches[i : i + 1], scenes[i])[0] == pytest.approx(each[i])
    assert scene_numbers(patches, scenes[0])[0] == pytest.approx(each[0])
    assert scene_numbers(patches[:0], scenes[0]).shape == (0, len(NUMBERS))


def test_black_and_white_pictures_have_finite_numbers():
    for level in (0, 255):
        blank = np.full((1, 64, 96, 3), level, np.uint8)
        assert np.isfinite(scene_numbers(blank, blank[0, :20, :32])).all()


# --- the head


def test_a_head_is_read_as_it_was_written():
    written = head()
    read = SceneHead.from_text(written.to_text())
    for name in ("mean", "deviation", "weights", "bias"):
        assert np.array_equal(getattr(read, name), getattr(written, name))


def test_a_number_far_off_counts_up_to_the_limit():
    far = head().mean + 100.0 * head().deviation
    assert head().standardised(far[None]) == pytest.approx(LIMIT)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"numbers": ["brightness"]}, "'numbers' must be"),
        ({"weights": [[1.0] * 3] * 2}, "'weights' must be finite numbers of shape"),
        ({"bias": ["much", 0, 0]}, "'bias' must be numbers of shape"),
        ({"mean": None}, "'mean' must be"),
        ({"deviation": [0.0] * len(NUMBERS)}, "'deviation' must be above 0"),
        ({"bias": [float("nan"), 0.0, 0.0]}, "'bias' must be finite"),
    ],
)
def test_a_damaged_head_is_named_with_its_file(tmp_path, change, said):
    text = json.dumps(json.loads(head().to_text()) | change)
    with pytest.raises(ModelError, match=rf"surface\.onnx: wrong metadata 'scene': .*{said}"):
        SurfaceClassifier(write_classifier(tmp_path / "surface.onnx", metadata=CLASSES | {"scene": text}))


@pytest.mark.parametrize("text", ["", "no JSON", "[1, 2]", "null"])
def test_a_head_that_is_no_table_is_refused(text):
    with pytest.raises(ValueError, match=r"no JSON|'numbers' must be"):
        SceneHead.from_text(text)


def test_a_network_adds_what_its_head_says_of_the_scene(tmp_path):
    added = head(2)
    metadata = CLASSES | {"scene": added.to_text()}
    classifier = SurfaceClassifier(write_classifier(tmp_path / "surface.onnx", metadata=metadata))
    rng = np.random.default_rng(5)
    patches = rng.integers(0, 255, (3, 64, 96, 3)).astype(np.uint8)
    scene = rng.integers(0, 255, (20, 32, 3)).astype(np.uint8)
    alone, beside = classifier.verdicts(patches), classifier.verdicts(patches, scene)
    expected = alone.logits + added.standardised(scene_numbers(patches, scene)) @ added.weights + added.bias
    assert beside.logits == pytest.approx(expected)
    assert np.array_equal(beside.readable, alone.readable)
    assert np.abs(beside.logits - alone.logits).max() > 0.1


def test_a_network_without_a_head_judges_patches_alone(tmp_path):
    classifier = SurfaceClassifier(write_classifier(tmp_path / "surface.onnx"))
    assert classifier.scene_head is None
    scene = np.zeros((20, 32, 3), np.uint8)
    assert np.array_equal(classifier.verdicts(PATCH).logits, classifier.verdicts(PATCH, scene).logits)


def test_the_bias_alone_is_the_same_for_every_scene():
    flat = replace(head(), weights=np.zeros((len(NUMBERS), 3)))
    assert flat.logits(PATCH, PATCH[0, :20, :32]) == pytest.approx(1.0)
