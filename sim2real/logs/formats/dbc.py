"""DBC files of strangers, read with bounds on what they may ask of the memory."""

from __future__ import annotations

import re
from pathlib import Path

import bitstruct  # type: ignore[import-untyped]
import cantools
from cantools.database.can import Database, Signal

from sim2real.logs.errors import LogError
from trpac_core.files import FileError, quoted, read_bytes

MOST_BYTES = 16_000_000
"""Largest DBC file that is read [bytes]; files of a whole car have some megabytes."""
LONGEST_PAYLOAD = 4095
"""Longest message that a DBC file may describe [bytes]; ISO 15765-2. cantools stores each of its bits."""
MOST_BRANCHES = 1_000_000
"""Numbers in all ranges of extended multiplexing that a DBC file may have; cantools stores each of them."""
DAMAGE = (
    cantools.Error,
    bitstruct.Error,
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    ArithmeticError,
    AssertionError,
    MemoryError,
    NotImplementedError,
    RecursionError,
)
"""Exceptions that cantools raises on damaged files, on reading or at the first message."""
_COMMENT_OR_TEXT = re.compile(r'//[^\n]*|"(?:\\"|[^"])*?"')
_SIZES = re.compile(r":\s*([-+]?\d+)(?:\s*\|\s*([-+]?\d+))?")
"""Numbers after a colon: bytes of a message, or first bit and bits of a signal."""
_BRANCHES, _RANGE = re.compile(r"SG_MUL_VAL_[^;]*"), re.compile(r"(\d+)\s*[-+]\s*(\d+)")
_BODIES = re.compile(r"^[ \t]*(?:BO_[ \t]+(\d+)|SG_[ \t]+(\w+))", re.MULTILINE)
"""Heads of messages and signals: a message's number, or a signal's name."""
_VALUE_TABLE = re.compile(
    r'^[ \t]*+VAL_\s++(\d++)\s++([A-Za-z_]\w*+)\s++(?:[-+.\w]++\s++"(?:\\"|[^"])*+"\s*+)*+;', re.MULTILINE
)
"""A value table: number of the message, name of the signal; matched without going back, in linear time."""
_NO_VALUE = re.compile(
    r"sna|snv|n/?a|(signal|value|data)?\s*(is\s+)?(not|un)\s*(available|avail|valid|defined|used|known|init\w*)"
    r"|invalid|init\w*|err(or)?|fault\w*|fail\w*|undefined|unknown",
    re.IGNORECASE,
)
"""Names in a value table that say that there is no value; blanks and underscores do not matter."""


def load_dbc(path: str | Path) -> Database:
    """The database of a DBC file; raises LogError where it is missing, damaged or too large."""
    try:
        text = _text(read_bytes(path, MOST_BYTES, "a DBC file"))
        _require_sizes(text)
        return cantools.database.load_string(_without_orphans(text), "dbc")  # type: ignore[return-value]
    except FileError as error:
        raise LogError(str(error)) from error
    except DAMAGE as error:
        raise LogError(f"{quoted(path)}: cannot be read as DBC file ({quoted(error)}).") from error


def _without_orphans(text: str) -> str:
    """A DBC file's text without value tables of signals that it does not have, at which cantools gives up."""
    signals: dict[str, set[str]] = {}
    message = ""
    for number, name in _BODIES.findall(text):
        message = number or message
        signals.setdefault(message, set()).add(name)
    return _VALUE_TABLE.sub(lambda found: found[0] if found[2] in signals.get(found[1], ()) else "", text)


def _text(data: bytes) -> str:
    """UTF-8, or the encoding that the format's first tools write: cp1252."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def no_value(signal: Signal) -> frozenset[float]:
    """Raw values of a signal that its value table names as "signal not available" (SNA), invalid or an error.

    Some tools write the codes of a signed signal as if it had no sign: they are those of its bits.
    """
    codes = {
        float(raw)
        for raw, name in (signal.choices or {}).items()
        if _NO_VALUE.fullmatch(str(name).replace("_", " ").strip())
    }
    if signal.is_float or not signal.is_signed:
        return frozenset(codes)
    values = 2.0**signal.length
    return frozenset(raw - values if values / 2.0 <= raw < values else raw for raw in codes)


def _require_sizes(text: str) -> None:
    """Raise ValueError where a message, signal or multiplexer is so large that cantools would fill the memory."""
    bare = _COMMENT_OR_TEXT.sub(lambda found: " " if found[0][0] == "/" else '""', text)
    for found in _SIZES.finditer(bare):
        if not all(0 <= int(size) <= 8 * LONGEST_PAYLOAD for size in found.groups("0")):
            raise ValueError(f"{quoted(found[0])}: no message has so many bytes or bits")
    ranges = (each for found in _BRANCHES.finditer(bare) for each in _RANGE.findall(found[0]))
    if sum(max(0, int(last) - int(first)) for first, last in ranges) > MOST_BRANCHES:
        raise ValueError("its multiplexers have too many branches")
