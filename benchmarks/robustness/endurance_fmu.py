"""What do the units do in the long run?

``python -m benchmarks.robustness.endurance_fmu [--steps N] [--instances N] [--out FILE]``.

Each measurement runs in a process of its own. The result is one line of JSON in out/endurance.jsonl.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

from benchmarks.report import append
from benchmarks.robustness.conformance.cases import CASES, STEP_S, write_pictures
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.files import file_sha256

RESULTS = Path("out") / "endurance.jsonl"
ROOT = Path(__file__).parents[2]
MOST_STEP_GROWTH_MB, MOST_INSTANCE_GROWTH_MB = 5.0, 20.0
WARM_UP = 0.25
"""Part of the run after which memory must stand still."""
STEPS_PER_SAMPLE = 1000
"""Memory is read, and estimators get a new picture, this often."""
TOGETHER, STEPS_TOGETHER = 4, 3000
SMALL_DISK = "200k"


class Instance:
    """One initialised instance in fmpy, with the calls that a host makes in each step and no more."""

    def __init__(self, folder: Path, name: str = "unit") -> None:
        description = read_model_description(str(folder), validate=False)
        case = CASES[description.modelName]
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.unit = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.unit.instantiate()
        self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()
        self._inputs = [self.references[n] for n in case.drive]
        self._drive = list(case.drive.values())
        self._outputs = [self.references[n] for n in case.watched]
        self._time_s = 0.0

    def steps(self, count: int, factor: float = 1.0) -> list[float]:
        """Set, step and get; returns what was read last. Torque and speeds wander a little."""
        unit, read = self.unit, []
        for index in range(count):
            wander = factor * (1.0 + 1e-3 * ((index * 7919) % 101 - 50) / 50.0)
            unit.setReal(self._inputs, [wander * value for value in self._drive])
            unit.doStep(self._time_s, STEP_S)
            self._time_s += STEP_S
            read = unit.getReal(self._outputs)
        return read

    def picture(self, path: Path) -> None:
        """A new picture at the next step, if the unit takes any."""
        if "image_path" in self.references:
            self.unit.setString([self.references["image_path"]], [str(path)])

    def free(self) -> None:
        """End of the instance."""
        self.unit.terminate()
        self.unit.freeInstance()


def resident_mb() -> float:
    """Memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def many_steps(folder: Path, count: int) -> dict[str, Any]:
    """Memory and time over many steps of one instance, with a picture every thousand."""
    pictures = write_pictures(Path(tempfile.mkdtemp(prefix="trpac-endurance-")))
    instance, samples = Instance(folder), []
    started = time.perf_counter()
    for index in range(count // STEPS_PER_SAMPLE):
        instance.picture(pictures[index % 2])
        instance.steps(STEPS_PER_SAMPLE)
        samples.append(resident_mb())
    elapsed = time.perf_counter() - started
    warm = samples[int(WARM_UP * len(samples))]
    later = samples[int(WARM_UP * len(samples)) :]
    instance.free()
    shutil.rmtree(pictures[0].parent)
    return {
        "steps": count,
        "seconds": round(elapsed, 1),
        "step_us": round(elapsed / count * 1e6, 1),
        "resident_warm_mb": round(warm, 1),
        "growth_mb": round(max(later) - warm, 2),
    }


def _open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def many_instances(folder: Path, count: int) -> dict[str, Any]:
    """What is left of many instances, one after the other."""
    Instance(folder).free()
    path, threads, files = list(sys.path), threading.active_count(), _open_files()
    tasks = len(os.listdir("/proc/self/task"))
    before, started = resident_mb(), time.perf_counter()
    for _ in range(count):
        instance = Instance(folder)
        instance.steps(1)
        instance.free()
    return {
        "instances": count,
        "milliseconds_each": round((time.perf_counter() - started) / count * 1e3, 1),
        "growth_mb": round(resident_mb() - before, 2),
        "path_unchanged": sys.path == path,
        "more_threads": max(threading.active_count() - threads, len(os.listdir("/proc/self/task")) - tasks),
        "more_files": _open_files() - files,
    }


def _alone(folder: Path, factor: float) -> list[float]:
    instance = Instance(folder)
    read = instance.steps(STEPS_TOGETHER, factor)
    instance.free()
    return read


def _tell(folder: Path, factor: float, told: Any) -> None:
    told.put((factor, _alone(folder, factor)))
    told.close()
    told.join_thread()
    os._exit(0)  # see "Limits" in docs/reference/unit.md


def _factors() -> list[float]:
    return [1.0 + 0.01 * index for index in range(TOGETHER)]


def in_threads(folder: Path, _: int) -> dict[str, Any]:
    """Instances that step at the same time in threads give what each gives alone."""
    alone = [_alone(folder, factor) for factor in _factors()]
    with ThreadPoolExecutor(TOGETHER) as pool:
        together = list(pool.map(lambda factor: _alone(folder, factor), _factors()))
    return {"instances": TOGETHER, "same_as_alone": together == alone}


def in_processes(folder: Path, _: int) -> dict[str, Any]:
    """Processes that step the same unpacked unit give what each gives alone, though one of them is killed."""
    alone = {factor: _alone(folder, factor) for factor in _factors()}
    context = multiprocessing.get_context("spawn")
    told = context.Queue()
    victim = context.Process(target=_step_on, args=(folder,))
    victim.start()
    workers = [context.Process(target=_tell, args=(folder, factor, told)) for factor in _factors()]
    for worker in workers:
        worker.start()
    time.sleep(2.0)
    os.kill(victim.pid or 0, signal.SIGKILL)
    victim.join()
    together = dict(told.get(timeout=300) for _ in workers)
    for worker in workers:
        worker.join()
    after = _alone(folder, 1.0)
    return {
        "processes": TOGETHER,
        "same_as_alone": together == alone,
        "killed": victim.exitcode == -signal.SIGKILL,
        "same_after_the_kill": after == alone[1.0],
    }


def _step_on(folder: Path) -> None:
    instance = Instance(folder)
    while True:
        instance.steps(STEPS_PER_SAMPLE)


# Full disk


def can_mount() -> bool:
    """Whether this machine lets a process mount a small file system in a namespace of its own."""
    if shutil.which("unshare") is None:
        return False
    tried = subprocess.run(
        ["unshare", "-Urm", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, check=False
    )
    return tried.returncode == 0


def small_disk(command: list[str], size: str = SMALL_DISK) -> dict[str, Any]:
    """Run a command whose argument OUT lies on a file system that is too small: how it ends and what it leaves."""
    with tempfile.TemporaryDirectory(prefix="trpac-full-") as name:
        script = (
            f'mount -t tmpfs -o size={size} none "{name}" && "$@" >/dev/null; code=$?; '
            f'find "{name}" -type f -printf "%P %s\\n"; exit $code'
        )
        words = [word.replace("OUT", f"{name}/out") for word in command]
        done = subprocess.run(
            ["unshare", "-Urm", "sh", "-c", script, "sh", *words],
            capture_output=True,
            text=True,
            cwd=ROOT,
            timeout=600,
            check=False,
        )
    said = [line for line in done.stderr.splitlines() if line.strip()]
    return {
        "exit_code": done.returncode,
        "lines_of_error": len(said),
        "error": said[-1:],
        "left": done.stdout.splitlines(),
    }


def full_disk() -> dict[str, Any]:
    """Each command that writes results, on a disk that is full."""
    trpac = [sys.executable, "-c", "import sys; from trpac_cli.main import app; app(sys.argv[1:])"]
    scenario = "scenarios/paper_simulation.yaml"
    car = "scenarios/vehicles/four_in_wheel_motor_ev.yaml"
    if not can_mount():
        return {"not_run": "this machine mounts no small file system without special rights"}
    with _recorded() as log:
        commands = {
            "build_fmu": [sys.executable, "build_fmu.py", "--out", "OUT"],
            "trpac run": [*trpac, "run", scenario, "--out", "OUT"],
            "trpac estimate": [*trpac, "estimate", str(log), "--vehicle", car, "--out", "OUT"],
            "trpac gap demo": [*trpac, "gap", "demo", "--out", "OUT"],
        }
        return {name: small_disk(command) for name, command in commands.items()}


@contextmanager
def _recorded() -> Iterator[Path]:
    """A log of the paper's drive."""
    from scenarios.files import load_scenario
    from scenarios.plant.pipeline import drive
    from scenarios.plant.sensors import make_scenario_log, write_log

    chosen = load_scenario(ROOT / "scenarios" / "paper_simulation.yaml")
    with tempfile.TemporaryDirectory(prefix="trpac-log-") as name:
        path = Path(name) / "log.csv"
        write_log(make_scenario_log(chosen, drive(chosen)), path)
        yield path


PARTS: dict[str, Callable[[Path, int], dict[str, Any]]] = {
    "steps": many_steps,
    "instances": many_instances,
    "threads": in_threads,
    "processes": in_processes,
}


def measured(part: str, folder: Path, count: int, timeout_s: float = 3600.0) -> dict[str, Any]:
    """One part in a process of its own; a crash is a result, too."""
    command = [
        sys.executable,
        "-m",
        "benchmarks.robustness.endurance_fmu",
        "--part",
        part,
        str(folder),
        str(count),
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=timeout_s, check=False)
    if done.returncode:
        return {"exit_code": done.returncode, "error": done.stderr[-500:]}
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def measure(unit: str, steps: int, instances: int) -> dict[str, Any]:
    """All parts of one unit."""
    with tempfile.TemporaryDirectory(prefix="trpac-endurance-") as name:
        archive = build_unit(UNITS[unit], Path(name) / f"{unit}.fmu")
        folder = unpack_unit(archive, Path(name) / "unpacked")
        counts = {"steps": steps, "instances": instances}
        return {"sha256": file_sha256(archive)} | {
            part: measured(part, folder, counts.get(part, 0)) for part in PARTS
        }


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.robustness.endurance_fmu", description=__doc__
    )
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--instances", type=int, default=1000)
    parser.add_argument("--unit", action="append", choices=list(CASES), help="only this one; repeatable")
    parser.add_argument("--out", type=Path, default=RESULTS, help="file that the line is added to")
    parser.add_argument("--part", nargs=3, metavar=("PART", "FOLDER", "COUNT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.part:
        part, folder, count = options.part
        print(json.dumps(PARTS[part](Path(folder), int(count))), flush=True)
        os._exit(0)  # see "Limits" in docs/reference/unit.md
    figures = {
        "versions": {p: version(p) for p in ("fmpy", "pythonfmu", "numpy", "onnxruntime")},
        "units": {u: measure(u, options.steps, options.instances) for u in options.unit or CASES},
        "full_disk": full_disk(),
    }
    print(json.dumps(append(options.out, figures), indent=2))


if __name__ == "__main__":
    main()
