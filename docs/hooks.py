"""Parts of the site that are made when it is built: command line, file schemas, mathematics, links to the sources."""

from __future__ import annotations

import html
import json
import os
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from typer.cli import get_docs_for_click

import trpac
from trpac_cli.main import app

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
CORE = (
    "paper", "slip", "tyre", "observer", "fuzzy", "dife", "stationary_mean", "preprocessing", "car_friction",
    "estimator", "four_wheels", "robust.belief", "robust.interval", "robust.roads", "robust.tyres",
    "vision.camera", "vision.evidence", "vision.ife", "vision.lookahead", "vision.surface_hmm", "vision.trajectory",
)  # fmt: skip
"""Modules of trpac_core with the equations, in the order of the page."""
FILES = {
    "vehicle.yaml": ("scenarios.files", "VehicleFile"),
    "road.yaml": ("scenarios.files", "RoadFile"),
    "manoeuvre.yaml": ("scenarios.files", "Manoeuvre"),
    "scenario.yaml": ("scenarios.files", "ScenarioFile"),
    "camera.yaml": ("scenarios.camera.files", "CameraFile"),
    "sweep.yaml": ("scenarios.sweep.files", "SweepFile"),
    "mapping.yaml": ("sim2real.logs.mapping", "MappingFile"),
}
"""Input files, and the model that reads each."""
DEEPEST = 2
"""How many levels of keys a table goes down."""
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
MATH = re.compile(r'<(span|div) class="arithmatex">(?:\\\(|\\\[)(.*?)(?:\\\)|\\\])</\1>', re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    pages = {
        "reference/api/trpac.md": _api(),
        "reference/api/trpac_core.md": _core(),
        "reference/command_line.md": _command_line(),
        "reference/files.md": "\n".join(_files()),
    }
    for place, content in pages.items():
        files.append(File.generated(config, place, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead links to sources to the reference; name the file where the site does not hold it."""
    here = DOCS / Path(page.file.src_uri).parent

    def led(found: re.Match[str]) -> str:
        picture, text, target = found.groups()
        place = target.partition("#")[0]
        if picture or not place or re.match(r"[a-z][a-z0-9+.-]*:", place):
            return found[0]
        path = Path(os.path.normpath(here / place))
        if path.is_relative_to(DOCS) or not path.is_relative_to(ROOT):
            return found[0]
        if not path.exists():
            raise FileNotFoundError(f"{page.file.src_uri}: {target}: no such file")
        name = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        if name.removeprefix("trpac_core.") in CORE:
            function = text.strip("`").rstrip("()")
            known = hasattr(import_module(name), function) if function.isidentifier() else False
            reference = os.path.relpath(DOCS / "reference/api/trpac_core.md", here)
            return f"[{text}]({reference}#{name}{'.' + function if known else ''})"
        return f"{text} (`{path.relative_to(ROOT).as_posix()}`)" if f"`{place}" not in text else text

    return LINK.sub(led, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn mathematics into MathML, which a browser shows without a script."""

    def shown(found: re.Match[str]) -> str:
        tag, latex = found[1], html.unescape(found[2])
        if tag == "span":
            return convert(latex.strip())
        return convert(latex.strip(), display="block").replace(
            "<math ", '<math tabindex="0" ', 1
        )  # it scrolls

    return MATH.sub(shown, content)


def on_post_page(output: str, **_: Any) -> str:
    """Name the theme's search for a screen reader."""
    return output.replace(
        'data-md-component="search" role="dialog"',
        'data-md-component="search" role="dialog" aria-label="Search"',
    )


def _api() -> str:
    """The package's names, each with its docstring."""
    names = [name for name in trpac.__all__ if name != "effects"]
    blocks = [f"::: {getattr(trpac, name).__module__}.{name}" for name in names]
    return "\n\n".join(["# Python package", "Everything that `import trpac` offers.", *blocks, ""])


def _core() -> str:
    """The modules of the estimator."""
    title = "# Equations in code"
    text = "The modules of `trpac_core`; [equations](../../theory/equations.md) has them by number."
    return "\n\n".join([title, text, *(f"::: trpac_core.{name}" for name in CORE), ""])


def _command_line() -> str:
    """The commands, their arguments and options, as Typer documents them."""
    command = typer.main.get_command(app)
    return get_docs_for_click(obj=command, ctx=typer.Context(command), name="trpac", title="Command line")


def _files() -> Iterator[str]:
    """Keys of the input files, and the schemas of what is written."""
    yield "# Files\n\nInput files are YAML. Unknown keys are refused. The keys, their types and bounds:\n"
    for name, (module, model) in FILES.items():
        schema = getattr(import_module(module), model).model_json_schema(by_alias=True)
        yield f"## {name}\n\n{schema.get('description', '').splitlines()[0] if 'description' in schema else ''}\n"
        yield "| key | type | bounds | default |\n|---|---|---|---|"
        yield from _rows(schema, schema.get("$defs", {}), "")
        yield ""
    yield "## What is written\n\nJSON schemas of the written files. The tests hold what is written to them.\n"
    for path in sorted((DOCS / "reference" / "schemas").glob("*.json")):
        description = json.loads(path.read_text(encoding="utf-8"))["description"]
        yield f"- [{path.name}](schemas/{path.name}): {description}"


def _rows(schema: dict[str, Any], known: dict[str, Any], above: str) -> Iterator[str]:
    """A row per key, with the keys below it."""
    for key, value in schema.get("properties", {}).items():
        shape = next((one for one in value.get("anyOf", [value]) if one.get("type") != "null"), value)
        items = shape.get("items", {})
        below = known.get(shape.get("$ref", items.get("$ref", "")).rpartition("/")[2], {})
        name = f"{above}{key}{'[]' if items else ''}"
        if below and above.count(".") < DEEPEST:
            yield from _rows(below, known, f"{name}.")
            continue
        default = "required" if key in schema.get("required", ()) else ""
        if "default" in value:
            default = f"`{json.dumps(value['default'])}`"
        yield f"| `{name}` | {_kind(shape, bool(below))} | {_bounds(shape)} | {default} |"


def _kind(shape: dict[str, Any], is_object: bool) -> str:
    """The type of a value."""
    if "const" in shape:
        return f"`{shape['const']}`"
    return shape.get("type", "mapping" if is_object else "any")


def _bounds(shape: dict[str, Any]) -> str:
    """The values that are taken, as far as the schema says."""
    low = shape.get("minimum", shape.get("exclusiveMinimum"))
    high = shape.get("maximum", shape.get("exclusiveMaximum"))
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    return ", ".join(f"`{one}`" for one in shape.get("enum", ()))
