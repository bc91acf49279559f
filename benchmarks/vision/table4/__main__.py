"""n_w in the form of Table 4, on real clips and on rendered drives that no training has seen.

python -m benchmarks.vision.table4 --models DIR --data ROAD_IMAGES --frames-cache DIR --out DIR [--page]

DIR of --models holds `full/` and a folder per source left out of training (`without_extreme`, `without_yolop`,
`without_camvid`, `without_lums`), each with segmenter.onnx and surface.onnx. A row whose networks are not there is
left out, and said so. A folder that holds
segmenter.onnx itself, such as `models`, counts as `full`. Verdicts are kept in --out and used again for the same
networks, pictures and code, so that a run broken off goes on. --page writes lab/2026-11-29_camera_scores.md.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Sequence as Row
from functools import cache
from pathlib import Path

import cv2
import pandas as pd
from rich.progress import Progress

from .clips import ASSUMED, real_sequences
from .drives import rendered_drives
from .judge import COLUMNS, SCENARIOS, Networks, judged
from .report import Measured, tables, write_page
from .sequences import Sequence
from .timing import frame_times

ROOT = Path(__file__).resolve().parents[3]
FULL = "full"
NETWORKS = ("segmenter.onnx", "surface.onnx")
LEAST_DRIVES = 2
CODE = (
    *sorted((ROOT / "trpac_core" / "vision").glob("*.py")),
    *(Path(__file__).with_name(f"{name}.py") for name in ("clips", "drives", "judge", "sequences")),
    ROOT / "scenarios" / "camera" / "disturbances.py",
    ASSUMED,
)
"""Files on which a verdict depends beside networks and pictures."""


def main(arguments: Row[str] | None = None) -> None:
    options = _options(arguments)
    cv2.setNumThreads(1)
    folders = network_folders(options.models)
    begin, sequences, cpu_s = time.process_time(), [], 0.0
    with Progress() as bars:
        if options.data:
            sequences += real_sequences(options.data)
        if options.drives >= LEAST_DRIVES:
            task = bars.add_task("rendered drives", total=options.drives)
            drives, cpu_s = rendered_drives(
                options.frames_cache, options.drives, lambda done, _: bars.update(task, completed=done)
            )
            sequences += drives
        table, missing = _verdicts(sequences, folders, options, bars)
    measured = Measured(
        table=table,
        missing=tuple(sorted(missing)),
        time=None if options.no_time else frame_times(folders[FULL]),
        render_cpu_min=cpu_s / 60.0,
        judge_cpu_min=(time.process_time() - begin) / 60.0,
        networks={
            name: {file: _sha256(folder / file)[:8] for file in NETWORKS} for name, folder in folders.items()
        },
    )
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "tables.md").write_text(tables(measured), encoding="utf-8")
    print(tables(measured))
    if options.page:
        write_page(measured)
    for reason in sorted(missing):
        print(f"LEFT OUT of the tables: {reason}", file=sys.stderr)


def _options(arguments: Row[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.vision.table4",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument(
        "--models", type=Path, default=ROOT / "models", help="folder with full/ and without_*/"
    )
    parser.add_argument(
        "--data", type=Path, help="folder of real road pictures with manifest.csv; none: rendered only"
    )
    parser.add_argument(
        "--frames-cache", type=Path, default=Path("out/table4_frames"), help="rendered pictures"
    )
    parser.add_argument("--out", type=Path, default=Path("out/table4"), help="verdicts and tables")
    parser.add_argument(
        "--drives", type=int, default=60, help="rendered drives of 60 frames; 0: real pictures only"
    )
    parser.add_argument("--no-time", action="store_true", help="do not measure the frame time")
    parser.add_argument("--page", action="store_true", help="write lab/2026-11-29_camera_scores.md")
    return parser.parse_args(arguments)


def network_folders(models: Path) -> dict[str, Path]:
    """Name and place of the folders that hold both networks; raises SystemExit without `full`."""
    if all((models / file).is_file() for file in NETWORKS):
        return {FULL: models}
    found = {f.name: f for f in sorted(models.glob("*/")) if all((f / file).is_file() for file in NETWORKS)}
    if FULL not in found:
        raise SystemExit(f"{models}: expected {' and '.join(NETWORKS)} in it or in its folder '{FULL}'.")
    return found


def _verdicts(
    sequences: list[Sequence], folders: dict[str, Path], options: argparse.Namespace, bars: Progress
) -> tuple[pd.DataFrame, set[str]]:
    """Verdicts on every sequence by the networks that never saw it, and the clips' validation parts by `full`."""
    load = cache(lambda name: Networks.load(folders[name]))
    missing: set[str] = set()
    found = []
    task = bars.add_task("judged", total=len(sequences) * len(SCENARIOS))
    for sequence in sequences:
        wanted = {sequence.left_out, FULL} if sequence.left_out != FULL else {FULL}
        for name in sorted(wanted):
            if name not in folders:
                missing.add(f"{sequence.source}: no networks in '{name}'")
                continue
            shown = sequence.validation_part() if name == FULL and sequence.left_out != FULL else sequence
            if not shown.frames:
                continue
            for scenario in SCENARIOS:
                verdicts = _kept(shown, folders[name], scenario, options.out, lambda name=name: load(name))
                found.append(verdicts.assign(networks=name, consecutive=sequence.consecutive))
        bars.advance(task, len(SCENARIOS))
    if not found:
        return pd.DataFrame(columns=[*COLUMNS, "networks", "consecutive"]), missing
    return pd.concat(found, ignore_index=True), missing


def _kept(sequence: Sequence, folder: Path, scenario: str, out: Path, load) -> pd.DataFrame:
    """The verdicts of an earlier run where networks, pictures and code are the same, else new ones."""
    pictures = "".join(f"{f.path.name}{f.path.stat().st_size}" for f in sequence.frames)
    asked = [
        *(_sha256(folder / file) for file in NETWORKS),
        _code_sha256(),
        scenario,
        sequence.name,
        pictures,
    ]
    key = hashlib.sha256("\n".join(asked).encode()).hexdigest()[:16]
    file = out / "verdicts" / f"{key}.csv"
    if file.is_file():
        return pd.read_csv(file, dtype={"sequence": str}, keep_default_na=False, na_values=["nan"])
    table = judged(sequence, load(), scenario)
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part")
    table.to_csv(part, index=False, na_rep="nan")
    part.replace(file)
    return table


@cache
def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def _code_sha256() -> str:
    return hashlib.sha256(b"".join(file.read_bytes() for file in CODE)).hexdigest()


if __name__ == "__main__":
    main()
