"""Build an SSP 1.0 package of plant, driver and estimator, validate it, run it; print its path and SHA-256."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from build_fmu import KINDS, NATIVE, PYTHON
from fmu_src.build_command import EPILOG, Product, run_build

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
        from fmu_src.native.build import NATIVE_UNITS, build_native
        from fmu_src.packaging import build_unit
        from fmu_src.ssp import SYSTEMS, build_package
        from fmu_src.ssp_client import problems, simulate
        from fmu_src.units import UNITS

        native = options.kind == NATIVE

        def unit_of(name: str, target: Path) -> Path:
            if native and name in NATIVE_UNITS:
                return build_native(UNITS[name].info, target)
            return build_unit(UNITS[name], target)

        def build(name: str) -> Path:
            wiring = SYSTEMS[name]
            with tempfile.TemporaryDirectory(prefix="trpac_ssp_") as scratch:
                units = {
                    unit: unit_of(unit, Path(scratch) / f"{unit}.fmu") for unit in wiring.elements.values()
                }
                target = options.out / f"{wiring.name}{'_native' if native else ''}.ssp"
                return build_package(wiring, units, target)

        def run(path: Path) -> str:
            simulate(path, RUN_S)
            return f"{RUN_S:g} s in fmpy"

        return Product("package", "system", SYSTEMS, build, problems, "against the schemas of SSP 1.0", run)

    return run_build("build_ssp.py", load, options.system)


if __name__ == "__main__":
    sys.exit(main())
