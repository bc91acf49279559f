"""The bus's messages by the DBC file: bytes to values by signal name, and back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cantools
from cantools.database.can import Message, Signal

from trpac_hil.errors import HilError

DBC_FILE = Path(__file__).with_name("trpac.dbc")
NOT_AVAILABLE = "not_available"
"""Name of the raw value by which a sender says that a signal has no value."""
STALE_AFTER = "StaleAfterMs"
"""Attribute of a signal in the DBC file: age beyond which it counts as lost [ms]."""

INPUT_MESSAGES = ("WheelSpeeds", "WheelTorques", "VehicleMotion", "Chassis", "RoadClass", "PlantTruth")
OUTPUT_MESSAGES = ("Estimate", "EstimateWheels", "Health")
COUNTER_OF = "_Counter"
LIFE_COUNTER = "LifeCounter"


@dataclass(frozen=True)
class Coded:
    """One message of the bus.

    Attributes
    ----------
    message : Message
        Its layout.
    signals : tuple of str
        Its signals but the counter.
    counter, counts : str, int
        Signal that counts the messages, and its number of values; empty and 0 if there is none.
    absent : mapping
        Physical value that stands for "not available", by signal.
    bounds : mapping
        Least and greatest value that can be sent, by signal.
    stale_ns : mapping
        Age beyond which a signal counts as lost [ns].
    """

    message: Message
    signals: tuple[str, ...]
    counter: str
    counts: int
    absent: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    stale_ns: Mapping[str, int]

    @classmethod
    def of(cls, message: Message) -> Coded:
        """What the DBC file says of a message."""
        absent, stale_ns = {}, {}
        for signal in message.signals:
            for raw, name in (signal.choices or {}).items():
                if str(name) == NOT_AVAILABLE:
                    absent[signal.name] = float(raw * signal.scale + signal.offset)
            attributes = signal.dbc.attributes if signal.dbc else {}
            if STALE_AFTER in attributes:
                stale_ns[signal.name] = int(attributes[STALE_AFTER].value) * 1_000_000
        counters = [s for s in message.signals if s.name.endswith(COUNTER_OF) or s.name == LIFE_COUNTER]
        return cls(
            message,
            tuple(s.name for s in message.signals if s not in counters),
            counters[0].name if counters else "",
            2 ** counters[0].length if counters else 0,
            absent,
            {s.name: _bounds(s, absent.get(s.name)) for s in message.signals},
            stale_ns,
        )

    def encode(self, values: Mapping[str, float], count: int = 0) -> bytes:
        """Bytes of a message; what is out of range is cut, what is missing or NaN is not available, else 0."""
        ready: dict[str, float] = {self.counter: count % self.counts} if self.counts else {}
        for name in self.signals:
            value = values.get(name, math.nan)
            low, high = self.bounds[name]
            if low <= value <= high:
                ready[name] = value
            elif math.isnan(value):
                ready[name] = self.absent.get(name, 0.0)
            else:
                ready[name] = low if value < low else high
        return bytes(self.message.encode(ready, strict=False))

    def decode(self, data: bytes) -> tuple[dict[str, float], int]:
        """Values by signal, NaN where not available, and the count, -1 without one; ValueError on too few bytes."""
        if len(data) < self.message.length:
            raise ValueError(
                f"{self.message.name}: {len(data)} bytes; expected {self.message.length}, see docs/hil_dbc.md."
            )
        values: dict[str, float] = self.message.decode(data, decode_choices=False)  # type: ignore[assignment]
        count = int(values.pop(self.counter)) if self.counts else -1
        for name, absent in self.absent.items():
            if values[name] == absent:
                values[name] = math.nan
        return values, count


def _bounds(signal: Signal, absent: float | None) -> tuple[float, float]:
    """The range that a signal states, else what its bits can hold but for "not available"."""
    low, high = -math.inf, math.inf
    if not signal.is_float:
        raw = (0, 2**signal.length - 1)
        if signal.is_signed:
            raw = (-(2 ** (signal.length - 1)), 2 ** (signal.length - 1) - 1)
        low, high = sorted(float(value * signal.scale + signal.offset) for value in raw)
        step = abs(float(signal.scale))
        low, high = low + step * (low == absent), high - step * (high == absent)
    return (
        low if signal.minimum is None else max(low, float(signal.minimum)),
        high if signal.maximum is None else min(high, float(signal.maximum)),
    )


@dataclass(frozen=True)
class Codec:
    """The messages of a DBC file by name."""

    path: Path
    messages: Mapping[str, Coded]

    def __getitem__(self, name: str) -> Coded:
        """A message by its name."""
        return self.messages[name]

    def by_id(self, names: Iterable[str]) -> dict[tuple[int, bool], Coded]:
        """Messages by identifier and by whether it is an extended one."""
        chosen = (self.messages[name] for name in names)
        return {(c.message.frame_id, c.message.is_extended_frame): c for c in chosen}


def load_codec(path: Path = DBC_FILE) -> Codec:
    """Read a DBC file that has the messages and signals of the shipped one; ids, layout and scales may differ.

    Raises
    ------
    HilError
        The file cannot be read, or lacks messages or signals: all of them are named.
    """
    codec = _read(path)
    if path != DBC_FILE:
        shipped = _read(DBC_FILE).messages
        missing = [name for name in shipped if name not in codec.messages]
        missing += [
            f"{name}.{signal}"
            for name, coded in shipped.items()
            if name in codec.messages
            for signal in coded.signals
            if signal not in codec[name].signals
        ]
        if missing:
            raise HilError(
                f"{path}: lacks {', '.join(missing)}. Expected all messages and signals of {DBC_FILE}."
            )
    return codec


def _read(path: Path) -> Codec:
    try:
        database = cantools.database.load_file(path, database_format="dbc", encoding="utf-8")
    except (OSError, UnicodeError, ValueError, cantools.Error) as error:
        raise HilError(
            f"{path}: cannot be read as DBC file ({error}). Expected one like {DBC_FILE}."
        ) from error
    return Codec(path, {m.name: Coded.of(m) for m in database.messages})  # type: ignore[union-attr]
