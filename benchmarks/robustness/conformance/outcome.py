"""What comes of an operation."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Outcome(Enum):
    """Of one client, one operation and one unit; the value is what the table shows."""

    OK = "ok"
    NOT_OFFERED = "-"
    FAILED = "FAILED"


class Cell(NamedTuple):
    """An outcome, and why where it is not OK."""

    outcome: Outcome
    reason: str = ""


class NotOfferedError(Exception):
    """The client has no such operation, or the unit no such variable; the text says which."""


class NotAsExpectedError(Exception):
    """The unit did something else; the text says what."""


def expect(problems: list[str] | bool, otherwise: str = "") -> None:
    """Raise NotAsExpectedError with the problems, if there are any, or where a condition is false."""
    if problems is False or (isinstance(problems, list) and problems):
        raise NotAsExpectedError(otherwise if problems is False else "; ".join(problems[:3]))
