"""A figure for notebooks and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, repr=False)
class Picture:
    """A PNG picture, shown by notebooks."""

    png: bytes

    def __repr__(self) -> str:
        return f"Picture of {len(self.png) / 1e3:.0f} kB; save(path) writes it."

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | Path) -> Path:
        """Write the PNG; returns its path."""
        Path(path).write_bytes(self.png)
        return Path(path)
