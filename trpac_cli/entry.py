"""Where the command `trpac` begins: a package that is not installed is one sentence, not a traceback."""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

from trpac.extras import MissingExtraError, missing


def main() -> None:
    """Run the command line; exits with 2 where one of its packages is missing, with 143 after SIGTERM."""
    signal.signal(signal.SIGTERM, _leave)
    os.environ.setdefault("MPLBACKEND", "Agg")  # files are drawn, no windows
    try:
        from trpac_cli.main import app

        app()
    except ModuleNotFoundError as error:
        text = missing(error)
        if text is None:
            raise
        print(f"trpac: {text}", file=sys.stderr)
        sys.exit(2)
    except MissingExtraError as error:
        print(f"trpac: {error}", file=sys.stderr)
        sys.exit(2)


def _leave(number: int, _: object) -> NoReturn:
    """End as after any other error: passing folders are removed, files keep what they held."""
    sys.exit(128 + number)
