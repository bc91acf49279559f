"""YAML text to plain values and back: the core schema of YAML 1.2 without tags and merge keys, of bounded size."""

from __future__ import annotations

import re
from typing import Any

import yaml
from yaml._yaml import CParser
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.resolver import BaseResolver

from trpac_core.files import quoted

MOST_VALUES = 100_000
"""Greatest number of values and keys, with those of aliases at each use; a road of 10,000 segments has 90,000."""

_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")
"""Control characters, and lone surrogates, which cannot be written to a file."""


class YamlError(ValueError):
    """Text that is not valid YAML of this kind; the text has the position."""


class _Loader(Composer, CParser, SafeConstructor, BaseResolver):
    """Reads null, booleans, decimal numbers, text, lists and mappings, without tags, merge keys and repeated keys."""

    def __init__(self, text: str) -> None:
        CParser.__init__(self, text)
        Composer.__init__(self)
        SafeConstructor.__init__(self)
        BaseResolver.__init__(self)
        self._count = 0
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """A node; an alias counts with all values of its anchor."""
        event: Any = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            node = super().compose_node(parent, index)
            size = self._sizes.get(id(node))
            if size is None:
                raise _wrong(f"alias {quoted(event.anchor)!r} lies within what it stands for", event)
            self._count += size
        else:
            if event.tag not in (None, "!"):
                raise _wrong(f"tag {quoted(event.tag)!r} is not read; expected plain values", event)
            before = self._count
            self._count += 1
            node = super().compose_node(parent, index)
            self._sizes[id(node)] = self._count - before
        if self._count > MOST_VALUES:
            raise _wrong(f"more than {MOST_VALUES} values", event)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _wrong("a key that is no plain text", key)
            if key.value in seen:
                raise _wrong(f"key {quoted(key.value)!r} stands twice", key)
            seen.add(key.value)
        return yaml.constructor.BaseConstructor.construct_mapping(self, node, deep)

    def construct_scalar(self, node: Any) -> str:
        if found := _UNPRINTABLE.search(node.value):
            raise _wrong(f"text with the character {found[0]!a}, which cannot be shown", node)
        return str(node.value)

    def _number(self, node: yaml.ScalarNode) -> int | float:
        text = str(node.value)
        if text.lstrip("+-").lower() in (".inf", ".nan"):
            text = text.replace(".", "", 1)
        return int(text) if re.fullmatch(r"[-+]?[0-9]+", text) else float(text)

    def _boolean(self, node: yaml.ScalarNode) -> bool:
        return str(node.value).lower() == "true"


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    # Longer ones are text: Python needs seconds to convert thousands of digits.
    ("int", r"[-+]?[0-9]{1,30}", list("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]{1,99}|[0-9]{1,99}(\.[0-9]{0,99})?)([eE][-+]?[0-9]{1,9})?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first)
_Loader.yaml_constructors = {
    **SafeConstructor.yaml_constructors,
    **dict.fromkeys(("tag:yaml.org,2002:int", "tag:yaml.org,2002:float"), _Loader._number),
    "tag:yaml.org,2002:bool": _Loader._boolean,
}


def _wrong(what: str, at: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=what, problem_mark=at.start_mark)


def parse_yaml(text: str) -> Any:
    """The values of a YAML text; raises YamlError with row and column, without the text around them."""
    loader = None
    try:
        loader = _Loader(text)
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = "" if mark is None else f"row {mark.line + 1}, column {mark.column + 1}: "
        raise YamlError(f"{where}{quoted(error.problem or error.context)}") from error
    except RecursionError as error:
        raise YamlError("nested too deeply") from error
    except (yaml.YAMLError, ValueError) as error:  # the latter of half a surrogate pair
        raise YamlError(quoted(error)) from error


def to_yaml(content: Any, width: int = 80) -> str:
    """YAML text of plain values, keys in their order."""
    return str(yaml.safe_dump(content, sort_keys=False, width=width))
