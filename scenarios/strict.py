"""YAML files read strictly: every problem of a file in one message, with its place and what was expected."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError

from scenarios.effects import suggestion
from scenarios.errors import ScenarioError

Model = TypeVar("Model", bound=BaseModel)


class _StrictLoader(yaml.SafeLoader):
    """YAML that refuses a key written twice, and takes 5e4 for a number as YAML 1.2 does."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key.value!r} stands twice", key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load_strict(path: str | Path, model: type[Model]) -> Model:
    """Read a YAML file into its model; all of its problems in one ScenarioError."""
    path = Path(path)
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=_StrictLoader)  # a SafeLoader
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}; expected a YAML file.") from error
    except RecursionError as error:
        raise ScenarioError(f"{path}: not valid YAML: nested too deeply") from error
    except (
        yaml.YAMLError,
        ValueError,
    ) as error:  # the latter of text that is not UTF-8 and of dates that do not exist
        raise ScenarioError(f"{path}: not valid YAML: {error}") from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ScenarioError("\n".join(f"{path}: {text}" for text in _problems(error, model))) from error


def _problems(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One sentence per problem: key, what is wrong, what was expected."""
    texts = []
    for item in error.errors():
        place, known = _place(model, item["loc"])
        if item["type"] == "extra_forbidden":
            texts.append(f"{place}: unknown key; {suggestion(str(item['loc'][-1]), known)}")
        elif item["type"] == "missing":
            texts.append(f"{place}: missing; expected this key.")
        elif item["type"] == "value_error":
            prefix = f"{place}: " if place else ""
            texts.extend(prefix + line for line in str(item["ctx"]["error"]).splitlines())
        else:
            texts.append(
                f"{place or 'file'}: is {item['input']!r}; {item['msg'][0].lower()}{item['msg'][1:]}."
            )
    return texts


def _place(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[str, list[str]]:
    """Where in the file a problem is, and the keys that are known there.

    Among the keys pydantic names the type that it tried, where there are several: those are left out.
    """
    place, known = "", list(_fields([model]))
    types: list[type] = [model]
    for key in location:
        if isinstance(key, int):
            place += f"[{key}]"
            continue
        fields = _fields(types)
        tried = [t for t in types if re.search(rf"\b{re.escape(t.__name__)}\b", key)]
        if key not in fields and len(types) > 1 and tried:
            types = tried
            continue
        place += f".{key}"
        known = list(fields)
        types = _types(fields[key]) if key in fields else types
    return place.lstrip("."), known


def _fields(types: Iterable[type]) -> dict[str, Any]:
    """Annotation of each key of the models among these types."""
    models = [t for t in types if issubclass(t, BaseModel)]
    return {f.alias or n: f.annotation for m in models for n, f in m.model_fields.items()}


def _types(annotation: Any) -> list[type]:
    """The classes in an annotation."""
    within = [found for part in get_args(annotation) for found in _types(part)]
    return within or ([annotation] if isinstance(annotation, type) else [])
