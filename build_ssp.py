"""Build an SSP 1.0 package of plant, driver and estimator, validate it, run it; print its path and SHA-256."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fmu_src.build_command import EPILOG, Product, run_build
from fmu_src.kinds import KINDS, PYTHON

RUN_S = 0.5
"""How long the package is run after it is built [s]."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, epilog=EPILOG)
    parser.add_argument(
        "--system",
        default="four_wheels",
        metavar="NAME",
        help="four_wheels (TrpacEstimator4W) or one_wheel (TrpacEstimator); default: %(default)s",
    )
    parser.add_argument(
        "--kind",
        choices=KINDS,
        default=PYTHON,
        help="of the estimator, see build_fmu.py; with native the file is NAME_native.ssp (default: %(default)s)",
    )
    parser.add_argument(
        "--out", default=Path("dist"), type=Path, metavar="DIR", help="folder (default: %(default)s)"
    )
    options = parser.parse_args(arguments)

    def load() -> Product:
        from fmu_src.ssp import SYSTEMS, build_system
        from fmu_src.ssp_client import problems, simulate

        def build(name: str) -> Path:
            return build_system(name, options.out, options.kind)

        def run(path: Path) -> str:
            simulate(path, RUN_S)
            return f"{RUN_S:g} s in fmpy"

        return Product("package", "system", SYSTEMS, build, problems, "against the schemas of SSP 1.0", run)

    return run_build("build_ssp.py", load, options.system)


if __name__ == "__main__":
    sys.exit(main())
