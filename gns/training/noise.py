"""Noise on the history, so that a model learns to live with its own errors (Sanchez-Gonzalez 2020).

A random walk: the velocity of each step of the window gets a Gaussian increment, so that the last
one is off by `velocity_std`, and positions are off by the sum of what the velocities are. The unit
is sqrt(g d): the paper's 0.067 m/s at a spacing of 1 m is 0.0214, its 0.020 m/s at 0.25 m 0.0128.
Whoever asks for the output that leads to the true next position (`Simulator.target` with noisy
positions) has a target that takes the noise back.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gns.network.units import ScaledScene


def random_walk(
    history: int, scene: ScaledScene, velocity_std: float, generator: torch.Generator
) -> Tensor:
    """Offsets of the positions of a window; kinematic points have none.

    Args:
        history: frames of the window.
        scene: for its points and its frame interval.
        velocity_std: standard deviation of each component of the last velocity's error [sqrt(g d)].
        generator: on the CPU; the same numbers for every device.

    Returns:
        (history, N, 2) [spacings]; the first frame is not moved.
    """
    steps = history - 1
    increments = torch.randn(steps, scene.points, 2, generator=generator)
    velocity = increments.cumsum(0) * (velocity_std / steps**0.5)
    walk = torch.cat([torch.zeros(1, scene.points, 2), velocity.cumsum(0) * scene.frame_interval])
    walk[:, scene.kinematic.cpu()] = 0.0
    return walk.to(scene.friction)
