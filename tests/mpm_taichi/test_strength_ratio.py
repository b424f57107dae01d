"""Strength in proportion to the stress before failure: closed forms, the effect, refusals, 3-D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.verification.three_dimensions import slab_scene
from geometry.scenes.scene import Scene, scene_from_mapping, scene_hash
from mpm_taichi import layout
from mpm_taichi import simulate as simulation
from mpm_taichi.batch import run_key
from mpm_taichi.effects import effects_on
from mpm_taichi.effects.framework.registry import kernel_effects
from mpm_taichi.effects.framework.table import COHESION, OVERBURDEN
from mpm_taichi.materials.mohr_coulomb import INTERCEPT
from mpm_taichi.simulate import simulate
from mpm_taichi.simulate3d import Flight3d, simulate_3d
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.runtime import Slots, start
from mpm_taichi.solver3d.problem import extruded
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import SHORT, slump

RATIO, FLOOR = 0.1, 2.0


def column(soil: dict, **changes):
    """A liquefied layer 12 m high from wall to wall, 1800 kg/m3."""
    document = {
        "name": "column",
        "domain": {"x_min": 0, "x_max": 6, "y_max": 20, "walls": "closed"},
        "ground": {"points": [[0, 0], [6, 0]]},
        "zones": [{"name": "a", "material": "silt", "polygon": [[0, 0], [6, 0], [6, 12], [0, 12]]}],
        "materials": {"silt": {"friction_deg": 0, "liquefied": True, **soil}},
        "spacing": 1.0,
    }
    return scene_from_mapping({**document, **changes})


def settled(scene, settings=None) -> tuple[Slots, object]:
    """A scene that has settled and moved for one frame."""
    prepared = prepare(scene, settings or SimulationSettings(duration_s=1.0))
    start("cpu", 1)
    kernels = build_kernels(
        affine=True, averaged=True, corrected=True, effects=kernel_effects(scene)
    )
    slots = Slots(1, len(prepared.order), prepared.grid.nodes, 1, device="cpu", kernels=kernels)
    slots.admit(0, prepared)
    slots.run()
    return slots, prepared


@pytest.mark.parametrize(("water", "weight"), [(None, 1800.0), (16.0, 800.0)])
def test_each_point_has_the_ratio_times_its_weight_above(water, weight):
    soil = {"cohesion_kpa": FLOOR, "strength_ratio": RATIO}
    slots, prepared = settled(column(soil, water_level=water))
    count = len(prepared.order)
    depth = 12.0 - prepared.points.position[prepared.order, 1]
    by_hand = np.maximum(RATIO * weight * 9.81 * depth, 1e3 * FLOOR)
    strength = 0.5 * slots.own_strength[:count, INTERCEPT]  # k = 2 c cos(phi)
    deep = depth > 3.0  # in the cell at the surface F-bar gives all points one volumetric strain
    assert strength[deep] == pytest.approx(by_hand[deep], rel=0.01)
    # The very stress that the solver settled to, and no less than the floor.
    exact = np.maximum(RATIO * slots.facts[:count, OVERBURDEN], np.float32(1e3 * FLOOR))
    assert strength == pytest.approx(exact, rel=1e-6)
    assert strength.min() == np.float32(1e3 * FLOOR)
    assert slots.facts[:count, COHESION] == pytest.approx(strength, rel=1e-6)


def test_k0_start_has_it_from_the_weight_above():
    soil = {"cohesion_kpa": 0.0, "strength_ratio": RATIO}
    settings = SimulationSettings(duration_s=1.0, initial_stress="k0")
    slots, prepared = settled(column(soil), settings)
    depth = 12.0 - prepared.points.position[prepared.order, 1]
    strength = 0.5 * slots.own_strength[: len(depth), INTERCEPT]
    assert strength == pytest.approx(RATIO * 1800.0 * 9.81 * depth, rel=1e-5)


def with_ratio(ratio: float, floor: float = 0.0, **changes):
    materials = {
        "silt": {
            "friction_deg": 0, "cohesion_kpa": floor, "liquefied": True, "strength_ratio": ratio,
        },
        "sand": {"friction_deg": 30, "cohesion_kpa": 5},
    }  # fmt: skip
    return slump(materials=materials, **changes)


def test_it_leaves_the_deposit_of_the_effect_at_amplitude_one():
    """The effect multiplies S_r by sigma'_v0 / mean: the same with S_r = ratio x mean."""
    (run,) = simulate([with_ratio(0.08)], SHORT, threads=1)
    own = run.zone == 0
    mean = np.maximum(-run.initial_stress[own, layout.YY], 0.0).mean()
    strength = 1e-3 * 0.08 * float(mean)
    soil = {"silt": {"friction_deg": 0, "cohesion_kpa": strength, "liquefied": True},
            "sand": {"friction_deg": 30, "cohesion_kpa": 5}}  # fmt: skip
    effect = slump({"overburden_strength": 1.0}, materials=soil)
    (other,) = simulate([effect], SHORT, threads=1)
    (uniform,) = simulate([slump(materials=soil)], SHORT, threads=1)
    moved = np.linalg.norm(run.positions[-1] - run.positions[0], axis=1).max()
    apart = np.abs(run.positions[-1] - other.positions[-1]).max()
    assert moved > 1.0
    assert apart < 1e-3 * moved
    assert np.abs(run.positions[-1] - uniform.positions[-1]).max() > 0.02 * moved


def test_without_a_ratio_nothing_is_another():
    plain = slump()
    assert kernel_effects(plain) == ()
    assert "strength_ratio" not in plain.materials["silt"].model_dump()
    none = plain.model_dump()
    none["materials"]["silt"]["strength_ratio"] = None
    assert scene_hash(scene_from_mapping(none)) == scene_hash(plain)
    key = run_key(plain, SHORT, "cpu")
    assert run_key(scene_from_mapping(none), SHORT, "cpu") == key
    assert run_key(with_ratio(0.1, 5.0), SHORT, "cpu") != key


def test_a_ratio_of_nothing_is_the_floor():
    """The kernels with a strength of each point give what those without give."""
    (own,) = simulate([with_ratio(0.0, 5.0)], SHORT, threads=1)
    (plain,) = simulate([slump()], SHORT, threads=1)
    assert np.abs(own.positions[-1] - plain.positions[-1]).max() < 1e-3


def test_effects_act_on_the_strength_at_depth():
    """All strengths doubled by an effect: as with twice the ratio."""
    contrast = with_ratio(0.06).changed(effects={"late_liquefaction": {
        "amplitude": 500.0, "peak_ratio": 2.0}})  # fmt: skip
    (late,), (twice,) = (simulate([one], SHORT, threads=1) for one in (contrast, with_ratio(0.12)))
    assert np.abs(late.positions[-1] - twice.positions[-1]).max() < 0.05


def test_what_cannot_be_is_refused_in_one_line():
    with pytest.raises(InputError, match="liquefied: true"):
        slump(materials={"silt": {"friction_deg": 0, "cohesion_kpa": 5, "strength_ratio": 0.1},
                         "sand": {"friction_deg": 30, "cohesion_kpa": 5}})  # fmt: skip
    with pytest.raises(InputError, match="less than or equal to 1"):
        with_ratio(12.0)
    both = with_ratio(0.1, effects={"overburden_strength": 0.5})
    with pytest.raises(InputError, match="overburden_strength: can do nothing .* strength_ratio"):
        effects_on(both)
    with pytest.raises(InputError, match="strength_ratio: .* 'gravity_on'"):
        simulate([with_ratio(0.1)], SHORT.model_copy(update={"initial_stress": "gravity_on"}))


def test_flanks_hold_back_soil_that_has_a_ratio_alone():
    materials = {"silt": {"friction_deg": 0, "cohesion_kpa": 0, "liquefied": True,
                          "strength_ratio": 0.1},
                 "sand": {"friction_deg": 30, "cohesion_kpa": 0}}  # fmt: skip
    assert effects_on(slump({"side_shear": 0.1}, materials=materials))


def bank_3d(soil: dict):
    """A bank of liquefied soil, 6 m wide between smooth flanks."""
    document = slab_scene(spacing=1.0)
    for material in document["materials"].values():
        material.update({"friction_deg": 0.0, "liquefied": True, **soil})
        material.pop("pre_failure", None)
    return extruded(Scene.model_validate(document), 6.0)


def test_three_dimensions_give_each_point_its_own_strength(tmp_path):
    problem = bank_3d({"cohesion_kpa": 0.5, "strength_ratio": RATIO})
    start("cpu", 1)
    flight = Flight3d(problem, SimulationSettings(duration_s=1.0))
    flight.settle()
    state = flight.state
    strength = state.in_given_order(0.5 * state.strength[state.row, INTERCEPT])
    vertical = -flight.initial_stress[:, 2]
    assert strength == pytest.approx(np.maximum(RATIO * vertical, 500.0), rel=1e-5)
    assert strength.max() > 2.0 * strength.min()
    assert state.density[state.row] == pytest.approx(
        state.density[0] * np.ones(len(state.row)), rel=0
    )


def test_three_dimensions_between_smooth_flanks_are_the_plane():
    settings = SimulationSettings(duration_s=1.0, early_stop=False)
    uniform = simulate_3d(bank_3d({"cohesion_kpa": 4.0}), settings, threads=1)
    nothing = simulate_3d(
        bank_3d({"cohesion_kpa": 4.0, "strength_ratio": 1e-9}), settings, threads=1
    )
    assert np.abs(uniform.positions[-1] - nothing.positions[-1]).max() < 1e-5
    grown = simulate_3d(bank_3d({"cohesion_kpa": 4.0, "strength_ratio": 0.3}), settings, threads=1)
    assert np.abs(grown.positions[-1] - uniform.positions[-1]).max() > 0.01
    with pytest.raises(InputError, match="strength_ratio: .* 'gravity_on'"):
        sudden = settings.model_copy(update={"initial_stress": "gravity_on"})
        simulate_3d(bank_3d({"cohesion_kpa": 4.0, "strength_ratio": 0.3}), sudden)


def test_a_checkpoint_of_a_ratio_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    from mpm_taichi import simulate3d

    problem = bank_3d({"cohesion_kpa": 1.0, "strength_ratio": RATIO})
    settings = SimulationSettings(duration_s=1.0, early_stop=False)
    whole = simulate_3d(problem, settings, threads=1)
    monkeypatch.setattr(simulate3d, "CHECKPOINT_S", -1.0)
    path = tmp_path / "state.npz"

    class Killed(Exception):
        pass

    frames = []

    def kill(now: float, energy: float) -> None:
        frames.append(now)
        if len(frames) == 3:
            raise Killed

    with pytest.raises(Killed):
        simulate_3d(problem, settings, threads=1, checkpoint=path, on_frame=kill)
    assert path.is_file()
    again = simulate_3d(problem, settings, threads=1, checkpoint=path)
    assert again.positions.tobytes() == whole.positions.tobytes()
    other = bank_3d({"cohesion_kpa": 1.0, "strength_ratio": 2 * RATIO})
    flights = [Flight3d(one, settings)._hash() for one in (problem, other, replace(problem))]
    assert flights[0] != flights[1] and flights[0] == flights[2]


def test_both_schedules_agree(monkeypatch):
    """Scenes side by side as on a graphics card, and one after the other."""
    scene = with_ratio(0.08)
    (by_scene,) = simulate([scene], SHORT, threads=1)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    (by_point,) = simulate([scene], SHORT, threads=1)
    assert by_point.status == "finished"
    assert np.abs(by_scene.positions - by_point.positions).max() < 0.01
