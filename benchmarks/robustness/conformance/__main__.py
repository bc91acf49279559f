"""Run the matrix and write docs/reference/conformance.md."""

from __future__ import annotations

import argparse
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .cases import TITLES
from .clients import CLIENTS
from .matrix import run
from .outcome import Outcome
from .table import DOCUMENT, document, read_cells


def versions() -> dict[str, str]:
    """Of what the matrix ran on."""
    found = {"Python": platform.python_version(), "Linux": platform.machine()}
    for package in ("fmpy", "pythonfmu", "libcosimpy", "ecospy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "(not installed)"
    return found


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness.conformance", description=__doc__)
    parser.add_argument("--client", action="append", choices=list(CLIENTS), help="only this one; repeatable")
    parser.add_argument("--unit", action="append", choices=list(TITLES), help="only this one; repeatable")
    parser.add_argument("--out", type=Path, default=DOCUMENT, help="what is not run now stays as it is there")
    options = parser.parse_args()
    cells = run(options.client or CLIENTS, options.unit or TITLES)
    for place, cell in cells.items():
        if cell.outcome is Outcome.FAILED:
            print(f"{place.client}, {place.unit}, {place.operation}: {cell.reason}", file=sys.stderr)
    before = read_cells(options.out.read_text(encoding="utf-8")) if options.out.is_file() else {}
    options.out.write_text(document(before | cells, versions()), encoding="utf-8")
    print(options.out)
    counts = {outcome.name: sum(c.outcome is outcome for c in cells.values()) for outcome in Outcome}
    print(counts)
    return int(counts["FAILED"] > 0)


if __name__ == "__main__":
    sys.exit(main())
