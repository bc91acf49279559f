"""The effects that the plant can model; the one list of them is EFFECTS."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

from scenarios.effects.aero_drag import AeroDrag
from scenarios.effects.base import Effect, Parameter
from scenarios.effects.load_transfer import LoadTransfer
from scenarios.effects.rolling_resistance import RollingResistance

EFFECTS: dict[str, type[Effect]] = {e.id: e for e in (LoadTransfer, AeroDrag, RollingResistance)}

__all__ = ["EFFECTS", "Effect", "Parameter", "make_effect", "problems_of"]


def suggestion(word: str, known: list[str]) -> str:
    """A closing sentence for an error about an unknown word: what it may have meant, or what is known."""
    close = get_close_matches(word, known, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}Known: {', '.join(known)}."


def problems_of(effect_id: str, values: Mapping[str, float]) -> list[str]:
    """Everything that keeps an effect from being made; empty when nothing does."""
    if effect_id not in EFFECTS:
        return [
            f"{effect_id!r} is not an effect that the plant models; {suggestion(effect_id, list(EFFECTS))}"
        ]
    known = {p.name: p for p in EFFECTS[effect_id].parameters()}
    problems = [
        f"{name!r} is not a parameter of {effect_id}; {suggestion(name, list(known))}"
        for name in values
        if name not in known
    ]
    for name, p in known.items():
        if name not in values:
            problems.append(f"{effect_id} needs {name} [{p.unit}], {p.meaning}.")
        elif not p.low <= values[name] <= p.high:
            problems.append(
                f"{effect_id}.{name} is {values[name]:g}; "
                f"expected {p.low:g} to {p.high:g} [{p.unit}], {p.meaning}."
            )
    return problems


def make_effect(effect_id: str, values: Mapping[str, float]) -> Effect:
    """The effect with these parameter values.

    Raises
    ------
    ValueError
        Unknown id or parameter, a missing parameter, or a value out of bounds; names them all.
    """
    problems = problems_of(effect_id, values)
    if problems:
        raise ValueError(" ".join(problems))
    return EFFECTS[effect_id](**values)
