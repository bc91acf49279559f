"""Where the command `trpac` begins: a package that is not installed is one sentence, not a traceback."""

from __future__ import annotations

import signal
import sys
from typing import NoReturn

OURS = ("fmu_src", "models", "scenarios", "sim2real", "trpac_cli", "trpac_core", "trpac_hil")
EXTRAS = "fmu,scenarios,gap,hil,sweep,design"


def main() -> None:
    """Run the command line; exits with 2 where one of its packages is missing, with 143 after SIGTERM."""
    signal.signal(signal.SIGTERM, _leave)
    try:
        from trpac_cli.main import app

        app()
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in OURS:
            raise
        print(
            f"trpac: needs the package that brings '{missing}', which is not installed. In the checkout: "
            f"pip install -e '.[{EXTRAS}]'",
            file=sys.stderr,
        )
        sys.exit(2)


def _leave(number: int, _: object) -> NoReturn:
    """End as after any other error: passing folders are removed, files keep what they held."""
    sys.exit(128 + number)
