"""The nomenclature page names what is there: unit variables, log columns, identifiers of the code."""

import re
from pathlib import Path

import pytest

from fmu_src.units import UNITS
from scenarios.files import load_scenario
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log

ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and not line.startswith(("|---", "| symbol"))
]
CODE, UNIT, LOG, DIMENSION = 2, 3, 4, 5


def names(cell):
    return re.findall(r"`([^`]+)`", cell)


def test_the_page_is_read():
    assert len(ROWS) > 25
    assert all(len(row) == 6 for row in ROWS)


def test_unit_variables_exist_with_their_units():
    variables = {v.name: v for v in UNITS["TrpacEstimator"].variables}
    for row in ROWS:
        for name in names(row[UNIT]):
            assert name in variables
            if row[DIMENSION]:
                assert variables[name].unit == row[DIMENSION].replace("-", "1")


def test_every_output_of_the_unit_is_on_the_page():
    listed = {name for row in ROWS for name in names(row[UNIT])}
    outputs = {v.name for v in UNITS["TrpacEstimator"].variables if v.causality == "output"}
    assert outputs - listed <= {"excitation_flag", "frame_age"}


def test_log_columns_exist():
    scenario = load_scenario(ROOT / "scenarios" / "paper_simulation.yaml")
    columns = set(make_scenario_log(scenario, drive(scenario).rows(10)).columns)
    assert {name for row in ROWS for name in names(row[LOG])} <= columns


@pytest.mark.parametrize("name", sorted({name for row in ROWS for name in names(row[CODE])}))
def test_identifiers_exist_in_the_core(name):
    sources = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "trpac_core").rglob("*.py"))
    assert re.search(rf"\b{re.escape(name)}\b", sources)
