"""How the scene's head is learned: patches and pictures seen alike, the regression, the card."""

import argparse

import numpy as np
import pytest
from scipy.special import softmax
from tiny_onnx import write_classifier

from models.training import roadside, scene_run
from models.training.cards import SCENE_BEGIN, SCENE_END
from models.training.patches import PatchSet
from models.training.scene_set import SceneSet, all_of, apart, load_scenes, save_scenes, scenes_of_views
from trpac_core.vision.networks import ModelError, SurfaceClassifier
from trpac_core.vision.scene import NUMBERS


def scene_set(levels, scene_levels, labels=None, source="rendered"):
    n = len(levels)
    patches = np.repeat(np.array(levels, np.uint8), 64 * 96 * 3).reshape(n, 64, 96, 3)
    scenes = np.repeat(np.array(scene_levels, np.uint8), 20 * 32 * 3).reshape(n, 20, 32, 3)
    labels = np.zeros(n, np.int64) if labels is None else np.asarray(labels, np.int64)
    return SceneSet(PatchSet(patches, labels, np.full(n, source), np.arange(n)), scenes)


def test_a_scene_and_its_patch_as_one_picture_come_apart_again():
    rng = np.random.default_rng(0)
    one = scene_set([10, 20], [30, 40])
    one = SceneSet(one.patches, rng.integers(0, 255, one.scenes.shape).astype(np.uint8))
    patches, scenes = apart(one.as_one())
    assert np.array_equal(patches, one.patches.patches)
    assert np.array_equal(scenes, one.scenes)


def test_other_cameras_and_disturbances_change_both_alike():
    """Of one level before, they are of one level afterwards; shadows may fall on the lower part alone."""
    levels = [60, 90, 120, 150] * 10
    same = scene_set(levels, levels)
    other = same.by_other_cameras(np.random.default_rng(1))
    assert np.abs(other.patches.patches[:, 0, 0].astype(int) - other.scenes[:, 0, 0]).max() == 0
    assert np.abs(other.scenes[:, 0, 0, 1].astype(int) - levels).max() > 5
    disturbed = same.disturbed(3)
    apart_by = np.abs(disturbed.patches.patches[:, 5, 48].astype(int) - disturbed.scenes[:, 8, 16]).max(
        axis=1
    )
    assert np.median(apart_by) <= 1
    assert np.abs(disturbed.scenes[:, 8, 16, 1].astype(int) - levels).max() > 10


def test_views_keep_their_scene_with_each_patch():
    patch = np.zeros((64, 96, 3), np.uint8)
    views = [(np.full((20, 32, 3), level, np.uint8), [(patch, c) for c in cut])
             for level, cut in ((10, (0, 2, 0)), (20, ()), (30, (1,)))]  # fmt: skip
    found = scenes_of_views(views)
    assert found.patches.labels.tolist() == [0, 0, 2, 1]
    assert found.scenes[:, 0, 0, 0].tolist() == [10, 10, 10, 30]
    assert len(set(found.patches.pictures[:3])) == 2  # a view's two classes are two pictures
    assert len(all_of([found, found])) == 8


def test_roadsides_darken_most_skies_and_leave_the_road_as_it_is():
    sky, ground = 200, 80
    open_land = np.full((400, 20, 32, 3), ground, np.uint8)
    open_land[:, :10] = sky
    seen = roadside.with_roadsides(open_land, seed=1)
    assert seen.dtype == np.uint8
    assert np.array_equal(seen[:, 10:], open_land[:, 10:])
    assert np.array_equal(seen, roadside.with_roadsides(open_land, seed=1))
    assert (open_land[:, :10] == sky).all(), "what was given has changed"
    hidden = (seen[:, :10] != sky).any(axis=-1)
    overgrown = hidden.any(axis=(1, 2))
    # 17 of 18 of the sides drawn are at least a column wide: a road with neither is rare
    assert overgrown.mean() == pytest.approx(roadside.OVERGROWN, abs=0.07)
    darkest = ground * roadside.MASS[0] * roadside.TINTS[0] * roadside.GRAIN[0]
    brightest = ground * roadside.MASS[1] * roadside.TINTS[1] * roadside.GRAIN[1]
    painted = seen[:, :10][hidden]
    assert darkest - 1.0 <= painted.min() < 0.4 * ground
    assert 0.8 * brightest < painted.max() <= brightest + 1.0
    # trees are highest and commonest at the edges, and the sky over the road's end is seen in most pictures
    often = hidden[overgrown].mean(axis=(0, 1))
    assert often[0] > 0.5
    assert often[31] > 0.5
    assert often[15] < 0.35
    assert (seen[:, :10] == sky).all(axis=-1).any(axis=(1, 2)).mean() > 0.9


def test_roadsides_are_painted_beside_rendered_roads_alone(monkeypatch):
    real, drawn = scene_set([70] * 40, [90] * 40, source="clip"), scene_set([70] * 40, [120] * 40)
    monkeypatch.setattr(scene_run, "trained_on", lambda pictures, without: [])
    monkeypatch.setattr(scene_run, "training_patches", lambda pictures, seed: real.patches)
    monkeypatch.setattr(scene_run, "scenes_of_pictures", lambda patches, pictures: real)
    monkeypatch.setattr(scene_run, "kept_or_made", lambda *given, **ways: drawn)
    given = argparse.Namespace(without=(), effort=1.0, kept=None, threads=1)
    seen = scene_run.gather(given, [], None, None)
    assert np.array_equal(seen.scenes[:40], real.scenes)
    changed = (seen.scenes[40:] != drawn.scenes).any(axis=(1, 2, 3))
    assert changed.mean() == pytest.approx(roadside.OVERGROWN, abs=0.2)
    assert np.array_equal(seen.patches.patches[40:], drawn.patches.patches)


def test_regression_stands_where_the_loss_is_least():
    """The gradient by finite differences of the loss written down anew vanishes, and the known law is found."""
    rng = np.random.default_rng(2)
    n, m = 4000, 3
    x, logits = rng.standard_normal((n, m)), rng.standard_normal((n, 3))
    law = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 0.0]])
    chance = softmax(logits + x @ law, axis=1)
    labels = (rng.random(n)[:, None] > chance.cumsum(axis=1)).sum(axis=1)
    shares = np.full(n, 1.0 / n)
    weights, bias = scene_run.regression(x, labels, shares, logits)
    assert weights - weights.mean(axis=1, keepdims=True) == pytest.approx(law, abs=0.2)

    def loss(w, b):
        p = softmax(logits + x @ w + b, axis=1)[np.arange(n), labels]
        return -np.mean(np.log(p)) + 0.5 * scene_run.RIDGE * np.sum(w**2)

    for i in range(m):
        for k in range(3):
            step = np.zeros((m, 3))
            step[i, k] = 1e-4
            slope = (loss(weights + step, bias) - loss(weights - step, bias)) / 2e-4
            assert slope == pytest.approx(0.0, abs=1e-4)


def test_a_head_tells_what_the_patch_alone_does_not(tmp_path):
    """Grey patches of three classes that differ by nothing but how bright their picture is."""
    rng = np.random.default_rng(4)
    labels = rng.integers(0, 3, 90)
    grey = scene_set(rng.integers(90, 110, 90), np.array([60, 110, 190])[labels], labels)
    classifier = SurfaceClassifier(write_classifier(tmp_path / "surface.onnx"))
    head = scene_run.learn_head(classifier, grey, seed=1)
    alone = grey.logits(classifier, alone=True)
    assert head.weights.shape == (len(NUMBERS), 3)
    beside = alone + head.logits(grey.patches.patches, grey.scenes)
    assert (beside.argmax(axis=1) == labels).mean() > 0.95
    assert (alone.argmax(axis=1) == labels).mean() < 0.6


def test_a_card_gets_its_section_hash_and_temperature_anew():
    card = (
        f"# surface.onnx\n\nsha256: `{'0' * 64}`\n\n- Metadata: `temperature` = 1.060797, `classes` = a.\n\n"
        f"## The scene\n\n{SCENE_BEGIN}\n\nold words\n\n{SCENE_END}\n\n## Limits\n"
    )
    told = scene_run.with_section(card, "new words", "f" * 64, 1.25)
    assert f"sha256: `{'f' * 64}`" in told
    assert "`temperature` = 1.250000, `classes` = a." in told
    assert "new words" in told
    assert "old words" not in told
    assert told.count(SCENE_BEGIN) == told.count(SCENE_END) == told.count("## Limits") == 1
    assert scene_run.with_section(told, "new words", "f" * 64, 1.25) == told


def test_kept_scenes_come_back_as_they_were(tmp_path):
    made = scene_set([10, 90, 200], [40, 50, 60], labels=[0, 1, 2])
    save_scenes(tmp_path / "kept" / "scenes.npz", made)
    again = load_scenes(tmp_path / "kept" / "scenes.npz")
    np.testing.assert_array_equal(again.scenes, made.scenes)
    for name, values in vars(made.patches).items():
        np.testing.assert_array_equal(getattr(again.patches, name), values)
    assert [file.name for file in (tmp_path / "kept").iterdir()] == ["scenes.npz"], "no part is left behind"


def test_a_head_of_numbers_no_longer_read_is_no_obstacle_to_another(tmp_path):
    pytest.importorskip("onnx", reason="the training extra is not installed")
    patch = np.full((1, 64, 96, 3), 90, np.uint8)
    told = {"temperature": "1.5", "classes": "dry,wet,snow_ice"}
    plain = write_classifier(tmp_path / "plain.onnx", metadata=told)
    stale = write_classifier(tmp_path / "stale.onnx", metadata=told | {"scene": '{"numbers": ["gloss"]}'})
    before = stale.read_bytes()
    with pytest.raises(ModelError, match="'numbers' must be"):
        SurfaceClassifier(stale)
    bare = scene_run.patches_alone(stale, threads=1)
    assert bare.scene_head is None
    assert bare.temperature == 1.5
    assert np.array_equal(bare.verdicts(patch).logits, SurfaceClassifier(plain).verdicts(patch).logits)
    assert stale.read_bytes() == before
