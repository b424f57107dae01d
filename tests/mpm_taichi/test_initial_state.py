"""The stress at t = 0: K0, settled, pre-failure strengths, water; and that nothing moves before."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.initial_state import (
    k0_stress,
    locate,
    material_rows,
    prepare,
    resting_points,
)
from pipeline.config import SimulationSettings

GRAVITY, WATER = 9.81, 1000.0
K0 = SimulationSettings(initial_stress="k0")
SETTLED = SimulationSettings(duration_s=5.0, early_stop=False)

STRONG = {"friction_deg": 35, "cohesion_kpa": 500, "density": 1800}
LAYER = [[0, 0], [40, 0], [40, 10], [0, 10]]
SLOPE = [[4, 0], [36, 0], [24, 10], [12, 10]]


def scene(polygons=None, materials=None, **changes):
    """Zones by name, each of the material of the same name; the default is a level layer."""
    polygons = polygons or {"soil": LAYER}
    materials = materials or {name: STRONG for name in polygons}
    zones = [
        {"name": name, "material": name, "polygon": polygon} for name, polygon in polygons.items()
    ]
    document = {
        "name": "start",
        "domain": {"x_min": 0, "x_max": 40, "y_max": 30},
        "ground": {"points": [[0, 0], [40, 0]]},
        "zones": zones,
        "materials": materials,
        "spacing": 1.0,
    }
    return scene_from_mapping({**document, **changes})


def stress_at_start(chosen, settings=K0):
    """Positions (N, 2) and stress (N, 4) in the order of the points."""
    prepared = prepare(chosen, settings)
    stress = np.zeros((len(prepared.points), 4))
    stress[prepared.order] = prepared.stress
    return prepared.points.position, stress


def shift_of(run):
    """Largest distance of any point from its place at t = 0, over the whole run [m]."""
    return float(np.hypot(*np.moveaxis(run.positions - run.positions[0], 2, 0)).max())


# --- K0 ---


def test_k0_of_a_level_layer_by_hand():
    position, stress = stress_at_start(scene())
    depth = 10.0 - position[:, 1]
    assert stress[:, 1] == pytest.approx(-1800 * GRAVITY * depth)
    ratio = 0.3 / 0.7
    assert stress[:, 0] == pytest.approx(ratio * stress[:, 1])
    assert stress[:, 2] == pytest.approx(ratio * stress[:, 1])
    assert (stress[:, 3] == 0).all()


def test_k0_of_two_layers_by_hand():
    polygons = {
        "low": [[0, 0], [40, 0], [40, 4], [0, 4]],
        "high": [[0, 4], [40, 4], [40, 10], [0, 10]],
    }
    materials = {
        "low": {**STRONG, "density": 2000, "poisson_ratio": 0.4},
        "high": {**STRONG, "density": 1500, "poisson_ratio": 0.2},
    }
    position, stress = stress_at_start(scene(polygons, materials))
    y = position[:, 1]
    weight = np.where(y > 4, 1500 * (10 - y), 1500 * 6 + 2000 * (4 - y))
    assert stress[:, 1] == pytest.approx(-GRAVITY * weight)
    lateral = np.where(y > 4, 0.2 / 0.8, 0.4 / 0.6)
    assert stress[:, 0] == pytest.approx(lateral * stress[:, 1])


@pytest.mark.parametrize("saturated", [None, 2000.0])
def test_k0_under_water_by_hand(saturated):
    materials = {"soil": {**STRONG, "saturated_density": saturated}}
    position, stress = stress_at_start(scene(materials=materials, water_level=6.0))
    y, wet = position[:, 1], saturated or 1800.0
    effective = np.where(y > 6, 1800 * (10 - y), 1800 * 4 + (wet - WATER) * (6 - y))
    assert stress[:, 1] == pytest.approx(-GRAVITY * effective)


def test_k0_below_a_slope_is_the_weight_of_the_column():
    chosen = scene({"soil": SLOPE})
    position, stress = stress_at_start(chosen)
    volume = fill(chosen).volume
    for column in (8.5, 14.5, 20.5):
        here = position[:, 0] == column
        above = np.array([volume[here & (position[:, 1] > y)].sum() for y in position[here, 1]])
        assert stress[here, 1] == pytest.approx(-1800 * GRAVITY * (above + 0.5 * volume[here]))


def test_k0_takes_mass_and_lateral_ratio_point_by_point():
    chosen = scene()
    points = fill(chosen)
    mass = np.linspace(1000, 2000, len(points))
    lateral = np.linspace(0.3, 0.6, len(points))
    stress = k0_stress(chosen, points, mass, lateral, 10.0)
    column = points.position[:, 0] == 0.5
    order = np.flatnonzero(column)[np.argsort(-points.position[column, 1])]
    weights = 10.0 * mass[order]
    assert stress[order, 1] == pytest.approx(-(np.cumsum(weights) - 0.5 * weights))
    assert stress[:, 0] == pytest.approx(lateral * stress[:, 1])


# --- materials, places, bodies ---


def test_saturated_soil_is_a_material_of_its_own_with_its_mass():
    materials = {"soil": {**STRONG, "saturated_density": 2050}}
    chosen = scene(materials=materials, water_level=4.0)
    points = fill(chosen)
    row, rows, densities = material_rows(chosen, points)
    assert len(rows) == 2 and densities == [1800.0, 2050.0]
    assert (row == (points.position[:, 1] < 4.0)).all()
    prepared = prepare(chosen, K0)
    expected = np.where(points.position[prepared.order, 1] < 4.0, 2050.0, 1800.0)
    assert prepared.density[prepared.row] == pytest.approx(expected)
    assert prepared.mass == pytest.approx(expected * points.volume[prepared.order])


def test_no_saturated_row_without_water():
    chosen = scene(materials={"soil": {**STRONG, "saturated_density": 2050}})
    _, rows, densities = material_rows(chosen, fill(chosen))
    assert len(rows) == 1 and densities == [1800.0]


def test_points_are_found_again_from_home_and_offset():
    prepared = prepare(scene(jitter=0.8, seed=3), K0)
    grid, place = prepared.grid, prepared.points.position
    motion, home = locate(grid, place)
    assert (motion[:, :2] >= -0.5).all() and (motion[:, :2] <= 0.5).all()
    node = np.stack(np.divmod(home, grid.shape[1]), axis=1)
    again = np.asarray(grid.origin) + grid.cell * (node + motion[:, :2].astype(float))
    assert np.abs(again - place).max() < 1e-6


def test_only_bodies_on_the_ground_that_are_not_thrown_rest():
    polygons = {
        "base": [[0, 0], [10, 0], [10, 4], [0, 4]],
        "on it": [[2, 4], [8, 4], [8, 8], [2, 8]],
        "hanging": [[2, 14], [8, 14], [8, 18], [2, 18]],
        "thrown": [[20, 0], [26, 0], [26, 6], [20, 6]],
        "on the thrown": [[20, 6], [26, 6], [26, 9], [20, 9]],
    }
    chosen = scene(polygons)
    document = chosen.model_dump()
    document["zones"][3]["initial_velocity"] = (1.0, 0.0)
    chosen = scene_from_mapping(document)
    points = fill(chosen)
    resting = resting_points(chosen, points)
    by_zone = [set(resting[points.zone == k].tolist()) for k in range(5)]
    assert by_zone == [{True}, {True}, {False}, {False}, {False}]
    _, stress = stress_at_start(chosen)
    assert (stress[points.zone >= 2] == 0).all(), "what flies starts free of stress"


def test_soil_on_a_fixed_body_rests():
    polygons = {
        "shelf": [[4, 10], [20, 10], [20, 14], [4, 14]],
        "soil": [[6, 14], [18, 14], [18, 18], [6, 18]],
    }
    document = scene(polygons).model_dump()
    document["zones"][0]["kinematic"] = True
    chosen = scene_from_mapping(document)
    assert resting_points(chosen, fill(chosen)).all()


# --- settled ---


POOL = {"water_level": 7.0}
DAM = {"water_level": 9.0, "phreatic_line": [[0, 9], [12, 9], [28, 2], [40, 2]]}
STARTS = {
    "dry": ({}, "buoyant"),
    "bonded ground": ({"ground": {"points": [[0, 0], [40, 0]], "contact": "no_slip"}}, "buoyant"),
    "jitter": ({"jitter": 0.5, "seed": 4}, "buoyant"),
    "submerged": (POOL, "buoyant"),
    "submerged, pore pressure": (POOL, "pore_pressure"),
    "dam": (DAM, "buoyant"),
    "dam, pore pressure": (DAM, "pore_pressure"),
}


@pytest.mark.parametrize("name", STARTS)
def test_a_strong_slope_stays_where_it_is(name):
    changes, water = STARTS[name]
    settings = SETTLED.model_copy(update={"water": water})
    chosen = scene({"soil": SLOPE}, **changes)
    run = simulate([chosen], settings, threads=1)[0]
    assert run.status == "finished", run.reason
    assert run.audit["settle_unbalanced"] < 2e-4
    assert np.array_equal(run.positions[0], fill(chosen).position.astype(np.float32))
    assert shift_of(run) < 0.1 * chosen.spacing
    assert run.energy["kinetic"].max() < 1e-3 * abs(run.energy["potential"][0])


def test_two_stiffnesses_stay_where_they_are():
    polygons = {
        "core": [[16, 0], [20, 0], [20, 10], [16, 10]],
        "shell": [[20, 0], [36, 0], [24, 10], [20, 10]],
        "other": [[4, 0], [16, 0], [16, 10], [12, 10]],
    }
    materials = {name: {**STRONG, "youngs_modulus_mpa": 30} for name in polygons}
    materials["core"]["youngs_modulus_mpa"] = 3.0
    materials["core"]["poisson_ratio"] = 0.45
    run = simulate([scene(polygons, materials)], SETTLED, threads=1)[0]
    assert shift_of(run) < 0.1


def test_settling_is_what_keeps_a_slope_at_rest():
    slope = scene({"soil": SLOPE})
    shifts = {
        start: shift_of(
            simulate([slope], SETTLED.model_copy(update={"initial_stress": start}), threads=1)[0]
        )
        for start in ("settled", "k0", "gravity_on")
    }
    assert shifts["settled"] < 0.2 * shifts["k0"]
    assert shifts["k0"] < shifts["gravity_on"]


def test_settled_stress_carries_the_weight():
    chosen = scene({"soil": SLOPE})
    run = simulate([chosen], SETTLED, threads=1)[0]
    position, stress = run.positions[0], run.initial_stress
    # The vertical stress of a row of points carries what lies above it.
    for y in (2.5, 4.5, 6.5):
        row = position[:, 1] == y
        above = 1800 * GRAVITY * ((position[:, 1] > y).sum() + 0.5 * row.sum())
        assert -stress[row, 1].sum() == pytest.approx(above, rel=0.15)


# --- strengths ---


def yield_excess(stress, friction_deg, cohesion):
    """Largest value of the shear yield function of stresses (N, 4) [Pa]."""
    xx, yy, zz, xy = stress.astype(float).T
    centre, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    high, low = np.maximum(centre + radius, zz), np.minimum(centre - radius, zz)
    sine, cosine = np.sin(np.radians(friction_deg)), np.cos(np.radians(friction_deg))
    return ((high - low) + (high + low) * sine - 2 * cohesion * cosine).max()


def test_settling_is_elastic_unless_pre_failure_strengths_are_given():
    weak = {"friction_deg": 0, "cohesion_kpa": 10, "density": 1800}
    before = {"friction_deg": 25, "cohesion_kpa": 15}
    runs = simulate(
        [
            scene({"soil": SLOPE}, {"soil": weak}),
            scene({"soil": SLOPE}, {"soil": {**weak, "pre_failure": before}}),
        ],
        SETTLED,
        threads=1,
    )
    elastic, limited = (run.initial_stress for run in runs)
    assert yield_excess(elastic, 25, 15e3) > 1e3, "elastic stress goes beyond the strength"
    assert yield_excess(limited, 25, 15e3) < 10.0
    assert np.abs(elastic - limited).max() > 1e3


def test_at_t0_every_zone_gets_its_own_strength():
    weak = {"friction_deg": 0, "cohesion_kpa": 10, "density": 1800}
    kept = {"pre_failure": {"friction_deg": 35, "cohesion_kpa": 500}}
    run = simulate([scene({"soil": SLOPE}, {"soil": {**weak, **kept}})], SETTLED, threads=1)[0]
    assert yield_excess(run.initial_stress, 0, 10e3) > 1e4
    assert yield_excess(run.stress, 0, 10e3) < 10.0
    assert shift_of(run) > 1.0, "10 kPa cannot hold 10 m"


def test_gravity_on_starts_free_of_stress():
    settings = SETTLED.model_copy(update={"initial_stress": "gravity_on"})
    prepared = prepare(scene(), settings)
    assert (prepared.stress == 0).all() and prepared.settled == 0


# --- another K0 ---


@pytest.mark.parametrize("start", ["k0", "settled"])
def test_a_stated_k0_is_the_ratio_before_the_slide(start):
    settings = SimulationSettings(initial_stress=start, k0=0.8, duration_s=0.1, early_stop=False)
    position, stress = stress_at_start(scene(), settings)
    assert stress[:, 0] == pytest.approx(0.8 * stress[:, 1])
    (run,) = simulate([scene()], settings, threads=1)
    assert run.status == "finished", run.reason
    middle = np.abs(run.positions[0, :, 0] - 20.0) < 5.0
    before = run.initial_stress[middle]
    # Elastic relaxation of a level layer in balance leaves the ratio as it is.
    assert before[:, 0].sum() == pytest.approx(0.8 * before[:, 1].sum(), rel=0.01)


def test_a_stated_k0_moves_a_slope_that_liquefies():
    """The stress that the liquefied soil loses is released, and sets it in motion."""
    slope = scene(
        zones=[{"name": "a", "polygon": [[0, 0], [30, 0], [15, 10], [0, 10]], "material": "soil"}],
        materials={"soil": {"friction_deg": 0, "cohesion_kpa": 20, "liquefied": True}},
    )
    ways = []
    for k0 in (None, 0.43, 1.0):
        (run,) = simulate([slope], SimulationSettings(k0=k0, duration_s=5.0), threads=1)
        ways.append(float((run.positions[-1] - run.positions[0])[:, 0].mean()))
    assert abs(ways[2] - ways[1]) > 3.0 * abs(ways[1] - ways[0])
