"""The kernels of the material point method, compiled for one choice of options.

`scene` schedule (CPU, `scene_schedule`): one thread takes one scene through all its steps.
`point` schedule (GPU, `point_schedule`): all points of all scenes side by side, with atomic adds,
so equal to the other to rounding only. Both are made of `point_functions`, `nodes`, `stress` and
`transfer`: the physics is written once.
"""

from functools import cache
from types import SimpleNamespace

from mpm_taichi.effects.framework.base import Effect
from mpm_taichi.effects.framework.hooks import effect_functions
from mpm_taichi.materials.law import MaterialLaw
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.point_schedule import point_schedule
from mpm_taichi.solver.scene_schedule import scene_schedule
from mpm_taichi.solver.tiles import tile_functions


@cache
def build_kernels(
    *,
    affine: bool,
    averaged: bool,
    corrected: bool,
    effects: tuple[Effect, ...] = (),
    law: MaterialLaw = MOHR_COULOMB,
) -> SimpleNamespace:
    """Build the kernels (Taichi compiles each when it is first called).

    Args:
        affine: the affine part of a point's velocity travels to the grid (APIC, affine FLIP).
        averaged: volumetric strain increments averaged over a cell (F-bar).
        corrected: volume correction at the free surface.
        effects: those that scenes may have on, `effects.registry.kernel_effects`; with none, the
            kernels know of no effects at all.
        law: the material law of all soils.

    Returns:
        `run_scenes` of the scene schedule; `point`, the kernels of the point schedule; `table`, the
        columns of the effects (`effects.table.EffectTable`), None without any; `law`.
    """
    acting = effect_functions(effects, law, averaged=averaged) if effects else None
    options = {"affine": affine, "averaged": averaged, "corrected": corrected, "effects": acting}
    point = point_functions(law, **options)
    tile = tile_functions(law, point, **options)
    return SimpleNamespace(
        run_scenes=scene_schedule(point, tile, acting),
        point=point_schedule(point, acting),
        table=acting.table if acting else None,
        law=law,
    )
