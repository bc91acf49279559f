"""Code blocks of the documents, and a runner of a page in a folder: `python pages.py PAGE.md FOLDER`.

Python blocks of a page share a namespace, bash blocks run in the same folder, in the page's order. A block with a
title is a file of that name, but for two titles: `by hand: REASON` is not run, and `output` is what the bash block
above prints.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

FENCE = re.compile(r'^( *)```(\w*)(?: +title="([^"]*)")?[^\n]*\n(.*?)^\1```$', re.MULTILINE | re.DOTALL)
BY_HAND, OUTPUT = "by hand: ", "output"
LANGUAGES = frozenset(
    ("bash", "c", "cmake", "json", "lua", "matlab", "modelica", "powershell", "python", "text", "xml", "yaml")
)
ABORTED_AFTER_THE_RESULTS = 128 + 6
"""The interpreter's shutdown with the wrapper loaded sometimes aborts: "Limits" in docs/reference/unit.md."""


class Block(NamedTuple):
    """One code block: its language, title and text."""

    language: str
    title: str
    text: str

    @property
    def runs(self) -> bool:
        """Whether the block is run."""
        return self.language in ("python", "bash") and not self.title


def blocks(page: Path) -> list[Block]:
    """The code blocks of a page, in order."""
    return [
        Block(language, title or "", re.sub(f"^{indent}", "", text, flags=re.MULTILINE))
        for indent, language, title, text in FENCE.findall(page.read_text(encoding="utf-8"))
    ]


def without_blocks(page: Path) -> str:
    """The text of a page without its code blocks."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def run_page(page: Path) -> None:
    """Run a page in the present folder; AssertionError where a block fails or prints something else."""
    found = blocks(page)
    for block in found:
        if block.title and block.title != OUTPUT and not block.title.startswith(BY_HAND):
            Path(block.title).parent.mkdir(parents=True, exist_ok=True)
            Path(block.title).write_text(block.text, encoding="utf-8")
    names: dict[str, Any] = {"__name__": "__main__"}
    printed = ""
    for block in found:
        began = time.monotonic()
        if block.title == OUTPUT:
            assert block.text == printed, f"the page shows\n{block.text}\nprinted was\n{printed}"
        if not block.runs:
            continue
        if block.language == "python":
            exec(compile(block.text, page.name, "exec"), names)
        else:
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", block.text], capture_output=True, text=True, check=False
            )
            printed = done.stdout
            assert done.returncode in (0, ABORTED_AFTER_THE_RESULTS), (
                f"{block.text}{done.stdout}{done.stderr}"
            )
        print(f"{block.text.strip().splitlines()[0][:90]}: {time.monotonic() - began:.1f} s", flush=True)


if __name__ == "__main__":
    os.chdir(sys.argv[2])
    run_page(Path(sys.argv[1]))
    os._exit(0)  # see ABORTED_AFTER_THE_RESULTS
