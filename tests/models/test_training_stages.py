"""What the classifiers' training does in torch: looks drawn anew, a pretrained trunk, nets kept in files."""

import argparse
from contextlib import contextmanager

import numpy as np
import pytest

from models.training import augment

torch = pytest.importorskip("torch", reason="the training extra is not installed")

from models.training import looks, nets, surface_run, train_surface, trunk  # noqa: E402


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
    """Not its first part: what sees some of a batch must see looks of both kinds, in their shares."""
    monkeypatch.setattr(looks, "COARSE_SCALES", (0.3, 0.6))
    noise = 255.0 * torch.rand(256, 3, 64, 96, generator=generator(3))
    coarse = (looks._coarsened(generator(4), noise) != noise).flatten(1).any(dim=1)
    assert coarse.float().mean() == pytest.approx(looks.COARSE_SHARE, abs=1 / 256)
    assert coarse[:96].float().mean() == pytest.approx(looks.COARSE_SHARE, abs=0.15)


@pytest.mark.parametrize(
    ("kind", "shapes"),
    [
        (trunk.LITE0, [(40, 8, 12), (80, 4, 6), (112, 4, 6)]),
        (trunk.LITE2, [(48, 8, 12), (88, 4, 6), (120, 4, 6)]),
    ],
    ids=["lite0", "lite2"],
)
def test_a_trunk_is_that_of_its_package(kind, shapes):
    """Its last maps are those that the whole network computes on its way, from the same picture in its own scale."""
    whole = trunk.EfficientNet.from_pretrained(kind.name, weights_path=str(kind.weights)).eval()
    seen = []
    whole._blocks[kind.blocks - 1].register_forward_hook(lambda *parts: seen.append(parts[2]))
    patches = torch.randint(0, 256, (2, 64, 96, 3), dtype=torch.uint8, generator=generator(5))
    rgb = patches.flip(3).permute(0, 3, 1, 2).float()
    with torch.no_grad():
        whole((rgb - 127.0) / 128.0)
        read = trunk.Trunk(kind, pretrained=True).eval()(patches)
    assert torch.allclose(read[-1], seen[0], atol=1e-5)
    assert [tuple(maps.shape[1:]) for maps in read] == shapes


def test_a_net_of_several_towers_has_the_weighted_mean_of_their_logits():
    nets_of_one = [train_surface.new_net(seed, kind).eval() for seed, kind in enumerate(surface_run.TOWERS)]
    patches = torch.randint(0, 256, (5, 64, 96, 3), dtype=torch.uint8, generator=generator(8))
    for net in nets_of_one:
        net.norm.running_mean = torch.randn(net.embedding, generator=generator(net.embedding))
        net.norm.running_var = torch.rand(net.embedding, generator=generator(net.embedding)) + 0.5
    with torch.no_grad():
        apart = [net.classifier(net.embed(patches)) for net in nets_of_one]
        net = nets.together(nets_of_one, (3.0, 1.0))
        logits = net.classifier(net.embed(patches))
    assert not net.training
    assert torch.allclose(logits, 0.75 * apart[0] + 0.25 * apart[1], atol=1e-4)
    assert (apart[0] - apart[1]).abs().max() > 0.1
    assert [tower.trunk.kind for tower in net.towers] == list(surface_run.TOWERS)


def test_the_mean_of_nets_has_the_means_of_their_weights_and_statistics():
    alike = [train_surface.new_net(seed).eval() for seed in range(2)]
    for net, part in zip(alike, (1.0, 3.0), strict=True):
        net.norm.running_var = torch.full_like(net.norm.running_var, part)
        net.norm.num_batches_tracked = torch.tensor(12)
    before = [{name: value.clone() for name, value in net.state_dict().items()} for net in alike]
    mean = nets.mean_of(alike)
    assert not mean.training
    for name, value in mean.state_dict().items():
        middle = (before[0][name].double() + before[1][name].double()) / 2
        assert torch.allclose(value.double(), middle, atol=1e-7), name
        assert value.dtype == before[0][name].dtype
    assert (mean.norm.running_var == 2.0).all()
    assert mean.norm.num_batches_tracked == 12
    assert not torch.equal(before[0]["classifier.weight"], before[1]["classifier.weight"])
    for net, kept in zip(alike, before, strict=True):
        assert all(torch.equal(value, kept[name]) for name, value in net.state_dict().items())


def test_each_tower_is_the_mean_of_a_training_per_sort_of_worlds(tmp_path, monkeypatch):
    """All begin alike; the patches of a sort are cut once for all towers; Lite0 sees streets in mixed styles, too."""
    given = argparse.Namespace(kept=tmp_path, seed=5, effort=1.0, device="cpu", threads=1, without=())
    seen, drawn = [], []

    def learned(net, patches, *, seed, steps, **others):
        [tower] = net.towers
        styled = isinstance(tower.trunk.style, trunk.MixedStyle)
        seen.append((tower.trunk.kind, styled, patches, seed, steps))
        torch.nn.init.constant_(net.classifier.bias, float(len(patches)))
        return net.eval()

    @contextmanager
    def steps(what, count):
        yield None

    def worlds(count):
        def draw():
            drawn.append(count)
            return range(count)

        return draw

    monkeypatch.setattr(surface_run, "learn_classes", learned)
    monkeypatch.setattr(surface_run, "joined", lambda parts: parts[-1])
    monkeypatch.setattr(surface_run, "_cuts", lambda given, pictures: ["real"])
    sorts = {surface_run.IN_OPEN_LAND: worlds(9), surface_run.IN_STREETS: worlds(5)}
    stage = surface_run._classes(given, [], sorts, steps)
    plain = [(kind, False) for kind in (trunk.LITE0, trunk.LITE2)]
    assert seen == [
        *((*each, range(9), 5, surface_run.CLASS_STEPS) for each in plain),
        *((*each, range(5), 5, surface_run.CLASS_STEPS) for each in [*plain, (trunk.LITE0, True)]),
    ]
    assert drawn == [9, 5], "the patches were cut more than once"
    assert len(list(tmp_path.iterdir())) == len(seen), "trainings are kept in one file"
    assert [tower.trunk.kind for tower in stage.net.towers] == list(surface_run.TOWERS)
    assert (stage.patches, stage.steps) == (9, 5 * surface_run.CLASS_STEPS)
    assert stage.says == tuple(surface_run.TOWERS.values())
    assert torch.allclose(stage.net.classifier.bias, torch.tensor((2 * 19 / 3 + 7) / 3))
    assert not any(isinstance(part, trunk.MixedStyle) for part in stage.net.modules())
    begun = train_surface.new_net(5).towers[0].state_dict()
    for name, value in stage.net.towers[0].state_dict().items():
        assert torch.allclose(value, begun[name], atol=1e-7), name


@pytest.mark.parametrize(("kernel", "stride"), [(5, 1), (3, 2)])
def test_a_depthwise_convolution_keeps_32_bits_in_half_precision(kernel, stride):
    """As without half precision, but for one rounding of what comes out; weights learn from exact gradients."""
    torch.manual_seed(9)
    conv = trunk.Depthwise(6, 6, kernel, stride, kernel // 2, groups=6, bias=False)
    maps = torch.randn(4, 6, 8, 12, generator=generator(9)).bfloat16()
    exact = torch.nn.Conv2d.forward(conv, maps.float())
    (expected,) = torch.autograd.grad(exact.sum(), conv.weight)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        out = conv(maps)
    (found,) = torch.autograd.grad(out.float().sum(), conv.weight)
    assert out.dtype == torch.bfloat16
    assert torch.equal(out, exact.bfloat16())
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-5)


def of_channels(maps):
    """Means and deviations of the channels, shape (n, 2 c), and the maps without them."""
    flat = maps.double().flatten(2)
    mean, deviation = flat.mean(2, keepdim=True), flat.std(2, keepdim=True)
    return torch.cat((mean, deviation), 1)[..., 0], (flat - mean) / deviation


def test_a_style_is_that_of_two_pictures_and_what_they_show_stays():
    torch.manual_seed(4)
    count = 200
    maps = torch.randn(count, 5, 8, 12) * torch.rand(count, 5, 1, 1).add(0.5) + torch.randn(count, 5, 1, 1)
    before, shown = of_channels(maps)
    styled, still_shown = of_channels(trunk.MixedStyle().train()(maps))
    assert torch.allclose(still_shown, shown, atol=1e-3)
    moved = styled - before
    changed = moved.norm(dim=1) > 1e-2
    assert 0.3 < changed.double().mean() < 0.6, "half of them, and some of these hardly"
    others = before[None] - before[:, None]
    parts = torch.einsum("ik,ijk->ij", moved, others) / others.square().sum(2).clamp(min=1e-9)
    off_line = (moved[:, None] - parts[..., None] * others).norm(dim=2) + (
        parts - parts.clamp(0.0, 1.0)
    ).abs()
    closest = off_line.min(1)
    assert closest.values[changed].max() < 1e-3
    part = parts.gather(1, closest.indices[:, None])[changed]
    assert ((part > 0.1) & (part < 0.9)).double().mean() < 0.5, "mostly one picture's or the other's"


def test_a_style_is_left_alone_at_rest():
    maps = torch.randn(6, 5, 8, 12, generator=generator(4))
    assert trunk.MixedStyle().eval()(maps) is maps


def test_what_a_classifier_reads_first_has_a_mixed_style(monkeypatch):
    """In training; at rest the same net reads the pretrained maps."""
    seen = train_surface.new_net(1, styled=True).towers[0].trunk
    patches = torch.randint(0, 256, (2, 64, 96, 3), dtype=torch.uint8, generator=generator(6))
    patches[1] //= 4
    plain = [each.detach() for each in seen.eval()(patches)]
    monkeypatch.setattr(trunk.MixedStyle, "SHARE", 1.0)
    monkeypatch.setattr(trunk.MixedStyle, "SPREAD", 100.0)
    torch.manual_seed(1)
    first = seen.train()(patches)[0]
    assert not torch.allclose(first, plain[0], atol=1e-2)
    torch.manual_seed(1)
    assert torch.equal(first, trunk.MixedStyle().train()(plain[0]))
    assert torch.equal(train_surface.new_net(1).towers[0].trunk.train()(patches)[0], plain[0])


def test_training_leaves_the_first_blocks_and_their_statistics_as_they_are():
    net = nets.SurfaceNet([trunk.LITE0], pretrained=True)
    seen = net.towers[0].trunk
    before = {name: value.clone() for name, value in seen.state_dict().items()}
    patches = torch.randint(0, 256, (8, 64, 96, 3), dtype=torch.uint8, generator=generator(6))
    optimiser = torch.optim.SGD([p for p in net.parameters() if p.requires_grad], lr=0.1)
    torch.nn.functional.cross_entropy(
        net.train().classifier(net.embed(patches)), torch.arange(8) % 3
    ).backward()
    optimiser.step()
    changed = {name for name, value in seen.state_dict().items() if not torch.equal(value, before[name])}
    blocks = {int(name.split(".")[1]) for name in changed if name.startswith("blocks.")}
    assert blocks == set(range(5, 11))
    assert not any(name.startswith("stem.") for name in changed)


def test_a_net_comes_back_from_its_file_and_is_not_trained_again(tmp_path, monkeypatch):
    given = argparse.Namespace(
        kept=tmp_path / "kept",
        seed=3,
        device="cpu",
        threads=2,
        without=("seq_extreme",),
    )
    monkeypatch.setattr(surface_run, "learn_classes", lambda net, patches, **others: net.eval())

    @contextmanager
    def steps(what, count):
        yield None

    def stage(patches):
        return surface_run.kept_stage(
            given, "classes", steps, count=40, what="net", patches=patches, kind=trunk.LITE0
        )

    def never():
        raise AssertionError("trained again")

    made, again = stage(lambda: range(1200)), stage(never)
    assert again.told() == made.told()
    assert made.told().startswith("40 steps of 256 on 1200 patches, ")
    for name, value in made.net.state_dict().items():
        assert torch.equal(again.net.state_dict()[name], value)
    given.without = ()
    with pytest.raises(AssertionError, match="trained again"):
        stage(never)


def test_a_short_training_forgets_what_it_began_from():
    """The running average of 300 equal steps from 1 to 0: with a fixed decay more than half of the 1 would be left."""
    average = [torch.ones(3)]
    for step in range(1, 301):
        train_surface._running_average(average, [torch.zeros(3)], step)
    assert average[0].max() < 1e-6
    counts = [torch.tensor(4)]
    train_surface._running_average(counts, [torch.tensor(9)], 1)
    assert counts[0] == 9, "counters are no mean"


def test_the_classes_are_learned_and_the_net_is_ready_to_be_judged(monkeypatch):
    """A few steps on patches whose class is their brightness: the loss falls, the net is ready to be judged."""
    from models.training import patches

    monkeypatch.setattr(train_surface, "BATCH", 12)
    rng = np.random.default_rng(0)
    shades = [list(rng.integers(low, low + 30, (6, 64, 96, 3), np.uint8)) for low in (20, 110, 200)]
    made = patches.patch_set((cut, label, "rendered") for label, cut in enumerate(shades))
    losses = []
    net = train_surface.learn_classes(
        train_surface.new_net(1),
        made,
        steps=12,
        seed=1,
        device=torch.device("cpu"),
        report=lambda step, loss: losses.append(loss),
    )
    assert len(losses) == 12
    assert losses[10] < 0.8 * losses[0]
    assert not net.training
    assert train_surface.verdicts_of(net, made.patches)[0].shape == (18, 3)
