"""Imports go one way: what lies below knows nothing of what stands on it, and no files import in a circle."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BELOW = {
    "trpac_core": "",
    "scenarios": "trpac_core",
    "fmu_src": "trpac_core scenarios",
    "models": "trpac_core scenarios",
    "sim2real": "trpac_core scenarios",
    "trpac_hil": "trpac_core scenarios fmu_src sim2real",
    "trpac": "trpac_core scenarios fmu_src sim2real",
    "trpac_cli": "trpac_core scenarios fmu_src sim2real trpac_hil trpac",
}
"""What each folder may import of ours; a folder that is not listed may import all, and none of these imports it."""
FLOORS = [
    "result", "logs", "observing", "hypotheses", "where how_far discrepancy", "own_model", "next_manoeuvre", "reporting"
]  # fmt: skip
"""The diagnosis from below; the files on top put them together."""

Graph = dict[str, set[str]]
"""Files by their modules' names, and which of them each imports: at its top, in a function, or for its types."""


@cache
def imports(root: Path) -> Graph:
    """The graph of all files of a project's packages, and of those beside them."""
    packages = [
        folder for folder in root.iterdir() if folder.name in BELOW or (folder / "__init__.py").is_file()
    ]
    files = {}
    for path in (*root.glob("*.py"), *(path for folder in packages for path in folder.rglob("*.py"))):
        *folders, file = path.relative_to(root).with_suffix("").parts
        files[".".join(folders if file == "__init__" else [*folders, file])] = path
    return {
        name: {m for n in named(name, path) if (m := known(n, files))} - {name}
        for name, path in files.items()
    }


def named(name: str, path: Path) -> Iterator[str]:
    """What a file's imports name, as from its project's root."""
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            yield from (".".join([*above, *filter(None, [node.module]), alias.name]) for alias in node.names)


def known(name: str, files: dict[str, Path]) -> str:
    """The file that a name stands for or in; empty where it is none of ours."""
    while name and name not in files:
        name = name.rpartition(".")[0]
    return name


def upwards(graph: Graph) -> list[str]:
    """Every import of a folder that the importing one does not stand on."""
    return [
        f"{name} imports {target}"
        for name, targets in graph.items()
        for target in sorted(targets)
        if (folder := name.split(".")[0]) in BELOW
        and target.split(".")[0] not in {folder, *BELOW[folder].split()}
    ]


def circle(graph: Graph) -> str:
    """A circle of files, each of which imports the next; empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " imports ".join(reversed(error.args[1]))
    return ""


def test_imports_go_down():
    assert upwards(imports(ROOT)) == []


def test_no_files_import_in_a_circle():
    assert circle(imports(ROOT)) == ""


def test_what_goes_up_or_round_is_named(tmp_path):
    texts = {
        "trpac_core/__init__.py": "",
        "trpac_core/tyre.py": "def late():\n    from scenarios.files import load\n",
        "scenarios/__init__.py": "",
        "scenarios/files.py": "from scenarios.plant import pipeline\nimport trpac_core.tyre as tyre\n",
        "scenarios/plant/__init__.py": "",
        "scenarios/plant/pipeline.py": "import typing\nif typing.TYPE_CHECKING:\n    from .. import files\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    graph = imports(tmp_path)
    assert graph["scenarios.files"] == {"scenarios.plant.pipeline", "trpac_core.tyre"}
    assert upwards(graph) == ["trpac_core.tyre imports scenarios.files"]
    names = circle(graph).split(" imports ")
    assert names[0] == names[-1]
    assert all(target in graph[name] for name, target in pairwise(names))
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == ""


def imports_of_test_files(folder: Path) -> list[str]:
    """Every import of a test file, by a test file or by what tests share."""
    tests = {path.stem for path in folder.rglob("test_*.py")}
    return [
        f"{path.relative_to(folder)} imports {module}"
        for path in sorted(folder.rglob("*.py"))
        for name in named(path.stem, path)
        for module in name.split(".")
        if module in tests
    ]


def test_no_test_file_imports_another_and_what_they_share_is_none(tmp_path):
    assert imports_of_test_files(ROOT / "tests") == []
    shared = [path.name for path in (ROOT / "tests" / "support").iterdir() if path.is_file()]
    assert shared
    assert [name for name in shared if name.startswith("test_") or name.endswith("_test.py")] == []
    (tmp_path / "test_one.py").write_text("ROAD = 1\n")
    (tmp_path / "test_two.py").write_text("def late():\n    from test_one import ROAD\n")
    assert imports_of_test_files(tmp_path) == ["test_two.py imports test_one"]


@pytest.mark.parametrize("floor", FLOORS)
def test_the_diagnosis_is_built_floor_by_floor(floor):
    known_there = set(" ".join(FLOORS[: FLOORS.index(floor)]).split())
    for part in floor.split():
        graph = {
            n: targets for n, targets in imports(ROOT).items() if f"{n}.".startswith(f"sim2real.{part}.")
        }
        assert graph
        for name, targets in graph.items():
            used = {target.split(".")[1] for target in targets if target.startswith("sim2real.")}
            assert used <= known_there | {part}, name


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        ("trpac", {"numba", "numpy", "pandas", "scipy", "cv2", "onnxruntime", "matplotlib", "pydantic"}),
        ("trpac_cli.main", {"numba", "numpy", "pandas", "scipy", "cv2", "onnxruntime", "matplotlib"}),
        ("scenarios.plant.pipeline", {"scipy.signal", "scipy.stats", "cv2", "onnxruntime", "matplotlib"}),
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
