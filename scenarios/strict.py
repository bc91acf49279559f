"""YAML files read strictly: every problem of a file in one message, with its place and what was expected."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from scenarios.errors import ScenarioError, suggestion
from scenarios.yaml_text import YamlError, parse_yaml
from trpac_core.files import FileError, quoted, read_text

Model = TypeVar("Model", bound=BaseModel)
Made = TypeVar("Made")

MOST_BYTES = 1_000_000
"""Larger files are refused unread; a road of 10,000 segments has 900,000 [bytes]."""
MOST_PROBLEMS = 20
"""Problems of a file that are told; the rest is counted."""
LONGEST_PROBLEM = 600
"""Characters of one problem."""


def load_strict(path: str | Path, model: type[Model]) -> Model:
    """Read a YAML file into its model; all of its problems in one ScenarioError."""
    name = quoted(path)
    try:
        data = parse_yaml(read_text(path, MOST_BYTES, "a YAML file"))
    except FileError as error:
        raise ScenarioError(str(error)) from error
    except YamlError as error:
        raise ScenarioError(f"{name}: not valid YAML: {error}") from error
    if not isinstance(data, dict):
        # Not a word of it: whoever named the wrong file need not see it in a log.
        raise ScenarioError(f"{name}: holds no keys at its top; expected lines of `key: value`.")
    return made(partial(model.model_validate, data), model, name)


def made(make: Callable[[], Made], model: type[BaseModel], name: str) -> Made:
    """What `make` gives, which makes a model of values; all that is wrong with these in one ScenarioError.

    Parameters
    ----------
    make : callable
        The making, with the values.
    model : type
        The model, whose keys are known.
    name : str
        What messages call the values.
    """
    try:
        return make()
    except ValidationError as error:
        raise ScenarioError("\n".join(f"{name}: {text}" for text in _problems(error, model))) from error


def _problems(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One sentence per problem: key, what is wrong, what was expected."""
    texts: list[str] = []
    every = error.errors(include_url=False)
    for item in every[:MOST_PROBLEMS]:
        path, known = _location(model, item["loc"])
        if item["type"] == "extra_forbidden":
            texts.append(f"{path}: unknown key; {suggestion(quoted(item['loc'][-1]), known)}")
        elif item["type"] == "missing":
            texts.append(f"{path}: missing; expected this key.")
        elif item["type"] == "value_error":
            prefix = f"{path}: " if path else ""
            texts.extend(prefix + line for line in str(item["ctx"]["error"]).splitlines())
        else:
            texts.append(
                f"{path or 'file'}: is {_shown(item['input'])}; {item['msg'][0].lower()}{item['msg'][1:]}."
            )
    named = [quoted(text, LONGEST_PROBLEM) for text in texts[:MOST_PROBLEMS]]
    more = len(texts) + len(every[MOST_PROBLEMS:]) - len(named)
    return [*named, f"and {more} more problems."] if more else named


def _shown(value: Any) -> str:
    """A value as a message repeats it; of lists and mappings the kind alone."""
    if value and isinstance(value, (list, dict)):
        return f"a {'list' if isinstance(value, list) else 'mapping'} of {len(value)}"
    return quoted(repr(value))


def _location(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[str, list[str]]:
    """Where in the file a problem is, and the keys that are known there.

    Among the keys pydantic names the type that it tried, where there are several: those are left out.
    """
    path, known = "", list(_fields([model]))
    types: list[type] = [model]
    for key in location:
        if isinstance(key, int):
            path += f"[{key}]"
            continue
        fields = _fields(types)
        tried = [t for t in types if re.search(rf"\b{re.escape(t.__name__)}\b", key)]
        if key not in fields and len(types) > 1 and tried:
            types = tried
            continue
        path += f".{key}"
        known = list(fields)
        types = _types(fields[key]) if key in fields else types
    return quoted(path.lstrip(".")), known


def _fields(types: Iterable[type]) -> dict[str, Any]:
    """Annotation of each key of the models among these types."""
    models = [t for t in types if issubclass(t, BaseModel)]
    return {f.alias or n: f.annotation for m in models for n, f in m.model_fields.items()}


def _types(annotation: Any) -> list[type]:
    """The classes in an annotation."""
    within = [found for part in get_args(annotation) for found in _types(part)]
    return within or ([annotation] if isinstance(annotation, type) else [])
