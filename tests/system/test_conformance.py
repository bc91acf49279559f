"""The committed matrix of clients is the one that a run gives."""

from __future__ import annotations

import pytest
from foreign_clients import need_client
from long import beyond

from benchmarks.robustness.conformance.cases import CASES
from benchmarks.robustness.conformance.clients import CLIENTS
from benchmarks.robustness.conformance.matrix import Bench, Place, prepare, run_cells
from benchmarks.robustness.conformance.operations import OPERATIONS
from benchmarks.robustness.conformance.outcome import Cell, Outcome
from benchmarks.robustness.conformance.table import DOCUMENT, document, read_cells

UNIT = "TrpacEstimator"
SHORT = {
    "fmpy": tuple(OPERATIONS),
    "fmpy_apart": ("load", "serialised"),
    "c": ("load", "steps", "state", "missing"),
    "libcosimpy": ("steps", "two", "reset", "logging"),
    "ecospy": ("steps", "reset", "state", "nan"),
    "proxyfmu": ("steps",),
}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return prepare(tmp_path_factory.mktemp("conformance"), [UNIT])


def test_the_document_has_every_client_unit_and_operation() -> None:
    found = read_cells(DOCUMENT.read_text(encoding="utf-8"))
    assert set(found) == {Place(c, u, o) for c in CLIENTS for u in CASES for o in OPERATIONS}


def test_a_document_is_read_as_it_was_written() -> None:
    kinds = (
        Cell(Outcome.OK),
        Cell(Outcome.NOT_OFFERED, "a reason: of (some) kind"),
        Cell(Outcome.FAILED, "12."),
    )
    cells = {Place(c, u, o): kinds[len(c + u + o) % 3] for c in CLIENTS for u in CASES for o in OPERATIONS}
    read = read_cells(document(cells, {"Python": "3.11"}))
    assert read == cells


@pytest.mark.e2e
@pytest.mark.parametrize("client", beyond(3, SHORT))
def test_a_short_run_gives_the_documents_cells(bench: Bench, client: str) -> None:
    need_client(CLIENTS[client].package)
    cells = run_cells(bench, client, UNIT, SHORT[client])
    committed = read_cells(DOCUMENT.read_text(encoding="utf-8"))
    assert {p: (c.outcome, c.reason) for p, c in cells.items() if c.outcome is not committed[p].outcome} == {}
