"""Real dry roads shown wet and under snow: what the weather changes, what it leaves, and where it comes from."""

import cv2
import numpy as np
import pytest

from models.training.data import Picture, of_split
from models.training.patches import draw_weights, training_patches
from models.training.weathered import Standpoint, snowed, weathered, wetted
from trpac_core.vision.classes import Surface

HEIGHT, WIDTH, HORIZON = 160, 240, 70
SEEN = Standpoint(float(HORIZON), 210.0)
WEATHERS = {"wet": wetted, "snow": snowed}


def street(sky=200, asphalt=90):
    image = np.full((HEIGHT, WIDTH, 3), sky, np.uint8)
    image[HORIZON:] = asphalt
    road = np.zeros((HEIGHT, WIDTH), np.float32)
    road[HORIZON:] = 1.0
    return image, road


def many(weather, image, road, count=40):
    return [weather(np.random.default_rng(seed), image, road, SEEN).astype(float) for seed in range(count)]


@pytest.mark.parametrize("weather", WEATHERS.values(), ids=WEATHERS)
def test_beside_the_road_only_the_light_changes(weather):
    image, road = street()
    road[:, : WIDTH // 2] = 0.0
    some, none = (weather(np.random.default_rng(3), image, mask, SEEN) for mask in (road, 0.0 * road))
    assert (some[:, : WIDTH // 2] == none[:, : WIDTH // 2]).all()
    assert (some[HORIZON + 5 :, WIDTH // 2 :] != none[HORIZON + 5 :, WIDTH // 2 :]).mean() > 0.5


@pytest.mark.parametrize("weather", WEATHERS.values(), ids=WEATHERS)
def test_same_seed_same_weather_another_seed_another(weather):
    image, road = street()
    first, again, other = (weather(np.random.default_rng(seed), image, road, SEEN) for seed in (5, 5, 6))
    assert (first == again).all()
    assert (first != other).any()
    assert first.dtype == np.uint8
    assert first.shape == image.shape


def test_water_mirrors_what_stands_above_and_the_more_the_flatter_the_look():
    image, road = street(sky=40)
    image[:HORIZON, WIDTH // 2 :] = 250
    shown = np.mean(many(wetted, image, road), axis=(0, 3))
    left, right = shown[:, 40], shown[:, WIDTH - 40]
    near, far = HEIGHT - 10, HORIZON + 12
    assert right[near] > left[near] + 2.0
    assert right[far] - left[far] > 2.0 * (right[near] - left[near])


def test_wet_asphalt_under_a_black_sky_is_darker_than_dry():
    image, road = street(sky=0)
    for seed, shown in enumerate(many(wetted, image, road)):
        dry = wetted(np.random.default_rng(seed), image, 0.0 * road, SEEN)
        assert shown[HEIGHT - 20 :].mean() < dry[HEIGHT - 20 :].mean()


def test_snow_is_brighter_than_asphalt_and_keeps_its_shadows():
    image, road = street()
    image[HORIZON:, : WIDTH // 2] = 45
    shown = many(snowed, image, road)
    lit, shadow = (
        np.array([s[HORIZON + 40 :, part].mean() for s in shown]) for part in (slice(150, None), slice(90))
    )
    dry = many(lambda rng, image, road, seen: snowed(rng, image, 0.0 * road, seen), image, road)
    assert (lit > np.array([d[HORIZON + 40 :, 150:].mean() for d in dry])).all()
    assert (shadow < 0.9 * lit).all()


@pytest.fixture
def pictures(tmp_path):
    """A dry street with a mask, one without, and pictures of sources whose standpoint is not known."""
    image, road = street()
    cv2.imwrite(str(tmp_path / "street.png"), image)
    cv2.imwrite(str(tmp_path / "mask.png"), road.astype(np.uint8))

    def picture(source, surface=Surface.DRY, mask=None, split="train"):
        return Picture(tmp_path / "street.png", split, surface, mask, source, source, "made up")

    return [
        picture("drivable_camvid/0006R0", mask=tmp_path / "mask.png"),
        picture("seq_dry_yolop/input1"),
        picture("condition_web"),
        picture("condition_web", surface=Surface.WET),
        picture("seq_dry_extreme/Critical_Driving1"),
    ]


def test_dry_pictures_of_known_standpoints_become_wet_and_snowy_ones(pictures):
    found = weathered(pictures, 1)
    assert [(p.source, p.surface) for p in found] == [
        (source, surface)
        for source in ("drivable_camvid/0006R0", "seq_dry_yolop/input1")
        for surface in (Surface.WET, Surface.SNOW_ICE)
    ]
    assert of_split(found, "train", masked=True) == found[:2]
    assert all((p.image() != pictures[0].image()).any() for p in found)
    assert (weathered(pictures, 2)[0].image() != found[0].image()).any()


def test_they_are_one_source_of_their_class_beside_the_others(pictures):
    shown = training_patches([*pictures, *weathered(pictures, 1)], 1)
    of_wet = shown.labels == Surface.WET
    made = np.char.startswith(shown.sources, "weathered/")
    shares = draw_weights(shown)
    assert set(shown.sources[made]) == {"weathered/drivable_camvid/0006R0", "weathered/seq_dry_yolop/input1"}
    assert shares[of_wet & made].sum() / shares[of_wet].sum() == pytest.approx(1.5 / (1.5 + 3.0))
    assert not (made & (shown.labels == Surface.DRY)).any()
