"""The model cards, written by the training run from what it measured."""

from __future__ import annotations

import importlib.metadata
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from trpac_core.vision.classes import Surface

from .data import FAMILIES, Picture
from .patches import CAMERA_SPREAD, RENDERED_SPREAD
from .rendered import STREETS
from .scores import ClassScore, wilson_interval

if TYPE_CHECKING:
    from .calibrate import Reliability
    from .outcomes import Outcome, Stage
    from .road_run import Road
    from .train_segmenter import SegmentationScore

CLASSES = [surface.label for surface in Surface]
PACKAGES = ("torch", "onnx", "onnxruntime", "numpy", "opencv-python-headless", "albumentations")

LICENCE_TEXT = """\
## Licences of the pictures

Most of the real pictures are non-commercial or carry no licence at all. None of them is part of this project, whole
or in part; only weights learned from them are. A product should retrain on pictures that its maker owns. That is one
command: `python -m models.training --data DIR`, where `DIR` holds the pictures and a `manifest.csv` with the columns
file, split, task, label, mask, sequence_id, licence, width and height, and in notes, if there are any, "night"."""


LEFT_OUT_TEXT = """\
## The surface, on sources left out

Each source is judged by a surface that was learned without it; by the road that the masks find, which know it. The flag
is up from the confidence at which no other source is wrong in more than 2 %. `python -m models.training.left_out --data
DIR` writes this table and that of masks left out.

{}

"""
CAMVID = """\
CamVid 0001TP is the validation drive (dusk, another drive than the training ones); the spread of gain and gamma in
training was widened for it, so its score is no test score. Real drivable masks of a test drive are not in the data.
"""
SEGMENTER_LIMITS = """\
- Damp, matt asphalt without reflections is often taken for dry: most of the wet streets that are missed look so.
- Snow by night is hardly in the data, and not found.
- The whole picture depends on weather and place as much as on the road: where a wet road lies under a blue sky, or
  snow is cleared, patches are more accurate.
- No real picture has a shadow label. On real pictures the shadow task learns from painted shadows and that the
  brighter half of a road and wet roads have none; the darker half stays unknown, so that unlabelled real shadows do
  not teach "no shadow". How well it finds real shadows was only looked at; dark asphalt and dusk still pass for shadow
  at times.
- On rendered pictures much of the shadow is missed, see its IoU; what is called shadow is mostly right.
- The edge between a snowy road and a snowy verge is a guess."""
WEATHERED = """\
Dry pictures of four dash cameras are shown wet and under snow too
(`models/training/weathered.py`). """
SURFACE_LIMITS = """\
- The validation and test stills come from the same kind of web search as the training stills; other cameras are the
  better estimate for a new car. Wet carries over worst: see its recall on other cameras and how few pictures that is.
- Real wet and snowy dash frames in training come from one car, one clip each, and the val rows of these clips show the
  same road seconds later. Rendered scores only show how well the network knows the renderer.
- Damp, matt asphalt is labelled nowhere in the data. What is found for it is a guess; expect dry.
- Night roads with reflected lights and wet cobbles are hardly covered. Gravel, soil and painted surfaces are not.
- A road unlike those in training may look disturbed to the softening, and is less sure than it could be."""
SQUASHED = """\
Web stills are squashed by their source and used stretched back; only their lower centre counts. The `*_extreme` clips
are used only where no text, path dots or bonnet cover the road.
"""
OWN_LIMITS = """\
- The scores hold for cameras, roads and weather like those of the pictures below.
- Pictures of one drive are alike: the intervals, which count pictures, are too narrow where there are few drives.
- Scores on rendered pictures tell how well the network knows the renderer, no more."""
OWN_LICENCES = """\
## Licences of the pictures

They are those of the table. Where a network of the package was used, its own card has the pictures behind it."""


@dataclass
class RunFacts:
    """What is the same for both cards of a run."""

    command: str
    seed: int
    pictures: Sequence[Picture]
    worlds: dict[str, int]
    seeds: dict[str, str]
    render_s: float
    threads: int
    without: tuple[str, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.versions = {name: importlib.metadata.version(name) for name in PACKAGES}

    @property
    def own(self) -> bool:
        """Whether all pictures are of others than the package's sources."""
        return not any(picture.family in FAMILIES for picture in self.pictures)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def data_table(pictures: Sequence[Picture]) -> str:
    """Pictures per source, class and split, with the licence as found."""
    counts = Counter((p.source, p.surface.label, p.split) for p in pictures)
    licences = {p.source: p.licence for p in pictures}
    rows = []
    for source, label in sorted({(source, label) for source, label, _ in counts}):
        split_counts = [str(counts[source, label, split]) for split in ("train", "val", "test")]
        rows.append([source, label, *split_counts, licences[source]])
    return table(["source", "class", "train", "val", "test", "licence as found"], rows)


def splits_text(facts: RunFacts) -> str:
    """How the data were split."""
    worlds = ", ".join(
        f"{split} {count} worlds (seeds {facts.seeds[split]})" for split, count in facts.worlds.items()
    )
    rendered = f"{worlds}; drawing or loading them took {facts.render_s:.0f} s."
    if facts.own:
        return (
            "Real pictures are split by the manifest: no sequence stands in two splits.\nRendered pictures, three "
            f"places in each world:\n{rendered}"
        )
    return f"""\
Real pictures are split by the manifest: no series of neighbouring pictures stands in two splits, except the three
clips of one car (`*_extreme`) that are cut in time, first part train, a gap, last part val. `other_cameras` and all
test rows are never trained on, and nothing was chosen by them. The rendered test scores were in view when the weather
of the rendered worlds was decided: they are kinder than those of a renderer never seen.
Rendered pictures, three places in each world, half of the worlds with the weather that is likely for their surface:
{rendered}"""


def time_text(facts: RunFacts, train_s: float) -> str:
    """How long training took, and with what."""
    threads = "one processor thread" if facts.threads == 1 else f"{facts.threads} processor threads"
    return f"{train_s:.0f} s by the clock with {threads}, on a machine with other work."


def versions_text(facts: RunFacts) -> str:
    """Command, seed and versions."""
    versions = ", ".join(f"{name} {version}" for name, version in facts.versions.items())
    return f"Command: `{facts.command}`; seed {facts.seed}. Python {platform.python_version()}, {versions}."


def class_rows(name: str, score: ClassScore) -> list[str]:
    """One row of a score table: items, accuracy with its interval, recalls, confusion."""
    low, high = wilson_interval(score.right, score.count)
    recalls = [
        f"{score.recall(label):.2f} ({int(score.confusion[label].sum())})"
        if score.confusion[label].sum()
        else "-"
        for label in range(3)
    ]
    confusion = " / ".join(" ".join(map(str, row)) for row in score.confusion.tolist())
    return [name, str(score.count), f"{score.accuracy:.3f} [{low:.3f}, {high:.3f}]", *recalls, confusion]


def class_table(scores: dict[str, ClassScore]) -> str:
    """Scores of several test sets."""
    header = ["set", "n", "accuracy [95 %]"] + [f"recall {name} (n)" for name in CLASSES]
    return table(
        [*header, "confusion, rows true"], [class_rows(name, score) for name, score in scores.items()]
    )


def calibration_table(
    reliabilities: Mapping[str, tuple[Reliability, Reliability]], temperature: float
) -> str:
    """Errors of the confidence per set, at T = 1 and at T."""
    header = ["ECE, T = 1", f"ECE, T = {temperature:.3f}", "MCE, T = 1", f"MCE, T = {temperature:.3f}"]
    rows = [
        [
            name,
            str(int(before.count.sum())),
            *(f"{x:.3f}" for x in (before.ece, after.ece, before.mce, after.mce)),
        ]
        for name, (before, after) in reliabilities.items()
    ]
    return table(["patches", "n", *header], rows)


def surface_card(facts: RunFacts, outcome: Outcome, *, sha256: str, train_s: float, stage: Stage) -> str:
    """Card of surface.onnx."""
    temperature, reliabilities, entropies = outcome.temperature, outcome.reliabilities, outcome.entropies
    picture_scores, patch_scores = outcome.picture_scores, outcome.patch_scores
    net = outcome.net
    parameters = sum(parameter.numel() for parameter in net.parameters())
    slope = float(net.softening)
    readings = table(
        ["patches", "share taken for readable road"],
        [[name, f"{share:.3f}"] for name, share in outcome.readings.items()],
    )
    calibration = calibration_table(reliabilities, temperature)
    kinds = [tower.trunk.kind for tower in net.towers]
    towers = ", ".join(f"the first {kind.blocks} blocks of {kind.name}" for kind in kinds)
    frozen = " or ".join(str(kind.frozen) for kind in kinds)
    weights = " : ".join(f"{say:g}" for say in stage.says)
    left_out = f"Left out: {', '.join(facts.without)}. " if facts.without else ""
    weathered = "" if facts.own else WEATHERED
    weigh = "" if facts.own else ", so that wet and snowy dash frames weigh as much as dry ones"
    limits, squashed, licences = (
        (OWN_LIMITS, "", OWN_LICENCES) if facts.own else (SURFACE_LIMITS, SQUASHED, LICENCE_TEXT)
    )
    return f"""\
# surface.onnx

sha256: `{sha256}`

Towers side by side: {towers}. Each trunk has learned
to see from other pictures (ImageNet weights, Apache-2.0); two units of ShuffleNet stand on it (grouped 1x1 convolutions
with {net.towers[0].GROUPS} groups, channel shuffle, depthwise 3x3; ref. [22] of Tian et al. 2022). {parameters}
parameters. Mean and deviation of four maps of each tower feed one linear layer. The towers are trained one by one, and
the logits are the mean of theirs, weighted {weights}. Each tower's weights are the mean of trainings that begin
alike: the rendered worlds of one lie in open land, of another's {100 * STREETS:.0f} % in the open shade of houses.
{kinds[0].name} has a third, in that shade with mixed styles: half of its patches have, in the first maps that are read,
means and deviations between their own and another patch's (Zhou et al. 2021, Domain generalization with MixStyle).

- Input `patches`: uint8 (N, 64, 96, 3), BGR; normalisation is in the graph.
- Output `logits`: float32 (N, 3), classes dry, wet, snow_ice. Probabilities are softmax(logits / T).
- Output `readable`: float32 (N,), probability that a patch shows road that can be read at all.
- Metadata: `temperature` = {temperature:.6f}, `classes` = dry,wet,snow_ice.
  The large arrays are kept in half precision.

## Training

{stage.patches} patches of undisturbed pictures, real and rendered; blur, strong exposure and shadows stay out.
Patches are 3:2 to 3:1 wide before they are squeezed to the input, from 48 pixels to nearly the whole width of the road.
They are mirrored, shifted, zoomed by up to 12 % and seen with the resolution, gain, gamma and white balance of other
cameras (within {100 * CAMERA_SPREAD:.0f} %; {100 * RENDERED_SPREAD:.0f} % for rendered ones, whose worlds
have drawn theirs already). {weathered}{left_out}Classes are drawn equally often and sources within a class by
fixed shares{weigh}. Cross-entropy, AdamW, running average of the
weights.
A trunk learns at two fifths of the others' rate, its first {frozen} blocks not at all, nor the statistics of their
batch norms. {stage.told()}. All together, but for what was kept: {time_text(facts, train_s)}
{versions_text(facts)}

`readable` is a head of its own, taught last, which leaves the rest as it is: road of all sources, undisturbed and
disturbed, against drawn walls, boards, cloth, plants, sky, bodywork, facades, lettering and covers (half of what is no
road), sky, trees and houses of the upper part of the training pictures (a quarter), and noise, clouds, stripes, and
roads that are too dark, too bright or far out of focus to be read (a quarter).

## Scores on pictures, patches alone

A real picture is judged by fixed patches of its road box (or mask): largest mean log probability. Recall columns give
the number of pictures of the class. Every rendered view is one picture.

{class_table(picture_scores)}

## Scores on single patches, alone

{class_table(patch_scores)}

## Readable road

{readings}

## Calibration

Within the graph the logits are divided by exp({slope:.3f} d): a patch that looks disturbed is less sure, one that looks
clear is surer. d, within {net.MOST_DISTURBED:g} to both sides, is the logit of a linear head that tells
clear training patches from the same ones disturbed; it has seen no class. The slope is learned like T, on the
validation patches.

Of patches alone, T = {temperature:.3f} minimises the cross-entropy of the validation patches, undisturbed and
disturbed (motion blur on all, brightness and contrast on 70 %, abnormal exposure and shadow on 30 % each), from
{entropies[0]:.3f} to {entropies[1]:.3f} nat. The class never changes. {len(reliabilities)} sets, 15 bins; MCE is the
worst bin however few patches it holds.

{calibration}

## Limits

{limits}

## Data

{splits_text(facts)}
{squashed}
{data_table(facts.pictures)}

{licences}
"""


def segmentation_table(scores: dict[str, dict[str, SegmentationScore]]) -> str:
    """IoU and pixel accuracy per set and task."""
    rows = []
    for name, tasks in scores.items():
        for task, score in tasks.items():
            rows.append([name, task, str(score.pictures), f"{score.iou:.3f}", f"{score.accuracy:.3f}"])
    return table(["set", "task", "pictures", "IoU", "pixel accuracy"], rows)


def segmenter_card(
    facts: RunFacts,
    road: Road,
    *,
    sha256: str,
    train_s: float,
    scores: dict[str, dict[str, SegmentationScore]],
    left_out: str,
) -> str:
    """Card of segmenter.onnx."""
    parameters = sum(parameter.numel() for parameter in road.net.parameters())
    views = Counter(view.kind for view in road.material.training.views)
    kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(views.items()))
    kind = road.net.trunk.kind
    validation, left_out_text, limits, licences = (
        ("", "", OWN_LIMITS, OWN_LICENCES)
        if facts.own
        else (CAMVID, LEFT_OUT_TEXT.format(left_out), SEGMENTER_LIMITS, LICENCE_TEXT)
    )
    return f"""\
# segmenter.onnx

sha256: `{sha256}`

One network for a whole picture: where the road is, where shadow lies on it, and what its surface is.
The encoder is the first {kind.blocks} blocks of {kind.name}, which has learned to see from other pictures (ImageNet
weights, Apache-2.0) and stays as it is: what it sees holds on streets that nothing here has seen. Two decoders
(section 3.1 of Tian et al. 2022) and a linear layer are learned. {parameters} parameters, the large ones kept in half
precision.

- Input `image`: uint8 (1, 160, 256, 3), BGR, the whole frame reduced by area averaging; normalisation is in the graph.
- Outputs `drivable` and `shadow`: float32 (1, 160, 256), probabilities. `shadow` means shadow on the road; off the
  drivable area it has no meaning.
- Output `surface`: float32 (1, 3), logits of dry, wet, snow_ice: of mean and deviation of the encoder's maps on the
  road that was found, and of their mean beside it. The class of the picture as a whole, not of a place in it.

## Training

{len(road.material.training.views)} views by kind of picture: {kinds}.
*masked*, *campus* and some of *street* are real pictures with road masks, *weak* real pictures of all three surfaces
without one: only the middle of the road box counts as road and the sky of stills as not road; of other *street*
pictures no more is known than that their sky is no road. The brighter half of a real road, and all
of a wet one, counts as free of shadow, the darker half as unknown. Shadows are painted over most of these, and on some
a bonnet or dashboard, which is no road; *night* are pictures by day shown by night (`models/training/night.py`);
*rendered* have exact labels of both tasks. Random crops, mirror, gain, gamma,
white balance, and on some pictures blur, noise, contrast. Cross-entropy and Dice, AdamW.

The surface is learned last, by multinomial regression with a ridge: {len(road.surfaces.labels)} whole pictures, by day
and by night, of training sources and rendered; classes alike, sources within a class by fixed shares. Its logits are
times {road.scale:.3f}, which makes the true classes of sources left out likeliest.
{time_text(facts, train_s)}
{versions_text(facts)}

{left_out_text}## The masks

At probability 0.5, whole pictures; unknown pixels are left out.

{segmentation_table(scores)}

{validation}"painted" means painted shadows, judged on the road in them and within 15 pixels around.

## Limits

{limits}

## Data

{splits_text(facts)}

{data_table(facts.pictures)}

{licences}
"""


def write_card(path: Path, text: str) -> None:
    """Write a card."""
    path.write_text(text, encoding="utf-8")
