"""What a training minimises: the mean squared error of the normalised acceleration (paper, Eq. 3).

The mean is over the soil points of all examples of a step, in all processes together; kinematic
points are imposed, not learned. The target is what leads from the noisy positions to the true next
ones (`noise_target: position`), or to the true next velocity. With `pushforward` the model first
takes some steps by itself, without gradient, and learns to come back from where it got.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from gns.sampling import Example
from gns.simulator import Simulator


class Objective(nn.Module):
    """A simulator with its loss, one module so that gradients of processes are averaged as a whole.

    Args:
        simulator: the model that learns.
    """

    def __init__(self, simulator: Simulator) -> None:
        super().__init__()
        self.simulator = simulator

    def forward(self, examples: Sequence[Example]) -> Tensor:
        """Sum over soil points of the squared error, mean of its two components."""
        windows, targets, soil = [], [], []
        for example in examples:
            window = self._pushed(example)
            after = example.after[example.steps_before] + example.offset
            windows.append(window)
            targets.append(self.simulator.target(window[-2], window[-1], after, example.scene))
            soil.append(~example.scene.kinematic)
        output = self.simulator(windows, [example.scene for example in examples])
        errors = (output - torch.cat(targets)).square().mean(dim=1)
        return (errors * torch.cat(soil)).sum()

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
