"""Forms: what the contract leaves open, in several readings, of which each case has one that its seal tells.

A form never changes the nominal car or what a parameter means: it acts only through the effect that is hidden, the
tyre's foreign share, the noise, the logger or the driver. Each tells since which edition of the generator it is drawn:
a case of an edition draws among the forms that there were by then, from a generator of its own, so that whatever else
is drawn stays as it was. Lists are added to at their ends only: what was drawn from them stays too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from numpy.random import Generator

from . import drivers_by_machine as by_machine
from . import drivers_by_task as by_task
from . import drivers_by_temper as by_temper
from .camera_forms import NEWEST_CAMERA
from .driver import BRISK, Style
from .effects import EFFECT_FORMS
from .foreign import FOREIGN
from .library import LIBRARY
from .loggers import DIGITS
from .noise import NOISES
from .outside import OUTSIDE, OUTSIDE_SINCE
from .world import Effect

Forms = dict[str, str]


@dataclass(frozen=True)
class Edition:
    """What the generator draws among: all that it had by then.

    Attributes
    ----------
    car : int
        Forms of effects, tyres, noise, loggers and drivers, log rates, deviations outside the library, and pairs; the
        first has one form of everything, as the library has it.
    camera : int
        The same of the camera's cases; the first has several forms of most aspects.
    """

    car: int
    camera: int


PLAIN = Edition(1, 1)
NEWEST = Edition(10, NEWEST_CAMERA)

STYLES: dict[str, tuple[int, Style]] = {
    "brisk": (1, BRISK),
    "squeezing": (2, by_temper.SQUEEZING),
    "restless": (2, by_temper.RESTLESS),
    "one_pedal": (3, by_temper.ONE_PEDAL),
    "proving": (3, by_machine.PROVING),
    "assisted": (4, by_machine.ASSISTED),
    "hurried": (4, by_temper.HURRIED),
    "robot": (5, by_machine.ROBOT),
    "learner": (5, by_temper.LEARNER),
    "winter": (5, by_task.WINTER),
    "delivery": (6, by_task.DELIVERY),
    "saving": (6, by_task.SAVING),
    "two_feet": (6, by_temper.TWO_FEET),
    "overtaking": (7, by_task.OVERTAKING),
    "training": (8, by_task.TRAINING),
    "cruise_control": (9, by_machine.CRUISE_CONTROL),
    "commuter": (10, by_task.COMMUTER),
}

_DRAWN_EARLY = tuple(name for name, forms in EFFECT_FORMS.items() if next(iter(forms.values()))[0] == 1)
ASPECTS: dict[str, dict[str, tuple[int, Any]]] = {
    **{name: EFFECT_FORMS[name] for name in _DRAWN_EARLY},
    "foreign_tyre": FOREIGN,
    "noise": NOISES,
    "digits": DIGITS,
    "driver": STYLES,
    **{name: forms for name, forms in EFFECT_FORMS.items() if name not in _DRAWN_EARLY},
}
"""All that has forms, in the order in which they are drawn."""

RATES_HZ: dict[int, dict[float, float]] = {
    1: {100: 0.35, 200: 0.4, 500: 0.15, 1000: 0.1},
    2: {100: 0.2, 200: 0.2, 250: 0.25, 400: 0.15, 500: 0.1, 800: 0.05, 2000: 0.05},
    3: {100: 0.2, 200: 0.2, 250: 0.1, 300: 0.2, 500: 0.1, 600: 0.15, 1200: 0.05},
    4: {100: 0.2, 150: 0.15, 200: 0.2, 350: 0.15, 500: 0.1, 750: 0.1, 1000: 0.05, 1500: 0.05},
    5: {100: 0.2, 200: 0.2, 250: 0.1, 450: 0.15, 550: 0.1, 900: 0.1, 1000: 0.1, 1300: 0.05},
    6: {100: 0.2, 150: 0.1, 200: 0.2, 300: 0.1, 400: 0.1, 650: 0.1, 700: 0.1, 1000: 0.1},
    7: {100: 0.15, 150: 0.1, 200: 0.2, 250: 0.15, 500: 0.1, 600: 0.1, 850: 0.1, 1000: 0.1},
    8: {100: 0.15, 150: 0.1, 200: 0.2, 250: 0.1, 400: 0.15, 500: 0.1, 950: 0.1, 1000: 0.1},
    9: {100: 0.15, 150: 0.1, 200: 0.2, 250: 0.1, 300: 0.15, 500: 0.1, 800: 0.1, 1000: 0.05, 1100: 0.05},
    10: {100: 0.15, 150: 0.1, 200: 0.15, 250: 0.1, 350: 0.15, 500: 0.1, 600: 0.1, 1000: 0.1, 1250: 0.05},
}
"""Log rates of each edition and their odds; at each, every second corner of the command at least falls on a row."""


def names_by(edition: int) -> dict[str, list[str]]:
    """Each aspect's forms that the generator had by an edition; what is not listed has the library's."""
    known = {
        aspect: [form for form, (since, _) in forms.items() if since <= edition]
        for aspect, forms in ASPECTS.items()
    }
    return {aspect: forms for aspect, forms in known.items() if forms}


def outside_by(edition: int) -> dict[str, Effect]:
    """Deviations outside the library that the generator had by an edition."""
    return {name: effect for name, (since, effect) in OUTSIDE_SINCE.items() if since <= edition}


def draw_forms(edition: int, rng: Generator) -> Forms:
    """A form of each aspect, all equally likely."""
    return {aspect: str(rng.choice(forms)) for aspect, forms in names_by(edition).items()}


def form_of(aspect: str, name: str) -> Any:
    """What a form is."""
    return ASPECTS[aspect][name][1]


def effect_in(forms: Forms, name: str) -> Effect:
    """An effect or outside deviation as a case with these forms has it."""
    effect = LIBRARY[name] if name in LIBRARY else OUTSIDE[name]
    return replace(effect, apply=form_of(name, forms[name])) if name in forms else effect
