"""Build, validate and smoke-run a co-simulation unit; print its path and SHA-256."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from functools import partial
from pathlib import Path

from fmu_src.build_command import EPILOG, Product, run_build
from fmu_src.kinds import KINDS, NATIVE, PYTHON, build, known_units

SMOKE_STEPS, SMOKE_STEP_S = 100, 0.001
"""Steps of the smoke run, and their length [s]."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, epilog=EPILOG)
    parser.add_argument(
        "--slave", default="TrpacEstimator", metavar="NAME", help="unit to build (default: %(default)s)"
    )
    parser.add_argument(
        "--kind",
        choices=KINDS,
        default=PYTHON,
        help="python: with the networks, the host needs Python; native: in C, no pictures, the host needs nothing; "
        "the file is NAME_native.fmu (default: %(default)s)",
    )
    parser.add_argument(
        "--fmi",
        choices=(2, 3),
        default=2,
        type=int,
        help="version of FMI, 2.0 or 3.0; a native unit for 3.0 is NAME_native_fmi3.fmu (default: %(default)s)",
    )
    parser.add_argument(
        "--flat",
        action="store_true",
        help="names with _ for dots, for tools that make structures of dotted names; the file is NAME_flat.fmu",
    )
    parser.add_argument(
        "--out", default=Path("dist"), type=Path, metavar="DIR", help="folder (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    if options.fmi == 3 and options.kind != NATIVE:
        parser.error("--fmi 3 is for native units: add --kind native")

    def load() -> Product:
        known = known_units(options.kind)
        chosen = {"kind": options.kind, "fmi": options.fmi, "flat": options.flat}
        make = partial(build, folder=options.out, **chosen)
        return Product("unit", f"{options.kind} unit", known, make, validate, "no problems found", smoke_run)

    return run_build("build_fmu.py", load, options.slave)


def validate(path: Path) -> list[str]:
    """Problems that fmpy's validation finds."""
    from fmpy.validation import validate_fmu

    return list(validate_fmu(str(path)))


def smoke_run(path: Path) -> str:
    """Instantiate the unit and step it with rolling wheels; returns how many steps, and the mean time of one."""
    from fmu_src.trial import rolling, run
    from scenarios.fmu_client.opening import opened
    from scenarios.fmu_client.unpacking import unpack_unit

    name = path.stem.removesuffix("_flat")
    if name.endswith("_fmi3"):
        folder = unpack_unit(path)
        try:
            outcome = run(folder, SMOKE_STEPS)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        if not outcome["ran"]:
            raise RuntimeError(outcome["error"])
        return f"{SMOKE_STEPS} steps, {outcome['step_us']:.1f} us each"
    with opened(path, name.removesuffix("_native"), {}) as unit:
        for variable in unit.variables:
            value = rolling(variable.name) if variable.causality == "input" else None
            if value is not None:
                unit.set({variable.name: value})
        started = time.perf_counter()
        for step in range(SMOKE_STEPS):
            unit.slave.doStep(step * SMOKE_STEP_S, SMOKE_STEP_S)
        elapsed = time.perf_counter() - started
        unit.slave.terminate()
    return f"{SMOKE_STEPS} steps, {elapsed / SMOKE_STEPS * 1e6:.1f} us each"


if __name__ == "__main__":
    sys.exit(main())
