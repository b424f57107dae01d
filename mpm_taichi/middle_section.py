"""The middle section of a slide in three dimensions, as a run of two dimensions.

So all that reads sections (measurements, pictures, back-analysis) reads it. Points of the middle
row stay in the middle where both halves mirror each other; soil that drifts sideways is seen in the
distance between the rows next to it, by which the area of each point is divided.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.scenes.scene import Scene
from mpm_taichi.trajectory import Run
from mpm_taichi.trajectory3d import Run3d
from pipeline.cli import InputError
from pipeline.config import SimulationSettings

if TYPE_CHECKING:
    from mpm_taichi.solver3d.problem import Problem3d

STRETCH = (0.2, 5.0)
"""Limits of the sideways stretch of soil that areas are divided by."""


@dataclass
class MiddleSection(Run):
    """A run of two dimensions whose points have areas of their own."""

    area: np.ndarray | None = None  # (N,) [m2], at the end

    @property
    def bulk_volume(self) -> np.ndarray:
        """Area of the points as a survey of the deposit sees it [m2]."""
        return super().bulk_volume if self.area is None else self.area


def middle_section(
    problem: Problem3d, run: Run3d, scene: Scene, settings: SimulationSettings
) -> MiddleSection:
    """The middle row of an extruded section.

    Args:
        problem: of `extruded`.
        run: its run.
        scene: the section.
        settings: of the run.

    Raises:
        InputError: fewer than three rows across.
    """
    y = problem.position[:, 1]
    rows = np.unique(y)
    if len(rows) < 3:
        raise InputError(f"{scene.name}: the width holds {len(rows)} rows of points; 3 are needed")
    middle = len(rows) // 2
    before, own, after = (np.flatnonzero(y == rows[middle + step]) for step in (-1, 0, 1))
    apart = run.positions[-1][after, 1] - run.positions[-1][before, 1]
    stretch = np.clip(apart.astype(float) / (rows[middle + 1] - rows[middle - 1]), *STRETCH)
    area = problem.volume[own] / (rows[1] - rows[0])
    plane, stress = [0, 2], [0, 2, 1, 5]  # x, z; xx, zz, yy, xz of xx, yy, zz, xy, yz, xz
    return MiddleSection(
        scene=scene,
        settings=settings,
        positions=run.positions[:, own][:, :, plane],
        time=run.time,
        material=run.material[own],
        zone=run.zone[own],
        kinematic=np.zeros(len(own), bool),
        velocity=run.velocity[own][:, plane],
        stress=run.stress[own][:, stress],
        initial_stress=run.initial_stress[own][:, stress],
        plastic_shear_strain=run.plastic_shear_strain[own],
        initial_volume=area.astype(np.float32),
        volume=run.volume[own],
        energy={},
        audit=dict(run.audit),
        status=run.status,
        reason=run.reason,
        wall_time_s=run.wall_time_s,
        steps=run.steps,
        area=area / stretch,
    )
