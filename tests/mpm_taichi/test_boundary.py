"""Ground, walls and fixed bodies as the nodes see them."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import numpy as np
import pytest
import taichi as ti
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi import layout
from mpm_taichi.layout import vec2, vec8
from mpm_taichi.solver.boundary import (
    COLUMN,
    LEFT,
    LOWEST,
    MARGIN,
    RIGHT,
    ROUGH,
    SLIDE,
    STICK,
    TOP,
    TRACTION,
    contact,
    edge_bits,
    fixed_by_bodies,
    ground_normal,
    ground_shares,
    make_grid,
    node_tables,
    node_weight,
)
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver.splines import BASE_EDGE, LEFT_EDGE, RIGHT_EDGE
from tests.budget import examples

VEC2 = ti.types.ndarray(dtype=vec2, ndim=1)
VEC8 = ti.types.ndarray(dtype=vec8, ndim=1)
LINES = {
    "level on a grid line": [[0, 2], [40, 2]],
    "sloped": [[0, 12], [40, 3]],
    "bent": [[0, 8], [10, 4.3], [26, 5.1], [40, 3]],
}


@pytest.fixture(scope="module", autouse=True)
def taichi():
    start("cpu", 1)


def scene(points, contact="rough", **changes):
    top = max(y for _, y in points)
    document = {
        "name": "block",
        "domain": {"x_min": 0, "x_max": 40, "y_max": 30},
        "ground": {"points": points, "contact": contact},
        "zones": [
            {
                "name": "a",
                "material": "soil",
                "polygon": [[10, top], [20, top], [20, top + 6], [10, top + 6]],
            }
        ],
        "materials": {"soil": {"friction_deg": 30, "cohesion_kpa": 5}},
        "spacing": 0.5,
    }
    if contact == "coulomb":
        document["ground"]["friction_coefficient"] = 0.4
    return scene_from_mapping({**document, **changes})


def tables(chosen, wall_contact="smooth", water="buoyant"):
    grid = make_grid(chosen)
    kind, table = node_tables(
        chosen, grid, wall_contact=wall_contact, water=water, water_face="fixed", gravity=9.81
    )
    return grid, kind.reshape(grid.shape), table.reshape(*grid.shape, 8)


# --- the grid and its splines ---


def test_grid_has_node_lines_on_the_lowest_ground_and_the_left_wall():
    grid = make_grid(scene(LINES["bent"]))
    x, y = grid.coordinates()
    assert x[MARGIN, 0] == 0.0 and y[0, MARGIN] == 3.0
    assert x[-1 - MARGIN, 0] >= 40.0 and y[0, -1 - MARGIN] >= 30.0
    assert grid.nodes == x.size


@pytest.mark.parametrize("name", LINES)
def test_node_weight_keeps_the_amount_and_its_first_moment(name):
    chosen = scene(LINES[name])
    grid = make_grid(chosen)
    random = np.random.default_rng(0)
    points = random.uniform([0, 0], [40, 1], (300, 2))
    base = chosen.ground.height(points[:, 0])
    points[:, 1] = base + points[:, 1] * (28 - base)
    amount = random.uniform(0, 2, 300)
    weight = node_weight(grid, points, amount, edge_bits(chosen.ground, grid))
    x, y = grid.coordinates()
    assert weight.sum() == pytest.approx(amount.sum())
    assert (weight * x).sum() == pytest.approx(amount @ points[:, 0])
    assert (weight * y).sum() == pytest.approx(amount @ points[:, 1])


# --- rough ground ---


def ends_of_integration(grid):
    left = grid.origin[0] + MARGIN * grid.cell
    return left, grid.origin[0] + (grid.shape[0] - 1 - MARGIN) * grid.cell


@pytest.mark.parametrize("name", LINES)
def test_ground_areas_add_up_to_the_length_of_the_ground(name):
    chosen = scene(LINES[name])
    grid = make_grid(chosen)
    area, _ = ground_shares(chosen.ground, grid)
    fine = np.linspace(*ends_of_integration(grid), 200_001)
    length = np.hypot(np.diff(fine), np.diff(chosen.ground.height(fine))).sum()
    assert area.sum() == pytest.approx(length, rel=1e-3 if name == "bent" else 1e-6)


@pytest.mark.parametrize("name", LINES)
def test_ground_areas_integrate_linear_functions_over_the_ground(name):
    chosen = scene(LINES[name])
    grid = make_grid(chosen)
    area, _ = ground_shares(chosen.ground, grid)
    x, y = grid.coordinates()
    fine = np.linspace(*ends_of_integration(grid), 200_001)
    middle = 0.5 * (fine[1:] + fine[:-1])
    length = np.hypot(np.diff(fine), np.diff(chosen.ground.height(fine)))
    for nodes, line in ((x, middle), (y, chosen.ground.height(middle))):
        assert (area * nodes).sum() == pytest.approx(length @ line, rel=2e-3)


@pytest.mark.parametrize("height", [2.0, 2.3, 2.5, 2.9])
def test_a_level_ground_has_a_cell_of_area_in_each_column_wherever_it_lies(height):
    # Lowest ground at 2 m sets the grid; the level part lies anywhere in its cell.
    chosen = scene([[0, 2], [2, height], [40, height]])
    grid = make_grid(chosen)
    area, volume = ground_shares(chosen.ground, grid)
    columns = slice(MARGIN + 5, -MARGIN - 4)
    assert area[columns].sum(axis=1) == pytest.approx(grid.cell)
    # Three cells of space above the ground, of which no share is lost to the nodes below it.
    assert volume[columns].sum(axis=1) == pytest.approx(3 * grid.cell**2)


def test_traction_reaches_the_nodes_whose_splines_touch_the_ground_and_no_others():
    chosen = scene(LINES["level on a grid line"])
    grid, kind, table = tables(chosen)
    middle = grid.shape[0] // 2
    _, y = grid.coordinates()
    touched = (kind[middle] & TRACTION) > 0
    assert y[middle, touched] == pytest.approx([2.0])
    assert table[middle, touched, layout.AREA] == pytest.approx([1.0], abs=2e-3)
    # Half a cell up the grid line lies inside the cell: three nodes are within reach.
    chosen = scene([[0, 2], [2, 2.5], [40, 2.5]])
    grid, kind, table = tables(chosen)
    touched = (kind[middle] & TRACTION) > 0
    assert y[middle, touched] == pytest.approx([2.0, 3.0])


def test_splines_end_on_level_ground_that_lies_on_a_line_of_nodes_and_on_walls():
    chosen = scene([[0, 2], [20, 2], [25, 6], [40, 6]])
    grid = make_grid(chosen)
    bits = edge_bits(chosen.ground, grid)
    x, y = grid.coordinates()
    low = (y == 2.0) & (x <= 18.5)
    high = (y == 6.0) & (x >= 26.5)
    assert ((bits & BASE_EDGE > 0) == low | high).all()
    assert ((bits & LEFT_EDGE > 0) == (x == 0.0)).all()
    assert ((bits & RIGHT_EDGE > 0) == (x == 40.0)).all()
    between = scene([[0, 2], [2, 2.5], [40, 2.5]])
    assert not (edge_bits(between.ground, make_grid(between)) & BASE_EDGE)[
        MARGIN + 5 : -MARGIN - 5
    ].any()


# --- ground that crosses the cells ---


def test_ground_acts_on_a_column_together_only_where_it_crosses_the_cells():
    chosen = scene([[0, 2], [10, 2], [14, 4.5], [24, 4.5], [24.5, 9], [40, 9]])
    grid, kind, table = tables(chosen)
    x, y = grid.coordinates()
    together = (kind & COLUMN) > 0
    level = x[:, 0] <= 8.5  # further on a spline reaches the slope
    assert not together[level].any(), "on a line its own nodes act"
    between = (x[:, 0] > 15.5) & (x[:, 0] < 22.5)
    assert y[between][together[between]].reshape(-1, 2).tolist() == [[4.0, 5.0]] * between.sum()
    face = (x[:, 0] >= 23.5) & (x[:, 0] <= 25.5)
    assert not together[face].any(), "at a steep face nodes act one by one"
    lowest = (kind & LOWEST) > 0
    assert (lowest.sum(axis=1) == together.any(axis=1)).all()
    assert table[lowest][:, layout.ROWS] == pytest.approx(together.sum(axis=1)[lowest.any(axis=1)])
    assert (table[together][:, layout.PER_COVER] > 0).all()


def test_no_slip_walls_and_fixed_bodies_hold_their_nodes_of_a_column():
    chosen = scene(LINES["sloped"])
    grid, kind, _ = tables(chosen, wall_contact="no_slip")
    held = (kind & STICK) > 0
    assert held[: MARGIN + 1].all() and not (kind[held] & COLUMN).any()
    assert (kind & COLUMN).any()


# --- types and tables ---


@pytest.mark.parametrize(
    ("name", "bit"), [("rough", ROUGH), ("no_slip", STICK), ("coulomb", SLIDE)]
)
def test_nodes_on_and_below_the_ground_are_of_its_type(name, bit):
    chosen = scene(LINES["sloped"], contact=name)
    grid, kind, table = tables(chosen)
    x, y = grid.coordinates()
    below = y <= chosen.ground.height(x) + 1e-6
    assert ((kind & bit > 0) == below | (kind & COLUMN > 0)).all()
    others = (ROUGH | STICK | SLIDE) & ~bit
    assert not (kind & others).any()
    expected = 0.4 if name == "coulomb" else 0.0
    assert (table[..., layout.COEFFICIENT] == np.float32(expected)).all()


@pytest.mark.parametrize("name", LINES)
def test_normals_are_those_of_the_line_and_point_up(name):
    chosen = scene(LINES[name])
    x = np.array([-5.0, 5.0, 20.0, 39.0, 45.0])
    normal = ground_normal(chosen, x)
    assert np.hypot(*normal.T) == pytest.approx(1.0)
    slope = (chosen.ground.height(x + 0.01) - chosen.ground.height(x - 0.01)) / 0.02
    assert normal[:, 0] + slope * normal[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert normal[[0, -1]] == pytest.approx(np.array([[0.0, 1.0], [0.0, 1.0]]))
    assert (normal[:, 1] > 0).all()


def test_walls_and_lid():
    chosen = scene(LINES["level on a grid line"])
    grid, kind, _ = tables(chosen)
    x, y = grid.coordinates()
    assert ((kind & LEFT > 0) == (x <= 0.0)).all()
    assert ((kind & RIGHT > 0) == (x >= 40.0)).all()
    assert ((kind & TOP > 0) == (y >= 30.0)).all()
    assert not (kind & STICK).any()
    _, held, _ = tables(chosen, wall_contact="no_slip")
    assert ((held & STICK > 0) == ((x <= 0.0) | (x >= 40.0))).all()


def test_fixed_bodies_hold_the_nodes_they_outweigh():
    chosen = scene(LINES["level on a grid line"])
    grid, kind, _ = tables(chosen)
    place = np.arange(0.25, 6.0, 0.5)
    body = np.stack(np.meshgrid(10 + place, 5 + place), axis=-1).reshape(-1, 2)
    soil = body + [6.0, 0.0]
    held = fixed_by_bodies(grid, soil, body, kind.ravel()).reshape(grid.shape)
    x, y = grid.coordinates()
    assert held[(x > 10) & (x < 15.9) & (y > 5) & (y < 11)].all()
    assert not held[(x > 16.1) & (x < 25)].any(), "the soil next to it is free"
    assert not fixed_by_bodies(grid, soil, np.empty((0, 2)), kind.ravel()).any()


def water_at(wet, across, water):
    """Force of the water at the nodes of the column at 20 m, whose level is 15 m, by elevation."""
    line = {"water_level": 20.0, "phreatic_line": [[0, 15 + 20 * across], [40, 15 - 20 * across]]}
    chosen = scene(LINES["level on a grid line"], **(line if wet else {}))
    grid, _, surroundings = tables(chosen, water=water)
    x, y = grid.coordinates()
    column = np.abs(x[:, 0] - 20.0) < 1e-9
    force = surroundings[column][0][:, [layout.WATER_X, layout.WATER_Y]]
    return {
        round(float(place), 6): tuple(one) for place, one in zip(y[column][0], force, strict=True)
    }


def test_water_force_is_the_slope_of_the_pore_pressure():
    unit = 1000 * 9.81
    force = water_at(True, 0.25, "pore_pressure")
    assert force[10.0] == pytest.approx((unit / 4, unit)) and force[25.0] == (0.0, 0.0)
    # At the level itself half a cell is wet, so the force sets in smoothly.
    assert force[15.0] == pytest.approx((unit / 8, unit / 2))
    assert water_at(True, 0.25, "buoyant")[10.0] == pytest.approx((0.0, unit))
    assert not np.any(list(water_at(False, 0.25, "pore_pressure").values()))


# --- contact ---


@ti.kernel
def contact_of(
    velocity: VEC2, new: VEC2, table: VEC8, kind: ti.i32, friction: ti.f32, adhesion: ti.f32
):
    for n in velocity:
        new[n] = contact(velocity[n], kind, table[n], friction, adhesion)


def after_contact(velocity, kind, *, normal=(0.0, 1.0), friction=0.0, adhesion=0.0):
    old = np.array([velocity], np.float32)
    new = np.zeros_like(old)
    table = np.array([[*normal, 0, 0, 0, 0, 0, 0]], np.float32)
    contact_of(old, new, table, kind, friction, adhesion)
    return new[0].astype(float)


def test_bonded_ground_holds_whatever_comes():
    assert after_contact((3.0, 2.0), STICK) == pytest.approx([0.0, 0.0])


def test_soil_may_leave_coulomb_ground():
    assert after_contact((3.0, 2.0), SLIDE, friction=0.5) == pytest.approx([3.0, 2.0])


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_coulomb_ground_slows_by_friction_times_the_normal_impulse(friction):
    new = after_contact((3.0, -2.0), SLIDE, friction=friction)
    assert new == pytest.approx([3.0 - 2.0 * friction, 0.0])
    back = after_contact((-3.0, -2.0), SLIDE, friction=friction)
    assert back == pytest.approx([-3.0 + 2.0 * friction, 0.0])


def test_friction_stops_and_never_turns_the_motion():
    assert after_contact((0.5, -2.0), SLIDE, friction=0.6) == pytest.approx([0.0, 0.0])


def test_contact_acts_along_the_slope():
    b = np.radians(30.0)
    along, normal = np.array([np.cos(b), -np.sin(b)]), np.array([np.sin(b), np.cos(b)])
    new = after_contact(4.0 * along - 1.0 * normal, SLIDE, normal=normal, friction=0.5)
    assert new == pytest.approx(3.5 * along)


def test_rough_ground_has_adhesion_too_and_holds_nothing_down():
    new = after_contact((3.0, -2.0), ROUGH | TRACTION, friction=0.3, adhesion=0.4)
    assert new == pytest.approx([2.0, 0.0])
    assert after_contact((3.0, 2.0), ROUGH | TRACTION, friction=0.3, adhesion=0.4) == pytest.approx(
        [2.6, 2.0]
    )


def test_a_node_above_rough_ground_feels_its_traction_alone():
    new = after_contact((3.0, -2.0), TRACTION, friction=0.3, adhesion=0.4)
    assert new == pytest.approx([2.6, -2.0])


@pytest.mark.parametrize(
    ("kind", "velocity", "expected"),
    [
        (LEFT, (-3.0, 2.0), (0.0, 2.0)),
        (LEFT, (3.0, 2.0), (3.0, 2.0)),
        (RIGHT, (3.0, 2.0), (0.0, 2.0)),
        (RIGHT, (-3.0, 2.0), (-3.0, 2.0)),
        (TOP, (-3.0, 2.0), (-3.0, 0.0)),
        (TOP, (-3.0, -2.0), (-3.0, -2.0)),
        (LEFT | SLIDE, (-3.0, -2.0), (0.0, 0.0)),
    ],
)
def test_walls_and_lid_stop_what_enters_them(kind, velocity, expected):
    assert after_contact(velocity, kind) == pytest.approx(expected)


speeds = st.floats(-20.0, 20.0, width=32)


@settings(max_examples=examples(200), deadline=None)
@given(
    velocity=st.tuples(speeds, speeds),
    angle=st.floats(-1.2, 1.2),
    friction=st.floats(0.0, 2.0),
    adhesion=st.floats(0.0, 3.0),
    kind=st.sampled_from([STICK, SLIDE, ROUGH, ROUGH | TRACTION, TRACTION]),
)
def test_contact_never_speeds_up_and_nothing_enters_the_ground(
    velocity, angle, friction, adhesion, kind
):
    normal = np.array([-np.sin(angle), np.cos(angle)])
    old = np.array(velocity, float)
    new = after_contact(velocity, kind, normal=normal, friction=friction, adhesion=adhesion)
    slack = 1e-5 * (1.0 + np.abs(old).max())
    assert np.hypot(*new) <= np.hypot(*old) + slack
    assert (old - new) @ (old + new) >= -slack * np.hypot(*old), "contact takes energy"
    if kind != TRACTION:
        assert new @ normal >= -slack
    along = np.array([normal[1], -normal[0]])
    pressed = max(-old @ normal, 0.0) if kind != TRACTION else 0.0
    if kind != STICK:
        assert abs((old - new) @ along) <= friction * pressed + adhesion + slack
        assert (old @ along) * (new @ along) >= -slack
