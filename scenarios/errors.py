"""Errors of scenario files."""

from __future__ import annotations

from difflib import get_close_matches


class ScenarioError(ValueError):
    """A scenario, camera, road or manoeuvre file is wrong: what, where, what was expected, how to mend."""


def suggestion(word: str, known: list[str]) -> str:
    """A closing sentence for an error about an unknown word: what it may have meant, or what is known."""
    close = get_close_matches(word, known, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}Known: {', '.join(known)}."
