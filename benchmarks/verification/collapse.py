"""Columns of soil that collapse next to a closed wall: scene, end state, figures of a deposit.

The wall at x = 0 is smooth, so the column is the half of a symmetric one. Surfaces are measured on
the deposit and its mirror image: the smooth column height then holds up to the wall.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.columns import toe
from geometry.survey.surface_profile import surface_profile
from mpm_taichi.trajectory import Run
from pipeline.files import read_yaml

WALL_GAP = 6
"""Cells between the longest deposit expected and the right wall."""


@cache
def experiments() -> dict[str, Any]:
    """The measured numbers, with sources, of `experiments.yaml`."""
    return read_yaml(Path(__file__).with_name("experiments.yaml"))


def column_scene(
    *,
    width: float,
    height: float,
    spacing: float,
    reach: float,
    material: dict[str, float],
    **fields: Any,
) -> Scene:
    """A column on rough level ground at y = 0, next to a closed smooth wall at x = 0.

    Args:
        width: L0 [m].
        height: H0 [m].
        spacing: between material points [m].
        reach: longest deposit to make room for [m].
        material: fields of `geometry.scenes.scene.Material`.
        fields: further fields of the scene, or other values of these.
    """
    far = reach + WALL_GAP * 2 * spacing
    document = {
        "name": f"column_{height / width:.3g}",
        "domain": {"x_min": 0.0, "x_max": far, "y_max": 1.2 * height, "walls": "closed"},
        "ground": {"points": [[0.0, 0.0], [far, 0.0]], "contact": "rough"},
        "zones": [
            {
                "name": "column",
                "polygon": [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
                "material": "soil",
            }
        ],
        "materials": {"soil": material},
        "spacing": spacing,
    }
    return scene_from_mapping({**document, **fields}, "column")


def surface(
    position: np.ndarray, x: np.ndarray, *, spacing: float, smoothing: float = 1.0
) -> np.ndarray:
    """Elevation of the surface at `x` [m], the wall at x = 0 taken as a mirror.

    Lengths are first scaled to a spacing of 1 m, because the smallest length of the observables
    is half a metre. `smoothing` widens the kernel; soil that was drawn out to many times its
    length has gaps between its columns of points.
    """
    scaled = np.asarray(position, dtype=float) / spacing
    both = np.concatenate([scaled, scaled * (-1.0, 1.0)])
    return spacing * surface_profile(both, 1.0, np.asarray(x) / spacing, spacing=smoothing)


def front(position: np.ndarray, *, spacing: float, volume: float = 1.0) -> float:
    """Toe of the deposit [m]: where it is one spacing thick (`geometry.survey.columns.toe`).

    For another thickness, give it as `spacing`, and the points' volume in its square.
    """
    scaled = np.asarray(position, dtype=float) / spacing
    return spacing * toe(scaled, volume, spacing=1.0, side="right", anchor_x=3.0)


def front_history(run: Run, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and toes [m] of every n frames of a run."""
    frames = np.unique(np.append(np.arange(0, len(run.time), every), len(run.time) - 1))
    places = [front(run.positions[frame], spacing=run.scene.spacing) for frame in frames]
    return run.time[frames], np.array(places)


def stopping_time(times: np.ndarray, places: np.ndarray, *, share: float) -> float:
    """Time [s] after which the front has covered `share` of its way for good."""
    covered = (places - places[0]) / (places[-1] - places[0])
    late = np.flatnonzero(covered < share)
    return float(times[late[-1] + 1]) if len(late) else float(times[0])
