"""The documents: each code block runs as a page shows it, each link leads somewhere, and the site needs no network."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import browser
import pages
import pytest
from foreign_clients import need_client

import trpac
from fmu_src.units import UNITS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
UNIT_PAGES = DOCS / "guide" / "unit"
SITE = ROOT / "out" / "site"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "models").glob("*.md")])
RUN = [page for page in DOCUMENTS if page.name != "README.md" and any(b.runs for b in pages.blocks(page))]
"""README.md is run from the installed wheel, in `wheel_check.py`."""
NEEDS = {"libcosim_ecos.md": ("libcosimpy", "ecospy")}
"""Packages of a page that no lock can promise."""
LONGEST_PAGE_S = 240.0


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.fixture(scope="session")
def example(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("documents") / "example"
    trpac.example(folder)
    return folder


@pytest.mark.e2e
@pytest.mark.parametrize("page", RUN, ids=named)
def test_each_block_of_a_page_runs(page: Path, example: Path, tmp_path: Path) -> None:
    for package in NEEDS.get(page.name, ()):
        need_client(package)
    if any(re.match(r"(cc|gcc) ", b.text) for b in pages.blocks(page) if b.runs) and not shutil.which("cc"):
        pytest.skip("the page needs a C compiler")
    shutil.copytree(example, tmp_path / "example")
    here = Path(sys.executable).parent
    done = subprocess.run(
        [sys.executable, pages.__file__, str(page), str(tmp_path)],
        env={**os.environ, "PATH": os.pathsep.join([str(here), os.environ["PATH"]]), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
        timeout=LONGEST_PAGE_S,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("page", DOCUMENTS, ids=named)
def test_blocks_say_what_they_are(page: Path) -> None:
    """A language that a reader knows, and a reason beside what is not run."""
    for block in pages.blocks(page):
        assert block.language in pages.LANGUAGES, f"{block.language!r}: {block.text[:60]}"
        if block.title.startswith("by hand"):
            assert re.fullmatch(r"by hand: \w.{5,}", block.title), block.title


LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.MULTILINE)
GENERATED = re.compile(r"docs/reference/(api/\w+|command_line|files)\.md$")
"""Pages that the site's build makes; it checks the links to them."""


def anchors(document: Path) -> set[str]:
    """Anchors of a document's headings, as GitHub makes them."""
    headings = HEADING.findall(pages.without_blocks(document))
    plain = [re.sub(r"[^\w\- ]", "", LINK.sub("", heading).lower()) for heading in headings]
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("document", [*DOCUMENTS, *sorted((ROOT / "lab").glob("*.md"))], ids=named)
def test_links_lead_somewhere(document: Path) -> None:
    broken = []
    for link in LINK.findall(pages.without_blocks(document)):
        if link.startswith("https://"):
            continue
        place, _, anchor = link.partition("#")
        target = (document.parent / place).resolve() if place else document
        if GENERATED.search(target.as_posix()):
            continue
        if not target.exists():
            broken.append(f"{link}: no such file")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            broken.append(f"{link}: no such heading")
    assert not broken


def test_the_unit_index_names_every_page() -> None:
    index = (UNIT_PAGES / "index.md").read_text(encoding="utf-8")
    others = [page.name for page in UNIT_PAGES.glob("*.md") if page.name != "index.md"]
    assert [name for name in others if f"]({name})" not in index] == []


@pytest.mark.parametrize("page", sorted(UNIT_PAGES.glob("*.md")), ids=named)
def test_pages_name_variables_that_exist(page: Path) -> None:
    """A name in code style with a dot that looks like a variable of a unit is one."""
    known = {variable.name for unit in UNITS.values() for variable in unit.variables}
    roots = {name.split(".")[0] for name in known if "." in name}
    said = re.findall(r"`([a-zA-Z_]+\.[a-zA-Z_.0-9]+)`", pages.without_blocks(page))
    assert {word for word in said if word.split(".")[0] in roots} <= known


class Resources(HTMLParser):
    """Addresses that a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source", "video"):
            self.found.append(given.get("src") or "")
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload", "preconnect"):
            self.found.append(given.get("href") or "")


@pytest.fixture(scope="module")
def site() -> Path:
    """The site that `make site` built; `make test` builds it first."""
    if not (SITE / "index.html").exists():
        pytest.skip("out/site is not built: make site")
    return SITE


def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        told = Resources()
        told.feed(page.read_text(encoding="utf-8"))
        for address in told.found:
            assert not re.match(r"(https?:)?//", address), f"{named(page)}: {address}"
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", style.read_text(encoding="utf-8")), named(style)


def test_mathematics_is_shown_without_a_script(site: Path) -> None:
    text = (site / "theory" / "equations.html").read_text(encoding="utf-8")
    assert text.count("<math") > 10
    assert "arithmatex" not in text


def test_pages_of_the_site_in_a_browser(site: Path) -> None:
    browser.require_chromium()
    shown = ("index", "guide/estimate", "theory/equations", "reference/command_line")
    assert browser.problems((name, site / f"{name}.html") for name in shown) == []
