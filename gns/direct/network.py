"""The direct model: one pass of a network along the columns of a section.

In: a `SectionColumns` as tensors, and the values of its zones, with respect to which everything has
a derivative. Out: both toes with the scale of their error, the thickness of the deposit with its
own, and the times of `gns.direct.arrivals` with theirs.

The network halves and doubles the number of columns as a U-Net does (Ronneberger et al. 2015, here
in one dimension). A convolution sees neighbours, but what holds a slide is the whole base from a
column to the foot: so each column is also told what pushes there, and what the weakest layers on
either side can bear together (`_balance`). A toe is an expectation over the columns, of their place
plus an offset that the column itself gives, so that it is not bound to a grid; errors are Laplace
distributed, so that the median is learned. The deposit keeps the volume of the section. Arrival
times ascend; their errors are shares of them; they are seen in the network's inner value
where the toe ends.

Shapes: B sections, C columns, K layers, Z zones, S shares of the way (`SHARES`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from gns.direct.arrivals import SHARES
from gns.direct.effects import NAMES
from gns.direct.effects import turned as turned_effects
from gns.direct.sections import COLUMN, DEEPEST, LAYERS, SectionColumns, places
from pipeline.cli import InputError

#: Strengths are taken as at least this [rho g height], for their logarithm.
LEAST_STRENGTH = 3e-3
#: Features of a layer, and of a column.
PER_LAYER, PER_COLUMN = 5, 19
#: Channels before those of effects.
OF_SECTION = PER_COLUMN + LAYERS * PER_LAYER
#: Neighbouring columns that the network takes as one.
TOGETHER = 2
#: Outputs of a column: for each toe a weight, an offset and a log scale; a change and a log scale.
OUTPUTS = 8
#: Channels that are turned over and change sides in the mirror image, and those that change sides.
TURNED_OVER, SIDES_CHANGED = [7, 8], ([13, 14], [16, 17])
#: Push and resistance of a column below which their quotient says nothing [rho g height^2].
LEAST_PUSH = 0.02
#: A layer counts as the weakest of its column by this power of its strength, and a zone as the
#: weakest of its layer: a minimum would jump from one to the other.
WEAKEST = 8.0
#: Share of the inner values of a block that a training step leaves out.
DROPPED = 0.05
#: Log scales of errors lie within these [heights].
LOG_SCALES = (-7.0, 1.5)
#: Inner values of the heads for arrival times.
OF_TIMES = 64
#: Rows of arrival times (left toe, right toe, all soil) in the mirror image.
TURNED = [1, 0, 2]


@dataclass(frozen=True)
class DirectConfig:
    """Size of a model.

    Attributes:
        widths: channels of each level, from the finest.
        blocks: of each level, on the way down and on the way up.
        networks: whose mean is the answer; each has its own beginning and order of runs.
        effects: that it has learned, names in the order of `gns.direct.effects.EFFECTS`.
    """

    widths: tuple[int, ...] = (64, 96, 128, 192)
    blocks: int = 2
    networks: int = 1
    effects: tuple[str, ...] = ()

    @property
    def channels(self) -> list[int]:
        """Of the features, those that it sees."""
        return [*range(OF_SECTION), *(OF_SECTION + NAMES.index(name) for name in self.effects)]


@dataclass(frozen=True)
class Answer:
    """What a model predicts; lengths in heights, times in falls from the section's height.

    Attributes:
        toes: left and right of the middle, (B, 2).
        toe_scale: of their Laplace distribution, (B, 2).
        thickness: (B, C); thickness_scale: (B, C).
        log_times: natural logarithm of the arrival times of the left toe, the right toe and all
            soil on its way, (B, 3, S); time_scale: of its Laplace distribution, likewise.
    """

    toes: Tensor
    toe_scale: Tensor
    thickness: Tensor
    thickness_scale: Tensor
    log_times: Tensor
    time_scale: Tensor


def features(sections: list[SectionColumns], before: np.ndarray, values: Tensor) -> Tensor:
    """What the network sees, (B, channels, C).

    Args:
        sections: B of them, with equally many zones.
        before: toes before the slide, (B, 2) [heights].
        values: of the zones, (B, Z, 3), `gns.direct.sections.PROPERTIES`.
    """

    def stacked(name: str) -> Tensor:
        return torch.as_tensor(np.stack([getattr(one, name) for one in sections])).to(values)

    thickness, water, share = stacked("thickness"), stacked("water"), stacked("zone_share")
    sat = stacked("saturated")
    mean_density = torch.as_tensor([one.density for one in sections]).to(values)[:, None, None]
    cohesions = stacked("strength_share") * values[:, None, None, :, 0]
    cohesion = cohesions.sum(dim=3)
    friction, density = torch.einsum("bckz,bzp->pbck", share, values[..., 1:])
    swell = torch.einsum("bckz,bz->bck", share, sat)
    middle = (torch.arange(LAYERS).to(values) + 0.5) / LAYERS
    step = thickness[..., None] / LAYERS
    depth = (water[..., None] - thickness[..., None] * middle) / step.clamp(min=1e-6)
    soaked = (depth + 0.5).clamp(0.0, 1.0)
    weight = (density * (1.0 + soaked * (swell - 1.0)) - soaked / mean_density) * step
    above = weight.flip(-1).cumsum(-1).flip(-1) - 0.5 * weight
    strength = (cohesion + friction * above).clamp(min=0.0)
    # Of each zone alone, where there is some of it: a seam that is thinner than a layer holds no
    # more than it would by itself.
    alone = cohesions + share * values[:, None, None, :, 1] * above[..., None]
    alone = (alone / share.clamp(min=1e-6)).clamp(min=0.0)
    weak = (_weights_of_weakest(alone, share) * alone).sum(dim=3)
    inside = (thickness > 0.0).to(values)
    logs = [_log_strength(one) for one in (cohesion.clamp(min=0.0), strength, weak)]
    layers = torch.stack([*logs, friction, soaked], dim=1) * inside[:, None, :, None]
    layers = layers.permute(0, 1, 3, 2).flatten(1, 2)
    x = torch.as_tensor(places()).to(values).expand(len(sections), -1)
    toes = torch.as_tensor(before).to(values)
    fineness = torch.as_tensor([-np.log(one.spacing) - 3.0 for one in sections]).to(values)
    ones = torch.ones_like(x)
    columns = torch.stack(
        [
            thickness,
            stacked("ground"),
            torch.gradient(stacked("ground"), spacing=COLUMN, dim=1)[0] * 10.0,
            water,
            (water - thickness).clamp(-DEEPEST, DEEPEST),
            stacked("wall"),
            inside,
            (x - toes[:, :1]) / 4.0,
            (x - toes[:, 1:]) / 4.0,
            ones * fineness[:, None],
            ones * (mean_density[:, :, 0] - 1.9) * 4.0,
            *_balance(thickness, water, weak, (above * step).sum(dim=2), mean_density[:, :, 0]),
        ],
        dim=1,
    )
    acting = stacked("effects")[:, :, None].expand(-1, -1, x.shape[1])
    return torch.cat([columns, layers, acting], dim=1)


def _balance(
    thickness: Tensor, water: Tensor, strength: Tensor, weight: Tensor, density: Tensor
) -> list[Tensor]:
    """What pushes a column and what holds it: eight channels, (B, C) each.

    A column could slide outwards on its weakest layer and those of all columns before it. Their
    strengths add up from either end of the section; the push is that of soil and water without
    strength. The last channel is how far a heap of the mean of these strengths would spread: its
    final slope is h dh/dx = 2 s (in rho g), so its length goes with (area^2 / s)^(1/3).

    Args:
        thickness: of the soil [heights].
        water: level over the ground [heights].
        strength: of the weakest zone of the layers (B, C, K) [rho g height].
        weight: effective stress integrated over the column [rho g height^2].
        density: mean over that of water, (B, 1).
    """
    inside = (thickness > 0.0).to(thickness)
    push = weight + 0.5 * water.clamp(min=0.0) ** 2 / density
    weight_of = _weights_of_weakest(strength, torch.ones_like(strength))
    weakest = (weight_of * strength).sum(dim=2)
    place = (weight_of * torch.arange(LAYERS).to(thickness)).sum(dim=2)
    held = weakest * inside * COLUMN
    resistance = held.cumsum(dim=1), held.flip(1).cumsum(dim=1).flip(1)
    area = thickness.sum(dim=1, keepdim=True)
    mean = (weakest * thickness).sum(dim=1, keepdim=True) / area.clamp(min=1e-6)
    spread = (2.0 * (area * COLUMN).log() - (mean + LEAST_STRENGTH).log()) / 3.0 - 1.0
    return [
        push,
        _log_strength(weakest) * inside,
        *resistance,
        place / LAYERS * inside,
        *(((push + LEAST_PUSH) / (one + LEAST_PUSH)).log() * inside for one in resistance),
        spread.expand_as(thickness),
    ]


def _weights_of_weakest(strength: Tensor, share: Tensor) -> Tensor:
    """Weights (..., n), of sum 1, by which a mean of n strengths is near the least of them.

    Args:
        strength: (..., n) [rho g height].
        share: of what has it (..., n); nothing has no weight, but where there is nothing at all.
    """
    weight = share.clamp(min=1e-9).log() - WEAKEST * (strength + LEAST_STRENGTH).log()
    return weight.masked_fill(share <= 0.0, -1e9).softmax(dim=-1)


def _log_strength(strength: Tensor) -> Tensor:
    return (strength + LEAST_STRENGTH).log() + 3.0


class Convolution(nn.Module):
    """A convolution of three columns that keeps the width; its weights are a matrix, for Muon."""

    def __init__(self, width: int) -> None:
        super().__init__()
        begin = nn.Conv1d(width, width, 3)
        self.weight = nn.Parameter(begin.weight.detach().flatten(1))
        self.bias = nn.Parameter(begin.bias.detach())

    def forward(self, x: Tensor) -> Tensor:
        """(B, width, columns) to the same."""
        weight = self.weight.unflatten(1, (x.shape[1], 3))
        return functional.conv1d(x, weight, self.bias, padding=1)


class ConvolutionBlock(nn.Module):
    """Two convolutions along the columns, added to their input."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(1, width)
        self.first = Convolution(width)
        self.second = Convolution(width)
        self.drop = nn.Dropout(DROPPED)
        nn.init.zeros_(self.second.weight)

    def forward(self, x: Tensor) -> Tensor:
        """(B, width, columns) to the same."""
        inner = functional.silu(self.first(functional.silu(self.norm(x))))
        return x + self.second(self.drop(inner))


def _blocks(width: int, count: int) -> nn.Sequential:
    return nn.Sequential(*(ConvolutionBlock(width) for _ in range(count)))


class Times(nn.Module):
    """Arrival times and the scale of their error, from inner values."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(width, OF_TIMES), nn.SiLU(), nn.Linear(OF_TIMES, 2 * len(SHARES))
        )

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """(..., width) to log times and their scale, both (..., S)."""
        step, scale = self.layers(x).chunk(2, dim=-1)
        low, high = LOG_SCALES
        # exp(step) is the time from one share to the next.
        return step.logcumsumexp(dim=-1), (scale - 2.0).clamp(low, high).exp()


class DirectNetwork(nn.Module):
    """One network of a configuration; see the module."""

    def __init__(self, config: DirectConfig) -> None:
        super().__init__()
        self.config = config
        widths = config.widths
        self.channels = config.channels
        self.stem = nn.Conv1d(TOGETHER * len(self.channels), widths[0], 3, padding=1)
        self.down = nn.ModuleList(
            nn.Conv1d(a, b, 2, stride=2) for a, b in zip(widths, widths[1:], strict=False)
        )
        self.up = nn.ModuleList(
            nn.Conv1d(b, a, 1) for a, b in zip(widths, widths[1:], strict=False)
        )
        self.inward = nn.ModuleList(_blocks(width, config.blocks) for width in widths)
        self.outward = nn.ModuleList(_blocks(width, config.blocks) for width in widths[:-1])
        self.bottom = nn.Sequential(
            nn.Linear(widths[-1], widths[-1]), nn.SiLU(), nn.Linear(widths[-1], widths[-1])
        )
        self.head = nn.Conv1d(widths[0], TOGETHER * OUTPUTS, 1)
        self.of_toes = Times(widths[0] + widths[-1])
        self.of_way = Times(widths[0] + widths[-1])
        with torch.no_grad():
            self.head.weight.mul_(0.1)

    def forward(self, seen: Tensor) -> Answer:
        """Answers for features (B, channels, C), of which it sees the effects it has learned."""
        x = self.stem(_together(seen[:, self.channels]))
        kept = []
        for block, down in zip(self.inward[:-1], self.down, strict=True):
            x = block(x)
            kept.append(x)
            x = down(x)
        x = self.inward[-1](x)
        whole = self.bottom(x.mean(dim=2))
        x = x + whole[..., None]
        for block, up, side in zip(
            reversed(self.outward), reversed(self.up), reversed(kept), strict=True
        ):
            x = block(side + up(x.repeat_interleave(2, dim=2)))
        out = _apart(self.head(x), OUTPUTS)
        weight = (4.0 * out[:, 0:2]).softmax(dim=2)
        place = torch.as_tensor(places()).to(out)
        toes = (weight * (place + out[:, 2:4])).sum(dim=2)
        low, high = LOG_SCALES
        scale = (weight * (out[:, 4:6] - 2.0)).sum(dim=2).clamp(low, high).exp()
        thickness = functional.relu(seen[:, 0] + out[:, 6])
        volume = seen[:, 0].sum(dim=1, keepdim=True)
        thickness = thickness * volume / thickness.sum(dim=1, keepdim=True).clamp(min=1e-3)
        log_times, time_scale = self._times(x, weight, whole)
        return Answer(
            toes,
            scale,
            thickness,
            (out[:, 7] - 3.0).clamp(low, high).exp(),
            log_times,
            time_scale,
        )

    def begin_with(self, other: DirectNetwork) -> None:
        """Take the weights of one of the same size, of whose effects it learns all, and others."""
        weights = {name: value.clone() for name, value in other.state_dict().items()}
        stem, old = torch.zeros_like(self.stem.weight), weights["stem.weight"]
        place = [self.channels.index(channel) for channel in other.channels]
        # Channels of neighbouring columns follow each other (`_together`).
        stem.unflatten(1, (-1, TOGETHER))[:, place] = old.unflatten(1, (-1, TOGETHER))
        self.load_state_dict({**weights, "stem.weight": stem})

    def both_ways(self, seen: Tensor) -> Answer:
        """The mean of the answers for a section and for its mirror image, which should be one."""
        found = self(torch.cat([seen, mirrored(seen)]))
        own, other = (
            Answer(*pair) for pair in zip(*(v.chunk(2) for v in vars(found).values()), strict=True)
        )
        back = Answer(
            -other.toes.flip(1),
            other.toe_scale.flip(1),
            other.thickness.flip(1),
            other.thickness_scale.flip(1),
            other.log_times[:, TURNED],
            other.time_scale[:, TURNED],
        )
        return mean_of([own, back])

    def _times(self, x: Tensor, weight: Tensor, whole: Tensor) -> tuple[Tensor, Tensor]:
        """Of both toes from the inner values where they end, of the way from those of all columns.

        Args:
            x: inner values (B, width, columns of TOGETHER).
            weight: of each column for each toe, (B, 2, C).
            whole: inner values of the section, (B, its width).
        """
        near = torch.einsum("bwn,bsn->bsw", x, weight.unflatten(2, (-1, TOGETHER)).sum(dim=3))
        toes = self.of_toes(torch.cat([near, whole[:, None].expand(-1, 2, -1)], dim=2))
        way = self.of_way(torch.cat([x.mean(dim=2), whole], dim=1))
        return tuple(torch.cat([a, b[:, None]], dim=1) for a, b in zip(toes, way, strict=True))


class DirectModel(nn.Module):
    """What answers: as many networks as the configuration says."""

    def __init__(self, config: DirectConfig) -> None:
        super().__init__()
        self.config = config
        self.networks = nn.ModuleList(DirectNetwork(config) for _ in range(config.networks))

    def check_begin(self, other: DirectModel) -> None:
        """Refuse to begin with a model that is no beginning of this one.

        Raises:
            InputError: it is of another size, has more networks, or has learned other effects.
        """
        own, old = self.config, other.config
        same = (own.widths, own.blocks) == (old.widths, old.blocks)
        if not same or old.networks > own.networks or set(old.effects) - set(own.effects):
            raise InputError(
                "--begin-with: is of another size, has more networks, or has learned effects that "
                "too few of the runs have"
            )

    def forward(self, seen: Tensor) -> Answer:
        """The mean of the networks' answers both ways.

        Their errors are in part their own: what each learned by heart of its runs.
        """
        return mean_of([network.both_ways(seen) for network in self.networks])


def mean_of(answers: Sequence[Answer]) -> Answer:
    """The mean of several answers, of times that of their logarithms."""
    columns = zip(*(vars(one).values() for one in answers), strict=True)
    return Answer(*(torch.stack(values).mean(dim=0) for values in columns))


def mirrored(seen: Tensor) -> Tensor:
    """Features (B, channels, C) of the mirror images."""
    turned = seen.flip(2).clone()
    left, right = TURNED_OVER
    turned[:, [left, right]] = -turned[:, [right, left]]
    for left, right in SIDES_CHANGED:
        turned[:, [left, right]] = turned[:, [right, left]]
    signs = [2, *(OF_SECTION + place for place in turned_effects())]
    turned[:, signs] = -turned[:, signs]
    return turned


def _together(seen: Tensor) -> Tensor:
    """Neighbouring columns become channels of one."""
    batch, channels, columns = seen.shape
    paired = seen.reshape(batch, channels, columns // TOGETHER, TOGETHER)
    return paired.permute(0, 1, 3, 2).flatten(1, 2)


def _apart(out: Tensor, channels: int) -> Tensor:
    """The reverse of `_together`."""
    batch, _, columns = out.shape
    return out.reshape(batch, channels, TOGETHER, columns).permute(0, 1, 3, 2).flatten(2)
