"""Conversion formulas in log files: arithmetic of one variable, parsed by a whitelist and never run as a program.

It needs numpy alone, so that `mdf_channels`, a program of its own, can load it by its place.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

LONGEST = 1_000
"""Characters of a formula."""

OPERATORS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
FUNCTIONS: Mapping[str, np.ufunc] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "ln": np.log,
    "log10": np.log10,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "arcsin": np.arcsin,
    "arccos": np.arccos,
    "arctan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "floor": np.floor,
    "ceil": np.ceil,
}
"""Functions of one argument, in upper or lower case; `log` is the natural logarithm."""


class FormulaError(ValueError):
    """A formula that is no plain arithmetic: what in it, and what is known."""


def evaluate(formula: str, values: Mapping[str, Any]) -> Any:
    """Value of a formula, in floating point.

    Numbers, the names among `values`, + - * /, ^ or ** for a power, brackets, and `FUNCTIONS`; all numbers count as
    floating point, so that no power takes longer than another.

    Parameters
    ----------
    formula : str
        Such as "0.5 * X1 + 3".
    values : mapping
        Arrays or numbers by name.

    Raises
    ------
    FormulaError
        If anything else is in it.
    """
    if len(formula) > LONGEST:
        raise FormulaError(f"is {len(formula)} characters long; expected at most {LONGEST}")
    try:
        tree = ast.parse(formula.replace("^", "**").strip(), mode="eval")
        with np.errstate(all="ignore"):
            return _value(tree.body, values)
    except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        if isinstance(error, FormulaError):
            raise
        raise FormulaError("is no arithmetic that can be read") from error


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name) if name in values:
            return np.asarray(values[name], dtype=np.float64)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            value = _value(operand, values)
            return -value if isinstance(sign, ast.USub) else value
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name.lower() in FUNCTIONS:
            return FUNCTIONS[name.lower()](_value(argument, values))
    what = ast.unparse(node)[:60]
    known = ", ".join(FUNCTIONS)
    raise FormulaError(
        f"has {what!r}; expected numbers, {', '.join(values)}, + - * / ^, brackets and {known}"
    )
