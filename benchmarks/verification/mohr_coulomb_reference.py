"""Mohr-Coulomb return by enumeration, in float64: the independent solution of `material_paths`.

Nothing here is ordered and no region is known beforehand. The six shear planes and the three
tension planes of principal stress space each have a normal and a flow direction,

    shear i, j   (s_i - s_j) + (s_i + s_j) sin(phi) - k <= 0,   flow e_i - e_j   (psi = 0)
    tension i    s_i - T <= 0,                                   flow e_i        (associated)

and the return s = trial - D sum(m_a l_a) with l_a >= 0, f_a <= 0, l_a f_a = 0 (Koiter) is found by
trying every set of up to three planes and keeping the one that meets all conditions.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mpm_taichi.materials.mohr_coulomb import NO_CAP

PAIRS = [(i, j) for i in range(3) for j in range(3) if i != j]


@dataclass(frozen=True)
class Soil:
    """Constants of one material in SI units; `cap` is infinite where there is none."""

    friction: float  # rad
    cohesion: float  # Pa
    youngs_modulus: float  # Pa
    poisson_ratio: float
    tension_cap: float | None = None  # Pa

    @property
    def shear_modulus(self) -> float:
        """G [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def bulk_modulus(self) -> float:
        """K [Pa]."""
        return self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poisson_ratio))

    @property
    def elasticity(self) -> np.ndarray:
        """Principal stress from principal strain, (3, 3) [Pa]."""
        lame = self.bulk_modulus - 2.0 / 3.0 * self.shear_modulus
        return lame * np.ones((3, 3)) + 2.0 * self.shear_modulus * np.eye(3)

    @property
    def apex(self) -> float:
        """Tension at the apex, c cot(phi) [Pa]; infinite for phi = 0."""
        return self.cohesion / np.tan(self.friction) if self.friction > 0 else np.inf

    @property
    def cap(self) -> float:
        """T [Pa]."""
        return self.apex if self.tension_cap is None else min(self.apex, self.tension_cap)

    def planes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Normals (A, 3), offsets (A,) [Pa] and flow directions (A, 3); shear planes come first."""
        sine, axes = np.sin(self.friction), np.eye(3)
        normals = [(1.0 + sine) * axes[i] - (1.0 - sine) * axes[j] for i, j in PAIRS]
        flows = [axes[i] - axes[j] for i, j in PAIRS]
        offsets = [2.0 * self.cohesion * np.cos(self.friction)] * len(PAIRS)
        if self.cap < 0.1 * NO_CAP:
            normals += list(axes)
            flows += list(axes)
            offsets += [self.cap] * 3
        return np.array(normals), np.array(offsets), np.array(flows)


@dataclass
class Returned:
    """Returned stresses of N trials."""

    stress: np.ndarray  # (N, 3) [Pa], in the order of the trial
    multipliers: np.ndarray  # (N, A) plastic multipliers [-]
    violation: np.ndarray  # (N,) what the best set of planes leaves unmet [Pa]
    spread: np.ndarray  # (N,) largest difference between sets that meet all conditions [Pa]


def enumerate_return(trial: np.ndarray, soil: Soil, tolerance: float = 1e-9) -> Returned:
    """Return principal trial stresses (N, 3) [Pa] to yield by trying all sets of planes.

    Args:
        trial: principal stresses in any order [Pa].
        soil: the material.
        tolerance: share of the stress scale below which a condition counts as met.
    """
    normals, offsets, flows = soil.planes()
    elasticity, scale = soil.elasticity, stress_scale(trial, soil)
    best = np.full(len(trial), np.inf)
    stress = np.array(trial, dtype=float)
    multipliers = np.zeros((len(trial), len(normals)))
    low, high = np.full_like(stress, np.inf), np.full_like(stress, -np.inf)
    for chosen, matrix in sets_of_planes(normals, flows, elasticity):
        rows = list(chosen)
        factors = np.zeros_like(multipliers)
        if rows:
            excess = trial @ normals[rows].T - offsets[rows]
            factors[:, rows] = np.linalg.solve(matrix, excess.T).T
        new = trial - factors @ flows @ elasticity
        over = (new @ normals.T - offsets).max(axis=1)
        negative = -factors.min(axis=1) * soil.shear_modulus
        unmet = np.maximum(np.maximum(over, negative), 0.0)
        better = unmet < best - 1e-12 * scale
        best[better], stress[better], multipliers[better] = (
            unmet[better],
            new[better],
            factors[better],
        )
        good = (unmet <= tolerance * scale)[:, None]
        low, high = (
            np.where(good, np.minimum(low, new), low),
            np.where(good, np.maximum(high, new), high),
        )
    return Returned(stress, multipliers, best, np.max(high - low, axis=1))


def sets_of_planes(
    normals: np.ndarray, flows: np.ndarray, elasticity: np.ndarray
) -> Iterator[tuple[tuple[int, ...], np.ndarray]]:
    """All sets of none to three planes whose multipliers are determined, with their matrix [Pa]."""
    whole = normals @ elasticity @ flows.T
    size = np.abs(whole).max()
    for count in range(4):
        for chosen in itertools.combinations(range(len(normals)), count):
            matrix = whole[np.ix_(chosen, chosen)]
            if count == 0 or abs(np.linalg.det(matrix / size)) > 1e-9:
                yield chosen, matrix


def stress_scale(trial: np.ndarray, soil: Soil) -> np.ndarray:
    """The larger of the trial stress and the cohesion (N,) [Pa]: what errors are measured by."""
    return np.maximum(np.abs(trial).max(axis=1), max(soil.cohesion, 1.0))


def region_names(returned: Returned, soil: Soil) -> np.ndarray:
    """Name of the region of the yield surface each trial was returned to, (N,) str."""
    size = 1e-9 * (1.0 + np.abs(returned.multipliers).max(axis=1, keepdims=True))
    active = returned.multipliers > size
    shearing = active[:, : len(PAIRS)].any(axis=1)
    opened = active[:, len(PAIRS) :].sum(axis=1)
    ordered = -np.sort(-returned.stress, axis=1)
    near = 1e-7 * stress_scale(returned.stress, soil)
    upper = ordered[:, 0] - ordered[:, 1] <= near
    lower = ordered[:, 1] - ordered[:, 2] <= near
    names = np.full(len(active), "elastic", dtype=object)
    alone = shearing & (opened == 0)
    names[alone] = "shear: main plane"
    names[alone & upper] = "shear: edge hi = mid"
    names[alone & lower] = "shear: edge mid = lo"
    for count, word in ((1, "one stress"), (2, "two stresses"), (3, "three stresses")):
        names[(opened == count) & ~shearing] = f"tension: {word} at the cap"
    both = shearing & (opened > 0)
    names[both] = "corner: shear and tension"
    names[both & upper] = "corner: shear and tension, hi = mid"
    names[both & lower] = "corner: shear and tension, mid = lo"
    if np.isfinite(soil.apex) and soil.cap == soil.apex:
        names[(opened > 0) & upper & lower] = "apex"
    return names
