"""Work for a thread, alone or beside another process on its core."""

from __future__ import annotations

import os
import subprocess
import sys
import time

from trpac_hil.delays import ThreadAccounts, cause


def busy(duration_s: float) -> None:
    """Work until the thread itself has had so much processor time."""
    end_s = time.thread_time() + duration_s
    while time.thread_time() < end_s:
        continue


def share_a_core() -> str:
    """What a thread of low priority was held up by, while another process worked on its core."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other, ThreadAccounts() as accounts:
        time.sleep(0.5)
        os.nice(10)
        began = accounts.spent()
        busy(0.1)
        ended = accounts.spent()
        other.kill()
    return cause(began, ended, 0)
