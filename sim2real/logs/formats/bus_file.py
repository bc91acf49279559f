"""Reading raw logs of a bus, which DBC files explain: BLF, ASC, candump, TRC and MDF."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from sim2real.logs.contract import TIME, is_optional
from sim2real.logs.errors import LogError
from sim2real.logs.formats.bus_signals import Catalogue, Described, Frames, decoded, merged, ordered
from sim2real.logs.formats.extraction import Extract, extract
from sim2real.logs.formats.mdf_file import extract_mdf, table_of_mdf
from sim2real.logs.rasters import Channel, table_of
from sim2real.logs.table import Finding, Table, Wanted

TIME_DIGITS = 6
"""Decimals of a time since 1970 [s]: a float64 holds 0.2 us of it."""
EPOCH_S = 631_152_000.0
"""From here on, which is 1990, a time counts from 1970 rather than from the log's begin [s]."""
PARTS = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")
"""How channels of an MDF begin that hold raw frames and their parts."""
LISTED = 8
"""Messages, signals or IDs that an error lists."""


def read_bus(path: Path, kind: str, wanted: Wanted, dbc: Sequence[str | Path]) -> Table:
    """Read the wanted signals of a bus log.

    Signals are named MESSAGE.SIGNAL, or SIGNAL where one message has it; MESSAGE.SIGNAL#CHANNEL where frames of one ID
    come on several channels of the bus. An MDF may hold other channels beside the frames.

    Parameters
    ----------
    path : Path
        The log.
    kind : str
        BLF, ASC, candump, TRC or MDF.
    wanted : Wanted
        What of it is read.
    dbc : sequence of paths
        DBC files that describe its frames.

    Raises
    ------
    LogError
        The file is damaged, none of the wanted signals is in it, or see `table_of`.
    """
    catalogue = Catalogue(dbc)
    meant = catalogue.wanted(wanted.numbers | wanted.text)
    ids = tuple(sorted({each.kind for each, _ in meant.values()}))
    if kind == "MDF":
        found = extract_mdf(path, wanted, ids)
        if not found.told["bus"]:
            told = Finding("holds no raw frames of a bus: the DBC file is not used.", fatal=False)
            table = table_of_mdf(path, found, wanted)
            return replace(table, findings=(*table.findings, told))
    else:
        found = extract(path, "bus_frames", kind, f"expected a whole {kind} log", form=kind, frames=ids)
    units = {each.name: str(each.signal.unit) for each in catalogue.all if each.signal.unit}
    seen = {(int(i), bool(x)) for i, x, _ in found.told["seen"]}
    if not meant and not found.told.get("channels"):
        there = tuple(each.name for each in catalogue.all if each.kind in seen)
        return Table((TIME, *there), {}, {}, np.arange(0), (_no_name(catalogue),), units)
    own = found.channels()
    meant = {name: each for name, each in meant.items() if name not in own}
    if not own and not found.told["frames"]:
        raise _none_of_them(path, meant, found)
    start_s = _start(found)
    channels, findings = _channels(meant, found, start_s)
    if found.told.get("cut"):
        findings.append(Finding("ends within a frame: it was cut off; look at its end.", fatal=False))
    if found.told.get("odd"):
        findings.append(
            Finding(
                f"{found.told['odd']} frames, rows or objects cannot be read and are left out.", fatal=False
            )
        )
    absent = {name for name, (each, _) in meant.items() if name not in channels and not is_optional(name)}
    used = {each.name for each, _ in meant.values()}
    others = [n for n in found.told.get("names", ()) if not n.startswith(PARTS)]
    names = [
        *channels,
        *absent,
        *others,
        *(each.name for each in catalogue.all if each.kind in seen and each.name not in used),
    ]
    notes = (f"{kind}, {found.told['count']} frames", *_since(found, start_s))
    if any(finding.fatal for finding in findings):
        return Table((*names, TIME), {}, {}, np.arange(0), tuple(findings), {}, notes)
    masters = found.told.get("masters", ()) if own else ()
    table = table_of(path, names, masters, own | channels, wanted, notes)
    return replace(table, findings=(*findings, *table.findings), units=units | table.units)


def _channels(
    meant: dict[str, tuple[Described, str]], found: Extract, start_s: float
) -> tuple[dict[str, Channel], list[Finding]]:
    """The signals that are in the log, by the names that are wanted, on times from `start_s` on."""
    channels: dict[str, Channel] = {}
    findings: list[Finding] = []
    groups: dict[tuple[str, str, tuple[int, bool]], list[tuple[str, Described]]] = {}
    for name, (each, channel) in meant.items():
        groups.setdefault((each.message.name, channel, each.kind), []).append((name, each))
    for (message, channel, kind), members in groups.items():
        there = _frames(found, kind)
        chosen = [frames for frames in there if channel in ("", frames.channel)]
        if not chosen:
            findings += _absent(message, channel, kind, members, there)
            continue
        if any(frames.data != chosen[0].data for frames in chosen[1:]):
            several = " and ".join(frames.channel for frames in chosen)
            findings.append(
                Finding(
                    f"message {message} (ID {_hex(*kind)}) comes on the channels {several} with different content; "
                    f"expected one of them in the mapping, such as {members[0][1].name}#{chosen[0].channel}."
                )
            )
            continue
        times = np.round(chosen[0].time_s - start_s, TIME_DIGITS) if start_s else chosen[0].time_s
        frames, mended = ordered(message, replace(chosen[0], time_s=times))
        signals = {each.signal.name: each.signal for _, each in members}
        values, told = decoded(members[0][1].message, frames, list(signals.values()))
        findings += [*mended, *told]
        channels |= {name: values[each.signal.name] for name, each in members if each.signal.name in values}
    return channels, findings


def _frames(found: Extract, kind: tuple[int, bool]) -> list[Frames]:
    """The log's frames of an ID, by channel of the bus."""
    channels: dict[str, list[Frames]] = {}
    for said in found.told["frames"]:
        if (said["id"], said["extended"]) == kind:
            time_s, lengths, data = (
                found.arrays[f"{what}_{said['key']}"] for what in ("time", "length", "data")
            )
            frames = Frames(said["channel"], time_s, lengths, data.tobytes())
            channels.setdefault(frames.channel, []).append(frames)
    return [merged(parts) for parts in channels.values()]


def _absent(
    message: str,
    channel: str,
    kind: tuple[int, bool],
    members: list[tuple[str, Described]],
    there: list[Frames],
) -> list[Finding]:
    """What is missing of a message; nothing where the log format can do without."""
    needed = [name for name, _ in members if not is_optional(name)]
    if not needed:
        return []
    where = f" on channel {channel}" if channel else ""
    seen = f"; it is on {', '.join(frames.channel for frames in there)}" if there else ""
    return [
        Finding(
            f"message {message} (ID {_hex(*kind)}) of {', '.join(needed)} does not occur in the log{where}{seen}."
        )
    ]


def _no_name(catalogue: Catalogue) -> Finding:
    known = _listed(each.name for each in catalogue.all)
    return Finding(
        f"no signal of the DBC file has a name of the log format, or one that the mapping names. It has: {known}. "
        "Write a mapping file with lines such as `vehicle_speed_m_s: {column: MESSAGE.SIGNAL}` and give it with --map."
    )


def _none_of_them(path: Path, meant: dict[str, tuple[Described, str]], found: Extract) -> LogError:
    seen = _listed(f"{_hex(int(i), bool(x))} ({n} times)" for i, x, n in found.told["seen"]) or "none"
    missing = _listed(
        dict.fromkeys(f"{each.message.name} ({_hex(*each.kind)})" for each, _ in meant.values())
    )
    return LogError(
        f"{path}: has no frame of the messages that are wanted: {missing}. IDs that it has: {seen}. Expected the DBC "
        "file of this bus."
    )


def _start(found: Extract) -> float:
    """What the log's times are counted from here: its first frame where they count from 1970, else 0 [s]."""
    first_s = float(found.told["first_s"])
    return first_s if first_s >= EPOCH_S else 0.0


def _since(found: Extract, start_s: float) -> tuple[str, ...]:
    """When time 0 is, where the log says so."""
    epoch_s = start_s + float(found.told["epoch_s"])
    if epoch_s < EPOCH_S:
        return ()
    try:
        return (f"time 0 is {datetime.fromtimestamp(epoch_s, UTC).isoformat(timespec='milliseconds')}",)
    except (ValueError, OverflowError, OSError):
        return ()


def _hex(number: int, extended: bool) -> str:
    return f"0x{number:08X}" if extended else f"0x{number:03X}"


def _listed(names: Iterable[str]) -> str:
    every = list(names)
    more = f" and {len(every) - LISTED} more" if len(every) > LISTED else ""
    return ", ".join(every[:LISTED]) + more
