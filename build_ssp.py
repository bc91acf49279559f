"""Build an SSP 1.0 package of plant, driver and estimator, validate it, run it; print its path and SHA-256."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from build_fmu import EXIT_BUILD, EXIT_INVALID, EXIT_RUN, EXIT_USAGE

RUN_S = 0.5
"""How long the package is run after it is built [s]."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="Exit codes: 0 done, 2 usage, 3 build, 4 validation, 5 run."
    )
    parser.add_argument(
        "--system",
        default="four_wheels",
        metavar="NAME",
        help="four_wheels (TrpacEstimator4W) or one_wheel (TrpacEstimator); default: %(default)s",
    )
    parser.add_argument(
        "--out", default=Path("dist"), type=Path, metavar="DIR", help="folder (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        from fmu_src.packaging import BuildError, build_unit, sha256
        from fmu_src.ssp import SYSTEMS, build_package
        from fmu_src.ssp_client import problems, simulate
        from fmu_src.units import UNITS
    except ImportError as error:
        print(
            f"build_ssp.py: {error}. Run it with the project's interpreter: .venv/bin/python build_ssp.py",
            file=sys.stderr,
        )
        return EXIT_BUILD
    if options.system not in SYSTEMS:
        known = ", ".join(sorted(SYSTEMS))
        print(f"build_ssp.py: '{options.system}' is not a system. Known: {known}.", file=sys.stderr)
        return EXIT_USAGE
    wiring = SYSTEMS[options.system]
    try:
        with tempfile.TemporaryDirectory(prefix="trpac_ssp_") as scratch:
            units = {
                name: build_unit(UNITS[name], Path(scratch) / f"{name}.fmu")
                for name in wiring.elements.values()
            }
            path = build_package(wiring, units, options.out / f"{wiring.name}.ssp")
    except (BuildError, OSError) as error:
        print(f"build_ssp.py: {error}", file=sys.stderr)
        return EXIT_BUILD
    print(f"built      {path.stat().st_size / 1e6:.2f} MB: {', '.join(wiring.elements.values())}")
    found = problems(path)
    if found:
        print("\n".join(["build_ssp.py: the package does not validate:", *found]), file=sys.stderr)
        return EXIT_INVALID
    print("validated  against the schemas of SSP 1.0")
    try:
        simulate(path, RUN_S)
    except Exception as error:  # noqa: BLE001 - fmpy raises bare Exceptions; the exit code tells that the run failed
        print(f"build_ssp.py: the package does not run: {error}", file=sys.stderr)
        return EXIT_RUN
    print(f"ran        {RUN_S:g} s in fmpy")
    print(f"package    {path}")
    print(f"SHA-256    {sha256(path)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
