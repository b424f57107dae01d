"""The solver on small scenes: open domains, fixed bodies, water, the two schedules."""

import numpy as np
import pytest

from geometry.random_scenes.templates import draw_scene
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi import flight, layout
from mpm_taichi import simulate as simulation
from mpm_taichi.flight import CHUNK
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import prepare
from pipeline.cli import InputError
from pipeline.config import SimulationSettings, load_config


def slump(**changes):
    """A 20 m x 8 m slump of 5 kPa with 160 points."""
    document = {
        "name": "slump",
        "domain": {"x_min": 0, "x_max": 60, "y_max": 20, "walls": "closed"},
        "ground": {"points": [[0, 0], [60, 0]]},
        "zones": [
            {"name": "a", "material": "clay", "polygon": [[20, 0], [40, 0], [40, 8], [20, 8]]}
        ],
        "materials": {"clay": {"friction_deg": 0, "cohesion_kpa": 5}},
        "spacing": 1.0,
    }
    return scene_from_mapping({**document, **changes})


SHORT = SimulationSettings(duration_s=3.0, early_stop=False)
FREE = {"left": "free", "right": "free"}


@pytest.mark.slow
def test_open_domain_is_bit_for_bit_a_wide_one():
    narrow = {"x_min": 16, "x_max": 44, "y_max": 20, "walls": "open", **FREE}
    wide = {"x_min": -40, "x_max": 100, "y_max": 20, "walls": "closed"}
    open_run, wide_run = simulate(
        [slump(domain=narrow), slump(domain=wide)], SHORT.model_copy(update={"duration_s": 6.0})
    )
    assert open_run.positions[-1, :, 0].min() < 16, "the soil must outrun the first domain"
    # Lattices and node lines of both coincide, so the physics is the same to the bit.
    shift = open_run.positions - wide_run.positions
    assert np.abs(shift).max() < 2e-5
    assert np.array_equal(open_run.plastic_shear_strain, wide_run.plastic_shear_strain)


def test_a_thrown_zone_finds_no_wall_in_an_open_domain():
    """The grid goes as far as the first frames of what is thrown, too."""
    thrown = [
        {"name": "a", "material": "clay", "polygon": [[20, 0], [40, 0], [40, 8], [20, 8]],
         "initial_velocity": [40.0, 0.0]}
    ]  # fmt: skip
    narrow = {"x_min": 16, "x_max": 44, "y_max": 20, "walls": "open"}
    wide = {"x_min": -40, "x_max": 212, "y_max": 20, "walls": "closed"}
    open_run, wide_run = simulate(
        [slump(domain=narrow, zones=thrown), slump(domain=wide, zones=thrown)], SHORT
    )
    assert open_run.positions[1, :, 0].max() > 44
    assert np.abs(open_run.positions - wide_run.positions).max() < 2e-5


def test_the_state_of_a_run_is_that_of_its_last_frame(monkeypatch):
    """Also where the chunk of frames that is computed at once would go beyond it."""
    settings = SHORT.model_copy(update={"duration_s": 1.4})
    (run,) = simulate([slump()], settings)
    assert (len(run.time) - 1) % CHUNK != 0
    monkeypatch.setattr(flight, "CHUNK", 1)
    (by_frame,) = simulate([slump()], settings)
    assert np.array_equal(run.positions, by_frame.positions)
    assert np.array_equal(run.velocity, by_frame.velocity)
    assert np.array_equal(run.stress, by_frame.stress)
    assert run.steps == by_frame.steps and run.audit == by_frame.audit


def test_more_materials_than_a_slot_holds_are_refused():
    clay = {"friction_deg": 0, "cohesion_kpa": 5, "saturated_density": 2000}
    left = {f"clay {number}": 2 * number for number in range(17)}
    zones = [
        {"name": name, "material": name, "polygon": [[x, 0], [x + 2, 0], [x + 2, 8], [x, 8]]}
        for name, x in left.items()
    ]
    with pytest.raises(InputError, match="materials: 17, 17 of them .* at most 32"):
        simulate([slump(zones=zones, materials=dict.fromkeys(left, clay))], SHORT)


def test_growing_slots_in_flight_changes_nothing(monkeypatch):
    """A large scene that comes late makes the arrays grow under a scene in flight."""
    big = slump(
        zones=[{"name": "a", "material": "clay", "polygon": [[5, 0], [55, 0], [55, 12], [5, 12]]}]
    )
    monkeypatch.setitem(simulation.SLOTS, "cpu", 2)
    monkeypatch.setattr(simulation, "PER_THREAD", 1)
    alone = simulate([slump()], SHORT)[0]
    short = slump(materials={"clay": {"friction_deg": 0, "cohesion_kpa": 500}})
    settings = SHORT.model_copy(update={"early_stop": True})
    quiet_alone = simulate([slump()], settings)[0]
    company = simulate([short, slump(), big], settings, threads=2)[1]
    assert np.array_equal(quiet_alone.positions, company.positions)
    assert np.array_equal(alone.positions[:5], company.positions[:5])


@pytest.mark.slow
def test_point_schedule_agrees_with_scene_schedule(monkeypatch):
    scenes = [
        slump(),
        slump(materials={"clay": {"friction_deg": 30, "cohesion_kpa": 1}}),
        slump(ground={"points": [[0, -0.3], [60, -6.3]]}),  # acts on columns of nodes
    ]
    by_scene = simulate(scenes, SHORT)
    monkeypatch.setitem(simulation.SCHEDULES, "cpu", "point")
    by_point = simulate(scenes, SHORT)
    for one, other in zip(by_scene, by_point, strict=True):
        assert one.status == other.status == "finished"
        assert one.steps == other.steps
        # Sums in another order: the same motion, until single points fly off and go their own way.
        off = np.abs(one.positions - other.positions)
        assert off[:8].max() < 0.01
        assert off[-1].mean() < 0.02
        assert np.abs(one.energy["kinetic"] - other.energy["kinetic"]).max() < 0.01 * max(
            one.energy["kinetic"]
        )


def test_kinematic_body_stops_soil():
    wall = {
        "name": "w", "material": "clay", "polygon": [[44, 0], [48, 0], [48, 12], [44, 12]],
        "kinematic": True,
    }  # fmt: skip
    zones = slump().model_dump()["zones"]
    held = simulate([slump(zones=[*zones, wall])], SHORT)[0]
    free = simulate([slump()], SHORT)[0]
    soil = ~held.kinematic
    assert np.array_equal(held.positions[0, ~soil], held.positions[-1, ~soil])
    assert free.positions[-1, :, 0].max() > 46
    assert held.positions[-1, soil, 0].max() < 45


def test_moving_kinematic_zone_and_unknown_effect_are_refused():
    zones = slump().model_dump()["zones"]
    moving = {**zones[0], "kinematic": True, "initial_velocity": (1.0, 0.0)}
    with pytest.raises(InputError, match="kinematic"):
        simulate([slump(zones=[moving])], SHORT)
    with pytest.raises(InputError, match="'rain' is unknown"):
        simulate([slump(effects={"rain": 1.0})], SHORT)


def test_pool_pushes_on_a_dry_core_with_its_whole_thrust():
    """The thrust of a pool of depth H on a falling water table is rho g H^2 / 2."""
    depth = 8.0
    scene = slump(water_level=depth, phreatic_line=[[0, depth], [28, depth], [32, 0], [60, 0]])
    force = {}
    for water in ("buoyant", "pore_pressure"):
        prepared = prepare(scene, SHORT.model_copy(update={"water": water}))
        x, y = prepared.grid.coordinates()
        horizontal = prepared.surroundings[:, layout.WATER_X].reshape(prepared.grid.shape)
        share = np.where(y > 0, 1.0, 0.5) * ((x >= 20) & (x <= 40) & (y > -0.5))
        force[water] = float((horizontal * share).sum()) * prepared.grid.cell**2
    assert force["buoyant"] == 0.0
    assert force["pore_pressure"] == pytest.approx(0.5 * 1000 * 9.81 * depth**2, rel=0.04)


def test_buoyancy_reduces_weight_by_the_water_displaced():
    wet = simulate(
        [slump(water_level=30.0, materials={"clay": {"friction_deg": 0, "cohesion_kpa": 500}})],
        SHORT,
    )[0]
    dry = simulate([slump(materials={"clay": {"friction_deg": 0, "cohesion_kpa": 500}})], SHORT)[0]
    ratio = wet.initial_stress[:, 1].mean() / dry.initial_stress[:, 1].mean()
    assert ratio == pytest.approx((1800 - 1000) / 1800, rel=0.02)


@pytest.mark.parametrize(
    "setting",
    [
        {"transfer": "apic"},
        {"transfer": "flip"},
        {"transfer": "pic"},
        {"pic_rate_per_s": 20.0},
        {"local_damping": 0.2},
        {"volumetric_averaging": False},
        {"volume_correction": False},
        {"pressure_relaxation": 0.1},
        {"pressure_smoothing": 0.0},
        {"initial_stress": "k0"},
        {"initial_stress": "gravity_on"},
        {"courant": 0.2},
        {"time_step_s": 0.002},
        {"gravity_m_per_s2": 5.0},
        {"frame_interval": 0.8},
    ],
)
@pytest.mark.slow
def test_every_setting_changes_the_run(setting):
    frictional = slump(
        materials={"clay": {"friction_deg": 25, "cohesion_kpa": 0.5}}, seed=3, jitter=0.3
    )
    settings = SimulationSettings(duration_s=1.5)
    usual = simulate([frictional], settings)[0]
    other = simulate([frictional], settings.model_copy(update=setting))[0]
    assert other.status == "finished", other.reason
    assert (usual.time[1] != other.time[1]) or not np.array_equal(
        usual.positions[-1], other.positions[-1]
    )


def test_smooth_and_rough_walls_differ():
    against = slump(
        zones=[{"name": "a", "material": "clay", "polygon": [[0, 0], [20, 0], [20, 8], [0, 8]]}]
    )
    smooth, held = (
        simulate([against], SHORT.model_copy(update={"wall_contact": contact}))[0]
        for contact in ("smooth", "no_slip")
    )
    near = smooth.positions[0, :, 0] < 1
    fallen = [float((r.positions[0] - r.positions[-1])[near, 1].mean()) for r in (smooth, held)]
    assert fallen[0] > 1.5 * fallen[1]
    assert smooth.wall_contact == {"left": 0.0}


def test_energy_account_closes():
    run = simulate([slump()], SimulationSettings(duration_s=20.0))[0]
    shares = [run.audit[name] for name in ("plastic_share", "contact_share", "numerical_share")]
    # A vertical face that falls onto the ground loses energy in the impact: four cells see no more.
    assert 0.0 <= run.audit["numerical_share"] < 0.2
    assert sum(shares) == pytest.approx(1.0, abs=0.02)
    assert run.energy["kinetic"][-1] < 0.01 * run.energy["kinetic"].max()


@pytest.mark.slow
def test_opening_soil_creates_no_energy():
    """Opened points within F-bar cells once fed energy to frictional scenes of the small scale."""
    config = load_config(None)
    settings = config.simulation_for("small").model_copy(update={"duration_s": 6.0})
    run = simulate([draw_scene(config, "small", 882)], settings)[0]
    assert run.status == "finished", run.reason
    assert run.audit["volume_opened"] > 1e-4, "the scene must open, or nothing is tested"
    assert 0.0 <= run.audit["numerical_share"] < 0.15


def test_top_of_a_closed_domain_is_a_lid_of_an_open_one_the_end():
    thrown = {**slump().model_dump()["zones"][0], "initial_velocity": (0.0, 14.0)}
    box = {"x_min": 0, "x_max": 60, "y_max": 12}
    closed, opened = simulate(
        [
            slump(zones=[thrown], domain={**box, "walls": "closed"}),
            slump(zones=[thrown], domain={**box, "walls": "open"}),
        ],
        SHORT,
    )
    assert closed.status == "finished" and closed.wall_contact["top"] > 0.0
    assert closed.positions[..., 1].max() < 12 + 2
    assert opened.status == "failed" and "domain.y_max 12 m" in opened.reason


def test_a_sheet_of_one_layer_brakes_by_the_friction_of_the_soil():
    # No thickness to speak of: what brakes it is sin(phi) g at the ground, from 10 m/s to rest.
    sheet = slump(
        domain={"x_min": 0, "x_max": 120, "y_max": 20, "walls": "open"},
        zones=[
            {
                "name": "a",
                "material": "sand",
                "polygon": [[20, 0], [60, 0], [60, 1.05], [20, 1.05]],
                "initial_velocity": [10.0, 0.0],
            }
        ],
        materials={"sand": {"friction_deg": 30, "cohesion_kpa": 0}},
    )
    (run,) = simulate([sheet], SHORT)
    way = run.positions[:, :, 0].astype(float).mean(axis=1) - 40.0
    braking = np.minimum(run.time, 10.0 / (0.5 * 9.81))
    expected = 10.0 * braking - 0.25 * 9.81 * braking**2
    assert np.abs(way - expected).max() < 0.02 * expected[-1]
