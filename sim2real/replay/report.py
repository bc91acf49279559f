"""estimates.csv, summary.json and report.html: what a replay says, for machines and for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.html_page import data_address, page
from scenarios.whole_files import written_whole
from sim2real.replay import figures
from sim2real.replay.run import DYNAMICS, Replay
from sim2real.reporting.report import DASH, jsonable
from trpac_core.estimator_data import Method, Source
from trpac_core.vehicle import WHEELS

TEMPLATE = Path(__file__).with_name("report.html.jinja")
CSV_NAME, SUMMARY_NAME, REPORT_NAME = "estimates.csv", "summary.json", "report.html"
HARDLY = 0.01
"""Share of the driving below which the tyre counts as not seen [-]."""
WIDE_STD = 0.15
"""Mean standard deviation above which an estimate says little [-]."""


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
        "TRPAC_source": _labels(np.bitwise_or.reduce(done.source, axis=1)),
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
    pictures = {
        "estimate": data_address(figures.estimate(done)),
        "wheels": data_address(figures.wheels(done)),
        "curve": data_address(figures.curve(done)),
    }
    if len(done.traces) > 2:
        pictures["compared"] = data_address(figures.compared(done))
    return page(
        TEMPLATE,
        {"number": number, "percent": percent},
        s=summary,
        pictures=pictures,
        verdict=verdict(summary),
        ours=done.method.title,
        interval=done.method is Method.ROBUST,
        dynamics=DYNAMICS,
    )


def verdict(summary: dict[str, Any]) -> str:
    """What the log showed, in sentences that follow from its numbers."""
    said, driven = summary["excitation"], summary["estimate"]
    sentences = [
        f"The car drove for {said['driven_s']:.1f} s; "
        f"the tyres showed the road for {percent(said['seen_share'])} of it."
    ]
    if said["seen_share"] < HARDLY and said["camera_share"] < HARDLY:
        sentences.append(
            "So the estimate is hardly more than its start value: brake or accelerate harder, up to a slip of 0.02."
        )
    sentences.append(
        f"TRPAC at the end is {driven['TRPAC_end']:.2f} with a standard deviation of {driven['TRPAC_std_end']:.2f}."
    )
    if driven["mean_std_seen"] is not None and driven["mean_std_seen"] > WIDE_STD:
        sentences.append("Its deviation is wide even where the tyre is seen: take it as a hint.")
    ours = Method.of(summary["method"]).title
    error = (summary["errors"] or {}).get(ours, {}).get("seen", {})
    if error.get("mean_abs") is not None:
        sentences.append(
            f"Where the tyre is seen, TRPAC_peak is {error['mean_abs']:.3f} off the reference in the mean, and "
            f"{percent(error['within_2_std'])} of these rows lie within two standard deviations."
        )
    return " ".join(sentences)


def number(value: float | None, digits: int = 3) -> str:
    """A number as the tables show it; a dash where there is none."""
    return DASH if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def percent(share: float | None) -> str:
    """A share of 1 as per cent."""
    return DASH if share is None or not np.isfinite(share) else f"{100.0 * share:.0f} %"
