"""Files of a result that appear in their folder all together, or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written_whole(folder: Path) -> Iterator[Path]:
    """A scratch folder; the files that lie in it when the block ends well are moved to `folder`, else none is.

    It lies in `folder` if that is there, which may be a mounted disk, else in the nearest folder above it that is:
    always on the same disk, so that a full one shows before anything is moved.

    Raises
    ------
    OSError
        The folder cannot be written to, or the disk is full.
    """
    whole = folder.absolute()
    place = next(place for place in (whole, *whole.parents) if place.exists())
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}_", dir=place) as made:
        yield Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        for path in sorted(Path(made).iterdir()):
            os.replace(path, folder / path.name)
