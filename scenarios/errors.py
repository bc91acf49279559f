"""Errors of scenario files, and what an error says of an unknown word."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from trpac_core.errors import TrpacError


class ScenarioError(TrpacError):
    """A scenario, camera, road or manoeuvre file is wrong: what, where, what was expected, how to mend."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """A closing sentence for an error about an unknown word: what it may have meant, or what is known."""
    words = list(known)
    close = get_close_matches(word, words, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}Known: {', '.join(words)}."
