"""The messages of a bus by its DBC file, and the quantities of the rig that they carry."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cantools.database.can import Message

from sim2real.logs import mapping
from sim2real.logs.errors import LogError
from sim2real.logs.formats.dbc import DAMAGE, load_dbc
from trpac_core.files import quoted
from trpac_hil.errors import HilError
from trpac_hil.message import CLASSIC_BYTES, FD_SIZES, NO_COUNTER, Coded
from trpac_hil.roles import LOADS, SHIPPED, TRUTH, Resolver, Role

DBC_FILE = Path(__file__).with_name("trpac.dbc")
CLASS_MESSAGE, TRUTH_MESSAGE = "RoadClass", "PlantTruth"
INPUT_MESSAGES = ("WheelSpeeds", "WheelTorques", "VehicleMotion", "Chassis", CLASS_MESSAGE, TRUTH_MESSAGE)
OUTPUT_MESSAGES = ("Estimate", "EstimateWheels", "Health")
OURS = (*OUTPUT_MESSAGES, CLASS_MESSAGE, TRUTH_MESSAGE)
"""Messages that have the shipped layout where a DBC file of others does not have them."""

DIMENSIONLESS = {"": "1", "-": "1"}
"""Other spellings of the unit of a number; a unit that is not stated is the shipped one."""


@dataclass(frozen=True)
class Supply:
    """What brings new values: a message, or those messages that a multiplexer marks.

    Attributes
    ----------
    name : str
        Message, with multiplexers and their values behind it.
    message, signal : str
        Message, and a signal that comes with it; empty where all of the message's do.
    stale_ns : int
        Age at which it is lost [ns].
    """

    name: str
    message: str
    signal: str
    stale_ns: int


@dataclass(frozen=True)
class Codec:
    """The messages of a bus.

    Attributes
    ----------
    path, signals : Path, Path or None
        The DBC file, and the file that maps quantities to its signals.
    messages : mapping
        Those that are used, by name.
    roles : mapping
        Quantities by name, as sums of signals.
    ours : frozenset of str
        Messages whose layout is that of trpac.dbc, since the DBC file has none of these names.
    notes : tuple of str
        What is not used, and why.
    """

    path: Path
    signals: Path | None
    messages: Mapping[str, Coded]
    roles: Mapping[str, Role]
    ours: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Coded:
        """A message by its name."""
        return self.messages[name]

    @property
    def received(self) -> tuple[str, ...]:
        """Names of the messages that come in."""
        return tuple(name for name in self.messages if name not in OUTPUT_MESSAGES)

    @property
    def beyond_classic(self) -> str:
        """Name and length of a message that comes in and is too long for a bus without CAN FD; empty for none."""
        long = [m for name in self.received if (m := self.messages[name].message).length > CLASSIC_BYTES]
        return f"{long[0].name} has {long[0].length} bytes" if long else ""

    def by_id(self, names: Iterable[str]) -> dict[tuple[int, bool], Coded]:
        """Messages by identifier and by whether it is an extended one."""
        chosen = (self.messages[name] for name in names)
        return {(c.message.frame_id, c.message.is_extended_frame): c for c in chosen}

    @property
    def supplies(self) -> tuple[Supply, ...]:
        """What brings the quantities and the classes of the road, without the plant's truth."""
        roles = [role for name, role in self.roles.items() if name not in TRUTH]
        found = self.supplies_of(roles)
        if CLASS_MESSAGE in self.messages:
            found += (self._supply(CLASS_MESSAGE, next(iter(self[CLASS_MESSAGE].signals))),)
        return tuple(dict.fromkeys(found))

    def supplies_of(self, roles: Iterable[Role]) -> tuple[Supply, ...]:
        """What brings some quantities."""
        return tuple(
            dict.fromkeys(self._supply(term.message, term.signal) for role in roles for term in role.terms)
        )

    def _supply(self, name: str, signal: str) -> Supply:
        coded = self[name]
        selection = coded.selections.get(signal, ())
        alike = [each for each in coded.signals if coded.selections.get(each, ()) == selection]
        words = "".join(f"_{multiplexer}_{value}" for multiplexer, value in selection)
        stale_ns = min(coded.stale_ns[each] for each in alike)
        return Supply(name + words, name, alike[0] if selection else "", stale_ns)

    def require(self, roles: Iterable[str]) -> None:
        """Raise HilError, with the lines to write, where a quantity has no source."""
        missing = [name for name in roles if name not in self.roles]
        if missing:
            raise HilError(
                f"{quoted(self.signals)}: lacks {', '.join(missing)}. Expected lines such as "
                f"`{missing[0]}: {{column: Message.Signal}}`, with names of {quoted(self.path)}."
            )


def load_codec(path: Path = DBC_FILE, signals: Path | None = None) -> Codec:
    """The codec of a DBC file.

    Parameters
    ----------
    path : Path
        The DBC file. Without `signals` it has the messages and signals of the shipped one; identifiers, layout, scales
        and units may differ.
    signals : Path or None
        Mapping file: `columns` of the log format from `Message.Signal`, and `counters` by message.

    Raises
    ------
    HilError
        A file cannot be read; messages, signals or units are missing or unknown (all of them are named); a message
        cannot be coded; an identifier of what is sent is in use.
    """
    theirs = _read(path)
    shipped = theirs if path == DBC_FILE else _read(DBC_FILE)
    messages: dict[str, Message] = {}
    for message in theirs:
        messages.setdefault(message.name, message)
    shipped_messages = {message.name: message for message in shipped}
    used = {name: _names(shipped_messages[name]) for name in (*INPUT_MESSAGES, *OUTPUT_MESSAGES)}
    ours, notes, counters = frozenset[str](), list[str](), dict[str, str]()
    invalid: Mapping[str, tuple[float, ...]] = {}
    specs = SHIPPED
    if signals is None:
        _require_shipped(path, messages, shipped_messages)
    else:
        stated = _mapping(signals)
        counters = stated.counters
        specs = {name: spec for name, spec in stated.columns.items() if name in SHIPPED}
        messages, ours, notes = _with_ours(path, messages, shipped_messages)
        specs |= {name: SHIPPED[name] for name in (*LOADS, *TRUTH) if _has(messages, SHIPPED[name].column)}
        _require_counted(signals, path, messages, counters)
        _require_known(signals, path, messages, stated.invalid)
        invalid = stated.invalid
    _require_units(path, messages, shipped_messages)
    resolver = Resolver(messages, quoted(path), quoted(signals) if signals else "", specs)
    roles = {name: resolver.role(name) for name in specs}
    if resolver.problems:
        raise HilError("\n".join(resolver.problems))
    if signals is not None:
        used = {name: used[name] for name in OURS if name in messages}
    for role in roles.values():
        for term in role.terms:
            used[term.message] = used.get(term.message, frozenset()) | {term.signal}
    coded = {}
    for name, names in used.items():
        message = messages[name]
        try:
            _require_single(message, theirs)
            none = {s: _none_of(f"{name}.{s}", invalid) for s in names} if name not in ours else {}
            coded[name] = _tried(message, names, counters.get(name, ""), none)
        except DAMAGE as error:
            like = f" Expected one like that of {DBC_FILE}." if name in shipped_messages else ""
            raise HilError(f"{quoted(path)}: {name} cannot be used ({quoted(error)}).{like}") from error
    return Codec(path, signals, coded, roles, ours, tuple(notes))


def _read(path: Path) -> list[Message]:
    try:
        return load_dbc(path).messages
    except LogError as error:
        raise HilError(f"{error} {DBC_FILE} is one.") from error


def _mapping(path: Path) -> mapping.Mapping:
    try:
        return mapping.load_mapping(path)
    except LogError as error:
        raise HilError(str(error)) from error


def _names(message: Message) -> frozenset[str]:
    return frozenset(signal.name for signal in message.signals)


def _has(messages: Mapping[str, Message], column: str | None) -> bool:
    name, _, signal = (column or "").partition(".")
    return name in messages and signal in _names(messages[name])


def _require_shipped(path: Path, messages: Mapping[str, Message], shipped: Mapping[str, Message]) -> None:
    """Raise HilError where a DBC file that is used without a mapping lacks messages or signals of the shipped one."""
    missing = [name for name in shipped if name not in messages]
    missing += [
        f"{name}.{signal}"
        for name, message in shipped.items()
        if name in messages
        for signal in Coded.of(message, _names(message)).signals
        if signal not in _names(messages[name])
    ]
    if missing:
        raise HilError(
            f"{quoted(path)}: lacks {', '.join(missing)}. Expected all messages and signals of {DBC_FILE}, or a file "
            "that maps other names: --signals."
        )


def _require_units(path: Path, messages: Mapping[str, Message], shipped: Mapping[str, Message]) -> None:
    """Raise HilError where a signal that is no quantity of the log format states another unit than the shipped one."""
    for name in (*OUTPUT_MESSAGES, CLASS_MESSAGE):
        units = {s.name: s.unit or "" for s in messages[name].signals} if name in messages else {}
        for signal in shipped[name].signals:
            stated, ours = (DIMENSIONLESS.get(u, u) for u in (units.get(signal.name, ""), signal.unit or ""))
            if stated not in ("1", ours):
                raise HilError(
                    f"{quoted(path)}: {name}.{signal.name} is in [{quoted(stated)}]; expected [{ours}], as in "
                    f"{DBC_FILE}."
                )


def _with_ours(
    path: Path, messages: Mapping[str, Message], shipped: Mapping[str, Message]
) -> tuple[dict[str, Message], frozenset[str], list[str]]:
    """A DBC file's messages and those of `OURS` that it lacks; raises HilError where an identifier is taken.

    A message of such a name with other signals is one of the car's own, and not used.
    """
    whole, ours, notes = dict(messages), set[str](), list[str]()
    taken = {(m.frame_id, m.is_extended_frame): m.name for m in messages.values()}
    for name in OURS:
        layout = shipped[name]
        signals = set(Coded.of(layout, _names(layout)).signals)
        if name in messages and signals <= _names(messages[name]):
            continue
        other = taken.get((layout.frame_id, layout.is_extended_frame))
        if other is not None and name in OUTPUT_MESSAGES:
            raise HilError(
                f"{quoted(path)}: {name} is sent with the identifier 0x{layout.frame_id:X} of trpac.dbc, which is that "
                f"of {quoted(other)} here. Add a message {name} with a free identifier: copy its lines from {DBC_FILE}."
            )
        if other is not None:
            whole.pop(name, None)
            notes.append(
                f"{name} is not received: its identifier 0x{layout.frame_id:X} is that of {quoted(other)}."
            )
            continue
        whole[name] = layout
        ours.add(name)
    return whole, frozenset(ours), notes


def _require_counted(
    signals: Path, path: Path, messages: Mapping[str, Message], counters: Mapping[str, str]
) -> None:
    """Raise HilError where a stated counter is not in the DBC file."""
    for name, counter in counters.items():
        if name not in messages or (counter != NO_COUNTER and counter not in _names(messages[name])):
            raise HilError(
                f"{quoted(signals)}: counters: {quoted(path)} has no {quoted(name)}.{quoted(counter)}. "
                f"Expected `counters: {{Message: Signal}}`, or `{NO_COUNTER}` in place of the signal."
            )


def _none_of(column: str, invalid: Mapping[str, tuple[float, ...]]) -> tuple[float, ...]:
    """Values of a signal that a mapping names as invalid: by `Message.Signal`, by `Signal`, or for all columns."""
    plain = {name.partition("#")[0]: values for name, values in invalid.items()}
    return tuple(v for name in (column, column.partition(".")[2], "*") for v in plain.get(name, ()))


def _require_known(
    signals: Path, path: Path, messages: Mapping[str, Message], invalid: Mapping[str, tuple[float, ...]]
) -> None:
    """Raise HilError where a mapping names invalid values of a signal that the DBC file does not have."""
    known = {s.name for m in messages.values() for s in m.signals} | {"*"}
    for name in (name.partition("#")[0] for name in invalid):
        if name not in known and not _has(messages, name):
            raise HilError(
                f"{quoted(signals)}: invalid: {quoted(path)} has no signal {quoted(name)}. Expected Message.Signal, or "
                '"*" for all.'
            )


def _require_single(message: Message, all_messages: Iterable[Message]) -> None:
    """Raise ValueError where a message's name or identifier is there twice."""
    key = (message.frame_id, message.is_extended_frame)
    alike = [m for m in all_messages if (m.frame_id, m.is_extended_frame) == key or m.name == message.name]
    if len(alike) > 1:
        others = ", ".join(f"{quoted(m.name)} 0x{m.frame_id:X}" for m in alike)
        raise ValueError(f"its name or its identifier occurs twice: {others}")


def _tried(
    message: Message, used: Collection[str], counter: str, invalid: Mapping[str, Collection[float]]
) -> Coded:
    """The coding of a message after test values were encoded and decoded; raises one of `DAMAGE`."""
    longest = CLASSIC_BYTES if message.name in OUTPUT_MESSAGES else FD_SIZES[-1]
    if message.length > longest:
        raise ValueError(f"it has {message.length} bytes; expected at most {longest}")
    coded = Coded.of(message, used, counter, invalid)
    if coded.selections and message.name in (*OUTPUT_MESSAGES, CLASS_MESSAGE):
        raise ValueError("it is multiplexed")
    coded.try_out()
    return coded
