"""What is told to the motors between the values of a table, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .compiling import compiled

Array = NDArray[np.floating[Any]]

COMMAND_STEP_S = 0.01


@compiled
def on_grid(table: Array, at: float) -> float:
    """`table` at `at` steps from its start, linear between, held beyond."""
    if at <= 0.0:
        return table[0]
    i = int(at)
    if i >= table.size - 1:
        return table[-1]
    return table[i] + (at - i) * (table[i + 1] - table[i])


@njit(cache=True, inline="always")
def commanded(command: Array, wheel: int, time: float) -> float:
    return on_grid(command[:, wheel], time / COMMAND_STEP_S)


@compiled
def joined(command: Array, wheel: int, time: float, message: float) -> float:
    """The command as straight lines between messages."""
    sent = np.floor(time / message)
    first = commanded(command, wheel, sent * message)
    return first + (time / message - sent) * (commanded(command, wheel, (sent + 1.0) * message) - first)
