"""The training data: splits by source, unknown pixels, road boxes, painted shadows, drawing weights."""

import importlib.util
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom
from training_folder import LowerHalf, row, write_folder

from models.training import (
    augment,
    calibrate,
    cards,
    data,
    keeping,
    outliers,
    patches,
    rendered,
    scores,
    segmenter_data,
    textures,
)
from models.training.__main__ import main
from models.training.found_roads import with_found_roads
from trpac_core.vision.networks import calibrated_probabilities

ROOT = Path(__file__).parents[2]

GREY, WHITE = 90, 250


@pytest.fixture
def made_up(tmp_path):
    """Stills whose road box is grey and the rest white, overlaid frames, and one masked drive per split."""
    rows, pictures = [], {}
    for split in ("train", "val", "test"):
        for label in ("dry", "wet", "snow"):
            still = np.full((200, 200, 3), WHITE, np.uint8)
            still[120:190, 40:160] = GREY
            name = f"condition_web/{label}/{label}_{split}.png"
            pictures[name] = still
            rows.append(row(name, split, label))
    for split in ("train", "val"):
        frame = np.full((360, 480, 3), WHITE, np.uint8)
        mask = np.zeros((360, 480), np.uint8)
        frame[200:, 100:400], mask[200:, 100:400] = GREY, 1
        mask[:, :20] = data.IGNORE
        name = f"drivable_camvid/{split}/0.png"
        pictures |= {name: frame, f"drivable_camvid/{split}/0_mask.png": mask}
        rows.append(row(name, split, "dry", mask=f"drivable_camvid/{split}/0_mask.png"))
    clip = np.full((360, 640, 3), WHITE, np.uint8)
    clip[200:315, 120:290] = GREY
    clip[200:315, 380:560] = GREY
    for split in ("train", "gap", "val"):
        name = f"seq_wet_extreme/rain/{split}.png"
        pictures[name] = clip
        rows.append(row(name, split, "wet", sequence="rain"))
    return write_folder(tmp_path, rows, pictures)


def test_splits_are_the_manifests(made_up):
    pictures = data.read_manifest(made_up)
    data.check_trainable(pictures)
    for split in data.SPLITS:
        assert all(picture.split == split for picture in data.of_split(pictures, split))
    assert {p.path.name for p in data.of_split(pictures, "train", masked=True)} == {"0.png"}
    training = patches.training_patches(data.of_split(pictures, "train"), seed=1)
    assert set(training.sources) == {"condition_web", "drivable_camvid/train", "seq_wet_extreme/rain"}
    assert len(np.unique(training.pictures)) == len(data.of_split(pictures, "train")) == 5


@pytest.mark.parametrize("seed", range(3))
def test_patches_stay_on_the_road(made_up, seed, monkeypatch):
    """The road is grey and all else white: a white edge wider than one pixel is a box that is off."""
    monkeypatch.setattr(patches, "WIDE_SHARE", 0.0)
    monkeypatch.setattr(patches, "LEAST_ROADS", (0.97, 0.97))
    monkeypatch.setattr(data, "WIDE_BOXES", {})
    for picture in data.read_manifest(made_up):
        cut = patches.random_patches(np.random.default_rng(seed), picture, 12)
        cut += patches.fixed_patches(picture)
        assert len(cut) > 12
        for patch in cut:
            assert patch.shape == (64, 96, 3)
            assert np.mean(patch > GREY + 40) <= 0.06


def test_wide_looks_span_most_of_the_wide_box_and_no_more(made_up, monkeypatch):
    monkeypatch.setattr(patches, "WIDE_SHARE", 1.0)
    still = next(p for p in data.read_manifest(made_up) if p.source == "condition_web")
    x, y = np.meshgrid(np.linspace(0, 255, 200), np.linspace(0, 255, 200))
    cv2.imwrite(str(still.path), np.dstack([x, y, 0 * x]).astype(np.uint8))
    left, top, right, bottom = data.WIDE_BOXES["condition_web"]
    for patch in patches.random_patches(np.random.default_rng(0), still, 20):
        columns, rows = patch[..., 0] / 255.0, patch[..., 1] / 255.0
        assert columns.min() >= left - 0.02
        assert columns.max() <= right + 0.02
        assert rows.min() >= top - 0.02
        assert rows.max() <= bottom + 0.02
        assert np.ptp(columns) >= 0.9 * patches.WIDE_LEAST * (right - left)
        assert np.ptp(rows) >= 0.9 * patches.WIDE_LEAST * (bottom - top)


def test_left_out_sources_are_absent_from_patches_and_outliers(made_up, monkeypatch):
    pytest.importorskip("torch", reason="the training extra is not installed")
    import argparse

    from models.training import surface_run

    monkeypatch.setattr(surface_run, "OUTLIERS", {"train": 160, "val": 80})
    rendered_part = patches.patch_set([([np.full((64, 96, 3), GREY, np.uint8)], 0, "rendered")])
    given = argparse.Namespace(without=("seq_extreme",), effort=0.5)
    pictures = data.read_manifest(made_up)
    material = surface_run.gather(given, pictures, {"train": rendered_part, "val": rendered_part})
    assert set(material.patches.sources) == {"condition_web", "drivable_camvid/train", "rendered"}
    assert {split: len(part) for split, part in material.outliers.items()} == {"train": 80, "val": 80}
    cuts = surface_run._cuts(given, data.trained_on(pictures, given.without))
    plain, weathered = cuts[: surface_run.CUTS // 2], cuts[surface_run.CUTS // 2 :]
    assert all(set(cut.sources) == {"condition_web", "drivable_camvid/train"} for cut in plain)
    assert len(weathered) == surface_run.WEATHERS // 2
    assert all(set(cut.sources) == {"weathered/drivable_camvid/train"} for cut in weathered)
    fewer = surface_run._cuts(given, data.trained_on(pictures, ("drivable_camvid",)))
    assert not any("camvid" in source for cut in fewer for source in cut.sources)


def test_outliers_repeat_by_seed_and_differ_from_one_another(made_up):
    pictures = data.of_split(data.read_manifest(made_up), "train")
    road = np.random.default_rng(0).integers(0, 80, (2, 64, 96, 3), np.uint8)
    first = outliers.outlier_patches(np.random.default_rng(3), pictures, road, 24)
    np.testing.assert_array_equal(
        first, outliers.outlier_patches(np.random.default_rng(3), pictures, road, 24)
    )
    drawn, spoilt = first[1::2], first[::4]
    assert len({patch.tobytes() for patch in (*drawn, *spoilt)}) == 18


@pytest.mark.parametrize("kind", textures.KINDS)
def test_drawn_textures_repeat_by_seed_and_none_is_like_another(kind):
    first, again = (
        [textures.KINDS[kind](rng) for _ in range(8)] for rng in map(np.random.default_rng, (5, 5))
    )
    np.testing.assert_array_equal(first, again)
    assert {(patch.shape, patch.dtype) for patch in first} == {((64, 96, 3), np.dtype(np.uint8))}
    distances = [
        np.abs(one.astype(float) - other).mean() for one in first for other in first if one is not other
    ]
    assert min(distances) > 3.0, "grey levels between two drawings"


def test_colours_have_the_hue_and_saturation_asked_for():
    rng = np.random.default_rng(0)
    for hue, channel in ((0.0, 2), (1 / 3, 1), (2 / 3, 0)):
        colour = textures.coloured(rng, (hue, hue), (0.6, 0.6))
        np.testing.assert_allclose(np.delete(colour, channel), 0.4, atol=1e-9)
        assert colour[channel] == pytest.approx(1.0)


def test_overlaid_clips_are_used_inside_their_limits_only():
    for box in data.ROAD_BOXES["seq_extreme"]:
        inside = [
            limit[0] <= box[0] < box[2] <= limit[2] and limit[1] <= box[1] < box[3] <= limit[3]
            for limit in data.EXTREME_LIMITS
        ]
        assert any(inside)


def test_clips_with_text_are_shown_below_it_and_above_the_bonnet_others_whole(made_up):
    """Text lies in rows 0 to 145, the bonnet below row 320 of 360."""
    pictures = data.read_manifest(made_up)
    overlaid, whole = (
        next(p for p in pictures if p.family == name) for name in ("seq_extreme", "condition_web")
    )
    parts = overlaid.clear_parts()
    assert [part.shape for part in parts] == [(158, 307, 3)] * 2
    for part, columns in zip(parts, (np.s_[45:352], np.s_[288:595]), strict=True):
        np.testing.assert_array_equal(part, overlaid.image()[155:313, columns])
    np.testing.assert_array_equal(whole.clear_parts(), [whole.image()])


def test_stills_are_used_in_their_lower_centre_only():
    (box,) = data.ROAD_BOXES["condition_web"]
    assert box == (0.20, 0.60, 0.80, 0.95)


def test_unknown_pixels_stay_unknown(made_up):
    (picture,) = data.of_split(data.read_manifest(made_up), "train", masked=True)
    sample = segmenter_data.masked_sample(picture)
    assert set(np.unique(sample.shadow)) == {0, data.IGNORE}
    assert (sample.drivable[sample.shadow == 0] == 1).all()
    plain = segmenter_data.plain_view(sample)
    assert set(np.unique(plain.drivable)) == {0, 1, data.IGNORE}
    assert np.mean(plain.drivable == data.IGNORE) == pytest.approx(20 / 480, abs=0.01)
    for seed in range(20):
        view = segmenter_data.training_view(np.random.default_rng(seed), sample)
        assert set(np.unique(view.drivable)) <= {0, 1, data.IGNORE}
        assert view.image.shape == (160, 256, 3)
        known = view.shadow != data.IGNORE
        assert (view.drivable[known] == 1).all()


def test_weak_labels_say_road_in_the_box_and_not_road_in_the_sky(made_up):
    for picture in data.of_split(data.read_manifest(made_up), "train", masked=False):
        sample = segmenter_data.weak_sample(picture)
        assert (sample.image[sample.drivable == 1] == GREY).all()
        assert (sample.image[sample.drivable == 0] == WHITE).all()
        assert (sample.drivable == 1).any()
        assert set(sample.shadow[sample.drivable == 1]) == {0}
        assert (sample.shadow[sample.drivable != 1] == data.IGNORE).all()


def test_the_darker_half_of_a_real_road_may_be_shadow():
    image = np.full((40, 60, 3), 100, np.uint8)
    image[:, 45:] = 40
    road = np.ones((40, 60), np.uint8)
    road[:5] = 0
    label = segmenter_data.brighter_half_lit(image, road)
    assert (label[5:, :40] == 0).all()
    assert (label[:, 50:] == data.IGNORE).all()
    assert (label[:5] == data.IGNORE).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_painted_shadows_darken_where_labelled(seed):
    rng = np.random.default_rng(seed)
    lit = np.full((80, 128, 3), 150, np.uint8)
    depth = augment.shadow_depth(rng, 80, 128)
    dark = augment.paint_shadow(rng, lit, depth)
    road = np.ones((80, 128), np.uint8)
    road[:10] = 0
    road[10:20] = data.IGNORE
    label = augment.shadow_label(depth, road, np.full_like(road, data.IGNORE))
    assert (label[:20] == data.IGNORE).all()
    assert (dark[depth == 0] == lit[depth == 0]).all()
    assert (dark <= lit).all()
    assert (dark[label == 1].mean(axis=-1) < 141).all()
    assert (dark[label == 0].mean(axis=-1) > 100).all()


def test_each_class_is_drawn_equally_and_dash_does_not_mean_dry():
    sources = (
        ["condition_web"] * 6 + ["drivable_camvid/x"] * 60 + ["seq_wet_extreme/rain"] * 3 + ["rendered"] * 9
    )
    labels = np.array([0, 0, 1, 1, 2, 2] + [0] * 60 + [1] * 3 + [0, 1, 2] * 3)
    count = len(labels)
    weights = patches.draw_weights(
        patches.PatchSet(np.zeros((count, 64, 96, 3), np.uint8), labels, np.array(sources), np.arange(count))
    )
    assert weights.sum() == pytest.approx(1.0)
    for label in range(3):
        assert weights[labels == label].sum() == pytest.approx(1 / 3)
    dash = np.array(["camvid" in source or "extreme" in source or source == "rendered" for source in sources])
    assert weights[dash & (labels == 1)].sum() > 0.9 * weights[dash & (labels == 0)].sum()


def test_rendered_seeds_of_the_splits_are_disjoint():
    ranges = list(rendered.SEED_RANGES.values())
    assert all(a.stop <= b.start for a, b in pairwise(ranges))
    assert set(rendered.SEED_RANGES) == {"train", "val", "test"}


def test_what_a_folder_keeps_is_made_once(tmp_path):
    made = []

    def make():
        made.append(len(made))
        return rendered.rendered_patches([[(np.full((64, 96, 3), len(made), np.uint8), 2)]])

    def ask(folder):
        found = keeping.kept_or_made(
            folder, "some.npz", load=rendered.load_patches, make=make, save=rendered.save_patches
        )
        return int(found.patches[0, 0, 0, 0])

    assert [ask(tmp_path / "new"), ask(tmp_path / "new"), ask(None), ask(None)] == [1, 1, 2, 3]
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["some.npz"]


def test_a_file_that_cannot_be_written_leaves_the_one_before(tmp_path):
    def fails(part):
        part.write_bytes(b"half")
        raise OSError("No space left on device")

    file = tmp_path / "kept.npz"
    file.write_bytes(b"whole")
    with pytest.raises(OSError, match="No space"):
        keeping.keep_whole(file, fails)
    assert file.read_bytes() == b"whole"


def test_kept_worlds_come_back_as_they_were(tmp_path):
    rng = np.random.default_rng(2)
    planes = rng.integers(0, 2, (2, 2, 24, 40)).astype(np.uint8)
    samples = [
        segmenter_data.Sample(
            np.full((24, 40, 3), 7 + i, np.uint8),
            planes[i, 0],
            planes[i, 1],
            "rendered",
            2 * i - 1,
            "rendered",
        )
        for i in range(2)
    ]
    cut = rendered.rendered_patches(
        [[(np.full((64, 96, 3), 9, np.uint8), 2)], [(np.zeros((64, 96, 3), np.uint8), 0)]]
    )
    rendered.save_worlds(tmp_path / "kept" / "test-2.npz", (samples, cut))
    kept, kept_cut = rendered.load_worlds(tmp_path / "kept" / "test-2.npz")
    for sample, again in zip(samples, kept, strict=True):
        assert all(
            (getattr(sample, name) == getattr(again, name)).all() for name in ("image", "drivable", "shadow")
        )
        assert (sample.surface, sample.source) == (again.surface, again.source)
    assert kept_cut.labels.tolist() == [2, 0]
    assert (kept_cut.patches == cut.patches).all()
    assert kept_cut.sources.tolist() == ["rendered", "rendered"]
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["test-2.npz"]


def test_kept_patches_come_back_as_they_were(tmp_path):
    cut = patches.patch_set([([np.full((64, 96, 3), 9, np.uint8)], 2, "rendered")])
    rendered.save_patches(tmp_path / "kept.npz", cut)
    kept = rendered.load_patches(tmp_path / "kept.npz")
    assert (kept.patches == cut.patches).all()
    assert (kept.labels.tolist(), kept.sources.tolist()) == ([2], ["rendered"])


def test_regions_of_a_driving_car_are_cut_on_the_road_and_repeat():
    seed = rendered.SEED_RANGES["train"].stop - 1
    (first, *_), (again, *_) = (list(rendered.world_views(seed, 0.25)) for _ in range(2))
    cut = rendered.driven_patches(first, 4)
    assert len(cut) == 4
    assert {label for _, label in cut} <= set(first.frame.surface[first.frame.drivable].tolist())
    for (patch, label), (same, same_label) in zip(cut, rendered.driven_patches(again, 4), strict=True):
        assert patch.shape == (64, 96, 3)
        assert (patch == same).all()
        assert label == same_label


def test_worlds_in_streets_are_those_of_open_land_but_for_their_light():
    """About three in ten lie between houses: they show the same road in another light, all others the same picture."""
    changed, count = 0, 16
    for seed in range(rendered.SEED_RANGES["train"].start, rendered.SEED_RANGES["train"].start + count):
        land, street = (
            next(rendered.world_views(seed, 0.06, streets=share))
            for share in (rendered.OPEN_LAND, rendered.STREETS)
        )
        assert (land.frame.surface == street.frame.surface).all()
        changed += not np.array_equal(land.frame.image, street.frame.image)
    low, high = binom.interval(0.99, count, rendered.STREETS)
    assert 1 <= low <= changed <= high


def test_shared_sequence_is_refused(tmp_path):
    picture = np.zeros((20, 20, 3), np.uint8)
    rows = [row("a/0.png", "train", "dry", sequence="one"), row("a/1.png", "test", "dry", sequence="one")]
    folder = write_folder(tmp_path, rows, {"a/0.png": picture, "a/1.png": picture})
    with pytest.raises(data.DataFolderError, match="sequence 'one' is in the splits test, train"):
        data.read_manifest(folder)


def test_all_problems_of_a_manifest_are_told_at_once(tmp_path):
    rows = [row("gone.png", "train", "dry"), row("gone.png", "training", "icy")]
    with pytest.raises(data.DataFolderError) as failure:
        data.read_manifest(write_folder(tmp_path, rows, {}))
    text = str(failure.value)
    assert "line 2: file gone.png" in text
    assert "line 3: split is 'training'" in text
    assert "line 3: label is 'icy'" in text


def test_lacking_classes_are_named(tmp_path):
    folder = write_folder(tmp_path, [row("a.png", "train", "dry")], {"a.png": np.zeros((9, 9, 3), np.uint8)})
    with pytest.raises(data.DataFolderError) as failure:
        data.check_trainable(data.read_manifest(folder))
    for part in ("train holds no picture labelled wet", "val holds no picture labelled dry", "road mask"):
        assert part in str(failure.value)


def test_of_pictures_of_ones_own_the_road_is_found_and_masks_are_for_the_segmenter_alone(tmp_path):
    names = [f"mine/{label}_{split}.png" for label in data.LABELS for split in ("train", "val")]
    rows = [row(n, n[:-4].rpartition("_")[2], n[5:-4].rpartition("_")[0], size=(320, 240)) for n in names]
    shown = np.full((240, 320, 3), 90, np.uint8)
    pictures = data.read_manifest(write_folder(tmp_path, rows, dict.fromkeys(names, shown)))
    data.check_trainable(pictures, masks=False)
    with pytest.raises(data.DataFolderError, match="--only surface needs none"):
        data.check_trainable(pictures)
    with pytest.raises(data.DataFolderError, match="no road box is known for source 'mine'"):
        patches.fixed_patches(pictures[0])
    found = with_found_roads(pictures, LowerHalf())
    assert all(road.mean() == 0.5 for road in (picture.road() for picture in found))
    assert len(patches.judged_patches(found)) > 0
    masked = replace(pictures[0], mask=tmp_path / "mask.png")
    assert not masked.road_is_found


def test_a_card_of_ones_own_pictures_says_nothing_of_the_packages(tmp_path, monkeypatch):
    monkeypatch.setattr(cards, "PACKAGES", ())
    told = []
    for folder in ("mine", "condition_web/a"):
        name = f"{folder}/a.png"
        made = write_folder(
            tmp_path / folder[0], [row(name, "train", "dry")], {name: np.zeros((9, 9, 3), np.uint8)}
        )
        facts = cards.RunFacts("", 1, data.read_manifest(made), {"train": 3}, {"train": "from 1"}, 1.0, 2)
        told.append((facts.own, "other_cameras" in cards.splits_text(facts)))
    assert told == [(True, False), (False, True)]


def test_pictures_of_ones_own_need_no_share(tmp_path, monkeypatch):
    monkeypatch.setitem(data.ROAD_BOXES, "mine", ((0.2, 0.5, 0.8, 0.9),))
    picture = np.full((240, 320, 3), 90, np.uint8)
    (mine,) = data.read_manifest(
        write_folder(tmp_path, [row("mine/a.png", "train", "dry")], {"mine/a.png": picture})
    )
    cut = patches.training_patches([mine], seed=0)
    assert patches.draw_weights(cut).sum() == pytest.approx(1.0)


def test_command_needs_the_training_extra_or_a_manifest(tmp_path, capsys):
    assert main(["--data", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    if importlib.util.find_spec("torch") is None:
        assert "trpac-fmu[all,train]" in told
    else:
        assert "manifest.csv: not found" in told


@settings(max_examples=30, deadline=None)
@given(st.floats(0.3, 6.0), st.integers(0, 1000))
def test_temperature_is_found_again(true_temperature, seed):
    """Labels drawn from softmax(logits / T) lead back to T within the sampling error."""
    rng = np.random.default_rng(seed)
    logits = rng.normal(0, 3, (6000, 3)) * true_temperature / 2
    chances = calibrated_probabilities(logits, true_temperature).cumsum(axis=1)
    labels = (rng.random((6000, 1)) > chances).sum(axis=1).clip(0, 2)
    found = calibrate.learn_temperature(logits, labels)
    assert found == pytest.approx(true_temperature, rel=0.12)
    assert calibrate.cross_entropy(logits, labels, found) <= calibrate.cross_entropy(logits, labels) + 1e-9


def test_calibration_errors_by_hand():
    """Ten samples at confidence 0.9, six right: the gap is 0.3 in the only filled bin."""
    logits = np.tile(np.log([0.9, 0.05, 0.05]), (10, 1))
    curve = calibrate.reliability(logits, np.array([0] * 6 + [1] * 4))
    assert curve.ece == pytest.approx(0.3)
    assert curve.mce == pytest.approx(0.3)
    assert curve.count.tolist() == [0] * 13 + [10, 0]


def test_wilson_interval_from_the_literature():
    """Newcombe (1998), table I: 81 of 263 gives 0.2553 to 0.3662; 0 of 20 gives 0 to 0.1611."""
    assert scores.wilson_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert scores.wilson_interval(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)


def test_picture_score_counts_pictures_not_patches():
    logits = np.array([[4.0, 0, 0], [0, 1.0, 0], [0, 0, 3.0]])
    part = patches.PatchSet(
        np.zeros((3, 64, 96, 3), np.uint8), np.array([0, 0, 1]), np.array(["a"] * 3), np.array([0, 0, 1])
    )
    assert scores.by_picture(logits, part, 1.0).confusion.tolist() == [[1, 0, 0], [0, 0, 1], [0, 0, 0]]
    assert scores.by_patch(logits, part).confusion.tolist() == [[1, 1, 0], [0, 0, 1], [0, 0, 0]]


def test_disturbed_patches_repeat_and_differ():
    plain = np.random.default_rng(1).integers(0, 255, (6, 64, 96, 3)).astype(np.uint8)
    first, again, other = (calibrate.noised(plain, seed) for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()
    assert all((first[i] != plain[i]).any() for i in range(6))


@pytest.mark.data
def test_real_folder_is_split_by_source():
    folder = os.environ.get("TRPAC_DATA")
    if not folder:
        pytest.skip("TRPAC_DATA is not set: no real pictures to check")
    pictures = data.read_manifest(Path(folder) / "road_images")
    data.check_trainable(pictures)
    sources = {split: {p.sequence for p in data.of_split(pictures, split)} for split in data.SPLITS}
    assert not sources["test"] & (sources["train"] | sources["val"])
    shared = sources["train"] & sources["val"]
    assert shared == sources["gap"]
    assert all(p.split == "test" for p in pictures if p.source.startswith("other_cameras"))
