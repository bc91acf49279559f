"""The networks' contract: inputs, outputs, calibration, and files that do not fit."""

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from tiny_onnx import write_classifier, write_segmenter

from trpac_core.vision.networks import ModelError, Segmenter, SurfaceClassifier, reduced


def test_classifier_takes_any_number_of_patches_in_one_run(tmp_path):
    classifier = SurfaceClassifier(write_classifier(tmp_path / "surface.onnx"))
    patches = np.random.default_rng(0).integers(0, 256, (7, 64, 96, 3), dtype=np.uint8)
    assert classifier.verdicts(patches).logits == pytest.approx(patches.mean(axis=(1, 2)), rel=1e-5)
    assert classifier.verdicts(patches[:1]).logits.shape == (1, 3)
    grey = patches.mean(axis=(1, 2, 3))
    assert classifier.verdicts(patches).readable == pytest.approx(1.0 / (1.0 + np.exp(-grey)), rel=1e-5)
    assert classifier.temperature == 2.5


def test_segmenter_reduces_the_picture_and_keeps_its_layout(tmp_path):
    segmenter = Segmenter(write_segmenter(tmp_path / "segmenter.onnx"), threads=1)
    image = np.zeros((1200, 1920, 3), np.uint8)
    image[600:, :960] = (100, 200, 200)
    masks = segmenter.segment(image)
    assert masks.drivable.shape == masks.shadow.shape == (160, 256)
    assert (masks.drivable[80:, :128] > 0.99).all()
    assert masks.shadow[100, 10] == pytest.approx(500.0 / 3.0)
    assert masks.surface == pytest.approx([25.0, 50.0, 50.0])
    assert (masks.drivable[:80] == 0.5).all()
    assert (masks.drivable[80:, 128:] == 0.5).all()


@pytest.mark.parametrize(
    "shape", [(160, 256), (600, 960), (639, 1030), (1200, 1920), (1201, 1921), (3000, 4000)]
)
def test_a_picture_is_reduced_to_the_means_of_its_areas(shape):
    rng = np.random.default_rng(sum(shape))
    coarse = cv2.resize(rng.uniform(0, 255, (20, 32, 3)), shape[::-1], interpolation=cv2.INTER_CUBIC)
    image = np.clip(coarse + rng.normal(0.0, 8.0, (*shape, 3)), 0, 255).astype(np.uint8)
    areas = cv2.resize(image, (256, 160), interpolation=cv2.INTER_AREA).astype(int)
    difference = reduced(image) - areas
    if min(shape[0] / 160, shape[1] / 256) < 4:
        assert not difference.any()
    assert np.abs(difference).mean() < 1.5, (
        "of pixels that scatter by 8 levels; an odd row or column is left out"
    )
    assert np.abs(difference.mean(axis=(0, 1))).max() < 0.3


def test_swapped_files_are_named_with_what_was_expected(tmp_path):
    surface, segmenter = write_classifier(tmp_path / "a.onnx"), write_segmenter(tmp_path / "b.onnx")
    with pytest.raises(
        ModelError, match=r"a\.onnx: expected one input 'image'.*\[1, 160, 256, 3\].*'patches'"
    ):
        Segmenter(surface)
    with pytest.raises(ModelError, match=r"b\.onnx: expected one input 'patches'.*64, 96, 3.*'image'"):
        SurfaceClassifier(segmenter)


def test_wrong_patch_size_and_wrong_outputs(tmp_path):
    with pytest.raises(ModelError, match=r"\['n', 64, 96, 3\].*32, 96"):
        SurfaceClassifier(write_classifier(tmp_path / "small.onnx", height=32))
    with pytest.raises(ModelError, match=r"expected outputs \['drivable', 'shadow', 'surface'\]"):
        Segmenter(write_segmenter(tmp_path / "other.onnx", outputs=("road", "shade")))


@pytest.mark.parametrize(
    ("metadata", "said"),
    [
        ({}, "'temperature' must be .*None.*'classes' must be"),
        ({"temperature": "warm", "classes": "dry,wet,snow_ice"}, "is 'warm'"),
        ({"temperature": "-1.0", "classes": "dry,wet,snow_ice"}, "above 0"),
        ({"temperature": "nan", "classes": "dry,wet,snow_ice"}, "above 0"),
        ({"temperature": "1.5", "classes": "snow,wet,dry"}, "is 'snow,wet,dry'"),
    ],
)
def test_calibration_must_come_with_the_file(tmp_path, metadata, said):
    with pytest.raises(ModelError, match=said):
        SurfaceClassifier(write_classifier(tmp_path / "surface.onnx", metadata=metadata))


def test_missing_empty_and_foreign_files(tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.onnx: no such network file"):
        Segmenter(tmp_path / "nowhere.onnx")
    for name, content in {"empty.onnx": b"", "text.onnx": b"not a network at all"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ModelError, match=name):
            Segmenter(tmp_path / name)
    whole = write_segmenter(tmp_path / "whole.onnx").read_bytes()
    (tmp_path / "cut.onnx").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ModelError, match=r"cut\.onnx"):
        Segmenter(tmp_path / "cut.onnx")


def test_a_network_that_loads_but_cannot_run_is_named(tmp_path):
    classifier = SurfaceClassifier(write_classifier(tmp_path / "surface.onnx", only_for=1))
    patches = np.zeros((2, 64, 96, 3), np.uint8)
    assert classifier.verdicts(patches[:1]).logits.shape == (1, 3)
    with pytest.raises(ModelError, match=r"surface\.onnx: a damaged network, it cannot be run: .*Reshape"):
        classifier.verdicts(patches)


def test_masks_that_are_no_numbers_are_refused(tmp_path):
    segmenter = Segmenter(write_segmenter(tmp_path / "segmenter.onnx", drivable_by="Log"))
    image = np.full((1200, 1920, 3), 20, np.uint8)
    assert segmenter.segment(image).drivable[0, 0] == pytest.approx(np.log(20.0))
    image[0:100, 0:100] = 0
    with pytest.raises(ModelError, match=r"segmenter\.onnx: expected 'drivable' finite and of 160 x 256"):
        segmenter.segment(image)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere reports leave no trace in the home folder")
def test_loading_networks_leaves_no_trace_in_the_users_home(tmp_path):
    write_segmenter(tmp_path / "segmenter.onnx")
    home = tmp_path / "home"
    home.mkdir()
    loads = "import sys; from trpac_core.vision.networks import Segmenter; Segmenter(sys.argv[1])"
    environment = {
        k: v for k, v in os.environ.items() if k not in ("ORT_DISABLE_TELEMETRY", "XDG_CACHE_HOME")
    }
    # Within a CI system the runtime keeps still by itself.
    environment = {k: v for k, v in environment.items() if not k.startswith(("CI", "GITHUB"))}
    subprocess.run(
        [sys.executable, "-B", "-c", loads, tmp_path / "segmenter.onnx"],
        env=environment | {"HOME": str(home)},
        check=True,
    )
    assert [path for path in home.rglob("*") if path.is_file()] == []
