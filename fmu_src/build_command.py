"""The common part of `build_fmu.py` and `build_ssp.py`: build a file, validate it, run it, print path and SHA-256."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

EXIT_USAGE, EXIT_BUILD, EXIT_INVALID, EXIT_RUN = 2, 3, 4, 5
"""Exit codes: wrong arguments; cannot be built; does not validate; does not run."""
EPILOG = "Exit codes: 0 done, 2 usage, 3 build, 4 validation, 5 run."


@dataclass(frozen=True)
class Product:
    """A kind of file that a build program makes.

    Parameters
    ----------
    noun : str
        Its noun in messages: unit, package.
    kind, known : str, collection of str
        The noun of its names, and the known names.
    build : callable
        Builds the file of a name; returns its path; raises BuildError or OSError.
    validate : callable
        Returns the problems of a built file.
    valid : str
        Message where there are none.
    run : callable
        Takes some steps with a built file; returns their number and time as a phrase.
    """

    noun: str
    kind: str
    known: Collection[str]
    build: Callable[[str], Path]
    validate: Callable[[Path], list[str]]
    valid: str
    run: Callable[[Path], str]


def run_build(program: str, load: Callable[[], Product], name: str) -> int:
    """Build the file of this name and print the outcome; returns the exit code."""

    def complain(text: str) -> None:
        print(f"{program}: {text}", file=sys.stderr)

    try:
        product = load()
        from trpac_core.files import file_sha256

        from .packaging import BuildError
    except ImportError as error:
        complain(f"{error}. Run it with the project's interpreter: .venv/bin/python {program}")
        return EXIT_BUILD
    if name not in product.known:
        complain(f"'{name}' is not a {product.kind}. Known: {', '.join(sorted(product.known))}.")
        return EXIT_USAGE
    started = time.perf_counter()
    try:
        path = product.build(name)
    except (BuildError, OSError) as error:
        complain(str(error))
        return EXIT_BUILD
    print(f"built      {path.stat().st_size / 1e6:.2f} MB in {time.perf_counter() - started:.1f} s")
    problems = product.validate(path)
    if problems:
        complain("\n".join([f"the {product.noun} does not validate:", *problems]))
        return EXIT_INVALID
    print(f"validated  {product.valid}")
    try:
        done = product.run(path)
    except Exception as error:  # noqa: BLE001 - fmpy raises bare Exceptions; the exit code tells that the run failed
        complain(f"the {product.noun} does not run: {error}")
        return EXIT_RUN
    print(f"ran        {done}")
    print(f"{product.noun:<10} {path}")
    print(f"SHA-256    {file_sha256(path)}")
    return 0
