"""Reading MAT-files (versions 4, 5 and 7.3)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sim2real.logs.contract import TIME, is_optional
from sim2real.logs.formats.extraction import Extract, extract
from sim2real.logs.rasters import Channel, table_of
from sim2real.logs.table import Array, Finding, Table, Text, Wanted, labels_of, numbered
from trpac_core.files import quoted

EXPECTED = "expected a whole MAT-file, saved with -v7 or -v7.3"
TIMETABLE = (
    "S = table2struct(timetable2table({name}, 'ConvertRowTimes', false), 'ToScalar', true); "
    "S.time = seconds({name}.Properties.RowTimes - {name}.Properties.RowTimes(1)); save('drive.mat', '-struct', 'S')"
)
DATASET = (
    "for k = 1:{name}.numElements, e = {name}{{k}}; S.(matlab.lang.makeValidName(e.Name)) = "
    "struct('time', e.Values.Time, 'values', e.Values.Data); end; save('drive.mat', 'S')"
)
SERIES = "S.{name} = struct('time', {name}.Time, 'values', {name}.Data); save('drive.mat', 'S')"
TABLE = "S = table2struct({name}, 'ToScalar', true); save('drive.mat', '-struct', 'S')"
OTHER = "save('drive.mat', ...) with structs and vectors of numbers"
EXPORTS = {
    "timetable": TIMETABLE,
    "Simulink.SimulationData.Dataset": DATASET,
    "Simulink.SimulationOutput": "S = {name}.logsout, and then: " + DATASET.replace("{name}", "S"),
    "timeseries": SERIES,
    "Simulink.Timeseries": SERIES,
    "table": TABLE,
}
"""What to run in MATLAB to save an object of a class as plain variables."""


def read_mat(path: Path, wanted: Wanted) -> Table:
    """Read the wanted variables; its rows are samples and count from 1.

    A field of a struct is named STRUCT.FIELD, or FIELD where one struct has it. Where all variables have one length
    they are columns; else each comes on the times of its struct, see `table_of`.

    Parameters
    ----------
    path : Path
        The file.
    wanted : Wanted
        What of it is read.

    Raises
    ------
    LogError
        The file is damaged or holds too much, or see `table_of`.
    """
    found = extract(path, "mat_variables", "MAT-file", EXPECTED, wanted=sorted(wanted.numbers | wanted.text))
    told: dict[str, dict[str, Any]] = found.told["channels"]
    findings = [*_several(found), *_objects(found, wanted), *_no_signals(told)]
    told = {name: said for name, said in told.items() if not said["kind"]}
    names = tuple(dict.fromkeys((*told, *found.told["several"], *found.told["names"])))
    sizes = {said["size"] for said in told.values()}
    times = {said["time"] for said in told.values() if said["time"] is not None}
    if len(sizes) == 1 and len(times) < 2:
        return _as_columns(found, told, names, wanted, findings)
    untimed = {name: said["size"] for name, said in told.items() if said["time"] is None}
    findings += [
        Finding(
            f"variable {quoted(name)} has {size} values, and no vector `time` of this length stands beside it."
        )
        for name, size in untimed.items()
    ]
    if untimed:
        return Table((*names, TIME), {}, {}, np.arange(0), tuple(findings))
    channels = {name: _channel(found, said) for name, said in told.items()}
    table = table_of(path, names, found.told["masters"], channels, wanted)
    return replace(table, findings=(*findings, *table.findings))


def _as_columns(
    found: Extract,
    told: dict[str, dict[str, Any]],
    names: tuple[str, ...],
    wanted: Wanted,
    findings: list[Finding],
) -> Table:
    """The variables of one length, with the time vector beside them as time_s where none has that name."""
    numbers: dict[str, Array] = {}
    text: dict[str, Text] = {}
    for name, said in told.items():
        samples = found.arrays[f"samples_{said['key']}"]
        is_text = samples.dtype.kind == "U"
        if name in wanted.text and is_text:
            text[name] = labels_of(samples.tolist())
        elif name in wanted.identifiers and is_text:
            numbers[name] = numbered(samples.tolist())
        elif is_text or name in wanted.text:
            there, expected = ("text", "numbers") if is_text else ("numbers", "text")
            findings.append(Finding(f"variable {quoted(name)} holds {there}; expected {expected}."))
        else:
            numbers[name] = samples
    time = next((said["time"] for said in told.values() if said["time"] is not None), None)
    if TIME in wanted.numbers and TIME not in numbers and time is not None:
        numbers[TIME] = found.arrays[f"time_{time}"]
        names = (*names, TIME)
    units = {name: said["unit"] for name, said in told.items() if said["unit"]}
    count = next(iter(told.values()))["size"]
    return Table(names, numbers, text, np.arange(1, count + 1), tuple(findings), units)


def _channel(found: Extract, said: dict[str, Any]) -> Channel:
    return Channel(
        found.arrays[f"time_{said['time']}"], found.arrays[f"samples_{said['key']}"], unit=said["unit"]
    )


def _several(found: Extract) -> list[Finding]:
    return [
        Finding(
            f"variable {quoted(name)} stands for several: {', '.join(map(quoted, full))}; expected one of these "
            "in a mapping."
        )
        for name, full in found.told["several"].items()
    ]


def _no_signals(told: dict[str, dict[str, Any]]) -> list[Finding]:
    return [
        Finding(f"variable {quoted(name)} is {said['kind']}; expected a vector with one number per sample.")
        for name, said in told.items()
        if said["kind"]
    ]


def _objects(found: Extract, wanted: Wanted) -> list[Finding]:
    """Objects that were not read, with the MATLAB line that saves them; fatal where something is missing."""
    missing = {
        name
        for name in wanted.numbers | wanted.text
        if name not in found.told["channels"] and not is_optional(name) and name != TIME
    }
    return [
        Finding(
            f"variable {quoted(name)} is an object of MATLAB's class {quoted(kind)}, which MATLAB alone can read. Save "
            f"it as plain variables: {EXPORTS.get(kind, OTHER).format(name=quoted(name))}",
            fatal=bool(missing),
        )
        for name, kind in found.told["opaque"].items()
    ]
