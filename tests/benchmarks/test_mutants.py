"""Faults that are put into code one at a time: where, and which of them tests find."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.robustness.mutants.faults import every, sample

ROOT = Path(__file__).parents[2]
SOURCE = '''"""Motion."""

from numba import njit

GRAVITY_M_S2 = 9.81


def fallen_m(time_s: float) -> float:
    """Height that is lost [m]."""
    if time_s < 0.0:
        raise ValueError(f"{time_s} s")
    return 0.5 * GRAVITY_M_S2 * time_s * time_s


def unseen(number: int) -> int:
    return number + 1


def endless(number: int) -> int:
    while number > 0:
        number -= 1
    return number


@njit
def doubled(number: float) -> float:
    return 2.0 * number
'''
TESTS = """import subprocess, sys
import pytest
from motion.fall import doubled, endless, fallen_m

def test_fall():
    assert fallen_m(2.0) == pytest.approx(19.62)

def test_endless():
    assert endless(3) == 0

def test_doubled():
    assert doubled(3.0) == 6.0

def test_refusal_in_another_process():
    code = "from motion.fall import fallen_m; fallen_m(-1.0)"
    assert b"ValueError" in subprocess.run([sys.executable, "-c", code], capture_output=True).stderr
"""


@pytest.fixture
def tree(tmp_path):
    root = tmp_path / "root"
    for name, text in (("motion/__init__.py", ""), ("motion/fall.py", SOURCE), ("tests/test_fall.py", TESTS)):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    return root


def test_each_fault_is_one_change_of_code_and_none_of_words(tree):
    mutants = every(tree, ["motion/fall.py"])
    whole = SOURCE.encode()
    for mutant in mutants:
        faulty = mutant.source(whole)
        assert ast.dump(ast.parse(faulty)) != ast.dump(ast.parse(whole))
        assert '"""Motion."""' in faulty.decode()
    assert {m.place.kind for m in mutants} == {
        "constant", "comparison", "condition", "operator", "removed", "returned"
    }  # fmt: skip
    assert {m.place.function for m in mutants if m.place.compiled} == {"doubled"}


def test_a_sample_repeats_with_its_seed(tree):
    names = [[m.name for m in sample(tree, ["motion"], 8, seed)] for seed in (1, 1, 2)]
    assert names[0] == names[1] != names[2]
    assert all(len(set(n)) == 8 for n in names)


@pytest.mark.long
def test_what_the_tests_find_and_what_they_do_not(tree, tmp_path):
    out = tmp_path / "mutants.jsonl"
    command = [sys.executable, "-m", "benchmarks.robustness.mutants", "motion", "--tests", "tests"]
    command += ["--root", tree, "--count", "1000", "--out", out, "--hangs-s", "5"]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    outcomes = {}
    for line in out.read_text(encoding="utf-8").splitlines():
        told = json.loads(line)
        outcomes.setdefault(told["identity"][1], set()).add(told["outcome"])
    assert outcomes == {
        "": {"killed"},
        "fallen_m": {"killed", "survives"},  # no test says what a time of 0 is
        "unseen": {"survives"},  # no test calls it
        "endless": {"killed", "hangs"},
        "doubled": {"killed"},
    }
    assert (tree / "motion/fall.py").read_text(encoding="utf-8") == SOURCE
