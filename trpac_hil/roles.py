"""Quantities that the rig needs, and the signals of the bus that they are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches

from cantools.database.can import Message, Signal

from sim2real.logs.contract import COLUMNS
from sim2real.logs.mapping import Spec
from trpac_core.files import quoted
from trpac_core.vehicle import WHEELS

TRUTH = tuple(f"theta_true_{w}" for w in WHEELS)
"""What the plant alone knows; it is logged and shown."""
LOADS = tuple(f"vertical_load_{w}_n" for w in WHEELS)
LOAD_UNITS = {"N": 1.0, "daN": 10.0, "kN": 1e3}
"""Units of the loads, which are no columns of the log format, in newtons."""
MOST_NAMED = 6
"""Names of messages or signals that a problem lists."""
SHIPPED: Mapping[str, Spec] = {
    name: Spec(column=column)
    for name, column in {
        **{f"wheel_speed_{w}_rad_s": f"WheelSpeeds.WheelSpeed_{w.upper()}" for w in WHEELS},
        **{f"wheel_torque_{w}_nm": f"WheelTorques.WheelTorque_{w.upper()}" for w in WHEELS},
        "vehicle_speed_m_s": "VehicleMotion.VehicleSpeed",
        "accel_x_m_s2": "VehicleMotion.AccelX",
        "accel_y_m_s2": "VehicleMotion.AccelY",
        "yaw_rate_rad_s": "VehicleMotion.YawRate",
        "steering_angle_rad": "Chassis.SteeringAngle",
        **{f"vertical_load_{w}_n": f"Chassis.VerticalLoad_{w.upper()}" for w in WHEELS},
        **{f"theta_true_{w}": f"PlantTruth.Theta_{w.upper()}" for w in WHEELS},
    }.items()
}
"""The mapping that holds without a file of signals: the shipped messages' names. Quantities are columns of the log."""


@dataclass(frozen=True)
class Term:
    """A signal of the bus, and what its value is multiplied with."""

    message: str
    signal: str
    gain: float


@dataclass(frozen=True)
class Role:
    """A quantity as a sum: constant + gain * signal + ..., in `unit`.

    `text` says in words what it is made of.
    """

    name: str
    unit: str
    constant: float = 0.0
    terms: tuple[Term, ...] = field(default_factory=tuple)
    text: str = ""


def unit_of(role: str) -> str:
    """Unit of a quantity."""
    if role in LOADS:
        return "N"
    return "-" if role in TRUTH else COLUMNS[role].unit


class Resolver:
    """Turns a mapping's sources into sums of signals of a DBC file; `problems` holds what is wrong, one line each.

    Parameters
    ----------
    messages : mapping
        Messages by name.
    dbc, file : str
        What problems call the DBC file and the file of signals; the latter is empty for the shipped mapping.
    specs : mapping
        Source of each quantity.
    """

    def __init__(
        self, messages: Mapping[str, Message], dbc: str, file: str, specs: Mapping[str, Spec]
    ) -> None:
        self._messages, self._dbc, self._file, self._specs = messages, dbc, file, specs
        self.problems: list[str] = []

    def role(self, name: str) -> Role:
        """A quantity as a sum of signals; what cannot be had is left out of it and told in `problems`."""
        spec, unit = self._specs[name], unit_of(name)
        constant, terms = self._sum(spec, name, unit)
        words = [
            f"{t.message}.{t.signal}" + ("" if abs(t.gain - 1.0) < 1e-9 else f" x {t.gain:.4g}")
            for t in terms
        ]
        words += [f"{constant:g}"] * (constant != 0.0 or not words)
        return Role(name, unit, constant, tuple(terms), " + ".join(words))

    def _sum(self, spec: Spec, role: str, unit: str) -> tuple[float, list[Term]]:
        constant, terms = self._source(spec, role, unit)
        factor = spec.sign * spec.scale
        return factor * constant + spec.offset, [
            Term(t.message, t.signal, factor * t.gain) for t in terms if factor
        ]

    def _source(self, spec: Spec, role: str, unit: str) -> tuple[float, list[Term]]:
        if spec.constant is not None:
            return spec.constant, []
        if spec.copy_of is not None and spec.copy_of in self._specs:
            return self._sum(self._specs[spec.copy_of], role, unit)
        if spec.integrate is not None or spec.copy_of is not None:
            why = (
                "integrate is for logs, not for a bus"
                if spec.copy_of is None
                else f"copies {quoted(spec.copy_of)}, for which there is no line"
            )
            self._blame(role, f"{why}; expected a signal, {{column: Message.Signal}}.")
            return 0.0, []
        if spec.sum:
            parts = [self._sum(term, role, unit) for term in spec.sum]
            return sum(constant for constant, _ in parts), [term for _, terms in parts for term in terms]
        found = self._signal(spec.column or "", role)
        if found is None:
            return 0.0, []
        message, signal = found
        gain = self._gain(spec, message, signal, role, unit)
        return 0.0, [] if gain is None else [Term(message.name, signal.name, gain)]

    def _signal(self, column: str, role: str) -> tuple[Message, Signal] | None:
        """A signal by its name `Message.Signal`, or `Signal` where one message alone has it.

        Behind a # a log's mapping may name a channel, which is the one bus here.
        """
        column = column.partition("#")[0]
        name, _, signal_name = column.partition(".")
        if not signal_name:
            having = [m.name for m in self._messages.values() for s in m.signals if s.name == column]
            if len(having) != 1:
                of = f": {', '.join(having)} have it" if having else ", such as VehicleMotion.VehicleSpeed"
                self._blame(role, f"{quoted(column)} is no Message.Signal{of}.")
                return None
            name, signal_name = having[0], column
        message = self._messages.get(name)
        if message is None:
            self._blame(role, f"{self._dbc} has no message {quoted(name)}; {_hint(name, self._messages)}")
            return None
        signals = {signal.name: signal for signal in message.signals}
        if signal_name not in signals:
            self._blame(role, f"{self._dbc} has no signal {quoted(column)}; {_hint(signal_name, signals)}")
            return None
        return message, signals[signal_name]

    def _gain(self, spec: Spec, message: Message, signal: Signal, role: str, unit: str) -> float | None:
        """Factor of the signal's values to `unit`: from the mapping's unit, else from the DBC file's."""
        stated = spec.unit or signal.unit or ""
        name = f"{message.name}.{signal.name}"
        radius = f", radius_m: {spec.radius_m:g}" if spec.radius_m is not None else ""
        line = f"{role}: {{column: {name}, unit: UNIT{radius}}}"
        if not stated and self._file and unit != "-":
            self._blame(role, f"{name} has no unit in {self._dbc}; state it in the line `{line}`.")
            return None
        try:
            if unit == "N" and stated:
                return _load_factor(stated)
            return spec.model_copy(update={"unit": stated or None}).factor(unit)
        except ValueError as error:
            where = self._file or "a file of signals (--signals)"
            self._blame(role, f"{name} of {self._dbc}: {error} State it in {where} by the line `{line}`.")
            return None

    def _blame(self, role: str, text: str) -> None:
        self.problems.append(f"{self._file or self._dbc}: {role}: {text}")


def _load_factor(unit: str) -> float:
    if unit not in LOAD_UNITS:
        raise ValueError(f"unit {unit!r} cannot become [N]; known units: {', '.join(LOAD_UNITS)}.")
    return LOAD_UNITS[unit]


def _hint(word: str, known: Mapping[str, object]) -> str:
    """The known name that is closest to a word, else the first ones of all."""
    lower = {name.lower(): name for name in known}
    close = get_close_matches(word.lower(), lower, n=1, cutoff=0.5)
    if close:
        return f"did you mean {quoted(lower[close[0]])}?"
    more = f" and {len(known) - MOST_NAMED} more" if len(known) > MOST_NAMED else ""
    return f"it has {', '.join(quoted(name) for name in list(known)[:MOST_NAMED])}{more}."
