"""estimates.csv, summary.json and report.html: what a replay says, for machines and for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios import known
from scenarios.html_page import page, percent
from scenarios.whole_files import written_whole
from sim2real.replay import figures
from sim2real.replay.run import DYNAMICS, Replay
from sim2real.reporting.report import jsonable
from trpac_core.estimator_data import Method, Source
from trpac_core.vehicle import WHEELS

TEMPLATE = Path(__file__).with_name("report.html.jinja")
CSV_NAME, SUMMARY_NAME, REPORT_NAME = "estimates.csv", "summary.json", "report.html"


def estimates_table(done: Replay) -> pd.DataFrame:
    """estimates.csv: the car's estimate, TRPAC per wheel, TRPAC_peak, the deviation per wheel, interval and source."""
    ours = done.ours
    theta, std, peak = ours.of_the_car
    flags = done.flag.any(axis=1), ours.excited.any(axis=1)
    columns: dict[str, Any] = {
        "time_s": done.inputs.time_s,
        "TRPAC": theta,
        "TRPAC_std": std,
        "flag": flags[0].astype(int),
        "K_v": done.K_v.max(axis=1),
        "excitation_flag": flags[1].astype(int),
        **{f"TRPAC_{w}": ours.theta[:, i] for i, w in enumerate(WHEELS)},
        "TRPAC_peak": peak,
        **{f"TRPAC_std_{w}": ours.std[:, i] for i, w in enumerate(WHEELS)},
        **done.of_the_car,
        "TRPAC_source": _labels(done.source_of_the_car),
        **{f"TRPAC_low_{w}": done.low[:, i] for i, w in enumerate(WHEELS)},
        **{f"TRPAC_high_{w}": done.high[:, i] for i, w in enumerate(WHEELS)},
        **{f"TRPAC_source_{w}": _labels(done.source[:, i]) for i, w in enumerate(WHEELS)},
    }
    for name, trace in done.traces.items():
        if name not in (done.method.title, DYNAMICS):
            columns[f"TRPAC_{name.replace('-', '_')}"] = trace.of_the_car[0]
    return pd.DataFrame(columns)


def _labels(source: NDArray[np.int_]) -> list[str]:
    """Words for what estimates rest on."""
    return [Source(value).label for value in source.tolist()]


def write_replay(done: Replay, summary: dict[str, Any], folder: Path) -> tuple[Path, ...]:
    """Write all three files; they are made whole beside the folder first, so it never holds half a result.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    with written_whole(folder) as made:
        estimates_table(done).to_csv(made / CSV_NAME, index=False, float_format="%.6g")
        text = json.dumps(jsonable(summary), indent=1, allow_nan=False)
        (made / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
        (made / REPORT_NAME).write_text(render(done, summary), encoding="utf-8")
    return tuple(folder / name for name in (REPORT_NAME, CSV_NAME, SUMMARY_NAME))


def render(done: Replay, summary: dict[str, Any]) -> str:
    """The report as one HTML page that needs nothing beside it."""
    return page(
        TEMPLATE,
        s=summary,
        estimate=figures.estimate(done),
        wheels=figures.wheels(done),
        curve=figures.curve(done),
        compared=figures.compared(done) if len(done.traces) > 2 else None,
        sentences=sentences(summary),
        ours=done.method.title,
        interval=done.method is Method.ROBUST,
    )


def verdict(summary: dict[str, Any]) -> str:
    """What the log showed, in sentences that follow from its numbers."""
    return " ".join(sentences(summary))


def sentences(summary: dict[str, Any]) -> list[str]:
    """Whether the estimate can be trusted; the estimate at the end; what the tyres showed; its errors."""
    said, driven, method = summary["excitation"], summary["estimate"], Method.of(summary["method"])
    theta, std, low, high = (driven[f"{n}_end"] for n in ("TRPAC", "TRPAC_std", "TRPAC_low", "TRPAC_high"))
    source = Source[driven["TRPAC_source_end"].upper()]
    first, *why = known.sentences(theta, std, *known.interval(method, theta, std, low, high), source)
    found = [f"At the end: {first}", *why]
    if not summary.get("torque_fits_car", True):
        found[0] = f"The estimate cannot be trusted: the logged torque does not fit the car. {found[0]}"
    share = percent(said["seen_share"])
    shown = f"The car drove for {said['driven_s']:.1f} s; the tyres showed the road for {share} of it"
    if not said["excited_share"]:
        shown += (
            ", since no tyre slipped above its threshold: brake or accelerate harder, up to a slip of 0.02"
        )
    bound = driven["lower_bound_share"]
    bounded = f"; only a lower bound was known for {percent(bound)}" if bound else ""
    found.append(f"{shown}. TRPAC was known for {percent(driven['known_share'])} of it{bounded}.")
    error = (summary["errors"] or {}).get(method.title, {}).get("seen", {})
    if error.get("mean_abs") is not None:
        found.append(
            "Where the tyres showed the road, the mean absolute error of TRPAC_peak against the reference is "
            f"{error['mean_abs']:.3f}, and {percent(error['within_2_std'])} of these rows lie within two standard "
            "deviations."
        )
    return found
