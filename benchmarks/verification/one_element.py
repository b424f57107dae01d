"""The solver's material law driven point by point, without a grid.

`solver_return` returns trial stresses to yield, `solver_path` follows displacement gradients; both
call the functions that the time loop calls.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import numpy as np
import taichi as ti

from benchmarks.verification.mohr_coulomb_reference import Soil
from mpm_taichi.layout import VEC4, VEC8, vec4
from mpm_taichi.materials.elasticity import elastic_constants, elastic_trial
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, material_constants
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver.stress import area_rate, stress_functions

return_to_yield = stress_functions(MOHR_COULOMB).return_to_yield


@ti.kernel
def return_all(trial: VEC4, elastic: VEC4, strength: VEC8, stress: VEC4, plastic: VEC4):
    """`return_to_yield` of each trial; `plastic` holds (shear, opening, work, 0)."""
    for p in trial:
        t = trial[p]
        circle = vec4(0.5 * (t[0] + t[1]), 0.5 * (t[0] - t[1]), t[2], t[3])
        new, shear, opening, work = return_to_yield(circle, elastic[p], strength[p], 0)
        stress[p] = new
        plastic[p] = vec4(shear, opening, work, 0.0)


@ti.kernel
def step_all(stress: VEC4, gradient: VEC4, elastic: VEC4, strength: VEC8):
    """One step of unit time of each element: elastic trial, return to yield."""
    for p in stress:
        g = gradient[p]
        trial = elastic_trial(stress[p], g, area_rate(g, 1.0), 1.0, elastic[p])
        new, _, _, _ = return_to_yield(trial, elastic[p], strength[p], 0)
        stress[p] = new


def constants(soil: Soil, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Elastic constants (count, 4) and strength (count, 8) of one soil as the kernels read them."""
    elastic = elastic_constants(
        youngs_modulus=soil.youngs_modulus, poisson_ratio=soil.poisson_ratio
    )
    strength = material_constants(
        friction_angle=soil.friction, cohesion=soil.cohesion, tension_cap=soil.tension_cap
    )
    return np.tile(elastic, (count, 1)), np.tile(strength, (count, 1))


def solver_return(trial: np.ndarray, soil: Soil) -> tuple[np.ndarray, np.ndarray]:
    """The solver's return of trial stresses (N, 4) [Pa]: stress (N, 4) [Pa], plastic (N, 3)."""
    start("cpu", 1)
    trial = np.ascontiguousarray(trial, np.float32)
    stress, plastic = np.zeros_like(trial), np.zeros_like(trial)
    return_all(trial, *constants(soil, len(trial)), stress, plastic)
    return stress.astype(float), plastic[:, :3].astype(float)


def solver_path(begin: np.ndarray, gradients: np.ndarray, soil: Soil) -> np.ndarray:
    """The solver's stresses (S + 1, N, 4) [Pa] along displacement gradients (S, N, 2, 2) [-]."""
    start("cpu", 1)
    stress = np.ascontiguousarray(begin, np.float32)
    history = [stress.astype(float)]
    table = constants(soil, len(stress))
    for gradient in gradients:
        columns = gradient.transpose(0, 2, 1).reshape(-1, 4)  # dvx/dx, dvy/dx, dvx/dy, dvy/dy
        step_all(stress, np.ascontiguousarray(columns, np.float32), *table)
        history.append(stress.astype(float))
    return np.stack(history)
