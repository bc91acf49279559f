"""The networks: one of whole pictures, and a surface classifier of patches.

Both take BGR uint8 pictures with channels last; normalisation is part of the graph.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from trpac_core.vision.classes import Surface

from .trunk import AT_REST, Depthwise, Kind, Trunk


class ConvUnit(nn.Sequential):
    """Pointwise convolution, batch norm, ReLU."""

    def __init__(self, channels_in: int, channels_out: int):
        super().__init__(
            nn.Conv2d(channels_in, channels_out, 1, bias=False),
            nn.BatchNorm2d(channels_out),
            nn.ReLU(inplace=True),
        )


class SeparableUnit(nn.Module):
    """Depthwise then pointwise convolution, with a residual path."""

    def __init__(self, channels: int, dilation: int = 1):
        super().__init__()
        self.depthwise = nn.Conv2d(
            channels, channels, 3, padding=dilation, dilation=dilation, groups=channels, bias=False
        )
        self.norm = nn.BatchNorm2d(channels)
        self.pointwise = ConvUnit(channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        """Feature maps in, feature maps out."""
        return x + self.pointwise(functional.relu(self.norm(self.depthwise(x))))


class Decoder(nn.Module):
    """One task's decoder: from stride 16 up to stride 4, with the encoder's maps added in."""

    def __init__(self, channels: Sequence[int], width: int = 32):
        super().__init__()
        self.lateral = nn.ModuleList([nn.Conv2d(each, width, 1) for each in channels])
        self.smooth = nn.ModuleList([SeparableUnit(width) for _ in channels])
        self.head = nn.Conv2d(width, 1, 1)

    def forward(self, maps: Sequence[Tensor]) -> Tensor:
        """Logits of one task at the size of the finest map, shape (n, h, w)."""
        x = self.smooth[-1](self.lateral[-1](maps[-1]))
        for level in range(len(maps) - 2, -1, -1):
            x = functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
            x = self.smooth[level](x + self.lateral[level](maps[level]))
        return self.head(x)[:, 0]


class RoadNet(nn.Module):
    """Drivable area, road shadow (section 3.1 of Tian et al. 2022) and the road's surface in a whole picture.

    One frozen pretrained encoder, two decoders, and a linear layer on what the encoder makes of the road and of the
    rest of the picture. General features generalise to streets of sources never seen.
    """

    WIDTH, DILATIONS = 128, (1, 2, 4)
    """Of the coarsest maps that the decoders begin from, and of the units that look around in them."""
    DROPOUT = 0.1
    """Share of the encoder's coarsest maps that a step of training leaves out [-]."""
    LEAST_WEIGHT = 0.02
    """Weight of the lower centre beside the road that was found: where none was, it stands for it [-]."""
    LOWER_CENTRE = (0.6, 0.2, 0.8)
    """Row from which, and columns between which, the road lies in most pictures [of the size]."""
    LIMIT = 5.0
    """A feature counts up to so many standard deviations of the training pictures' [-]."""

    def __init__(self, *, pretrained: bool = False):
        super().__init__()
        self.trunk = Trunk(AT_REST, pretrained=pretrained)
        first, second, *coarse = AT_REST.channels
        self.enter = ConvUnit(sum(coarse) + 2, self.WIDTH)
        self.around = nn.Sequential(*(SeparableUnit(self.WIDTH, dilation) for dilation in self.DILATIONS))
        self.context = nn.Linear(self.WIDTH, self.WIDTH)
        self.drivable = Decoder((first, second, self.WIDTH))
        self.shadow = Decoder((first, second, self.WIDTH))
        self.features = 3 * sum(AT_REST.channels[1:])
        self.register_buffer("mean", torch.zeros(self.features))
        self.register_buffer("deviation", torch.ones(self.features))
        self.surface = nn.Linear(self.features, len(Surface))

    def masks(self, maps: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Logits of drivable and of shadow, each (n, 40, 64): a quarter of the picture's size; of the trunk's maps."""
        first, second, *coarse = maps
        x = functional.dropout2d(torch.cat(coarse, dim=1), self.DROPOUT, self.training)
        rows, columns = x.shape[2:]
        height = torch.linspace(-1.0, 1.0, rows)[:, None].expand(rows, columns)
        aside = torch.linspace(-1.0, 1.0, columns).abs().expand(rows, columns)
        place = torch.stack((height, aside)).expand(len(x), 2, rows, columns)
        x = self.around(self.enter(torch.cat((x, place), dim=1)))
        x = x * torch.sigmoid(self.context(x.mean(dim=(2, 3))))[:, :, None, None]
        return self.drivable((first, second, x)), self.shadow((first, second, x))

    def pooled(self, maps: Sequence[Tensor], drivable: Tensor) -> Tensor:
        """Mean and deviation of the maps on the road, and their mean beside it, shape (n, features)."""
        found = torch.sigmoid(drivable)[:, None]
        rows, columns = found.shape[2:]
        top, left, right = self.LOWER_CENTRE
        centre = torch.zeros(rows, columns)
        centre[round(top * rows) :, round(left * columns) : round(right * columns)] = self.LEAST_WEIGHT
        columns_of = []
        for level, each in enumerate(maps[1:]):
            factor = 2 if level == 0 else 4
            on, beside = (functional.avg_pool2d(w, factor) for w in (found + centre, 1.0 - found))
            mean = (each * on).sum(dim=(2, 3)) / on.sum(dim=(2, 3))
            spread = ((each - mean[:, :, None, None]).square() * on).sum(dim=(2, 3)) / on.sum(dim=(2, 3))
            around = (each * beside).sum(dim=(2, 3)) / (beside.sum(dim=(2, 3)) + 1e-6)
            columns_of += [mean, torch.sqrt(spread + 1e-6), around]
        return torch.cat(columns_of, dim=1)

    def classes(self, pooled: Tensor) -> Tensor:
        """Logits of the surface, shape (n, classes), of pooled features."""
        return self.surface(((pooled - self.mean) / self.deviation).clamp(-self.LIMIT, self.LIMIT))

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Logits of drivable and of shadow, each (n, h, w), and of the surface, of uint8 pictures (n, h, w, 3)."""
        maps = self.trunk(images)
        drivable, shadow = self.masks(maps)
        return enlarged(drivable), enlarged(shadow), self.classes(self.pooled(maps, drivable))


def enlarged(logits: Tensor) -> Tensor:
    """Logits (n, h, w) of a quarter of a picture's size at its size."""
    return functional.interpolate(logits[:, None], scale_factor=4.0, mode="bilinear", align_corners=False)[
        :, 0
    ]


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
    """Width of the head for readable road."""
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
    """The towers of several nets in one, whose logits are the weighted mean of theirs; other heads are not trained yet.

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
