"""The networks: a two-task segmenter, and a surface classifier of patches or of whole pictures.

Both take BGR uint8 pictures with channels last; normalisation is part of the graph.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from trpac_core.vision.classes import Surface

from .trunk import Depthwise, Kind, Trunk

PIXEL_MEAN, PIXEL_DEVIATION = 110.0, 60.0
"""Round figures for road pictures; the same for the three channels, so that grey stays grey."""


def normalise(images: Tensor) -> Tensor:
    """Uint8 pictures (n, h, w, 3) to float planes (n, 3, h, w) around zero."""
    return (images.permute(0, 3, 1, 2).float() - PIXEL_MEAN) / PIXEL_DEVIATION


class ConvUnit(nn.Sequential):
    """Convolution, batch norm, ReLU."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int = 3, stride: int = 1):
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, stride, kernel // 2, bias=False),
            nn.BatchNorm2d(channels_out),
            nn.ReLU(inplace=True),
        )


class SeparableUnit(nn.Module):
    """Depthwise then pointwise convolution, with a residual path where the shapes allow it."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1, dilation: int = 1):
        super().__init__()
        self.depthwise = nn.Conv2d(
            channels_in, channels_in, 3, stride, dilation, dilation, groups=channels_in, bias=False
        )
        self.norm = nn.BatchNorm2d(channels_in)
        self.pointwise = ConvUnit(channels_in, channels_out, kernel=1)
        self.residual = stride == 1 and channels_in == channels_out

    def forward(self, x: Tensor) -> Tensor:
        """Feature maps in, feature maps out."""
        y = self.pointwise(functional.relu(self.norm(self.depthwise(x))))
        return x + y if self.residual else y


class Decoder(nn.Module):
    """One task's decoder: from stride 16 up to stride 2, with the encoder's maps added in."""

    def __init__(self, widths: tuple[int, int, int, int], width: int = 32):
        super().__init__()
        self.lateral = nn.ModuleList([nn.Conv2d(channels, width, 1) for channels in widths])
        self.smooth = nn.ModuleList([SeparableUnit(width, width) for _ in widths])
        self.head = nn.Conv2d(width, 1, 1)

    def forward(self, maps: list[Tensor]) -> Tensor:
        """Logits of one task at twice the finest map's size, shape (n, h, w)."""
        x = self.smooth[-1](self.lateral[-1](maps[-1]))
        for level in range(len(maps) - 2, -1, -1):
            x = functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = self.smooth[level](x + self.lateral[level](maps[level]))
        logits = functional.interpolate(self.head(x), scale_factor=2.0, mode="bilinear", align_corners=False)
        return logits[:, 0]


class Segmenter(nn.Module):
    """One encoder, two decoders: drivable area and road shadow (section 3.1 of Tian et al. 2022)."""

    def __init__(self) -> None:
        super().__init__()
        widths = (16, 32, 64, 128)
        self.stem = ConvUnit(3, widths[0], stride=2)
        self.stages = nn.ModuleList(
            [
                nn.Sequential(SeparableUnit(widths[0], widths[0])),
                nn.Sequential(SeparableUnit(widths[0], widths[1], 2), SeparableUnit(widths[1], widths[1])),
                nn.Sequential(
                    SeparableUnit(widths[1], widths[2], 2),
                    SeparableUnit(widths[2], widths[2]),
                    SeparableUnit(widths[2], widths[2]),
                ),
                nn.Sequential(
                    SeparableUnit(widths[2], widths[3], 2),
                    SeparableUnit(widths[3], widths[3], dilation=2),
                    SeparableUnit(widths[3], widths[3], dilation=4),
                    SeparableUnit(widths[3], widths[3]),
                ),
            ]
        )
        self.context = nn.Linear(widths[3], widths[3])
        self.drivable = Decoder(widths)
        self.shadow = Decoder(widths)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Logits of drivable and of shadow, each (n, h, w), for uint8 pictures (n, h, w, 3)."""
        x = self.stem(normalise(images))
        maps = []
        for stage in self.stages:
            x = stage(x)
            maps.append(x)
        gate = torch.sigmoid(self.context(x.mean(dim=(2, 3))))
        maps[-1] = x * gate[:, :, None, None]
        return self.drivable(maps), self.shadow(maps)


class ShuffleUnit(nn.Module):
    """Unit of ShuffleNet: grouped 1x1, shuffle, depthwise 3x3, grouped 1x1 (Zhang et al. 2018, figure 2).

    With stride 2 the average-pooled input is concatenated, as there; else the unit is residual.
    """

    def __init__(self, channels_in: int, channels_out: int, groups: int, stride: int):
        super().__init__()
        self.stride, self.groups = stride, groups
        branch_out = channels_out - channels_in if stride == 2 else channels_out
        middle = channels_out // 4 // groups * groups
        self.squeeze = nn.Sequential(
            nn.Conv2d(channels_in, middle, 1, groups=groups, bias=False),
            nn.BatchNorm2d(middle),
            nn.ReLU(inplace=True),
        )
        self.depthwise = nn.Sequential(
            Depthwise(middle, middle, 3, stride, 1, groups=middle, bias=False), nn.BatchNorm2d(middle)
        )
        self.expand = nn.Sequential(
            nn.Conv2d(middle, branch_out, 1, groups=groups, bias=False), nn.BatchNorm2d(branch_out)
        )

    def shuffle(self, x: Tensor) -> Tensor:
        """Deal the channels of each group to all groups."""
        channels, height, width = x.shape[1:]
        grouped = x.reshape(-1, self.groups, channels // self.groups, height, width)
        return grouped.transpose(1, 2).reshape(-1, channels, height, width)

    def forward(self, x: Tensor) -> Tensor:
        """Feature maps in, feature maps out."""
        y = self.expand(self.depthwise(self.shuffle(self.squeeze(x))))
        if self.stride == 2:
            return functional.relu(torch.cat((functional.avg_pool2d(x, 3, 2, 1), y), dim=1))
        return functional.relu(x + y)


def pooled(maps: Tensor) -> Tensor:
    """Mean and standard deviation of each channel over the picture, shape (n, 2 c)."""
    mean = maps.mean(dim=(2, 3))
    variance = (maps - mean[:, :, None, None]).square().mean(dim=(2, 3))
    return torch.cat((mean, torch.sqrt(variance + 1e-5)), dim=1)


class Tower(nn.Module):
    """Pretrained trunk and two units of ShuffleNet on top of it."""

    GROUPS = 4
    LAST = 240
    """Channels of the units of ShuffleNet."""

    def __init__(self, kind: Kind, *, pretrained: bool):
        super().__init__()
        self.trunk = Trunk(kind, pretrained=pretrained)
        channels = kind.channels[-1]
        self.units = nn.Sequential(
            ShuffleUnit(channels, self.LAST, self.GROUPS, 2),
            ShuffleUnit(self.LAST, self.LAST, self.GROUPS, 1),
        )

    @property
    def channels(self) -> int:
        """Of all maps together."""
        return sum(self.trunk.kind.channels) + self.LAST

    def forward(self, patches: Tensor) -> list[Tensor]:
        """Maps of the trunk and of the units on top of it, of uint8 patches (n, h, w, 3)."""
        read = self.trunk(patches)
        return [*read, self.units(read[-1])]


class SurfaceNet(nn.Module):
    """One tower or several for 64 x 96 patches; their maps' means and deviations are classified.

    Texture and gloss live in the middle maps, hence all four of a tower are read. Beside the classes it says whether a
    patch shows readable road at all, and it softens the logits of patches that look disturbed; neither changes the
    class.
    """

    DROPOUT = 0.3
    """Share of the pooled features that a step of training leaves out [-]."""
    READING = 64
    """Width of the head that tells readable road."""
    MOST_DISTURBED = 4.0
    """Limit of the logit that a patch is disturbed, to both sides, beyond which the softening stays as it is."""

    def __init__(self, kinds: Sequence[Kind], *, pretrained: bool = False):
        super().__init__()
        self.towers = nn.ModuleList([Tower(kind, pretrained=pretrained) for kind in kinds])
        self.embedding = 2 * sum(tower.channels for tower in self.towers)
        self.norm = nn.BatchNorm1d(self.embedding, affine=False)
        self.dropout = nn.Dropout(self.DROPOUT)
        self.classifier = nn.Linear(self.embedding, len(Surface))
        self.reading = nn.Sequential(
            nn.Linear(self.embedding, self.READING), nn.ReLU(), nn.Linear(self.READING, 1)
        )
        self.disturbed = nn.Linear(self.embedding, 1)
        self.softening = nn.Parameter(torch.tensor(0.0), requires_grad=False)

    def maps(self, patches: Tensor) -> list[Tensor]:
        """Maps of all towers, of uint8 patches (n, 64, 96, 3)."""
        return [maps for tower in self.towers for maps in tower(patches)]

    def embed(self, patches: Tensor) -> Tensor:
        """Pooled features of uint8 patches (n, 64, 96, 3), each around zero, shape (n, embedding)."""
        return self.pool(self.maps(patches))

    def pool(self, maps: Sequence[Tensor]) -> Tensor:
        """Mean and deviation of each channel, standardised, shape (n, embedding)."""
        return self.norm(torch.cat([pooled(each) for each in maps], dim=1))

    def readable(self, embedding: Tensor) -> Tensor:
        """Logit that a patch shows readable road, shape (n,)."""
        return self.reading(embedding)[:, 0]

    def disturbance(self, embedding: Tensor) -> Tensor:
        """Logit that a patch is blurred, badly exposed or otherwise disturbed, shape (n,)."""
        return self.disturbed(embedding)[:, 0]

    def soft_logits(self, embedding: Tensor) -> Tensor:
        """Logits (n, classes), smaller the more disturbed a patch looks: `softening` is the slope."""
        looks = self.disturbance(embedding).clamp(-self.MOST_DISTURBED, self.MOST_DISTURBED)
        return self.classifier(embedding) * torch.exp(-self.softening * looks)[:, None]

    def forward(self, patches: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (n, classes), and the probability of readable road (n,), of uint8 patches (n, 64, 96, 3)."""
        embedding = self.embed(patches)
        return self.soft_logits(embedding), torch.sigmoid(self.readable(embedding))


def together(nets: Sequence[SurfaceNet], says: Sequence[float]) -> SurfaceNet:
    """The towers of several nets in one, whose logits are the weighted mean of theirs; other heads are not taught yet.

    Nets that began from unlike trunks err on unlike patches, so the mean is better than each and less sure of what it
    does not know. Source: Lakshminarayanan et al. 2017, Simple and scalable predictive uncertainty estimation.
    """
    whole = SurfaceNet([tower.trunk.kind for net in nets for tower in net.towers])
    whole.towers = nn.ModuleList([tower for net in nets for tower in net.towers])
    with torch.no_grad():
        whole.norm.running_mean = torch.cat([net.norm.running_mean for net in nets])
        whole.norm.running_var = torch.cat([net.norm.running_var for net in nets])
        shares = torch.tensor(says) / sum(says)
        read = [share * net.classifier.weight for share, net in zip(shares, nets, strict=True)]
        whole.classifier.weight.copy_(torch.cat(read, dim=1))
        whole.classifier.bias.copy_(shares @ torch.stack([net.classifier.bias for net in nets]))
    return whole.eval()


def mean_of(nets: Sequence[SurfaceNet]) -> SurfaceNet:
    """One net whose weights are the means of those of several, which began alike and learned from unlike roads.

    It costs no more to ask than one of them. Source: Wortsman et al. 2022, Model soups: averaging weights of multiple
    fine-tuned models improves accuracy without increasing inference time.
    """
    states = [net.state_dict() for net in nets]
    mean = copy.deepcopy(nets[0])
    mean.load_state_dict(
        {
            name: torch.stack([state[name].double() for state in states]).mean(dim=0).to(first.dtype)
            for name, first in states[0].items()
        }
    )
    return mean.eval()
