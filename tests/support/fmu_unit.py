"""A unit driven through fmpy, with variables by name and the log kept."""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import byref
from pathlib import Path
from typing import NamedTuple

from fmpy import calloc, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy

STEP_S = 0.001
DRIVING = {"wheel_speed": 52.0, "wheel_torque": 150.0, "vehicle_speed": 15.0}
"""A driven wheel at 15 m/s with half a per cent of slip."""


class LogLine(NamedTuple):
    status: int
    category: str
    text: str


class Unit:
    """One instance; `log` holds what the unit said."""

    def __init__(self, folder: Path, name: str = "unit", logging: bool = True) -> None:
        self.description = read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.log: list[LogLine] = []
        self.time_s = 0.0
        self._identity = {
            "guid": self.description.guid,
            "unzipDirectory": str(folder),
            "modelIdentifier": self.description.coSimulation.modelIdentifier,
            "instanceName": name,
        }
        self._open(logging)

    def _open(self, logging: bool) -> None:
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._on_log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(self._callbacks))
        self.slave = FMU2Slave(**self._identity)
        self.slave.instantiate(callbacks=self._callbacks, loggingOn=logging)

    def _on_log(self, _: object, __: bytes, status: int, category: bytes, message: bytes) -> None:
        self.log.append(LogLine(status, (category or b"").decode(), message.decode()))

    def initialise(self) -> None:
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def saved(self) -> bytes:
        return bytes(self.slave.serializeFMUstate(self.slave.getFMUstate()))

    def restore(self, saved: bytes) -> None:
        self.slave.setFMUstate(self.slave.deSerializeFMUstate(saved))

    def reset(self) -> None:
        self.slave.reset()
        self.time_s = 0.0

    def set(self, values: Mapping[str, object]) -> None:
        for name, value in values.items():
            variable = self.variables[name]
            getattr(self.slave, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, name: str) -> float | bool:
        variable = self.variables[name]
        (value,) = getattr(self.slave, f"get{variable.type}")([variable.valueReference])
        return bool(value) if variable.type == "Boolean" else value

    def outputs(self) -> dict[str, float | bool]:
        return {name: self.get(name) for name, v in self.variables.items() if v.causality == "output"}

    def step(
        self, values: Mapping[str, object] | None = None, step_s: float = STEP_S, count: int = 1
    ) -> None:
        self.set(values or {})
        for _ in range(count):
            self.slave.doStep(self.time_s, step_s)
            self.time_s += step_s

    def free(self) -> None:
        if self.slave is not None:
            self.slave.freeInstance()
            self.slave = None


class Unit3(Unit):
    """One instance for FMI 3.0."""

    def _open(self, logging: bool) -> None:
        self.slave = FMU3Slave(**self._identity)
        self.slave.instantiate(loggingOn=logging, logMessage=self._on_message)

    def _on_message(self, _: object, status: int, category: bytes, message: bytes) -> None:
        self.log.append(LogLine(status, category.decode(), message.decode()))

    def initialise(self) -> None:
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def saved(self) -> bytes:
        return self.slave.serializeFMUState(self.slave.getFMUState())

    def restore(self, saved: bytes) -> None:
        self.slave.setFMUState(self.slave.deserializeFMUState(saved))
