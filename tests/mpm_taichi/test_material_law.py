"""The material law of the documentation's example, on one point and in both schedules."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import taichi as ti

from docs.examples.my_law import SHEARED, hardening
from geometry.scenes.scene import (
    MOHR_COULOMB,
    save_scene,
    scene_from_mapping,
    scene_hash,
    scene_text,
)
from gns.data.scene_facts import start_of
from mpm_taichi import simulate as simulation
from mpm_taichi.batch import run_key
from mpm_taichi.effects import given_effects, load_effects_file
from mpm_taichi.layout import DISSIPATED, DVX_DX, DVY_DY, SHEAR, XX, YY, A, StepNumbers
from mpm_taichi.materials import registry
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import Slots, start
from mpm_taichi.solver3d.problem import extruded
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi import effects_slump
from tests.mpm_taichi.arrays import arrays

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "my_law.py"
LAW = "hardening_von_mises"
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
                StepNumbers(
                    slot=0, first_node=0, columns=1, cell=1.0, per_cell=1.0, dt=dt,
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


@pytest.fixture
def laws():
    """Laws that a scene can name, for the length of a test."""
    before = dict(registry.users)
    yield registry.users
    registry.users.clear()
    registry.users.update(before)


@pytest.mark.slow
def test_perfectly_plastic_it_flows_as_mohr_coulomb_and_hardening_shortens_the_runout(
    laws,
):
    laws |= {"perfect": hardening(0.0), "hard": hardening(60e3)}
    reference, perfect, hard = simulate(
        [slump(), slump(law="perfect"), slump(law="hard")], SHORT, threads=1
    )
    travel = [np.ptp(run.positions[-1, :, 0]) - 20.0 for run in (reference, perfect, hard)]
    assert all(run.status == "finished" for run in (reference, perfect, hard))
    assert travel[0] > 2.0
    assert travel[1] == pytest.approx(travel[0], rel=0.05)
    assert travel[2] < 0.8 * travel[1]


@pytest.mark.slow
def test_both_schedules_run_it(monkeypatch, laws):
    laws["hard"] = hardening(20e3)
    (by_scene,) = simulate([slump(law="hard")], SHORT)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    (by_point,) = simulate([slump(law="hard")], SHORT)
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


def test_an_effect_on_strength_is_refused_where_the_law_does_not_provide_for_it(laws):
    laws["perfect"] = hardening(0.0)
    scene = effects_slump.slump({"strain_softening": 1.0}, law="perfect")
    with pytest.raises(InputError, match=r"slump: effects: strain_softening: changes the strength"):
        simulate([scene], SHORT)


def test_a_scene_that_names_no_law_is_written_without_one():
    usual, other = slump(), slump(law=LAW)
    assert usual == slump(law=MOHR_COULOMB)
    assert "law" not in usual.model_dump() and "law" not in scene_text(usual, ".yaml")
    assert other.changed(spacing=2.0).law == LAW
    assert scene_from_mapping(other.model_dump(mode="json")) == other
    assert scene_hash(other) != scene_hash(usual)


def test_a_law_that_is_not_there_is_refused_in_one_line(laws):
    message = "slump: law: no material law 'clay'; there are mohr_coulomb; your own needs --effects"
    for asked in (lambda scene: simulate([scene], SHORT), lambda scene: run_key(scene, SHORT, "")):
        with pytest.raises(InputError, match=message) as error:
            asked(slump(law="clay"))
        assert "\n" not in str(error.value)


def test_the_key_holds_the_content_of_the_file(laws, tmp_path):
    with given_effects([EXAMPLE]):
        key = run_key(slump(law=LAW), SHORT, "cpu")
        assert key != run_key(slump(), SHORT, "cpu")
    assert LAW not in laws
    changed = tmp_path / "mine.py"
    changed.write_text(EXAMPLE.read_text().replace("hardening(200e3)", "hardening(300e3)"))
    with given_effects([changed]):
        assert run_key(slump(law=LAW), SHORT, "cpu") != key
    with given_effects([EXAMPLE]):
        assert run_key(slump(law=LAW), SHORT, "cpu") == key


def test_a_name_of_the_library_is_taken(laws, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(EXAMPLE.read_text().replace(LAW, MOHR_COULOMB))
    with pytest.raises(InputError, match="'mohr_coulomb': the library has a law of this name"):
        load_effects_file(path)


def test_what_does_not_know_other_laws_refuses_them():
    with pytest.raises(InputError, match=f"slump: law: {LAW}: not in three dimensions"):
        extruded(slump(law=LAW), 4.0)
    with pytest.raises(InputError, match=f"slump: law: {LAW}; the learned simulator knows"):
        start_of(slump(law=LAW), SHORT)


@pytest.mark.slow
def test_a_scene_of_a_users_law_runs_from_the_command_line(tmp_path, run_module):
    save_scene(slump(law=LAW), tmp_path / "scene.yaml")
    run = [
        "flowslide",
        "scenes",
        "simulate",
        tmp_path / "scene.yaml",
        "--out",
        tmp_path,
        "--threads",
        "1",
    ]
    run += ["--quiet", "--set", "simulation.duration_s=0.5"]
    assert "no material law 'hardening_von_mises'" in run_module(*run).stderr
    done = run_module(*run, "--effects", EXAMPLE)
    assert done.returncode == 0, done.stderr
    assert "1 runs, 0 failed" in done.stdout
