"""Files that are moved into a folder all together, or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from trpac_core.files import quoted


def write_whole(path: Path, data: bytes) -> None:
    """Write a file completely or not at all."""
    scratch = path.with_name(path.name + ".part")
    scratch.unlink(missing_ok=True)
    with scratch.open("xb") as file:  # fails on a link or pipe of that name
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(scratch, path)


@contextmanager
def written_whole(folder: Path) -> Iterator[Path]:
    """A scratch folder whose files are moved to `folder` when the block ends without exception.

    It is made in `folder`, which may be a mounted disk, or in the nearest existing folder above, so that all files are
    on the same disk and a full disk is detected before files are moved. Where a move fails, replaced files are
    restored; a process that is killed meanwhile leaves them in the scratch folder.

    Raises
    ------
    OSError
        The folder cannot be written to, the disk is full, or a folder has the name of a file.
    """
    whole = folder.absolute()
    existing = next(above for above in (whole, *whole.parents) if above.exists())
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}_", dir=existing) as made:
        yield Path(made)
        _move_all(Path(made), whole)


def _move_all(made: Path, folder: Path) -> None:
    """Move the files of `made` into a folder; on any exception the folder is unchanged."""
    files = sorted(made.iterdir())
    aside = Path(tempfile.mkdtemp(dir=made))
    with ExitStack() as undo:  # last done, first undone
        for above in [p for p in (*reversed(folder.parents), folder) if not p.exists()]:
            undo.callback(_remove, above)
            above.mkdir(exist_ok=True)
        for path in files:
            there = folder / path.name
            if there.is_dir() and not there.is_symlink():
                raise IsADirectoryError(f"{quoted(there)}: a folder. Expected a place for a file.")
            if os.path.lexists(there):
                undo.callback(_move_back, aside / path.name, there)
                os.replace(there, aside / path.name)
        for path in files:
            undo.callback(_move_back, folder / path.name, path)
            os.replace(path, folder / path.name)
        undo.pop_all()


def _move_back(now: Path, before: Path) -> None:
    """Undo a move, if it was made."""
    if not os.path.lexists(before):
        os.rename(now, before)


def _remove(folder: Path) -> None:
    """Undo the making of a folder, if it was made."""
    if folder.exists():
        folder.rmdir()
