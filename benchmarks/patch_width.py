"""How wide a patch of road the surface network should look at: wrong frames per 100 by the width.

``python -m benchmarks.patch_width --data ROAD_IMAGES [--models DIR] [--widths 0.8 1.2 ...] [--out DIR]`` judges
rendered drives of seeds of their own and the validation parts of the real clips, none of which the networks were
trained on or are scored on, and prints a table.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import pandas as pd
from rich.progress import Progress

from .table4.clips import real_sequences
from .table4.drives import rendered_drives
from .table4.judge import SCENARIOS, VOTING, Networks, judged
from .table4.scores import n_w
from .table4.sequences import Sequence

ROOT = Path(__file__).resolve().parents[1]
FIRST_SEED = 6_000_100
EVERY = 2
"""Of the frames of a rendered drive: neighbours are 0.5 m apart and much alike."""


def main() -> None:
    given = _options()
    cv2.setNumThreads(1)
    networks = Networks.load(given.models)
    widths = {f"{width:g} m": {"roi_width_m": width} for width in given.widths}
    with Progress() as bars:
        drawing = bars.add_task("rendered drives", total=given.drives)
        drives, _ = rendered_drives(
            given.out, given.drives, lambda done, _: bars.update(drawing, completed=done), FIRST_SEED
        )
        sequences = [replace(drive, frames=drive.frames[::EVERY]) for drive in drives]
        sequences += _validation_parts(given.data) if given.data else []
        task = bars.add_task("judged", total=len(sequences) * len(SCENARIOS))
        found = []
        for sequence in sequences:
            for scenario in SCENARIOS:
                found.append(judged(sequence, networks, scenario, widths))
                bars.advance(task)
    print(table(pd.concat(found, ignore_index=True)))


def table(verdicts: pd.DataFrame) -> str:
    """Wrong frames per 100 with their intervals, a row per set and scenario, a column per width, as Markdown."""
    of_widths = verdicts[verdicts["method"] != VOTING]
    rendered = of_widths["source"].str.startswith("rendered")
    sets = of_widths["source"].mask(rendered, "rendered drives")
    widths = list(dict.fromkeys(of_widths["method"]))
    lines = [f"| set | scenario | {' | '.join(widths)} |", "|---" * (2 + len(widths)) + "|"]
    for (name, scenario), rows in of_widths.groupby([sets, "scenario"], sort=False):
        scores = (str(n_w(rows[rows["method"] == width])) for width in widths)
        lines.append(f"| {name} | {scenario} | {' | '.join(scores)} |")
    return "\n".join(lines)


def _validation_parts(data: Path) -> list[Sequence]:
    parts = (
        replace(s, frames=tuple(frame for frame in s.frames if frame.part == "val"))
        for s in real_sequences(data)
    )
    return [part for part in parts if part.frames]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.patch_width",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--data", type=Path, help="folder of real road pictures; none: rendered drives only")
    parser.add_argument("--models", type=Path, default=ROOT / "models", help="folder of both networks")
    parser.add_argument("--widths", type=float, nargs="+", default=[0.8, 1.0, 1.2, 1.4, 1.8, 2.4], help="[m]")
    parser.add_argument("--drives", type=int, default=36, help="rendered drives of 30 frames")
    parser.add_argument("--out", type=Path, default=Path("out/patch_width"), help="where these are kept")
    return parser.parse_args()


if __name__ == "__main__":
    main()
