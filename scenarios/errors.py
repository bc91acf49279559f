"""Errors of scenario files."""

from __future__ import annotations


class ScenarioError(ValueError):
    """A scenario, camera, road or manoeuvre file is wrong: what, where, what was expected, how to mend."""
