"""Reading of foreign files: regular files of bounded size, quoted in messages as short, plain text."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from io import BufferedReader
from pathlib import Path
from typing import Any

from trpac_core.errors import TrpacError

LONGEST_QUOTE = 200
"""Characters of a file's own text, or of its name, that a message repeats."""
MOST_HASHED_BYTES = 10_000_000_000
"""Size of the largest file whose hash is worth waiting for: half a minute [bytes]."""
CHUNK_BYTES = 1 << 20


class FileError(OSError, TrpacError):
    """A file is not to be read: its name, why, and what was expected."""


def quoted(text: object, longest: int = LONGEST_QUOTE) -> str:
    """Text of a file, or its name, as messages repeat it: on one line, printable, at most `longest` characters.

    What is not printable, such as the escape codes of a terminal or half a surrogate pair, is written as its code.
    """
    plain = "".join(c if c.isprintable() else _code(c) for c in str(text)[: longest + 1])
    return plain if len(plain) <= longest else f"{plain[:longest]} ..."


def _code(character: str) -> str:
    return " " if character in "\n\r\t" else character.encode("unicode_escape").decode("ascii")


def open_file(path: str | Path, most_bytes: int, expected: str) -> BufferedReader:
    """A regular file of at most `most_bytes`, opened for reading; never a pipe, a device or a folder.

    Parameters
    ----------
    path : str or Path
        The file; links are followed.
    most_bytes : int
        Size above which it is refused unread.
    expected : str
        The expected content in messages, such as "a YAML file".

    Raises
    ------
    FileError
        If it is not there, cannot be read, is no regular file, or is larger.
    """
    name = quoted(path)
    try:
        _require_regular(os.stat(path), name, most_bytes, expected)
        # A pipe that took the file's place meanwhile is not waited for.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileError:
        raise
    except (OSError, ValueError) as error:  # the latter of a path with a zero in it
        why = getattr(error, "strerror", None) or error
        raise FileError(f"{name}: cannot be read: {quoted(why)}; expected {expected}.") from error
    file = os.fdopen(handle, "rb")
    try:
        _require_regular(os.fstat(handle), name, most_bytes, expected)
    except FileError:
        file.close()
        raise
    return file


def _require_regular(there: os.stat_result, name: str, most_bytes: int, expected: str) -> None:
    if not stat.S_ISREG(there.st_mode):
        kind = "a folder" if stat.S_ISDIR(there.st_mode) else "no regular file"
        raise FileError(f"{name}: is {kind}; expected {expected}.")
    if there.st_size > most_bytes:
        raise FileError(
            f"{name}: {there.st_size / 1e6:.1f} MB; expected {expected} of at most {most_bytes / 1e6:g} MB."
        )


def require_file(path: str | Path, most_bytes: int, expected: str) -> int:
    """Size of a regular file of at most `most_bytes` that can be read [bytes]; raises FileError.

    For libraries that open a file by its path.
    """
    with open_file(path, most_bytes, expected) as file:
        return os.fstat(file.fileno()).st_size


def read_bytes(path: str | Path, most_bytes: int, expected: str) -> bytes:
    """Content of a regular file of at most `most_bytes`; raises FileError."""
    with open_file(path, most_bytes, expected) as file:
        try:
            data = file.read(most_bytes + 1)
        except OSError as error:
            raise FileError(
                f"{quoted(path)}: cannot be read: {error.strerror}; expected {expected}."
            ) from error
    if len(data) > most_bytes:
        raise FileError(f"{quoted(path)}: grows; expected {expected} of at most {most_bytes / 1e6:g} MB.")
    return data


def read_text(path: str | Path, most_bytes: int, expected: str) -> str:
    """Text of a regular UTF-8 file of at most `most_bytes`; raises FileError."""
    data = read_bytes(path, most_bytes, expected)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise FileError(f"{quoted(path)}: row {row} is not UTF-8 text; expected {expected}.") from error


def file_sha256(path: str | Path) -> str:
    """SHA-256 of a regular file, as hexadecimal text; raises FileError."""
    total = hashlib.sha256()
    with open_file(path, MOST_HASHED_BYTES, "a file") as file:
        while chunk := file.read(CHUNK_BYTES):
            total.update(chunk)
    return total.hexdigest()


def parse_json(data: bytes | str, name: str) -> Any:
    """The content of a JSON text; raises FileError with `name` where it is damaged, or nested without end."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileError(f"{name}: is no JSON text ({quoted(error)}).") from error
