"""What a stranger does with an installed wheel, in an empty folder: `python wheel_check.py README.md`.

Runs every Python block of the README in one namespace, then the commands; the first that fails ends it.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

COMMANDS = (
    "trpac --version",
    "trpac run paper_simulation --out out/run",
    "trpac gap demo --out out/gap",
    "trpac vision classify frame.jpg --out classes.csv",
    "trpac hil --with-plant --duration-s 5 --quiet --out out/hil",
)


def blocks(readme: str) -> list[str]:
    """The Python blocks of a page."""
    return re.findall(r"```python\n(.*?)```", readme, re.DOTALL)


def import_time_s() -> float:
    """How long `import trpac` takes in a fresh interpreter, the best of three [s]."""
    code = "import time; s = time.perf_counter(); import trpac; print(time.perf_counter() - s)"
    told = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(3)
    ]
    return min(float(one.stdout) for one in told)


def main(readme: Path) -> None:
    """Run it all; raises where something fails."""
    import trpac

    assert Path(trpac.__file__).is_relative_to(sys.prefix), f"{trpac.__file__} is not of this environment"
    assert not list(Path.cwd().iterdir()), "expected an empty folder"
    took_s = import_time_s()
    print(f"import trpac: {took_s:.2f} s", flush=True)
    assert took_s < 0.3
    names: dict[str, Any] = {}
    for block in blocks(readme.read_text(encoding="utf-8")):
        began = time.monotonic()
        exec(compile(block, "README.md", "exec"), names)
        print(f"block of {len(block.splitlines())} lines: {time.monotonic() - began:.0f} s", flush=True)
    shutil.copy(names["run"].frames[20], "frame.jpg")
    for command in COMMANDS:
        began = time.monotonic()
        program, *arguments = command.split()
        subprocess.run(
            [str(Path(sys.executable).with_name(program)), *arguments], check=True, stdout=subprocess.DEVNULL
        )
        print(f"{command}: {time.monotonic() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
