"""The material law of the documentation's example, on one point and in both schedules."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import taichi as ti

from docs.examples.my_law import SHEARED, hardening
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi import simulate as simulation
from mpm_taichi.layout import DISSIPATED, DVX_DX, DVY_DY, SHEAR, XX, YY, A, Step
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import Slots, start
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi import effects_slump
from tests.mpm_taichi.arrays import arrays

SHORT = SimulationSettings(duration_s=2.0, early_stop=False)
COHESION, MODULUS = 5e3, 40e3
YOUNG, POISSON = 3e6, 0.3
G = YOUNG / (2.0 * (1.0 + POISSON))


def slump(**changes):
    """A column of clay that collapses, 20 m x 10 m; 200 points."""
    document = {
        "name": "slump",
        "domain": {"x_min": 0, "x_max": 60, "y_max": 16},
        "ground": {"points": [[0, 0], [60, 0]]},
        "zones": [
            {"name": "a", "material": "clay", "polygon": [[20, 0], [40, 0], [40, 10], [20, 10]]}
        ],
        "materials": {"clay": {"friction_deg": 0, "cohesion_kpa": 15}},
        "spacing": 1.0,
    }
    return scene_from_mapping({**document, **changes})


@cache
def shear_of(program: object):
    """Kernel that shears one point step by step; `program`: Taichi as it runs now."""
    point = point_functions(hardening(MODULUS), affine=True, averaged=False, corrected=True)

    @ti.func
    def shear(steps: A, dt: A, state: A):
        for p in range(state.points.home.shape[0]):
            step = ti.static(
                Step(
                    slot=0, first_node=0, columns=1, cell=1.0, per_cell=1.0, volume=1.0, dt=dt,
                )
            )  # fmt: skip
            for _ in range(steps):
                point.strain_point(p, step, state)

    return state_kernel(shear, steps=ti.i32, dt=ti.f32)


@pytest.mark.parametrize("before", [0.0, 0.05])
def test_pure_shear_follows_the_hardening(before):
    start("cpu", 1)
    strain, steps, rate = 0.1, 400, 1.0
    gradient = np.zeros((1, 4))
    gradient[0, [DVX_DX, DVY_DY]] = 0.5 * rate, -0.5 * rate
    state = arrays(
        gradient=gradient, strength=[[COHESION, MODULUS, 0, 0, 0, 0, 0, 0]], variables=[[before]],
        elastic=[elastic_constants(youngs_modulus=YOUNG, poisson_ratio=POISSON)],
    )  # fmt: skip
    kernel = shear_of(ti.lang.impl.get_runtime().prog)
    kernel(steps, strain / rate / steps, *state.values())
    stress, history = state["stress"][0].astype(float), state["history"][0].astype(float)
    first = COHESION + MODULUS * before
    plastic = (strain - first / G) / (1.0 + MODULUS / G)  # tau = first + H plastic = G elastic
    assert 0.5 * (stress[XX] - stress[YY]) == pytest.approx(first + MODULUS * plastic, rel=1e-4)
    assert state["variables"][0, SHEARED] == pytest.approx(before + plastic, rel=1e-4)
    assert history[SHEAR] == pytest.approx(plastic, rel=1e-4)
    work = first * plastic + 0.5 * MODULUS * plastic**2
    assert history[DISSIPATED] == pytest.approx(work, rel=1e-2)


@pytest.mark.slow
def test_perfectly_plastic_it_flows_as_mohr_coulomb_and_hardening_shortens_the_runout():
    reference, perfect, hard = (
        simulate([slump()], SHORT, **options)[0]
        for options in ({}, {"law": hardening(0.0)}, {"law": hardening(60e3)})
    )
    travel = [np.ptp(run.positions[-1, :, 0]) - 20.0 for run in (reference, perfect, hard)]
    assert all(run.status == "finished" for run in (reference, perfect, hard))
    assert travel[0] > 2.0
    assert travel[1] == pytest.approx(travel[0], rel=0.05)
    assert travel[2] < 0.8 * travel[1]


@pytest.mark.slow
def test_both_schedules_run_it(monkeypatch):
    law = hardening(20e3)
    (by_scene,) = simulate([slump()], SHORT, law=law)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    (by_point,) = simulate([slump()], SHORT, law=law)
    assert by_scene.status == by_point.status == "finished"
    assert by_scene.steps == by_point.steps
    off = np.abs(by_scene.positions - by_point.positions)
    assert off[:8].max() < 0.01
    assert off[-1].mean() < 0.02


@pytest.mark.slow
def test_history_variables_begin_as_the_law_says_and_follow_the_points():
    law = replace(hardening(20e3), initial_variables=lambda material: (0.25,))
    start("cpu", 1)
    kernels = build_kernels(affine=True, averaged=True, corrected=True, law=law)
    scene = prepare(slump(), SHORT, law)
    slots = Slots(1, len(scene.order), scene.grid.nodes, 8, device="cpu", kernels=kernels)
    slots.admit(0, scene)
    where = slots.point_range(0)
    assert (slots.variables[where, SHEARED] == 0.25).all()
    slots.run()
    assert slots.variables[where, SHEARED] == pytest.approx(
        0.25 + slots.history[where, SHEAR], rel=1e-5
    )
    assert slots.history[where, SHEAR].max() > 0.01
    larger = Slots(1, 2 * len(scene.order), scene.grid.nodes, 8, device="cpu", kernels=kernels)
    larger.take_over(0, slots, scene)
    assert np.array_equal(larger.variables[larger.point_range(0)], slots.variables[where])


def test_an_effect_on_strength_is_refused_where_the_law_does_not_provide_for_it():
    scene = effects_slump.slump({"strain_softening": 1.0})
    with pytest.raises(InputError, match=r"slump: effects: strain_softening: changes the strength"):
        simulate([scene], SHORT, law=hardening(0.0))
