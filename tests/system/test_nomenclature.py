"""Names in the code are those of the nomenclature page: variables of units, log columns, symbols, units in names."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from fmu_src.units import UNITS
from scenarios.files import load_scenario
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from trpac_core.parameters.variables import Kind

ROOT = Path(__file__).resolve().parents[2]
TABLES = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (ROOT / "docs" / "reference" / "nomenclature.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and not line.startswith(("|---", "| symbol", "| suffix"))
]
ROWS = [row for row in TABLES if len(row) > 2]
SYMBOL, CODE, UNIT, LOG, DIMENSION = 0, 2, 3, 4, 5
PRODUCT = ("trpac", "trpac_core", "fmu_src", "scenarios", "sim2real", "trpac_hil", "trpac_cli", "models")
NOT_YET = ("trpac_core/robust", "trpac_core/vision", "sim2real", "models")
"""Folders that still have some of the words of no field."""
OF_NO_FIELD = re.compile(
    "places?|placing|looks?|looked|verdicts?|traces?|elastic|sight|hum|wander(ing)?|quiet|sluggish|suspects?|telling|tells?"
    "|told|says?|said|foresight|partner|neighbours?|film|spread|ferry|eyes"
)
NAMED_ELSEWHERE = {
    "groups_looked_at": "trpac_core.vision",
    "told_by_bus": "trpac_core.vision",
    "verdicts": "trpac_core.vision",
    "verdict": "diagnosis.json, and Diagnosis.verdict and Estimates.verdict of the package",
    "Verdict": "sim2real",
    "Place": "sim2real",
    "spread": "the sigma points of Wan and van der Merwe (2000), scenarios/peers/tuning.yaml",
    "said": "trpac_core.robust",
    "water_film": "hydroplaning",
}
"""Identifiers with such a word that another package, a file or the literature gives."""


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


SUFFIXES = {name.lstrip("_") for row in TABLES if len(row) == 2 for name in names(row[0])}


def base(variable: str) -> str:
    """A variable's name without its wheel, side or `vehicle`."""
    return re.sub(r"\.(fl|fr|rl|rr|left|right|vehicle)$", "", variable)


def identifiers(folders: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """File and name of all that the code of some folders calls by a name."""
    for path in sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        file = str(path.relative_to(ROOT))
        yield file, path.stem
        for node in ast.walk(ast.parse(path.read_bytes())):
            for attribute in ("id", "attr", "arg", "name"):
                if isinstance(name := getattr(node, attribute, None), str):
                    yield file, name


def strange_words(name: str) -> list[str]:
    words = (word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name))
    return [word for word in words if OF_NO_FIELD.fullmatch(word)]


def unit_of(name: str) -> str:
    """The parts of units that a name ends in, joined; empty where it ends in none."""
    atoms = {atom for suffix in SUFFIXES for atom in suffix.split("_")}
    parts = name.lower().strip("_").split("_")
    first = next((i for i in range(len(parts), 0, -1) if parts[i - 1] not in atoms), 0)
    return "_".join(parts[max(first, 1) :])


def test_the_page_is_read():
    assert len(ROWS) > 25
    assert all(len(row) == 6 for row in ROWS)
    assert len(SUFFIXES) > 15


def test_unit_variables_exist_with_their_units():
    variables = {base(v.name): v for unit in UNITS.values() for v in unit.variables}
    for row in ROWS:
        for name in names(row[UNIT]):
            assert name in variables
            if row[DIMENSION]:
                assert variables[name].unit == row[DIMENSION].replace("-", "1")


def test_every_signal_of_the_units_is_on_the_page():
    listed = {name for row in ROWS for name in names(row[UNIT])}
    signals = {
        base(v.name)
        for unit in UNITS.values()
        for v in unit.variables
        if v.causality in ("input", "output") and v.kind in (Kind.REAL, Kind.BOOLEAN)
    }
    assert signals - listed == set()


def test_log_columns_are_those_of_the_page():
    scenario = load_scenario("paper_simulation")
    columns = set(make_scenario_log(scenario, drive(scenario).rows(10)).columns) - {"time_s"}
    listed = {name for row in ROWS for name in names(row[LOG])}
    assert {re.sub("_(fr|rl|rr)_", "_fl_", column) for column in columns} == listed


@pytest.mark.parametrize("name", sorted({name for row in ROWS for name in names(row[CODE])}))
def test_identifiers_exist_in_the_core(name):
    sources = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "trpac_core").rglob("*.py"))
    assert re.search(rf"\b{re.escape(name)}\b", sources)


def test_symbols_with_an_index_are_on_the_page():
    listed = {name for row in ROWS for name in (*row[SYMBOL].split(", "), *names(row[CODE]))}
    used = {
        (f, n)
        for f, n in identifiers(PRODUCT[:4])
        if re.fullmatch(r"[A-Z]_[a-z0-9]{1,6}(_m)?|theta_(hat|img)", n)
    }
    assert {(file, name) for file, name in used if name.removesuffix("_m") not in listed} == set()


def test_units_in_names_are_on_the_page():
    assert unit_of("speed_m_s") == "m_s"
    assert unit_of("NOISE_NM_S2") == "nm_s2"
    assert unit_of("m") == unit_of("K_v") == unit_of("speed") == ""
    found = {(file, name) for file, name in identifiers(PRODUCT) if unit_of(name)}
    assert {(file, name) for file, name in found if unit_of(name) not in SUFFIXES} == set()


def test_no_identifier_has_a_word_of_no_field():
    assert strange_words("_tellTruth") == ["tell"]
    assert strange_words("WHEEL_SIGHT") == ["sight"]
    found = {
        (file, name)
        for file, name in identifiers(PRODUCT)
        if not file.startswith(NOT_YET) and strange_words(name) and name not in NAMED_ELSEWHERE
    }
    assert found == set()
