"""What the tests of native units share: drives and what they give, a host in C, attributes of variables."""

import math
import subprocess
from pathlib import Path

from fmu_src.native.library import FLAGS, compiler

HOST = Path(__file__).with_name("native_host.c")
ATTRIBUTES = (
    "name",
    "valueReference",
    "type",
    "causality",
    "variability",
    "initial",
    "start",
    "min",
    "max",
    "unit",
)
"""Of a variable in modelDescription.xml."""


def driven(open_one, steps, parameters):
    """All outputs of a drive, and the log."""
    unit = open_one(**parameters)
    trace = [unit.outputs()]
    for values, step_s in steps:
        unit.step(values, step_s=step_s)
        trace.append(unit.outputs())
    return trace, list(unit.log)


def bits(outputs):
    return {name: value if math.isfinite(value) else str(value) for name, value in outputs.items()}


def compiled_host(folder: Path, name: str, parts: list[Path], *options: str) -> Path:
    """The host with a library of the unit, or with its sources."""
    command = [
        *compiler(),
        *FLAGS,
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        *options,
        f"-I{folder / 'sources'}",
    ]
    files = [str(path) for path in (HOST, *parts)]
    subprocess.run([*command, *files, "-o", str(folder / name), "-lm", "-lpthread"], check=True)
    return folder / name


def called(host: Path, *arguments: object) -> str:
    """What the host prints in an empty environment, in which it can find no Python; it must end well."""
    done = subprocess.run(
        [str(host), *map(str, arguments)],
        env={},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout
