"""Causes of long delays, on threads that the test holds up in a known way."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from shared_core import busy

from trpac_hil.delays import SCHEDULER_FILE, Spent, ThreadAccounts, cause

MS = 1_000_000
needs_linux = pytest.mark.skipif(not SCHEDULER_FILE.exists(), reason="this system has no schedstat")


def test_without_the_systems_accounts_nothing_is_claimed() -> None:
    assert cause(Spent(0, 0), Spent(9 * MS, MS), 0) == "untold"


@pytest.mark.parametrize(
    ("ended", "slept_ns", "expected"),
    [
        (Spent(9 * MS, 8 * MS, 0, 0), 0, "own_work"),
        (Spent(9 * MS, MS, 8 * MS, 0), 0, "other_work"),
        (Spent(9 * MS, MS, 0, 0), 0, "machine"),
        (Spent(9 * MS, MS, 0, 1), 0, "waiting"),
        (Spent(19 * MS, MS, 0, 1), 10 * MS, "machine"),
        (Spent(19 * MS, MS, 0, 2), 10 * MS, "waiting"),
        (Spent(19 * MS, 5 * MS, 2 * MS, 1), 10 * MS, "own_work"),
    ],
)
def test_the_greatest_part_beside_the_sleep_names_the_cause(
    ended: Spent, slept_ns: int, expected: str
) -> None:
    assert cause(Spent(0, 0, 0, 0), ended, slept_ns) == expected


TRIES = 20
"""Stretches of which one at least has to be undisturbed: a busy machine may queue a thread longer than it works."""


@needs_linux
def test_a_thread_that_works_is_told_from_one_that_waits_for_a_lock() -> None:
    working, waiting = [], []
    with ThreadAccounts() as accounts:
        for _ in range(TRIES):
            began = accounts.spent()
            busy(0.05)
            worked = accounts.spent()
            threading.Event().wait(0.05)
            working.append(cause(began, worked, 0))
            waiting.append(cause(worked, accounts.spent(), 0))
    assert "own_work" in working
    assert "waiting" in waiting
    assert "own_work" not in waiting


@needs_linux
def test_a_sleep_that_was_asked_for_is_no_delay_of_anybody() -> None:
    causes = []
    with ThreadAccounts() as accounts:
        for _ in range(TRIES):
            began = accounts.spent()
            time.sleep(0.05)
            busy(0.03)
            causes.append(cause(began, accounts.spent(), 50 * MS))
    assert "own_work" in causes


@needs_linux
def test_two_that_share_a_core_hold_each_other_up() -> None:
    code = "from shared_core import share_a_core; print(share_a_core())"
    support = Path(__file__).parents[1] / "support"
    told = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=support, check=True
    )
    assert told.stdout.strip() == "other_work"
