"""All figures of lab/2026-11-29_fusion_over_many_drives.md, from folders of the shipped sweeps.

``python -m benchmarks.accuracy.fusion_tables out/fusion`` writes their tables between the markers of the page, and the
pictures beside it. It takes sweeps that are not finished too, and says how many runs each table rests on.
"""

import argparse
import json
from collections.abc import Iterator
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.accuracy import oracle
from benchmarks.accuracy.full_run import full_run
from benchmarks.report import markdown, write_between
from scenarios.figure17 import draw_figure17
from scenarios.plots import png
from scenarios.sweep import figures
from scenarios.sweep.draw import plan_run, run_keys
from scenarios.sweep.files import load_sweep
from scenarios.sweep.store import Parts
from scenarios.sweep.summary import distribution, shown_enough, slippery, summarise

ROOT = Path(__file__).resolve().parents[2]
SWEEPS = ROOT / "scenarios" / "sweeps"
PAGE, PICTURES = ROOT / "lab" / "2026-11-29_fusion_over_many_drives.md", ROOT / "lab" / "fusion"
NAMES = ("methods", "paper_simulation", "peers", "road_test", "road_test_brakes", "degradation")
DASH = "–"
LEAST_RUNS = 5
"""Levels with fewer runs are left out of tables and pictures."""
FRICTION_EDGES = (0.1, 0.15, 0.25, 0.35, 0.4, 0.45, 0.5, 0.55)
DEFAULT = "robust"
OURS = ("IFE", "DE", "as_printed", "DIFE", DEFAULT)
"""Estimators of ours, in the tables' order."""
ORACLE_RUNS = 200
"""Of the paper's road."""


def collected(folder: Path) -> dict[str, Any]:
    """What a sweep's folder holds: its table, how many runs of how many, processor time, code."""
    described = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    parts = Parts(folder, described)
    table = parts.table()
    if (table["parameter"] != "").any():
        runs_of_level = table.groupby(["parameter", "level"])["run"].transform("nunique")
        table = table[runs_of_level >= LEAST_RUNS]
    file = described["sweep"]
    asked = file["runs"] * max(1, sum(len(axis["levels"]) for axis in file["vary"]))
    cpu_s = parts.cpu_s()
    return {
        "table": table,
        "runs": int(table["run"].nunique()),
        "asked": asked,
        "cpu_s_per_run": float(np.median(cpu_s)),
        "camera": file["camera"]["source"],
    }


def cell(value: float | None, digits: int, missing: str = DASH) -> str:
    return missing if value is None else f"{value:.{digits}f}"


def pair(measure: dict[str, Any], digits: int, missing: str = DASH) -> str:
    return f"{cell(measure['median'], digits, missing)} / {cell(measure['percentile_95'], digits, missing)}"


def accuracy(found: dict[str, Any]) -> str:
    """Median / 95th percentile of error and times, by where the stretch lies and by surface."""
    table = found["table"]
    judged = shown_enough(slippery(table))
    groups = {
        "slippery, after a change of road": judged[judged["stretch"] > 0],
        "slippery, from standstill": judged[judged["stretch"] == 0],
    }
    rows = []
    for where, part in groups.items():
        for name in names_of(table):
            mine = distribution(part[part["estimator"] == name])
            rows.append(
                [
                    where,
                    name,
                    str(mine["stretches"]),
                    pair(mine["steady_state_error"], 4),
                    pair(mine["convergence_time_s"], 2, "never"),
                    pair(mine["shown_convergence_time_s"], 2, "never"),
                    pair(mine["wall_convergence_time_s"], 2, "never"),
                    pair(mine["band_time_s"], 2, "never"),
                ]
            )
    heads = [
        "stretches",
        "estimator",
        "number",
        "steady-state error",
        "5 % of the step, excited [s]",
        "shown [s]",
        "elapsed [s]",
        "within 0.02, excited [s]",
    ]
    return markdown(heads, rows)


def by_friction(found: dict[str, Any]) -> str:
    """The default after a change of road over true friction: where errors and slow convergence come from."""
    table = found["table"]
    judged = shown_enough(slippery(table[(table["estimator"] == DEFAULT) & (table["stretch"] > 0)]))
    rows = []
    for low, high in pairwise(FRICTION_EDGES):
        mine = distribution(judged[(judged["theta"] >= low) & (judged["theta"] < high)])
        measures = (
            pair(mine["steady_state_error"], 4),
            pair(mine["convergence_time_s"], 2, "never"),
            pair(mine["band_time_s"], 2, "never"),
        )
        rows.append([f"{low:g} to {high:g}", str(mine["stretches"]), *measures])
    heads = ["true friction", "stretches", "steady-state error", "5 % of the step [s]", "within 0.02 [s]"]
    return markdown(heads, rows)


def names_of(table: Any) -> list[str]:
    """Estimators in a table, ours first."""
    own = [n for n in OURS if n in set(table["estimator"])]
    return own + sorted(set(table["estimator"]) - set(own))


def not_shown(found: dict[str, Any]) -> str:
    """Where nothing could be seen: how many stretches, and how far off the estimate stays there."""
    slick = slippery(found["table"])
    rows = []
    for surface, part in slick.groupby("surface"):
        for name in names_of(part):
            mine = part[part["estimator"] == name]
            dark = mine[mine["shown_s"] < 0.5]
            error = f"{np.average(dark['error_mean'], weights=dark['time_s']):.3f}" if len(dark) else DASH
            rows.append([str(surface), name, f"{len(dark)} of {len(mine)}", error])
    return markdown(["surface", "estimator", "stretches not shown", "mean error there"], rows)


def coverage_rows(found: dict[str, dict[str, Any]]) -> str:
    rows = []
    for sweep, part in found.items():
        for name in names_of(part["table"]):
            of = (
                summarise(part["table"][part["table"]["parameter"] == ""])["levels"]
                if sweep != "degradation"
                else []
            )
            for level in of:
                estimator = level["estimators"].get(name)
                if estimator is None or estimator["coverage"] is None:
                    continue
                whole = estimator["coverage"]
                rows.append([sweep, name, "all", *(cell(whole[k], 3) for k in KINDS)])
                for surface, mine in estimator["coverage_by_surface"].items():
                    if mine is not None:
                        rows.append([sweep, name, surface, *(cell(mine[k], 3) for k in KINDS)])
    return markdown(["sweep", "estimator", "road", "all time", "while shown", "end of stretch"], rows)


KINDS = ("all_time", "while_shown", "at_the_end_of_a_stretch")


def table_5(found: dict[str, dict[str, Any]]) -> str:
    """The paper's Table 5: condition, method, steady-state error, convergence."""
    rows = []
    for sweep in ("paper_simulation", "road_test", "road_test_brakes"):
        if sweep not in found:
            continue
        table = found[sweep]["table"]
        judged = slippery(table) if sweep == "paper_simulation" else table
        judged = shown_enough(judged)
        judged = judged[judged["stretch"] > 0] if sweep == "paper_simulation" else judged
        for name in names_of(table):
            mine = distribution(judged[judged["estimator"] == name])
            times = [
                pair(mine[k], 2, "never") if mine["stretches"] else DASH
                for k in ("convergence_time_s", "shown_convergence_time_s", "wall_convergence_time_s")
            ]
            whole = slippery(table) if sweep == "paper_simulation" else table
            whole = whole[whole["estimator"] == name]
            mean = f"{np.average(whole['error_mean'], weights=whole['time_s']):.3f}"
            rows.append([sweep, name, pair(mine["steady_state_error"], 3), *times, mean])
    heads = [
        "condition",
        "method",
        "steady-state error",
        "convergence, excited [s]",
        "shown [s]",
        "elapsed [s]",
        "mean, all time",
    ]
    return markdown(heads, rows)


def papers_road(found: dict[str, Any]) -> str:
    """All methods, the peers and the oracle on the paper's road of 0.9, 0.3 and 0.5."""
    table, sweep = found["table"], load_sweep(SWEEPS / "methods.yaml")
    told = [oracle.oracle_rows(plan_run(sweep, key)) for key in run_keys(sweep)[:ORACLE_RUNS]]
    table = pd.concat([table, pd.DataFrame(chain.from_iterable(told))])
    rows = []
    for name in names_of(table):
        mine = table[table["estimator"] == name]
        cells = []
        for surface in ("snow_ice", "wet"):
            of = distribution(mine[mine["surface"] == surface])
            cells.append(pair(of["steady_state_error"], 4))
            cells.append(pair(of["shown_convergence_time_s"], 2, "never"))
        rows.append([name, str(mine["run"].nunique()), *cells])
    heads = ["method", "runs", "0.3: steady error", "0.3: time [s]", "0.5: steady error", "0.5: time [s]"]
    return markdown(heads, rows)


def degradation(found: dict[str, Any]) -> str:
    rows = []
    for level in summarise(found["table"])["levels"]:
        for name, mine in level["estimators"].items():
            shown, covered = mine["shown"], mine["coverage"]
            rows.append(
                [
                    f"{level['parameter']} {level['level']:g}",
                    str(level["runs"]),
                    name,
                    pair(shown["steady_state_error"], 3),
                    pair(shown["band_time_s"], 2, "never"),
                    cell(mine["mean_error_slippery"], 3),
                    cell(covered["all_time"] if covered else None, 2),
                ]
            )
    heads = [
        "level",
        "runs",
        "estimator",
        "steady-state error",
        "within 0.02 [s]",
        "mean error, all time",
        "in 2 std",
    ]
    return markdown(heads, rows)


def blocks(found: dict[str, dict[str, Any]]) -> Iterator[str]:
    """The page's measured part."""
    state = ", ".join(f"{n} {f['runs']} of {f['asked']}" for n, f in found.items())
    cpu = ", ".join(f"{n} {f['cpu_s_per_run']:.2f} s ({f['camera']})" for n, f in found.items())
    yield f"Runs: {state}. Processor time per run: {cpu}. Each pair is median / 95th percentile."
    yield "### In the form of Table 5\n\n" + table_5(found)
    if "methods" in found:
        yield "### The paper's own road\n\n" + papers_road(found["methods"])
    if "paper_simulation" in found:
        yield "### The simulation condition\n\n" + accuracy(found["paper_simulation"])
        yield f"`{DEFAULT}` after a change of road, by true friction:\n\n" + by_friction(
            found["paper_simulation"]
        )
        yield "Where the tyre never showed its friction for 0.5 s:\n\n" + not_shown(found["paper_simulation"])
    if "peers" in found:
        yield "### Peers, on the first of these roads\n\n" + accuracy(found["peers"])
    yield "### Coverage of 2 TRPAC_std\n\n" + coverage_rows(found)
    if "degradation" in found:
        yield "### Degradation\n\n" + degradation(found["degradation"])


def write(out: Path) -> None:
    """The page's measured part, and its pictures."""
    found = {n: collected(out / n) for n in NAMES if any((out / n / "parts").glob("*.json"))}
    if not found:
        raise SystemExit(f"{out}: no sweep there; run `trpac sweep {NAMES[0]} --out {out / NAMES[0]}` first")
    write_between(PAGE, "\n\n".join(blocks(found)))
    draw(found)


def draw(found: dict[str, dict[str, Any]]) -> None:
    """The page's pictures: both drives in the form of Figures 17 and 19, distributions, coverage."""
    PICTURES.mkdir(exist_ok=True)
    for name in ("road_test", "road_test_brakes"):
        sweep = load_sweep(SWEEPS / f"{name}.yaml")
        draw_figure17(full_run(plan_run(sweep, run_keys(sweep)[0])), PICTURES / f"{name}.png")
    if "paper_simulation" in found:
        table = found["paper_simulation"]["table"]
        (PICTURES / "distributions.png").write_bytes(png(figures.distributions(table)))
        (PICTURES / "errors.png").write_bytes(png(figures.errors_by_friction(table)))
        (PICTURES / "coverage.png").write_bytes(png(figures.coverage(table)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the sweeps' folders")
    write(parser.parse_args().out)
