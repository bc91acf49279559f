"""Entry of the command `trpac`: a missing package is reported as one sentence."""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

from trpac.extras import MissingExtraError, missing

OURS = ("fmu_src", "models", "scenarios", "sim2real", "trpac", "trpac_cli", "trpac_core", "trpac_hil")


def main() -> None:
    """Run the command line; exits with 2 where one of its packages is missing, with 143 after SIGTERM."""
    signal.signal(signal.SIGTERM, _leave)
    os.environ.setdefault("MPLBACKEND", "Agg")  # files are drawn, no windows
    try:
        from trpac_cli.main import app

        app()
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module in OURS:
            raise
        text = (
            missing(error) or f"needs the package '{module}', which is not installed: pip install trpac-fmu"
        )
        print(f"trpac: {text}", file=sys.stderr)
        sys.exit(2)
    except MissingExtraError as error:
        print(f"trpac: {error}", file=sys.stderr)
        sys.exit(2)


def _leave(number: int, _: object) -> NoReturn:
    """Exit as after an exception, so that temporary folders are removed and files restored."""
    sys.exit(128 + number)
