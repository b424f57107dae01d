"""The interface of a truth by another code: a scene and what is hidden in it -> a slide.

A code knows particles, their strength, forces on them and the ground, but no effect by name: what
is hidden comes as a `hidden.Loading`, the same for every code. So a code that can change the
strength of its particles and push them can hide nearly all that can be hidden at all.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from typing import Protocol

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from benchmarks.hidden_effects.foreign.hidden import Hidden
from geometry.scenes.scene import Scene
from geometry.survey.measured import Deposit, Measured
from pipeline.cli import InputError

#: A slide that keeps less of its area than this has collapsed and is no truth.
LEAST_AREA = 0.94
#: Places of the raster per spacing, along each axis.
RASTER = 4
#: Gaps between points narrower than twice this many spacings belong to the soil.
GAP = 1.0


@dataclass(frozen=True)
class Slide:
    """A slide as a code made it. N points, T frames.

    Attributes:
        scene: the section as it was before the slide, with all that was hidden in its geometry.
        zone: of each point, place in ``scene.zones``, (N,).
        positions: frames, the first before anything moved, (T, N, 2) [m].
        time: of the frames, (T,) ascending from 0 [s].
        at_rest: nothing moves after the last frame.
    """

    scene: Scene
    zone: np.ndarray
    positions: np.ndarray
    time: np.ndarray
    at_rest: bool

    @property
    def initial(self) -> np.ndarray:
        """Points before the slide, (N, 2) [m]."""
        return self.positions[0]

    @property
    def final(self) -> np.ndarray:
        """Points at the last frame, (N, 2) [m]."""
        return self.positions[-1]

    @property
    def spacing(self) -> float:
        """Distance between points before the slide [m]."""
        return self.scene.spacing

    @cached_property
    def volumes(self) -> np.ndarray:
        """Room of each point at the last frame, (N,) [m2 per m]: what a surveyor would measure."""
        # The raster's own bias, of the points before the slide, is taken off.
        before = rooms(self.initial, self.spacing).sum()
        return rooms(self.final, self.spacing) * (len(self.zone) * self.spacing**2 / before)

    @property
    def area_kept(self) -> float:
        """Area of the deposit over that of the section."""
        return float(self.volumes.sum() / (len(self.zone) * self.spacing**2))

    def deposit(self, judged: Scene) -> Deposit:
        """The slide as measurements see it.

        Args:
            judged: the section that the judge is given: its feet and its ground are what the
                survey knows.
        """
        return Deposit.on(
            judged.changed(spacing=self.spacing),
            {side: judged.foot(side) for side in ("left", "right")},
            self.final,
            self.initial,
            self.spacing**2,
            volume=self.volumes,
            positions=self.positions,
            time=self.time,
            at_rest=self.at_rest,
        )

    def reading(self, entries: Sequence[Measured], judged: Scene) -> np.ndarray:
        """All measurements as they would read on this slide, (m,), in the unit of each.

        Raises:
            ValueError: one cannot be read on it.
        """
        deposit = self.deposit(judged)
        return np.concatenate([entry.observe(deposit) for entry in entries])


def rooms(position: np.ndarray, spacing: float) -> np.ndarray:
    """Area that belongs to each point, (N,) [m2]: its cell among the points, within the soil.

    The soil is the closing of the points: all that cannot be reached from outside by a disc of
    `GAP` spacings, less what lies beyond half a spacing from its outermost points.
    """
    step = spacing / RASTER
    margin = 2.0 * GAP * spacing
    low = position.min(axis=0) - margin
    count = np.ceil((position.max(axis=0) + margin - low) / step).astype(int)
    axes = [low[k] + step * (np.arange(count[k]) + 0.5) for k in (0, 1)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distance, nearest = cKDTree(position).query(places.reshape(-1, 2))
    near = (distance <= GAP * spacing).reshape(count)
    inside = distance_transform_edt(near, sampling=step) > (GAP - 0.5) * spacing
    return np.bincount(nearest[inside.ravel()], minlength=len(position)) * step**2


class Simulate(Protocol):
    """What a code's module calls `simulate`."""

    def __call__(
        self,
        scene: Scene,
        hidden: Sequence[Hidden],
        *,
        duration_s: float,
        frames: int,
        seed: int,
        threads: int | None = None,
    ) -> Slide:
        """Simulate a slide.

        Args:
            scene: the section as the judge's base model has it, with the true strengths and the
                spacing of the slide; its own `effects` are not read.
            hidden: what else is true; empty: nothing.
            duration_s: longest slide [s]; one that has come to rest before ends earlier.
            frames: number of equal steps of time of `duration_s` at whose ends positions are kept.
            seed: of the places of the points.
            threads: CPU threads; None: all.

        Raises:
            WorkFailed: the code failed, or the slide did not keep `LEAST_AREA`; one line.
            InputError: the code cannot hide that; one line.
        """
        ...


@dataclass(frozen=True)
class Source:
    """A code that makes slides.

    Attributes:
        name: in a plan; words: what it is, for tables.
        module: that holds `simulate`, and `HIDES`: names of what it can hide.
        needs: module of an optional package without which it cannot run; empty: none.
        python: environment variable that names a Python which has it; empty: this one must.
    """

    name: str
    words: str
    module: str
    needs: str = ""
    python: str = ""

    @property
    def missing(self) -> str:
        """Why it cannot run here; empty: it can."""
        if not self.needs or os.environ.get(self.python) or find_spec(self.needs) is not None:
            return ""
        if self.python:
            return f"{self.name} needs a Python with the package {self.needs} in {self.python}"
        return f"{self.name} needs the package {self.needs}: pip install 'flowslide[foreign]'"

    @property
    def hides(self) -> tuple[str, ...]:
        """Names of what it can hide; known without its package."""
        return import_module(self.module).HIDES

    @property
    def simulate(self) -> Simulate:
        """The code.

        Raises:
            InputError: its package is not installed.
        """
        if self.missing:
            raise InputError(self.missing)
        return import_module(self.module).simulate


_HERE = "benchmarks.hidden_effects.foreign"
SOURCES: Mapping[str, Source] = {
    one.name: one
    for one in (
        Source("own", "the judge's own solver", f"{_HERE}.own"),
        Source("newton", "newton 1.8, implicit MPM", f"{_HERE}.newton_mpm", "newton"),
        Source("genesis", "Genesis 1.4, explicit MPM", f"{_HERE}.genesis_mpm", "genesis",
               "FLOWSLIDE_GENESIS_PYTHON"),
        Source("smoothed_particles", "smoothed particles", f"{_HERE}.smoothed_particles"),
    )
}  # fmt: skip


def source(name: str) -> Source:
    """A code by name.

    Raises:
        InputError: there is none; one line.
    """
    if name not in SOURCES:
        raise InputError(f"source: {name!r} is unknown; known: {', '.join(SOURCES)}")
    return SOURCES[name]
