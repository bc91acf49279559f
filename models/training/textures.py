"""Drawn patches of things that are no road: walls, plants, sky, cloth, bodywork, facades, lettering, covers.

Every drawing is its own: where it lies in the picture, how large it is there, its colours and its light come from the
generator. Nothing of them is meant to look right but what tells them from road: structure and colour.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.roi_sampling import PATCH_HEIGHT_PX, PATCH_WIDTH_PX

from .data import Image

SIZE = (PATCH_WIDTH_PX, PATCH_HEIGHT_PX)
SHAPE = (PATCH_HEIGHT_PX, PATCH_WIDTH_PX)
Plane = NDArray[np.float64]
Rgb = NDArray[np.float64]


def coloured(rng: np.random.Generator, hues: tuple[float, float], saturations: tuple[float, float]) -> Rgb:
    """A colour [B, G, R] of brightness 1; hue in turns (0 red, 1/3 green, 2/3 blue), saturation in [0, 1]."""
    hue = rng.uniform(*hues) % 1.0 * 6.0
    saturation = rng.uniform(*saturations)
    sectors = (np.array([1.0, 3.0, 5.0]) + hue) % 6.0  # B, G, R
    return 1.0 - saturation * np.clip(np.minimum(sectors, 4.0 - sectors), 0.0, 1.0)


def rough(rng: np.random.Generator, slope: float) -> Plane:
    """Noise of mean 0 and deviation 1 whose amplitude falls with frequency^-slope, shape (64, 96)."""
    noise = np.fft.rfft2(rng.standard_normal(SHAPE))
    fy, fx = np.fft.fftfreq(SHAPE[0])[:, None], np.fft.rfftfreq(SHAPE[1])[None]
    plane = np.fft.irfft2(noise * np.maximum(np.hypot(fx, fy), 1.0 / SIZE[0]) ** -slope, SHAPE)
    return (plane - plane.mean()) / (plane.std() + 1e-9)


def placed(rng: np.random.Generator, turn_rad: float = 0.12) -> tuple[Plane, Plane]:
    """Coordinates (u, v) of a plane seen askew, in pixels at the patch's middle, shape (64, 96) each."""
    x, y = np.meshgrid(np.arange(SIZE[0]) - SIZE[0] / 2.0, np.arange(SIZE[1]) - SIZE[1] / 2.0)
    turn, shear = rng.normal(0.0, turn_rad), rng.normal(0.0, 0.15)
    depth = 1.0 + rng.normal(0.0, 0.002) * x + rng.normal(0.0, 0.002) * y
    u = (x * np.cos(turn) + y * np.sin(turn) + shear * y) / depth
    v = (y * np.cos(turn) - x * np.sin(turn)) / depth
    return u + rng.uniform(0, 500), v + rng.uniform(0, 500)


def seen(rng: np.random.Generator, picture: NDArray[np.float64]) -> Image:
    """What a camera makes of a picture of light (64, 96, 3) around 1: uneven light, exposure, lens and sensor."""
    x, y = np.linspace(-1, 1, SIZE[0])[None], np.linspace(-1, 1, SIZE[1])[:, None]
    light = np.exp(rng.normal(0.0, 0.15) * x + rng.normal(0.0, 0.15) * y)
    levels = picture * light[..., None] * rng.uniform(25.0, 215.0) * np.exp(rng.normal(0.0, 0.04, 3))
    if rng.random() < 0.6:
        levels = cv2.GaussianBlur(levels, (0, 0), rng.uniform(0.3, 1.5))
    levels = levels + rng.normal(0.0, rng.uniform(0.3, 6.0), levels.shape)
    return np.clip(levels + 0.5, 0, 255).astype(np.uint8)


def toned(tone: Plane, colour: Rgb) -> NDArray[np.float64]:
    """A colour whose brightness follows exp(tone)."""
    return np.exp(tone)[..., None] * colour


def masonry(rng: np.random.Generator, aspects: tuple[float, float], shift: float) -> Image:
    """Courses of bricks, slabs or boards with joints, each stone of its own tone and hue."""
    u, v = placed(rng)
    high = np.exp(rng.uniform(np.log(4.0), np.log(34.0)))
    wide = high * rng.uniform(*aspects)
    course = np.floor(v / high)
    along = u + course * shift * wide
    stone = (course * 131 + np.floor(along / wide) * 37).astype(int) % 256
    hues, saturations = ((-0.05, 0.13), (0.1, 0.65)) if rng.random() < 0.65 else ((0.0, 1.0), (0.0, 0.5))
    first, second = coloured(rng, hues, saturations), coloured(rng, hues, saturations)
    mixed = rng.uniform(0.0, 1.0, 256)[stone][..., None] * rng.uniform(0.0, 1.0)
    tone = rng.normal(0.0, rng.uniform(0.02, 0.25), 256)[stone]
    tone = tone + rng.uniform(0.01, 0.2) * rough(rng, rng.uniform(0.3, 1.2))
    wall = toned(tone, np.ones(3)) * (first + mixed * (second - first))
    width = rng.uniform(0.04, 0.22) * high
    joint = (v % high < width) | (along % wide < width)
    mortar = coloured(rng, (0.0, 0.2), (0.0, 0.2)) * np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.12, 0.8))
    return seen(rng, np.where(joint[..., None], mortar * np.exp(0.05 * rough(rng, 0.5))[..., None], wall))


def bricks(rng: np.random.Generator) -> Image:
    """A wall in bond."""
    return masonry(rng, (1.8, 4.2), float(rng.choice([0.5, 0.5, 0.25, 0.33])))


def tiles(rng: np.random.Generator) -> Image:
    """Tiles, panes and slabs whose joints cross."""
    return masonry(rng, (0.7, 2.5), 0.0)


def boards(rng: np.random.Generator) -> Image:
    """Boards, cladding, fences, upright or lying."""
    board = masonry(rng, (8.0, 40.0), float(rng.uniform(0.0, 1.0)))
    if rng.random() < 0.5:
        return board
    return np.asarray(cv2.resize(np.ascontiguousarray(board.transpose(1, 0, 2)), SIZE), np.uint8)


def ribs(rng: np.random.Generator) -> Image:
    """Corrugated metal, blinds, containers, guard rails: a smooth profile, repeated."""
    u, v = placed(rng, 0.2)
    along = u if rng.random() < 0.5 else v
    phase = along / np.exp(rng.uniform(np.log(4.0), np.log(45.0))) * 2.0 * np.pi
    profile = np.tanh(rng.uniform(0.5, 4.0) * np.sin(phase)) + 0.4 * np.sin(phase + rng.uniform(0.5, 2.5))
    tone = rng.uniform(0.08, 0.5) * profile + rng.uniform(0.0, 0.08) * rough(rng, 1.0)
    return seen(rng, toned(tone, coloured(rng, (0.0, 1.0), (0.0, 0.7))))


def plaster(rng: np.random.Generator) -> Image:
    """Painted plaster, soil, painted metal: it differs from road in its colour."""
    tone = rng.uniform(0.02, 0.12) * rough(rng, rng.uniform(0.2, 1.2)) + rng.uniform(0.0, 0.15) * rough(
        rng, 1.8
    )
    return seen(rng, toned(tone, coloured(rng, (0.0, 1.0), (0.3, 0.85))))


def cloth(rng: np.random.Generator) -> Image:
    """Woven cloth, seats, carpet: threads across each other, a pattern, folds."""
    u, v = placed(rng, 0.8)
    period = rng.uniform(2.2, 9.0)
    weave = np.sin(2 * np.pi * u / period) * np.sin(2 * np.pi * v / (period * rng.uniform(0.7, 1.4)))
    tone = rng.uniform(0.05, 0.3) * weave + rng.uniform(0.0, 0.4) * rough(rng, rng.uniform(1.5, 2.5))
    first, second = (coloured(rng, (0.0, 1.0), (0.1, 0.9)) * rng.uniform(0.3, 1.0) for _ in range(2))
    check = (u % rng.uniform(10, 60) < rng.uniform(3, 25)) ^ (v % rng.uniform(10, 60) < rng.uniform(3, 25))
    second = first if rng.random() < 0.4 else second
    return seen(rng, toned(tone, np.ones(3)) * np.where(check[..., None], first, second))


def leaves(rng: np.random.Generator) -> Image:
    """Hedges, trees, flower beds: leaves over leaves, the lower ones in shade."""
    hues = (0.16, 0.42) if rng.random() < 0.75 else (-0.03, 0.2)
    size = np.exp(rng.uniform(np.log(1.5), np.log(9.0)))
    picture = np.full((*SHAPE, 3), 0.1)
    count = int(min(900, 2.5 * SIZE[0] * SIZE[1] / (size * size)))
    shades = np.sort(rng.uniform(0.15, 1.0, count))
    for place, turn, shade in zip(
        rng.uniform(0, SIZE, (count, 2)), rng.uniform(0, 180, count), shades, strict=True
    ):
        colour = coloured(rng, hues, (0.25, 0.9)) * shade * np.exp(rng.normal(0.0, 0.15))
        axes = (max(1, round(size)), max(1, round(size * rng.uniform(0.3, 0.7))))
        cv2.ellipse(picture, (int(place[0]), int(place[1])), axes, turn, 0, 360, colour.tolist(), -1)
    return seen(rng, picture)


def grass(rng: np.random.Generator) -> Image:
    """Lawn, stubble, reed: short strokes that rise."""
    hues = (0.17, 0.36) if rng.random() < 0.7 else (0.08, 0.17)
    picture = toned(0.2 * rough(rng, 1.2), 0.5 * coloured(rng, hues, (0.3, 0.8)))
    length, lean = rng.uniform(3.0, 14.0), rng.normal(0.0, 0.3)
    for place in rng.uniform(0, SIZE, (int(rng.integers(250, 800)), 2)):
        angle = lean + rng.normal(0.0, 0.4)
        end = place + length * rng.uniform(0.5, 1.5) * np.array([np.sin(angle), -np.cos(angle)])
        colour = coloured(rng, hues, (0.2, 0.8)) * rng.uniform(0.25, 1.1)
        cv2.line(
            picture, place.astype(int).tolist(), end.astype(int).tolist(), colour.tolist(), 1, cv2.LINE_AA
        )
    return seen(rng, picture)


def clouds(rng: np.random.Generator) -> Image:
    """Sky: a clean gradient, clouds with soft or hard edges, blue or the colours of the evening."""
    blue = rng.random() < 0.7
    sky = coloured(rng, (0.54, 0.66) if blue else (-0.08, 0.14), (0.2, 0.75))
    fall = np.linspace(0.0, rng.normal(0.0, 0.35), SIZE[1])[:, None] + np.zeros(SHAPE)
    field = rough(rng, rng.uniform(1.4, 2.4)) + rng.uniform(-1.5, 1.5)
    cover = np.clip(field * rng.uniform(0.4, 2.5), 0.0, 1.0)[..., None]
    white = toned(
        rng.uniform(0.0, 0.2) * rough(rng, 1.8),
        coloured(rng, (0.0, 1.0), (0.0, 0.08)) * rng.uniform(0.8, 1.5),
    )
    return seen(rng, toned(fall, sky) * (1.0 - cover) + white * cover)


def bodywork(rng: np.random.Generator) -> Image:
    """Bonnet, dashboard, other cars: smooth shining sheets with edges, lights and mirrored surroundings."""
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]))
    colour = coloured(rng, (0.0, 1.0), (0.0, 0.9)) * rng.uniform(0.15, 1.0)
    picture = toned(rng.normal(0.0, 0.5) * y + rng.normal(0.0, 0.5) * (x - rng.normal(0.0, 0.5)) ** 2, colour)
    for _ in range(int(rng.integers(1, 5))):
        edge = y - rng.uniform(-0.9, 0.9) - rng.normal(0.0, 0.4) * x - rng.normal(0.0, 0.4) * x * x
        beyond = 1.0 / (1.0 + np.exp(-edge * np.exp(rng.uniform(np.log(4.0), np.log(80.0)))))
        picture = picture * np.exp(rng.normal(0.0, 0.6) * beyond)[..., None]
    for _ in range(int(rng.integers(0, 4))):
        reach = rng.uniform(0.04, 0.6, 2)
        spot = np.exp(
            -(((x - rng.uniform(-1, 1)) / reach[0]) ** 2) - ((y - rng.uniform(-1, 1)) / reach[1]) ** 2
        )
        picture = picture + rng.uniform(0.1, 1.2) * spot[..., None]
    return seen(rng, picture)


def facade(rng: np.random.Generator) -> Image:
    """Windows in rows: panes, frames and sills, each pane with light of its own."""
    u, v = placed(rng, 0.05)
    wide, high = np.exp(rng.uniform(np.log(9.0), np.log(70.0), 2))
    fill_u, fill_v, frame = rng.uniform(0.35, 0.85), rng.uniform(0.35, 0.85), rng.uniform(0.0, 0.15)
    pane = (np.floor(u / wide) * 37 + np.floor(v / high) * 101).astype(int) % 64
    glass = rng.uniform(0.05, 1.1, 64)[pane][..., None] * coloured(rng, (0.45, 0.7), (0.0, 0.4))
    across, down = u / wide % 1.0, v / high % 1.0
    wall = toned(0.05 * rough(rng, 1.0), coloured(rng, (-0.05, 0.2), (0.0, 0.6)) * rng.uniform(0.3, 1.1))
    inner = (across < fill_u - frame) & (down < fill_v - frame) & (across > frame) & (down > frame)
    sash = (across < fill_u) & (down < fill_v) & ~inner
    picture = np.where(inner[..., None], glass, wall)
    return seen(rng, np.where(sash[..., None], rng.uniform(0.1, 1.3), picture))


def things(rng: np.random.Generator) -> Image:
    """Shapes over shapes: traffic, people, rooms, machines."""
    picture = toned(0.1 * rough(rng, 1.2), coloured(rng, (0.0, 1.0), (0.0, 0.6)))
    for _ in range(int(rng.integers(6, 20))):
        colour = coloured(rng, (0.0, 1.0), (0.0, 0.9)) * rng.uniform(0.05, 1.2)
        centre, reach = rng.uniform((0, 0), SIZE), np.exp(rng.uniform(np.log(4.0), np.log(40.0)))
        if rng.random() < 0.4:
            axes = (int(reach), max(1, int(reach * rng.uniform(0.3, 1.0))))
            place = (int(centre[0]), int(centre[1]))
            cv2.ellipse(picture, place, axes, rng.uniform(0, 180), 0, 360, colour.tolist(), -1, cv2.LINE_AA)
            continue
        angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 7))))
        corners = (
            centre
            + reach * rng.uniform(0.5, 1.0, len(angles))[:, None] * np.c_[np.cos(angles), np.sin(angles)]
        )
        cv2.fillPoly(picture, [np.round(corners).astype(np.int32)], colour.tolist(), cv2.LINE_AA)
    return seen(rng, picture + rng.uniform(0.0, 0.1) * rough(rng, 0.8)[..., None])


def lettering(rng: np.random.Generator) -> Image:
    """Signs, plates, screens, paper."""
    first, second = rng.permutation([rng.uniform(0.5, 1.1), rng.uniform(0.05, 0.3)])
    ground, ink = (coloured(rng, (0.0, 1.0), (0.0, 0.9)) * level for level in (first, second))
    written = np.zeros(SHAPE, np.uint8)
    scale = rng.uniform(0.3, 2.2)
    for row in np.arange(rng.uniform(0, 20), SIZE[1] + 20 * scale, 26 * scale):
        text = "".join(chr(letter) for letter in rng.integers(33, 123, 24))
        start = (int(rng.uniform(-40, 10)), int(row))
        weight = max(1, round(scale * rng.uniform(0.6, 2.5)))
        cv2.putText(written, text, start, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, weight, cv2.LINE_AA)
    share = written[..., None] / 255.0
    return seen(rng, ground + share * (ink - ground))


def wood(rng: np.random.Generator) -> Image:
    """Grain drawn out along one direction, in warm colours."""
    noise = cv2.GaussianBlur(
        rng.standard_normal(SHAPE), (0, 0), sigmaX=rng.uniform(8.0, 30.0), sigmaY=rng.uniform(0.4, 1.5)
    )
    grain = noise / (noise.std() + 1e-9)
    grain = grain if rng.random() < 0.5 else cv2.resize(np.ascontiguousarray(grain.T), SIZE)
    tone = rng.uniform(0.06, 0.25) * grain + 0.1 * rough(rng, 1.8)
    return seen(rng, toned(tone, coloured(rng, (0.0, 0.14), (0.25, 0.8))))


def cover(rng: np.random.Generator) -> Image:
    """A hand, dirt or a cap close to the lens: smooth, dim, with little grain left once the patch is reduced."""
    tone = rng.uniform(0.03, 0.5) * rough(rng, rng.uniform(1.4, 2.6))
    hues, saturations = ((-0.05, 0.13), (0.0, 0.7)) if rng.random() < 0.6 else ((0.0, 1.0), (0.0, 0.4))
    levels = toned(tone, coloured(rng, hues, saturations)) * rng.uniform(8.0, 150.0)
    levels = levels + rng.normal(0.0, rng.uniform(0.2, 4.0), levels.shape)
    return np.clip(levels + 0.5, 0, 255).astype(np.uint8)


KINDS: dict[str, Callable[[np.random.Generator], Image]] = {
    kind.__name__: kind
    for kind in (
        bricks, tiles, boards, ribs, plaster, cloth, leaves, grass, clouds, bodywork, facade, things, lettering,
        wood, cover,
    )
}  # fmt: skip
