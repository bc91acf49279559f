"""How wide the patches of road should be that the surface network looks at: wrong frames per 100.

``python -m benchmarks.patch_width --data ROAD_IMAGES [--models DIR] [--patches 1.2 1.2x1.7 ...] [--out DIR]`` judges
rendered drives of seeds of their own and the validation parts of the real clips, none of which the networks were
trained on or are scored on, and prints a table. 1.2x1.7 are patches around 1.2 m, spread by a factor of 1.7 to both
sides; 1.2 alone are patches all alike.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import pandas as pd
from rich.progress import Progress

from trpac_core.vision.ife_config import IfeConfig

from .table4.clips import real_sequences
from .table4.drives import rendered_drives
from .table4.judge import SCENARIOS, VOTING, Networks, judged
from .table4.scores import n_w
from .table4.sequences import Sequence

ROOT = Path(__file__).resolve().parents[1]
FIRST_SEED = 6_000_100
PATCHES = ["0.8", "1.2", "1.4", "1.8", "2.4", "1.2x1.3", "1.2x1.7", "1.2x2.2"]
EVERY = 2
"""Of the frames of a rendered drive: neighbours are 0.5 m apart and much alike."""


def main() -> None:
    given = _options()
    cv2.setNumThreads(1)
    networks = Networks.load(given.models)
    with Progress() as bars:
        sequences = development_sequences(given.out, given.drives, given.data, bars)
        task = bars.add_task("judged", total=len(sequences) * len(SCENARIOS))
        found = []
        for sequence in sequences:
            for scenario in SCENARIOS:
                found.append(judged(sequence, networks, scenario, given.patches))
                bars.advance(task)
    print(table(pd.concat(found, ignore_index=True)))


def development_sequences(out: Path, count: int, data: Path | None, bars: Progress) -> list[Sequence]:
    """Rendered drives of seeds of their own, kept in `out`, and the validation parts of the real clips in `data`."""
    drawing = bars.add_task("rendered drives", total=count)
    drives, _ = rendered_drives(out, count, lambda done, _: bars.update(drawing, completed=done), FIRST_SEED)
    rendered = [replace(drive, frames=drive.frames[::EVERY]) for drive in drives]
    real = real_sequences(data) if data else []
    return rendered + [part for part in (sequence.validation_part() for sequence in real) if part.frames]


def table(verdicts: pd.DataFrame) -> str:
    """Wrong frames per 100, all and those of flag 1, a row per set and scenario, a column per patches, as Markdown."""
    ours = verdicts[verdicts["method"] != VOTING]
    rendered = ours["source"].str.startswith("rendered")
    sets = ours["source"].mask(rendered, "rendered drives")
    patches = list(dict.fromkeys(ours["method"]))
    lines = [f"| set | scenario | {' | '.join(patches)} |", "|---" * (2 + len(patches)) + "|"]
    for (name, scenario), rows in ours.groupby([sets, "scenario"], sort=False):
        of_each = [rows[rows["method"] == each] for each in patches]
        scores = (f"{n_w(each).value:.1f} ({n_w(each[each['flag']]).value:.1f})" for each in of_each)
        lines.append(f"| {name} | {scenario} | {' | '.join(scores)} |")
    return "\n".join(lines)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.patch_width",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--data", type=Path, help="folder of real road pictures; none: rendered drives only")
    parser.add_argument("--models", type=Path, default=ROOT / "models", help="folder of both networks")
    parser.add_argument("--patches", nargs="+", default=PATCHES, help="widths [m], or widths and spreads")
    parser.add_argument("--drives", type=int, default=36, help="rendered drives of 30 frames")
    parser.add_argument("--out", type=Path, default=Path("out/patch_width"), help="where these are kept")
    given = parser.parse_args()
    try:
        given.patches = {text: changes(text) for text in given.patches}
    except ValueError as error:
        parser.error(f"--patches: expected widths such as 1.2, or 1.2x1.7 with a spread ({error})")
    return given


def changes(patches: str) -> dict[str, float]:
    """What `1.2x1.7` changes in the estimator; raises ValueError."""
    width, _, spread = patches.partition("x")
    changed = {"roi_width_m": float(width), "roi_spread": float(spread or 1.0)}
    IfeConfig(**changed)  # refuses what the estimator would, before any drive is drawn
    return changed


if __name__ == "__main__":
    main()
