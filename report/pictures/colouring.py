"""Colouring of points: values of a run by frame, colour maps, colours of materials.

In: a `Run`. Out: a `Colouring`, one colour scale for all its frames. The maps are even in lightness
and keep their order for every kind of colour vision; the material colours follow Okabe and Ito
(2008) and Tol (2021).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize

from geometry.scenes.scene import Scene
from mpm_taichi.trajectory import Run
from pipeline.cli import InputError

COLOURS = ("displacement", "plastic_strain", "speed", "material")

LIQUEFIED_COLOURS = ("#d55e00", "#e69f00", "#882255", "#f0a58a")
SOIL_COLOURS = ("#ddcc77", "#117733", "#44aa99", "#999933", "#aa4499", "#bbbbbb", "#332288")


@dataclass(frozen=True)
class Colouring:
    """How one quantity is shown: its values in a frame, its map and its label."""

    values: Callable[[int], np.ndarray]  # frame -> (N,)
    colour_map: Colormap
    norm: Normalize
    label: str  # empty: no colour bar (materials have a legend)


def colouring_of(run: Run, colour: str) -> Colouring:
    """The colour scale of a quantity, common to all frames of a run.

    Args:
        run: a run with at least one frame.
        colour: one of `COLOURS`. Plastic strain is known at the end only and is shown in every
            frame on the point that will suffer it.
    """
    if colour == "material":
        colours = list(material_colours(run.scene).values())
        norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
        return Colouring(lambda frame: run.material, ListedColormap(colours), norm, "")
    if colour == "displacement":
        values, name, label = displacement(run), "magma_r", "displacement (m)"
    elif colour == "speed":
        values, name, label = speed(run), "YlOrBr", "speed (m/s)"
    elif colour == "plastic_strain":
        end = run.plastic_shear_strain
        values, name, label = (lambda frame: end), "magma_r", "plastic shear strain at the end"
    else:
        raise InputError(f"colour {colour!r} is unknown; allowed: {', '.join(COLOURS)}")
    sample = np.unique(np.linspace(0, run.frames - 1, 12).round().astype(int))
    top = max(_upper(values(frame)) for frame in sample)
    return Colouring(values, _soil_map(name), Normalize(0.0, rounded_up(top)), label)


def displacement(run: Run) -> Callable[[int], np.ndarray]:
    """Distance of every point from its first place [m], by frame."""
    return lambda frame: np.linalg.norm(run.positions[frame] - run.positions[0], axis=1)


def speed(run: Run) -> Callable[[int], np.ndarray]:
    """Speed of every point [m/s] by frame, from the frames before and after."""

    def values(frame: int) -> np.ndarray:
        before, after = max(frame - 1, 0), min(frame + 1, run.frames - 1)
        if before == after:
            return np.linalg.norm(run.velocity, axis=1)
        moved = np.linalg.norm(run.positions[after] - run.positions[before], axis=1)
        return moved / (run.time[after] - run.time[before])

    return values


def material_colours(scene: Scene) -> dict[str, str]:
    """A colour per material: warm, strong ones for what liquefies, calm ones for the rest."""
    used = {True: 0, False: 0}
    colours = {}
    for name, material in scene.materials.items():
        palette = LIQUEFIED_COLOURS if material.liquefied else SOIL_COLOURS
        colours[name] = palette[used[material.liquefied] % len(palette)]
        used[material.liquefied] += 1
    return colours


def rounded_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten, for the end of a colour scale."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 1.5, 2, 3, 4, 5, 6, 8, 10]) * power
    return float(steps[np.searchsorted(steps, value * (1 - 1e-9))])


def _soil_map(name: str) -> Colormap:
    """A map without its ends: soil at rest is seen on white paper, black lines on fast soil."""
    start, end = (0.07, 0.9) if name == "magma_r" else (0.12, 0.97)
    return ListedColormap(matplotlib.colormaps[name](np.linspace(start, end, 256)), name=name)


def _upper(values: np.ndarray) -> float:
    """Nearly the largest value: a few stray points must not use up the colour scale."""
    values = values[np.isfinite(values)]
    return float(np.quantile(values, 0.995)) if len(values) else 0.0
