"""The card of picture.onnx."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from trpac_core.vision.picture import LOOKS

from .cards import CLASSES, LICENCE_TEXT, class_rows, table
from .patches import CAMERA_SPREAD, RENDERED_SPREAD, PatchSet
from .rendered import FIRST_SCENE_WORLD, SEED_RANGES

if TYPE_CHECKING:
    from .outcomes import Stage
    from .picture_scores import Scores


def picture_card(
    found: Mapping[str, Scores],
    *,
    looks: PatchSet,
    stage: Stage,
    given: argparse.Namespace,
    sha256: str,
    temperature: float,
    train_s: float,
    parameters: int,
) -> str:
    """Card of picture.onnx."""
    rows = [
        [name, *class_rows(kind, part)]
        for name, scores in found.items()
        for kind, part in (
            ("its patches", scores.patches),
            ("as a whole", scores.picture),
            ("both", scores.together),
        )
    ]
    header = ["set", "judged by", "n", "accuracy [95 %]", *(f"recall {name} (n)" for name in CLASSES)]
    entropies = [
        [name, *(f"{value:.3f}" for value in (*scores.entropies, scores.reliability.ece))]
        for name, scores in found.items()
    ]
    boxes = "; ".join(" ".join(f"{100 * edge:.0f}" for edge in box) for box in LOOKS)
    left_out = f"Left out: {', '.join(given.without)}. " if given.without else ""
    real = int((looks.sources != "rendered").sum())
    first = SEED_RANGES["train"].start + FIRST_SCENE_WORLD
    return f"""\
# picture.onnx

sha256: `{sha256}`

A net as the first tower of [surface.onnx](surface.md), without its further heads, {parameters} parameters, trained on
looks at most of a picture. `trpac vision classify` counts it beside the patches of road. The estimator of a driving car
does not use it: where the class changes ahead, the picture's is not that of the road under the wheel.

- Input `looks`: uint8 (N, 128, 192, 3), BGR, parts of a picture squeezed; normalisation is in the graph.
- Output `logits`: float32 (N, 3), classes dry, wet, snow_ice.
- Metadata: `temperature` = {temperature:.6f}, `classes` = dry,wet,snow_ice.

A picture is looked at in {len(LOOKS)} parts (left, top, right, bottom in percent: {boxes}), each mirrored
too. The mean of their logits over T is added to the mean log probability of the patches.

## Training

From the pretrained trunk, as the surface network; {stage.told()}, drawn by the same shares of
classes and sources. {left_out}{real} looks at real pictures and {len(looks) - real} at rendered worlds of one class
(seeds from {first}), undisturbed, at places and sizes about those that are judged, seen by cameras of other gain, gamma
and white balance (within {100 * CAMERA_SPREAD:.0f} %; {100 * RENDERED_SPREAD:.0f} % for rendered ones). Of
the clips that have the weather written into them the parts without text and bonnet are looked at. Seed {given.seed};
{train_s:.0f} s by the clock for what was not kept. Command: `python -m models.training --only picture --data DIR`.

T makes the true classes of the validation pictures likeliest beside the patches, every sequence of neighbouring
pictures counted alike. Data, splits and versions: [surface.md](surface.md).

## Scores on pictures

What the command says: refused pictures are not among them. Of the clips that have the weather written into them, the
two parts of a picture without text and bonnet are judged, as the command asks to crop them.

{table([*header, "confusion, rows true"], rows)}

{table(["set", "cross-entropy, its patches [nat]", "both [nat]", "ECE, both"], entropies)}

## Limits

- A picture as a whole tells of weather, place and camera as much as of the road: where a wet road lies under a blue
  sky, or snow is cleared, the patches know better. So it counts by T, and not in the estimator.
- Text, bonnets and borders in the picture are looked at as well. Crop them.
- The limits of [surface.md](surface.md) hold here too.

{LICENCE_TEXT}
"""
