"""fmpy behind a pipe: answers the commands of client.c on standard output."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .transports import Fmpy


def main() -> None:
    client = Fmpy(Path(sys.argv[1]))
    for line in sys.stdin:
        status, value, log = client.ask(line.rstrip("\n"))
        print(*(f"log {said}" for said in log), f"= {status} {value}", sep="\n", flush=True)
    os._exit(0)  # see "Limits" in docs/reference/unit.md


if __name__ == "__main__":
    main()
