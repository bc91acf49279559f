"""From a file's columns to the columns of the log format, by a mapping or by their own names."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from sim2real.logs.contract import COLUMNS, IMAGE_PATH, POSITION, REQUIRED, TIME, WHEEL_SPEEDS
from sim2real.logs.mapping import INTEGRAND_UNIT, Mapping, Spec
from sim2real.logs.table import Array, Finding, Table, Wanted
from sim2real.logs.times import times_of_numbers
from sim2real.logs.units import UNITS
from trpac_core.files import quoted

BRIDGED_S = 0.25
"""An integral across a longer stretch of lost samples is worth a warning [s]."""

LISTED_NAMES, LONGEST_NAME = 12, 40
"""Column names of the file that an error lists, and characters of each."""
MOST_COMPARED = 3_000
"""Column names of the file among which a likely one is looked for: comparing takes microseconds each."""


def wanted_columns(mapping: Mapping) -> Wanted:
    """Which columns of a file the log format needs under a mapping."""
    sources = {name: mapping.sources(name) for name in COLUMNS}
    text = frozenset(sources.pop(IMAGE_PATH))
    time = mapping.spec(TIME).column or ""
    return Wanted(
        numbers=frozenset(s for names in sources.values() for s in names) - text,
        text=text,
        identifiers=frozenset(sources["frame_id"]),
        held=frozenset(s for name, names in sources.items() if COLUMNS[name].held for s in names),
        base=tuple(s for name in WHEEL_SPEEDS for s in sources[name]),
        time=time,
        time_form=mapping.time_form,
    )


def missing_columns(table: Table, mapping: Mapping) -> list[Finding]:
    """What the log format or the mapping needs and the file does not have; and ignored columns that are a slip."""
    names = list(table.names)
    findings = []
    mapped = mapping.columns
    for name, spec in mapped.items():
        for source in (leaf.column for leaf in spec.leaves()):
            if source is not None and source not in names:
                hint = _did_you_mean(source, names)
                findings.append(
                    Finding(f"column {source!r} is missing, which {mapping.path} wants for {name}.{hint}")
                )
        for copied in (leaf.copy_of for leaf in spec.leaves()):
            if copied is not None and copied not in mapped and copied not in names:
                findings.append(
                    Finding(f"column {copied!r} is missing, which {mapping.path} copies to {name}.")
                )
    # Stretches of the road that pictures are stamped with count from the road's zero, as the position does.
    stamped = {"image_from_m", "image_to_m"} & {*mapped, *names}
    needed = (*REQUIRED, POSITION) if stamped else REQUIRED
    absent = [name for name in needed if name not in mapped and name not in names]
    if absent:
        findings.append(Finding(_absent_text(absent, names)))
    spare = [n for n in COLUMNS if n not in REQUIRED and n not in mapped and n not in names]
    for name in ignored_columns(table, mapping)[:MOST_COMPARED]:
        close = get_close_matches(name.lower(), spare, n=1, cutoff=0.85)
        if close:
            findings.append(Finding(f"column {name!r} is ignored; did you mean {close[0]!r}?", fatal=False))
    return findings


def ignored_columns(table: Table, mapping: Mapping) -> tuple[str, ...]:
    """Columns of the file that nothing is made of."""
    used = {source for name in COLUMNS for source in mapping.sources(name)}
    return tuple(name for name in table.names if name not in used)


@dataclass(frozen=True)
class Translated:
    """The columns of the log format that could be made of a file's.

    Attributes
    ----------
    signals : dict
        Without time and picture names; shape (n,), in the log format's units.
    derived : frozenset of str
        Which of them were computed rather than measured.
    findings : list of Finding
        Where an integral is doubtful.
    """

    signals: dict[str, Array]
    derived: frozenset[str]
    findings: list[Finding]


def read_time(table: Table, mapping: Mapping) -> tuple[Array | None, Table]:
    """Time [s], shape (n,), None where its columns are not there or hold no numbers; the table with how it was read."""
    spec = mapping.spec(TIME)
    findings: list[Finding] = []
    name = spec.column or ""
    if name in table.numbers and not (spec.unit or table.units.get(name)):
        times = times_of_numbers(table.numbers[name], mapping.time_form)
        if times.note:
            numbers = table.numbers | {name: times.time_s}
            table = table.with_numbers(numbers, (*table.notes, times.note))
    time_s = _Evaluation(table, _specs(mapping), None, {}, findings).column(TIME)
    return time_s, table.with_numbers(table.numbers, table.notes, findings)


def translate(table: Table, mapping: Mapping, time_s: Array | None) -> Translated:
    """Make the columns of the log format out of the file's; without usable times those that need none."""
    specs = _specs(mapping)
    del specs[TIME]
    evaluation = _Evaluation(table, specs, time_s, {}, [])
    made = {name: evaluation.column(name) for name in specs}
    signals = {name: values for name, values in made.items() if values is not None}
    derived = frozenset(name for name in signals if specs[name].derived)
    return Translated(signals, derived, evaluation.findings)


@dataclass(frozen=True)
class _Evaluation:
    """Columns of the log format in the making; `done` holds those that are, since some are copied to others."""

    table: Table
    specs: dict[str, Spec]
    time_s: Array | None
    done: dict[str, Array]
    findings: list[Finding]

    def column(self, name: str) -> Array | None:
        """A column of the log format; None where a source of it is missing."""
        if name not in self.done:
            values = self.value(self.specs[name], COLUMNS[name].unit, name)
            if values is None:
                return None
            self.done[name] = values
        return self.done[name]

    def value(self, spec: Spec, unit: str, name: str) -> Array | None:
        """A source in `unit`; `name` is the column that it is for."""
        raw = self._raw(spec, unit, name)
        return None if raw is None else spec.sign * spec.scale * raw + spec.offset

    def _raw(self, spec: Spec, unit: str, name: str) -> Array | None:
        if spec.constant is not None:
            return np.full(len(self.table.rows), spec.constant)
        if spec.copy_of is not None:
            return self.column(spec.copy_of)
        if spec.integrate is not None:
            rate = self.value(spec.integrate, INTEGRAND_UNIT[unit], name)
            return None if rate is None or self.time_s is None else self._integral(self.time_s, rate, name)
        if spec.sum:
            terms = [self.value(term, unit, name) for term in spec.sum]
            known = [term for term in terms if term is not None]
            return np.sum(known, axis=0) if len(known) == len(terms) else None
        return self._measured(spec, unit, name)

    def _measured(self, spec: Spec, unit: str, name: str) -> Array | None:
        """A column of the file in `unit`: by the mapping's unit, else by the one that the file states."""
        source = spec.column or ""
        raw, stated = self.table.numbers.get(source), self.table.units.get(source)
        if raw is None:
            return None
        own = self._factor(spec.model_copy(update={"unit": stated}), unit) if stated else None
        if spec.unit is not None or not stated:
            by = spec.factor(unit)
            if own is not None and not np.isclose(own, by):
                self.findings.append(
                    Finding(
                        f"column {source!r} is in {quoted(stated)} by the file and in {spec.unit} by the mapping; the "
                        "mapping's is used.",
                        fatal=False,
                    )
                )
            return raw * by
        if own is None:
            if unit == "-" and COLUMNS[name].held:
                return raw  # a class or a number: what stands there is no unit
            line = f"{name}: {{column: {source!r}, unit: UNIT}}"
            self.findings.append(
                Finding(
                    f"column {source!r} states the unit {quoted(stated, 40)!r}, which cannot become [{unit}]. A "
                    f"mapping file with `{line}` says which it is; expected one of {', '.join(UNITS[unit])}."
                )
            )
            return None
        return raw * own

    @staticmethod
    def _factor(spec: Spec, unit: str) -> float | None:
        try:
            return spec.factor(unit)
        except ValueError:
            return None

    def _integral(self, time_s: Array, rate: Array, name: str) -> Array:
        total, bridged_s = integrate(time_s, rate)
        if bridged_s > BRIDGED_S:
            text = (
                f"{name} is integrated across {bridged_s:.2g} s without samples; it may be off from there on."
            )
            self.findings.append(Finding(text, fatal=False))
        return total


def integrate(time_s: Array, values: Array) -> tuple[Array, float]:
    """Trapezoidal integral over time from 0, and the longest time that it bridges [s].

    Across lost samples the signal is taken as a straight line; without any sample the integral is NaN.
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(values), np.nan), 0.0
    filled = np.interp(time_s, time_s[known], values[known])
    total = np.concatenate(([0.0], np.cumsum(0.5 * (filled[1:] + filled[:-1]) * np.diff(time_s))))
    ends = np.concatenate(([time_s[0]], time_s[known], [time_s[-1]]))
    return total, float(np.max(np.diff(ends)))


def _specs(mapping: Mapping) -> dict[str, Spec]:
    return {name: mapping.spec(name) for name in COLUMNS if name != IMAGE_PATH}


def picture_source(mapping: Mapping) -> str:
    """The file's column of picture names."""
    return mapping.sources(IMAGE_PATH)[0]


def _did_you_mean(name: str, known: list[str]) -> str:
    lower = {k.lower(): k for k in known[:MOST_COMPARED]}
    close = get_close_matches(name.lower(), lower, n=1, cutoff=0.5)
    return f" Did you mean {lower[close[0]]!r}?" if close else f" The file has: {_listed(known)}."


def _absent_text(absent: list[str], names: list[str]) -> str:
    lower = {n.lower(): n for n in names[:MOST_COMPARED]}
    hints = [
        f"{name} (is it {lower[close[0]]!r}?)" if close else name
        for name in absent
        for close in [get_close_matches(name.lower(), lower, n=1, cutoff=0.6)]
    ]
    what = "column" if len(absent) == 1 else "columns"
    line = f"{absent[0]}: {{column: NAME, unit: UNIT}}"
    if absent == [POSITION]:
        line = "position_m: {integrate: {copy: vehicle_speed_m_s}}"
    return (
        f"required {what} missing: {', '.join(hints)}. The file has: {_listed(names)}. If they are there under other "
        f"names or in other units, write a mapping file with lines such as `{line}` and give it with --map."
    )


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - LISTED_NAMES} more" if len(names) > LISTED_NAMES else ""
    return ", ".join(quoted(name, LONGEST_NAME) for name in names[:LISTED_NAMES]) + more
