"""Tables, figure and page of the camera's scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.report import markdown, write_between
from scenarios.plot_style import BLUE, GREEN, INK
from trpac_core.vision.classes import Surface

from .judge import SCENARIOS, VARIANTS, VOTING
from .scores import Share, blocks_of, confusion, gate, method_of, n_w, recalls

ROOT = Path(__file__).resolve().parents[3]
PAGE, FIGURE = ROOT / "lab" / "2026-11-29_camera_scores.md", ROOT / "lab" / "camera_scores.png"
PAPER = {("normal", VOTING): 21.6621, ("normal", "IFE"): 1.5327, ("w/ interference", VOTING): 31.4714,
         ("w/ interference", "IFE"): 12.8406}  # fmt: skip
CLIPS, SETS, STILLS, PARTS, RENDERED = (
    "(a) clips",
    "(a) sets",
    "other cameras",
    "validation parts",
    "(b) rendered",
)
SAID = {
    CLIPS: "(a) real clips, consecutive, source left out",
    SETS: "(a) real drives, not at frame rate, source left out",
    STILLS: "stills of other cameras, never trained on",
    PARTS: "clips' validation parts, rest of the clip in training",
    RENDERED: "(b) rendered drives over class changes",
}


@dataclass(frozen=True)
class Measured:
    """A run: verdicts per frame, what was missing, frame times, processor time, networks."""

    table: pd.DataFrame
    missing: tuple[str, ...]
    time: dict[str, Any] | None
    render_cpu_min: float
    judge_cpu_min: float
    networks: dict[str, dict[str, str]]


def groups(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The sets of sequences that are scored together."""
    real, full = table["part"] != "", table["networks"] == "full"
    stills = table["source"].str.startswith("other cameras")
    chosen = {
        CLIPS: real & ~full & table["consecutive"],
        SETS: real & ~full & ~table["consecutive"],
        STILLS: stills & full,
        PARTS: real & full & ~stills & (table["part"] == "val"),
        RENDERED: ~real,
    }
    for name, rows in chosen.items():
        if rows.any():
            yield name, table[rows]


def tables(measured: Measured) -> str:
    """All tables as Markdown."""
    named = dict(groups(measured.table))
    parts = [
        ("Table 4", _table_4(named)),
        ("Each source", _sources(named)),
        ("Class borders", _borders(named)),
        ("Each part switched off", _ablations(named)),
        ("What the flag is worth", _gates(named)),
        ("Recall and confusion", _confusions(named)),
        ("Frame time", _times(measured.time)),
        ("How it was measured", _how(measured)),
    ]
    found = (f"## {title}\n\n{text}" for title, text in parts if text)
    return "\n\n".join([*_warning(measured), *found]) + "\n"


def _warning(measured: Measured) -> list[str]:
    """What the reader must know before the first figure."""
    if not measured.missing:
        return []
    return [f"**No rows, for want of networks that never saw the source**: {'; '.join(measured.missing)}."]


def _in(table: pd.DataFrame, scenario: str, method: str) -> pd.DataFrame:
    return method_of(table[table["scenario"] == scenario], method)


def _table_4(named: dict[str, pd.DataFrame]) -> str:
    rows = [
        (
            scenario,
            method,
            f"{PAPER[scenario, method]:.1f}",
            *(n_w(_in(t, scenario, method)) for t in named.values()),
        )
        for scenario in SCENARIOS
        for method in (VOTING, "IFE")
    ]
    frames = ("", "frames (blocks)", "", *(f"{s.frames} ({s.blocks})" for s in map(_size, named.values())))
    heads = ("scenario", "method", "paper", *(SAID[name] for name in named))
    return markdown(heads, [*rows, frames])


def _size(table: pd.DataFrame) -> Share:
    return n_w(_in(table, "normal", "IFE"))


def _sources(named: dict[str, pd.DataFrame]) -> str:
    rows = []
    for name, table in named.items():
        for source, part in table.groupby("source", sort=False):
            size = _size(part)
            scores = (
                n_w(_in(part, scenario, method)) for scenario in SCENARIOS for method in (VOTING, "IFE")
            )
            rows.append((SAID[name].split(",")[0], source, f"{size.frames} ({size.blocks})", *scores))
    heads = [f"{method}, {scenario}" for scenario in SCENARIOS for method in (VOTING, "IFE")]
    return markdown(("set", "source", "frames (blocks)", *heads), rows)


def _borders(named: dict[str, pd.DataFrame]) -> str:
    if RENDERED not in named:
        return ""
    rows = []
    for scenario in SCENARIOS:
        for method in (VOTING, "IFE"):
            table = _in(named[RENDERED], scenario, method)
            mixed = table["share"] < 1.0
            rows.append((scenario, method, n_w(table[~mixed]), n_w(table[mixed]), int(mixed.sum())))
    heads = ("scenario", "method", "one class in the near group", "two classes in it", "frames with two")
    return markdown(heads, rows)


def _ablations(named: dict[str, pd.DataFrame]) -> str:
    kept = {name: named[name] for name in (CLIPS, SETS, RENDERED) if name in named}
    rows = [
        (scenario, variant, *(cell for t in kept.values() for cell in _variant(t, scenario, variant)))
        for scenario in SCENARIOS
        for variant in VARIANTS
    ]
    heads = [h for name in kept for h in (f"{name}: n_w", "less IFE's")]
    return markdown(("scenario", "variant", *heads), rows)


def _variant(table: pd.DataFrame, scenario: str, variant: str) -> tuple[object, object]:
    own, whole = _in(table, scenario, variant), _in(table, scenario, "IFE")
    if variant == "IFE":
        return n_w(own), "-"
    return n_w(own), paired(own, whole)


def paired(own: pd.DataFrame, whole: pd.DataFrame, draws: int = 2000) -> str:
    """Difference of n_w on the same frames with its 95 % interval, bootstrap over blocks."""
    if own.empty:
        return "-"
    wrong = (own["found"] != own["truth"]).to_numpy(float) - (whole["found"] != whole["truth"]).to_numpy(
        float
    )
    _, inverse = np.unique(blocks_of(own), return_inverse=True)
    sums, sizes = np.bincount(inverse, wrong), np.bincount(inverse)
    drawn = np.random.default_rng(0).integers(0, len(sizes), (draws, len(sizes)))
    low, high = np.percentile(100.0 * sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1), [2.5, 97.5])
    return f"{100.0 * wrong.mean():+.1f} [{low:+.1f}, {high:+.1f}]"


def _gates(named: dict[str, pd.DataFrame]) -> str:
    rows = [
        (SAID[name].split(",")[0], scenario, *gate(_in(table, scenario, "IFE")).values())
        for name, table in named.items()
        for scenario in SCENARIOS
    ]
    heads = (
        "n_w, gate off: all frames",
        "n_w, gate on: flag 1",
        "of wrong frames, flag 0 [%]",
        "of right frames, flag 0 [%]",
    )
    return markdown(("set", "scenario", *heads), rows)


def _confusions(named: dict[str, pd.DataFrame]) -> str:
    rows = []
    for name, table in named.items():
        for scenario in SCENARIOS:
            part = _in(table, scenario, "IFE")
            counts = " / ".join(" ".join(map(str, row[: len(Surface)])) for row in confusion(part).tolist())
            rows.append((SAID[name].split(",")[0], scenario, *recalls(part).values(), counts))
    heads = (*(f"recall {s.label} [%]" for s in Surface), "confusion, rows true, dry wet snow_ice")
    return markdown(("set", "scenario", *heads), rows)


def _times(times: dict[str, Any] | None) -> str:
    if times is None:
        return ""
    rows = [
        (name, *(entry[key] for key in ("median_ms", "p99_ms", "processor_median_ms")))
        for name, entry in times.items()
        if isinstance(entry, dict)
    ]
    heads = ("1920 x 1200, both tracks", "median [ms]", "p99 [ms]", "processor, median [ms]")
    said = (
        f"{times['threads']} threads per network, {times['cpus']} processors, {times['frames']} frames; load of the "
        f"machine before the start {times['load_1min_before']:.1f}. Decoding is not in the estimator's rows."
    )
    return f"{markdown(heads, rows)}\n\n{said}"


def _how(measured: Measured) -> str:
    drives = measured.table.loc[measured.table["part"] == "", "sequence"].nunique()
    said = [
        f"{drives} rendered drives. Processor time: "
        f"{measured.render_cpu_min:.1f} min to draw the drives, {measured.judge_cpu_min:.1f} min "
        "in this run to judge (verdicts kept from a run before cost nothing).",
        "Networks: "
        + "; ".join(
            f"{name} {', '.join(f'{f} {s}' for f, s in files.items())}"
            for name, files in measured.networks.items()
        )
        + ".",
    ]
    return "\n\n".join(said)


def write_page(measured: Measured) -> None:
    """Write the tables between the page's markers, and the figure."""
    write_between(PAGE, tables(measured))
    draw(measured, FIGURE)


def draw(measured: Measured, path: Path) -> None:
    """n_w of both methods on every set, both scenarios, with intervals and the paper's figures."""
    from matplotlib.figure import Figure

    named = dict(groups(measured.table))
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    for axis, scenario in zip(figure.subplots(1, 2, sharey=True), SCENARIOS, strict=True):
        for offset, method, colour, hatch in (
            (-0.2, VOTING, GREEN.light, "//"),
            (0.2, "IFE", BLUE.light, ""),
        ):
            found = [n_w(_in(table, scenario, method)) for table in named.values()]
            at = np.arange(len(found)) + offset
            values = np.array([s.value for s in found])
            reach = np.array([[s.value - s.low for s in found], [s.high - s.value for s in found]])
            axis.bar(at, values, 0.38, color=colour, hatch=hatch, label=method)
            axis.errorbar(at, values, np.maximum(reach, 0.0), fmt="none", ecolor=INK.light, capsize=3, lw=1)
            axis.axhline(PAPER[scenario, method], color=colour, ls="--", lw=1.2)
            axis.text(len(found) - 0.5, PAPER[scenario, method], f"paper,\n{method}", va="bottom", fontsize=8)
        axis.set_xticks(range(len(named)), [name.replace(" ", "\n", 1) for name in named], fontsize=8)
        axis.set_title(scenario)
        axis.set_xlim(-0.6, len(named) + 0.2)
        axis.grid(axis="y", alpha=0.3)
    figure.axes[0].set_ylabel("n_w: wrong frames per 100")
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8
    )
    figure.savefig(path, dpi=110, metadata={"Software": None})
