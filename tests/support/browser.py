"""Pages in a real browser: at two widths, light and dark, for a reader who cannot see well, and without network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import pytest

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
WIDTHS = (390, 1440)
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
SERIOUS = ("serious", "critical")
HEIGHT = 900

WIDER = """() => {
  const width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth <= width) return "";
  const wide = [...document.body.querySelectorAll("*")].filter(e => e.getBoundingClientRect().right > width + 1);
  const shown = wide.slice(0, 3).map(e => e.outerHTML.slice(0, 80));
  return `${document.documentElement.scrollWidth} px wide: ${shown.join(" | ")}`;
}"""


def require_chromium() -> None:
    """Skip the test, aloud, where there is no browser."""
    if not CHROMIUM.exists():
        pytest.skip(f"no {CHROMIUM}: pages are not looked at in a browser")
    for name in ("playwright", "axe_playwright_python"):
        pytest.importorskip(name, reason=f"{name} is not installed: pages are not looked at in a browser")


@contextmanager
def plots_page(path: Path) -> Iterator[Any]:
    """The first plot of a page, as a locator of an open browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        try:
            page = browser.new_page(viewport={"width": WIDTHS[1], "height": HEIGHT})
            page.goto(path.resolve().as_uri())
            page.locator(".canvas .modebar").first.wait_for(state="attached")
            yield page.locator(".canvas").first
        finally:
            browser.close()


def problems(pages: Iterable[tuple[str, Path]], pictures: Path | None = None) -> list[str]:
    """What is wrong with pages, by name: none of them scrolls sideways, breaks a rule of WCAG, or asks for a server.

    Parameters
    ----------
    pages : iterable of name and path
        Files of HTML.
    pictures : Path, optional
        Folder for a picture of each page as it was looked at.
    """
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import ViewportSize, sync_playwright

    found: list[str] = []
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        try:
            for name, path in pages:
                for width in WIDTHS:
                    size: ViewportSize = {"width": width, "height": HEIGHT}
                    context = browser.new_context(viewport=size, color_scheme=SCHEMES[0], offline=True)
                    page, where = context.new_page(), [f"{name} at {width} px"]
                    page.on("pageerror", lambda error, where=where: found.append(f"{where[0]}: {error}"))
                    page.on(
                        "request", lambda request, where=where: found.extend(_foreign(request.url, where[0]))
                    )
                    page.goto(path.resolve().as_uri())
                    for scheme in SCHEMES:
                        page.emulate_media(color_scheme=scheme)
                        where[0] = f"{name} at {width} px, {scheme}"
                        if wider := page.evaluate(WIDER):
                            found.append(f"{where[0]}: {wider}")
                        for broken in Axe().run(page).response["violations"]:
                            if broken["id"] == "color-contrast" or broken["impact"] in SERIOUS:
                                nodes = [n["html"][:120] for n in broken["nodes"][:3]]
                                found.append(f"{where[0]}: {broken['id']} ({broken['help']}): {nodes}")
                        if pictures is not None:
                            pictures.mkdir(parents=True, exist_ok=True)
                            page.screenshot(path=pictures / f"{name}_{width}_{scheme}.png", full_page=True)
                    context.close()
        finally:
            browser.close()
    return found


def _foreign(address: str, where: str) -> list[str]:
    """The problem of a request that leaves the page's own files."""
    return [] if address.startswith(("file:", "data:", "blob:")) else [f"{where}: asks for {address}"]
