"""Zip archives from untrusted sources: all checks come before a byte is written."""

from __future__ import annotations

import hashlib
import io
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from xml.parsers import expat

from scenarios.whole_files import written_whole
from trpac_core.errors import TrpacError
from trpac_core.files import FileError, open_file, quoted

MOST_BYTES = 500_000_000
"""Largest archive, and largest unpacked content; units of this project have 20 MB [bytes]."""
MOST_ENTRIES = 10_000
"""Greatest number of entries; units of this project have 100."""
MOST_DIRECTORY_BYTES = 4_000_000
"""Largest directory of entries, which is read at once: 10,000 of 400 bytes [bytes]."""
MOST_TEXT_BYTES = 16_000_000
"""Largest entry that is read at once: descriptions and records; those of this project have 0.1 MB [bytes]."""
LONGEST_PART = 255
"""Longest part of an entry's path between two slashes, as of file systems [bytes]."""
CHUNK_BYTES = 1 << 20
"""Bytes that are read at once."""
XML = (".xml", ".ssd", ".ssv", ".ssm", ".ssb")
DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    OSError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    ValueError,
)
"""Exceptions that zipfile raises on damaged archives."""
MEND = "Copy or build it again."


class UnitFileError(TrpacError):
    """A unit's file cannot be used; the text has reason and remedy."""


class _DoctypeError(ValueError):
    """An XML text declares entities."""


class _Bounded(io.BufferedReader):
    """A file whose reads are limited to `MOST_DIRECTORY_BYTES`, because zipfile reads the directory at once."""

    def read(self, size: int | None = -1, /) -> bytes:
        whole = size is None or size < 0
        data = super().read(MOST_DIRECTORY_BYTES + 1 if whole else min(size or 0, MOST_DIRECTORY_BYTES + 1))
        if len(data) > MOST_DIRECTORY_BYTES:
            raise zipfile.BadZipFile(f"its directory has more than {MOST_DIRECTORY_BYTES / 1e6:.0f} MB")
        return data


class Archive:
    """An open archive with checked entries; `names` has their names."""

    def __init__(self, name: str, content: zipfile.ZipFile) -> None:
        self.name, self._content = name, content
        self.names = content.namelist()

    def read(self, entry: str) -> bytes:
        """Content of a text entry; raises UnitFileError, and KeyError where there is none."""
        return b"".join(self._chunks(self._content.getinfo(entry), MOST_TEXT_BYTES))

    def sha256(self, entry: str) -> str:
        """SHA-256 of an entry as hexadecimal text; raises UnitFileError, and KeyError where there is none."""
        total = hashlib.sha256()
        for chunk in self._chunks(self._content.getinfo(entry)):
            total.update(chunk)
        return total.hexdigest()

    def damage(self) -> str | None:
        """Name of the first damaged entry; None without any."""
        for entry in self._content.infolist():
            try:
                for _ in self._chunks(entry):
                    pass
            except UnitFileError:
                return quoted(entry.filename)
        return None

    def unpack(self, folder: Path) -> None:
        """Write all entries to a new or empty folder, all or none; raises UnitFileError."""
        try:
            if folder.is_dir() and any(folder.iterdir()):
                raise FileExistsError("the folder is not empty")
            with written_whole(folder) as made:
                for entry in self._content.infolist():
                    target = made / entry.filename
                    if entry.is_dir():
                        target.mkdir(parents=True, exist_ok=True)
                        continue
                    target.parent.mkdir(parents=True, exist_ok=True)
                    with target.open("xb") as file:
                        for chunk in self._chunks(entry):
                            file.write(chunk)
        except OSError as error:
            raise UnitFileError(
                f"{self.name}: cannot be unpacked to {quoted(folder)}: {quoted(error.strerror or error)}. "
                "Give an empty folder with room for it."
            ) from error

    def _chunks(self, entry: zipfile.ZipInfo, most_bytes: int = MOST_BYTES) -> Iterator[bytes]:
        """Content of an entry in chunks, limited in size whatever its header states."""
        left = most_bytes
        try:
            with self._content.open(entry) as file:
                while chunk := file.read(CHUNK_BYTES):
                    left -= len(chunk)
                    if left < 0:
                        raise ValueError(f"unpacks to more than {most_bytes / 1e6:.0f} MB")
                    yield chunk
        except DAMAGED as error:
            raise UnitFileError(
                f"{self.name}: cannot be unpacked: {quoted(entry.filename)}: {_reason(error)}. {MEND}"
            ) from error


def _reason(error: Exception) -> str:
    return quoted(" ".join(str(error).split()) or type(error).__name__)


@contextmanager
def opened_archive(
    path: str | Path, expected: str = "a unit, a zip archive such as `trpac fmu build` makes"
) -> Iterator[Archive]:
    """An open archive, after checks of all limits and for XML texts without document types.

    Raises
    ------
    UnitFileError
        If it is no regular file, no archive, too large, or one of its entries must not be unpacked.
    """
    name = quoted(path)
    try:
        file = open_file(path, MOST_BYTES, expected)
    except FileError as error:
        raise UnitFileError(str(error)) from error
    with _Bounded(file.detach()) as bounded:
        try:
            content = zipfile.ZipFile(bounded)
        except DAMAGED as error:
            raise UnitFileError(
                f"{name}: cannot be unpacked: {_reason(error)}; expected {expected}. {MEND}"
            ) from error
        with content:
            if problem := _problem(content.infolist()):
                raise UnitFileError(f"{name}: cannot be unpacked: {problem}. {MEND}")
            archive = Archive(name, content)
            _require_plain_xml(archive)
            yield archive


def _problem(entries: Sequence[zipfile.ZipInfo]) -> str | None:
    """The reason why these entries must not be unpacked; None without one."""
    if len(entries) > MOST_ENTRIES:
        return f"it has {len(entries)} entries, expected at most {MOST_ENTRIES}"
    size = sum(entry.file_size for entry in entries)
    if size > MOST_BYTES:
        return f"it unpacks to {size / 1e9:.1f} GB, expected at most {MOST_BYTES / 1e9:.1f}"
    files: set[str] = set()
    folders: set[str] = set()
    for entry in entries:
        if problem := _entry_problem(entry):
            return f"its entry '{quoted(entry.orig_filename)}' {problem}"
        same = unicodedata.normalize("NFC", entry.filename).casefold().rstrip("/")
        if same in files or (same in folders and not entry.is_dir()):
            return f"its entry '{quoted(entry.filename)}' stands twice, capitals or not"
        above = same.split("/")
        folders.update("/".join(above[:count]) for count in range(1, len(above)))
        (folders if entry.is_dir() else files).add(same)
    both = files & folders
    return f"its entry '{quoted(min(both))}' is a file and a folder" if both else None


def _entry_problem(entry: zipfile.ZipInfo) -> str | None:
    path = entry.orig_filename
    parts = path.removesuffix("/").split("/")
    if ".." in parts or path.startswith("/") or "\\" in path or ":" in path:
        return "would be written outside of the folder"
    if not path.isprintable() or any(part in ("", ".") for part in parts):
        return "has no printable path"
    if any(len(part.encode()) > LONGEST_PART for part in parts):
        return f"has a name of more than {LONGEST_PART} bytes"
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device, expected files and folders"
    if entry.flag_bits & 1:
        return "is encrypted"
    if path.lower().endswith(XML) and entry.file_size > MOST_TEXT_BYTES:
        return f"is a text of more than {MOST_TEXT_BYTES / 1e6:.0f} MB"
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is compressed otherwise than FMI and SSP allow, expected stored or deflated"
    return None


def _require_plain_xml(archive: Archive) -> None:
    """Raise UnitFileError where an XML text declares a document type, and so entities."""
    for name in archive.names:
        if not name.lower().endswith(XML):
            continue
        parser = expat.ParserCreate()
        parser.StartDoctypeDeclHandler = _refuse_doctype
        try:
            parser.Parse(archive.read(name), True)
        except _DoctypeError as error:
            raise UnitFileError(
                f"{archive.name}: its entry '{quoted(name)}' declares a document type, expected plain XML. {MEND}"
            ) from error
        except (expat.ExpatError, UnitFileError):  # reported by the reader of the text
            continue


def _refuse_doctype(*_: object) -> None:
    raise _DoctypeError
