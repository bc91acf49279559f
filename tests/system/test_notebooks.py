"""The notebooks run in an empty folder, come without outputs, and end with what they are to show."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parents[2] / "docs" / "notebooks"
LONGEST_CELL_S = 600
TRAINING = ("torch", "onnxscript", "efficientnet_lite_pytorch")
"""Packages without which the camera's notebook leaves its training out."""


def estimates(text: str) -> None:
    inside = re.search(r"lies in the interval in (\d+)%", text)
    errors = re.search(r"Mean error: ([\d.]+) in these rows, ([\d.]+)", text)
    assert inside
    assert int(inside[1]) >= 95
    assert errors
    assert float(errors[1]) < 0.05 < float(errors[2])
    assert "before braking: source none" in text
    assert "while braking: source tyre" in text
    assert "with camera: 0.29" in text


def diagnoses(text: str) -> None:
    verdicts = re.findall(r"^(no_gap|identified|compound|partial|ambiguous|unknown)$", text, re.MULTILINE)
    assert verdicts == ["identified", "ambiguous", "identified"]
    found = re.search(r"^found: +torque_lag \{'time_constant_s': ([\d.]+)\}", text, re.MULTILINE)
    assert found
    assert float(found[1]) == pytest.approx(0.08, abs=0.005)
    assert "second diagnosis: no_gap" in text
    assert re.search(r"mass_offset .*torque_gain.*do not separate them", text)
    assert re.search(r"mass_offset \(mass_kg 1[45]\d", text)


def runs_the_unit(text: str) -> None:
    difference = re.search(r"largest difference .* is ([\d.e+-]+)$", text, re.MULTILINE)
    assert difference
    assert float(difference[1]) < 1e-9
    ends = dict(re.findall(r"^road ([\d.]+): TRPAC .* ([\d.]+)$", text, re.MULTILINE))
    assert list(ends) == ["0.9", "0.3", "0.5"]
    assert float(ends["0.9"]) > 0.7
    assert float(ends["0.3"]) == pytest.approx(0.3, abs=0.1)


def judges_pictures(text: str) -> None:
    drives = re.search(r"^(\d+) of 12 drives are mostly right", text, re.MULTILINE)
    assert drives
    assert 9 <= int(drives[1]) < 12, "one drive is to show that pictures of a drive err together"
    if missing := [name for name in TRAINING if find_spec(name) is None]:
        assert "The training is left out" in text
        assert "shipped networks" in text
        warnings.warn(f"not trained: {', '.join(missing)} not installed", stacklevel=2)
    else:
        assert "surface.onnx" in text
        assert re.search(r"own, effort [\d.]+: \d+% of \d+ test pictures are right", text)
        assert "with the own networks" in text


SHOWN: dict[str, Callable[[str], None]] = {
    "estimate_a_drive": estimates,
    "diagnose_a_gap": diagnoses,
    "unit_in_fmpy_and_ssp": runs_the_unit,
    "camera_on_own_pictures": judges_pictures,
}


def test_every_notebook_is_run() -> None:
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_is_committed_without_outputs(name: str) -> None:
    for cell in nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4).cells:
        if cell.cell_type == "code":
            assert not cell.outputs
            assert cell.execution_count is None


@pytest.mark.e2e
@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_runs_and_shows_what_it_is_to(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOKS.parents[1]))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # plots go into the notebook
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
    client = NotebookClient(
        notebook,
        timeout=LONGEST_CELL_S,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs), "there is no plot"
    SHOWN[name]("\n".join(output.text for output in outputs if output.output_type == "stream"))
