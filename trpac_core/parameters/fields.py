"""Access to the fields of nested frozen dataclasses by dotted paths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import reduce
from typing import Any


def field_value(configuration: object, path: str) -> Any:
    """Value of a dotted path of fields, such as `vehicle.mass_kg`; a number takes the element of a tuple."""
    return reduce(_part, path.split("."), configuration)


def _part(owner: Any, name: str) -> Any:
    return owner[int(name)] if name.isdigit() else getattr(owner, name)


def with_fields(owner: Any, settings: Mapping[str, Any]) -> Any:
    """The frozen dataclass or tuple with the fields at these dotted paths replaced, all at once."""
    if "" in settings:
        value = settings[""]
        return type(owner)(value) if isinstance(owner, Enum) else value
    below: dict[str, dict[str, Any]] = {}
    for path, value in settings.items():
        name, _, rest = path.partition(".")
        below.setdefault(name, {})[rest] = value
    if is_dataclass(owner) and not isinstance(owner, type):
        known = (f.name for f in fields(owner) if f.name in below)
        return replace(owner, **{name: with_fields(getattr(owner, name), below[name]) for name in known})
    return tuple(
        with_fields(item, below[str(index)]) if str(index) in below else item
        for index, item in enumerate(owner)
    )
