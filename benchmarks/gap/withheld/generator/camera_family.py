"""Families of the camera's forms: which a case draws from, and what each form is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any

from numpy.random import Generator

from .camera_forms import CAMERA_FORMS
from .camera_second import MORE, NEW, Aspects
from .camera_third import FURTHER


class CameraFamily(StrEnum):
    """Which forms of the camera are drawn from; each later one holds all of the earlier ones."""

    FIRST = "first"
    """Several of most aspects."""
    SECOND = "second"
    """More of nearly every aspect, more aspects, deviations outside the library, and pairs."""
    THIRD = "third"
    """More of most aspects, deviations outside the library, and pairs."""


SECOND: Aspects = {
    name: {**CAMERA_FORMS.get(name, {}), **MORE.get(name, {})} for name in {**CAMERA_FORMS, **MORE}
}
THIRD: Aspects = {name: {**forms, **FURTHER.get(name, {})} for name, forms in SECOND.items()}
ASPECTS: dict[CameraFamily, Aspects] = {
    CameraFamily.FIRST: CAMERA_FORMS,
    CameraFamily.SECOND: SECOND,
    CameraFamily.THIRD: THIRD,
}
"""All that has forms in each family."""
ONLY = {aspect: next(iter(forms)) for aspect, forms in NEW.items()}
"""What the first family has of the second's new aspects."""

OF_EFFECT: dict[str, tuple[str, ...]] = {
    "camera_latency": ("lateness",),
    "camera_pitch": ("mounting",),
    "exposure_shift": ("exposure_law", "exposure_course", "kept", "poor_pictures"),
    "motion_blur": ("blur_law", "blur_course", "kept", "poor_pictures"),
    "class_friction_offset": ("friction_off",),
}
"""Aspects that are an effect's own; all else is the system's that it is hidden in."""


def draw_forms_of(family: CameraFamily, rng: Generator) -> dict[str, str]:
    """A form of each of the family's aspects, all equally likely."""
    return {aspect: str(rng.choice(list(forms))) for aspect, forms in ASPECTS[family].items()}


def form(forms: Mapping[str, str], aspect: str) -> str:
    """Which one a system has; what its family does not list is as in the first."""
    return forms.get(aspect) or ONLY[aspect]


def function(forms: Mapping[str, str], aspect: str) -> Callable[..., Any]:
    """That of a form that has one."""
    found = THIRD[aspect][form(forms, aspect)]
    assert found is not None
    return found


def is_new(forms: Mapping[str, str], effect: str, family: CameraFamily = CameraFamily.FIRST) -> bool:
    """Whether an effect has a form that the `family` lacks."""
    listed = ASPECTS[family]
    known = {aspect: list(listed.get(aspect) or [ONLY[aspect]]) for aspect in OF_EFFECT.get(effect, ())}
    return any(form(forms, aspect) not in those for aspect, those in known.items())
