"""The linear head learned anew, and its judgement on sources that were left out."""

import numpy as np
import pytest

from models.training import cards, head, left_out
from models.training.data import Picture
from models.training.head import Embedded, Linear
from models.training.patches import PatchSet
from models.training.scene_set import SceneSet
from trpac_core.vision.classes import Surface
from trpac_core.vision.networks import SurfaceClassifier
from trpac_core.vision.scene import NUMBERS, scene_numbers

WIDTH = 6
FAMILIES = [families[0] for families in left_out.SOURCES.values()]


def embedded(seed=0, count=840, noise=0.5):
    """Classes around three corners, from all sources by turns; four patches a picture."""
    rng = np.random.default_rng(seed)
    pictures = np.repeat(np.arange(count // 4), 4)
    labels = pictures % 3
    sources = np.array([FAMILIES[n // 3 % len(FAMILIES)] for n in pictures])
    corners = 2.0 * np.eye(3, WIDTH)[labels]
    seen = (corners + rng.normal(0.0, noise, (count, WIDTH))).astype(np.float32)
    numbers = rng.normal(0.0, 1.0, (count, len(NUMBERS)))
    return Embedded(seen, np.ones(count), numbers, labels, sources, pictures)


def blank():
    return Linear(np.zeros((WIDTH, 3)), np.zeros(3))


def accuracy(seen, found):
    return np.mean(head.logits_of(seen, found).argmax(axis=1) == seen.labels)


class OneTower:
    head = blank()


def test_a_head_learns_the_classes_and_a_ridge_draws_it_to_the_one_before(monkeypatch):
    train, other = embedded(0), embedded(1)
    monkeypatch.setattr(head, "RIDGE", 1e-3)
    free = head.learn(train, blank())
    assert accuracy(other, free) > 0.97
    monkeypatch.setattr(head, "RIDGE", 1e6)
    before = Linear(np.random.default_rng(2).normal(size=(WIDTH, 3)), np.zeros(3))
    np.testing.assert_allclose(head.learn(train, before).weights, before.weights, atol=1e-4)


def test_softness_and_scene_count_as_in_the_network():
    seen = embedded()
    soft = Embedded(seen.embeddings, np.full(len(seen.labels), 0.5), *list(vars(seen).values())[2:])
    found = head.learn(seen, blank())
    np.testing.assert_allclose(head.logits_of(soft, found), 0.5 * head.logits_of(seen, found))
    scene = head.learn_scene(seen, found)
    beside = head.logits_of(seen, found, scene) - head.logits_of(seen, found)
    np.testing.assert_allclose(
        beside, scene.standardised(seen.numbers) @ scene.weights + scene.bias, atol=1e-9
    )


def test_what_is_shown_anew_belongs_to_the_camera_that_took_it():
    seen = embedded(count=12)
    sources = np.array(
        ["night/cws8262"] * 4 + ["night/drivable_camvid/0001"] * 4 + ["seq_wet_extreme/rain"] * 4
    )
    other = Embedded(*list(vars(seen).values())[:4], sources, seen.pictures)
    assert other.families[::4].tolist() == ["cws8262", "drivable_camvid", "seq_extreme"]


def test_a_source_left_out_is_not_learned_from():
    """Whatever stands in its patches, by day or by night, the logits of its judged pictures stay."""
    train, judged = embedded(0), embedded(1)
    rng = np.random.default_rng(3)
    own = train.sources == "cws8262"
    by_night = np.flatnonzero(own)[::2]
    sources = train.sources.astype("<U20")
    sources[by_night] = "night/cws8262"
    other = train.embeddings.copy()
    other[own] = rng.normal(0.0, 9.0, (own.sum(), WIDTH))
    spoilt = Embedded(other, *list(vars(train).values())[1:4], sources, train.pictures)
    first, second = (left_out.left_out_logits(OneTower(), each, judged) for each in (train, spoilt))
    np.testing.assert_allclose(first["cws8262"], second["cws8262"], atol=1e-3)
    assert np.abs(first["web"] - second["web"]).max() > 0.1


def test_a_picture_is_judged_by_the_mean_of_its_patches():
    seen = embedded(count=8)
    logits = np.log(np.array([[0.8, 0.1, 0.1]] * 3 + [[0.1, 0.8, 0.1]] + [[0.2, 0.2, 0.6]] * 4))
    shown = [Picture(None, "val", Surface.DRY, None, "a", "b", "c", night) for night in (False, True)]
    found = left_out.verdicts_of(logits, seen, shown, 1.0)
    mean = np.array([0.8**0.75 * 0.1**0.25, 0.1**0.75 * 0.8**0.25, 0.1])
    np.testing.assert_allclose(np.exp(found.logs[0]), mean / mean.sum())
    np.testing.assert_allclose(found.confidence, np.exp(found.logs).max(axis=1))
    assert found.night.tolist() == [False, True]


def test_the_flags_error_holds_on_pictures_like_those_it_was_set_by():
    """A confidence that tells right from wrong: of 200 draws of 400 pictures the mean error at flag 1 is within 2 %."""
    rng = np.random.default_rng(4)
    errors, flags = [], []
    for _ in range(200):
        confidence = rng.uniform(0.4, 1.0, 800)
        right = rng.random(800) < confidence**0.2
        threshold = left_out.risk_threshold(confidence[:400], right[:400], np.ones(400))
        flag = confidence[400:] >= threshold
        flags.append(flag.mean())
        errors.append((~right[400:] & flag).sum() / max(flag.sum(), 1))
    assert np.mean(errors) < left_out.FLAG_ERROR
    assert np.mean(flags) > 0.02


def test_few_pictures_raise_no_flag_however_right():
    """49 pictures without an error are the fewest that tell 2 %: (0 + 1) / (49 + 1)."""
    sure = np.linspace(0.9, 0.99, 49)
    assert left_out.risk_threshold(sure[1:], np.ones(48, bool), np.ones(48)) == 1.0
    assert left_out.risk_threshold(sure, np.ones(49, bool), np.ones(49)) == sure[0]


def test_a_table_has_a_row_for_each_source_and_tells_day_from_night():
    judged = embedded(1)
    logits = left_out.left_out_logits(OneTower(), embedded(0), judged)
    shown = [
        Picture(None, "val", Surface.DRY, None, "a", "b", "c", night=n % 2 == 1) for n in range(840 // 4)
    ]
    found = left_out.judge(logits, judged, shown, None)
    rows = [
        row for name in left_out.SOURCES for row in left_out.rows(name, "x", *left_out.flagged(found, name))
    ]
    assert len(rows) == 2 * len(left_out.SOURCES)
    assert {len(row) for row in rows} == {len(left_out.HEADER)}
    assert sum(int(row[2]) for row in rows) == 840 // 4


def test_a_card_tells_of_the_new_head_in_place_of_the_scores_of_the_old():
    card = (
        "# surface.onnx\n\nsha\n\n## Training\n\nlong\n\n## Scores on pictures, patches alone\n\nold\n\n"
        "## Scores on single patches, alone\n\nold\n\n## Readable road\n\nread\n\n## Calibration\n\nsoft\n\n"
        "Of patches alone, T = old\n\n| old |\n\n## The scene\n\nscene\n\n## Data\n\nsplit\n\n"
        "| source | class | train |\n| --- | --- | --- |\n| old | dry | 3 |\n\n## Licences of the pictures\n\nend\n"
    )
    told = cards.with_head(card, "new head", "| new |")
    assert "old" not in told
    titles = [line[3:] for line in told.splitlines() if line.startswith("## ")]
    assert titles == [
        "Training", "The head", "Readable road", "Calibration", "The scene", "Data", "Licences of the pictures",
    ]  # fmt: skip
    assert "split\n\n| new |\n\n## Licences" in told
    assert cards.with_head(told, "new head", "| new |") == told.replace("| new |", "| new |")


@pytest.fixture
def network(tmp_path):
    """A network whose towers give mean blue, green and red of a patch over 100, with a softness of a half."""
    onnx = pytest.importorskip("onnx", reason="the training extra is not installed")
    make, array = onnx.helper, onnx.numpy_helper.from_array
    constants = {
        "over": np.float32(100.0), "half": np.float32(0.005), "axes": np.array([1, 2]), "all": np.array([1]),
        head.WEIGHT: np.eye(3, dtype=np.float32), head.BIAS: np.array([0.1, 0.2, 0.3], np.float32),
    }  # fmt: skip
    nodes = [
        make.make_node("Cast", ["patches"], ["float"], to=onnx.TensorProto.FLOAT),
        make.make_node("ReduceMean", ["float", "axes"], ["mean"], keepdims=0),
        make.make_node("Div", ["mean", "over"], ["seen"]),
        make.make_node("Gemm", ["seen", head.WEIGHT, head.BIAS], ["hard"], transB=1),
        make.make_node("ReduceMean", ["mean", "all"], ["grey"], keepdims=1),
        make.make_node("Mul", ["grey", "half"], ["soft"]),
        make.make_node("Mul", ["hard", "soft"], ["logits"]),
        make.make_node("ReduceMean", ["seen", "all"], ["level"], keepdims=0),
        make.make_node("Sigmoid", ["level"], ["readable"]),
    ]
    value = make.make_tensor_value_info
    graph = make.make_graph(
        nodes,
        "made_up",
        [value("patches", onnx.TensorProto.UINT8, ["n", 64, 96, 3])],
        [value("logits", onnx.TensorProto.FLOAT, ["n", 3]), value("readable", onnx.TensorProto.FLOAT, ["n"])],
        [array(each, name) for name, each in constants.items()],
    )
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 18)], ir_version=10)
    make.set_model_props(model, {"temperature": "1.5", "classes": "dry,wet,snow_ice"})
    file = tmp_path / "surface.onnx"
    onnx.save(model, str(file))
    return file


def test_towers_and_head_give_the_logits_of_the_network_and_another_head_others(network):
    rng = np.random.default_rng(5)
    patches = (
        rng.integers(0, 255, (7, 64, 96, 3)).astype(np.uint8)
        // np.arange(1, 8, dtype=np.uint8)[:, None, None, None]
    )
    cut = PatchSet(patches, np.zeros(7, np.int64), np.full(7, "a"), np.arange(7))
    scenes = rng.integers(0, 255, (7, 20, 32, 3)).astype(np.uint8)
    towers = head.Towers(network, threads=1)
    seen = towers.embed(SceneSet(cut, scenes))
    np.testing.assert_array_equal(seen.numbers, scene_numbers(patches, scenes))
    told = SurfaceClassifier(network).verdicts(patches)
    np.testing.assert_allclose(head.logits_of(seen, towers.head), told.logits, atol=1e-5)
    new = Linear(rng.normal(size=(3, 3)), rng.normal(size=3))
    head.with_head(network, new)
    again, changed = head.Towers(network, threads=1), SurfaceClassifier(network)
    np.testing.assert_allclose(head.logits_of(seen, new), changed.verdicts(patches).logits, atol=1e-5)
    np.testing.assert_array_equal(changed.verdicts(patches).readable, told.readable)
    assert changed.temperature == 1.5
    assert again.name == towers.name, "what is kept of the towers is good for any head"
