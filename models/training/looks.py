"""Training looks at patches: as other undisturbed cameras would show them, drawn anew in every step, on any device."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

SHIFT_PX = (8, 5)
"""Largest shift across and along [px]."""
ZOOM = 0.12
"""Largest logarithm of the zoom [-]."""
COARSE_SHARE, COARSE_SCALES = 0.4, (0.3, 1.0)
"""Share of the training looks that come from a coarser camera, and its resolution [-]."""
COARSE_CAMERAS = 8
"""Coarser cameras in one batch."""


def seen_anew(generator: torch.Generator, patches: Tensor, spreads: Tensor) -> Tensor:
    """Patches mirrored or not, shifted, zoomed, at the resolution, gain, gamma and white balance of other cameras.

    Parameters
    ----------
    generator : torch.Generator
        Of the patches' device.
    patches : Tensor
        uint8, shape (n, h, w, 3).
    spreads : Tensor, shape (n,)
        How far each patch's camera may differ [-], see `augment.camera_look`.

    Returns
    -------
    Tensor
        uint8, shape (n, h, w, 3).
    """
    planes = patches.permute(0, 3, 1, 2).float()
    moved = _coarsened(generator, _moved(generator, planes))
    return _by_cameras(generator, moved, spreads).round().to(torch.uint8).permute(0, 2, 3, 1)


def _uniform(generator: torch.Generator, *shape: int) -> Tensor:
    """Numbers from -1 to 1."""
    return 2.0 * torch.rand(*shape, generator=generator, device=generator.device) - 1.0


def _moved(generator: torch.Generator, planes: Tensor) -> Tensor:
    count, _, height, width = planes.shape
    zoom = torch.exp(ZOOM * _uniform(generator, count))
    mirror = torch.sign(_uniform(generator, count))
    across = 2.0 * SHIFT_PX[0] / width * _uniform(generator, count)
    along = 2.0 * SHIFT_PX[1] / height * _uniform(generator, count)
    none = torch.zeros_like(zoom)
    rows = [torch.stack((mirror / zoom, none, across), 1), torch.stack((none, 1.0 / zoom, along), 1)]
    grid = functional.affine_grid(torch.stack(rows, 1), list(planes.shape), align_corners=False)
    return functional.grid_sample(planes, grid, padding_mode="reflection", align_corners=False)


def _coarsened(generator: torch.Generator, planes: Tensor) -> Tensor:
    """Some of the patches, anywhere among them, reduced and enlarged again."""
    size = planes.shape[2:]
    order = torch.randperm(len(planes), generator=generator, device=generator.device)
    low, high = COARSE_SCALES
    scales = low + (high - low) * 0.5 * (1.0 + _uniform(generator, COARSE_CAMERAS))
    seen = planes.clone()
    cameras = order[: round(COARSE_SHARE * len(planes))].tensor_split(COARSE_CAMERAS)
    for some, scale in zip(cameras, scales.tolist(), strict=True):
        if len(some):
            small = functional.interpolate(
                planes[some], [round(scale * side) for side in size], mode="bilinear", antialias=True
            )
            seen[some] = functional.interpolate(small, list(size), mode="bilinear")
    return seen


def _by_cameras(generator: torch.Generator, planes: Tensor, spreads: Tensor) -> Tensor:
    """Gain, white balance and gamma as `augment.camera_look` draws them for a single picture."""
    spread = spreads[:, None]
    gains = torch.exp(
        spread * (_uniform(generator, len(planes), 1) + 0.3 * _uniform(generator, len(planes), 3))
    )
    gammas = torch.exp(spread * _uniform(generator, len(planes), 1))
    levels = (planes / 255.0).clamp(0.0, 1.0) ** gammas[:, :, None, None]
    return 255.0 * (levels * gains[:, :, None, None]).clamp(0.0, 1.0)
