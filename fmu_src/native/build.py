"""Units of C: their sources, their libraries for each platform, and the archive."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
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
from ..guarded_slave import GREATEST_JUMP
from ..interface import TRPAC_ESTIMATOR
from ..interface_4w import TRPAC_ESTIMATOR_4W
from ..model_description import TIME, UnitInfo, build_description, model_description, model_description_3
from ..packaging import BuildError, digest_of, licences, write_archive
from ..signals import NO_ROAD_CLASS
from .estimator import estimator_program
from .library import FLAGS, CompilerError, compiler
from .tables import code, header, outputs_code, settings_code
from .translator.types import initialiser

C_FILES = Path(__file__).parent / "c"
FMI_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
"""The standard's own files by the version of FMI, 2.0 or 3.0."""


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

    def sources(self, fmi: int) -> tuple[str, ...]:
        """Names of the files that are compiled, also by hosts that compile a unit themselves."""
        return (
            "common.c",
            f"fmi{fmi}.c",
            "frames.c",
            "instance.c",
            "outputs.c",
            "tables.c",
            "text.c",
            "trpac.c",
            f"{self.folder}.c",
        )

    def of(self, fmi: int) -> Sequence[Variable]:
        """The variables of the unit for a version of FMI: 3.0 has the time beside them."""
        return (*self.variables, TIME) if fmi == 3 else self.variables


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
TRIPLES = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
}
"""Platforms, as FMI 3.0 names their folders, and their names for zig's compiler."""
FOLDERS_2 = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86_64-darwin": "darwin64",
    "aarch64-darwin": "darwin64",
}
"""Folders of platforms in a unit of FMI 2.0; else they are those of FMI 3.0."""
ENDINGS = {"linux": "so", "windows": "dll", "darwin": "dylib"}
"""Ending of a library by its system."""
MACHINES = {"AMD64": "x86_64", "arm64": "aarch64"}
"""Processors that Python names otherwise than FMI does."""
FAT_MAGIC, FAT_ALIGNMENT = 0xCAFEBABE, 14
"""First word of a library for several processors of Apple's, and the power of two at which each part begins."""


def sources(unit: UnitInfo, guid: str, fmi: int = 2) -> dict[str, str]:
    """The C of a unit for FMI 2.0 or 3.0, by the names of its files."""
    native, program = NATIVE_UNITS[unit.name], estimator_program()
    variables = native.of(fmi)
    for function in native.functions:
        program.require(function)
    settings = program.types.of(type(native.settings), "the settings")
    header_text, code_text = program.texts(
        "trpac", f"Made of the Python package trpac_core {unit.version}: change that."
    )
    constants = {
        "NO_ROAD_CLASS": str(NO_ROAD_CLASS),
        "LONGEST_STEP": repr(LONGEST_STEP_S),
        "GREATEST_JUMP": repr(GREATEST_JUMP),
        "INITIAL_SLOPE_OF_THE_TYRE": repr(INITIAL_SLOPE),
        **{f"MOST_{name}": repr(most) for name, most in PLAUSIBLE.items()},
    }
    default = initialiser(native.settings, settings, "the default settings")
    files = [*sorted(C_FILES.glob("*.[ch]")), *sorted((C_FILES / native.folder).glob("*.[ch]"))]
    own = [path for path in files if path.suffix == ".h" or path.name in native.sources(fmi)]
    standard = Path(str(fmpy.__file__)).parent / "c-code"
    return {
        **{path.name: path.read_text(encoding="utf-8") for path in own},
        **{
            name: (standard / name).read_text(encoding="utf-8").replace("\r", "") for name in FMI_HEADERS[fmi]
        },
        "trpac.h": header_text,
        "trpac.c": code_text,
        "tables.h": header(unit.name, guid, variables, constants),
        "tables.c": code(variables),
        "outputs.c": "\n".join(
            [
                "/* Made of the unit's variables: change those. */",
                '#include "unit.h"',
                "",
                f"void settings_of(const Memory *memory, {settings.c} *settings);",
                f"extern const {settings.c} DEFAULT_SETTINGS;",
                f"const {settings.c} DEFAULT_SETTINGS = {default};",
                "",
                settings_code("settings_of", settings, variables),
                outputs_code(variables, native.outputs),
            ]
        ),
    }


def build_native(
    unit: UnitInfo, target: Path, *, fmi: int = 2, flat: bool = False, everywhere: bool | None = None
) -> Path:
    """Write the archive of a unit in C; returns `target`; errors as of `fmu_src.kinds.build`.

    Parameters
    ----------
    unit : UnitInfo
        General attributes.
    target : Path
        The archive.
    fmi, flat
        As of `fmu_src.kinds.build`.
    everywhere : bool, optional
        Libraries for all platforms, by zig's compiler, and the same bytes from the same sources; else one for this
        machine by its own. By default for all where zig is installed.
    """
    native = NATIVE_UNITS[unit.name]
    variables, names = native.of(fmi), native.sources(fmi)

    def described(guid: str) -> bytes:
        if fmi == 3:
            return model_description_3(unit, variables, guid, flat=flat)
        return model_description(unit, variables, guid, flat=flat, sources=names)

    def files_of(texts: Mapping[str, str]) -> dict[str, bytes]:
        files = {f"sources/{name}": text.encode() for name, text in texts.items()}
        if fmi == 3:
            files["sources/buildDescription.xml"] = build_description(unit.name, names, FLAGS)
        return files

    guid = digest_of(described(""), files_of(sources(unit, "", fmi)))
    texts = sources(unit, guid, fmi)
    everywhere = find_spec("ziglang") is not None if everywhere is None else everywhere
    content = files_of(texts) | licences("trpac-fmu") | libraries(unit.name, names, texts, everywhere, fmi)
    content["modelDescription.xml"] = described(guid)
    files = {path: sha256_of(data) for path, data in content.items()}
    record = Contents(unit.name, unit.version, guid, {}, files)
    content[f"resources/{CONTENTS_FILE}"] = record.to_bytes()
    return write_archive(target, content)


def libraries(
    name: str, files: Sequence[str], texts: Mapping[str, str], everywhere: bool, fmi: int
) -> dict[str, bytes]:
    """The unit's libraries by their paths in the archive; BuildError where one cannot be made."""
    made: dict[str, list[bytes]] = {}
    platforms = list(TRIPLES) if everywhere else [this_platform()]
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(os.cpu_count()) as side_by_side:
        folder = Path(temporary)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")

        def compiled(platform: str) -> bytes:
            return _library(folder, _command(platform, everywhere), files, platform, name)

        for platform, data in zip(platforms, side_by_side.map(compiled, platforms), strict=True):
            parent = FOLDERS_2.get(platform, platform) if fmi == 2 else platform
            made.setdefault(f"binaries/{parent}/{name}.{_ending(platform)}", []).append(data)
    return {path: parts[0] if len(parts) == 1 else fat(parts) for path, parts in made.items()}


def _ending(platform: str) -> str:
    return ENDINGS[platform.partition("-")[2]]


def this_platform() -> str:
    """Name of the platform of this machine, as FMI 3.0 names its folder."""
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    return f"{MACHINES.get(machine(), machine())}-{system}"


def _command(platform: str, everywhere: bool) -> list[str]:
    """The compiler for a platform: zig's, or this machine's own; BuildError where there is none."""
    if everywhere:
        return [sys.executable, "-m", "ziglang", "cc", "-target", TRIPLES[platform]]
    try:
        return compiler()
    except CompilerError as error:
        raise BuildError(str(error)) from error


def _library(folder: Path, command: list[str], files: Sequence[str], platform: str, name: str) -> bytes:
    """A library of the sources in a folder; a library for Windows holds its own file's name."""
    windows = platform.endswith("windows")
    flags = [*FLAGS, *OPTIONS, *([] if windows else ["-fPIC"])]
    library = folder / platform / f"{name}.{_ending(platform)}"
    library.parent.mkdir()
    done = subprocess.run(
        [
            *command,
            *flags,
            *(f"../{file}" for file in files),
            "-o",
            library.name,
            *([] if windows else ["-lm"]),
        ],
        cwd=library.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BuildError(f"The unit's C does not compile for {platform}:\n{done.stderr}")
    return library.read_bytes()


def fat(parts: Sequence[bytes]) -> bytes:
    """One library of libraries for several processors of Apple's."""
    head, body, begin = struct.pack(">II", FAT_MAGIC, len(parts)), b"", 1 << FAT_ALIGNMENT
    for part in parts:
        processor, kind = struct.unpack("<II", part[4:12])
        head += struct.pack(">IIIII", processor, kind, begin + len(body), len(part), FAT_ALIGNMENT)
        body += part + bytes(-len(part) % begin)
    return head.ljust(begin, b"\0") + body
