"""Rendered pictures for training and tests: looks, cameras and places drawn from seeds, one range per split."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import RenderedFrame, Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.roi_sampling import roi_box, roi_width_px

from .data import IGNORE, Image
from .keeping import keep_arrays
from .patches import ASPECTS, PatchSet, patch_set, reduced
from .segmenter_data import SIZE, Sample

SEED_RANGES = {
    "train": range(1_000_000, 2_000_000),
    "val": range(2_000_000, 3_000_000),
    "test": range(3_000_000, 4_000_000),
}
"""Seeds of the looks of each split: disjoint, so no world is seen in two splits."""

WORLDS = {"train": 480, "val": 36, "test": 60}
"""Worlds of each split, three views each."""
PATCHES_PER_VIEW = {"train": 12, "val": 8, "test": 8}

STORED_WIDTH_PX = 384
"""Width at which whole pictures are kept for the segmenter [px]."""

OPEN_LAND, STREETS = 0.0, 0.3
"""Share of the worlds that lie in the open shade of houses [-]: of none, and where they are to be learned."""

PLACES_M = (0.0, 17.0, 41.0)
"""Road coordinates from which each world is seen [m]."""

FULL_SCALE, REDUCED_SCALE = 1.0, 0.5
"""Scales of the rendered pictures: every fourth world at the camera's own resolution, the others at half."""

NEAREST_M, FARTHEST_M = 2.5, 15.0
ROI_WIDTHS_M = (0.7, 4.5)
PURE_SHARE = 0.97
"""Least share of a patch that is lit road of one surface [-]; the classifier learns undisturbed looks only."""

ONE_SURFACE = 0.9
"""Least share of one surface on the road of a picture that is told to be of it [-]."""

WORLDS_PER_CAMERA = 6
"""Further worlds that share a camera: to know where its pixels look takes half of the time that a world takes."""
DRIVEN_SHARE = 0.6
"""Share of the patches of further worlds that are cut where and as wide as a driving car cuts them [-]."""
DRIVEN_M, DRIVEN_ASIDE_M, DRIVEN_WIDTHS_M = (2.5, 12.0), 1.8, (0.9, 2.4)
"""Their way ahead, their reach to both sides, and the width of road that they show [m]."""
DRIVEN_PURE_SHARE = 0.7
"""Least share of one surface in them: a car's regions reach over borders and verges too [-]."""


Cut = list[tuple[Image, int]]
"""Patches of one view, each with its class index."""
Seen = TypeVar("Seen")


@dataclass(frozen=True)
class View:
    """One rendered picture with the camera that took it."""

    frame: RenderedFrame
    camera: Camera
    patch_seed: int


def random_camera(rng: np.random.Generator, scale: float) -> Camera:
    """A mounting and lens near those of the camera file, pictures scaled by a factor."""
    base = Camera().scaled(scale)
    focal = base.fx_px * rng.uniform(0.7, 1.15)
    return Camera(
        width_px=base.width_px,
        height_px=base.height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=base.cx_px,
        cy_px=base.cy_px,
        height_m=rng.uniform(1.15, 1.7),
        pitch_rad=rng.uniform(0.04, 0.15),
        yaw_rad=rng.uniform(-0.03, 0.03),
        roll_rad=rng.uniform(-0.02, 0.02),
    )


def world_views(
    seed: int, scale: float, camera: Camera | None = None, streets: float = OPEN_LAND
) -> Iterator[View]:
    """Pictures of one world from several places; its class is seed modulo 3, and one world in four changes it.

    Half of the worlds have the weather that is likely for their class, half any weather: snow under a summer sky
    must still be told by its surface. Without a camera the world draws its own. A share `streets` of the worlds lies
    between houses, and is else as it would be in open land.
    """
    rng = np.random.default_rng(seed)
    surface = Surface(seed % 3)
    likely = surface if seed // 3 % 2 == 0 else None
    camera = random_camera(rng, scale) if camera is None else camera
    segments = [SurfaceSegment(-1000.0, surface)]
    if rng.random() < 0.25:
        other = Surface((int(surface) + int(rng.integers(1, 3))) % 3)
        segments.append(SurfaceSegment(rng.uniform(8.0, 60.0), other))
    look = Scene.random(rng, likely)
    street = rng.spawn(1)[0]
    if street.random() < streets:
        look = look.in_a_street(street)
    renderer = Renderer(camera, segments, look)
    for number, place_m in enumerate(PLACES_M):
        frame = renderer.frame(place_m, rng.uniform(-0.5, 0.5), rng.uniform(-0.05, 0.05))
        yield View(frame, camera, 10 * seed + number)


def draw_worlds(
    split: str,
    count: int,
    patches_per_view: int,
    processes: int,
    report: Callable[[], None],
    streets: float = OPEN_LAND,
) -> tuple[list[Sample], PatchSet]:
    """Whole pictures and patches of the first `count` worlds of a split; `report` is called after each world."""
    samples: list[Sample] = []
    cut: list[Cut] = []
    see = partial(_sample_and_patches, split=split, count=patches_per_view, streets=streets)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        for views in pool.map(see, range(count)):
            samples += [sample for sample, _ in views]
            cut += [patches for _, patches in views]
            report()
    return samples, rendered_patches(cut)


def _sample_and_patches(number: int, split: str, count: int, streets: float) -> list[tuple[Sample, Cut]]:
    cv2.setNumThreads(1)
    return [(view_sample(view), view_patches(view, count)) for view in _split_world(split, number, streets)]


def _split_world(split: str, number: int, streets: float = OPEN_LAND) -> Iterator[View]:
    """Views of one world of a split, by a camera of its own."""
    scale = FULL_SCALE if number % 4 == 0 else REDUCED_SCALE
    return world_views(SEED_RANGES[split][number], scale, streets=streets)


def split_views(split: str, count: int, report: Callable[[], None]) -> Iterator[View]:
    """Views of the first `count` worlds of a split, each world by a camera of its own."""
    for number in range(count):
        yield from _split_world(split, number)
        report()


def draw_further_worlds(
    seeds: Sequence[int],
    patches_per_view: int,
    processes: int,
    report: Callable[[], None],
    streets: float,
) -> list[Cut]:
    """Patches of each view of further worlds, see `seen_in_worlds`."""
    see = partial(_further_patches, count=patches_per_view)
    return seen_in_worlds(seeds, see, processes, report, streets)


def seen_in_worlds(
    seeds: Sequence[int],
    see: Callable[[View], Seen],
    processes: int,
    report: Callable[[], None],
    streets: float = OPEN_LAND,
) -> list[Seen]:
    """What each view of worlds shows, at the reduced scale, a camera for several; independent of `processes`."""
    sharing = [seeds[first : first + WORLDS_PER_CAMERA] for first in range(0, len(seeds), WORLDS_PER_CAMERA)]
    seen: list[Seen] = []
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        look = partial(_by_one_camera, see=see, streets=streets)
        for some, views in zip(sharing, pool.map(look, sharing), strict=True):
            seen += views
            for _ in some:
                report()
    return seen


def _by_one_camera(seeds: Sequence[int], see: Callable[[View], Seen], streets: float) -> list[Seen]:
    cv2.setNumThreads(1)
    camera = random_camera(np.random.default_rng([seeds[0], 2]), REDUCED_SCALE)
    return [see(view) for seed in seeds for view in world_views(seed, REDUCED_SCALE, camera, streets)]


def _further_patches(view: View, count: int) -> Cut:
    """Patches of a view of which most are cut as a driving car does."""
    driven = round(DRIVEN_SHARE * count)
    return driven_patches(view, driven) + view_patches(view, count - driven)


def view_sample(view: View) -> Sample:
    """A view as the segmenter's sample, reduced; its shadow is known on the road only."""
    height = round(STORED_WIDTH_PX * SIZE[1] / SIZE[0])
    size = (STORED_WIDTH_PX, height)
    image = np.asarray(cv2.resize(view.frame.image, size, interpolation=cv2.INTER_AREA), np.uint8)
    drivable, shadow = (
        np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST), np.uint8)
        for mask in (view.frame.drivable, view.frame.shadow)
    )
    shadow[drivable == 0] = IGNORE
    return Sample(image, drivable, shadow, "rendered", one_surface(view.frame), "rendered")


def one_surface(frame: RenderedFrame) -> int:
    """Class index of the road in a frame, -1 where it is of several."""
    counts = np.bincount(frame.surface[frame.surface >= 0], minlength=len(Surface))
    return int(counts.argmax()) if counts.max() >= ONE_SURFACE * max(counts.sum(), 1) else -1


def view_patches(view: View, count: int) -> Cut:
    """Patches on the road of a view with their class index; mixed and shadowed places are left out."""
    rng = np.random.default_rng(view.patch_seed)
    frame, camera = view.frame, view.camera
    cut: Cut = []
    for _ in range(16 * count):
        if len(cut) == count:
            break
        point = np.array([rng.uniform(NEAREST_M, FARTHEST_M), rng.uniform(-2.5, 2.5)])
        width_m = float(np.exp(rng.uniform(*np.log(ROI_WIDTHS_M))))
        pixel = camera.ground_to_image(point[None])[0]
        width = roi_width_px(camera, point, width_m)
        in_picture = (pixel >= 0).all() and pixel[0] < camera.width_px and pixel[1] < camera.height_px
        if not in_picture or width > 0.9 * camera.width_px:
            continue
        height = width / rng.uniform(*ASPECTS)
        left, top = round(pixel[0] - width / 2), round(pixel[1] - height / 2)
        right, bottom = round(left + width), round(top + height)
        if left < 0 or top < 0 or right > camera.width_px or bottom > camera.height_px:
            continue
        window = np.s_[top:bottom, left:right]
        label = int(frame.surface[int(pixel[1]), int(pixel[0])])
        pure = (frame.surface[window] == label) & ~frame.shadow[window]
        if label >= 0 and pure.mean() >= PURE_SHARE:
            cut.append((reduced(frame.image, (left, top, right, bottom)), label))
    return cut


def driven_patches(view: View, count: int) -> Cut:
    """Patches with their class index at the places and widths of a driving car's regions.

    The class is that of the centre. Shadowed places are left out, some verge or another surface is not.
    """
    rng = np.random.default_rng([view.patch_seed, 1])
    frame, camera = view.frame, view.camera
    cut: Cut = []
    for _ in range(16 * count):
        if len(cut) == count:
            break
        ahead_m = float(np.exp(rng.uniform(*np.log(DRIVEN_M))))
        point = np.array([ahead_m, rng.uniform(-DRIVEN_ASIDE_M, DRIVEN_ASIDE_M)])
        width_m = float(np.exp(rng.uniform(*np.log(DRIVEN_WIDTHS_M))))
        pixel = camera.ground_to_image(point[None])[0]
        if not ((pixel >= 0).all() and pixel[0] < camera.width_px and pixel[1] < camera.height_px):
            continue
        width = roi_width_px(camera, point, width_m)
        left, top, right, bottom = roi_box(camera.width_px, camera.height_px, pixel, width)
        window = np.s_[top:bottom, left:right]
        label = int(frame.surface[int(pixel[1]), int(pixel[0])])
        lit = np.mean(~frame.shadow[window]) >= PURE_SHARE
        if label >= 0 and lit and np.mean(frame.surface[window] == label) >= DRIVEN_PURE_SHARE:
            cut.append((reduced(frame.image, (left, top, right, bottom)), label))
    return cut


def rendered_patches(found: Sequence[Cut]) -> PatchSet:
    """The patches of several views as one set; each view is one picture."""
    groups = []
    for cut in found:
        for label in sorted({label for _, label in cut}):
            groups.append(([patch for patch, own in cut if own == label], label, "rendered"))
    return patch_set(groups)


def patches_in(kept: Mapping[str, Any]) -> PatchSet:
    """The patches of an open .npz file."""
    return PatchSet(*(kept[name] for name in ("patches", "labels", "sources", "pictures")))


def save_patches(file: Path, patches: PatchSet) -> None:
    """Keep patches in a .npz file."""
    keep_arrays(file, **vars(patches))


def load_patches(file: Path) -> PatchSet:
    """Patches kept by `save_patches`."""
    with np.load(file) as kept:
        return patches_in(kept)


def save_worlds(file: Path, worlds: tuple[list[Sample], PatchSet]) -> None:
    """Keep drawn worlds in a .npz file."""
    samples, patches = worlds
    planes = {
        name: np.stack([getattr(sample, name) for sample in samples])
        for name in ("image", "drivable", "shadow", "surface")
    }
    keep_arrays(file, **planes, **vars(patches))


def load_worlds(file: Path) -> tuple[list[Sample], PatchSet]:
    """Worlds kept by `save_worlds`."""
    with np.load(file) as kept:
        planes = zip(*(kept[name] for name in ("image", "drivable", "shadow", "surface")), strict=True)
        samples = [
            Sample(image, drivable, shadow, "rendered", int(surface), "rendered")
            for image, drivable, shadow, surface in planes
        ]
        return samples, patches_in(kept)
