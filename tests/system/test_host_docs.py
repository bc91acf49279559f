"""The pages for other people's tools: what they say was run is run, from the page; all documents' links."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import pytest
from foreign_clients import need_client

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "guide" / "unit"
DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "models").glob("*.md")],
)

FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.MULTILINE)
ABORTED_AFTER_THE_RESULTS = 128 + 6
"""The interpreter's shutdown with the wrapper loaded sometimes aborts: "Limits" in docs/reference/unit.md."""


TITLE = re.compile(r'title="([^"]*)"')
OUTPUT, BY_HAND = "output", "by hand: "
"""Titles of blocks that are no files: the output of the command above; what is not run, and why."""


class Block(NamedTuple):
    """One code block: its language, its title, its text."""

    language: str
    title: str
    text: str

    @property
    def file(self) -> str:
        """Name of the file that the block is saved as; empty: it is none."""
        return "" if self.title == OUTPUT or self.title.startswith(BY_HAND) else self.title


def blocks(page: Path) -> list[Block]:
    """Code blocks of a page, in order."""
    found = []
    for info, text in FENCE.findall(page.read_text(encoding="utf-8")):
        title = TITLE.search(info)
        found.append(Block(info.split(" ")[0], title[1] if title else "", text))
    return found


def runs(page: Path) -> list[tuple[str, str | None]]:
    """Commands of a page, each with the output that the page shows after it, None where it shows none."""
    listed = blocks(page)
    following = [*listed[1:], Block("", "", "")]
    return [
        (block.text, after.text if after.title == OUTPUT else None)
        for block, after in zip(listed, following, strict=True)
        if block.language == "bash" and not block.title
    ]


@pytest.mark.e2e
@pytest.mark.parametrize(
    ("page", "packages", "program"),
    [
        ("fmpy.md", (), None),
        ("c_host.md", (), "cc"),
        ("native.md", (), "cc"),
        ("simulink.md", (), "cc"),
        ("libcosim_ecos.md", ("libcosimpy", "ecospy"), None),
    ],
)
def test_page_does_what_it_says(
    tmp_path: Path, page: str, packages: tuple[str, ...], program: str | None
) -> None:
    for package in packages:
        need_client(package)
    if program is not None and (shutil.which(program) is None or not sys.platform.startswith("linux")):
        pytest.skip(f"{page} needs {program} on Linux")
    for block in blocks(PAGES / page):
        if block.file:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": str(ROOT),
    }
    commands = runs(PAGES / page)
    assert commands, f"{page} shows no command to run"
    for command, shown in commands:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", command],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode in (0, ABORTED_AFTER_THE_RESULTS), done.stdout + done.stderr
        if shown is not None:
            assert done.stdout == shown


def anchors(document: Path) -> set[str]:
    """Anchors of a document's headings, as GitHub makes them."""
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    plain = [re.sub(r"[^\w\- ]", "", re.sub(LINK, "", heading).lower()) for heading in HEADING.findall(text)]
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_relative_links_lead_somewhere(document: Path) -> None:
    broken = []
    for link in LINK.findall(FENCE.sub("", document.read_text(encoding="utf-8"))):
        if re.match(r"[a-z][a-z0-9+.-]*:", link):
            continue
        place, _, anchor = unquote(link).partition("#")
        target = (document.parent / place).resolve() if place else document
        if not target.exists():
            broken.append(f"{link}: no such file")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            broken.append(f"{link}: no such heading")
    assert not broken


def test_index_names_every_page() -> None:
    index = (PAGES / "index.md").read_text(encoding="utf-8")
    missing = [
        page.name for page in PAGES.glob("*.md") if page.name != "index.md" and f"]({page.name})" not in index
    ]
    assert not missing


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda path: path.name)
def test_pages_name_variables_that_exist(page: Path) -> None:
    """A name in code style with a dot or an underscore that looks like a variable of a unit is one."""
    from fmu_src.units import UNITS

    known = {variable.name for unit in UNITS.values() for variable in unit.variables}
    roots = {name.split(".")[0] for name in known if "." in name}
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    said = {
        word for word in re.findall(r"`([a-zA-Z_]+\.[a-zA-Z_.0-9]+)`", text) if word.split(".")[0] in roots
    }
    assert said <= known
