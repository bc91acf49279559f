"""A co-simulation slave whose callbacks raise no exceptions.

The wrapper of pythonfmu frees the slave when an exception leaves a callback, while the host keeps its handle:
the next call would use freed memory. It also passes log texts on as printf formats. This module handles both for all
slaves; see findings 4 and 5 in lab/2026-11-29_findings_on_pythonfmu.md.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
import threading
import zlib
from _thread import interrupt_main
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial, wraps
from typing import Any, ClassVar

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from trpac_core.files import FileError, parse_json, quoted
from trpac_core.parameters.variables import Kind, Variable
from trpac_core.sensors import LONGEST_STEP_S

from .host import end_in_order

Value = float | int | bool | str
STATE_SCHEMA = 1
INTERRUPT_DELAY_S = 0.1
"""Delay after which a Ctrl-C within a callback is raised again, then in the host's code: callbacks return sooner, also
on a busy machine [s]."""
LONGEST_LOG = 1000
"""Greatest number of characters of a log line."""
MOST_STATE_BYTES = 16_000_000
"""Largest serialised state that is read; those of the unit have 0.1 MB and the path of a picture [bytes]."""
MOST_INTEGER = 1 << 31
"""Integers of FMI 2.0 have 32 bits."""
GREATEST_JUMP = 0.5
"""Greatest distance of a communication point from the end of the last step, as a part of the step: hosts round their
times, some to single precision; a step that is left out or taken twice is twice as far away [-]."""
PYTHON: dict[Kind, Callable[[Any], Value]] = {
    Kind.REAL: float,
    Kind.INTEGER: int,
    Kind.BOOLEAN: bool,
    Kind.STRING: str,
}
"""Python types that the wrapper accepts; on others it raises an error that is not caught."""
NEUTRAL: dict[Kind, Value] = {Kind.REAL: 0.0, Kind.INTEGER: 0, Kind.BOOLEAN: False, Kind.STRING: ""}
"""Start values of outputs, and values of unknown value references."""


def log_text(message: str) -> str:
    """The message as one short line without printf directives and lone surrogates, as the wrapper can log it."""
    return quoted(message, LONGEST_LOG).replace("%", "%%")


def guarded(fallback: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate a callback to log its exceptions and then return `fallback(*arguments)`."""

    def decorate(callback: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(callback)
        def run(self: GuardedSlave, *arguments: Any) -> Any:
            try:
                return callback(self, *arguments)
            except BaseException as error:  # noqa: BLE001 - no exception may reach C++
                with suppress(BaseException):  # nor one of the logging
                    self.report_fault(callback.__name__, error)
            return fallback(*arguments)

        return run

    return decorate


def settled(callback: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a function to clear an error that C code left pending, by raising and catching another one."""

    @wraps(callback)
    def run(self: GuardedSlave, *arguments: Any) -> Any:
        try:
            raise LookupError  # noqa: TRY301 - raised to be caught, see above
        except (LookupError, SystemError):  # the second where the pending error spoils the first
            pass
        return callback(self, *arguments)

    return run


def _nothing(*_: Any) -> None:
    return None


def _fits(kind: Kind, value: Any) -> bool:
    """Whether the wrapper accepts such a value for a variable of this kind."""
    if kind is Kind.STRING:
        return (
            isinstance(value, str) and value.encode("utf-8", "ignore").decode() == value
        )  # no half surrogate pair
    if isinstance(value, float):
        return kind is Kind.REAL
    return isinstance(value, int) and -MOST_INTEGER <= value < MOST_INTEGER


def holes(items: list[Any]) -> list[int]:
    """Indices of a list at which C code has left null pointers; reading one would crash Python.

    The address of its items is the fourth word of a list object (CPython 3.11, Include/cpython/listobject.h).
    """
    word = ctypes.sizeof(ctypes.c_void_p)
    address = ctypes.c_void_p.from_address(id(items) + 3 * word).value
    if address is None:
        return []
    return [
        index for index, item in enumerate((ctypes.c_void_p * len(items)).from_address(address)) if not item
    ]


def _problem(begin_s: float, step_s: float, ended_s: float | None) -> tuple[str, str] | None:
    """Why a step cannot be taken, as key and sentences, or None.

    The last step ended at `ended_s`; None where the host may begin at any time.
    """
    if not 0.0 < step_s <= LONGEST_STEP_S:
        return "size", (
            f"step size is {step_s} s; expected above 0 and up to {LONGEST_STEP_S:g} s. Step again with such a size."
        )
    if not math.isfinite(begin_s):
        return "begin", f"the step begins at {begin_s} s; expected a finite time. Step again from one."
    if ended_s is not None and abs(begin_s - ended_s) > GREATEST_JUMP * step_s:
        return "begin", (
            f"the step begins at {begin_s} s; expected {ended_s} s, where the last one ended. Step again from there, "
            "or restore a state or reset the unit before time jumps."
        )
    return None


class Held(dict[str, Any]):
    """Values by name; a name that is missing here is computed by `show` when it is read."""

    def __init__(self, values: Mapping[str, Any], show: Callable[[str], Value]) -> None:
        super().__init__(values)
        self._show = show

    def __missing__(self, name: str) -> Value:
        return self._show(name)


class InstantiationError(RuntimeError):
    """The unit cannot be instantiated; the text is escaped for a printf-like logger."""


class GuardedSlave(Fmi2Slave):
    """Base of all slaves: variables by name, callbacks without exceptions, one log line per kind, the state as bytes.

    A slave sets `variables` and overrides `prepare`, `initialise`, `step`, `inner_state` and
    `restore_inner_state`, and `shown` for outputs that are computed when they are read; all may raise.
    """

    variables: ClassVar[tuple[Variable, ...]] = ()
    volatile: ClassVar[frozenset[str]] = frozenset()
    """Inputs of one step only, such as addresses: `clear_volatile` resets them, the state does not contain them."""
    views: ClassVar[frozenset[str]] = frozenset()
    """Outputs that `shown` returns; `values` does not contain them."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        # The wrapper prepends the resources to sys.path at every instantiation and leaves them there. All modules of
        # the unit are imported by now, and packages find their parts without it.
        sys.path[:] = [entry for entry in sys.path if entry != self.resources]
        self._starts: dict[str, Value] = {
            v.name: NEUTRAL[v.kind] if v.start is None else v.start for v in self.variables
        }
        self._forgotten = {name: self._starts[name] for name in sorted(self.volatile)}
        self.values = Held({n: s for n, s in self._starts.items() if n not in self.views}, self._view)
        self._names: dict[Kind, dict[int, str]] = {
            kind: {vr: v.name for vr, v in enumerate(self.variables) if v.kind is kind} for kind in Kind
        }
        self._inputs = frozenset(v.name for v in self.variables if v.causality == "input")
        self._inputs_and_parameters = self._inputs | {
            v.name for v in self.variables if v.causality == "parameter"
        }
        self._settable = self._inputs_and_parameters
        self._reported: set[str] = set()
        self._ready = self._computed = False
        self._initialising = self._stale = False
        self._ended_s: float | None = None
        try:
            self.prepare()
        except Exception as error:
            # During instantiation the wrapper handles an exception, which is how the host learns of it. Many hosts show
            # no log of a unit that they could not instantiate.
            text = quoted(f"{self.modelName} cannot be instantiated: {error}", LONGEST_LOG)
            print(text, file=sys.stderr)
            raise InstantiationError(log_text(text)) from error
        finally:
            # Called after all libraries are loaded, so that in a host without Python the interpreter ends before them.
            end_in_order(str(self.resources))

    # Overridden by slaves

    def prepare(self) -> None:
        """Load what all instances need; where it raises, the unit is not instantiated."""

    def initialise(self) -> None:
        """Apply the parameters; ValueError where they cannot be applied."""

    def step(self, step_s: float) -> None:
        """Advance by one communication step, above 0 and up to LONGEST_STEP_S [s]."""
        raise NotImplementedError

    def shown(self, name: str) -> Value:
        """An output of `views` after the last step, or after the initialisation."""
        raise NotImplementedError

    def inner_state(self) -> Any:
        """The state of `step` between calls, JSON-able and exact."""
        return None

    def restore_inner_state(self, values: dict[str, Any], state: Any) -> None:
        """Restore what `inner_state` returned under these variable values, or raise and change nothing."""

    def _view(self, name: str) -> Value:
        if name not in self.views:
            raise KeyError(name)
        return self.shown(name) if self._ready or self._computed else self._starts[name]

    def _compute_outputs(self) -> None:
        """Compute the outputs from the values set so far, for a host that reads them during initialisation."""
        self._stale = self._computed = False
        try:
            self.initialise()
        except ValueError:  # reported at the end of the initialisation where it persists
            return
        self._computed = True

    def clear_volatile(self) -> None:
        """Reset the inputs of one step only."""
        self.values.update(self._forgotten)

    def report(self, kind: str, status: Fmi2Status, message: str) -> None:
        """Log a message, once per kind and instance; errors go to standard error too, for hosts without a log."""
        if kind in self._reported:
            return
        self._reported.add(kind)
        self.log(log_text(message), status)
        if status >= Fmi2Status.error:
            with suppress(OSError, ValueError):  # standard error may be closed, and the log has it
                print(quoted(message, LONGEST_LOG), file=sys.stderr)

    def report_fault(self, name: str, error: BaseException) -> None:
        """Log an exception of the callback of this name; an interrupt is raised again in the host."""
        if isinstance(error, KeyboardInterrupt):
            threading.Timer(INTERRUPT_DELAY_S, interrupt_main).start()
            return
        kind = type(error).__name__
        self.report(
            f"{name}: {kind}",
            Fmi2Status.error,
            f"{self.modelName}: {name} failed: {kind}: {quoted(error)}. The outputs hold their last values. "
            "Please report this as a fault of the unit.",
        )

    # FMI callbacks

    @guarded(_nothing)
    def enter_initialization_mode(self) -> None:
        """From now on outputs can be read."""
        self._initialising = self._stale = True

    @guarded(_nothing)
    def exit_initialization_mode(self) -> None:
        """Apply the parameters; where they are wrong this is logged, and each step is then discarded."""
        self._initialising = self._stale = False
        self._settable = self._inputs
        try:
            self.initialise()
        except ValueError as error:
            message = f"{self.modelName} cannot be initialised, and every step will be discarded: {error}"
            self.report("initialise", Fmi2Status.error, message)
            self._computed = False
        else:
            self._ready = True

    @guarded(lambda *_: False)
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Take one communication step; returns False (fmi2Discard) where nothing could be computed.

        A step that is refused changes nothing. The first step, and the first after a restored state or a fault, may
        begin at any time.
        """
        if not self._ready:
            if self._settable is not self._inputs:  # else the reason is logged already
                text = f"{self.modelName}: a step was asked for before the initialisation has ended; it is discarded."
                self.report("not ready", Fmi2Status.error, text)
            return False
        problem = _problem(current_time, step_size, self._ended_s)
        if problem:
            text = f"{self.modelName}: {problem[1]} The step is discarded and no time has passed."
            self.report(f"step {problem[0]}", Fmi2Status.error, text)
            return False
        self._ended_s = None
        self.step(step_size)
        self._ended_s = current_time + step_size
        return True

    @guarded(_nothing)
    def terminate(self) -> None:
        """Do nothing: the unit has no open files and no threads."""

    def _set(self, kind: Kind, references: list[int], values: list[Any]) -> None:
        names, settable = self._names[kind], self._settable
        self._stale = self._initialising
        for reference, value in zip(references, values, strict=True):
            name = names.get(reference)
            if name in settable:
                self.values[name] = value
            else:
                self.report(
                    f"set {kind.value} {reference}",
                    Fmi2Status.error,
                    f"{self.modelName}: value reference {reference} ({name or 'unknown'}) is no {kind.value} "
                    "that can be set now, and was ignored. Inputs can be set at any time, parameters until "
                    "the initialisation ends.",
                )

    def _get(self, kind: Kind, references: list[int]) -> list[Any]:
        if self._stale:
            self._compute_outputs()
        names, values, python = self._names[kind], self.values, PYTHON[kind]
        try:
            return [python(values[names[reference]]) for reference in references]
        except KeyError:
            unknown = [reference for reference in references if reference not in names]
            self.report(
                f"get {kind.value}",
                Fmi2Status.error,
                f"{self.modelName}: value references {unknown} are no {kind.value} of this unit: read as "
                f"{NEUTRAL[kind]!r}.",
            )
            return [
                python(values[names[reference]]) if reference in names else NEUTRAL[kind]
                for reference in references
            ]

    @guarded(_nothing)
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set Real variables by value reference."""
        self._set(Kind.REAL, vrs, values)

    @guarded(_nothing)
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer variables by value reference."""
        self._set(Kind.INTEGER, vrs, values)

    @guarded(_nothing)
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Set Boolean variables by value reference."""
        self._set(Kind.BOOLEAN, vrs, values)

    def __init_subclass__(cls) -> None:
        # A text that is not UTF-8 leaves a Python error pending while the wrapper looks up this callback, and only
        # properties of the instance's own class are then found.
        found = settled(lambda self: partial(GuardedSlave.set_string, self))
        cls.set_string = property(found)  # type: ignore[method-assign, assignment]

    @guarded(_nothing)
    def set_string(self, vrs: list[int], values: list[str | None]) -> None:
        """Set String variables by value reference; a null pointer is the empty text, as is one that is not UTF-8."""
        # The wrapper leaves a hole in the list where a text is not UTF-8.
        unreadable = holes(values)
        if unreadable:
            self.report(
                "set String encoding",
                Fmi2Status.error,
                f"{self.modelName}: the texts for value references {[vrs[index] for index in unreadable]} are "
                "not UTF-8, as FMI 2.0 has them, and were taken as empty.",
            )
        texts = ["" if index in unreadable else values[index] or "" for index in range(len(values))]
        self._set(Kind.STRING, vrs, texts)

    @guarded(lambda vrs: [0.0] * len(vrs))
    def get_real(self, vrs: list[int]) -> list[float]:
        """Read Real variables by value reference."""
        return self._get(Kind.REAL, vrs)

    @guarded(lambda vrs: [0] * len(vrs))
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Read Integer variables by value reference."""
        return self._get(Kind.INTEGER, vrs)

    @guarded(lambda vrs: [False] * len(vrs))
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Read Boolean variables by value reference."""
        return self._get(Kind.BOOLEAN, vrs)

    @guarded(lambda vrs: [""] * len(vrs))
    def get_string(self, vrs: list[int]) -> list[str]:
        """Read String variables by value reference."""
        return self._get(Kind.STRING, vrs)

    # The state is the bytes of a JSON text: immutable, so that it can be restored many times, and serialised
    # without failure.

    @guarded(lambda: b"")
    def _get_fmu_state(self) -> bytes:
        state = {
            "schema": STATE_SCHEMA,
            "unit": __name__,
            "ready": self._ready,
            "initialised": self._settable is self._inputs,
            "values": self.values | self._forgotten,
            "inner": self.inner_state() if self._ready else None,
        }
        text = json.dumps(state)
        return f'{text[:-1]}, "crc32": {zlib.crc32(text.encode())}}}'.encode()

    @guarded(_nothing)
    def _set_fmu_state(self, state: bytes) -> None:
        content, problem = self._read_state(state)
        before = vars(self).copy()
        if not problem and content["ready"]:
            try:
                self.restore_inner_state(content["values"], content["inner"])
                for name in self.views:
                    self.shown(name)
            except Exception as error:  # noqa: BLE001 - a host's bytes: a file changed or gone, or anything else
                kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
                problem = "inner", f"it cannot be taken up ({kind}{quoted(error, LONGEST_LOG)})"
        if problem:
            self.__dict__ = before
            text = f"{self.modelName}: the state was not restored: {problem[1]}."
            self.report(f"state {problem[0]}", Fmi2Status.error, text)
            return
        self._settable = self._inputs if content["initialised"] else self._inputs_and_parameters
        self.values = Held(content["values"], self._view)
        self._ready, self._computed = content["ready"], False
        self._ended_s = None
        self._initialising = self._stale = not content["initialised"]

    def _read_state(self, state: bytes) -> tuple[dict[str, Any], tuple[str, str] | None]:
        """The content of a serialised state, and its problem as key and sentence or None."""
        if len(state) > MOST_STATE_BYTES:
            return {}, ("size", f"it has {len(state) / 1e6:.0f} MB, expected a state of this unit")
        try:
            content = parse_json(state, "it")
            origin = (content["schema"], content["unit"])
            crc32 = content.pop("crc32", None)
            saved = json.dumps(content).encode()
        except (FileError, KeyError, TypeError, AttributeError, RecursionError) as error:
            return {}, ("other", f"it is not a state of this unit ({type(error).__name__}: {quoted(error)})")
        if origin != (STATE_SCHEMA, __name__):
            return {}, ("build", f"it was saved by another build of the unit ({quoted(origin[1])})")
        if crc32 != zlib.crc32(saved):
            return {}, ("damage", "it is damaged")
        if not self._states(content):
            return {}, ("variables", "its variables are not those of this unit")
        return content, None

    def _states(self, content: dict[str, Any]) -> bool:
        """Whether a state has exactly the expected keys, and a value of its kind for each variable."""
        values, kinds = content.get("values"), {v.name: v.kind for v in self.variables}
        return (
            content.keys() == {"schema", "unit", "ready", "initialised", "values", "inner"}
            and isinstance(content["ready"], bool)
            and isinstance(content["initialised"], bool)
            and isinstance(values, dict)
            and values.keys() == self.values.keys()
            and all(_fits(kinds[name], value) for name, value in values.items())
        )

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state
