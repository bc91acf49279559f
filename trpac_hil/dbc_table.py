"""Writes the page of the bus's messages from the DBC file: `python -m trpac_hil.dbc_table`."""

from __future__ import annotations

import argparse
from pathlib import Path

from cantools.database.can import Message, Signal

from trpac_hil.codec import load_codec
from trpac_hil.message import NOT_AVAILABLE, STALE_AFTER

TARGET = Path(__file__).parent.parent / "docs" / "reference" / "bus_messages.md"
_HEAD = """# Messages of `trpac hil`

Written by `python -m trpac_hil.dbc_table` from `trpac_hil/trpac.dbc`; do not edit. How they are used: [hil.md](hil.md).

Classic CAN, 11-bit identifiers, 8 bytes, Intel byte order; a CAN FD bus may fill them up. "Stale after" is the age
beyond which the rig takes a signal for lost. A message that comes more often than its cycle time for long has two
senders, unless its counter goes on by one each time: its signals then count as lost, and `Status` is 2 until 1 s after
the last sign of it.
"""


def document() -> str:
    """The page of all messages as Markdown text."""
    messages = sorted((c.message for c in load_codec().messages.values()), key=lambda m: int(m.frame_id))
    return _HEAD + "".join(_section(message) for message in messages)


def _section(message: Message) -> str:
    rows = "\n".join(_row(signal) for signal in message.signals)
    heading = f"## {message.name}, 0x{message.frame_id:X}, sent by {' '.join(message.senders)}"
    return (
        f"\n{heading}\n\n{message.comment}. Cycle time {message.cycle_time} ms.\n\n"
        "| signal | bits | unit | scale | range | stale after | meaning |\n|---|---|---|---|---|---|---|\n"
        f"{rows}\n"
    )


def _row(signal: Signal) -> str:
    attributes = signal.dbc.attributes if signal.dbc else {}
    stale = f"{attributes[STALE_AFTER].value} ms" if STALE_AFTER in attributes else ""
    named = ", ".join(
        f"{raw}: {str(name).replace(NOT_AVAILABLE, 'not available')}"
        for raw, name in (signal.choices or {}).items()
    )
    sign = "i" if signal.is_signed else "u"
    meaning = f"{signal.comment} ({named})" if named else f"{signal.comment}"
    return (
        f"| `{signal.name}` | {signal.start}, {sign}{signal.length} | {signal.unit or ''} | {signal.scale:g} | "
        f"{signal.minimum:g} ... {signal.maximum:g} | {stale} | {meaning} |"
    )


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    TARGET.write_text(document(), encoding="utf-8")
    print(TARGET)
