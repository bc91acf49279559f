"""The record of a unit's files at its build, and the differences from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from trpac_core.files import FileError, file_sha256, parse_json, quoted, read_bytes

CONTENTS_FILE = "contents.json"
"""File of the record, among the unit's resources; it lists every other file of the archive."""
SCHEMA = 1
SHOWN_DIGITS = 12
"""Digits of a hash in messages."""
MOST_RECORD_BYTES = 4_000_000
"""Largest record that is read; those of this project's units have 10 kB [bytes]."""


class ContentError(ValueError):
    """A file of the unit differs from the build; the text names it and what to do."""


@dataclass(frozen=True)
class Contents:
    """The record of a build.

    Parameters
    ----------
    unit, version, build : str
        Name of the unit, version of the project, hash of the whole content.
    packages : mapping
        Modules that the host's Python must have, and the packages that bring them.
    files : mapping
        SHA-256 by path in the archive.
    """

    unit: str
    version: str
    build: str
    packages: Mapping[str, str]
    files: Mapping[str, str]

    def to_bytes(self) -> bytes:
        """The record as a JSON text; the same contents give the same bytes."""
        return json.dumps({"schema": SCHEMA, **asdict(self)}, indent=1, sort_keys=True).encode() + b"\n"


def read_contents(data: bytes) -> Contents:
    """The record that `to_bytes` wrote; raises ContentError."""
    try:
        content = parse_json(data, CONTENTS_FILE)
        schema = content.pop("schema")
        contents = Contents(**content)
        pairs = [*contents.packages.items(), *contents.files.items()]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ContentError(
            f"{CONTENTS_FILE}: damaged ({quoted(error)}). Build or copy the unit again."
        ) from error
    pairs.append((contents.unit, contents.version))
    pairs.append((contents.build, ""))
    if schema != SCHEMA or not all(isinstance(text, str) for pair in pairs for text in pair):
        raise ContentError(f"{CONTENTS_FILE}: not of schema {SCHEMA}. Build the unit again.")
    return contents


def sha256_of(data: bytes) -> str:
    """SHA-256 as hexadecimal text."""
    return hashlib.sha256(data).hexdigest()


def deviations(contents: Contents, names: Iterable[str], sha256: Callable[[str], str]) -> list[str]:
    """One sentence for each named file that differs from the build, or where `sha256` raises FileError or KeyError."""
    problems = []
    for name in names:
        try:
            found = sha256(name)
        except (FileError, KeyError):
            problems.append(f"{quoted(name)} is missing")
            continue
        built = contents.files.get(name)
        if built is None:
            problems.append(f"{quoted(name)} is not of this build")
        elif found != built:
            problems.append(
                f"{quoted(name)} is damaged or has been exchanged: SHA-256 {found[:SHOWN_DIGITS]}..., "
                f"built was {quoted(built[:SHOWN_DIGITS])}..."
            )
    return problems


def require_as_built(resources: Path, names: Iterable[str]) -> None:
    """Raise one ContentError that names all of these resources that differ from the build."""
    try:
        data = read_bytes(resources / CONTENTS_FILE, MOST_RECORD_BYTES, "the unit's record of its build")
    except FileError as error:
        raise ContentError(f"{error} Copy the unit again.") from error
    problems = deviations(
        read_contents(data),
        [f"resources/{name}" for name in names],
        lambda name: file_sha256(resources.parent / name),
    )
    if problems:
        raise ContentError(
            f"{'; '.join(problems)} (in {resources.parent}). Copy the unit again, or build one with the files that are "
            "meant."
        )
