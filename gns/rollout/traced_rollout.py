"""A rollout that is to be differentiated: the positions of every frame, and little else.

In: a simulator, a `ScaledScene` and a first window. Out: a `Trace`. `gns.rollout.differentiate`
recomputes the steps from these positions, so that a frame more costs its positions and nothing
else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from gns.network.graph import Graph
from gns.network.simulator import Simulator
from gns.network.units import ScaledScene
from pipeline.cli import WorkFailed

Until = Callable[[Tensor, Tensor], bool]
"""Positions after and before a step (N, 2) [spacings] -> the rollout ends with this step. It may
raise `WorkFailed` where the step makes no sense."""


@dataclass
class Trace:
    """Record of a rollout for its derivative.

    Attributes:
        positions: (history - 1 + T, N, 2) [spacings], the first window's own frames before t = 0.
        scene: the scene that was rolled out.
        graphs: edges of each step, where they were asked for.
    """

    positions: Tensor
    scene: ScaledScene
    history: int
    graphs: list[Graph] = field(default_factory=list)

    @property
    def frames(self) -> np.ndarray:
        """(T, N, 2) float64 [m], the first at t = 0."""
        return self.scene.to_metres(self.positions[self.history - 1 :])

    def window(self, frame: int) -> Tensor:
        """(history, N, 2), the last of which is `frame`."""
        return self.positions[frame : frame + self.history]


def trace(
    simulator: Simulator,
    scene: ScaledScene,
    window: np.ndarray,
    frames: int,
    *,
    record: bool = False,
    graphs: Sequence[Graph] | None = None,
    until: Until | None = None,
) -> Trace:
    """Roll out and keep the positions.

    Args:
        simulator: the model.
        scene: of any type of number; it decides that of the rollout.
        window: (history, N, 2) [m], the last at t = 0.
        frames: T, t = 0 among them.
        record: keep the edges of each step too (a finite-difference check wants them).
        graphs: edges to be used instead of those found, one for each step.
        until: ends the rollout before its last frame; None: never.

    Raises:
        WorkFailed: a position is not a finite number.
    """
    history = simulator.config.history
    first = scene.to_spacings(window)
    positions = first.new_empty(history - 1 + frames, *first.shape[1:])
    positions[:history] = first
    result = Trace(positions, scene, history)
    with torch.no_grad():
        for frame in range(frames - 1):
            known = result.window(frame)
            graph = simulator.graph(known[-1]) if graphs is None else graphs[frame]
            if record:
                result.graphs.append(graph)
            after = simulator.advance(known, scene, graph)
            positions[frame + history] = finite_step(after, frame + 1)
            if until is not None and until(after, known[-1]):
                result.positions = positions[: frame + history + 1].clone()
                break
    return result


def finite_step(positions: Tensor, frame: int) -> Tensor:
    """The same positions.

    Raises:
        WorkFailed: one of them is not a finite number.
    """
    if not bool(torch.isfinite(positions).all()):
        raise WorkFailed(f"the rollout fails at frame {frame}: a position is not a finite number")
    return positions
