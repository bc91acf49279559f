"""A unit's archive unpacked to a safe place."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path

from scenarios.fmu_client.archives import UnitFileError, opened_archive
from trpac_core.files import quoted

SAFE_PATH = re.compile(r"[A-Za-z0-9_./ -]*")
"""Paths that the wrapper's URI decoding leaves as they are: it crashes on umlauts, # + % ( and )."""


def unpack_unit(archive: Path, folder: Path | None = None) -> Path:
    """Unpack a unit to a folder whose path the wrapper can read; returns the folder.

    Parameters
    ----------
    archive : Path
        The unit.
    folder : Path, optional
        Where to, new or empty; by default a fresh temporary folder, which the caller removes. After an error nothing
        is left of it.

    Raises
    ------
    UnitFileError
        If the path holds a character that crashes the wrapper, or the archive is damaged, too large, or has an entry
        that is not to be unpacked.
    """
    if folder is not None:
        return _unpacked(archive, folder)
    made = Path(tempfile.mkdtemp(prefix="trpac-fmu-"))
    try:
        return _unpacked(archive, made)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise


def _unpacked(archive: Path, folder: Path) -> Path:
    path = str(folder.resolve())
    if not SAFE_PATH.fullmatch(path):
        bad = "".join(sorted(set(re.sub(SAFE_PATH, "", path))))
        raise UnitFileError(
            f"{quoted(path)}: the unit's wrapper crashes on the characters '{quoted(bad)}' in its path. Unpack to a "
            "path of letters, digits, spaces and . _ - only, for example by setting TMPDIR."
        )
    with opened_archive(archive) as content:
        content.unpack(folder)
    return folder


def require_whole(archive: Path) -> None:
    """Read a unit's archive to its end; raises UnitFileError where it is damaged or not to be unpacked."""
    with opened_archive(archive) as content:
        damaged = content.damage()
    if damaged:
        raise UnitFileError(f"{quoted(archive)}: damaged at {damaged}. Copy or build the unit again.")
