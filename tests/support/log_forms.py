"""One drive in the forms that other tools write: each gives a file, and its mapping and DBC file."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

WHEELS = ("fl", "fr", "rl", "rr")
SPEEDS = [f"wheel_speed_{w}_rad_s" for w in WHEELS]
TORQUES = [f"wheel_torque_{w}_nm" for w in WHEELS]
MESSAGES = (SPEEDS, TORQUES, ["vehicle_speed_m_s", "accel_x_m_s2", "position_m"])
"""Columns by the message that carries them."""
UNITS = {"time_s": "s", **dict.fromkeys(SPEEDS, "rad/s"), **dict.fromkeys(TORQUES, "Nm")}
UNITS |= {"vehicle_speed_m_s": "m/s", "accel_x_m_s2": "m/s²", "position_m": "m"}
START = pd.Timestamp("2024-05-03 12:34:57.5")


@dataclass(frozen=True)
class Form:
    """A file, and what goes with it; None where nothing is needed."""

    path: Path
    mapping: Path | None = None
    dbc: Path | None = None


def _text(folder: Path, name: str, data: bytes, mapping: str | None = None) -> Form:
    (folder / name).write_bytes(data)
    if mapping is not None:
        (folder / "map.yaml").write_text(mapping, encoding="utf-8")
    return Form(folder / name, folder / "map.yaml" if mapping is not None else None)


def _csv(frame: pd.DataFrame, separator: str = ",", decimal: str = ".") -> str:
    return frame.to_csv(index=False, sep=separator, decimal=decimal, lineterminator="\n")


def comma(frame, folder):
    return _text(folder, "drive.csv", _csv(frame).encode())


def semicolon_decimal_comma(frame, folder):
    theirs = frame.assign(vehicle_speed_m_s=3.6 * frame["vehicle_speed_m_s"]).rename(
        columns={"time_s": "Zeit [s]", "vehicle_speed_m_s": "Geschw [km/h]", "accel_x_m_s2": "ax [m/s²]"}
    )
    mapping = "schema: 1\ntime_s: Zeit\nvehicle_speed_m_s: Geschw\naccel_x_m_s2: ax\n"
    return _text(folder, "drive.csv", _csv(theirs, ";", ",").encode("cp1252"), mapping)


def utf_16(frame, folder):
    return _text(folder, "drive.csv", _csv(frame, "\t").encode("utf-16"))


def tab(frame, folder):
    return _text(folder, "drive.tsv", _csv(frame, "\t").replace("\n", "\r\n").encode())


def blanks(frame, folder):
    text = "\n".join("   ".join(line.split(",")) for line in _csv(frame).splitlines())
    return _text(folder, "drive.txt", (text + "\n").encode())


def preamble(frame, folder):
    head = "Messung 12, Auto 3\nFahrer: NN\n\nBemerkung;trocken; ; ;\n"
    return _text(folder, "drive.csv", (head + _csv(frame, ";")).encode("utf-8-sig"))


def units_row(frame, folder):
    names, *rows = _csv(frame).splitlines()
    units = ",".join(UNITS[name] for name in names.split(","))
    return _text(folder, "drive.csv", "\n".join([names, units, *rows, ""]).encode())


def iso(frame, folder):
    stamps = START + pd.to_timedelta(frame["time_s"], unit="s").dt.round("us")
    return _text(
        folder, "drive.csv", _csv(frame.assign(time_s=stamps.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ"))).encode()
    )


def stated(frame, folder):
    """All of it stated: German times, latin-1, a header in row 3, epoch nowhere, invalid codes."""
    stamps = START + pd.to_timedelta(frame["time_s"], unit="s").dt.round("us")
    theirs = frame.assign(time_s=stamps.dt.strftime("%d.%m.%Y %H:%M:%S.%f"))
    theirs = theirs.rename(columns={"time_s": "Zeit"})
    mapping = (
        'schema: 1\nformat: {encoding: latin-1, separator: ";", decimal: ",", header_row: 3, unit_row: 0}\n'
        "time: {column: Zeit, form: '%d.%m.%Y %H:%M:%S.%f'}\ninvalid: {'*': [99999.5]}\n"
    )
    return _text(folder, "drive.csv", ("Länge\nx;y\n" + _csv(theirs, ";", ",")).encode("latin-1"), mapping)


def epoch_ms(frame, folder):
    stamps = START.timestamp() * 1e3 + np.round(frame["time_s"] * 1e3)
    return _text(folder, "drive.csv", _csv(frame.assign(time_s=stamps.astype("int64"))).encode())


def epoch_ns(frame, folder):
    stamps = START.value + (np.round(frame["time_s"] * 1e6) * 1000).astype("int64")
    return _text(folder, "drive.csv", _csv(frame.assign(time_s=stamps)).encode())


def clock(frame, folder):
    stamps = (START + pd.to_timedelta(frame["time_s"], unit="s")).dt.round("us")
    return _text(folder, "drive.csv", _csv(frame.assign(time_s=stamps.dt.strftime("%H%M%S.%f"))).encode())


def parquet_timestamps(frame, folder):
    stamps = (START + pd.to_timedelta(frame["time_s"], unit="s").dt.round("us")).dt.tz_localize(
        "Europe/Berlin"
    )
    table = pa.Table.from_pandas(frame.assign(time_s=stamps), preserve_index=False)
    pq.write_table(table, folder / "drive.parquet")
    return Form(folder / "drive.parquet")


def parquet_durations(frame, folder):
    durations = pa.array((frame["time_s"] * 1e6).round().astype("int64"), pa.int64()).cast(pa.duration("us"))
    table = pa.Table.from_pandas(frame, preserve_index=False).set_column(0, "time_s", durations)
    pq.write_table(table, folder / "drive.parquet")
    return Form(folder / "drive.parquet")


def one_row_per_message(frame, folder):
    rows = pd.concat([frame[["time_s", *columns]] for columns in MESSAGES]).sort_values(
        "time_s", kind="stable"
    )
    return _text(folder, "drive.csv", _csv(rows).encode())


def mdf4(frame, folder):
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        for columns in MESSAGES:
            signals = [
                Signal(frame[c].to_numpy(), frame["time_s"].to_numpy(), name=c, unit=UNITS[c])
                for c in columns
            ]
            mdf.append(signals, common_timebase=True)
        mdf.save(folder / "drive.mf4", overwrite=True)
    return Form(folder / "drive.mf4")


def _doubles(number: int, columns: list[str]) -> str:
    signals = "".join(
        f' SG_ {c} : {64 * i}|64@1- (1,0) [0|0] "{UNITS[c].replace("²", "2")}" ECU\n'
        for i, c in enumerate(columns)
    )
    return f"BO_ {number} Message{number}: {8 * len(columns)} ECU\n{signals}\n"


def _types(number: int, columns: list[str]) -> str:
    return "".join(f"SIG_VALTYPE_ {number} {c} : 2;\n" for c in columns)


NUMBERED = tuple(enumerate(MESSAGES, start=256))
DBC = 'VERSION ""\nNS_ :\nBS_:\nBU_: ECU\n\n' + "".join(_doubles(n, c) for n, c in NUMBERED)
DBC += "".join(_types(n, c) for n, c in NUMBERED)
"""Messages of CAN FD whose signals are doubles, so that nothing is rounded."""


def _on_bus(suffix: str, name: str) -> Callable[[pd.DataFrame, Path], Form]:
    def form(frame: pd.DataFrame, folder: Path) -> Form:
        import can
        from bus_maker import described, write

        # python-can's writers of BLF and MDF subtract times since 1970, of which a float64 holds 0.2 us.
        start_s = {".blf": 8.0, ".mf4": 0.0}.get(suffix, 1.7e9)
        messages = [
            can.Message(
                timestamp=start_s + float(row["time_s"]),
                arbitration_id=number,
                is_extended_id=False,
                is_fd=True,
                data=struct.pack(f"<{len(columns)}d", *(float(row[c]) for c in columns)),
                channel=1,
            )
            for row in frame.to_dict("records")
            for number, columns in NUMBERED
        ]
        if suffix == ".trc":  # python-can's writer knows its first time by a frame of classic CAN alone
            messages.insert(
                0, can.Message(timestamp=start_s, arbitration_id=1, is_extended_id=False, data=b"0")
            )
        return Form(write(folder / f"drive{suffix}", messages, from_0=True), dbc=described(folder, DBC))

    form.__name__ = name
    return form


def mat_5(frame, folder):
    from scipy.io import savemat

    savemat(folder / "drive.mat", {"log": {c: frame[c].to_numpy() for c in frame}})
    return Form(folder / "drive.mat")


def mat_73(frame, folder):
    import h5py

    with h5py.File(folder / "drive.mat", "w", userblock_size=512) as root:
        log = root.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for c in frame:
            log[c] = frame[c].to_numpy()[None, :]
            log[c].attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    raw = (folder / "drive.mat").read_bytes()
    (folder / "drive.mat").write_bytes(head + raw[len(head) :])
    return Form(folder / "drive.mat")


FORMS: dict[str, Callable[[pd.DataFrame, Path], Form]] = {
    form.__name__: form
    for form in (
        comma,
        semicolon_decimal_comma,
        utf_16,
        tab,
        blanks,
        preamble,
        units_row,
        iso,
        stated,
        epoch_ms,
        epoch_ns,
        clock,
        parquet_timestamps,
        parquet_durations,
        one_row_per_message,
        mdf4,
        _on_bus(".mf4", "mdf_bus"),
        _on_bus(".blf", "blf"),
        _on_bus(".asc", "asc"),
        _on_bus(".log", "candump"),
        _on_bus(".trc", "trc"),
        mat_5,
        mat_73,
    )
}
