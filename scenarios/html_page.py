"""Reports as one HTML page without further files; inserted values are escaped."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jinja2

from scenarios.plot_style import COLOURS

HERE = Path(__file__).parent
LIBRARY = "<!-- plotly -->"
"""Place of the plots' library in a page; text from files cannot hold it, since it is escaped."""
MISSING = "not known"


def page(template: Path, filters: Mapping[str, Callable[..., Any]] | None = None, **content: Any) -> str:
    """The page of a template that extends `report_base.html.jinja`; a missing value is an error."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, HERE]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update({"number": number, "percent": percent} | dict(filters or {}))
    environment.globals["colours"] = COLOURS
    text = environment.get_template(template.name).render(**content)
    return text.replace(LIBRARY, _library() if 'class="plot"' in text else "", 1)


def _library() -> str:
    """The script that draws the plots."""
    from plotly.offline import get_plotlyjs  # takes a second to load

    return f"<script>{get_plotlyjs()}</script>"


def data_address(data: bytes, media_type: str = "image/png") -> str:
    """A picture as a data URL."""
    return f"data:{media_type};base64,{b64encode(data).decode('ascii')}"


def number(value: float | None, digits: int = 3, missing: str = MISSING) -> str:
    """A number as text; `missing` where there is none."""
    return missing if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def percent(share: float | None, missing: str = MISSING) -> str:
    """A share of 1 as per cent, with a digit more near none and all; what is not all is never shown as all."""
    if share is None or not math.isfinite(share):
        return missing
    if 0.0 < share < 0.0005:
        return "< 0.1 %"
    if 0.9995 <= share < 1.0:
        return "> 99.9 %"
    return f"{100.0 * share:.1f} %" if 0.0 < share < 0.01 or 0.99 < share < 1.0 else f"{100.0 * share:.0f} %"
