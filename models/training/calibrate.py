"""Temperature scaling of the surface classifier and how well its confidence fits (section 3.1, Figure 4)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from scenarios.camera.disturbances import PAPER, disturb
from scenarios.plot_style import BLUE, VERMILLION
from trpac_core.vision.networks import calibrated_probabilities

from .data import Image

BINS = 15
"""Bins of confidence in ECE, MCE and the reliability diagram."""

DISTURBANCE = replace(PAPER, motion_blur_limit_px=180.0, exposure_probability=0.3, shadow_probability=0.3)
"""The disturbed scenario of section 5.1, with the abnormal exposure and the shadow of section 3.1 on three in ten.

The limit of the blur counts in a picture 1920 px wide; in a patch it comes to 9 px, as of a far region.
"""

LARGEST_TEMPERATURE = 20.0


@dataclass(frozen=True)
class Reliability:
    """Confidence and accuracy per bin; empty bins hold NaN, `count` zero."""

    confidence: NDArray[np.float64]
    accuracy: NDArray[np.float64]
    count: NDArray[np.int64]

    @property
    def ece(self) -> float:
        """Expected calibration error [-]: mean gap over all samples."""
        filled = self.count > 0
        gaps = np.abs(self.confidence - self.accuracy)[filled]
        return float(np.average(gaps, weights=self.count[filled]))

    @property
    def mce(self) -> float:
        """Maximum calibration error [-]: the largest gap of a bin."""
        return float(np.nanmax(np.abs(self.confidence - self.accuracy)))


def cross_entropy(logits: NDArray[np.float64], labels: NDArray[np.int64], temperature: float = 1.0) -> float:
    """Mean negative log probability of the true class at temperature T [nat]."""
    chosen = calibrated_probabilities(logits, temperature)[np.arange(len(labels)), labels]
    return float(-np.log(np.maximum(chosen, 1e-300)).mean())


def learn_temperature(logits: NDArray[np.float64], labels: NDArray[np.int64]) -> float:
    """T > 0 that minimises the validation cross-entropy (Guo et al. 2017); convex in 1/T, so one minimum."""
    bounds = (1.0 / LARGEST_TEMPERATURE, LARGEST_TEMPERATURE)
    found = minimize_scalar(
        lambda inverse: cross_entropy(logits, labels, 1.0 / inverse), bounds=bounds, method="bounded"
    )
    return float(1.0 / found.x)


def reliability(
    logits: NDArray[np.float64], labels: NDArray[np.int64], temperature: float = 1.0, bins: int = BINS
) -> Reliability:
    """Mean confidence and accuracy in equal bins of confidence."""
    found = calibrated_probabilities(logits, temperature)
    confidence, right = found.max(axis=1), found.argmax(axis=1) == labels
    index = np.minimum((confidence * bins).astype(np.int64), bins - 1)
    count = np.bincount(index, minlength=bins)
    with np.errstate(invalid="ignore"):
        return Reliability(
            np.bincount(index, confidence, bins) / count, np.bincount(index, right, bins) / count, count
        )


def noised(patches: Image, seed: int) -> Image:
    """The patches as a disturbed camera would show them, see DISTURBANCE."""
    return np.stack([disturb(patch, DISTURBANCE, seed + row) for row, patch in enumerate(patches)])


def draw_reliability(before: Reliability, after: Reliability, temperature: float, path: Path) -> None:
    """Write the two reliability diagrams in the form of Figure 4."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.4), layout="constrained")
    titles = ("(a) original model, T = 1", f"(b) calibrated model, T = {temperature:.3f}")
    width = 1.0 / BINS
    centres = (np.arange(BINS) + 0.5) * width
    for axis, curve, title in zip(figure.subplots(1, 2), (before, after), titles, strict=True):
        filled = curve.count > 0
        axis.bar(
            centres[filled],
            curve.accuracy[filled],
            width,
            color=BLUE.light,
            edgecolor="black",
            label="accuracy",
        )
        gap = curve.confidence[filled] - curve.accuracy[filled]
        axis.bar(
            centres[filled], gap, width, bottom=curve.accuracy[filled], color=VERMILLION.light, alpha=0.35,
            edgecolor=VERMILLION.light, hatch="//", label="gap to confidence",
        )  # fmt: skip
        axis.plot([0, 1], [0, 1], "--", color="grey", label="perfect calibration")
        errors = f"ECE {curve.ece:.3f}\nMCE {curve.mce:.3f}"
        paper = {"facecolor": "white", "edgecolor": "grey"}
        axis.text(0.96, 0.06, errors, ha="right", transform=axis.transAxes, bbox=paper)
        axis.set(title=title, xlabel="confidence", ylabel="accuracy", xlim=(0, 1), ylim=(0, 1))
        axis.legend(loc="upper left", fontsize=8)
    figure.savefig(path, dpi=110, metadata={"Software": None})
