"""Tests on one mutant after another, in forks of a process that has loaded every library but not our code."""

from __future__ import annotations

import importlib
import json
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from .faults import Mutant, prefix_of

POLL_S = 0.02
MOST_PLAIN = 40
QUICK_S = 0.1
"""Of compiled code so many tests, of those that take less than this, are tried first without compiling it [s]."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMEXPR_MAX_THREADS": "1"}


class Bench:
    """A copy of the tree, and what each test runs there."""

    def __init__(
        self,
        root: Path,
        work: Path,
        folders: Sequence[str],
        tests: Sequence[str],
        *,
        marks: str,
        tests_s: float,
        hangs_s: float,
    ) -> None:
        self.copy, self._root, self._work = work / "tree", root, work
        self._folders, self._tests, self._marks = folders, tests, marks
        self._tests_s, self._hangs_s = tests_s, hangs_s
        self._killers: defaultdict[str, list[str]] = defaultdict(list)
        _copy(root, self.copy)
        hooks = work / "hooks"
        hooks.mkdir(exist_ok=True)
        (work / "numba").mkdir(exist_ok=True)
        for file, module in (("lines.py", "sitecustomize.py"), ("plugin.py", "mutants_plugin.py")):
            shutil.copy(Path(__file__).with_name(file), hooks / module)
        self._environment = os.environ | ONE_THREAD | {
            "PYTHONPATH": f"{self.copy}:{hooks}",
            "NUMBA_CACHE_DIR": str(work / "numba"),
            "MPLBACKEND": "Agg",
        }  # fmt: skip
        self._environment.pop("PYTHONDONTWRITEBYTECODE", None)

    # What each test runs

    def watch(self) -> None:
        """Run all tests once, without any fault, and write down what they run."""
        told, record = self._work / "told.json", self._work / "lines.tsv"
        if not told.exists():
            record.unlink(missing_ok=True)
            environment = self._environment | {
                "MUTANTS_RECORD": str(record),
                "MUTANTS_ROOT": str(self.copy),
                "MUTANTS_FOLDERS": ":".join(map(prefix_of, self._folders)),
                "MUTANTS_TOLD": str(told),
            }
            command = [sys.executable, "-m", "pytest", "-p", "mutants_plugin", *self._options()]
            subprocess.run([*command, *self._tests], cwd=self.copy, env=environment, check=False)
        found = json.loads(told.read_text(encoding="utf-8"))
        self.took, self.failed, self._modules = found["took"], found["failed"], found["modules"]
        ran: defaultdict[str, set[tuple[str, int]]] = defaultdict(set)
        for line in record.read_text(encoding="utf-8").splitlines():
            test, file, number = line.split("\t")
            ran[test].add((file, int(number)))
        self._at_load = ran.pop("", set())
        self._by_line: defaultdict[str, defaultdict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
        for test in self.took:
            for one in (test, *found["fixtures"][test]):
                for file, number in ran[one]:
                    self._by_line[file][number].add(test)

    def tests_of(self, mutant: Mutant) -> list[str]:
        """The tests that run a mutant's place: first those that found others near it, then what is near, then quick."""
        place = mutant.place
        lines = range(place.lines[0], place.lines[1] + 1)
        tests = set().union(*(self._by_line[place.file][n] for n in lines))
        if place.compiled or place.loaded or any((place.file, n) in self._at_load for n in lines):
            tests |= self._beside(place.file)
        tests = tests or self._naming(place.file)  # as where an isolated interpreter runs it
        killers = self._killers[f"{place.file} {place.function}"][::-1] + self._killers[place.file][::-1]
        likely = list(dict.fromkeys(t for t in killers if t in tests))
        near = self._naming(place.file).union(*self._by_line[place.file].values())
        ordered = likely + sorted(tests - set(likely), key=lambda t: (t not in near, self.took[t], t))
        total, enough = 0.0, []
        for test in ordered:
            total += self.took[test]
            if enough and total > self._tests_s:
                continue
            enough.append(test)
        return enough

    def _beside(self, file: str) -> set[str]:
        """The tests that may depend on what is compiled in a file or done as it is loaded, where no test is seen."""
        beside = [f for f in self._by_line if f.startswith(file.rpartition("/")[0])]
        found = {test for f in beside for tests in self._by_line[f].values() for test in tests}
        return found | self._naming(file)

    def _naming(self, file: str) -> set[str]:
        """The tests in files that name this one."""
        files = {test: self.copy / test.partition("::")[0] for test in self.took}
        name = re.compile(rf"\b{Path(file).stem}\b")
        naming = {f for f in set(files.values()) if name.search(f.read_text(encoding="utf-8"))}
        return {test for test, f in files.items() if f in naming}

    # Mutants

    def load(self) -> None:
        """Load every library that the tests use; forks start with them."""
        os.environ.clear()
        os.environ.update(self._environment, PYTHONDONTWRITEBYTECODE="1")
        sys.dont_write_bytecode = True
        for name in self._modules:
            with suppress(ImportError):
                importlib.import_module(name)
        root = str(self._root)
        for name, module in list(sys.modules.items()):
            file = str(getattr(module, "__file__", ""))
            if file.startswith(root) and "site-packages" not in file and name != "__main__":
                del sys.modules[name]  # the forks load the copy's
        hooks = str(self._work / "hooks")
        sys.path[:] = [str(self.copy), hooks, *(p for p in sys.path if p not in ("", root))]

    def judge(self, mutant: Mutant, tests: Sequence[str], number: int) -> dict[str, Any]:
        """Put the fault in, run the tests until one fails, take it out."""
        if not tests:
            return {"outcome": "not run", "by": "", "seconds": 0.0}
        plain = self._without_compiling(mutant) if mutant.place.compiled else set()
        path = self.copy / mutant.place.file
        whole, times = path.read_bytes(), path.stat()
        caches = self._work / "numba-now"
        shutil.rmtree(caches, ignore_errors=True)
        shutil.copytree(self._work / "numba", caches)
        try:
            path.write_bytes(mutant.source(whole))
            # Byte code of a file that is as long and as old would be taken for this one's.
            other_s = int(times.st_mtime) + 1000 + number
            os.utime(path, (other_s, other_s))
            code, by, seconds = 0, [], 0.0
            quick = [test for test in tests if test in plain][:MOST_PLAIN]
            if quick:
                code, by, seconds = self.run(quick, caches, compiled=False)
            if not by:  # neither found nor, so slowly, hanging for sure
                code, by, more_s = self.run([t for t in tests if code or t not in quick], caches)
                seconds += more_s
        finally:
            path.write_bytes(whole)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        outcome = {None: "hangs", -signal.SIGXCPU: "hangs", 0: "survives"}.get(code, "killed")
        if by:
            for kept in (f"{mutant.place.file} {mutant.place.function}", mutant.place.file):
                with suppress(ValueError):
                    self._killers[kept].remove(by[0])
                self._killers[kept].append(by[0])
        return {"outcome": outcome, "by": by[0] if by else "", "seconds": seconds}

    def _without_compiling(self, mutant: Mutant) -> set[str]:
        """The tests of compiled code that also pass without compiling it, which would take longer than they do."""
        kept = self._work / "plain.json"
        if not kept.exists():
            quick = [t for t in self._beside(mutant.place.file) if self.took[t] < QUICK_S]
            failed = self.run(quick, self._work / "numba", stop=False, compiled=False)[1]
            kept.write_text(json.dumps([t for t in quick if t not in failed]), encoding="utf-8")
        return set(json.loads(kept.read_text(encoding="utf-8")))

    def run(
        self, tests: Sequence[str], caches: Path, *, stop: bool = True, compiled: bool = True
    ) -> tuple[int | None, list[str], float]:
        """Exit code, None where it hung; the tests that failed; seconds."""
        told = self._work / "failed.txt"
        told.write_text("", encoding="utf-8")
        started = time.monotonic()
        process = os.fork()
        if process == 0:
            self._become(tests, told, caches, stop, compiled)
        code = _wait(process, 2.0 * self._hangs_s if stop else math.inf)
        with suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)
        return code, told.read_text(encoding="utf-8").splitlines(), round(time.monotonic() - started, 1)

    def _become(self, tests: Sequence[str], told: Path, caches: Path, stop: bool, compiled: bool) -> None:
        code = 70
        try:
            os.setpgid(0, 0)
            if stop:  # processor time, since the machine may have other work
                resource.setrlimit(resource.RLIMIT_CPU, (round(self._hangs_s), round(self._hangs_s) + 5))
            os.chdir(self.copy)
            with (self._work / "words.txt").open("w") as words:
                os.dup2(words.fileno(), 1)
                os.dup2(words.fileno(), 2)
            os.environ["NUMBA_CACHE_DIR"] = str(caches)
            import numba
            import pytest

            numba.config.CACHE_DIR = str(caches)
            if not compiled:
                os.environ["NUMBA_DISABLE_JIT"] = "1"
                numba.config.DISABLE_JIT = 1
            from mutants_plugin import Chosen  # type: ignore[import-not-found]  # the copy of plugin.py

            files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
            options = [*self._options(), *(["-x"] if stop else [])]
            code = int(pytest.main([*options, *files], plugins=[Chosen(tests, told)]))
        finally:
            os._exit(code)

    def _options(self) -> list[str]:
        return [
            "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed", "0",
            "--basetemp", str(self._work / "base"), *(["-m", self._marks] if self._marks else []),
        ]  # fmt: skip

    def confirm(self, killers: Iterable[str]) -> list[str]:
        """Those of these tests that fail without any fault, too."""
        tests = sorted(set(killers))
        return self.run(tests, self._work / "numba", stop=False)[1] if tests else []


def _copy(root: Path, copy: Path) -> None:
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=root, capture_output=True, check=True).stdout.decode()
    for name in listed.split("\0"):
        if name and (root / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, copy / name)


def _wait(process: int, limit_s: float) -> int | None:
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s:
        found, status = os.waitpid(process, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(POLL_S)
    os.killpg(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return None
