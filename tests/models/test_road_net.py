"""The road network's training: views and their labels, what the surface is read from, sources left out, the file."""

import numpy as np
import pytest
from training_folder import row, write_folder

from models.training import augment, data, segmenter_data
from models.training.segmenter_data import Sample
from trpac_core.vision.classes import Surface

torch = pytest.importorskip("torch", reason="the training extra is not installed")

from scipy.special import log_softmax, softmax  # noqa: E402

from models.training import left_out, nets, road_run, train_segmenter  # noqa: E402
from models.training.export import export_segmenter  # noqa: E402
from trpac_core.vision.networks import Segmenter  # noqa: E402

GREY = 110


def road_sample(kind="masked", surface=Surface.DRY, source="drivable_camvid/a"):
    image = np.full((160, 256, 3), 200, np.uint8)
    image[80:] = GREY
    drivable = np.zeros((160, 256), np.uint8)
    drivable[80:] = 1
    return Sample(
        image, drivable, np.where(drivable == 1, 0, data.IGNORE).astype(np.uint8), kind, int(surface), source
    )


@pytest.fixture
def net():
    torch.manual_seed(3)
    return nets.RoadNet().eval()


def test_a_bonnet_is_no_road_and_hides_only_the_lower_part():
    for seed in range(30):
        sample = road_sample()
        seen = segmenter_data.over_a_bonnet(np.random.default_rng(seed), sample)
        _, hidden = augment.bonnet(np.random.default_rng(seed), sample.image)
        assert hidden[-1].any()
        assert not hidden[:90].any()
        assert (seen.drivable[hidden] == 0).all()
        assert (seen.drivable[~hidden] == sample.drivable[~hidden]).all()
        assert (seen.image[:90] == sample.image[:90]).all()
        assert (seen.shadow[hidden] == data.IGNORE).all()


def test_a_view_by_night_is_dark_and_keeps_road_and_class():
    sample = road_sample(surface=Surface.WET)
    night = segmenter_data.night_view(np.random.default_rng(4), sample)
    assert night.image.mean() < 0.6 * sample.image.mean()
    assert night.source == "night/drivable_camvid/a"
    assert (night.kind, night.surface) == ("night", int(Surface.WET))
    assert (night.shadow == data.IGNORE).all()
    edge = np.flatnonzero((night.drivable == 1).any(axis=1))[0]
    assert (night.drivable[edge + 2 :] == 1).all()


def test_views_of_a_kind_are_as_many_as_told():
    samples = [road_sample("masked"), road_sample("campus"), road_sample("rendered")]
    kinds = [view.kind for view in segmenter_data.training_views(samples, seed=2)]
    assert kinds.count("masked") == segmenter_data.VIEWS["masked"] + 1
    assert kinds.count("night") == 2, "rendered worlds have drawn their light already"
    assert all(view.image.shape == (160, 256, 3) for view in segmenter_data.training_views(samples, seed=2))


def test_of_a_street_picture_without_mask_the_sky_alone_is_known(tmp_path):
    rows = [row("street_conditions/dry/cws8262_a.png", "train", "dry")]
    folder = write_folder(tmp_path, rows, {rows[0]["file"]: np.full((100, 120, 3), 90, np.uint8)})
    (picture,) = data.read_manifest(folder)
    sample = segmenter_data.sample_of(picture)
    assert (sample.drivable[:30] == 0).all()
    assert (sample.drivable[30:] == data.IGNORE).all()
    assert segmenter_data.training_views([sample], seed=1)[-1].kind == "street", (
        "no road, no night, no bonnet"
    )


def test_the_surface_is_read_on_the_road_and_beside_it(net):
    """Maps of two values, one where the road is: its mean, no deviation, and the other value beside."""
    drivable = torch.full((1, 40, 64), -20.0)
    drivable[:, 20:] = 20.0
    maps = []
    for channels, (rows, columns) in zip(
        nets.AT_REST.channels, ((40, 64), (20, 32), (10, 16), (10, 16)), strict=True
    ):
        each = torch.full((1, channels, rows, columns), 2.0)
        each[:, :, rows // 2 :] = 5.0
        maps.append(each)
    pooled = net.pooled(maps, drivable)[0].split(
        [c for channels in nets.AT_REST.channels[1:] for c in [channels] * 3]
    )
    for mean, deviation, around in zip(pooled[::3], pooled[1::3], pooled[2::3], strict=True):
        assert torch.allclose(mean, torch.tensor(5.0), atol=1e-4)
        assert deviation.max() < 0.02
        assert torch.allclose(around, torch.tensor(2.0), atol=1e-4)


def test_without_road_the_lower_centre_stands_for_it(net):
    maps = [
        torch.zeros(1, c, *s)
        for c, s in zip(nets.AT_REST.channels, ((40, 64), (20, 32), (10, 16), (10, 16)), strict=True)
    ]
    for each in maps:
        each[:, :, int(0.7 * each.shape[2]) :, each.shape[3] // 2] = 1.0
    pooled = net.pooled(maps, torch.full((1, 40, 64), -60.0))
    assert torch.isfinite(pooled).all()
    assert pooled[0, 0] > 0.01


def test_the_file_computes_what_was_trained_and_the_estimator_reads_it(net, tmp_path):
    export_segmenter(net, tmp_path / "segmenter.onnx")
    image = np.random.default_rng(0).integers(0, 256, (160, 256, 3)).astype(np.uint8)
    masks = Segmenter(tmp_path / "segmenter.onnx", 1).segment(image)
    with torch.no_grad():
        drivable, shadow, surface = net(torch.from_numpy(image)[None])
    assert masks.drivable == pytest.approx(torch.sigmoid(drivable)[0].numpy(), abs=0.02)
    assert masks.shadow == pytest.approx(torch.sigmoid(shadow)[0].numpy(), abs=0.02)
    assert masks.surface == pytest.approx(surface[0].double().numpy(), abs=0.02)
    assert (tmp_path / "segmenter.onnx").stat().st_size < 3e6, "weights are kept in half precision"


def test_an_encoder_sees_what_the_trunk_sees(net):
    samples = [road_sample(), segmenter_data.night_view(np.random.default_rng(1), road_sample())]
    seen = train_segmenter.Encoder(net, 1)(samples, lambda done, _: None)
    images = torch.from_numpy(np.stack([sample.image for sample in samples]))
    with torch.no_grad():
        maps = net.trunk(images)
    for found, true in zip(seen.maps, maps, strict=True):
        assert found == pytest.approx(true.numpy(), rel=0.02, abs=0.05)
    assert len(seen.where(np.array([False, True])).views) == 1


def test_masks_are_learned_from_views(monkeypatch):
    """A few steps tell the lower half from the upper one."""
    monkeypatch.setattr(train_segmenter, "BATCH", 4)
    torch.manual_seed(3)
    net = nets.RoadNet(pretrained=True).eval()
    samples = [road_sample() for _ in range(4)]
    before = train_segmenter.score_segmenter(net, samples, "drivable").iou
    seen = train_segmenter.Encoder(net, 1)(samples, lambda done, _: None)
    trunk = [each.clone() for each in net.trunk.state_dict().values()]
    train_segmenter.learn_masks(net, seen, steps=60, seed=1, report=lambda step, loss: None)
    assert not net.training
    assert train_segmenter.score_segmenter(net, samples, "drivable").iou > max(0.95, before)
    for old, new in zip(trunk, net.trunk.state_dict().values(), strict=True):
        assert torch.equal(old, new), "the trunk is at rest"


def classes_of(count, rng):
    """Features of which two tell the class, of three sources; labels; sources."""
    labels = rng.integers(0, 3, count)
    features = rng.normal(0.0, 1.0, (count, 6))
    features[:, 0] += 3.0 * (labels == 1)
    features[:, 1] += 3.0 * (labels == 2)
    return (
        features.astype(np.float32),
        labels,
        rng.choice(["cws8262", "condition_web", "night/cws8262"], count),
    )


def test_a_head_learns_what_tells_the_class_and_ships_in_the_net(net):
    rng = np.random.default_rng(2)
    features, labels, sources = classes_of(600, rng)
    head = train_segmenter.learn_surface(features, labels, sources)
    assert np.mean(head.logits(features).argmax(axis=1) == labels) > 0.85
    assert head.times(2.0).logits(features) == pytest.approx(2.0 * head.logits(features))
    wide = np.zeros((600, net.features), np.float32)
    wide[:, :6] = features
    head = train_segmenter.learn_surface(wide, labels, sources)
    head.into(net)
    with torch.no_grad():
        found = net.classes(torch.from_numpy(wide)).numpy()
    assert found == pytest.approx(head.logits(wide), abs=1e-3)


def test_classes_count_alike_and_families_by_their_shares():
    labels = np.array([0] * 6 + [1] * 2)
    sources = np.array(["cws8262"] * 3 + ["night/cws8262"] + ["bdd_day"] * 2 + ["cws8262", "other_cameras/x"])
    weights = train_segmenter.surface_weights(labels, sources)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[:6].sum() == pytest.approx(0.5)
    assert weights[:3].sum() == pytest.approx(weights[3])
    assert weights[:3].sum() == pytest.approx(1.5 * weights[4:6].sum())
    assert weights[6] == pytest.approx(3.0 * weights[7])


def test_the_scale_makes_probabilities_true():
    rng = np.random.default_rng(5)
    logits = rng.normal(0.0, 1.5, (4000, 3))
    labels = np.array([rng.choice(3, p=p) for p in softmax(0.6 * logits, axis=1)])
    assert road_run.scale_of(logits, labels, np.full(4000, "one")) == pytest.approx(0.6, abs=0.06)


def test_the_flag_is_as_high_as_the_worst_source_needs():
    """One source whose surest is wrong, one that is always right."""
    logs = log_softmax(np.linspace(0.1, 6.0, 100)[:, None] * np.array([1.0, 0.0, 0.0]), axis=1)
    right = left_out.Verdicts(np.zeros(100, np.int64), logs)
    some = right.labels.copy()
    some[:10] = 1
    half = left_out.Verdicts(some, logs)
    assert left_out.flag_threshold([right]) == pytest.approx(right.confidence.min())
    least = left_out.flag_threshold([right, half])
    sure = half.confidence >= least
    assert np.mean(~half.right[sure]) <= left_out.FLAG_ERROR
    assert 85 <= sure.sum() <= 92
    wrong = left_out.Verdicts(np.ones(100, np.int64), logs)
    assert left_out.flag_threshold([right, wrong]) == 1.0
