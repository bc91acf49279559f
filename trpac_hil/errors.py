"""Errors of the rig."""

from __future__ import annotations

from scenarios.errors import ScenarioError


class HilError(ScenarioError):
    """The rig cannot start: what, where, what was expected, how to mend."""
