"""Reports as one HTML page that needs nothing beside it; what is not ours in it is text, whatever it holds."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jinja2


def page(template: Path, filters: Mapping[str, Callable[..., Any]], **content: Any) -> str:
    """The page of a template; each value is escaped, and one that the template wants and is not there is an error."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(filters)
    return environment.get_template(template.name).render(**content)


def data_address(data: bytes, media_type: str = "image/png") -> str:
    """A picture as the address that holds it."""
    return f"data:{media_type};base64,{b64encode(data).decode('ascii')}"
