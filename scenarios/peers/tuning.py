"""The file of the peers' tuning."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from scenarios.peers.kalman import KalmanTuning
from scenarios.peers.slip_slope import SlipSlopeTuning
from scenarios.strict import load_strict
from scenarios.yaml_text import to_yaml

TUNING_FILE = Path(__file__).with_name("tuning.yaml")
HEADER = "# Written by `python -m benchmarks.accuracy.tune_peers`; see docs/theory/peers.md.\n"


@dataclass(frozen=True)
class Tuning:
    """Tuning of all peers."""

    slip_slope: SlipSlopeTuning = field(default_factory=SlipSlopeTuning)
    ekf: KalmanTuning = field(default_factory=KalmanTuning)
    ukf: KalmanTuning = field(default_factory=KalmanTuning)


class _TuningFile(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    how: dict[str, Any]
    slip_slope: SlipSlopeTuning
    ekf: KalmanTuning
    ukf: KalmanTuning


@lru_cache
def load_tuning(path: Path = TUNING_FILE) -> Tuning:
    """The tuning of a file; raises ScenarioError."""
    file = load_strict(path, _TuningFile)
    return Tuning(file.slip_slope, file.ekf, file.ukf)


def write_tuning(path: Path, tuning: Tuning, how: dict[str, Any]) -> None:
    """Write a tuning and the description of how it was found."""
    values = {name: _rounded(part) for name, part in asdict(tuning).items()}
    path.write_text(HEADER + to_yaml({"how": how, **values}), encoding="utf-8")


def _rounded(part: dict[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.4g}") for name, value in part.items()}
