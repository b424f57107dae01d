"""Filling: a regular lattice, the right zone at shared borders, the right area."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon, box

from geometry import Scene
from geometry.scenes.fill import contains, covered_squares, fill
from geometry.scenes.polygon_checks import area
from geometry.scenes.scene import scene_from_mapping
from tests.budget import examples

some = settings(
    max_examples=examples(40),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
coordinate = st.integers(0, 120).map(lambda n: 0.5 * n)


def test_lattice_counts_from_wall_and_ground(make_scene):
    polygon = [(3.0, 0.0), (13.0, 0.0), (13.0, 6.0), (3.0, 6.0)]
    points = fill(make_scene([polygon], spacing=0.5))
    assert len(points) == 20 * 12
    assert (points.volume == 0.25).all()
    np.testing.assert_allclose(points.position % 0.5, 0.25)
    np.testing.assert_allclose(points.position.min(axis=0), [3.25, 0.25])
    # Four points in every cell of twice the spacing that the base touches.
    cells = np.floor(points.position / 1.0)
    assert (np.unique(cells, axis=0, return_counts=True)[1] == 4).all()


def test_order_is_row_by_row(make_scene):
    points = fill(make_scene([[(0, 0), (4, 0), (4, 2), (0, 2)]]))
    np.testing.assert_array_equal(
        points.position, [(x + 0.5, y + 0.5) for y in range(2) for x in range(4)]
    )


@some
@given(
    corners=st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=7, unique=True),
    cut=st.tuples(coordinate, coordinate),
)
def test_no_point_is_lost_or_doubled_at_a_shared_border(corners, cut):
    """A fan of triangles about a point covers the plane as often as its outline winds round it."""
    lattice = np.stack(np.meshgrid(np.arange(61) + 0.5, np.arange(61) + 0.5), axis=-1)
    points = lattice.reshape(-1, 2)
    hull = (
        np.array(Polygon(corners).convex_hull.exterior.coords)[:-1] if _has_area(corners) else None
    )
    if hull is None:
        return
    centre = np.asarray(cut)
    if not Polygon(hull).buffer(-1e-9).contains(Point(cut)):
        centre = hull.mean(axis=0)
    fan = [np.array([a, b, centre]) for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True)]
    hits = sum(contains(triangle, points).astype(int) for triangle in fan)
    np.testing.assert_array_equal(hits, contains(hull, points).astype(int))


def _has_area(corners) -> bool:
    return Polygon(corners).convex_hull.area > 1.0


@some
@given(
    x0=st.floats(0, 40),
    width=st.floats(15, 60),
    height=st.floats(15, 50),
    lean=st.floats(-0.4, 0.4),
    share=st.floats(0.2, 0.8),
    spacing=st.sampled_from([0.25, 0.5]),
)
def test_area_and_zones_of_a_leaning_block(make_scene, x0, width, height, lean, share, spacing):
    """Two zones one above the other: total area, and every point in the zone it lies in."""
    shift, middle = lean * height, share * height

    def ring(low, high):
        left = [x0 + shift * low / height, x0 + shift * high / height]
        return [(left[0], low), (left[0] + width, low), (left[1] + width, high), (left[1], high)]

    rings = [ring(0.0, middle), ring(middle, height)]
    points = fill(make_scene(rings, spacing=spacing))
    total = sum(area(r) for r in rings)
    assert points.volume.sum() == pytest.approx(total, rel=1e-9)
    for number, polygon in enumerate(rings):
        held = points.volume[points.zone == number].sum()
        assert held == pytest.approx(area(polygon), rel=1e-9)
        own = points.position[points.zone == number]
        shape = Polygon(polygon).buffer(1e-6 * spacing + 1e-9)
        assert all(shape.covers(Point(place)) for place in own[:: max(1, len(own) // 50)])


def test_points_on_a_border_go_up_and_right(make_scene):
    left = [(0.0, 0.0), (10.5, 0.0), (10.5, 5.5), (0.0, 5.5)]
    right = [(10.5, 0.0), (20.0, 0.0), (20.0, 5.5), (10.5, 5.5)]
    above = [(0.0, 5.5), (20.0, 5.5), (20.0, 10.0), (0.0, 10.0)]
    points = fill(make_scene([left, right, above]))
    assert len(points) == 200
    on_border = points.position[:, 0] == 10.5
    assert (points.zone[on_border & (points.position[:, 1] < 5.0)] == 1).all()
    assert (points.zone[points.position[:, 1] == 5.5] == 2).all()


def test_first_zone_wins_within_the_tolerance(make_scene):
    a, b = [(0, 0), (10.04, 0), (10.04, 10), (0, 10)], [(10, 0), (20, 0), (20, 10), (10, 10)]
    assert len(fill(make_scene([a, b]))) == 200


def test_uneven_ground_holds_no_points(make_scene):
    ground = [(0.0, 0.0), (20.0, 10.0), (40.0, 0.0)]
    ring = [(0.0, 0.0), (20.0, 10.0), (40.0, 0.0), (40.0, 15.0), (0.0, 15.0)]
    scene = make_scene([ring], ground=ground)
    points = fill(scene)
    assert (points.position[:, 1] > scene.ground.height(points.position[:, 0])).all()
    assert len(points) == pytest.approx(area(ring), rel=0.02)


def test_jitter_stays_in_bounds_and_follows_the_seed(make_scene):
    polygon = [(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0)]
    plain = fill(make_scene([polygon]))
    first, again, other = (fill(make_scene([polygon], jitter=0.4, seed=seed)) for seed in (1, 1, 2))
    step = first.position - plain.position
    assert 0.19 < np.abs(step).max() <= 0.2
    assert abs(step.mean()) < 0.01
    np.testing.assert_array_equal(first.position, again.position)
    assert (first.position != other.position).any()
    assert (first.position[:, 1] > 0.0).all()
    np.testing.assert_array_equal(first.zone, plain.zone)


def test_materials_velocities_and_kinematic_points():
    scene = Scene.model_validate(
        {
            "name": "s",
            "domain": {"x_min": 0, "x_max": 40, "y_max": 40},
            "ground": {"points": [[0, 0]]},
            "zones": [
                {
                    "name": "flying",
                    "polygon": [[0, 5], [5, 5], [5, 10], [0, 10]],
                    "material": "second",
                    "initial_velocity": [3.0, -1.0],
                },
                {
                    "name": "fixed",
                    "polygon": [[10, 0], [15, 0], [15, 5], [10, 5]],
                    "material": "first",
                    "kinematic": True,
                },
            ],
            "materials": {
                "first": {"friction_deg": 30, "cohesion_kpa": 0},
                "second": {"friction_deg": 0, "cohesion_kpa": 5},
            },
            "spacing": 1.0,
        }
    )
    points = fill(scene)
    flying = points.zone == 0
    assert scene.material_names == ["first", "second"]
    np.testing.assert_array_equal(points.material, np.where(flying, 1, 0))
    np.testing.assert_array_equal(points.kinematic, ~flying)
    np.testing.assert_array_equal(points.velocity[flying], [[3.0, -1.0]] * 25)
    assert not points.velocity[~flying].any()
    assert points.material.dtype == points.zone.dtype == np.int32


def test_the_lattice_may_count_from_another_height(make_scene):
    scene = make_scene([[(3.0, 0.0), (13.0, 0.0), (13.0, 6.0), (3.0, 6.0)]], spacing=0.5)
    raised = scene.changed(lattice_from_y=0.2)
    np.testing.assert_allclose((fill(raised).position[:, 1] - 0.2) % 0.5, 0.25)
    assert fill(raised).position[:, 1].min() == pytest.approx(0.45), "and down to the base"
    assert scene.lattice_y == 0.0 and raised.lattice_y == 0.2
    assert "lattice_from_y" not in scene.model_dump(), "other scenes keep their hashes"
    assert scene_from_mapping(raised.model_dump(), "again") == raised


class Counted(np.ndarray):
    """Points that count the numbers in every operation on them."""

    numbers = 0

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        plain = [np.asarray(one) for one in inputs]
        Counted.numbers += max(one.size for one in plain)
        keywords.pop("out", None)
        found = getattr(ufunc, method)(*plain, **keywords)
        return found.view(Counted) if found.dtype == float and found.ndim else found


def test_many_edges_cost_little_more_than_few():
    """An outline may have as many vertices as there are points."""
    places = np.random.default_rng(1).uniform(0.0, 10.0, (4000, 2)).view(Counted)
    work = []
    for number in (100, 1600):
        angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False)
        circle = 5.0 + 4.0 * np.column_stack([np.cos(angle), np.sin(angle)])
        Counted.numbers = 0
        inside = contains(circle, places)
        assert np.count_nonzero(inside) == pytest.approx(4000 * np.pi * 16.0 / 100.0, rel=0.05)
        work.append(Counted.numbers)
    assert 1000 < work[1] < 1.5 * work[0]


@some
@given(
    corners=st.lists(
        st.tuples(st.floats(0, 12), st.floats(0, 9)), min_size=3, max_size=6, unique=True
    )
)
def test_squares_are_covered_as_geometry_says(corners):
    outline = Polygon(corners).convex_hull
    assume(outline.area > 0.1)
    hull = np.array(outline.exterior.coords)[:-1]
    share = covered_squares(hull)
    assert share.sum() == pytest.approx(outline.area, rel=1e-9)
    for column, row in ((0, 0), (3, 2), (5, 4), (8, 1)):
        expected = outline.intersection(box(column, row, column + 1, row + 1)).area
        found = share[column, row] if column < share.shape[0] and row < share.shape[1] else 0.0
        assert found == pytest.approx(expected, abs=1e-8)


def test_a_hollow_outline_covers_what_it_encloses():
    ring = [(1, 1), (6, 1), (6, 5), (4, 5), (4, 2.5), (3, 2.5), (3, 5), (1, 5)]
    share = covered_squares(np.array(ring, dtype=float))
    assert share.sum() == pytest.approx(Polygon(ring).area)
    assert share[3, 3] == 0.0 and share[3, 2] == pytest.approx(0.5) and share[1, 3] == 1.0


def test_soil_without_a_point_of_its_own_goes_to_its_neighbours(make_scene):
    """A wedge whose tip is thinner than half a spacing, and its mirror image."""
    wedge = [(0.0, 0.0), (20.0, 0.0), (0.0, 4.0)]
    points = fill(make_scene([wedge]))
    assert points.position[:, 0].max() < 18.0 and points.volume.sum() == pytest.approx(40.0)
    last = points.position[:, 0].argmax()
    tip = 0.5 * 0.2 * (20.0 - points.position[last, 0] - 0.5) ** 2
    assert points.volume[last] > tip
    mirrored = fill(make_scene([[(100.0 - x, y) for x, y in wedge]]))
    assert np.sort(mirrored.volume) == pytest.approx(np.sort(points.volume))


@pytest.mark.parametrize("spacing", [0.4, 0.7, 1.0, 1.3])
def test_a_thin_layer_keeps_its_volume_at_any_spacing(make_scene, spacing):
    below = [(0.0, 0.0), (30.0, 0.0), (30.0, 3.1), (0.0, 2.3)]
    seam = [(0.0, 2.3), (30.0, 3.1), (30.0, 4.7), (0.0, 3.9)]
    points = fill(make_scene([below, seam], spacing=spacing))
    for number, polygon in enumerate((below, seam)):
        held = points.volume[points.zone == number].sum()
        assert held == pytest.approx(Polygon(polygon).area, rel=1e-9)


def blanketed(make_scene, *, below: bool):
    """A berm that thins to a blanket of 0.2 m over 44 m, with soil below it or none."""
    blanket = [(-50.0, 0.0), (0.0, 0.0), (3.0, 2.0), (-4.0, 2.0), (-6.0, 0.2), (-50.0, 0.2)]
    loose = [(-50.0, -3.0), (80.0, -3.0), (80.0, 0.0), (-50.0, 0.0)]
    ground = [(-1000.0, -3.0 * below), (1000.0, -3.0 * below)]
    polygons = [loose, blanket] if below else [blanket]
    return fill(make_scene(polygons, spacing=0.5, ground=ground)), blanket


def test_a_thin_blanket_joins_the_soil_below_it_where_it_is(make_scene):
    points, blanket = blanketed(make_scene, below=True)
    assert points.volume.sum() == pytest.approx(390.0 + Polygon(blanket).area, rel=1e-9)
    assert points.volume.max() < 4.0 * 0.25
    there = points.position[:, 0] < -20.0
    assert points.volume[there].sum() == pytest.approx(30.0 * 3.2, rel=0.01)


def test_a_thin_blanket_on_bare_ground_is_left_out(make_scene):
    points, blanket = blanketed(make_scene, below=False)
    lost = Polygon(blanket).area - points.volume.sum()
    assert 7.0 < lost < 8.8 and points.volume.max() < 8.0 * 0.25
