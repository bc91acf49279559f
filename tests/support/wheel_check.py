"""What a stranger does with an installed wheel, in an empty folder: `python wheel_check.py README.md`.

Runs every block of the README that is not marked as by hand, then further commands; the first that fails ends it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from pages import run_page

COMMANDS = (
    "trpac --version",
    "trpac run paper_simulation --out out/run",
    "trpac vision classify example/frames --out classes.csv",
    "trpac hil --with-plant --duration-s 5 --quiet --out out/hil",
)


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
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    took_s = import_time_s()
    print(f"import trpac: {took_s:.2f} s", flush=True)
    assert took_s < 0.3
    run_page(readme)
    for command in COMMANDS:
        began = time.monotonic()
        subprocess.run(command.split(), check=True, stdout=subprocess.DEVNULL)
        print(f"{command}: {time.monotonic() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
