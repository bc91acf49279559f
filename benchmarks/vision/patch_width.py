"""How wide the patches of road should be that the surface network looks at: wrong frames per 100.

``python -m benchmarks.vision.patch_width --data ROAD_IMAGES [--models DIR] [--patches 1.2 1.2x1.7 ...] [--out DIR]``
judges rendered drives of seeds of their own and the validation parts of the real clips, none of which the networks
were trained on or are scored on, and prints a table. 1.2x1.7 are patches around 1.2 m, spread by a factor of 1.7 to
both sides; 1.2 alone are patches all alike.
"""

from __future__ import annotations

import argparse

import pandas as pd

from trpac_core.vision.ife_config import IfeConfig

from .development_drives import add_options, verdicts
from .table4.judge import VOTING
from .table4.scores import n_w

PATCHES = ["0.8", "1.2", "1.4", "1.8", "2.4", "1.2x1.3", "1.2x1.7", "1.2x2.2"]


def main() -> None:
    given = _options()
    print(table(verdicts(given, given.patches)))


def table(judged: pd.DataFrame) -> str:
    """Wrong frames per 100, all and those of flag 1, a row per set and scenario, a column per patches, as Markdown."""
    ours = judged[judged["method"] != VOTING]
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
        prog="python -m benchmarks.vision.patch_width",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    add_options(parser, drives=36)
    parser.add_argument("--patches", nargs="+", default=PATCHES, help="widths [m], or widths and spreads")
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
