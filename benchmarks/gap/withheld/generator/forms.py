"""Forms: what the contract leaves open, in several readings, of which each case has one that its seal tells.

A form never changes the nominal car or what a parameter means: it acts only through the effect that is hidden, the
tyre's foreign share, the noise, the logger or the driver. They are drawn from a generator of their own, so that
whatever else is drawn does not hang on which forms there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.random import Generator

from . import drivers_by_machine as by_machine
from . import drivers_by_task as by_task
from . import drivers_by_temper as by_temper
from .driver import BRISK, Style
from .effects import EFFECT_FORMS, FOREIGN
from .library import LIBRARY
from .loggers import DIGITS
from .noise import NOISES
from .outside import OUTSIDE
from .world import Effect

Forms = Mapping[str, str]

STYLES: dict[str, Style] = {
    "brisk": BRISK,
    "squeezing": by_temper.SQUEEZING,
    "restless": by_temper.RESTLESS,
    "hurried": by_temper.HURRIED,
    "learner": by_temper.LEARNER,
    "two_feet": by_temper.TWO_FEET,
    "proving": by_machine.PROVING,
    "assisted": by_machine.ASSISTED,
    "robot": by_machine.ROBOT,
    "cruise_control": by_machine.CRUISE_CONTROL,
    "winter": by_task.WINTER,
    "delivery": by_task.DELIVERY,
    "saving": by_task.SAVING,
    "overtaking": by_task.OVERTAKING,
    "training": by_task.TRAINING,
    "commuter": by_task.COMMUTER,
}

ASPECTS: dict[str, Mapping[str, Any]] = {
    **EFFECT_FORMS,
    "foreign_tyre": FOREIGN,
    "noise": NOISES,
    "digits": DIGITS,
    "driver": STYLES,
}
"""All that has forms, in the order in which they are drawn."""

RATES_HZ = {100: 0.15, 150: 0.1, 200: 0.15, 250: 0.1, 350: 0.15, 500: 0.1, 600: 0.1, 1000: 0.1, 1250: 0.05}
"""Log rates and their odds; at each, every second corner of the command at least falls on a row."""


def draw_forms(rng: Generator, aspects: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """A form of each aspect, all equally likely."""
    return {aspect: str(rng.choice(list(forms))) for aspect, forms in aspects.items()}


def form_of(aspect: str, name: str) -> Any:
    """What a form is."""
    return ASPECTS[aspect][name]


def effect_in(forms: Forms, name: str) -> Effect:
    """An effect or outside deviation as a case with these forms has it."""
    effect = LIBRARY[name] if name in LIBRARY else OUTSIDE[name]
    return replace(effect, apply=form_of(name, forms[name])) if name in forms else effect
