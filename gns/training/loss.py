"""The training loss: the mean squared error of the normalised acceleration (paper, Eq. 3).

The mean is over the soil points of all examples of a step, in all processes together; kinematic
points are imposed, not learned. The target is what leads from the noisy positions to the true next
ones (`noise_target: position`), or to the true next velocity. With `pushforward` the model first
takes some steps by itself, without gradient, and learns to come back from where it got.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from gns.network.simulator import Simulator
from gns.training.sampling import Example


class TrainingObjective(nn.Module):
    """A simulator with its loss, one module so that gradients of processes are averaged as a whole.

    Args:
        simulator: the model that learns.
        unroll: steps in a row through which the loss is differentiated.
        balance: divide the loss of each example by the mean square of its run's accelerations, plus
            this in units of the training's variance; 0: all examples count as they are (paper). Of
            the run and not of the window: a slope about to fail and one at rest look alike, and if
            rest counted more, the model would learn that nothing ever begins to move.
    """

    def __init__(self, simulator: Simulator, unroll: int = 1, balance: float = 0.0) -> None:
        super().__init__()
        self.simulator = simulator
        self.unroll = unroll
        self.balance = balance

    def forward(self, examples: Sequence[Example]) -> Tensor:
        """Sum over soil points of the squared error, mean of its two components.

        The error of step k of a row is the position's, over what a constant error of the
        acceleration would have made of it by then, k (k + 1) / 2 times that of the first step: so a
        drift counts alike in all of them, and the first alone is the loss of a single step.
        """
        windows = [self._pushed(example) for example in examples]
        scenes = [example.scene for example in examples]
        soil = torch.cat([~scene.kinematic for scene in scenes])
        weights = torch.cat([self._weight(example) for example in examples]) * soil
        total = 0.0
        for step in range(1, self.unroll + 1):
            output = self.simulator(windows, scenes)
            parts = output.split([scene.points for scene in scenes])
            errors, following = [], []
            for window, part, example in zip(windows, parts, examples, strict=True):
                after = example.after[example.steps_before + step - 1]
                if step == 1:
                    after = after + example.offset
                before, now = window[-2], window[-1]
                target = self.simulator.target(before, now, after, example.scene)
                errors.append((part - target).square().mean(dim=1))
                if step < self.unroll:
                    moved = self.simulator.next_positions(part, before, now, example.scene)
                    following.append(torch.cat([window[1:], moved[None]]))
            share = (0.5 * step * (step + 1)) ** 2 * self.unroll
            total = total + (torch.cat(errors) * weights).sum() / share
            windows = following
        return total

    def _weight(self, example: Example) -> Tensor:
        """Weight of the points of an example in the loss, (N,)."""
        one = torch.ones_like(example.scene.friction)
        if self.balance == 0.0:
            return one
        squares = example.accelerations / self.simulator.acceleration_std.square()
        return one / (squares.mean() + self.balance)

    @torch.no_grad()
    def _pushed(self, example: Example) -> Tensor:
        window = example.window
        for _ in range(example.steps_before):
            after = self.simulator.advance(window, example.scene)
            window = torch.cat([window[1:], after[None]])
        return window


def soil_points(examples: Sequence[Example]) -> int:
    """Number of points over which the loss of these examples is a mean."""
    return sum(int((~example.scene.kinematic).sum()) for example in examples)
