"""Trajectory files of runs that cost nothing: points fly freely and stop on the ground."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from geometry.scenes.scene import Origin, Scene
from mpm_taichi.trajectory import Run, write_runs
from pipeline.config import SimulationSettings
from tests.mpm_taichi.ballistic import FAST, fly, make_scene

LETTERS = "abcde"


def scene_of(number: int, *, scale: str = "coarse", spacing: float = 2.0, **changes) -> Scene:
    """A thrown block on a layer; its template follows from its number."""
    origin = Origin(
        template=LETTERS[number % 5], scale=scale, index=number, draws=1, materials="wide"
    )
    scene = make_scene(number, spacing=spacing)
    # No two are the same: a model would refuse to be judged by what it has learned from.
    scene = scene.with_strength("liquefied fill", cohesion_kpa=18.7 + 0.01 * number)
    return scene.changed(origin=origin.model_dump(), **changes)


def run_of(number: int, settings: SimulationSettings = FAST, **changes) -> Run:
    """Its run."""
    return fly(scene_of(number, **changes), settings)


def write_batch(
    path: Path,
    numbers: Iterable[int],
    *,
    alter: Callable[[int, Run], None] = lambda number, run: None,
    settings: SimulationSettings = FAST,
    **changes,
) -> Path:
    """A trajectory file of such runs; `alter` may spoil them."""
    runs = {}
    for number in numbers:
        runs[number] = run_of(number, settings, **changes)
        alter(number, runs[number])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_runs(path, runs)
    return path
