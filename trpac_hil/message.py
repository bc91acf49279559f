"""A message of the bus: bytes to values by signal name, and back, by the layout of a DBC file.

The bits are taken here and not by cantools' `decode`, which refuses a message whose page (multiplexer value) the file
does not describe, whatever else is in it, and computes all signals, used or not. Tests hold the two to each other.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from cantools.database.can import Message, Signal

from sim2real.logs.formats.dbc import no_value
from trpac_core.files import quoted

NOT_AVAILABLE = "not_available"
"""Name of the raw value that means: the signal has no value; files of others name it as `no_value` knows it."""
STALE_AFTER = "StaleAfterMs"
"""Attribute of a signal in the DBC file: greatest age at which it is used [ms]."""
STALE_CYCLES, LEAST_STALE_NS, STALE_WITHOUT_CYCLE_NS = 3, 30_000_000, 100_000_000
"""Without that attribute: cycle times after which a signal is lost, but no less than 30 ms; and its greatest age where
there is no cycle time either [ns]. A missing message or two are ordinary; 30 ms are what the shipped file allows."""
COUNTER_OF, LIFE_COUNTER = "_Counter", "LifeCounter"
NO_COUNTER = "none"
"""In place of a counter's name: the message has none."""
LONGEST_MS = 60_000
"""Greatest cycle time and age limit [ms]; from the definitions in trpac.dbc."""
MOST_BITS = 64
"""Longest signal [bits]; of the DBC format."""
CLASSIC_BYTES, FD_SIZES = 8, (8, 12, 16, 20, 24, 32, 48, 64)
"""Longest message of classic CAN, and lengths of a CAN FD message from there on [bytes]; ISO 11898-1."""
FLOATS = {16: ("<e", 65504.0), 32: ("<f", 3.4028234e38), 64: ("<d", 1.7976931348623157e308)}
"""Format and greatest number of a float of so many bits; IEEE 754."""
TRIED = (math.nan, -math.inf, 0.0, 1.0, math.inf)
"""Values that each message must be able to carry, or to cut to its range, before the loop begins."""
NOTHING: Mapping[str, Collection[float]] = MappingProxyType({})
Selection = tuple[tuple[str, int], ...]
"""Raw values of the multiplexers that select a signal, from the outermost on; empty for one that is always there."""


@dataclass(frozen=True)
class Field:
    """A signal in the bits of its message.

    Attributes
    ----------
    name : str
        Its name.
    shift, mask, little : int, int, bool
        Its place in the message as one number of that byte order, and as many ones as it has bits.
    sign, form : int, str
        Weight of its sign bit, 0 without one; format of its bytes where it is a float, else empty.
    scale, offset : float
        Value = scale * raw + offset.
    low, high : float
        Its stated range, half a step wider; infinite where none is stated.
    invalid : frozenset of float
        Raw values that say that there is no value.
    selectors : tuple of (str, frozenset of int)
        Multiplexers, and their raw values with which the signal is in the message.
    """

    name: str
    shift: int
    mask: int
    little: bool
    sign: int
    form: str
    scale: float
    offset: float
    low: float
    high: float
    invalid: frozenset[float]
    selectors: tuple[tuple[str, frozenset[int]], ...]

    @classmethod
    def of(cls, signal: Signal, message: Message, invalid: Collection[float] = ()) -> Field:
        """The place of a signal; raises ValueError where it is not in the message or cannot be computed.

        `invalid` are values that say that there is none, besides those of the file.
        """
        bits = signal.length
        little = signal.byte_order == "little_endian"
        first = signal.start if little else 8 * (signal.start // 8) + 7 - signal.start % 8
        scale, offset = float(signal.scale), float(signal.offset)
        if not 0 < bits <= MOST_BITS or first < 0 or first + bits > 8 * message.length:
            raise ValueError(f"{signal.name} lies outside the message")
        if signal.is_float and bits not in FLOATS:
            raise ValueError(f"{signal.name} is a float of {bits} bits")
        if not (math.isfinite(scale) and math.isfinite(offset)) or scale == 0.0:
            raise ValueError(f"{signal.name} has the scale {scale:g} and the offset {offset:g}")
        low, high = _stated(signal)
        half = 0.0 if signal.is_float else 0.5 * abs(scale)
        return cls(
            name=signal.name,
            shift=first if little else 8 * message.length - first - bits,
            mask=(1 << bits) - 1,
            little=little,
            sign=1 << (bits - 1) if signal.is_signed and not signal.is_float else 0,
            form=FLOATS[bits][0] if signal.is_float else "",
            scale=scale,
            offset=offset,
            low=low - half,
            high=high + half,
            invalid=_invalid(signal) | {raw for v in invalid if _holds(signal, raw := _raw_of(v, signal))},
            selectors=_selectors(signal, message),
        )

    def raw(self, little: int, big: int) -> int:
        """Its bits in a message, given as a number of either byte order."""
        return ((little if self.little else big) >> self.shift) & self.mask

    def value(self, bits: int) -> float:
        """The value that these bits stand for, infinite outside the stated range, NaN where there is none."""
        raw: float = bits - 2 * (bits & self.sign)
        if self.form:
            raw = struct.unpack(self.form, bits.to_bytes(struct.calcsize(self.form), "little"))[0]
        if raw in self.invalid:
            return math.nan
        value = raw * self.scale + self.offset
        if self.low <= value <= self.high and -math.inf < value:
            return value
        return math.nan if math.isnan(value) else math.inf

    def bits(self, value: float) -> int:
        """The bits that stand for a finite value within `Coded.bounds`."""
        raw = (value - self.offset) / self.scale
        if self.form:
            return int.from_bytes(struct.pack(self.form, raw), "little")
        return round(raw) & self.mask


@dataclass(frozen=True)
class Coded:
    """A message of the bus with its coding.

    Attributes
    ----------
    message : Message
        Its layout.
    signals : tuple of str
        Those of its signals that are used, without the counter.
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
    fields : mapping
        Place of each used signal, of the counter and of the multiplexers.
    selections : mapping
        What selects each multiplexed one of `signals`; the others are not in it.
    """

    message: Message
    signals: tuple[str, ...]
    counter: str
    counts: int
    absent: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    stale_ns: Mapping[str, int]
    cycle_ns: int
    fields: Mapping[str, Field]
    selections: Mapping[str, Selection]

    @classmethod
    def of(
        cls,
        message: Message,
        used: Collection[str],
        counter: str = "",
        invalid: Mapping[str, Collection[float]] = NOTHING,
    ) -> Coded:
        """The coding of a message of a DBC file; raises one of `sim2real.logs.formats.dbc.DAMAGE`.

        `used` are the signals to read or write, `counter` is the one that counts the messages: `NO_COUNTER` for none,
        empty for the one that is called so. `invalid` are values of signals that say that there is none, besides those
        that the file names.
        """
        by_name = {signal.name: signal for signal in message.signals}
        if len(by_name) < len(message.signals):
            raise ValueError("a signal occurs twice")
        counting = _counter(by_name, counter)
        signals = tuple(name for name in by_name if name in used and name != counting)
        cycle_ns = _whole_ms(message.cycle_time, "its cycle time") if message.cycle_time else 0
        fields = {
            name: Field.of(by_name[name], message, invalid.get(name, ()))
            for name in (*signals, *filter(None, [counting]))
        }
        multiplexers = {name for field in fields.values() for name, _ in field.selectors}
        fields |= {name: Field.of(by_name[name], message) for name in sorted(multiplexers - set(fields))}
        selections = {
            name: tuple((multiplexer, min(ids)) for multiplexer, ids in fields[name].selectors)
            for name in signals
            if fields[name].selectors
        }
        pages = len(
            {(s.multiplexer_signal, each) for s in message.signals for each in s.multiplexer_ids or ()}
        )
        return cls(
            message,
            signals,
            counting,
            _counts(by_name[counting]) if counting else 0,
            {name: _absent(by_name[name], fields[name].invalid) for name in signals if fields[name].invalid},
            {name: _bounds(by_name[name], fields[name].invalid) for name in signals},
            {
                name: _stale_ns(by_name[name], cycle_ns * (pages if name in selections else 1))
                for name in signals
            },
            cycle_ns,
            fields,
            selections,
        )

    def try_out(self) -> None:
        """Encode and decode some values; raises one of `sim2real.logs.formats.dbc.DAMAGE` where that fails."""
        for name, (low, high) in self.bounds.items():
            if not -math.inf < low <= high < math.inf:
                raise ValueError(f"{name} has no range")
        for value in TRIED:
            for count in range(len(self._pages)):
                self.decode(self.encode(dict.fromkeys(self.signals, value), count))
        for byte in (0x00, 0x55, 0xAA, 0xFF):
            self.decode(bytes([byte]) * self.message.length)

    @property
    def _pages(self) -> list[Selection]:
        """What multiplexers must be for each part of the used signals to be sent once."""
        found = sorted(set(self.selections.values()), key=len, reverse=True)
        pages = [s for k, s in enumerate(found) if not any(set(s) <= set(longer) for longer in found[:k])]
        return pages or [()]

    def encode(self, values: Mapping[str, float], count: int = 0) -> bytes:
        """Bytes of a message; values are limited to their range, missing ones and NaN sent as not available or 0.

        Of a multiplexed message each `count` has the next part of the signals.
        """
        raws = {self.counter: count % self.counts} if self.counts else {}
        selected = dict(self._pages[count % len(self._pages)]) if self.selections else {}
        for name in self.signals:
            field = self.fields[name]
            if all(selected.get(multiplexer) in ids for multiplexer, ids in field.selectors):
                raws[name] = field.bits(self._sendable(name, values.get(name, math.nan)))
        parts = [0, 0]
        for name, bits in (raws | selected).items():
            field = self.fields[name]
            parts[field.little] |= (bits & field.mask) << field.shift
        length = self.message.length
        return (parts[True] | int.from_bytes(parts[False].to_bytes(length, "big"), "little")).to_bytes(
            length, "little"
        )

    def _sendable(self, name: str, value: float) -> float:
        low, high = self.bounds[name]
        if math.isnan(value):
            return self.absent.get(name, min(max(0.0, low), high))
        return min(max(value, low), high)

    def decode(self, data: bytes, outside: dict[str, int] | None = None) -> tuple[dict[str, float], int]:
        """Values of the signals that are in the message, NaN where not available, and the counter, -1 without one.

        Those outside their stated range are NaN, too, and counted in `outside` by name. Raises ValueError on a wrong
        length.
        """
        least = self.message.length
        if len(data) != least:
            if len(data) != padded(least):
                raise ValueError(
                    f"{self.message.name}: {len(data)} bytes; expected {least}, or these filled up to a length of CAN "
                    "FD, see docs/reference/bus_messages.md."
                )
            data = data[:least]
        little, big, fields = int.from_bytes(data, "little"), int.from_bytes(data, "big"), self.fields
        values: dict[str, float] = {}
        for name in self.signals:
            field = fields[name]
            if field.selectors and not all(
                fields[multiplexer].raw(little, big) in ids for multiplexer, ids in field.selectors
            ):
                continue
            value = field.value(field.raw(little, big))
            if value == math.inf:
                value = math.nan
                if outside is not None:
                    outside[name] = outside.get(name, 0) + 1
            values[name] = value
        return values, fields[self.counter].raw(little, big) if self.counts else -1


def identifier(coded: Coded) -> str:
    """Identifier of a message as text; an extended one ends in x."""
    return f"0x{coded.message.frame_id:X}" + ("x" if coded.message.is_extended_frame else "")


def _invalid(signal: Signal) -> frozenset[float]:
    """Raw values that say that there is no value; raises ValueError where the signal's bits do not hold one."""
    invalid = no_value(signal)
    if not all(_holds(signal, raw) for raw in invalid):
        raise ValueError(f"{signal.name} has a value in its table that its bits do not hold")
    return invalid


def _counter(by_name: Mapping[str, Signal], stated: str) -> str:
    """Name of the signal that counts the messages, empty for none; raises ValueError where it does not count."""
    if stated == NO_COUNTER:
        return ""
    named = [name for name in by_name if name.endswith(COUNTER_OF) or name == LIFE_COUNTER][:1]
    name = stated or "".join(named)
    if name and name not in by_name:
        raise ValueError(f"it has no signal {quoted(name)} that could count it")
    counter = by_name.get(name)
    if counter and (
        counter.is_float
        or counter.is_signed
        or (counter.scale, counter.offset) != (1, 0)
        or counter.multiplexer_ids
        or _counts(counter) < 2
    ):
        raise ValueError(f"{name} does not count by one from 0")
    return name


def _counts(counter: Signal) -> int:
    """Number of values of a counter: those of its stated range from 0, else those of its bits."""
    _, high = _stated(counter)
    return int(min(high + 1, 2**counter.length))


def _selectors(signal: Signal, message: Message) -> tuple[tuple[str, frozenset[int]], ...]:
    """Multiplexers of a signal from the outermost on, and the values that select it; raises ValueError in a circle."""
    found: list[tuple[str, frozenset[int]]] = []
    while signal.multiplexer_ids:
        if len(found) > len(message.signals) or signal.multiplexer_signal is None:
            raise ValueError(f"{signal.name} has no multiplexer, or a circular one")
        found.insert(0, (signal.multiplexer_signal, frozenset(signal.multiplexer_ids)))
        signal = message.get_signal_by_name(signal.multiplexer_signal)
    return tuple(found)


def padded(length: int) -> int:
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


def _stale_ns(signal: Signal, cycle_ns: int) -> int:
    """Greatest age at which a signal is used, by its attribute, else by how often it comes [ns]."""
    attributes = signal.dbc.attributes if signal.dbc else {}
    if STALE_AFTER in attributes:
        return _whole_ms(attributes[STALE_AFTER].value, f"{STALE_AFTER} of {signal.name}")
    return max(STALE_CYCLES * cycle_ns, LEAST_STALE_NS) if cycle_ns else STALE_WITHOUT_CYCLE_NS


def _holds(signal: Signal, raw: float) -> bool:
    """Whether a raw value is one that the signal's bits can have."""
    values = 2**signal.length
    low, high = (-values // 2, values // 2 - 1) if signal.is_signed else (0, values - 1)
    return bool(signal.is_float or low <= raw <= high)


def _raw_of(value: float, signal: Signal) -> float:
    """Raw value of a value in the signal's unit."""
    raw = (value - float(signal.offset)) / float(signal.scale)
    return raw if signal.is_float else float(round(raw))


def _absent(signal: Signal, invalid: Collection[float]) -> float:
    """Physical value of the raw value that says best that there is none."""
    named = [raw for raw, name in (signal.choices or {}).items() if str(name) == NOT_AVAILABLE]
    raw = named[0] if named else max(invalid)
    return float(raw) * float(signal.scale) + float(signal.offset)


def _stated(signal: Signal) -> tuple[float, float]:
    """The range that the file states for a signal; infinite where it states none or an empty one."""
    if signal.minimum is None or signal.maximum is None or not signal.minimum < signal.maximum:
        return -math.inf, math.inf
    return float(signal.minimum), float(signal.maximum)


def _raws(signal: Signal, invalid: Collection[float]) -> Iterator[float]:
    """Least and greatest raw value of a signal that is none of `invalid`."""
    if signal.is_float:
        yield from (-FLOATS[signal.length][1], FLOATS[signal.length][1])
        return
    half = 2 ** (signal.length - 1)
    low, high = (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)
    while low in invalid and low < high:
        low += 1
    while high in invalid and low < high:
        high -= 1
    yield from (low, high)


def _bounds(signal: Signal, invalid: Collection[float]) -> tuple[float, float]:
    """Least and greatest value of a signal: what its bits hold except "not available", within its stated range."""
    low, high = sorted(
        float(raw) * float(signal.scale) + float(signal.offset) for raw in _raws(signal, invalid)
    )
    least, greatest = _stated(signal)
    return max(low, least), min(high, greatest)
