"""Three ways to the FMI functions: fmpy in this process, fmpy in its own process, and a C program."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from ctypes import byref
from pathlib import Path
from typing import NamedTuple, Protocol

import fmpy
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelDescription

from .outcome import NotOfferedError


class Answer(NamedTuple):
    """FMI status of a call, its value as text, and what was logged meanwhile."""

    status: int
    value: str
    log: tuple[str, ...]


class Transport(Protocol):
    """Carries one command line to FMI functions; the commands are those of client.c."""

    def ask(self, line: str) -> Answer:
        """Answer of one command."""

    def close(self) -> None:
        """End of the client."""


class Fmpy:
    """fmpy's FMU2Slave in this process."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._description: ModelDescription = read_model_description(str(folder))
        self._units: dict[str, FMU2Slave] = {}
        self._states: dict[str, object] = {}
        self._log: list[str] = []
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._on_log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(byref(self._callbacks))

    def _on_log(self, _: object, name: bytes, status: int, __: bytes, message: bytes) -> None:
        self._log.append(f"{name.decode()} {status}: {message.decode()}")

    def ask(self, line: str) -> Answer:
        """Answer of one command."""
        self._log.clear()
        verb, *words = line.split(" ")
        try:
            value = getattr(self, f"_{verb}")(*words)
        except FMICallException as error:
            return Answer(error.status, "", tuple(self._log))
        return Answer(0, "" if value is None else str(value), tuple(self._log))

    def close(self) -> None:
        """Nothing is left to do."""

    def _load(self, *_: str) -> None:
        """Nothing: fmpy loads the library for each instance."""

    def _unload(self) -> None:
        """Nothing: fmpy unloads the library as it frees an instance."""

    def _instantiate(self, slot: str, name: str, guid: str, _: str, logging: str) -> None:
        self._units[slot] = FMU2Slave(
            guid=guid,
            unzipDirectory=str(self._folder),
            modelIdentifier=self._description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self._units[slot].instantiate(callbacks=self._callbacks, loggingOn=logging == "1")

    def _setup(self, slot: str) -> None:
        self._units[slot].setupExperiment(startTime=0.0)

    def _enter(self, slot: str) -> None:
        self._units[slot].enterInitializationMode()

    def _leave(self, slot: str) -> None:
        self._units[slot].exitInitializationMode()

    def _step(self, slot: str, time_s: str, step_s: str) -> None:
        self._units[slot].doStep(float.fromhex(time_s), float.fromhex(step_s))

    def _reset(self, slot: str) -> None:
        self._units[slot].reset()

    def _terminate(self, slot: str) -> None:
        self._units[slot].terminate()

    def _free(self, slot: str) -> None:
        self._units.pop(slot).freeInstance()

    def _set(self, slot: str, kind: str, reference: str, *text: str) -> None:
        read: dict[str, Callable[[str], object]] = {"Real": float.fromhex, "String": str}
        value = read.get(kind, int)(" ".join(text))
        getattr(self._units[slot], f"set{kind}")([int(reference)], [value])

    def _get(self, slot: str, kind: str, reference: str) -> str:
        (value,) = getattr(self._units[slot], f"get{kind}")([int(reference)])
        if kind == "Real":
            return str(value.hex())
        return value.decode() if kind == "String" else str(int(value))

    def _save(self, slot: str, state: str) -> None:
        self._states[state] = self._units[slot].getFMUstate()

    def _restore(self, slot: str, state: str) -> None:
        self._units[slot].setFMUstate(self._states[state])

    def _drop(self, slot: str, state: str) -> None:
        self._units[slot].freeFMUstate(self._states.pop(state))

    def _serialise(self, slot: str, state: str) -> str:
        return str(self._units[slot].serializeFMUstate(self._states[state]).hex())

    def _deserialise(self, slot: str, state: str, content: str) -> None:
        self._states[state] = self._units[slot].deSerializeFMUstate(bytes.fromhex(content))


class Piped:
    """A client in a process of its own that takes commands on its input."""

    def __init__(self, command: list[str], environment: dict[str, str]) -> None:
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def ask(self, line: str) -> Answer:
        """Answer of one command; ConnectionError where the process has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        log = []
        for said in self._process.stdout:
            if said.startswith("= "):
                status, _, value = said[2:].rstrip("\n").partition(" ")
                return Answer(int(status), value, tuple(log))
            if said.startswith("log "):
                log.append(said[4:].rstrip("\n"))
        raise ConnectionError(f"the client ended with exit code {self._process.wait()} at '{line[:60]}'")

    def close(self) -> None:
        """End the process; ConnectionError where it does not end well."""
        self._process.communicate(timeout=60)
        if self._process.returncode:
            raise ConnectionError(f"the client ended with exit code {self._process.returncode}")


def fmpy_apart(folder: Path) -> Piped:
    """fmpy in its own process; its remoting serves foreign platforms only."""
    command = [sys.executable, "-m", "benchmarks.robustness.conformance.fmpy_server", str(folder)]
    return Piped(command, dict(os.environ))


def shared_python() -> str:
    """The interpreter as a shared library, for hosts that are not Python; raises NotOfferedError."""
    path = Path(str(sysconfig.get_config_var("LIBDIR"))) / str(sysconfig.get_config_var("INSTSONAME"))
    if ".so" not in path.name or not path.is_file():
        raise NotOfferedError(f"this Python has no shared library ({path.name})")
    return str(path)


def with_python(**more: str) -> dict[str, str]:
    """Environment in which a program that is not Python can run the unit."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return {**os.environ, "PATH": path, "LD_PRELOAD": shared_python(), **more}


def c_program(folder: Path) -> Piped:
    """The C host, compiled once per process."""
    return Piped([str(_compiled())], with_python())


def c_alone(folder: Path) -> Piped:
    """The C host in an empty environment."""
    return Piped([str(_compiled())], {})


_PROGRAM: list[Path] = []


def _compiled() -> Path:
    if not _PROGRAM:
        compiler = shutil.which("cc")
        if compiler is None:
            raise NotOfferedError("needs a C compiler")
        program = Path(tempfile.mkdtemp(prefix="trpac-c-host-")) / "client"
        headers = Path(fmpy.__file__).parent / "c-code"
        source = Path(__file__).with_name("client.c")
        subprocess.run([compiler, "-O1", "-I", headers, "-o", program, source, "-ldl"], check=True)
        _PROGRAM.append(program)
    return _PROGRAM[0]
