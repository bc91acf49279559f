"""Every report in a real browser: on a phone and on a screen, light and dark."""

from dataclasses import replace
from pathlib import Path

import made_up_diagnosis as made_up
import numpy as np
import pytest
import yaml
from browser import plots_page, problems, require_chromium
from log_maker import make_frame
from report_page import require_report

import trpac
from benchmarks.accuracy.full_run import full_run
from scenarios.report import write_report as write_run_report
from scenarios.runner import summarise
from scenarios.sweep.draw import plan_run, run_keys
from scenarios.sweep.execute import Failure, run_one
from scenarios.sweep.files import load_sweep
from scenarios.sweep.outcome import outcome
from scenarios.sweep.report import write_report as write_sweep_report
from scenarios.sweep.store import as_table
from scenarios.sweep.summary import summarise as summarise_sweep
from sim2real.reporting.report import rated, render
from trpac_core.estimator_data import Method

ROOT = Path(__file__).parents[2]
SHORT = {
    "schema": 1,
    "name": "short",
    "description": "Two stretches of three metres.",
    "scenario": str(ROOT / "scenarios" / "paper_simulation.yaml"),
    "runs": 2,
    "estimators": ["IFE", "DE", "DIFE", "robust"],
    "road": {"stretch_m": 3.0, "friction": {"dry": [0.7, 1.0], "snow_ice": [0.2, 0.35]}},
    "pedal": {},
}


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """All reports, with and without failures: by name."""
    folder = tmp_path_factory.mktemp("reports")
    (folder / "sweep.yaml").write_text(yaml.safe_dump(SHORT))
    sweep = load_sweep(folder / "sweep.yaml")
    plan = plan_run(sweep, run_keys(sweep)[0])
    run = full_run(plan)
    summary = summarise(plan.scenario, run.table, folder / "sweep.yaml", Method.ROBUST)
    write_run_report(replace(run, summary=summary), None, folder / "run.html")
    table = as_table(row for key in run_keys(sweep) for row in run_one(sweep, key).rows)
    table["convergence_time_s"] = np.where(table["run"] == 1, np.nan, 0.2)
    table["shown_s"] = table["shown_s"].clip(1.0)
    became = outcome(table, [Failure(2, "ValueError: DIFE gives an estimate that is no finite number.")])
    write_sweep_report(sweep, table, summarise_sweep(table), became, folder / "sweep.html")
    varied = table.assign(parameter="camera.wrong_share", level=table["run"] * 0.5)
    became = outcome(varied, [])
    write_sweep_report(sweep, varied, summarise_sweep(varied), became, folder / "sweep_varied.html")
    trpac.estimate(make_frame(duration_s=3.0)).to_html(folder / "estimate.html")
    for name in ("identified", "unknown", "ambiguous", "no_gap"):
        diagnosis = made_up.ALL[name]()
        diagnosis = rated(replace(diagnosis, traces=diagnosis.traces[:2]))
        (folder / f"gap_{name}.html").write_text(render(diagnosis))
    return {path.stem: path for path in sorted(folder.glob("*.html"))}


def test_every_report_is_one_page_that_needs_nothing_beside_it(reports):
    assert len(reports) == 8
    for name, path in reports.items():
        page = require_report(path.read_text())
        assert page.specs, name
        assert path.stat().st_size < 8_000_000, name


def test_every_report_says_its_failures_first(reports):
    said = {name: require_report(path.read_text()).verdict for name, path in reports.items()}
    assert said["run"].startswith(("0.", "1 "))
    assert said["estimate"].startswith("At the end: ")
    assert said["sweep"] == "Of 3 runs: 1 never converged (robust), 1 failed with an error."
    assert "no effect of the library explains it" in said["gap_unknown"]


@pytest.mark.long
def test_every_report_can_be_read_on_a_phone_and_in_the_dark(reports):
    require_chromium()
    assert problems(reports.items()) == []


@pytest.mark.long
def test_the_bar_of_a_plot_covers_no_data(reports):
    require_chromium()
    with plots_page(reports["estimate"]) as canvas:
        place, bar = canvas.bounding_box(), canvas.locator(".modebar")
        opacity = "bar => getComputedStyle(bar).opacity"
        assert bar.evaluate(opacity) == "0"
        canvas.hover()
        canvas.page.wait_for_function(
            "bar => getComputedStyle(bar).opacity === '1'", arg=bar.element_handle()
        )
        over = bar.bounding_box()
        assert over["y"] + over["height"] <= place["y"]
        bar.locator(".modebar-btn").last.click()


@pytest.mark.long
def test_the_browser_check_sees_what_is_wrong(tmp_path):
    require_chromium()
    bad = tmp_path / "bad.html"
    bad.write_text(
        '<!doctype html><html lang="en"><title>t</title><meta name="viewport" content="width=device-width">'
        '<main><h1 style="color:#bbb;background:#fff">pale</h1><div style="width:2000px">wide</div>'
        '<img src="https://example.org/a.png"></main></html>'
    )
    found = " ".join(problems([("bad", bad)]))
    for word in ("px wide", "color-contrast", "image-alt", "asks for https://example.org/a.png"):
        assert word in found
