"""Units of C: their sources, their libraries for each platform, and the archive."""

from __future__ import annotations

import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from platform import machine
from typing import Any

import fmpy

from trpac_core.estimator_data import Estimate, EstimatorConfig
from trpac_core.four_wheels import (
    FourWheelsConfig,
    car_claim,
    car_loads,
    car_setup,
    lateral_plausible,
    wheel_speeds,
)
from trpac_core.local_speed import local_speeds
from trpac_core.parameters.variables import Variable
from trpac_core.sensors import LONGEST_STEP_S, PLAUSIBLE
from trpac_core.tyre import INITIAL_SLOPE
from trpac_core.vehicle import WHEELS

from ..contents import CONTENTS_FILE, Contents, sha256_of
from ..estimate_outputs import FIELDS
from ..interface import TRPAC_ESTIMATOR
from ..interface_4w import TRPAC_ESTIMATOR_4W
from ..model_description import UnitInfo, model_description
from ..packaging import BuildError, digest_of, licences, write_archive
from ..signals import NO_ROAD_CLASS
from .estimator import estimator_program
from .library import FLAGS, CompilerError, compiler
from .tables import code, header, outputs_code, settings_code
from .translator.types import initialiser

C_FILES = Path(__file__).parent / "c"
FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")


@dataclass(frozen=True)
class NativeUnit:
    """A unit that is there in C.

    Parameters
    ----------
    variables : sequence of Variable
        In the order of their value references.
    folder : str
        Of its own C files, beside those that all units share.
    settings : Any
        Its settings by default; parameters change them.
    functions : tuple
        Python functions that its own C files call, besides those of one wheel.
    outputs : callable
        What an output is in C, by its name.
    """

    variables: Sequence[Variable]
    folder: str
    settings: Any
    functions: tuple[Any, ...]
    outputs: Callable[[str], str]

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the files that are compiled, also by hosts that compile a unit themselves."""
        return (
            "common.c",
            "fmi2.c",
            "frames.c",
            "outputs.c",
            "tables.c",
            "text.c",
            "trpac.c",
            f"{self.folder}.c",
        )


def of_wheel(name: str, wheel: str = "wheel") -> str:
    """An output of a wheel in C."""
    field = FIELDS.get(name, name)
    last = f"unit->memory.inner.{wheel}.last"
    return f"{last}.{field}" if field in Estimate._fields else f"Estimate_{field}(&{last})"


def of_car(name: str) -> str:
    """An output of the unit of four wheels in C."""
    output, _, part = name.rpartition(".")
    if part == "vehicle":
        return f"unit->memory.inner.car.{FIELDS.get(output, output)}"
    return of_wheel(output, f"wheel[{WHEELS.index(part)}]")


NATIVE_UNITS = {
    "TrpacEstimator": NativeUnit(TRPAC_ESTIMATOR, "wheel", EstimatorConfig(), (local_speeds,), of_wheel),
    "TrpacEstimator4W": NativeUnit(
        TRPAC_ESTIMATOR_4W,
        "car",
        FourWheelsConfig(),
        (car_setup, car_loads, car_claim, lateral_plausible, wheel_speeds),
        of_car,
    ),
}
"""Units that are there in C."""
OPTIONS = ("-shared", "-s", "-fvisibility=hidden", "-Wall", "-Wextra", "-pedantic", "-Werror")
TARGETS = {
    "linux64": ("so", ("x86_64-linux-gnu.2.17",)),
    "win64": ("dll", ("x86_64-windows-gnu",)),
    "darwin64": ("dylib", ("x86_64-macos", "aarch64-macos")),
    "aarch64-linux": ("so", ("aarch64-linux-gnu.2.17",)),
}
"""Folder of a platform in the unit: the ending of its library, and its names for zig's compiler."""
HERE = {"win32": "win64", "darwin": "darwin64"}
"""Folder of this machine's platform, by Python's name; that of Linux else."""
FAT_MAGIC, FAT_ALIGNMENT = 0xCAFEBABE, 14
"""First word of a library for several processors of Apple's, and the power of two at which each part begins."""


def sources(unit: UnitInfo, guid: str) -> dict[str, str]:
    """The C of a unit, by the names of its files."""
    native, program = NATIVE_UNITS[unit.name], estimator_program()
    for function in native.functions:
        program.require(function)
    settings = program.types.of(type(native.settings), "the settings")
    header_text, code_text = program.texts(
        "trpac", f"Made of the Python package trpac_core {unit.version}: change that."
    )
    constants = {
        "NO_ROAD_CLASS": str(NO_ROAD_CLASS),
        "LONGEST_STEP": repr(LONGEST_STEP_S),
        "INITIAL_SLOPE_OF_THE_TYRE": repr(INITIAL_SLOPE),
        **{f"MOST_{name}": repr(most) for name, most in PLAUSIBLE.items()},
    }
    default = initialiser(native.settings, settings, "the default settings")
    own = [*sorted(C_FILES.glob("*.[ch]")), *sorted((C_FILES / native.folder).glob("*.[ch]"))]
    fmi = Path(str(fmpy.__file__)).parent / "c-code"
    return {
        **{path.name: path.read_text(encoding="utf-8") for path in own},
        **{name: (fmi / name).read_text(encoding="utf-8").replace("\r", "") for name in FMI_HEADERS},
        "trpac.h": header_text,
        "trpac.c": code_text,
        "tables.h": header(unit.name, guid, native.variables, constants),
        "tables.c": code(native.variables),
        "outputs.c": "\n".join(
            [
                "/* Made of the unit's variables: change those. */",
                '#include "unit.h"',
                "",
                f"void settings_of(const Memory *memory, {settings.c} *settings);",
                f"extern const {settings.c} DEFAULT_SETTINGS;",
                f"const {settings.c} DEFAULT_SETTINGS = {default};",
                "",
                settings_code("settings_of", settings, native.variables),
                outputs_code(native.variables, native.outputs),
            ]
        ),
    }


def build_native(unit: UnitInfo, target: Path, *, flat: bool = False, everywhere: bool | None = None) -> Path:
    """Write the archive of a unit in C.

    Parameters
    ----------
    unit : UnitInfo
        General attributes.
    target : Path
        The archive.
    flat : bool
        Names without dots, see `model_description`.
    everywhere : bool, optional
        Libraries for all platforms, by zig's compiler, and the same bytes from the same sources; else one for this
        machine by its own. By default for all where zig is installed.

    Returns
    -------
    Path
        `target`.

    Raises
    ------
    BuildError
        There is no compiler, or it refuses the code.
    OSError
        The archive cannot be written.
    """
    variables, names = NATIVE_UNITS[unit.name].variables, NATIVE_UNITS[unit.name].sources
    plain = {f"sources/{name}": text.encode() for name, text in sources(unit, "").items()}
    guid = digest_of(model_description(unit, variables, "", flat=flat, sources=names), plain)
    texts = sources(unit, guid)
    content = {f"sources/{name}": text.encode() for name, text in texts.items()} | licences("trpac-fmu")
    everywhere = find_spec("ziglang") is not None if everywhere is None else everywhere
    content |= libraries(unit.name, names, texts, everywhere)
    content["modelDescription.xml"] = model_description(unit, variables, guid, flat=flat, sources=names)
    files = {path: sha256_of(data) for path, data in content.items()}
    record = Contents(unit.name, unit.version, guid, {}, files)
    content[f"resources/{CONTENTS_FILE}"] = record.to_bytes()
    return write_archive(target, content)


def libraries(
    name: str, files: Sequence[str], texts: Mapping[str, str], everywhere: bool
) -> dict[str, bytes]:
    """The unit's libraries by their paths in the archive; BuildError where one cannot be made."""
    made = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
        if not everywhere:
            platform = HERE.get(sys.platform, "linux64" if machine() == "x86_64" else f"{machine()}-linux")
            try:
                data = _library(folder, compiler(), files, platform)
            except CompilerError as error:
                raise BuildError(str(error)) from error
            return {f"binaries/{platform}/{name}.{TARGETS[platform][0]}": data}
        for platform, (ending, triples) in TARGETS.items():
            zig = [sys.executable, "-m", "ziglang", "cc", "-target"]
            parts = [_library(folder, [*zig, triple], files, platform) for triple in triples]
            made[f"binaries/{platform}/{name}.{ending}"] = parts[0] if len(parts) == 1 else fat(parts)
    return made


def _library(folder: Path, command: list[str], files: Sequence[str], platform: str) -> bytes:
    """A library of the sources in a folder."""
    windows = platform == "win64"
    flags = [*FLAGS, *OPTIONS, *([] if windows else ["-fPIC"])]
    done = subprocess.run(
        [*command, *flags, *files, "-o", "library", *([] if windows else ["-lm"])],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BuildError(f"The unit's C does not compile for {platform}:\n{done.stderr}")
    return (folder / "library").read_bytes()


def fat(parts: Sequence[bytes]) -> bytes:
    """One library of libraries for several processors of Apple's."""
    head, body, begin = struct.pack(">II", FAT_MAGIC, len(parts)), b"", 1 << FAT_ALIGNMENT
    for part in parts:
        processor, kind = struct.unpack("<II", part[4:12])
        head += struct.pack(">IIIII", processor, kind, begin + len(body), len(part), FAT_ALIGNMENT)
        body += part + bytes(-len(part) % begin)
    return head.ljust(begin, b"\0") + body
