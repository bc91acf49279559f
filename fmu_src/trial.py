"""A trial of a unit in a process of its own: `python trial.py FOLDER [STEPS]`; imports the standard library alone.

It loads the wrapper as a host does, instantiates, steps with rolling wheels and prints one line of JSON. A crash ends
this process only.
"""

from __future__ import annotations

import ctypes
import json
import math
import platform
import re
import sys
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

ROLLING = {"wheel_speed": 34.5, "vehicle_speed": 10.0, "wheel_torque": 20.0}
"""Inputs of a rolling car by name, for one wheel and for each of four [rad/s], [m/s], [N m]."""
STEPS, STEP_S = 20, 0.001
PLATFORMS = {"linux": ("linux64", ".so"), "win32": ("win64", ".dll")}
SYSTEMS_3 = {"linux": ("linux", ".so"), "win32": ("windows", ".dll"), "darwin": ("darwin", ".dylib")}
MACHINES_3 = {"AMD64": "x86_64", "arm64": "aarch64"}
"""Processors that Python names otherwise than FMI does."""
CO_SIMULATION = 1
OK = 0

_POINTER, _TEXT = ctypes.c_void_p, ctypes.c_char_p
_LOGGER = ctypes.CFUNCTYPE(None, _POINTER, _TEXT, ctypes.c_int, _TEXT, _TEXT)
_ALLOCATE = ctypes.CFUNCTYPE(_POINTER, ctypes.c_size_t, ctypes.c_size_t)
_FREE = ctypes.CFUNCTYPE(None, _POINTER)
_LOGGER_3 = ctypes.CFUNCTYPE(None, _POINTER, ctypes.c_int, _TEXT, _TEXT)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        ("allocate", _ALLOCATE),
        ("free", _FREE),
        ("step_finished", _POINTER),
        ("environment", _POINTER),
    )


def rolling(name: str) -> float | None:
    """Value of an input of a rolling car; the name may end in a wheel after a dot or, in flat units, an underscore."""
    return next(
        (value for root, value in ROLLING.items() if re.fullmatch(rf"{root}([._](fl|fr|rl|rr))?", name)), None
    )


def binaries_2() -> tuple[str, str]:
    """Folder of this platform's library in a unit for FMI 2.0, and the library's ending."""
    return PLATFORMS.get(sys.platform, (sys.platform, ".so"))


def binaries_3() -> tuple[str, str]:
    """Folder of this platform's library in a unit for FMI 3.0, and the library's ending."""
    system, suffix = SYSTEMS_3.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine()
    return f"{MACHINES_3.get(machine, machine)}-{system}", suffix


def library(folder: Path, name: str, binaries: tuple[str, str]) -> Path:
    """The library of a unit for this platform, of a version of FMI; raises FileNotFoundError."""
    where, suffix = binaries
    path = folder / "binaries" / where / f"{name}{suffix}"
    if not path.is_file():
        raise FileNotFoundError(f"the unit holds no library for this platform ({where})")
    return path


def description_of(folder: Path) -> tuple[ElementTree.Element, str]:
    """The root of modelDescription.xml and the unit's name; raises ValueError where it is for no co-simulation."""
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    simulation = root.find("CoSimulation")
    if simulation is None:
        raise ValueError("modelDescription.xml: no CoSimulation element")
    return root, simulation.attrib["modelIdentifier"]


class Instance:
    """One instance of the unit, called as FMI 2.0 requires; `log` has its messages, `reals` its Real variables."""

    def __init__(self, folder: Path, root: ElementTree.Element, name: str) -> None:
        self.reals = [s.attrib for s in root.iter("ScalarVariable") if s[0].tag == "Real"]
        self.log: list[str] = []
        self._dll = ctypes.CDLL(str(library(folder, name, binaries_2())))
        self._callbacks = _Callbacks(_LOGGER(self._log_message), _ALLOCATE(0), _FREE(0), None, None)
        instantiate = self._dll.fmi2Instantiate
        instantiate.restype = _POINTER
        resources = (folder.resolve() / "resources").as_uri().encode()
        self._component = _POINTER(
            instantiate(
                b"trial",
                CO_SIMULATION,
                root.attrib["guid"].encode(),
                resources,
                ctypes.byref(self._callbacks),
                0,
                1,
            )
        )
        if not self._component:
            raise RuntimeError("fmi2Instantiate gave no instance")

    def _log_message(self, _: int, __: bytes, ___: int, ____: bytes, message: bytes) -> None:
        self.log.append(message.decode("utf-8", "replace").replace("%%", "%"))

    def call(self, name: str, *arguments: Any) -> None:
        """Call an FMI function on this instance; raises RuntimeError where its status is not fmi2OK."""
        status = getattr(self._dll, name)(self._component, *arguments)
        if status != OK:
            raise RuntimeError(f"{name} returned status {status}")

    def set_real(self, reference: int, value: float) -> None:
        """Set one Real variable."""
        self.call(
            "fmi2SetReal",
            ctypes.byref(ctypes.c_uint(reference)),
            ctypes.c_size_t(1),
            ctypes.byref(ctypes.c_double(value)),
        )

    def get_real(self, reference: int) -> float:
        """Read one Real variable."""
        value = ctypes.c_double()
        self.call(
            "fmi2GetReal",
            ctypes.byref(ctypes.c_uint(reference)),
            ctypes.c_size_t(1),
            ctypes.byref(value),
        )
        return value.value

    def initialise(self) -> None:
        """Initialise the instance."""
        no, zero = ctypes.c_int(0), ctypes.c_double(0.0)
        self.call("fmi2SetupExperiment", no, zero, zero, no, zero)
        self.call("fmi2EnterInitializationMode")
        self.call("fmi2ExitInitializationMode")

    def step(self, index: int) -> None:
        """Take one communication step."""
        self.call("fmi2DoStep", ctypes.c_double(index * STEP_S), ctypes.c_double(STEP_S), ctypes.c_int(1))

    def free(self) -> None:
        """End the instance."""
        self.call("fmi2Terminate")
        self._dll.fmi2FreeInstance(self._component)


class Instance3:
    """The same as `Instance` for FMI 3.0."""

    def __init__(self, folder: Path, root: ElementTree.Element, name: str) -> None:
        self.reals = [v.attrib for v in root.iter("Float64")]
        self.log: list[str] = []
        self._dll = ctypes.CDLL(str(library(folder, name, binaries_3())))
        self._logger = _LOGGER_3(self._log_message)
        instantiate = self._dll.fmi3InstantiateCoSimulation
        instantiate.restype = _POINTER
        token, no, yes = root.attrib["instantiationToken"].encode(), ctypes.c_bool(False), ctypes.c_bool(True)
        hidden = (no, yes, no, no)  # not visible, with a log, without events and early return
        nothing = (None, ctypes.c_size_t(0), None)
        self._component = _POINTER(instantiate(b"trial", token, None, *hidden, *nothing, self._logger, None))
        if not self._component:
            raise RuntimeError("; ".join(["fmi3InstantiateCoSimulation gave no instance", *self.log]))

    def _log_message(self, _: int, __: int, ___: bytes, message: bytes) -> None:
        self.log.append(message.decode("utf-8", "replace"))

    def call(self, name: str, *arguments: Any) -> None:
        """Call an FMI function on this instance; raises RuntimeError where its status is not fmi3OK."""
        status = getattr(self._dll, name)(self._component, *arguments)
        if status != OK:
            raise RuntimeError(f"{name} returned status {status}")

    def _real(self, name: str, reference: int, value: ctypes.c_double) -> None:
        one = ctypes.c_size_t(1)
        self.call(name, ctypes.byref(ctypes.c_uint(reference)), one, ctypes.byref(value), one)

    def set_real(self, reference: int, value: float) -> None:
        """Set one Float64 variable."""
        self._real("fmi3SetFloat64", reference, ctypes.c_double(value))

    def get_real(self, reference: int) -> float:
        """Read one Float64 variable."""
        value = ctypes.c_double()
        self._real("fmi3GetFloat64", reference, value)
        return value.value

    def initialise(self) -> None:
        """Initialise the instance."""
        no, zero = ctypes.c_bool(False), ctypes.c_double(0.0)
        self.call("fmi3EnterInitializationMode", no, zero, zero, no, zero)
        self.call("fmi3ExitInitializationMode")

    def step(self, index: int) -> None:
        """Take one communication step."""
        times = ctypes.c_double(index * STEP_S), ctypes.c_double(STEP_S)
        answers = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        self.call("fmi3DoStep", *times, ctypes.c_bool(True), *answers, ctypes.byref(ctypes.c_double()))

    def free(self) -> None:
        """End the instance."""
        self.call("fmi3Terminate")
        self._dll.fmi3FreeInstance(self._component)


def run(folder: Path, steps: int) -> dict[str, Any]:
    """Instantiate, step and free the unit; returns the outcome, JSON-able."""
    instance = None
    try:
        root, name = description_of(folder)
        made = Instance3 if root.attrib["fmiVersion"].startswith("3.") else Instance
        instance = made(folder, root, name)
        instance.initialise()
        reals = [(a["name"], a["causality"], int(a["valueReference"])) for a in instance.reals]
        for name, causality, reference in reals:
            value = rolling(name) if causality == "input" else None
            if value is not None:
                instance.set_real(reference, value)
        started = time.perf_counter()
        for index in range(steps):
            instance.step(index)
        elapsed = time.perf_counter() - started
        outputs = {
            name: instance.get_real(reference)
            for name, causality, reference in reals
            if causality == "output"
        }
        instance.free()
    except (OSError, ValueError, RuntimeError, KeyError, AttributeError, ElementTree.ParseError) as error:
        return {"ran": False, "error": str(error), "log": instance.log if instance else []}
    strange = sorted(name for name, value in outputs.items() if not math.isfinite(value))
    return {"ran": True, "step_us": elapsed / steps * 1e6, "not_finite": strange, "log": instance.log}


def end_with_parent() -> None:
    """Have Linux kill this process when its parent ends; its source is also run in another program."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG, SIGKILL: prctl(2)


if __name__ == "__main__":
    end_with_parent()
    print(json.dumps(run(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else STEPS)))
