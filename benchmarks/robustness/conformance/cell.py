"""One client on one unit, in a process that may crash: one line of JSON for each operation.

``python -m benchmarks.robustness.conformance.cell CLIENT UNIT ARCHIVE FOLDER PICTURE PICTURE OPERATION...``
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from .cases import TITLES
from .clients import CLIENTS
from .outcome import Cell, NotOfferedError, Outcome


def outcome_of(work: object, operation: str) -> Cell:
    """What came of one operation."""
    try:
        work.run(operation)  # type: ignore[attr-defined]
    except NotOfferedError as error:
        return Cell(Outcome.NOT_OFFERED, str(error))
    except Exception as error:  # noqa: BLE001 - clients raise bare exceptions, and each is a cell of the table
        return Cell(Outcome.FAILED, f"{type(error).__name__}: {error}")
    return Cell(Outcome.OK)


def main() -> None:
    client, unit, archive, folder, first, second, *operations = sys.argv[1:]
    case, pictures = TITLES[unit], (Path(first), Path(second))
    # The clients and the units may write to standard output; the answers go to a copy of it.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for operation in operations:
        print(json.dumps({"begins": operation}), file=answers, flush=True)
        try:
            runner = CLIENTS[client].open(case, Path(archive), Path(folder), pictures)
        except NotOfferedError as error:
            cell = Cell(Outcome.NOT_OFFERED, str(error))
        else:
            cell = outcome_of(runner, operation)
        line = {"ends": operation, "outcome": cell.outcome.name, "reason": cell.reason}
        print(json.dumps(line), file=answers, flush=True)
    os._exit(0)  # see "Limits" in docs/reference/unit.md


if __name__ == "__main__":
    main()
