"""Vertical effective stress of a section by the weight above it: sigma'_v0 of the field.

In: a section and points in it. Out: the weight above each point less the pressure of the pore
water, which is hydrostatic below the phreatic line; a pool rests on what it covers. No shear
between columns, so no arching: what practice divides strengths by, and reads relations with blow
count at. It depends on the section alone, hardly on the spacing.
"""

from __future__ import annotations

import numpy as np

from geometry.scenes.scene import Scene

#: Of fresh water [kg/m3].
WATER_DENSITY = 1000.0


def vertical_effective_stress(
    scene: Scene, position: np.ndarray, volume: np.ndarray, mass: np.ndarray, gravity: float
) -> np.ndarray:
    """Vertical effective stress at points that fill a section, (N,) [Pa], compression positive.

    Args:
        scene: with its spacing and water.
        position: of the points, (N, 2) [m].
        volume: of the points, (N,) [m2 per m of width].
        mass: of the points, (N,) [kg/m].
        gravity: [m/s2].
    """
    spacing = scene.spacing
    wet = position[:, 1] < scene.phreatic_level(position[:, 0])
    weight = gravity * (mass - WATER_DENSITY * volume * wet) / spacing
    column = np.floor((position[:, 0] - scene.domain.x_min) / spacing).astype(int)
    order = np.lexsort((-position[:, 1], column))
    running = np.cumsum(weight[order])
    start = np.flatnonzero(np.diff(column[order], prepend=column[order][0] - 1))
    before = np.repeat(
        np.concatenate([[0.0], running])[start], np.diff(np.append(start, len(order)))
    )
    stress = np.empty(len(position))
    stress[order] = running - before - 0.5 * weight[order]
    return stress


def stress_in_kpa(
    scene: Scene, position: np.ndarray, volume: np.ndarray, zone: np.ndarray, gravity: float
) -> np.ndarray:
    """`vertical_effective_stress` by the densities of the section, (N,) [kPa].

    Args:
        scene: the section.
        position: of the points that fill it, (N, 2) [m].
        volume: of them, (N,) [m2 per m of width].
        zone: of them, (N,) place in the scene's zones.
        gravity: [m/s2].
    """
    wet = position[:, 1] < scene.phreatic_level(position[:, 0])
    soils = [scene.materials[one.material] for one in scene.zones]
    dry = np.array([soil.density for soil in soils])
    saturated = [soil.saturated_density for soil in soils]
    soaked = np.array([d if s is None else s for s, d in zip(saturated, dry, strict=True)])
    mass = np.where(wet, soaked[zone], dry[zone]) * volume
    return 1e-3 * vertical_effective_stress(scene, position, volume, mass, gravity)


def mean_and_deviation(values: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Weighted mean and standard deviation of values (n,), in their unit."""
    share = weight / weight.sum()
    mean = float((share * values).sum())
    return mean, float(np.sqrt((share * (values - mean) ** 2).sum()))
