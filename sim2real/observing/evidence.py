"""What a model is held against: drives with the noise of their channels, and what the model leaves of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim2real.observing.doubt import doubt
from sim2real.observing.drift import read_drift, with_drift
from sim2real.observing.drive import Drive
from sim2real.observing.noise import Noise, read_noise
from sim2real.observing.observer import Simulation

Array = NDArray[np.float64]

SETTLING_S = 0.3
"""At the start of a drive the observer's state is no better than single samples: not counted [s]."""
ASTRAY = 1e3
"""What is left where a model predicts no number at all, in any channel's unit: no lost sample, but a bad model."""


@dataclass(frozen=True)
class Evidence:
    """Drives with the noise of their channels: what a model is held against."""

    drives: tuple[Drive, ...]
    noises: tuple[Noise, ...]

    def residuals(self, model: Simulation) -> tuple[Array, ...]:
        """Measured minus predicted per drive, shape (n, 7) each; NaN where nothing counts."""
        return tuple(residuals(model, drive) for drive in self.drives)

    def whitened(self, found: Sequence[Array]) -> Array:
        """All residuals in standard deviations behind each other, 0 where nothing counts."""
        parts = [n.whitened(r).ravel() for n, r in zip(self.noises, found, strict=True)]
        return np.nan_to_num(np.concatenate(parts))

    def sharpened(self, model: Simulation) -> Evidence:
        """The same drives with their noise as a better model leaves it; a channel that it fits worse keeps its own.

        Before anything is known a gap passes for noise in part, and then hides in it what a wrong effect leaves.
        """
        noises = [n.sharper(m) for n, m in zip(self.noises, gather(model, self.drives).noises, strict=True)]
        return replace(self, noises=tuple(noises))

    def drifting(self, model: Simulation, drift: Array) -> Evidence:
        """The same drives with sensors that drift by shares of their noise."""
        pairs = zip(self.drives, self.noises, strict=True)
        return replace(self, noises=tuple(with_drift(model, d, n, drift) for d, n in pairs))

    def swinging(self) -> Evidence:
        """The same drives with what repeats with the wheels' angle, if that was taken off, in their noise as it is."""
        drives = [d if d.swing is None else replace(d, measured=d.measured + d.swing) for d in self.drives]
        return replace(self, drives=tuple(drives))

    def each(self) -> list[Evidence]:
        """Each drive alone."""
        return [Evidence((d,), (n,)) for d, n in zip(self.drives, self.noises, strict=True)]

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Where each drive's residuals stand in `whitened`."""
        ends = np.cumsum([0, *(d.measured.size for d in self.drives)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))


def residuals(model: Simulation, drive: Drive) -> Array:
    """Measured minus predicted, shape (n, 7); NaN where a sample is lost or does not count."""
    return rest_of(drive, model.predict(drive).channels)


def rest_of(drive: Drive, channels: Array) -> Array:
    """Measured minus given channels, shape (n, 7); NaN where a sample is lost or does not count, see also `ASTRAY`.

    Of a drive with a reference, less what the nominal model leaves of that.
    """
    astray = np.isfinite(drive.measured) & ~np.isfinite(channels)
    rest = np.where(astray, ASTRAY, drive.measured - expected(drive, channels))
    rest[~drive.moving] = np.nan
    rest[:, ~drive.counted] = np.nan
    rest[drive.time_s < drive.time_s[0] + SETTLING_S] = np.nan
    return rest


def expected(drive: Drive, channels: Array) -> Array:
    """What the log should read where a model predicts these channels, shape (n, 7): with the reference's residuals."""
    return channels if drive.reference is None else channels + drive.reference


def gather(model: Simulation, drives: Sequence[Drive]) -> Evidence:
    """Drives with their noise, read from what a model leaves of them."""
    return Evidence(tuple(drives), tuple(read_noise(d, residuals(model, d), doubt(model, d)) for d in drives))


def drift_of(model: Simulation, *evidence: Evidence) -> Array:
    """The sensors' drift over all drives, see `read_drift` [standard deviations of the noise]."""
    drives = [d for e in evidence for d in e.drives]
    noises = [n for e in evidence for n in e.noises]
    return read_drift(drives, noises, [residuals(model, d) for d in drives])


def all_logs(*parts: Evidence) -> tuple[tuple[Drive, ...], tuple[Noise, ...]]:
    """Drives and noises of all parts, in order."""
    return tuple(d for part in parts for d in part.drives), tuple(n for part in parts for n in part.noises)
