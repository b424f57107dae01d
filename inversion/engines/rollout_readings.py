"""Measurements read on a rollout, with their derivatives with respect to the positions.

In: all frames of a rollout. Out: the numbers of the measurements by their own definitions, and how
they change with the positions in each frame they depend on, as `gns.rollout.differentiate` takes
it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.scenes.scene import Scene
from geometry.survey.measured import Deposit
from inversion.estimation.forward import SectionSetup


@dataclass(frozen=True)
class RolledOut:
    """A rollout that is over, as readings of the whole history see a run."""

    scene: Scene
    positions: np.ndarray
    time: np.ndarray
    initial_volume: np.ndarray
    bulk_volume: np.ndarray
    came_to_rest: bool
    status: str
    reason: str


class RolloutReading:
    """Reads all measurements on the frames of a rollout, with their derivatives.

    Args:
        setup: the question.
        scene: with all values put in.
        volume: of its points, (N,) [m2].
        frame_time: between two frames [s].
        at_rest: whether the rollout ended at rest, asked when it is over.

    Attributes:
        wanted: (m,) bool, numbers that are differentiated; None: all that can be read.
        frames: (T, N, 2) [m], once the rollout is over.
    """

    def __init__(
        self,
        setup: SectionSetup,
        scene: Scene,
        volume: np.ndarray,
        frame_time: float,
        at_rest: Callable[[], bool],
    ) -> None:
        self.setup = setup
        self.scene = scene
        self.volume = volume
        self.frame_time = frame_time
        self.at_rest = at_rest
        self.wanted: np.ndarray | None = None
        self.frames: np.ndarray | None = None
        self._known = np.zeros(len(setup.targets.names), dtype=bool)

    def __call__(self, frames: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Numbers and their derivatives by frame; those not known are left out."""
        self.frames = frames
        wanted = np.ones(len(self._known), bool) if self.wanted is None else self.wanted
        deposit = self._deposit(frames)
        values, parts, first = [], [], 0
        for entry in self.setup.targets.entries:
            places = np.arange(first, first + len(entry.values))
            first += len(places)
            chosen = wanted[places]
            if not chosen.any():
                continue
            try:
                seen = entry.observe_with_derivative(deposit)
            except ValueError:
                continue
            self._known[places[chosen]] = True
            values.append(seen.values[chosen])
            parts.append((seen.frames[chosen], seen.change[chosen]))
        return np.concatenate([np.zeros(0), *values]), _by_frame(parts, len(frames))

    def by_entry(self, slopes: np.ndarray) -> list[np.ndarray]:
        """Derivatives (m_e, p) of each measurement, NaN where they are not known."""
        whole = np.full((len(self._known), slopes.shape[1]), np.nan)
        whole[self._known] = slopes
        ends = np.cumsum([len(entry.values) for entry in self.setup.targets.entries])
        return np.split(whole, ends[:-1])

    def _deposit(self, frames: np.ndarray) -> Deposit:
        return Deposit.on(
            self.scene,
            self.setup.foot,
            frames[-1],
            frames[0],
            self.volume,
            positions=frames,
            time=self.frame_time * np.arange(len(frames)),
            at_rest=self.at_rest(),
        )


def _by_frame(parts: Sequence[tuple[np.ndarray, np.ndarray]], frames: int) -> dict:
    """Derivatives (m, N, 2) by frame from those of each measurement, (m_e, K) and (m_e, K, N, 2).

    A frame that only some of the numbers depend on has zeros for the others.
    """
    count = sum(len(numbers) for numbers, _ in parts)
    found: dict[int, np.ndarray] = {}
    first = 0
    for numbers, change in parts:
        for row, (own, slopes) in enumerate(zip(numbers, change, strict=True), start=first):
            for frame, slope in zip(own, slopes, strict=True):
                place = int(frame) % frames
                if place not in found:
                    found[place] = np.zeros((count, *slope.shape))
                found[place][row] += slope
        first += len(numbers)
    return found
