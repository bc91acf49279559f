"""Errors of logs and mapping files."""

from __future__ import annotations

from scenarios.errors import ScenarioError


class LogError(ScenarioError):
    """A log cannot be used; one line per problem: which file, column or row, what was expected, how to mend it."""
