"""From which mass on the class of a frame is believed: what the flag holds back of wrong frames, and of right ones.

``python -m benchmarks.vision.flag_gate [--data ROAD_IMAGES] [--models DIR] [--out DIR]`` judges drives of
development, on which nothing is scored, and prints a row per value of `least_mass`: shares of wrong and of right
frames with flag 0, and what is wrong among those with flag 1 [%]. The value chosen is the least that holds back more
than half of the wrong frames in every set and scenario.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from rich.progress import Progress

from benchmarks.report import markdown
from trpac_core.vision.ife_config import IfeConfig

from .table4.clips import real_sequences
from .table4.drives import rendered_drives
from .table4.judge import SCENARIOS, Networks, judged
from .table4.scores import gate, method_of

ROOT = Path(__file__).resolve().parents[2]
FIRST_SEED = 6_000_100
EVERY = 2
"""Of the frames of a rendered drive: neighbours are 0.5 m apart and much alike."""

MASSES = tuple(np.round(np.arange(0.5, 0.96, 0.025), 3).tolist())
ENOUGH_PERCENT = 50.0
RENDERED, REAL = "rendered", "real clips"
HELD_BACK, COST, LEFT = "wrong frames with flag 0", "right frames with flag 0", "n_w, flag 1"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vision.flag_gate", description=__doc__)
    parser.add_argument("--data", type=Path, help="folder of real road pictures; none: rendered drives only")
    parser.add_argument("--models", type=Path, default=ROOT / "models", help="folder of both networks")
    parser.add_argument("--drives", type=int, default=96, help="rendered drives of 30 frames")
    parser.add_argument(
        "--out", type=Path, default=Path("out/development"), help="the drives, and the figure"
    )
    given = parser.parse_args()
    shares = shares_by_mass(method_of(verdicts(given), "IFE"))
    print(as_markdown(shares))
    print(f"chosen: {chosen(shares)}")
    draw(shares, given.out / "flag_gate.png")


def verdicts(given: argparse.Namespace) -> pd.DataFrame:
    """Verdicts on drives that nothing is scored on, undisturbed and with interference: see `judged`.

    Rendered drives, kept in the folder of `--out`, and the validation parts of the real clips.
    """
    cv2.setNumThreads(1)
    networks, found = Networks.load(given.models), []
    with Progress() as bars:
        task = bars.add_task("rendered drives", total=given.drives)
        drawn, _ = rendered_drives(
            given.out, given.drives, lambda done, _: bars.update(task, completed=done), FIRST_SEED
        )
        sequences = [replace(drive, frames=drive.frames[::EVERY]) for drive in drawn]
        real = [part.validation_part() for part in real_sequences(given.data)] if given.data else []
        sequences += [part for part in real if part.frames]
        for sequence in bars.track(sequences, description="judged"):
            found += [judged(sequence, networks, scenario, {"IFE": {}}) for scenario in SCENARIOS]
    return pd.concat(found, ignore_index=True)


def shares_by_mass(judged: pd.DataFrame) -> pd.DataFrame:
    """A row per set, scenario and least mass: what the flag is worth there [%].

    Parameters
    ----------
    judged : DataFrame
        Of `verdicts`, one method.
    """
    sets = np.where(judged["source"].str.startswith("rendered"), RENDERED, REAL)
    rows = []
    for (name, scenario), part in judged.groupby([sets, "scenario"], sort=False):
        for mass in MASSES:
            worth = gate(part.assign(flag=flags(part, mass)))
            rows.append(
                {"set": name, "scenario": scenario, "least_mass": mass}
                | {key: worth[key].value for key in (HELD_BACK, COST, LEFT)}
            )
    return pd.DataFrame(rows)


def flags(judged: pd.DataFrame, mass: float) -> pd.Series:
    """The estimator's flags with another least mass (groups of one patch or none have mass 0)."""
    return (judged["Q_v"] > IfeConfig().flag_threshold) & (judged["m_0"] >= mass)


def chosen(shares: pd.DataFrame) -> float | None:
    """The least mass at which most wrong frames of every set and scenario carry flag 0; None: at no mass."""
    least = shares.groupby("least_mass")[HELD_BACK].min()
    enough = least[least > ENOUGH_PERCENT]
    return float(enough.index[0]) if len(enough) else None


def as_markdown(shares: pd.DataFrame) -> str:
    """Per least mass a row, per set and scenario a cell: held back / cost (left); - where no frame is wrong."""
    cells = shares.assign(
        cell=[_cell(*row) for row in shares[[HELD_BACK, COST, LEFT]].itertuples(index=False, name=None)],
        column=shares["set"] + ", " + shares["scenario"],
    )
    wide = cells.pivot_table("cell", "least_mass", "column", aggfunc="first", sort=False)
    return markdown(("least_mass", *wide.columns), ((f"{mass:g}", *row) for mass, *row in wide.itertuples()))


def _cell(held_back: float, cost: float, left: float) -> str:
    held = "-" if np.isnan(held_back) else f"{held_back:.0f}"
    return f"{held} / {cost:.0f} ({left:.1f})"


def draw(shares: pd.DataFrame, path: Path) -> None:
    """Held back against cost, a line per set and scenario with wrong frames, the units' least mass marked."""
    figure, axes = plt.subplots(figsize=(7.0, 4.5), layout="constrained")
    for (name, scenario), part in shares.dropna(subset=HELD_BACK).groupby(["set", "scenario"], sort=False):
        (line,) = axes.plot(part[COST], part[HELD_BACK], ".-", label=f"{name}, {scenario}")
        now = part[np.isclose(part["least_mass"], IfeConfig().least_mass)]
        axes.plot(now[COST], now[HELD_BACK], "o", ms=11, mfc="none", color=line.get_color())
    axes.axhline(50.0, color="0.6", lw=0.8)
    axes.set(
        xlabel="right frames with flag 0 [%]",
        ylabel="wrong frames with flag 0 [%]",
        xlim=(0, 60),
        ylim=(0, 100),
    )
    axes.set_title(f"What the flag holds back; ring: least_mass {IfeConfig().least_mass:g}")
    axes.legend(loc="lower right")
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    main()
