"""Reading MDF (versions 3 and 4)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from sim2real.logs.errors import LogError
from sim2real.logs.formats.extraction import Extract, extract
from sim2real.logs.rasters import table_of
from sim2real.logs.table import Table, Wanted

EXPECTED = "expected a whole MDF3 or MDF4 file"


def read_mdf(path: Path, wanted: Wanted) -> Table:
    """Read the wanted channels; raises LogError where the file is damaged or has no time base, see `table_of`.

    A name that several groups have is told apart as NAME#GROUP.
    """
    found = extract_mdf(path, wanted)
    if found.told["bus"] and not any(name in found.told["channels"] for name in wanted.base):
        raise needs_dbc(path, "MDF")
    return table_of_mdf(path, found, wanted)


def table_of_mdf(path: Path, found: Extract, wanted: Wanted) -> Table:
    """The wanted channels as a table, with the units of all channels."""
    table = table_of(path, found.told["names"], found.told["masters"], found.channels(), wanted)
    units = {name: unit for name, unit in found.told["units"].items() if unit}
    return replace(table, units=units | table.units)


def extract_mdf(path: Path, wanted: Wanted, frames: tuple[tuple[int, bool], ...] | None = None) -> Extract:
    """The wanted channels, and the raw frames with these (ID, is extended); raises LogError."""
    names = sorted(wanted.numbers | wanted.text)
    return extract(path, "mdf_channels", "MDF", EXPECTED, wanted=names, frames=frames)


def needs_dbc(path: Path, kind: str) -> LogError:
    """The error of a log of raw frames without a DBC file."""
    return LogError(
        f"{path}: holds raw frames of a bus ({kind}); expected the DBC file that says what they mean: --dbc car.dbc, "
        "in Python dbc=."
    )
