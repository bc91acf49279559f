"""Pictures in which no road can be judged: no road at all, a covered or blurred lens, noise, night.

``python -m benchmarks.vision.odd_pictures [--models DIR] [--page]`` shows them to
the image estimator and prints how many end in flag 0, kind by kind: all ought to. --page writes the table into
lab/2026-11-29_camera_scores.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.report import markdown, write_between
from models.training.rendered import random_camera
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.results import FrameResult
from trpac_core.vision.trajectory import Motion

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "lab" / "2026-11-29_camera_scores.md"
WIDTH_PX, HEIGHT_PX = 960, 600
SCALE = 0.5
DISPLAY_GAMMA = 2.2
Picture = NDArray[np.uint8]
Field = NDArray[np.float64]


def cloud(rng: np.random.Generator, slope: float) -> Field:
    """Noise of mean 0 and deviation 1 whose power falls with frequency^-slope, shape (600, 960)."""
    across, down = (np.fft.fftfreq(n) * n for n in (WIDTH_PX, HEIGHT_PX))
    frequency = np.hypot(across[None, :], down[:, None])
    frequency[0, 0] = 1.0
    field = np.fft.ifft2(
        np.fft.fft2(rng.standard_normal((HEIGHT_PX, WIDTH_PX))) * frequency ** (-slope / 2.0)
    ).real
    return (field - field.mean()) / field.std()


def painted(rng: np.random.Generator, colour: object, tone: Field, sensor: float = 2.0) -> Picture:
    """A colour [B, G, R] whose brightness follows exp(tone), with sensor noise [8-bit levels]."""
    levels = np.asarray(colour, dtype=np.float64) * np.exp(tone[..., None])
    return as_picture(levels + rng.normal(0.0, sensor, (HEIGHT_PX, WIDTH_PX, 3)))


def as_picture(levels: NDArray[np.float64]) -> Picture:
    return np.clip(levels, 0.0, 255.0).astype(np.uint8)


def road(rng: np.random.Generator, pitch_rad: float | None = None, **look: float) -> Picture:
    """Any rendered road, or what is above it."""
    camera = random_camera(rng, SCALE)
    camera = camera if pitch_rad is None else replace(camera, pitch_rad=pitch_rad)
    surface = Surface(int(rng.integers(3)))
    drawn = replace(Scene.random(rng, surface), **look)  # type: ignore[arg-type]
    return Renderer(camera, [SurfaceSegment(0.0, surface)], drawn).frame(0.0).image


def sky(rng: np.random.Generator) -> Picture:
    return road(rng, pitch_rad=float(rng.uniform(-0.75, -0.45)))


def brick_wall(rng: np.random.Generator) -> Picture:
    high, wide = int(rng.integers(18, 60)), int(rng.integers(50, 160))
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    row = y // high
    shifted = x + (row % 2) * wide // 2
    stone = (row * 97 + shifted // wide * 31) % 256
    tone = rng.normal(0.0, 0.12, 256)[stone] + 0.1 * cloud(rng, 1.2)
    wall = painted(rng, rng.uniform([40, 50, 90], [110, 120, 190]), tone)
    wall[(y % high < 3) | (shifted % wide < 3)] = 140
    return wall


def concrete_wall(rng: np.random.Generator) -> Picture:
    tone = 0.04 * cloud(rng, 1.2) + 0.04 * cloud(rng, 2.5)
    wall = painted(rng, rng.uniform(90.0, 190.0) * np.array([1.0, 1.02, 1.03]), tone)
    for column in range(int(rng.integers(100, 300)), WIDTH_PX, int(rng.integers(200, 400))):
        cv2.line(wall, (column, 0), (column, HEIGHT_PX), (60, 60, 60), 2)
    return wall


def foliage(rng: np.random.Generator) -> Picture:
    return painted(
        rng, rng.uniform([20, 70, 40], [60, 140, 110]), 0.35 * cloud(rng, float(rng.uniform(0.6, 1.6)))
    )


def meadow(rng: np.random.Generator) -> Picture:
    nearness = np.linspace(0.3, 1.0, HEIGHT_PX)[:, None]
    ground = painted(rng, rng.uniform([25, 90, 60], [60, 150, 120]), 0.3 * nearness * cloud(rng, 0.8))
    horizon = int(0.35 * HEIGHT_PX)
    ground[:horizon] = sky(rng)[:horizon]
    return ground


def night(rng: np.random.Generator) -> Picture:
    """Road in the light of the headlights alone, and a sensor at its limit."""
    light = (road(rng, sun_share=0.0) / 255.0) ** DISPLAY_GAMMA
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    row, reach = HEIGHT_PX * rng.uniform(0.5, 0.65), HEIGHT_PX * rng.uniform(0.1, 0.2)
    across = (x - WIDTH_PX / 2.0) / (WIDTH_PX * rng.uniform(0.15, 0.35))
    cone = np.exp(-(across**2) - ((y - row) / reach) ** 2)
    cone[y < row - 20.0] *= 0.2
    share = rng.uniform(0.0005, 0.006) + rng.uniform(0.03, 0.3) * cone
    lit = light * share[..., None] * np.array([0.75, 0.9, 1.0])
    noise = rng.normal(0.0, rng.uniform(2.0, 9.0), lit.shape)
    return as_picture(255.0 * lit ** (1.0 / DISPLAY_GAMMA) + noise)


def even_noise(rng: np.random.Generator) -> Picture:
    return rng.integers(0, 256, (HEIGHT_PX, WIDTH_PX, 3)).astype(np.uint8)


def grey_noise(rng: np.random.Generator) -> Picture:
    return as_picture(rng.normal(rng.uniform(40.0, 200.0), rng.uniform(8.0, 40.0), (HEIGHT_PX, WIDTH_PX, 3)))


def dark_noise(rng: np.random.Generator) -> Picture:
    return as_picture(rng.normal(rng.uniform(2.0, 14.0), rng.uniform(1.5, 6.0), (HEIGHT_PX, WIDTH_PX, 3)))


def covered_lens(rng: np.random.Generator) -> Picture:
    return painted(
        rng, rng.uniform(20.0, [130, 140, 160]), 0.25 * cloud(rng, 3.5), float(rng.uniform(1.2, 4.0))
    )


def blurred_lens(rng: np.random.Generator) -> Picture:
    """Water or dirt on the lens: nothing of the road's texture is left."""
    blurred = cv2.GaussianBlur(road(rng), (0, 0), float(rng.uniform(25.0, 60.0)))
    return as_picture(blurred + rng.normal(0.0, rng.uniform(1.2, 3.0), blurred.shape))


KINDS: dict[str, Callable[[np.random.Generator], Picture]] = {
    kind.__name__: kind
    for kind in (
        sky, brick_wall, concrete_wall, foliage, meadow, night, even_noise, grey_noise, dark_noise, covered_lens,
        blurred_lens,
    )
}  # fmt: skip


def picture(kind: str, number: int, seed: int = 0) -> Picture:
    """One picture of a kind, BGR of 960 x 600; the same numbers give the same picture."""
    return KINDS[kind](np.random.default_rng([seed, list(KINDS).index(kind), number]))


def verdicts(ife: Ife, kind: str, count: int, seed: int = 0) -> list[FrameResult]:
    """What the estimator says of single pictures of a kind, without history."""
    return [ife.process(IfeState(), picture(kind, number, seed), Motion(10.0))[1] for number in range(count)]


def table(ife: Ife, count: int = 16) -> str:
    """How many of each kind end in flag 0, as Markdown."""
    rows, held, shown = [], 0, 0
    for kind in KINDS:
        found = verdicts(ife, kind, count)
        p_util, P_fusion = np.median([[result.p_util, result.P_fusion] for result in found], axis=0)
        down = sum(not result.flag for result in found)
        held, shown = held + down, shown + len(found)
        rows.append((kind.replace("_", " "), len(found), down, f"{p_util:.2f}", f"{P_fusion:.2f}"))
    heads = ("kind", "pictures", "flag 0", "p_util, median", "P_fusion, median")
    return markdown(heads, [*rows, ("all", shown, held, "", "")])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, default=ROOT / "models")
    parser.add_argument(
        "--page", action="store_true", help="write the table into lab/2026-11-29_camera_scores.md"
    )
    options = parser.parse_args()
    files = options.models / "segmenter.onnx", options.models / "surface.onnx"
    ife = Ife(IfeConfig(groups_looked_at=1), Segmenter(files[0]), SurfaceClassifier(files[1]))
    found = table(ife)
    print(found)
    if options.page:
        write_between(PAGE, found, "odd")


if __name__ == "__main__":
    main()
