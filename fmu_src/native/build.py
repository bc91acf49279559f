"""Units of C: their sources, their libraries for each platform, and the archive."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import fmpy

from trpac_core.estimator_data import Estimate, EstimatorConfig
from trpac_core.sensors import LONGEST_STEP_S, PLAUSIBLE
from trpac_core.tyre import INITIAL_SLOPE

from ..contents import CONTENTS_FILE, Contents, sha256_of
from ..estimate_outputs import FIELDS
from ..interface import TRPAC_ESTIMATOR
from ..model_description import UnitInfo, model_description
from ..packaging import BuildError, digest_of, licences, write_archive
from ..signals import NO_ROAD_CLASS
from .estimator import estimator_program
from .library import FLAGS, CompilerError, compiler
from .tables import code, header, outputs_code, settings_code
from .translator.types import initialiser

C_FILES = Path(__file__).parent / "c"
FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
SOURCES = ("common.c", "fmi2.c", "frames.c", "outputs.c", "tables.c", "text.c", "trpac.c", "wheel.c")
"""Files that are compiled, also by hosts that compile a unit themselves."""
OPTIONS = ("-shared", "-s", "-fvisibility=hidden", "-Wall", "-Wextra", "-pedantic", "-Werror")
NATIVE_UNITS = ("TrpacEstimator",)
"""Units that are there in C."""
TARGETS = {
    "linux64": ("so", "x86_64-linux-gnu.2.17"),
    "win64": ("dll", "x86_64-windows-gnu"),
    "darwin64": ("dylib", "x86_64-macos"),
    "aarch64-linux": ("so", "aarch64-linux-gnu.2.17"),
}
"""Folder of a platform in the unit: the ending of its library, and its name for zig's compiler."""


def sources(unit: UnitInfo, guid: str) -> dict[str, str]:
    """The C of the unit of one wheel, by the names of its files."""
    program, variables = estimator_program(), TRPAC_ESTIMATOR
    settings, estimate = (program.types.of(kind, "the unit") for kind in (EstimatorConfig, Estimate))
    program.require(vars(Estimate)["TRPAC_peak"].fget)
    note = f"Made of the Python package trpac_core {unit.version}: change that."
    trpac_header, trpac_code = program.texts("trpac", note)
    constants = {
        "NO_ROAD_CLASS": str(NO_ROAD_CLASS),
        "LONGEST_STEP": repr(LONGEST_STEP_S),
        "INITIAL_SLOPE_OF_THE_TYRE": repr(INITIAL_SLOPE),
        **{f"MOST_{name}": repr(most) for name, most in PLAUSIBLE.items()},
    }
    default = initialiser(EstimatorConfig(), settings, "the default settings")
    own = {path.name: path.read_text(encoding="utf-8") for path in sorted(C_FILES.rglob("*.[ch]"))}
    fmi = Path(str(fmpy.__file__)).parent / "c-code"
    return {
        **own,
        **{name: (fmi / name).read_text(encoding="utf-8").replace("\r", "") for name in FMI_HEADERS},
        "trpac.h": trpac_header,
        "trpac.c": trpac_code,
        "tables.h": header(unit.name, guid, variables, constants),
        "tables.c": code(variables),
        "outputs.c": "\n".join(
            [
                "/* Made of the unit's variables: change those. */",
                '#include "unit.h"',
                "",
                "void settings_of(const Memory *memory, EstimatorConfig *settings);",
                "extern const EstimatorConfig DEFAULT_SETTINGS;",
                f"const EstimatorConfig DEFAULT_SETTINGS = {default};",
                "",
                settings_code("settings_of", settings, variables),
                outputs_code(variables, FIELDS, estimate),
            ]
        ),
    }


def build_native(unit: UnitInfo, target: Path, *, flat: bool = False, everywhere: bool | None = None) -> Path:
    """Write the archive of the unit of one wheel in C.

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
    variables = TRPAC_ESTIMATOR
    plain = {f"sources/{name}": text.encode() for name, text in sources(unit, "").items()}
    guid = digest_of(model_description(unit, variables, "", flat=flat, sources=SOURCES), plain)
    texts = sources(unit, guid)
    content = {f"sources/{name}": text.encode() for name, text in texts.items()} | licences("trpac-fmu")
    everywhere = find_spec("ziglang") is not None if everywhere is None else everywhere
    content |= libraries(unit.name, texts, everywhere)
    content["modelDescription.xml"] = model_description(unit, variables, guid, flat=flat, sources=SOURCES)
    files = {path: sha256_of(data) for path, data in content.items()}
    record = Contents(unit.name, unit.version, guid, {}, files)
    content[f"resources/{CONTENTS_FILE}"] = record.to_bytes()
    return write_archive(target, content)


def libraries(name: str, texts: Mapping[str, str], everywhere: bool) -> dict[str, bytes]:
    """The unit's libraries by their paths in the archive; BuildError where one cannot be made."""
    zig = [sys.executable, "-m", "ziglang", "cc"]
    made = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
        for platform, (ending, triple) in TARGETS.items() if everywhere else [("linux64", ("so", ""))]:
            try:
                command = [*zig, "-target", triple] if everywhere else compiler()
            except CompilerError as error:
                raise BuildError(str(error)) from error
            made[f"binaries/{platform}/{name}.{ending}"] = _library(
                folder, command, f"{name}.{ending}", platform
            )
    return made


def _library(folder: Path, command: list[str], file: str, platform: str) -> bytes:
    """A library of the sources in a folder."""
    flags = [*FLAGS, *OPTIONS, *([] if platform == "win64" else ["-fPIC"])]
    done = subprocess.run(
        [*command, *flags, *SOURCES, "-o", file, *([] if platform == "win64" else ["-lm"])],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BuildError(f"The unit's C does not compile for {platform}:\n{done.stderr}")
    return (folder / file).read_bytes()
