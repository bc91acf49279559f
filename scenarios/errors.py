"""Errors of scenario files, and hints on unknown words."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from trpac_core.errors import TrpacError


class ScenarioError(TrpacError):
    """A scenario, camera, road or manoeuvre file is wrong; the text says what, where, and what was expected."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """Last sentences of an error about an unknown word: the closest known word, and all known words."""
    words = list(known)
    close = get_close_matches(word, words, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}Known: {', '.join(words)}."
