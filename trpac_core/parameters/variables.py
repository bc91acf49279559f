"""What a named variable is, in the terms of FMI 2.0."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """FMI 2.0 type of a variable; the value is the element's name."""

    REAL = "Real"
    INTEGER = "Integer"
    BOOLEAN = "Boolean"
    STRING = "String"


@dataclass(frozen=True)
class Variable:
    """One FMI 2.0 scalar variable; in a unit its value reference is its place in the table."""

    name: str
    kind: Kind
    causality: str
    variability: str
    description: str
    unit: str | None = None
    start: float | int | bool | str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    source: str = ""
    """Of a parameter: the field of the estimator's configuration, as a dotted path; empty: the unit's own."""
    binary: str = ""
    """Of a part of a binary variable: the binary variable's name; this one's is that and the part."""
