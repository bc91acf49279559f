"""The committed matrix of clients is the one that a run gives."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import cache

import pytest
from foreign_clients import need_client
from long import beyond

from benchmarks.robustness.conformance.cases import TITLES
from benchmarks.robustness.conformance.clients import CLIENTS
from benchmarks.robustness.conformance.matrix import Bench, Place, prepare, run_cells
from benchmarks.robustness.conformance.operations import OPERATIONS
from benchmarks.robustness.conformance.outcome import Cell, Outcome
from benchmarks.robustness.conformance.table import DOCUMENT, document, read_cells

UNIT, NATIVE = "TrpacEstimator", "TrpacEstimator native"
SHORT = (
    ("fmpy", UNIT, tuple(OPERATIONS)),
    ("c", UNIT, ("steps", "state")),
    ("c", NATIVE, ("steps", "serialised", "again")),
    ("fmpy_apart", UNIT, ("load", "serialised")),
    ("libcosimpy", UNIT, ("steps", "two", "reset", "logging")),
    ("libcosimpy", NATIVE, ("two", "logging")),
    ("ecospy", UNIT, ("steps", "reset", "state", "nan")),
    ("proxyfmu", UNIT, ("steps",)),
    ("proxyfmu", NATIVE, ("steps", "missing")),
)
"""Client, unit and operations."""


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Bench]:
    """Prepares the bench of one unit at its first use; skips where the native unit has no compiler."""

    @cache
    def of(unit: str) -> Bench:
        if TITLES[unit].native and shutil.which("cc") is None:
            pytest.skip("the native unit needs a C compiler")
        return prepare(tmp_path_factory.mktemp("conformance"), [unit])

    return of


def test_the_document_has_every_client_unit_and_operation() -> None:
    found = read_cells(DOCUMENT.read_text(encoding="utf-8"))
    assert set(found) == {Place(c, u, o) for c in CLIENTS for u in TITLES for o in OPERATIONS}


def test_a_document_is_read_as_it_was_written() -> None:
    kinds = (
        Cell(Outcome.OK),
        Cell(Outcome.NOT_OFFERED, "a reason: of (some) kind"),
        Cell(Outcome.FAILED, "12."),
    )
    cells = {Place(c, u, o): kinds[len(c + u + o) % 3] for c in CLIENTS for u in TITLES for o in OPERATIONS}
    read = read_cells(document(cells, {"Python": "3.11"}))
    assert read == cells


@pytest.mark.e2e
@pytest.mark.parametrize(("client", "unit", "operations"), beyond(3, SHORT))
def test_a_short_run_gives_the_documents_cells(
    benches: Callable[[str], Bench], client: str, unit: str, operations: tuple[str, ...]
) -> None:
    need_client(CLIENTS[client].package)
    cells = run_cells(benches(unit), client, unit, operations)
    committed = read_cells(DOCUMENT.read_text(encoding="utf-8"))
    assert {p: (c.outcome, c.reason) for p, c in cells.items() if c.outcome is not committed[p].outcome} == {}
