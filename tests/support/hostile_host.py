"""Commands run in forks of one process that has everything loaded, with their time and memory; see `commands.Host`."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any, NoReturn

LIMIT_S = 60


def run(order: dict[str, Any]) -> dict[str, Any]:
    """What became of a command: exit code (negative: a signal), processor seconds, most memory [MB], what it said."""
    out, errors = Path(order["folder"], "said_out"), Path(order["folder"], "said_err")
    process = os.fork()
    if process == 0:
        _become(order["arguments"], order["folder"], out, errors)
    _, status, used = os.wait4(process, 0)
    return {
        "exit": os.waitstatus_to_exitcode(status),
        "seconds": used.ru_utime + used.ru_stime,
        "megabytes": used.ru_maxrss / 1024.0,
        "out": out.read_text(errors="replace"),
        "err": errors.read_text(errors="replace"),
    }


def _become(arguments: list[str], folder: str, out: Path, errors: Path) -> NoReturn:
    code = 1
    try:
        signal.alarm(LIMIT_S)
        os.chdir(folder)
        for descriptor, path in ((1, out), (2, errors)):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), descriptor)
        sys.argv = ["trpac", *arguments]
        from trpac_cli.entry import main

        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001 - as an interpreter ends, whatever it is
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def main() -> None:
    """Read one order a line, answer one line each."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name in (
        "trpac_cli.main",
        "sim2real.replay.run",
        "scenarios.stills",
        "scenarios.runner",
        "trpac_hil.codec",
    ):
        __import__(name)
    for line in sys.stdin:
        print(json.dumps(run(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
