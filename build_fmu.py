"""Build, validate and smoke-run a co-simulation unit; print its path and SHA-256."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

EXIT_USAGE, EXIT_BUILD, EXIT_INVALID, EXIT_RUN = 2, 3, 4, 5
"""Exit codes: wrong arguments; cannot be built; does not validate; does not run."""

SMOKE_STEPS = 100
SMOKE_STEP_S = 0.001


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="Exit codes: 0 done, 2 usage, 3 build, 4 validation, 5 smoke run."
    )
    parser.add_argument(
        "--slave", default="TrpacEstimator", metavar="NAME", help="unit to build (default: %(default)s)"
    )
    parser.add_argument(
        "--out", default=Path("dist"), type=Path, metavar="DIR", help="folder (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        from fmu_src.packaging import BuildError, build_unit, sha256
        from fmu_src.units import UNITS
        from scenarios.whole_files import written_whole
    except ImportError as error:
        print(
            f"build_fmu.py: {error}. Run it with the project's interpreter: .venv/bin/python build_fmu.py",
            file=sys.stderr,
        )
        return EXIT_BUILD
    if options.slave not in UNITS:
        print(
            f"build_fmu.py: '{options.slave}' is not a unit. Known: {', '.join(sorted(UNITS))}.",
            file=sys.stderr,
        )
        return EXIT_USAGE
    started = time.perf_counter()
    try:
        with written_whole(options.out) as made:
            built = build_unit(UNITS[options.slave], made / f"{options.slave}.fmu")
        path = options.out / built.name
    except (BuildError, OSError) as error:
        print(f"build_fmu.py: {error}", file=sys.stderr)
        return EXIT_BUILD
    print(f"built      {path.stat().st_size / 1e6:.2f} MB in {time.perf_counter() - started:.1f} s")
    problems = validate(path)
    if problems:
        print("\n".join(["build_fmu.py: the unit does not validate:", *problems]), file=sys.stderr)
        return EXIT_INVALID
    print("validated  no problems found")
    try:
        microseconds = smoke_run(path)
    except Exception as error:  # noqa: BLE001 - fmpy raises bare Exceptions; the exit code tells that the run failed
        print(f"build_fmu.py: the unit does not run: {error}", file=sys.stderr)
        return EXIT_RUN
    print(f"ran        {SMOKE_STEPS} steps, {microseconds:.0f} us each")
    print(f"unit       {path}")
    print(f"SHA-256    {sha256(path)}")
    return 0


def validate(path: Path) -> list[str]:
    """Problems that fmpy's validation finds."""
    from fmpy.validation import validate_fmu

    return list(validate_fmu(str(path)))


def smoke_run(path: Path) -> float:
    """Instantiate the unit and step it with rolling wheels; returns the mean time of a step [us]."""
    from fmpy import read_model_description
    from fmpy.fmi2 import FMU2Slave

    from fmu_src.packaging import unpack_unit
    from fmu_src.trial import ROLLING

    description = read_model_description(str(path))
    folder = unpack_unit(path)
    try:
        unit = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="smoke",
        )
        unit.instantiate(loggingOn=True)
        unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        references = {v.name: v.valueReference for v in description.modelVariables if v.causality == "input"}
        for name, reference in references.items():
            if name.split(".")[0] in ROLLING:
                unit.setReal([reference], [ROLLING[name.split(".")[0]]])
        started = time.perf_counter()
        for step in range(SMOKE_STEPS):
            unit.doStep(step * SMOKE_STEP_S, SMOKE_STEP_S)
        elapsed = time.perf_counter() - started
        unit.terminate()
        unit.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return elapsed / SMOKE_STEPS * 1e6


if __name__ == "__main__":
    sys.exit(main())
