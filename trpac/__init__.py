"""Tyre-road peak adhesion (TRPAC) from Python: estimate, simulate, run scenarios, diagnose a gap, judge pictures.

Everything that the command line does is a function here. Results are small frozen objects; nothing is written and
nothing is printed unless asked. What is heavy is imported when it is first used.
"""

from __future__ import annotations

import logging
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from trpac_core.errors import TrpacError

if TYPE_CHECKING:
    from trpac import effects
    from trpac.estimation import Estimate, Estimates, Estimator, estimate
    from trpac.extras import MissingExtraError
    from trpac.files import (
        Log,
        Road,
        SensorNoise,
        Vehicle,
        list_effects,
        list_roads,
        list_scenarios,
        list_vehicles,
        read_log,
    )
    from trpac.gap import Diagnosis, diagnose
    from trpac.scenarios import ScenarioRun, run, simulate
    from trpac.units import build_fmu
    from trpac.vision import PictureClass, VisionEstimator, classify

_HOMES = {
    "effects": ("effects",),
    "estimation": ("Estimate", "Estimates", "Estimator", "estimate"),
    "extras": ("MissingExtraError",),
    "files": (
        "Log",
        "Road",
        "SensorNoise",
        "Vehicle",
        "list_effects",
        "list_roads",
        "list_scenarios",
        "list_vehicles",
        "read_log",
    ),
    "gap": ("Diagnosis", "diagnose"),
    "scenarios": ("ScenarioRun", "run", "simulate"),
    "units": ("build_fmu",),
    "vision": ("PictureClass", "VisionEstimator", "classify"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Diagnosis",
    "Estimate",
    "Estimates",
    "Estimator",
    "Log",
    "MissingExtraError",
    "PictureClass",
    "Road",
    "ScenarioRun",
    "SensorNoise",
    "TrpacError",
    "Vehicle",
    "VisionEstimator",
    "build_fmu",
    "classify",
    "diagnose",
    "effects",
    "estimate",
    "list_effects",
    "list_roads",
    "list_scenarios",
    "list_vehicles",
    "read_log",
    "run",
    "simulate",
]

logging.getLogger("trpac").addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    """A function or class of this package, from its module, which is imported now."""
    if name == "__version__":
        return version("trpac-fmu")
    if name not in _HOME:
        raise AttributeError(f"module 'trpac' has no attribute {name!r}")
    module = import_module(f"trpac.{_HOME[name]}")
    return module if _HOME[name] == name else getattr(module, name)


def __dir__() -> list[str]:
    """All names, imported already or not."""
    return sorted([*__all__, "__version__"])
