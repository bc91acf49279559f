"""Forms: what the contract leaves open, in several readings, of which each case has one that its seal tells.

A form never changes the nominal car or what a parameter means: it acts only through the effect that is hidden, the
tyre's foreign share, the noise, the logger or the driver. The first form of each aspect is the first family's only one;
the families after it draw among theirs, from a generator of its own, so that whatever else is drawn stays as it was.
What a family adds stands in a file of its own, and its lists are never changed: what was drawn from them stays too.
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from itertools import accumulate
from operator import or_
from typing import Any

from numpy.random import Generator

from . import (
    forms_eighth,
    forms_fifth,
    forms_fourth,
    forms_ninth,
    forms_second,
    forms_seventh,
    forms_sixth,
    forms_tenth,
    forms_third,
)
from .forms_second import Foreign
from .library import LIBRARY
from .outside import EVEN_FURTHER, FURTHER, OUTSIDE, STILL_FURTHER, YET_FURTHER
from .outside_eighth import AND_BEYOND
from .outside_ninth import STILL_BEYOND
from .outside_seventh import BEYOND
from .outside_sixth import LAST_FURTHER
from .outside_tenth import WELL_BEYOND
from .world import Effect

Forms = dict[str, str]
Aspects = dict[str, dict[str, Any]]


class Family(StrEnum):
    """Which forms are drawn from; each later one holds all of the earlier ones."""

    FIRST = "first"
    """One form of each aspect."""
    SECOND = "second"
    """More forms, more log rates, more deviations outside the library."""
    THIRD = "third"
    """Forms of nearly every effect; again more of all else."""
    FOURTH = "fourth"
    """Forms of every effect; again more of all else."""
    FIFTH = "fifth"
    """Again more of everything, and more pairs."""
    SIXTH = "sixth"
    """The same once more."""
    SEVENTH = "seventh"
    """And again, of nearly everything."""
    EIGHTH = "eighth"
    """More of most."""
    NINTH = "ninth"
    """More of most, once more."""
    TENTH = "tenth"
    """More of nearly everything."""


def _joined(aspects: Aspects, more: Aspects) -> Aspects:
    """What has had forms before comes first, as do those forms."""
    return {name: {**aspects.get(name, {}), **more.get(name, {})} for name in {**aspects, **more}}


THIRD: Aspects = _joined(forms_second.ASPECTS, forms_third.MORE)
FOURTH: Aspects = _joined(THIRD, forms_fourth.MORE)
FIFTH: Aspects = _joined(FOURTH, forms_fifth.MORE)
SIXTH: Aspects = _joined(FIFTH, forms_sixth.MORE)
SEVENTH: Aspects = _joined(SIXTH, forms_seventh.MORE)
EIGHTH: Aspects = _joined(SEVENTH, forms_eighth.MORE)
NINTH: Aspects = _joined(EIGHTH, forms_ninth.MORE)
TENTH: Aspects = _joined(NINTH, forms_tenth.MORE)
ASPECTS: dict[Family, Aspects] = {
    Family.FIRST: {name: dict([next(iter(forms.items()))]) for name, forms in forms_second.ASPECTS.items()},
    Family.SECOND: forms_second.ASPECTS,
    Family.THIRD: THIRD,
    Family.FOURTH: FOURTH,
    Family.FIFTH: FIFTH,
    Family.SIXTH: SIXTH,
    Family.SEVENTH: SEVENTH,
    Family.EIGHTH: EIGHTH,
    Family.NINTH: NINTH,
    Family.TENTH: TENTH,
}
"""All that has forms in each family; what a family does not list has the library's form."""
EFFECT_FORMS: Aspects = {name: forms for name, forms in TENTH.items() if name in LIBRARY}
FOREIGN: dict[str, Foreign] = TENTH["foreign_tyre"]
NOISES, DIGITS, STYLES = TENTH["noise"], TENTH["digits"], TENTH["driver"]

RATES_HZ: dict[Family, dict[float, float]] = {
    Family.FIRST: {100.0: 0.35, 200.0: 0.4, 500.0: 0.15, 1000.0: 0.1},
    Family.SECOND: {
        100.0: 0.2,
        200.0: 0.2,
        250.0: 0.25,
        400.0: 0.15,
        500.0: 0.1,
        800.0: 0.05,
        2000.0: 0.05,
    },
    Family.THIRD: {100.0: 0.2, 200.0: 0.2, 250.0: 0.1, 300.0: 0.2, 500.0: 0.1, 600.0: 0.15, 1200.0: 0.05},
    Family.FOURTH: {
        100.0: 0.2,
        150.0: 0.15,
        200.0: 0.2,
        350.0: 0.15,
        500.0: 0.1,
        750.0: 0.1,
        1000.0: 0.05,
        1500.0: 0.05,
    },
    Family.FIFTH: {
        100.0: 0.2,
        200.0: 0.2,
        250.0: 0.1,
        450.0: 0.15,
        550.0: 0.1,
        900.0: 0.1,
        1000.0: 0.1,
        1300.0: 0.05,
    },
    Family.SIXTH: {
        100.0: 0.2,
        150.0: 0.1,
        200.0: 0.2,
        300.0: 0.1,
        400.0: 0.1,
        650.0: 0.1,
        700.0: 0.1,
        1000.0: 0.1,
    },
    Family.SEVENTH: {
        100.0: 0.15,
        150.0: 0.1,
        200.0: 0.2,
        250.0: 0.15,
        500.0: 0.1,
        600.0: 0.1,
        850.0: 0.1,
        1000.0: 0.1,
    },
    Family.EIGHTH: {
        100.0: 0.15,
        150.0: 0.1,
        200.0: 0.2,
        250.0: 0.1,
        400.0: 0.15,
        500.0: 0.1,
        950.0: 0.1,
        1000.0: 0.1,
    },
    Family.NINTH: {
        100.0: 0.15,
        150.0: 0.1,
        200.0: 0.2,
        250.0: 0.1,
        300.0: 0.15,
        500.0: 0.1,
        800.0: 0.1,
        1000.0: 0.05,
        1100.0: 0.05,
    },
    Family.TENTH: {
        100.0: 0.15,
        150.0: 0.1,
        200.0: 0.15,
        250.0: 0.1,
        350.0: 0.15,
        500.0: 0.1,
        600.0: 0.1,
        1000.0: 0.1,
        1250.0: 0.05,
    },
}
"""Log rates and their odds; at each, every second corner of the command at least falls on a row."""

_ADDED = (
    OUTSIDE,
    FURTHER,
    STILL_FURTHER,
    YET_FURTHER,
    EVEN_FURTHER,
    LAST_FURTHER,
    BEYOND,
    AND_BEYOND,
    STILL_BEYOND,
    WELL_BEYOND,
)
OUTSIDES: dict[Family, dict[str, Effect]] = dict(zip(Family, accumulate(_ADDED, or_), strict=True))
"""Each family's deviations outside the library."""


def draw_forms(family: Family, rng: Generator) -> Forms:
    """A form of each of the family's aspects, all equally likely."""
    aspects = ASPECTS[family]
    if family is Family.FIRST:
        return {aspect: next(iter(forms)) for aspect, forms in aspects.items()}
    return {aspect: str(rng.choice(list(forms))) for aspect, forms in aspects.items()}


def effect_in(forms: Forms, name: str) -> Effect:
    """An effect or outside deviation as a case with these forms has it."""
    effect = {**LIBRARY, **OUTSIDES[Family.TENTH]}[name]
    return replace(effect, apply=EFFECT_FORMS[name][forms[name]]) if name in forms else effect


def is_further(forms: Forms, name: str, family: Family) -> bool:
    """Whether an effect has a form that the `family` lacks."""
    known = ASPECTS[family].get(name) or list(EFFECT_FORMS.get(name, {}))[:1]
    return name in forms and forms[name] not in known
