"""Files that are shipped with the package, by name: scenarios, vehicles, roads, manoeuvres, cameras and sweeps."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from scenarios.errors import ScenarioError, suggestion
from trpac_core.files import quoted

FOLDERS = {
    "scenario": "",
    "vehicle": "vehicles",
    "road": "roads",
    "manoeuvre": "manoeuvres",
    "camera": "cameras",
    "sweep": "sweeps",
}
"""Folder of each kind of file."""
PAPER_VEHICLE = "four_in_wheel_motor_ev"
"""Shipped vehicle with the values of Table 3 in Tian et al. 2022."""


def networks_folder() -> Path:
    """The folder of the trained networks: segmenter.onnx and surface.onnx."""
    return Path(str(files("models")))


def shipped(kind: str) -> dict[str, Path]:
    """Paths of the shipped files of a kind by name, in alphabetical order."""
    return _named(_folder(kind))


def located(kind: str, given: str | Path) -> Path:
    """The path of a file: a path as given, or the shipped file of a name without ending and folder.

    Raises
    ------
    ScenarioError
        A name that is neither a file nor shipped.
    """
    return located_in(_folder(kind), kind, given)


def located_in(folder: Path, kind: str, given: str | Path) -> Path:
    """The path of a file: a path as given, or the file in a folder of a name without ending; raises ScenarioError."""
    path = Path(given)
    if path.suffix or len(path.parts) != 1 or path.exists():
        return path
    known = _named(folder)
    if path.name not in known:
        raise ScenarioError(
            f"{quoted(path)}: neither a file nor the name of a shipped {kind}; {suggestion(path.name, known)}"
        )
    return known[path.name]


def _folder(kind: str) -> Path:
    return Path(str(files(__package__))) / FOLDERS[kind]


def _named(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
