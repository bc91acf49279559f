"""Data flows one way: what lies below knows nothing of what stands on it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "trpac_core": set(),
    "sim2real": {"trpac_core", "scenarios"},
    "trpac_hil": {"trpac_core", "scenarios", "fmu_src"},
    "models": {"trpac_core", "scenarios"},
    "fmu_src": {"trpac_core", "scenarios"},
    "scenarios": {"trpac_core", "fmu_src"},
}
"""What each may import of ours; the plant is a unit too, and units are clients' in scenarios."""
FLOORS = ["result", "logs", "observing", "where how_far", "which", "next_manoeuvre", "telling"]
"""The diagnosis from below; the files on top put them together."""


def imported(path):
    """Names of all modules that a file imports, by whatever form."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_knows_only_what_it_stands_on(package):
    known = PACKAGES[package] | {package}
    for path in (ROOT / package).rglob("*.py"):
        used = {name.split(".")[0] for name in imported(path)} & (set(PACKAGES) | {"trpac_cli", "benchmarks"})
        assert used <= known, path


@pytest.mark.parametrize("floor", FLOORS)
def test_the_diagnosis_is_built_floor_by_floor(floor):
    known = set(" ".join(FLOORS[: FLOORS.index(floor)]).split())
    for part in floor.split():
        place = ROOT / "sim2real" / part
        paths = list(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        assert paths
        for path in paths:
            used = {name.split(".")[1] for name in imported(path) if name.startswith("sim2real.")}
            assert used <= known | {part}, path


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        ("trpac_cli.main", {"numba", "numpy", "pandas", "scipy", "cv2", "onnxruntime", "matplotlib"}),
        ("scenarios.plant", {"scipy.signal", "scipy.stats", "cv2", "onnxruntime", "matplotlib"}),
        ("sim2real.diagnose", {"scipy.signal", "scipy.stats", "matplotlib"}),
    ],
)
def test_what_is_slow_to_load_is_loaded_where_it_is_needed(module, slow):
    told = subprocess.run(
        [sys.executable, "-c", f"import sys, {module}; print(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert not slow & set(told.stdout.split())
