"""The commands `trpac vision`: the camera side alone, on pictures of one's own."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from trpac_cli.console import Terminal, bars, refuse, require_folder
from trpac_core.files import quoted

if TYPE_CHECKING:
    from scenarios.vision_runs import Drive

EXIT_SOME_UNREADABLE = 1
"""Exit code where some pictures could not be used; they are named on standard error."""
LONGEST_PROBLEM = 400
"""Greatest number of characters of a problem."""
MOST_NAMED = 20
"""Unusable pictures that are named; further ones are counted."""

Bits = Annotated[
    int | None,
    typer.Option(
        min=8,
        max=16,
        help="How many bits a picture of 16 uses; by default 12 where all its values are below 4096, else 16.",
    ),
]

app = typer.Typer(help="The camera side alone: road surface from pictures.", no_args_is_help=True)


@app.command()
def classify(
    paths: Annotated[list[Path], typer.Argument(help="Pictures (JPEG, PNG), or folders of them.")],
    out: Annotated[Path, typer.Option(help="CSV file to write.")],
    bits: Bits = None,
) -> None:
    """Classify the road surface in pictures of any camera: dry, wet, or snow and ice.

    Uses road out of the shadow in the lower centre of each picture. No camera file is needed.

    Example: trpac vision classify my_pictures --out classes.csv

    Exit codes: 0 done, 1 done but some pictures could not be used, 2 unusable input.
    """
    from scenarios.stills import classify_pictures, find_pictures, write_classes
    from trpac_core.vision.networks import ModelError

    command = "trpac vision classify"
    require_folder(command, out.parent)
    try:
        if out.exists() and not out.is_file():
            refuse(command, f"{out}: no plain file. Expected the name of a CSV file to write.")
        files, problems = find_pictures(paths)
        if os.path.realpath(out) in {os.path.realpath(file) for file in files}:
            refuse(command, f"{out}: one of the pictures. Expected the name of a CSV file to write.")
        with bars() as progress:
            table, unusable = classify_pictures(files, partial(progress, "pictures"), bits)
        problems += unusable
        if table.empty:
            refuse(command, _listed("nothing to classify", problems))
        write_classes(table, out)
    except (ModelError, OSError) as error:
        refuse(command, error)
    Terminal().print(f"{len(table)} pictures: {_counted(list(table['class']))}. Table: {out}", soft_wrap=True)
    _finish(command, f"{len(problems)} of the inputs could not be used", problems)


@app.command()
def run(
    frames: Annotated[
        Path, typer.Argument(help="Folder of frames (in the order of their names), or a video.")
    ],
    camera: Annotated[Path, typer.Option(help="Camera file, such as scenarios/cameras/paper.yaml.")],
    speed_m_s: Annotated[float, typer.Option(help="Constant speed of the car in m/s.")],
    fps: Annotated[float, typer.Option(help="Frames per second.")],
    out: Annotated[
        Path, typer.Option(help="Folder for frames.csv, annotated.mp4, strip.jpg and summary.json.")
    ],
    bits: Bits = None,
) -> None:
    """Run the image estimator and the voting baseline over the frames of one drive.

    Example: trpac vision run frames --camera scenarios/cameras/paper.yaml --speed-m-s 10 --fps 40 --out out/drive

    Exit codes: 0 done, 1 done but some frames could not be used, 2 unusable input.
    """
    from scenarios.errors import ScenarioError
    from scenarios.vision_runs import Frames, run_frames
    from trpac_core.vision.networks import ModelError

    command = "trpac vision run"
    require_folder(command, out)
    try:
        found = Frames.find(frames, bits)
        with bars() as progress:
            drive = run_frames(found, camera, speed_m_s, fps, out, partial(progress, "frames"))
    except (ScenarioError, ModelError, OSError) as error:
        refuse(command, error)
    _show(drive)
    problems = [f"{entry['frame']}: {entry['reason']}" for entry in drive.summary["unreadable"]]
    _finish(command, f"{len(problems)} of {drive.summary['frames']} frames could not be used", problems)


def _show(drive: Drive) -> None:
    """Print the outcome."""
    summary, console = drive.summary, Terminal()
    table = Table(title=f"{summary['frames']} frames, {len(summary['unreadable'])} not usable")
    for heading in ("share of frames", "IFE", "voting"):
        table.add_column(heading, justify="left" if heading == "share of frames" else "right")
    for label, share in summary["class_share"].items():
        table.add_row(label, f"{share:.1%}", f"{summary['voting_class_share'][label]:.1%}")
    table.add_row("flag set", f"{summary['flag_share']:.1%}", "-")
    console.print(table)
    console.print(f"IFE time per frame: median {summary['ms_median']:.1f} ms, p99 {summary['ms_p99']:.1f} ms")
    if summary["annotated"] is None:
        console.print("No video encoder on this machine: strip.jpg in place of annotated.mp4.")
    missing = summary["frames_announced"] - summary["frames"]
    if missing > 0:
        console.print(
            f"The video ends {missing} frames before the {summary['frames_announced']} it announces."
        )
    console.print(f"Table: {drive.out / 'frames.csv'}", soft_wrap=True)


def _counted(classes: Sequence[str]) -> str:
    """The number of pictures by class as text."""
    from trpac_core.vision.classes import Surface

    return ", ".join(f"{classes.count(surface.label)} {surface.label}" for surface in Surface)


def _listed(heading: str, problems: Sequence[str]) -> str:
    more = [f"and {len(problems) - MOST_NAMED} more"] if len(problems) > MOST_NAMED else []
    named = [quoted(problem, LONGEST_PROBLEM) for problem in problems[:MOST_NAMED]]
    return "\n  ".join([f"{heading}:", *named, *more])


def _finish(command: str, heading: str, problems: Sequence[str]) -> None:
    """Exit with `EXIT_SOME_UNREADABLE` and a message where there are problems."""
    if problems:
        print(f"{command}: {_listed(heading, problems)}", file=sys.stderr)
        raise typer.Exit(EXIT_SOME_UNREADABLE)
