"""YAML files read strictly: all problems of a file in one message, with position and expectation."""

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
"""Largest file that is read; a road of 10,000 segments has 900,000 [bytes]."""
MOST_PROBLEMS = 20
"""Problems of a file that are named; further ones are counted."""
LONGEST_PROBLEM = 600
"""Greatest number of characters of a problem."""


def load_strict(path: str | Path, model: type[Model]) -> Model:
    """The model of a YAML file; raises one ScenarioError with all problems."""
    name = quoted(path)
    try:
        data = parse_yaml(read_text(path, MOST_BYTES, "a YAML file"))
    except FileError as error:
        raise ScenarioError(str(error)) from error
    except YamlError as error:
        raise ScenarioError(f"{name}: not valid YAML: {error}") from error
    if not isinstance(data, dict):
        # The content is not repeated: the file may be a wrong one, and must not appear in logs.
        raise ScenarioError(f"{name}: holds no keys at its top; expected lines of `key: value`.")
    return made(partial(model.model_validate, data), model, name)


def made(make: Callable[[], Made], model: type[BaseModel], name: str) -> Made:
    """The result of `make`, which makes a model of values; raises one ScenarioError with all problems of these."""
    try:
        return make()
    except ValidationError as error:
        raise ScenarioError("\n".join(f"{name}: {text}" for text in _problems(error, model))) from error


def _problems(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Problems as sentences: key, problem, expectation."""
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
    """A value as text in messages; of lists and mappings only kind and length."""
    if value and isinstance(value, (list, dict)):
        return f"a {'list' if isinstance(value, list) else 'mapping'} of {len(value)}"
    return quoted(repr(value))


def _location(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[str, list[str]]:
    """Path of a problem in the file, and the keys that are known there.

    Where a value may have several types, pydantic's location contains the type that it tried, which is left out.
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
