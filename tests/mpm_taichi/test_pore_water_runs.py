"""Pore water in whole runs: its two limits, rest, a slope that fails late, and what is refused."""

import numpy as np
import pytest

from diagnosis.hypotheses.physics import acting_candidates
from geometry.scenes.scene import scene_from_mapping, scene_hash
from gns.data.scene_facts import check_base_physics
from mpm_taichi import simulate as simulation
from mpm_taichi.batch import run_key
from mpm_taichi.comparison import water_line
from mpm_taichi.effects import BY_THE_CLOCK, effects_on, kernel_effects
from mpm_taichi.effects.framework.between import SettledPoints
from mpm_taichi.simulate import simulate
from mpm_taichi.simulate3d import simulate_3d
from mpm_taichi.solver.pore_water import Volumes, pore_water
from mpm_taichi.solver3d.problem import extruded
from pipeline.cli import InputError
from pipeline.config import SimulationSettings

SETTINGS = SimulationSettings(duration_s=12.0)
BEFORE = {"friction_deg": 30.0, "cohesion_kpa": 60.0}


def bank(effects=None, level=9.0, **silt):
    """A bank of silt under water, 20 m x 6 m, that stands on a plane."""
    return scene_from_mapping(
        {
            "name": "bank",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 20, "walls": "closed"},
            "ground": {"points": [[0, 0], [60, 0]]},
            "zones": [
                {"name": "a", "material": "silt", "polygon": [[20, 0], [40, 0], [34, 6], [26, 6]]}
            ],
            "materials": {
                "silt": {"friction_deg": 0, "cohesion_kpa": 2, "liquefied": True,
                         "density": 2000, "pre_failure": BEFORE, **silt},
            },
            "water_level": level,
            "spacing": 1.0,
            "effects": effects or {},
        }
    )  # fmt: skip


def ends(run):
    """Both toes and the top of the deposit [m]."""
    x, y = run.positions[-1].T
    return np.array([x.min(), x.max(), y.max()])


def test_without_flow_the_run_is_that_of_the_residual_strength():
    base, shut = simulate([bank(), bank(permeability_m_per_s=1e-15)], SETTINGS, threads=1)
    assert ends(shut) == pytest.approx(ends(base), abs=1e-3)
    assert shut.time[-1] == base.time[-1]  # it rests as soon: water has nothing to do


def test_with_free_flow_the_run_is_that_of_the_friction_angle():
    before = {"friction_deg": 18, "cohesion_kpa": 60}
    drained, free = simulate(
        [
            bank(liquefied=False, friction_deg=18, cohesion_kpa=0, pre_failure=before),
            bank({"pore_water": {"amplitude": 1e4, "initial_ratio": 0.0, "contractancy": 0.0}},
                 cohesion_kpa=0, permeability_m_per_s=1.0, pre_failure=before),
        ],
        SETTINGS,
        threads=1,
    )  # fmt: skip
    assert np.abs(drained.positions[-1] - drained.positions[0]).max() > 1.0
    assert ends(free) == pytest.approx(ends(drained), abs=0.1)  # of 8.6 m of runout


def test_a_run_gives_the_same_bits_in_any_company():
    wet = bank(permeability_m_per_s=1e-3)
    (alone,) = simulate([wet], SETTINGS, threads=1)
    runs = simulate([bank({"weak_base": 0.1}), wet, bank(permeability_m_per_s=1e-4)], SETTINGS)
    assert np.array_equal(alone.positions, runs[1].positions)
    assert np.array_equal(alone.stress, runs[1].stress)


def sealed(k):
    """A slope of 20 degrees under water: clay on sand on a layer that has liquefied and holds."""

    def layer(name, low, high):
        x, rise = np.array([10.0, 50.0]), np.tan(np.radians(20.0))
        line = [[a, rise * a + low] for a in x] + [[a, rise * a + high] for a in x[::-1]]
        return {"name": name, "material": name, "polygon": line}

    return scene_from_mapping(
        {
            "name": "sealed",
            "domain": {"x_min": -20, "x_max": 80, "y_max": 40, "walls": "closed"},
            "ground": {"points": [[0, 0], [60, 60 * np.tan(np.radians(20.0))]]},
            "zones": [layer("loose", 0, 2), layer("sand", 2, 5), layer("clay", 5, 7)],
            "materials": {
                "loose": {"friction_deg": 0, "cohesion_kpa": 60, "liquefied": True,
                          "density": 2000, "permeability_m_per_s": k},
                "sand": {"friction_deg": 38, "cohesion_kpa": 0, "density": 2000,
                         "permeability_m_per_s": k},
                "clay": {"friction_deg": 0, "cohesion_kpa": 60, "density": 2000},
            },
            "water_level": 35.0,
            "spacing": 0.5,
        }
    )  # fmt: skip


def failure(run):
    """When the clay has moved by 0.1 m [s]."""
    clay = run.zone == 2
    moved = np.linalg.norm(run.positions[:, clay] - run.positions[0, clay], axis=2).mean(axis=1)
    assert moved[-1] > 0.5
    return np.interp(0.1, moved, run.time)


@pytest.mark.slow
def test_a_slope_under_a_seal_fails_late_the_later_the_slower_water_flows():
    late = []
    for k in (9e-5, 3e-5):
        (run,) = simulate([sealed(k)], SimulationSettings(duration_s=4e-4 / k), threads=1)
        late.append(failure(run))
    # With H^2 / c_v, but for the second that soil without strength takes to move so far.
    assert (late[1] - 1.0) / (late[0] - 1.0) == pytest.approx(3.0, rel=0.15)
    (shut,) = simulate([sealed(1e-9)], SimulationSettings(duration_s=40.0))
    assert shut.time[-1] < 10.0  # at rest, and water has nothing to do
    assert np.abs(shut.positions[-1] - shut.positions[0]).max() < 0.1


@pytest.mark.slow
def test_dense_soil_under_a_seal_holds_until_water_has_filled_what_it_dilates_by():
    late = []
    for dilatancy, dilation in ((0.0, 0.02), (0.05, 0.001), (0.05, 0.002), (0.05, 0.02)):
        numbers = {"amplitude": 1.0, "dilatancy": dilatancy, "dilation": dilation}
        dense = sealed(9e-5).changed(effects={"pore_water": numbers})
        (run,) = simulate([dense], SimulationSettings(duration_s=30.0), threads=1)
        late.append(failure(run) if dilation < 0.02 or not dilatancy else np.inf)
    assert np.all(np.diff(late) > 5.0)  # at 2.3, 10.6 and 18.1 s, and not at all
    clay = run.zone == 2
    assert np.abs(run.positions[-1, clay] - run.positions[0, clay]).max() < 0.2


def test_no_permeability_leaves_no_trace():
    written = bank().materials["silt"].model_dump()
    assert "permeability_m_per_s" not in written
    wet = bank(permeability_m_per_s=1e-5)
    assert scene_hash(wet) != scene_hash(bank())
    assert run_key(wet, SETTINGS, "cpu") != run_key(bank(), SETTINGS, "cpu")
    assert kernel_effects(bank()) == ()


def test_it_is_on_where_water_can_flow_and_the_scene_does_not_say_otherwise():
    wet = bank(permeability_m_per_s=1e-5)
    assert [(one.effect.name, one.amplitude) for one in effects_on(wet)] == [("pore_water", 1.0)]
    assert effects_on(wet.changed(water_level=None)) == ()
    assert effects_on(wet.changed(effects={"pore_water": 0.0})) == ()
    (ten,) = effects_on(wet.changed(effects={"pore_water": 10.0}))
    assert ten.amplitude == 10.0


def test_a_fixed_body_holds_the_water_in():
    wet = bank(permeability_m_per_s=1e-2)
    wall = [[40.0, 0.0], [44.0, 0.0], [44.0, 6.0], [34.0, 6.0]]
    held = wet.changed(zones=[*wet.zones, {"name": "wall", "material": "silt", "polygon": wall,
                                           "kinematic": True}])  # fmt: skip
    short = SimulationSettings(duration_s=0.5, early_stop=False)
    free, beside = (simulate([one], short, threads=1)[0] for one in (wet, held))
    near = np.flatnonzero((free.positions[0, :, 0] > 34.0) & (free.positions[0, :, 1] < 3.0))
    pressures = [run.effect_fields["excess_pore_pressure_pa"][near] for run in (free, beside)]
    assert pressures[1].mean() > 1.2 * pressures[0].mean()


@pytest.mark.slow
def test_the_point_schedule_agrees(monkeypatch):
    wet = bank(permeability_m_per_s=1e-3)
    short = SimulationSettings(duration_s=2.0, early_stop=False)
    (by_scene,) = simulate([wet], short)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    (by_point,) = simulate([wet], short)
    assert by_scene.steps == by_point.steps
    assert by_point.positions[-1] == pytest.approx(by_scene.positions[-1], abs=0.02)
    name = "excess_pore_pressure_pa"
    two = [run.effect_fields[name].mean() for run in (by_scene, by_point)]
    assert two[0] == pytest.approx(two[1], rel=0.01)


def test_no_clock_states_what_the_water_gives():
    wet = bank(permeability_m_per_s=1e-5)
    with pytest.raises(InputError, match="late_liquefaction: states as a function of time"):
        simulate([wet.changed(effects={"late_liquefaction": 5.0})], SETTINGS)
    found, left_out = acting_candidates(wet)
    assert not {"pore_water", *BY_THE_CLOCK} & {one.name for one in found}
    assert "`effects: {pore_water: 0}` in the scene puts it on trial" in left_out["pore_water"]
    found, _ = acting_candidates(wet.changed(effects={"pore_water": 0.0}))
    there = {one.name: one for one in found}
    assert there["pore_water"].ladder == (0.1, 1.0, 10.0)
    assert {"late_liquefaction", "spreading_liquefaction"} <= set(there)
    assert {name for name, one in there.items() if one.asked} == {"pore_water"}
    # k is known to a factor of 3: decades are alike, and 68 % of them within a half of 1.
    assert there["pore_water"].counted_prior == pytest.approx((2.0, 0.5))
    assert there["pore_water"].most_of(10.0) == pytest.approx(3.5 / 3.0)
    _, left_out = acting_candidates(bank())
    assert "no soil with a permeability_m_per_s" in left_out["pore_water"]


def test_a_soil_may_state_its_own_excess_pressure_whether_it_liquefies_or_not():
    loose = bank().materials["silt"]
    dense = bank(liquefied=False, friction_deg=35).materials["silt"]
    flows, own = {"permeability_m_per_s": 1e-5}, {"excess_pressure_ratio": 0.3}
    soils = [
        soil.model_copy(update=new) for soil in (loose, dense) for new in (flows, flows | own, own)
    ]
    six = np.ones(6)
    stress = np.outer(six, [-60e3, -140e3, -60e3, 0.0])
    settled = SettledPoints(np.outer(six, [30.0, 1.0]), six, stress, np.arange(6), soils,
                            np.zeros((0, 2)), (0.0, 0.0), 2.0, 9.81)  # fmt: skip
    water = pore_water(bank(), settled, 1.0, 0.8, Volumes(0.02, 0.1, 0.02, 0.0))
    assert water.excess == pytest.approx([80e3, 30e3, 0.0, 0.0, 30e3, 0.0])  # without k: none
    wet = bank(permeability_m_per_s=1e-5)
    stated = bank(permeability_m_per_s=1e-5, excess_pressure_ratio=0.3)
    assert run_key(stated, SETTINGS, "cpu") != run_key(wet, SETTINGS, "cpu")


def cover(k, level=4.0):
    """Liquefied sand, 4 m of it, under 2 m of sand in a box, all 4 m wide."""
    layers = {"loose": (0, 4), "cover": (4, 6)}
    return scene_from_mapping(
        {
            "name": "cover",
            "domain": {"x_min": 0, "x_max": 4, "y_max": 10, "walls": "closed"},
            "ground": {"points": [[0, 0], [4, 0]]},
            "zones": [
                {"name": name, "material": name, "polygon": [[0, a], [4, a], [4, b], [0, b]]}
                for name, (a, b) in layers.items()
            ],
            "materials": {
                "loose": {"friction_deg": 0, "cohesion_kpa": 1, "liquefied": True,
                          "density": 2000, "permeability_m_per_s": 1e-2, "pre_failure": BEFORE},
                "cover": {"friction_deg": 33, "cohesion_kpa": 1, "permeability_m_per_s": k},
            },
            "water_level": level,
            "spacing": 0.5,
        }
    )  # fmt: skip


def test_dry_soil_drains_with_any_permeability_and_seals_without():
    short = SimulationSettings(duration_s=3.0, early_stop=False)
    runs = simulate([cover(k) for k in (1e-9, 1e-2, None)], short, threads=1)
    low, high, none = (run.audit["water_expelled_m2"] for run in runs)
    assert low == pytest.approx(high, rel=1e-3) and low > 0.1
    assert none == 0.0
    shut = water_line(runs[-1])
    assert shut.startswith("Pore water: 0 m³ per metre left the soil, which contracted by ")
    assert f"to {runs[-1].effect_fields['excess_pore_pressure_pa'].max() / 1e3:.3g} kPa." in shut
    (dry,) = simulate([cover(1e-2, level=None)], short, threads=1)
    assert water_line(dry) == ""


def test_a_stated_excess_pressure_rises_where_soil_yields_at_once():
    """Level ground, sin(phi) 0.574, K_0 0.43: u over sigma'_v0 as the page says."""
    dense = {"liquefied": False, "friction_deg": 35, "cohesion_kpa": 0, "density": 2000}
    found = []
    for ratio in (0.25, 0.56):
        level = cover(1e-15, level=8.0)
        soils = {name: {**soil.model_dump(), **dense, "pre_failure": None,
                        "permeability_m_per_s": 1e-15, "excess_pressure_ratio": ratio}
                 for name, soil in level.materials.items()}  # fmt: skip
        level, us = level.changed(materials=soils), []
        for end in (2.0, 2.05, 2.1, 2.15, 2.2):  # it swings elastically
            settings = SimulationSettings(duration_s=end, early_stop=False)
            (run,) = simulate([level], settings, threads=1)
            y = run.positions[-1][:, 1]
            low = (y > 1.0) & (y < 4.0)
            excess = run.effect_fields["excess_pore_pressure_pa"][low]
            us.append((excess / (9.81e3 * (6.0 - y[low]))).mean())
        found.append(np.mean(us))
    assert found[0] == pytest.approx(0.25 * 1.43 / 2.0, rel=0.03)
    assert 0.5 < found[1] < 0.6  # it swings, and yields a little more; not 0.4, as r_u s


def test_a_run_whose_flow_cannot_be_solved_ends_with_its_reason(monkeypatch):
    monkeypatch.setattr("mpm_taichi.solver.pore_water.MOST_TURNS", 1)
    (run,) = simulate([bank(permeability_m_per_s=1e-3)], SETTINGS, threads=1)
    assert run.status == "failed"
    assert run.reason == "the flow of the pore water could not be solved"


def test_what_cannot_be_is_refused_in_one_line():
    wet = bank(permeability_m_per_s=1e-5)
    with pytest.raises(InputError, match="pore_water: .* no soil with a permeability_m_per_s"):
        simulate([bank({"pore_water": 1.0})], SETTINGS)
    with pytest.raises(InputError, match="pore_water: .* 'gravity_on'"):
        simulate([wet], SETTINGS.model_copy(update={"initial_stress": "gravity_on"}))
    with pytest.raises(InputError, match="permeability_m_per_s: pore water does not flow in three"):
        simulate_3d(extruded(wet, 6.0), SETTINGS)
    with pytest.raises(InputError, match="pore_water is on; the direct model knows the base"):
        check_base_physics(wet, "the direct model")
    with pytest.raises(InputError, match="permeability_m_per_s"):
        bank(permeability_m_per_s=2.0)
    with pytest.raises(InputError, match="excess_pressure_ratio: of soil whose pore water flows"):
        bank(excess_pressure_ratio=0.5)
