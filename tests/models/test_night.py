"""Roads by day shown by night: what the dark changes, and what wet roads mirror."""

import numpy as np
import pytest

from models.training import night
from trpac_core.vision.classes import Surface

HEIGHT, WIDTH = 160, 240


def street(sky=200, asphalt=90):
    image = np.full((HEIGHT, WIDTH, 3), sky, np.uint8)
    image[HEIGHT // 2 :] = asphalt
    road = np.zeros((HEIGHT, WIDTH), np.float32)
    road[HEIGHT // 2 :] = 1.0
    return image, road


def shown(surface, sky=200):
    image, road = street(sky)
    return [night.darkened(np.random.default_rng(s), image, road, surface).astype(float) for s in range(20)]


@pytest.mark.parametrize("surface", Surface)
def test_a_seed_draws_one_night_and_it_is_dark(surface):
    image, road = street()
    first, again, other = (
        night.darkened(np.random.default_rng(seed), image, road, surface) for seed in (5, 5, 6)
    )
    assert (first == again).all()
    assert (first != other).any()
    assert (first.shape, first.dtype) == (image.shape, np.uint8)
    assert np.mean([each.mean() for each in shown(surface)]) < 0.5 * image.mean()


def test_wet_roads_mirror_lamps_more_than_dry_ones_and_snow_does_not(monkeypatch):
    """With nothing but lamps for a light, what a road shows is mirrored."""
    for light in ("AMBIENT", "BEAM"):
        monkeypatch.setattr(night, light, (1e-9, 1e-9))
    for none in ("POOLS", "VEIL", "SHOT_NOISE", "READ_NOISE"):
        monkeypatch.setattr(night, none, (0.0, 0.0))
    monkeypatch.setattr(night, "LAMP_BELOW", (-0.05, -0.04))
    wet, dry, snow = (
        np.mean([each[-HEIGHT // 3 :].mean() for each in shown(surface)])
        for surface in (Surface.WET, Surface.DRY, Surface.SNOW_ICE)
    )
    assert wet > 2.0 * dry > 0.0
    assert snow < 1.0


def test_lamps_shine_on_dry_and_snowy_roads_and_less_on_wet_ones(monkeypatch):
    """Without lamps in view and under a black sky nothing is mirrored: what is left is scattered."""
    monkeypatch.setattr(night, "LAMPS", (0, 1))
    wet, dry = (
        np.mean([each[-HEIGHT // 3 :].mean() for each in shown(surface, sky=0)])
        for surface in (Surface.WET, Surface.DRY)
    )
    assert wet < 0.8 * dry
