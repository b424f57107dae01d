"""Baselines that a trained model must beat: two ways to guess a runout without simulating anything.

In: the training runs of packed data. Out: runouts of scenes that were held out, from the scene
before it moves alone (`gns.data.scene_features`).

- *Nearest training run*: the runout, in lengths of the scene, of the run whose dimensionless
  features are nearest; or the mean of the nearest few.
- *Sliding block*: a ridge regression of the runout on the travel of a sliding block and the
  features. Each template has its own coefficients, drawn towards those that all share, which a
  scene made by hand gets.

Neither may guess beyond the wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from geometry.sides import SIDES, Side
from gns.data.dataset import Windows
from gns.data.scene_facts import SceneFacts
from gns.data.scene_features import SideView, side_view
from gns.evaluation.metrics import LEAST_TRAVEL, farther_side, runout
from gns.evaluation.score_tables import quantile

FREE = 0.3
"""A side whose wall is nearer [lengths] says nothing of how far a slide runs."""

LEAST_BLOCK_TRAVEL = 1e-3
"""Travel of the sliding block is taken as at least this [lengths], for the logarithm."""

RIDGES = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Strengths of the ridge that are tried; the least error of runs left out decides."""

OWN_RIDGE = 3.0
"""How much harder than shared coefficients those of a template are held."""


@dataclass(frozen=True)
class TrainingSide:
    """One side of a training run."""

    view: SideView
    template: str
    wall: float  # distance from the foot to the wall [m]; inf without
    runout: float  # [m]


class Baseline(Protocol):
    """Something that guesses a runout."""

    name: str

    def guess(self, view: SideView, template: str) -> float:
        """Runout in lengths of the scene, as if there were no wall."""
        ...


@dataclass(frozen=True)
class Guess:
    """A guessed runout against the simulated one, on the side that travelled the farther."""

    run: int
    template: str
    travel_m: float
    error_m: float  # guessed minus simulated
    spacing_m: float


def examples(windows: Windows) -> list[TrainingSide]:
    """Both sides of every run of a split; a side without a deposit is left out."""
    found = []
    for row, run in enumerate(windows.runs):
        facts, start, end = ends_of(windows, int(run))
        for side in SIDES:
            reached = runout(end, start, facts, side)
            if math.isfinite(reached):
                view = side_view(start, facts, side)
                wall = wall_distance(start, facts, side)
                found.append(TrainingSide(view, windows.templates[row], wall, reached))
    return found


def ends_of(windows: Windows, run: int) -> tuple[SceneFacts, np.ndarray, np.ndarray]:
    """Facts, first and last positions (N, 2) [m] of a run."""
    last = int(windows.frames[np.flatnonzero(windows.runs == run)[0]]) - 1
    first, end = windows.positions(run, 0, 1)[0], windows.positions(run, last, last + 1)[0]
    return windows.facts(run), first, end


def wall_distance(start: np.ndarray, facts: SceneFacts, side: Side) -> float:
    """Distance [m] from the foot of the section to the wall on one side; inf without walls."""
    if facts.numbers["walls_open"]:
        return math.inf
    half = 0.5 * facts.spacing
    if side == "left":
        return float(start[:, 0].min()) - half - facts.numbers["x_min"]
    return facts.numbers["x_max"] - float(start[:, 0].max()) - half


@dataclass
class NearestRun:
    """The runout of the nearest training run, or the mean of the nearest `neighbours`."""

    known: Sequence[TrainingSide]
    neighbours: int = 1
    name: str = field(init=False)

    def __post_init__(self) -> None:
        one = self.neighbours == 1
        self.name = "nearest training run" if one else f"nearest {self.neighbours} training runs"
        features = np.array([example.view.features for example in self.known])
        self._mean, self._spread = features.mean(axis=0), _spread(features)
        self._places = (features - self._mean) / self._spread
        self._runouts = np.array([one.runout / one.view.length for one in self.known])

    def guess(self, view: SideView, template: str) -> float:
        """See `Baseline`; the template is not looked at."""
        place = (view.features - self._mean) / self._spread
        distance = np.sum((self._places - place) ** 2, axis=1)
        nearest = np.argsort(distance, kind="stable")[: self.neighbours]
        return float(self._runouts[nearest].mean())


@dataclass
class SlidingBlock:
    """A regression on the travel of a sliding block and the features."""

    known: Sequence[TrainingSide]
    name: str = field(default="sliding-block regression", init=False)
    ridge: float = field(init=False)

    def __post_init__(self) -> None:
        free = [one for one in self.known if one.wall > FREE * one.view.length] or self.known
        features = np.array([one.view.features for one in free])
        self._mean, self._spread = features.mean(axis=0), _spread(features)
        self._templates = sorted({one.template for one in free})
        matrix = np.array([self._row(one.view, one.template) for one in free])
        target = np.array([one.runout / one.view.length for one in free])
        shared = len(features[0]) + 2
        own = [0.0, *[OWN_RIDGE] * (shared - 1)]
        held = np.array([0.0, *[1.0] * (shared - 1), *(own * len(self._templates))])
        # A template's own constant is held lightly, or it and the shared one would be the same.
        held[shared::shared] = 1.0
        errors = [_left_out_error(matrix, target, ridge * held) for ridge in RIDGES]
        self.ridge = RIDGES[int(np.argmin(errors))]
        self._coefficients = np.linalg.solve(
            matrix.T @ matrix + np.diag(self.ridge * held), matrix.T @ target
        )

    def guess(self, view: SideView, template: str) -> float:
        """See `Baseline`; an unknown template has the shared coefficients alone."""
        return float(self._row(view, template) @ self._coefficients)

    def _row(self, view: SideView, template: str) -> np.ndarray:
        """1, log of the block's travel and the features; and again for the scene's template."""
        travel = math.log(max(view.block_travel, LEAST_BLOCK_TRAVEL))
        shared = np.array([1.0, travel, *((view.features - self._mean) / self._spread)])
        own = [shared if template == name else 0.0 * shared for name in self._templates]
        return np.concatenate([shared, *own])


def baselines(windows: Windows) -> list[Baseline]:
    """All of them, from the training runs."""
    known = examples(windows)
    return [NearestRun(known), NearestRun(known, neighbours=3), SlidingBlock(known)]


def guess_runout(
    baseline: Baseline, start: np.ndarray, facts: SceneFacts, side: Side, template: str = ""
) -> float:
    """Runout of a scene on one side [m], never beyond the wall.

    Args:
        baseline: which.
        start: positions at t = 0, (N, 2) [m].
        facts: of the scene.
        side: left or right.
        template: letter, if it is a random scene.
    """
    view = side_view(start, facts, side)
    return min(baseline.guess(view, template) * view.length, wall_distance(start, facts, side))


def judge(baseline: Baseline, windows: Windows) -> list[Guess]:
    """Guess the runs of a split; runs whose simulation left no deposit are left out."""
    guesses = []
    for row, run in enumerate(windows.runs):
        facts, start, end = ends_of(windows, int(run))
        side, travel, reached = farther_side(end, start, facts)
        if math.isfinite(travel):
            template = windows.templates[row]
            error = guess_runout(baseline, start, facts, side, template) - reached
            guesses.append(Guess(int(run), template, travel, error, facts.spacing))
    return guesses


def summary(guesses: Iterable[Guess]) -> dict[str, float]:
    """The columns of `gns.evaluation.score_tables.COLUMNS` that a guessed runout has."""
    guesses = list(guesses)
    spacings = [abs(one.error_m) / one.spacing_m for one in guesses]
    percent = [
        100.0 * abs(one.error_m) / one.travel_m
        for one in guesses
        if one.travel_m > LEAST_TRAVEL * one.spacing_m
    ]
    return {
        "runs": float(len(guesses)),
        "runout, m": quantile([abs(one.error_m) for one in guesses], 0.5),
        "runout, d": quantile(spacings, 0.5),
        "90 %, d": quantile(spacings, 0.9),
        "runout, % of travel": quantile(percent, 0.5),
    }


def _spread(features: np.ndarray) -> np.ndarray:
    """Standard deviation of each feature, 1 for one that does not vary."""
    spread = features.std(axis=0)
    return np.where(spread > 1e-9, spread, 1.0)


def _left_out_error(matrix: np.ndarray, target: np.ndarray, held: np.ndarray) -> float:
    """Mean squared error of each row predicted from the others, in closed form."""
    inverse = np.linalg.inv(matrix.T @ matrix + np.diag(held))
    leverage = np.einsum("ij,jk,ik->i", matrix, inverse, matrix)
    residual = target - matrix @ (inverse @ (matrix.T @ target))
    return float(np.mean((residual / np.maximum(1.0 - leverage, 1e-6)) ** 2))
