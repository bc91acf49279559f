"""Callables that long work tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Given how many of how many items are done."""
StageProgress = Callable[[str, int, int], None]
"""Given the stage, and how many of how many of its items are done."""


def silent(*_: object) -> None:
    """Show no progress."""
