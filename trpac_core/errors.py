"""The base of all errors that this project raises on purpose."""

from __future__ import annotations


class TrpacError(ValueError):
    """Something that was given cannot be used: what, where, what was expected, how to mend it; a problem a line."""
