"""Writes the page of the bus's messages from the DBC file: `python -m trpac_hil.dbc_table`."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from cantools.database.can import Message, Signal

from trpac_hil.codec import load_codec
from trpac_hil.message import NOT_AVAILABLE, STALE_AFTER

TARGET = Path(__file__).parent.parent / "docs" / "reference" / "bus_messages.md"
_HEAD = """# Messages of `trpac hil`

Generated from `trpac_hil/trpac.dbc`. How they are used: [guide](../guide/bus.md).

Classic CAN, 11-bit identifiers, 8 bytes, Intel byte order. On CAN FD the messages may be filled up. "Lost after" is the
age beyond which the signals of a message count as lost. A message whose counter stands still counts as old. A message
that comes for long more often than its cycle time has two senders, unless its counter goes up by one each time: its
signals then count as lost until 1 s after the last sign of it.

In the tables, "bits" are start bit and length; `u` is unsigned, `i` signed. "N/A" is the raw value that means "not
available".
"""
_WHEEL_OR_SIDE = re.compile(r"_(FL|FR|RL|RR|Left|Right)$")
_WHEEL_OR_SIDE_WORDS = re.compile(r"\b((front|rear) )?(left|right) ")


def document() -> str:
    """The page of all messages as Markdown text."""
    messages = sorted((c.message for c in load_codec().messages.values()), key=lambda m: int(m.frame_id))
    return _HEAD + "".join(_section(message) for message in messages)


def _section(message: Message) -> str:
    groups: dict[str, list[Signal]] = {}
    for signal in message.signals:
        groups.setdefault(_WHEEL_OR_SIDE.sub("_", signal.name), []).append(signal)
    rows = "\n".join(_row(group) for group in groups.values())
    limits = {
        str(s.dbc.attributes[STALE_AFTER].value)
        for s in message.signals
        if s.dbc and STALE_AFTER in s.dbc.attributes
    }
    lost = f", lost after {', '.join(sorted(limits))} ms" if limits else ""
    return (
        f"\n## {message.name}, 0x{message.frame_id:X}\n\n"
        f"{message.comment}. Sent by {' '.join(message.senders)}; cycle time {message.cycle_time} ms{lost}.\n\n"
        "| signal | bits | unit | scale | range | N/A | meaning |\n|---|---|---|---|---|---|---|\n"
        f"{rows}\n"
    )


def _row(group: list[Signal]) -> str:
    """A row for a signal, or for those of all wheels or sides, which differ in their start bits only."""
    first = group[0]
    names = ", ".join(f"`{s.name}`" if s is first else f"`{_suffix(s)}`" for s in group)
    values = {raw: str(name) for raw, name in (first.choices or {}).items()}
    missing = ", ".join(f"{raw}" for raw, name in values.items() if name == NOT_AVAILABLE)
    named = ", ".join(f"{raw} {name}" for raw, name in values.items() if name != NOT_AVAILABLE)
    meaning = first.comment if len(group) == 1 else _WHEEL_OR_SIDE_WORDS.sub("", f"{first.comment}")
    starts = ", ".join(f"{s.start}" for s in group)
    sign = "i" if first.is_signed else "u"
    return (
        f"| {names} | {starts}; {sign}{first.length} | {first.unit or ''} | {first.scale:g} | "
        f"{first.minimum:g} ... {first.maximum:g} | {missing} | {meaning}{f': {named}' if named else ''} |"
    )


def _suffix(signal: Signal) -> str:
    found = _WHEEL_OR_SIDE.search(signal.name)
    return found.group(0) if found else signal.name


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    TARGET.write_text(document(), encoding="utf-8")
    print(TARGET)
