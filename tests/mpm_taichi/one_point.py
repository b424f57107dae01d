"""One material point with effects on, led through a given path of velocity gradients.

The point goes through the functions that the schedules call: effects renew its strength, then its
stress is updated. Nothing else of the solver takes part, so closed forms hold to rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import taichi as ti

from mpm_taichi import layout
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
from mpm_taichi.layout import MEAN_OVERBURDEN, VEC4, VEC8, A, StepNumbers
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, NO_CAP, material_constants
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import start
from tests.mpm_taichi.arrays import arrays


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
    functions = effect_functions((one,), MOHR_COULOMB, averaged=False)
    point = point_functions(
        MOHR_COULOMB, affine=True, averaged=False, corrected=True, effects=functions
    )
    renew, strain = functions.renew_strength, point.strain_point

    @ti.func
    def run(dt: A, time: A, cell: A, gradients: A, stresses: A, histories: A, kept: A, state: A):
        points = ti.static(state.points)
        for _ in range(1):
            now = time
            step = ti.static(
                StepNumbers(
                    slot=0, first_node=0, columns=3, cell=cell, per_cell=1.0, dt=dt,
                    time=now, on=1,
                )
            )  # fmt: skip
            for turn in range(gradients.shape[0]):
                points.gradient[0] = gradients[turn]
                renew(0, step, state)
                strain(0, step, state)
                stresses[turn] = points.stress[0]
                histories[turn] = points.history[0]
                kept[turn] = points.own_strength[0]
                now += dt

    numbers = dict.fromkeys(("dt", "time", "cell"), ti.f32)
    paths = dict.fromkeys(("gradients", "stresses", "histories"), VEC4)
    run = state_kernel(run, **numbers, **paths, kept=VEC8)
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
    numbers = np.zeros((1, layout.NUMBERS), np.float32)
    numbers[0, MEAN_OVERBURDEN] = soil.mean_overburden
    elastic = elastic_constants(
        youngs_modulus=soil.youngs_modulus, poisson_ratio=soil.poisson_ratio
    )
    strength = material_constants(
        friction_angle=float(np.arctan(soil.friction)), cohesion=soil.cohesion
    )
    steps = len(gradient)
    stresses, histories = np.zeros((2, steps, 4), np.float32)
    kept = np.zeros((steps, 8), np.float32)
    state = arrays(
        nodes=9, home=[4], stress=[stress], numbers=numbers, facts=facts, elastic=[elastic],
        strength=[strength], effect_numbers=[values],
    )  # fmt: skip
    run(
        dt, start_time, cell, np.asarray(gradient, np.float32), stresses, histories, kept,
        *state.values(),
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
