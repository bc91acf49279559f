"""What a run keeps in a folder, so that the next one need not make it again: files written whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

Made = TypeVar("Made")


def kept_or_made(
    folder: Path | None,
    name: str,
    *,
    load: Callable[[Path], Made],
    make: Callable[[], Made],
    save: Callable[[Path, Made], None],
) -> Made:
    """What the folder holds under a name, or else what is made and kept there; without a folder nothing is kept."""
    if folder is None:
        return make()
    file = folder / name
    if file.is_file():
        return load(file)
    made = make()
    save(file, made)
    return made


def keep_whole(file: Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a file of another name (and the same suffix) and then take its place."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(f".part{file.suffix}")
    write(part)
    part.replace(file)


def keep_arrays(file: Path, **arrays: Any) -> None:
    """Write a .npz file."""
    keep_whole(file, lambda part: np.savez(part, **arrays))
