"""Translated functions as a library of this machine's C compiler, called from Python: what the tests compare."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from trpac_core.errors import TrpacError

from .translator.program import Function, Program
from .translator.types import Type, safe

FLAGS = ("-O3", "-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""How the C is compiled everywhere: loops over two numbers at once, as nobody reads errno or the processor's flags.
Fast math would change the results, and the code refuses it."""
WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Werror")

SIMPLE = {
    "double": ctypes.c_double,
    "int": ctypes.c_int,
    "bool": ctypes.c_bool,
    "enum": ctypes.c_int,
    "nothing": ctypes.c_int,
}
"""The types of ctypes of those that are no record; of nothing any."""


class CompilerError(TrpacError):
    """There is no C compiler, or it refuses the code."""


def compiler() -> list[str]:
    """The command of the C compiler: that of the variable CC, else cc; CompilerError where there is none."""
    command = shlex.split(os.environ.get("CC", "cc"))
    if not command or shutil.which(command[0]) is None:
        raise CompilerError(f"There is no C compiler {' '.join(command)!r}: install one, or name one in CC.")
    return command


def compiled(sources: list[Path], target: Path, *options: str) -> Path:
    """A shared library of C files; CompilerError with the compiler's messages."""
    files = [str(path) for path in sources]
    command = [*compiler(), *FLAGS, "-fPIC", "-shared", *options, *files, "-o", str(target), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CompilerError(f"{' '.join(command)}\n{done.stderr}")
    return target


class Library:
    """The functions of a program, by their Python functions.

    Parameters
    ----------
    program : Program
        What was translated.
    folder : Path
        Where code and library are written.
    """

    def __init__(self, program: Program, folder: Path) -> None:
        self.program = program
        self._kinds: dict[str, Any] = {}
        files = folder / "trpac.h", folder / "trpac.c"
        for file, text in zip(files, program.texts("trpac", "Made of Python: change that."), strict=True):
            file.write_text(text, encoding="utf-8")
        self._library = ctypes.CDLL(str(compiled([files[1]], folder / "trpac.so", *WARNINGS)))

    def call(self, python: Any, *arguments: Any) -> Any:
        """What the C of a function returns for these arguments; those that Python changes in place are changed."""
        function = self.program.require(python)
        called = getattr(self._library, function.c)
        kinds = [kind for _, kind in function.parameters]
        values = [self.to_c(value, kind) for value, kind in zip(arguments, kinds, strict=True)]
        result = self._called(function, called, values, kinds)
        for argument, value, kind in zip(arguments, values, kinds, strict=True):
            if kind.mutable:
                for f in kind.fields:
                    setattr(argument, f.name, self.to_python(getattr(value, safe(f.name)), f.type))
        return result

    def _called(self, function: Function, called: Any, values: list[Any], kinds: list[Type]) -> Any:
        by_value = not (function.updates or function.by_pointer or function.returns.kind == "nothing")
        called.restype = self.kind(function.returns) if by_value else None
        given = [
            ctypes.byref(value) if kind.big or kind.kind == "array" else value
            for value, kind in zip(values, kinds, strict=True)
        ]
        result = values[0] if function.updates else self.kind(function.returns)()
        returned = called(ctypes.byref(result), *given) if function.by_pointer else called(*given)
        return self.to_python(returned if by_value else result, function.returns)

    def kind(self, kind: Type) -> Any:
        """The type of ctypes."""
        if kind.kind == "array":
            return self.kind(kind.item) * kind.size
        if kind.kind in SIMPLE:
            return SIMPLE[kind.kind]
        if kind.c not in self._kinds:
            fields = [(safe(f.name), self.kind(f.type)) for f in kind.fields]
            if kind.kind == "tuple":
                fields = [("at", ctypes.c_double * kind.size)]
            if kind.kind == "optional":
                fields = [("has", ctypes.c_bool), ("value", self.kind(kind.item))]
            self._kinds[kind.c] = type(kind.c, (ctypes.Structure,), {"_fields_": fields})
        return self._kinds[kind.c]

    def to_c(self, value: Any, kind: Type) -> Any:
        """A Python value in C."""
        made = self.kind(kind)
        if kind.kind == "enum":
            return made(value.value)
        if kind.kind == "array":
            return made(*np.ravel(value).tolist())
        if kind.kind == "tuple":
            return made((ctypes.c_double * kind.size)(*value))
        if kind.kind == "optional":
            return made() if value is None else made(True, self.to_c(value, kind.item))
        if kind.kind == "record":
            parts = value if type(value) is tuple else [getattr(value, f.name) for f in kind.fields]
            return made(*(self.to_c(part, f.type) for part, f in zip(parts, kind.fields, strict=True)))
        return made(value)

    def to_python(self, value: Any, kind: Type) -> Any:
        """A value of C in Python."""
        if kind.kind == "nothing":
            return None
        if kind.kind == "enum":
            return kind.python(value)
        if kind.kind == "array":
            return np.array(value[:]).reshape(kind.shape)
        if kind.kind == "tuple":
            return tuple(value.at)
        if kind.kind == "optional":
            return self.to_python(value.value, kind.item) if value.has else None
        if kind.kind == "record":
            parts = {f.name: self.to_python(getattr(value, safe(f.name)), f.type) for f in kind.fields}
            return tuple(parts.values()) if kind.python is tuple else kind.python(**parts)
        return value
