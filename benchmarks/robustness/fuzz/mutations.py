"""Damage to files: what disks, transfers, editors and tired people do to them."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

Rng = np.random.Generator
NUMBERS = (*b"nan inf -1 0 1e308 -1e308 1e-320 99999999999999999999 ~ [] {} true 'x'".split(), b"")
WORDS = (
    *(b": ", b"\n", b"\t", b"- ", b"{", b"[", b"&a ", b"*a", b"<<: ", b"!!python/object:os.system "),
    *(b"\xff\xfe", b"\x00", b"%", b"'", b'"', b"#"),
)


def cut(data: bytes, rng: Rng) -> bytes:
    """The end is missing."""
    return data[: int(rng.integers(0, len(data)))]


def flip(data: bytes, rng: Rng) -> bytes:
    """Some bits are the other way round."""
    array = np.frombuffer(data, np.uint8).copy()
    places = rng.integers(0, len(array), int(rng.integers(1, 9)))
    array[places] ^= (1 << rng.integers(0, 8, len(places))).astype(np.uint8)
    return array.tobytes()


def lose(data: bytes, rng: Rng) -> bytes:
    """A piece from the middle is missing."""
    start, length = _piece(data, rng)
    return data[:start] + data[start + length :]


def blank(data: bytes, rng: Rng) -> bytes:
    """A piece holds zeros."""
    start, length = _piece(data, rng)
    return data[:start] + bytes(length) + data[start + length :]


def rubbish(data: bytes, rng: Rng) -> bytes:
    """A piece holds anything."""
    start, length = _piece(data, rng)
    return data[:start] + rng.bytes(length) + data[start + length :]


def twice(data: bytes, rng: Rng) -> bytes:
    """A piece is there twice."""
    start, length = _piece(data, rng)
    return data[: start + length] + data[start:]


def other_number(data: bytes, rng: Rng) -> bytes:
    """One number is another one, or none."""
    numbers = list(re.finditer(rb"-?\d+(\.\d+)?([eE][+-]?\d+)?", data))
    if not numbers:
        return flip(data, rng)
    chosen = numbers[int(rng.integers(len(numbers)))]
    return data[: chosen.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + data[chosen.end() :]


def odd_word(data: bytes, rng: Rng) -> bytes:
    """A word is put in that means something to a parser."""
    place = int(rng.integers(0, len(data) + 1))
    return data[:place] + WORDS[int(rng.integers(len(WORDS)))] + data[place:]


def lose_line(data: bytes, rng: Rng) -> bytes:
    """One line is missing."""
    lines = data.splitlines(keepends=True)
    del lines[int(rng.integers(len(lines)))]
    return b"".join(lines)


def _piece(data: bytes, rng: Rng) -> tuple[int, int]:
    length = min(len(data), int(2 ** rng.uniform(0.0, 12.0)))
    return int(rng.integers(0, len(data) - length + 1)), length


BINARY: tuple[Callable[[bytes, Rng], bytes], ...] = (cut, flip, flip, lose, blank, rubbish, twice)
TEXT = (*BINARY, other_number, other_number, other_number, odd_word, odd_word, lose_line, lose_line)


def damaged(ways: tuple[Callable[[bytes, Rng], bytes], ...], good: bytes, rng: Rng) -> bytes:
    """The bytes after one damage, or two."""
    for _ in range(int(rng.integers(1, 3))):
        if good:
            good = ways[int(rng.integers(len(ways)))](good, rng)
    return good
