"""The bus's messages by the DBC file: bytes to values by signal name, and back."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cantools.database.can import Message, Signal

from sim2real.logs.dbc import DAMAGE, load_dbc
from sim2real.logs.errors import LogError
from trpac_core.files import quoted
from trpac_hil.errors import HilError

DBC_FILE = Path(__file__).with_name("trpac.dbc")
NOT_AVAILABLE = "not_available"
"""Name of the raw value that means: the signal has no value."""
STALE_AFTER = "StaleAfterMs"
"""Attribute of a signal in the DBC file: greatest age at which it is used [ms]."""

INPUT_MESSAGES = ("WheelSpeeds", "WheelTorques", "VehicleMotion", "Chassis", "RoadClass", "PlantTruth")
OUTPUT_MESSAGES = ("Estimate", "EstimateWheels", "Health")
COUNTER_OF = "_Counter"
LIFE_COUNTER = "LifeCounter"

LONGEST_MS = 60_000
"""Greatest cycle time and age limit [ms]; from the definitions in trpac.dbc."""
CLASSIC_BYTES, FD_SIZES = 8, (8, 12, 16, 20, 24, 32, 48, 64)
"""Longest message of classic CAN, and lengths of a CAN FD message from there on [bytes]; ISO 11898-1."""
GREATEST_FLOATS = {16: 65504.0, 32: 3.4028234e38, 64: 1.7976931348623157e308}
"""Greatest number that a float of so many bits holds; IEEE 754."""


@dataclass(frozen=True)
class Coded:
    """A message of the bus with its coding.

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
        Greatest age at which a signal is used [ns].
    cycle_ns : int
        Its cycle time; 0 where the file has none [ns].
    """

    message: Message
    signals: tuple[str, ...]
    counter: str
    counts: int
    absent: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    stale_ns: Mapping[str, int]
    cycle_ns: int

    @classmethod
    def of(cls, message: Message) -> Coded:
        """The coding of a message of a DBC file; raises one of `DAMAGE`."""
        absent, stale_ns = {}, {}
        for signal in message.signals:
            for raw, name in (signal.choices or {}).items():
                if str(name) == NOT_AVAILABLE:
                    absent[signal.name] = float(raw * signal.scale + signal.offset)
            attributes = signal.dbc.attributes if signal.dbc else {}
            if STALE_AFTER in attributes:
                stale_ns[signal.name] = _whole_ms(
                    attributes[STALE_AFTER].value, f"{STALE_AFTER} of {signal.name}"
                )
        counters = [s for s in message.signals if s.name.endswith(COUNTER_OF) or s.name == LIFE_COUNTER]
        return cls(
            message,
            tuple(s.name for s in message.signals if s not in counters),
            counters[0].name if counters else "",
            2 ** counters[0].length if counters else 0,
            absent,
            {s.name: _bounds(s, absent.get(s.name)) for s in message.signals},
            stale_ns,
            _whole_ms(message.cycle_time, "its cycle time") if message.cycle_time else 0,
        )

    def encode(self, values: Mapping[str, float], count: int = 0) -> bytes:
        """Bytes of a message; values are limited to their range, missing ones and NaN sent as not available or 0."""
        ready: dict[str, float] = {self.counter: count % self.counts} if self.counts else {}
        for name in self.signals:
            value = values.get(name, math.nan)
            low, high = self.bounds[name]
            if low <= value <= high:
                ready[name] = value
            elif math.isnan(value):
                ready[name] = self.absent.get(name, min(max(0.0, low), high))
            else:
                ready[name] = low if value < low else high
        return bytes(self.message.encode(ready, strict=False))

    def decode(self, data: bytes) -> tuple[dict[str, float], int]:
        """Values by signal, NaN where not available, and the counter, -1 without one; ValueError on a wrong length."""
        least = self.message.length
        if len(data) not in (least, _padded(least)):
            raise ValueError(
                f"{self.message.name}: {len(data)} bytes; expected {least}, or these filled up to a length of CAN FD, "
                "see docs/hil_dbc.md."
            )
        values: dict[str, float] = self.message.decode(data, decode_choices=False)  # type: ignore[assignment]
        count = int(values.pop(self.counter)) if self.counts else -1
        for name, absent in self.absent.items():
            if values[name] == absent:
                values[name] = math.nan
        return values, count


def _padded(length: int) -> int:
    """Length of the shortest CAN FD message of 8 bytes or more that holds so many bytes [bytes]."""
    return next((size for size in FD_SIZES if size >= length), length)


def _whole_ms(value: object, what: str) -> int:
    """A time of the DBC file [ns]; ValueError where it is none."""
    try:
        milliseconds = int(value)  # type: ignore[call-overload]
    except (TypeError, ValueError, OverflowError):
        milliseconds = 0
    if not 0 < milliseconds <= LONGEST_MS:
        raise ValueError(f"{what} is {quoted(value)}; expected 1 to {LONGEST_MS} ms")
    return milliseconds * 1_000_000


def _bounds(signal: Signal, absent: float | None) -> tuple[float, float]:
    """Least and greatest value of a signal: its stated range, else what its bits hold except "not available"."""
    if signal.is_float:
        greatest = GREATEST_FLOATS[signal.length]
        low, high = sorted(
            value * float(signal.scale) + float(signal.offset) for value in (-greatest, greatest)
        )
    else:
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
    """The codec of a DBC file with the messages and signals of the shipped one; ids, layout and scales may differ.

    Raises
    ------
    HilError
        The file cannot be read, lacks messages or signals (all of them are named), or has one that cannot be coded.
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
                f"{quoted(path)}: lacks {', '.join(missing)}. Expected all messages and signals of {DBC_FILE}."
            )
    return codec


def _read(path: Path) -> Codec:
    try:
        messages = load_dbc(path).messages
    except LogError as error:
        raise HilError(f"{error} {DBC_FILE} is one.") from error
    used: Counter[object] = Counter(
        key for m in messages for key in (m.name, (m.frame_id, m.is_extended_frame))
    )
    coded = {}
    for message in messages:
        if message.name not in INPUT_MESSAGES + OUTPUT_MESSAGES:
            continue
        try:
            if used[message.name] > 1 or used[message.frame_id, message.is_extended_frame] > 1:
                raise ValueError("its name or its identifier is there twice")
            coded[message.name] = _tried(message)
        except DAMAGE as error:
            raise HilError(
                f"{quoted(path)}: {message.name} cannot be used ({quoted(error)}). "
                f"Expected one like that of {DBC_FILE}."
            ) from error
    return Codec(path, coded)


def _tried(message: Message) -> Coded:
    """The coding of a message after test values were encoded and decoded; raises one of `DAMAGE`."""
    longest = CLASSIC_BYTES if message.name in OUTPUT_MESSAGES else FD_SIZES[-1]
    if message.length > longest:
        raise ValueError(f"it has {message.length} bytes; expected at most {longest}")
    if message.is_multiplexed():
        raise ValueError("it is multiplexed")
    names = [signal.name for signal in message.signals]
    if len(set(names)) < len(names):
        raise ValueError("a signal is there twice")
    coded = Coded.of(message)
    for name, (low, high) in coded.bounds.items():
        if not -math.inf < low <= high < math.inf:
            raise ValueError(f"{name} has no range")
    counter = message.get_signal_by_name(coded.counter) if coded.counts else None
    if counter and (counter.is_float or counter.is_signed or (counter.scale, counter.offset) != (1, 0)):
        raise ValueError(f"{coded.counter} does not count by one from 0")
    sent = [
        coded.encode(dict.fromkeys(coded.signals, value))
        for value in (math.nan, -math.inf, 0.0, 1.0, math.inf)
    ]
    for data in (*sent, *(bytes([byte]) * message.length for byte in (0x00, 0x55, 0xAA, 0xFF))):
        values, _ = coded.decode(data)
        if values.keys() != set(coded.signals) or not all(
            isinstance(v, float | int) for v in values.values()
        ):
            raise ValueError("its signals cannot be told apart")
    return coded
