"""The text of Python functions and classes, and where it stands."""

from __future__ import annotations

import ast
import inspect
import io
import sys
import tokenize
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any


class Unsupported(Exception):  # noqa: N818 - what the translator says of a construct
    """A construct that the translator does not know; the text begins with file and line."""


@dataclass(frozen=True)
class Source:
    """A module's file as it is named in the C code, its syntax tree, and its lines that are comments alone."""

    file: str
    tree: ast.Module
    comments: dict[int, str]


@cache
def source_of(module: str) -> Source:
    """The source of an imported module."""
    text = Path(str(sys.modules[module].__file__)).read_text(encoding="utf-8")
    comments = {
        token.start[0]: token.string[1:].strip()
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip()
    }
    return Source(f"{module.replace('.', '/')}.py", ast.parse(text), comments)


def definition(python: Any) -> Any:
    """The syntax tree of a function, method or class."""
    inside: Any = source_of(python.__module__).tree
    for name in python.__qualname__.split("."):
        inside = next(
            n for n in inside.body if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == name
        )
    return inside


def field_texts(python: Any) -> dict[str, str]:
    """The strings that follow the fields of a class, by field."""
    body = definition(python).body
    return {
        item.target.id: after.value.value
        for item, after in pairwise(body)
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name) and is_text(after)
    }


def is_text(node: ast.AST) -> bool:
    """Whether a statement is a string."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def names_in(node: ast.AST | None) -> set[str]:
    """All names in a piece of source."""
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)} if node is not None else set()


def summary(node: ast.FunctionDef) -> str:
    """The first paragraph of a docstring."""
    return inspect.cleandoc(ast.get_docstring(node) or "").split("\n\n")[0]
