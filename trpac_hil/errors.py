"""Errors of the rig."""

from __future__ import annotations

from scenarios.errors import ScenarioError


class HilError(ScenarioError):
    """The rig cannot start; the text says what is wrong, where, what was expected and what to do."""
