"""Which window a training sees when, and how it is prepared.

Windows are counted through the whole training: number `position` of it is a window of epoch
position // windows, in an order that follows from (seed, epoch). Its noise, mirror and length of
pushforward follow from (seed, position). So everything a step sees follows from its number: a
training that is continued sees what it would have seen, and several processes that share out the
positions of a step see together what one would have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from gns.data.dataset import Windows
from gns.network.units import MIRROR, ScaledScene, scaled
from gns.training.noise import random_walk
from pipeline.cli import InputError
from pipeline.config import TrainSettings


@dataclass(frozen=True)
class Example:
    """A window to learn from.

    Attributes:
        run: number of the run.
        frame: the last known frame.
        window: (history, N, 2) positions with their noise [spacings].
        accelerations: mean square of those of the moving points of the run, (2,) [g^2].
        after: (pushforward + unroll, N, 2) true positions of the frames that follow [spacings].
        steps_before: steps that the model takes by itself before the one that is learned.
        offset: (N, 2) what is added to the true next position to get the target [spacings].
        scene: the scene.
    """

    run: int
    frame: int
    window: Tensor
    accelerations: Tensor
    after: Tensor
    steps_before: int
    offset: Tensor
    scene: ScaledScene


class Order:
    """In which order the windows of a data set are seen.

    Args:
        count: number of windows.
        seed: of the training.
    """

    def __init__(self, count: int, seed: int) -> None:
        self.count, self.seed = count, seed
        self._epoch, self._order = -1, np.zeros(0, np.int64)

    def window(self, position: int) -> int:
        """Number of the window that is seen at a position of the training."""
        epoch, place = divmod(position, self.count)
        if epoch != self._epoch:
            order = np.random.default_rng([self.seed, 1, epoch]).permutation(self.count)
            self._epoch, self._order = epoch, order
        return int(self._order[place])


class Examples:
    """Examples by their position in the training.

    Args:
        windows: `history` known frames and at least 1 + `settings.pushforward` more.
        settings: of the training.
        device: where the examples are to be.
    """

    def __init__(
        self, windows: Windows, settings: TrainSettings, device: torch.device | str = "cpu"
    ) -> None:
        if len(windows) == 0:
            raise InputError(
                f"{windows.folder}: no run of the split {windows.split} is as long as a window of "
                f"{windows.window} frames"
            )
        self.windows, self.settings, self.device = windows, settings, device
        self.order = Order(len(windows), settings.seed)

    def at(self, position: int) -> Example:
        """The example at a position of the training."""
        settings, history = self.settings, self.windows.history
        generator = torch.Generator().manual_seed(_seed(settings.seed, position))
        place = self.order.window(position)
        if float(torch.rand((), generator=generator)) < settings.start_share:
            place = self.windows.first_of(place)
        given = self.windows[place]
        scene = scaled(given.facts)
        frames = scene.to_spacings(given.positions)
        if settings.mirror and bool(torch.randint(2, (), generator=generator)):
            scene, frames = scene.mirrored(), frames * frames.new_tensor(MIRROR)
        steps_before = int(torch.randint(settings.pushforward + 1, (), generator=generator))
        walk = random_walk(history, scene, settings.noise, generator)
        right_velocity = settings.noise_target == "velocity" and steps_before == 0
        return Example(
            run=given.run,
            frame=given.frame,
            window=(frames[:history] + walk).to(self.device),
            accelerations=torch.from_numpy(self.windows.squares(given.run)).to(
                device=self.device, dtype=scene.friction.dtype
            ),
            after=frames[history:].to(self.device),
            steps_before=steps_before,
            offset=(walk[-1] if right_velocity else torch.zeros_like(walk[-1])).to(self.device),
            scene=scene.to(device=self.device),
        )


def _seed(seed: int, position: int) -> int:
    """A seed of 63 bits for a position of the training."""
    state = np.random.SeedSequence([seed, 2, position]).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(1))
