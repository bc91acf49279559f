"""What do the native units do in the long run, by other compilers, and on other processors?

``python -m benchmarks.robustness.native_units [--steps N] [--instances N] [--unit FILE]``.

It drives the tests' host in C, and prints one row per check. What the machine has no program for is said and left out:
other platforms need ziglang for the unit's libraries, qemu-aarch64 with Debian's libc6-arm64-cross, and wine64.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from fmpy.build import build_platform_binary
from numpy.typing import NDArray

from benchmarks.report import markdown
from fmu_src.native.build import NATIVE_UNITS, TRIPLES, build_native, sources
from fmu_src.native.library import FLAGS, compiler
from fmu_src.units import ROOT, UNITS
from scenarios.files import load_scenario
from scenarios.plant.pipeline import drive
from trpac_core.estimator_data import Method
from trpac_core.vision.classes import Surface

HOST = ROOT / "tests" / "support" / "native_host.c"
UNIT = "TrpacEstimator"
FOUR_WHEELS = {"TrpacEstimator": (), "TrpacEstimator4W": ("-DFOUR_WHEELS",)}
"""Options of the host by unit."""
CONFIDENCE, FRAME_STEPS = 0.9, 33
SMALLEST = 1e-6
"""Of an output's largest value: smaller values count as this where differences are relative."""
SYSROOT = Path("/usr/aarch64-linux-gnu")
WINE = (shutil.which("wine64") or "/usr/lib/wine/wine64",)
COMPILERS = (
    ("gcc", "-O0"),
    ("gcc", "-O3"),
    ("gcc", "-O2", "-march=native"),
    ("gcc", "-O2", "-march=native", "-ffp-contract=off"),
    ("clang", "-O2"),
    ("clang", "-O3", "-march=native"),
)
"""Commands of hosts that compile the sources, by their own flags."""

Row = tuple[str, str]


def rows() -> NDArray[np.float64]:
    """The host's rows: the paper's road with its class by number, shape (n, 11)."""
    path = drive(load_scenario(ROOT / "scenarios" / "paper_simulation.yaml"))
    made = np.zeros((len(path), 11))
    made[:, 0] = 0.001
    made[:, 1], made[:, 2] = path.wheel_speed_rad_s[:, 0], path.wheel_torque_nm[:, 0]
    made[:, 3], made[:, 4] = path.speed_m_s, CONFIDENCE
    theta = path.theta[:, 0]
    made[:, 9] = np.select([theta > 0.7, theta > 0.4], [Surface.DRY, Surface.WET], Surface.SNOW_ICE)
    made[:, 10] = 1 + np.arange(len(path)) // FRAME_STEPS
    return made


def run(*command: object, **environment: str) -> str:
    """What a program prints, in an environment of its own; CalledProcessError where it fails."""
    arguments = [str(part) for part in command]
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise subprocess.CalledProcessError(done.returncode, arguments, done.stdout, done.stderr)
    return done.stdout


def compiled(command: list[str], target: Path, source: Path, *parts: object) -> Path:
    """The host by this compiler, with a library of the unit or its sources."""
    flags = [*FLAGS, f"-I{source}", "-o", str(target)]
    windows = target.suffix == ".exe"
    subprocess.run(
        [*command, *flags, *map(str, parts), *([] if windows else ["-lm", "-lpthread"])], check=True
    )
    return target


def difference(expected: NDArray[np.float64], found: NDArray[np.float64]) -> float:
    """Largest relative difference of two traces, shape (steps, outputs) [-]."""
    least = SMALLEST * np.abs(expected).max(axis=0)
    scale = np.maximum(np.abs(expected), np.where(least > 0.0, least, 1.0))
    return float((np.abs(found - expected) / scale).max())


class Bench:
    """An unpacked unit, the rows, and the host on its library."""

    def __init__(self, folder: Path, archive: Path, given: NDArray[np.float64]) -> None:
        self.folder, self.source = folder, folder / "sources"
        with zipfile.ZipFile(archive) as opened:
            opened.extractall(folder)
        self.rows = folder / "rows.bin"
        given.tofile(self.rows)
        self._steps = len(given)
        self.host = compiled(compiler(), folder / "host", self.source, HOST, *self.linked("linux64", "so"))
        self.expected = self.traces(self.host)

    def linked(self, platform: str, ending: str) -> list[Path]:
        """What a host is linked with: the unit's library of a platform, and the table of its variables."""
        return [self.source / "tables.c", self.folder / "binaries" / platform / f"{UNIT}.{ending}"]

    def traces(self, *command: object, **environment: str) -> list[NDArray[np.float64]]:
        """All real outputs over the rows, by method; in mid-run another instance takes over the state."""
        out, made = self.folder / "out.bin", []
        for method in Method:
            run(*command, "run", self.rows, out, method.value, **environment)
            made.append(np.fromfile(out).reshape(self._steps, -1))
        return made

    def against(self, traces: list[NDArray[np.float64]]) -> str:
        """How these traces differ from those of this machine's library."""
        if all(np.array_equal(a, b, equal_nan=True) for a, b in zip(self.expected, traces, strict=True)):
            return "the same bits"
        most = max(difference(a, b) for a, b in zip(self.expected, traces, strict=True))
        return f"{most:.1e} at most, relative"


def memory(name: str, folder: Path, given: Path, steps: int, instances: int) -> Iterator[Row]:
    """Memory over many steps and instances, calls of the allocator, and threads, of one unit by its sources."""
    source = folder / name
    source.mkdir()
    for file, text in sources(UNITS[name].info, "guid").items():
        (source / file).write_text(text, encoding="utf-8")
    parts = [HOST, *sorted(source.glob("*.c"))]
    options = FOUR_WHEELS[name]
    host = compiled(compiler(), folder / f"{name}_host", source, *options, *parts)
    first, last, before, after = map(int, run(host, "long", given, steps, instances).split())
    yield f"{name}: {steps:,} steps of one instance", f"{last - first:+d} kB resident (of {last:,})"
    yield f"{name}: {instances:,} instances made and freed", f"{after - before:+d} kB resident"
    hooks = ("-DCOUNT_ALLOCATIONS", "-Wl,--wrap=malloc,--wrap=calloc")
    run(compiled(compiler(), folder / f"{name}_counted", source, *options, *hooks, *parts), "run", given)
    yield f"{name}: malloc and calloc within the drive's steps, by ld's --wrap", "0"
    run(host, "threads", given)
    yield f"{name}: eight threads, one instance each", "the same outputs"


def compilers(bench: Bench) -> Iterator[Row]:
    """The sources by other compilers and flags, as hosts compile them."""
    files = sorted(bench.source.glob("*.c"))
    for name, *flags in COMPILERS:
        what = f"sources by {' '.join([name, *flags])}"
        if shutil.which(name) is None:
            yield what, f"not run: no {name}"
            continue
        library = bench.folder / "own.so"
        command = [name, *flags, "-fPIC", "-shared", *map(str, files), "-o", str(library), "-lm"]
        subprocess.run(command, check=True)
        host = compiled(
            compiler(), bench.folder / "own", bench.source, HOST, bench.source / "tables.c", library
        )
        yield what, bench.against(bench.traces(host))
    if shutil.which("cmake") is None:
        yield "sources by fmpy's cmake project", "not run: no cmake"
        return
    folder = bench.folder / "by_fmpy"
    shutil.copytree(bench.folder, folder, ignore=shutil.ignore_patterns("binaries", "by_fmpy", "*.bin"))
    (folder / "binaries" / "linux64").mkdir(parents=True)
    saved = os.dup(1)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            build_platform_binary(folder)
        finally:
            os.dup2(saved, 1)
            os.close(saved)
    library = folder / "binaries" / "linux64" / f"{UNIT}.so"
    host = compiled(
        compiler(), bench.folder / "cmake", bench.source, HOST, bench.source / "tables.c", library
    )
    found = bench.traces(host, LD_LIBRARY_PATH=str(library.parent))  # cmake's library is found by its name
    yield "sources by fmpy's cmake project", bench.against(found)


def platforms(bench: Bench) -> Iterator[Row]:
    """The unit's libraries of other platforms, in emulators."""
    zig = [sys.executable, "-m", "ziglang", "cc", "-target"]
    has = {path.name for path in (bench.folder / "binaries").iterdir()}
    emulators = (
        ("aarch64-linux", "so", TRIPLES["aarch64-linux"], "host_arm", "qemu-aarch64", ("-L", SYSROOT)),
        ("win64", "dll", TRIPLES["x86_64-windows"], "host.exe", WINE[0], ()),
    )
    for platform, ending, triple, name, emulator, options in emulators:
        what = f"{platform} by {Path(emulator).name}"
        if platform not in has or find_spec("ziglang") is None:
            yield what, "not run: no ziglang"
        elif shutil.which(emulator) is None or (platform == "aarch64-linux" and not SYSROOT.is_dir()):
            yield what, f"not run: no {Path(emulator).name}"
        else:
            host = compiled(
                [*zig, triple], bench.folder / name, bench.source, HOST, *bench.linked(platform, ending)
            )
            if ending == "dll":  # Windows looks for it beside the program
                shutil.copy(bench.linked(platform, ending)[1], bench.folder)
            own = {"WINEPREFIX": str(bench.folder / "wine"), "WINEDEBUG": "-all", "PATH": "/usr/bin"}
            yield what, bench.against(bench.traces(emulator, *options, host, **own))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness.native_units", description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--unit", type=Path, help=f"a built {UNIT}, instead of building it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="trpac-native-") as name:
        folder = Path(name)
        archive = options.unit or build_native(UNITS[UNIT].info, folder / "unit.fmu")
        bench = Bench(folder / "unit", archive, rows())
        found: list[Row] = []
        for unit in NATIVE_UNITS:
            found += memory(unit, folder, bench.rows, options.steps, options.instances)
        found += compilers(bench)
        found += platforms(bench)
    print(markdown(("check", "found"), found))


if __name__ == "__main__":
    main()
