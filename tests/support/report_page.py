"""A report as a reader meets it: its words, plots and addresses, and what every report must be."""

import json
import re
from html import unescape
from html.parser import HTMLParser

from scenarios.html_page import _library

VOID = ("meta", "img", "link", "br", "input")


class Page(HTMLParser):
    """A page's visible words, addresses, plots, widths of a budget's parts, and tags that are still open."""

    def __init__(self, html):
        super().__init__()
        self.source = html.replace(_library(), "", 1) if 'class="plot"' in html else html
        self.addresses, self.words, self.open, self.classes, self.budget = [], [], [], [], []
        self.headings, self.specs, self.problems, self.metas = [], [], [], {}
        self.tables = self.captions = 0
        self.feed(self.source)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag == "table":
            self.tables += 1
            if ("div", "wide") not in self.open:
                self.problems.append("a table outside a container that scrolls")
        if tag == "img":
            if not given.get("alt"):
                self.problems.append("a picture without a text")
            if ("div", "wide") not in self.open:
                self.problems.append("a picture outside a container that scrolls")
        if tag == "th" and "scope" not in given:
            self.problems.append(f"a heading of a table without scope: {given}")
        if tag == "html" and not given.get("lang"):
            self.problems.append("no language")
        if tag == "meta":
            self.metas |= {given.get("name") or "charset": given.get("content") or given.get("charset")}
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag not in VOID:
            self.open.append((tag, given.get("class") or ""))
        if tag == "caption":
            self.captions += 1
        if tag == "i" and {"class", "style"} <= set(given):
            self.budget.append(float(given["style"].removeprefix("width: ").removesuffix("%")))
        self.addresses += [value for key, value in attributes if key in ("src", "href")]
        self.classes += [value for key, value in attributes if key == "class"]

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == ("script", "plot"):
            self.specs.append(json.loads(data))
        elif self.open and self.open[-1][0] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())

    @property
    def verdict(self):
        """The first sentence: all that stands large at the top."""
        found = re.search(r'<p class="verdict">(.*?)</p>', self.source, re.S)
        return " ".join(unescape(re.sub("<[^>]*>", "", found.group(1))).split()) if found else ""


def require_report(html):
    """The page of a report; AssertionError where it is not one that every reader can use."""
    page = Page(html)
    assert page.open == []
    assert page.problems == []
    assert page.metas["viewport"] == "width=device-width, initial-scale=1"
    assert page.metas["charset"] == "utf-8"
    assert page.captions == page.tables
    assert page.headings[0] == 1
    assert page.headings.count(1) == 1
    steps = [after - before for before, after in zip(page.headings, page.headings[1:], strict=False)]
    assert max(steps) <= 1, page.headings
    assert all(a.startswith(("data:", "#")) for a in page.addresses), page.addresses
    assert not re.search(r"(?:src|href|url\(|@import)\s*[=(\"']*\s*(?:https?:)?//", page.source)
    assert "prefers-color-scheme: dark" in page.source
    assert "@media print" in page.source
    assert page.verdict
    assert page.text.index(page.verdict) < 300
    assert not {"undefined", "None", "nan", "–"} & set(page.text.split())
    assert "How this report was made" in page.text
    return page
