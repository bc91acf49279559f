"""What the classifiers' training does in torch: looks drawn anew, the teacher's layers, stages kept in files."""

import argparse

import numpy as np
import pytest

from models.training import augment

torch = pytest.importorskip("torch", reason="the training extra is not installed")

from models.training import looks, surface_run, teacher, train_surface  # noqa: E402


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def test_looks_of_a_camera_without_spread_keep_an_even_patch():
    """An even patch shows neither move nor resolution: only gain, gamma and white balance could change it."""
    even = torch.full((32, 64, 96, 3), 90, dtype=torch.uint8)
    assert torch.equal(looks.seen_anew(generator(), even, torch.zeros(32)), even)
    changed = looks.seen_anew(generator(), even, torch.full((32,), 0.4))
    assert changed.shape == even.shape
    assert changed.float().std(dim=0).max() > 5.0, "patches of one batch have cameras of their own"
    assert torch.equal(changed, looks.seen_anew(generator(), even, torch.full((32,), 0.4)))


def test_looks_have_the_spread_of_the_single_pictures_look():
    """The same grey through the batch's and the single picture's cameras: mean and deviation of the grey levels."""
    grey, spread, count = 120, 0.3, 4000
    batch = looks.seen_anew(
        generator(1), torch.full((count, 4, 6, 3), grey, dtype=torch.uint8), torch.full((count,), spread)
    )
    rng = np.random.default_rng(1)
    single = [augment.camera_look(rng, np.full((1, 1, 3), grey, np.uint8), spread) for _ in range(count)]
    one, other = batch[:, 0, 0].double().numpy(), np.array(single)[:, 0, 0].astype(float)
    error = 4.0 * other.std(axis=0) / np.sqrt(count)
    assert (np.abs(one.mean(axis=0) - other.mean(axis=0)) < 1.5 * error).all()
    assert one.std(axis=0) == pytest.approx(other.std(axis=0), rel=0.08)


def test_looks_are_mirrored_half_of_the_time_and_move_within_their_limits(monkeypatch):
    monkeypatch.setattr(looks, "COARSE_SHARE", 0.0)
    edge = torch.zeros((400, 64, 96, 3), dtype=torch.uint8)
    edge[:, :, 48:] = 200
    seen = looks.seen_anew(generator(2), edge, torch.zeros(400)).float()[:, 32, :, 0]
    brighter_left = seen[:, 8] > seen[:, 88]
    assert 0.4 < brighter_left.float().mean() < 0.6
    border = (seen > 100).float().sum(dim=1)
    assert (border - 48).abs().max() <= looks.SHIFT_PX[0] * np.exp(looks.ZOOM) + 1
    assert (border - 48).abs().max() >= looks.SHIFT_PX[0] - 2, "shifts are not drawn from their whole range"


def test_coarse_looks_lie_anywhere_in_a_batch(monkeypatch):
    """A teacher that sees the first 96 of 256 must see looks of both kinds, in their shares."""
    monkeypatch.setattr(looks, "COARSE_SCALES", (0.3, 0.6))
    noise = 255.0 * torch.rand(256, 3, 64, 96, generator=generator(3))
    coarse = (looks._coarsened(generator(4), noise) != noise).flatten(1).any(dim=1)
    assert coarse.float().mean() == pytest.approx(looks.COARSE_SHARE, abs=1 / 256)
    assert coarse[:96].float().mean() == pytest.approx(looks.COARSE_SHARE, abs=0.15)


def layer(**changes):
    fields = {
        "inputs": (0,),
        "output": 1,
        "weights": "",
        "stride": 1,
        "groups": 1,
        "border": (0, 0, 0, 0),
        "limits": (-100.0, 100.0),
    }
    return teacher.Layer(**(fields | changes))


def test_the_teachers_layers_saturate_and_add(monkeypatch):
    """Two layers by hand: a convolution by 2 that saturates at 1.5, and the sum of both tensors."""
    monkeypatch.setattr(teacher, "GLOSS_LAYERS", {1: (224, 3), 2: (224, 3)})
    weight = torch.eye(3).mul(2.0).reshape(3, 3, 1, 1)
    net = teacher.Teacher(
        (layer(weights="twice", limits=(0.0, 1.5)), layer(inputs=(0, 1), output=2)),
        {"twice": weight, "twice_bias": torch.zeros(3)},
        (0, 0.01, 100),
    )
    seen = net.tensors(torch.tensor([50, 150, 200], dtype=torch.uint8).reshape(1, 1, 1, 3).repeat(1, 4, 4, 1))
    rgb = torch.tensor([1.0, 0.5, -0.5])
    doubled = (2.0 * rgb).clamp(0.0, 1.5)
    assert torch.allclose(seen[1][0, :, 7, 9], doubled, atol=1e-5)
    assert torch.allclose(seen[2][0, :, 7, 9], rgb + doubled, atol=1e-5)


@pytest.mark.parametrize(
    ("kind", "before", "after", "kernel", "stride", "border"),
    [
        ("CONV_2D", 224, 112, 3, 2, (0, 1)),
        ("DEPTHWISE_CONV_2D", 113, 56, 3, 2, (0, 0)),
        ("DEPTHWISE_CONV_2D", 28, 28, 3, 1, (1, 1)),
        ("CONV_2D", 14, 14, 1, 1, (0, 0)),
        ("PAD", 112, 113, 1, 1, (0, 1)),
    ],
)
def test_strides_and_borders_are_read_off_the_shapes(kind, before, after, kernel, stride, border):
    details = {
        0: {"shape": (1, before, before, 24)},
        1: {"shape": (24, kernel, kernel, 24)},
        2: {"shape": (1, after, after, 24), "quantization": (0.5, -128)},
    }
    found = teacher._layer(kind, [0, 1], 2, details)
    assert (found.stride, found.border[:2], found.border[2:]) == (stride, border, border)
    assert found.groups == (24 if kind.startswith("DEPTH") else 1)
    assert found.limits == (0.0, 127.5)


def test_operations_of_another_network_are_refused():
    with pytest.raises(teacher.TeacherError, match=r"operation SOFTMAX .* expected MobileNetV2"):
        teacher._layer("SOFTMAX", [0], 1, {})


def test_a_missing_teacher_is_said_in_one_line(tmp_path):
    with pytest.raises(teacher.TeacherError, match="not found; leave --teacher out"):
        teacher.Teacher.read(tmp_path / "none.tflite")


def test_a_stage_comes_back_from_its_file_and_is_not_trained_again(tmp_path):
    given = argparse.Namespace(kept=tmp_path / "kept", seed=3)
    made = surface_run.Stage(train_surface.new_student(3), 1200, 40, 5.5, "2 processor thread(s)")
    surface_run.kept(given, "classes", ("seq_extreme",), lambda: made)

    def never():
        raise AssertionError("trained again")

    again = surface_run.kept(given, "classes", ("seq_extreme",), never)
    assert again.told() == made.told() == "40 steps on 1200 patches, 6 s on 2 processor thread(s)"
    for name, value in made.taught.parts().state_dict().items():
        assert torch.equal(again.taught.parts().state_dict()[name], value)
    with pytest.raises(AssertionError, match="trained again"):
        surface_run.kept(given, "classes", (), never)


def test_a_short_training_forgets_what_it_began_from():
    """The running average of 300 equal steps from 1 to 0: with a fixed decay more than half of the 1 would be left."""
    average = [torch.ones(3)]
    for step in range(1, 301):
        train_surface._running_average(average, [torch.zeros(3)], step)
    assert average[0].max() < 1e-6
    counts = [torch.tensor(4)]
    train_surface._running_average(counts, [torch.tensor(9)], 1)
    assert counts[0] == 9, "counters are no mean"


def test_both_stages_train_and_come_back_on_the_processor(monkeypatch):
    """A few steps on patches whose class is their brightness: the loss falls, the net is ready to be judged."""
    from models.training import patches

    monkeypatch.setattr(train_surface, "BATCH", 12)
    rng = np.random.default_rng(0)
    shades = [list(rng.integers(low, low + 30, (6, 64, 96, 3), np.uint8)) for low in (20, 110, 200)]
    made = patches.patch_set((cut, label, "rendered") for label, cut in enumerate(shades))
    losses = []
    taught = train_surface.learn_classes(
        train_surface.new_student(1),
        made,
        None,
        steps=12,
        seed=1,
        device=torch.device("cpu"),
        report=lambda step, loss: losses.append(loss),
    )
    assert len(losses) == 12
    assert losses[10] < 0.8 * losses[0]
    assert not taught.net.training
    assert train_surface.verdicts_of(taught.net, made.patches)[0].shape == (18, 3)
