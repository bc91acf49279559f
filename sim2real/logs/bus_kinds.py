"""Which format of bus log a text is."""

from __future__ import annotations

import re

KINDS = ("BLF", "ASC", "candump", "TRC")
"""Formats that hold raw frames alone."""

_CANDUMP = re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}#")
_TRC = re.compile(rb"\s*;[^\n]*(\$FILEVERSION|PEAK|PCAN|\.trc)", re.IGNORECASE)
_ASC = re.compile(
    rb"(\s*//[^\n]*\n)*\s*(date\s+\w+\s[^\n,;]*\d:\d\d[^\n,;]*\n|base\s+(hex|dec)\b|begin\s+triggerblock\b)",
    re.IGNORECASE,
)


def text_kind(start: bytes) -> str | None:
    """Which bus log of text begins like this; None for another text."""
    kinds = {"candump": _CANDUMP, "TRC": _TRC, "ASC": _ASC}
    return next((kind for kind, pattern in kinds.items() if pattern.match(start)), None)
