"""Picture disturbances and camera files."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from scenarios.camera.disturbances import NONE, PAPER, Disturbance, blur_length_px, disturb
from scenarios.camera.files import load_camera
from scenarios.errors import ScenarioError
from trpac_core.vision.camera import Camera

EVERYTHING = Disturbance(1.0, 15.0, 1.0, 0.2, 0.2, 1.0, 1.5, 1.0, 2)


@pytest.fixture
def picture():
    return np.random.default_rng(0).integers(40, 200, (150, 240, 3), dtype=np.uint8)


@pytest.mark.parametrize("disturbance", [PAPER, EVERYTHING])
def test_disturbing_keeps_shape_and_type_and_repeats_from_its_seed(picture, disturbance):
    before = picture.copy()
    once, again = (disturb(picture, disturbance, 5) for _ in range(2))
    assert once.shape == picture.shape
    assert once.dtype == np.uint8
    assert np.array_equal(once, again)
    assert (once != picture).mean() > 0.5
    assert not np.array_equal(once, disturb(picture, disturbance, 6))
    assert np.array_equal(picture, before)


def test_no_disturbance_leaves_the_picture_alone(picture):
    untouched = disturb(picture, NONE, 1)
    assert np.array_equal(untouched, picture)
    assert untouched is not picture


def test_the_paper_blurs_every_frame_and_changes_light_on_seven_of_ten():
    flat = np.full((48, 64, 3), 100, dtype=np.uint8)
    changed = np.mean([(disturb(flat, PAPER, seed) != 100).any() for seed in range(300)])
    assert changed == pytest.approx(0.7, abs=0.09)
    dot = np.zeros((49, 65, 3), dtype=np.uint8)
    dot[24, 32] = 255
    only_blur = replace(PAPER, brightness_contrast_probability=0.0)
    smeared = [(disturb(dot, only_blur, seed) > 0).any(axis=2).sum() > 1 for seed in range(100)]
    assert np.mean(smeared) > 0.95  # the library's shortest kernel is a single pixel in some directions


def test_blur_scales_with_the_picture():
    assert blur_length_px(15.0, 1920) == 15
    assert blur_length_px(31.0, 960) == 17
    assert blur_length_px(15.0, 256) == 3
    assert all(blur_length_px(limit, 1920) % 2 for limit in range(3, 40))


def test_exposure_goes_both_ways():
    flat = np.full((16, 16, 3), 100, dtype=np.uint8)
    exposure = Disturbance(exposure_probability=1.0, exposure_limit_ev=1.5)
    means = np.array([disturb(flat, exposure, seed).mean() for seed in range(60)])
    assert means.min() < 85
    assert means.max() > 120


def test_the_shipped_camera_is_the_default(request):
    assert load_camera(request.config.rootpath / "scenarios" / "cameras" / "paper.yaml") == Camera()


@pytest.fixture
def values(request):
    return yaml.safe_load((request.config.rootpath / "scenarios" / "cameras" / "paper.yaml").read_text())


def test_a_camera_file_names_all_its_problems_at_once(tmp_path, values):
    values["hieght_m"] = values.pop("height_m")
    values["fx_px"] = -3.0
    values["distortion"] = [0.0, 0.0]
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(values))
    with pytest.raises(ScenarioError) as caught:
        load_camera(path)
    text = str(caught.value)
    for part in ("camera.yaml", "hieght_m", "height_m", "fx_px", "distortion"):
        assert part in text
    assert text.count("camera.yaml") == 4


@pytest.mark.parametrize("schema", [2, "1", None])
def test_another_schema_is_refused(tmp_path, values, schema):
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(values | {"schema": schema}))
    with pytest.raises(ScenarioError, match="schema"):
        load_camera(path)
