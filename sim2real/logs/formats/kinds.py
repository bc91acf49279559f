"""Which format a file is of, by its first bytes."""

from __future__ import annotations

import re

KINDS = ("BLF", "ASC", "candump", "TRC")
"""Formats that hold raw frames of a bus alone."""
_MAT_VERSION = (b"\x00\x01IM", b"\x01\x00MI", b"\x00\x02IM")
"""What stands at byte 124 of a MAT-file, before which its header is free text: version and byte order."""
_HDF5, _MAT_4 = b"\x89HDF\r\n\x1a\n", b"\0\0\0\0"
"""How HDF5 begins, and a MAT-file of version 4 with a matrix of doubles."""

_CANDUMP = re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}#")
_TRC = re.compile(rb"(?:[ \t]*;[^\n]*\n)*?[ \t]*;[^\n]*(\$FILEVERSION|PEAK|PCAN|\.trc)", re.IGNORECASE)
_ASC = re.compile(
    rb"(\s*//[^\n]*\n)*\s*(date\s+\w+\s[^\n,;]*\d:\d\d[^\n,;]*\n|base\s+(hex|dec)\b|begin\s+triggerblock\b)",
    re.IGNORECASE,
)


def kind_of(start: bytes) -> str | None:
    """Which bus log or MAT-file begins like this; None for another file."""
    if start[:4] == b"LOGG":
        return "BLF"
    if start[:6] == b"MATLAB" or start[124:128] in _MAT_VERSION or start[:8] == _HDF5 or start[:4] == _MAT_4:
        return "MAT"
    kinds = {"candump": _CANDUMP, "TRC": _TRC, "ASC": _ASC}
    return next((kind for kind, pattern in kinds.items() if pattern.match(start)), None)
