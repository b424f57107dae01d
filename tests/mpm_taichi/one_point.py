"""One material point with effects on, led through a given path of velocity gradients.

The point goes through the functions that the schedules call: effects renew its strength, then its
stress is updated. Nothing else of the solver takes part, so closed forms hold to rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import taichi as ti

from mpm_taichi.effects import Effect, effect
from mpm_taichi.effects.framework.hooks import effect_functions
from mpm_taichi.effects.framework.table import (
    CAP,
    COHESION,
    LIQUEFIED,
    OVERBURDEN,
    TANGENT,
    EffectTable,
)
from mpm_taichi.materials.mohr_coulomb import NO_CAP, material_constants
from mpm_taichi.solver.layout import (
    CELL,
    F32,
    I32,
    INDEX,
    INTEGERS,
    MEAN_OVERBURDEN,
    NUMBERS,
    VEC4,
    VEC8,
)
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import start


@dataclass(frozen=True)
class Soil:
    """Of the point, in SI; before failure it carried `overburden`, liquefied soil the mean [Pa]."""

    friction: float = 0.0  # tan(phi)
    cohesion: float = 0.0
    liquefied: bool = False
    youngs_modulus: float = 30e6
    poisson_ratio: float = 0.3
    overburden: float = 0.0
    mean_overburden: float = 0.0

    @property
    def shear_modulus(self) -> float:
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def bulk_modulus(self) -> float:
        return self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poisson_ratio))


@dataclass(frozen=True)
class Path:
    """What the point went through, one row a step."""

    stress: np.ndarray  # (S, 4) xx, yy, zz, xy [Pa]
    volumetric: np.ndarray  # (S,) volumetric strain
    opening: np.ndarray  # (S,)
    shear: np.ndarray  # (S,) plastic shear strain
    dissipated: np.ndarray  # (S,) [J/m3] of the first volume
    strength: np.ndarray  # (S, 8) sin phi, k, tension cap, ...


@cache
def _compiled(one: Effect, program: object) -> tuple[EffectTable, Callable]:
    """Columns of an effect, and the kernel that leads a point; `program`: Taichi as it runs now."""
    functions = effect_functions((one,))
    point = point_functions(affine=True, averaged=False, corrected=True, effects=functions)
    renew, strain = functions.renew_strength, point.strain_point

    @ti.kernel
    def run(
        dt: ti.f32, time: ti.f32, gradients: VEC4, stresses: VEC4, histories: VEC4, kept: VEC8,
        integers: I32, numbers: F32, motion: VEC4, home: INDEX, gradient: VEC4, stress: VEC4,
        history: VEC4, row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4, swelling: VEC4,
        facts: F32, present: VEC8, effect_numbers: F32,
    ):  # fmt: skip
        for _ in range(1):
            now = time
            for step in range(gradients.shape[0]):
                gradient[0] = gradients[step]
                renew(0, 0, 1, now, 3, 0, integers, numbers, motion, home, gradient, stress,
                      history, facts, present, effect_numbers)  # fmt: skip
                strain(0, dt, 0.0, 1.0, home, gradient, stress, history, row, elastic, strength,
                       edges, swelling, 0, 1, now, 3, 0, integers, numbers, motion, facts, present,
                       effect_numbers)  # fmt: skip
                stresses[step] = stress[0]
                histories[step] = history[0]
                kept[step] = present[0]
                now += dt

    return functions.table, run


def lead(
    name: str | Effect,
    amplitude: float,
    soil: Soil,
    gradient: np.ndarray,
    dt: float,
    *,
    stress: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    cell: float = 1.0,
    field: float = 0.0,
    start_time: float = 0.0,
    **parameters: float,
) -> Path:
    """Lead a point through `gradient` (S, 4) [1/s] in steps of `dt` [s] under one effect.

    `amplitude` and `parameters` are in the units of a scene; constants that an effect takes from a
    scene are given here like parameters.
    """
    one = effect(name) if isinstance(name, str) else name
    start("cpu", 1)
    table, run = _compiled(one, ti.lang.impl.get_runtime().prog)
    values = [amplitude * one.amplitude.si]
    for parameter in one.parameters:
        values.append(parameters.pop(parameter.name, parameter.default) * parameter.si)
    values += [parameters.pop(name) for name in one.constant_names]
    assert not parameters, parameters
    facts = np.zeros((1, table.facts), np.float32)
    facts[0, [LIQUEFIED, TANGENT, COHESION, CAP, OVERBURDEN]] = [
        soil.liquefied, soil.friction, soil.cohesion, NO_CAP, soil.overburden,
    ]  # fmt: skip
    for column in table.field.values():
        facts[0, column] = field
    numbers = np.zeros((1, NUMBERS), np.float32)
    numbers[0, CELL] = cell
    numbers[0, MEAN_OVERBURDEN] = soil.mean_overburden
    elastic, strength, edges = material_constants(
        friction_angle=float(np.arctan(soil.friction)), cohesion=soil.cohesion,
        youngs_modulus=soil.youngs_modulus, poisson_ratio=soil.poisson_ratio,
    )  # fmt: skip
    steps = len(gradient)
    stresses, histories = np.zeros((2, steps, 4), np.float32)
    kept = np.zeros((steps, 8), np.float32)
    state = np.array([stress], np.float32)
    four = np.zeros((5, 1, 4), np.float32)
    run(
        dt, start_time, np.asarray(gradient, np.float32), stresses, histories, kept,
        np.zeros((1, INTEGERS), np.int32), numbers, four[0], np.full(1, 4, np.int32), four[1],
        state, four[2], np.zeros(1, np.int32), elastic[None], strength[None], edges[None],
        np.zeros((9, 4), np.float32), facts, np.zeros((1, 8), np.float32),
        np.array([values], np.float32),
    )  # fmt: skip
    past = histories.astype(float)
    return Path(
        stress=stresses.astype(float), volumetric=past[:, 0], opening=past[:, 1], shear=past[:, 2],
        dissipated=past[:, 3], strength=kept.astype(float),
    )  # fmt: skip


def simple_shear(rate: float, steps: int) -> np.ndarray:
    """Gradients (S, 4) of simple shear along x at `rate` [1/s]."""
    return np.tile([0.0, 0.0, rate, 0.0], (steps, 1))


def pure_shear(rate: float, steps: int) -> np.ndarray:
    """Gradients (S, 4) of shear without a turn: x longer and y shorter, `rate` in all [1/s]."""
    return np.tile([0.5 * rate, 0.0, 0.0, -0.5 * rate], (steps, 1))
