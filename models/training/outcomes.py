"""What trainings and their judgement come to, for the cards."""

from __future__ import annotations

from dataclasses import dataclass

from .calibrate import Reliability
from .nets import SurfaceNet
from .scores import ClassScore
from .train_surface import BATCH


@dataclass(frozen=True)
class Stage:
    """A net that has learned its classes, how that came about, and how much each tower's logits count."""

    net: SurfaceNet
    patches: int
    steps: int
    seconds: float
    device: str
    says: tuple[float, ...] = (1.0,)

    def told(self) -> str:
        """The effort in words, for the card."""
        return (
            f"{self.steps} steps of {BATCH} on {self.patches} patches, {self.seconds:.0f} s on {self.device}"
        )


@dataclass(frozen=True)
class Outcome:
    """A trained and calibrated classifier with its scores on the judged sets."""

    net: SurfaceNet
    temperature: float
    reliabilities: dict[str, tuple[Reliability, Reliability]]
    entropies: tuple[float, float]
    picture_scores: dict[str, ClassScore]
    patch_scores: dict[str, ClassScore]
    readings: dict[str, float]
