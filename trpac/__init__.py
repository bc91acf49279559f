"""Tyre-road peak adhesion (TRPAC) from Python: estimate, simulate, run scenarios, diagnose a gap, judge pictures.

Functions for the commands of the command line. Results are small frozen objects; files are written only by methods
that say so, and nothing is printed. Modules are imported when they are first used.
"""

from __future__ import annotations

import logging
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from trpac_core.errors import TrpacError

if TYPE_CHECKING:
    from scenarios.car_and_road import Road, Vehicle
    from scenarios.files import SensorNoise
    from scenarios.vision_estimator import PictureClass, VisionEstimator, classify
    from scenarios.wheel_estimator import Estimate, Estimator
    from sim2real.logs import Log
    from trpac import effects
    from trpac.estimation import Estimates, estimate
    from trpac.example_files import example
    from trpac.extras import MissingExtraError
    from trpac.files import list_effects, list_roads, list_scenarios, list_vehicles, read_log
    from trpac.gap import Diagnosis, diagnose
    from trpac.scenarios import ScenarioRun, run, simulate
    from trpac.units import build_fmu, build_ssp

_MODULES = {
    "scenarios.car_and_road": ("Road", "Vehicle"),
    "scenarios.files": ("SensorNoise",),
    "scenarios.vision_estimator": ("PictureClass", "VisionEstimator", "classify"),
    "scenarios.wheel_estimator": ("Estimate", "Estimator"),
    "sim2real.logs": ("Log",),
    "trpac.estimation": ("Estimates", "estimate"),
    "trpac.example_files": ("example",),
    "trpac.extras": ("MissingExtraError",),
    "trpac.files": ("list_effects", "list_roads", "list_scenarios", "list_vehicles", "read_log"),
    "trpac.gap": ("Diagnosis", "diagnose"),
    "trpac.scenarios": ("ScenarioRun", "run", "simulate"),
    "trpac.units": ("build_fmu", "build_ssp"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

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
    "build_ssp",
    "classify",
    "diagnose",
    "effects",
    "estimate",
    "example",
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
    """A function or class of this package; its module is imported now."""
    if name == "__version__":
        return version("trpac-fmu")
    if name == "effects":
        return import_module("trpac.effects")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'trpac' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    """All names, imported already or not."""
    return sorted([*__all__, "__version__"])
