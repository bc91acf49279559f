"""Progress, for whoever wants to show it."""

from __future__ import annotations

from collections.abc import Callable

Told = Callable[[str, int, int], None]
"""Told a stage, and how much of how much of it is done."""


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody is told."""
