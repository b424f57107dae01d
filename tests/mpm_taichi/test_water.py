"""Water that follows the soil: the head over a section, its thrust, and what it does to a run."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.water import (
    FACE_DEPTH,
    FACE_PLACES,
    WATER_DENSITY,
    MovingFace,
    head_places,
    level_and_fall,
    water_force,
)
from pipeline.config import load_config
from tests.budget import examples

CELL, GRAVITY = 1.0, 9.81
POOL, TAIL = 8.0, 0.0


def dam(**changes):
    """A dam 10 m high, its crest at 30 m, that keeps a pool of 8 m: a shell and a core."""
    return scene_from_mapping({
        "name": "dam",
        "domain": {"x_min": 0.0, "x_max": 60.0, "y_max": 20.0, "walls": "open"},
        "ground": {"points": [[0.0, 0.0], [60.0, 0.0]], "contact": "rough"},
        "zones": [
            {"name": "shell", "material": "sand", "polygon": [[10, 0], [30, 10], [30, 0]]},
            {"name": "core", "material": "clay", "polygon": [[30, 0], [30, 10], [50, 0]]},
        ],
        "materials": {
            "sand": {"friction_deg": 0.0, "cohesion_kpa": 4.0, "density": 1900.0,
                     "youngs_modulus_mpa": 10.0, "poisson_ratio": 0.3, "liquefied": True},
            "clay": {"friction_deg": 0.0, "cohesion_kpa": 60.0, "density": 1900.0,
                     "youngs_modulus_mpa": 10.0, "poisson_ratio": 0.3},
        },
        "water_level": POOL,
        "phreatic_line": [[0.0, POOL], [30.0, POOL], [40.0, TAIL], [60.0, TAIL]],
        "spacing": 0.5, "points_per_cell": 4,
        **changes,
    })  # fmt: skip


def mirrored(scene):
    """The scene with left and right exchanged."""

    def flip(line):
        return [(60.0 - x, y) for x, y in line][::-1]

    document = scene.model_dump()
    for zone in document["zones"]:
        zone["polygon"] = flip(zone["polygon"])
    document["phreatic_line"] = flip(document["phreatic_line"])
    return scene_from_mapping(document)


def points_of(scene):
    """Points as the solver would fill the dam."""
    from geometry.scenes.fill import fill

    return fill(scene).position


PLACES = head_places(np.arange(-5.0, 66.0, CELL), CELL)


def thrust_of(head):
    """Horizontal force of the water [N/m] on soil that fills the section up to 20 m."""
    y = np.arange(0.0, 20.0, CELL)[None] + 0.5 * CELL
    level, fall = level_and_fall(head, CELL)
    across, _ = water_force(level, fall, y, CELL, GRAVITY)
    return float(across.sum()) * CELL**2


def test_at_the_start_the_head_is_the_phreatic_line():
    scene = dam()
    position = points_of(scene)
    head = MovingFace.at_start(scene, position).head(PLACES, position)
    np.testing.assert_allclose(head, scene.phreatic_level(PLACES), atol=1e-9)


def test_a_shell_that_leaves_is_replaced_by_water():
    scene = dam()
    position = points_of(scene)
    face = MovingFace.at_start(scene, position)
    gone = position.copy()
    shell = position[:, 0] < 30.0
    gone[shell] = gone[shell] * [1.0, 0.2] - [15.0, 0.0]
    head = face.head(PLACES, gone)
    line = scene.phreatic_level(PLACES)
    # Where the core begins to lower the head at the face itself, the fall begins deeper in it.
    np.testing.assert_allclose(head, line, atol=0.2 * POOL)
    away = (PLACES < 30.0) | (PLACES > 30.0 + 0.5 * CELL * (FACE_DEPTH + FACE_PLACES))
    np.testing.assert_allclose(head[away], line[away], atol=1e-9)


def test_the_pool_presses_on_the_face_where_part_of_the_core_has_left_as_well():
    scene = dam()
    position = points_of(scene)
    face = MovingFace.at_start(scene, position)
    stays = position[:, 0] > 33.0
    moved = np.where(stays[:, None], position, position * [1.0, 0.2] - [20.0, 0.0])
    head = face.head(PLACES, moved)
    assert (head[PLACES < 32.5] == POOL).all(), "water fills what has left"
    np.testing.assert_allclose(
        head[PLACES > 36.0], scene.phreatic_level(PLACES[PLACES > 36.0]), atol=1e-9
    )
    assert (np.diff(head) <= 1e-12).all(), "water does not rise away from the pool"
    assert thrust_of(head) == pytest.approx(thrust_of(scene.phreatic_level(PLACES)), rel=0.02)


def test_thrust_is_half_of_the_square_of_the_depth():
    head = dam().phreatic_level(PLACES)
    assert thrust_of(head) == pytest.approx(0.5 * WATER_DENSITY * GRAVITY * POOL**2, rel=0.01)


def test_core_that_moves_keeps_its_head():
    scene = dam()
    position = points_of(scene)
    face = MovingFace.at_start(scene, position)
    head = face.head(PLACES, position - [2.0, 0.0])
    inside = (PLACES > 30.0) & (PLACES < 36.0)
    np.testing.assert_allclose(head[inside], scene.phreatic_level(PLACES[inside] + 2.0), atol=0.3)


def test_soil_that_is_overtopped_still_holds_back_water():
    scene = dam()
    position = points_of(scene)
    face = MovingFace.at_start(scene, position)
    sunk = position * [1.0, 0.7]
    head = face.head(PLACES, sunk)
    assert head[0] == POOL and head[-1] == TAIL
    assert np.argmax(head < POOL - 0.1) == pytest.approx(np.argmax(PLACES > 30.0), abs=6)


def test_left_and_right_are_alike():
    scene = dam()
    position = points_of(scene)
    moved = position * [1.0, 0.5] - [3.1, 0.0]
    other = mirrored(scene)
    flip = [-1.0, 1.0]
    theirs = MovingFace.at_start(other, position * flip + [60.0, 0.0])
    head = MovingFace.at_start(scene, position).head(PLACES, moved)
    mirror = theirs.head((60.0 - PLACES)[::-1], moved * flip + [60.0, 0.0])[::-1]
    np.testing.assert_allclose(mirror, head, atol=1e-9)


@settings(max_examples=examples(30), deadline=None)
@given(
    seed=st.integers(0, 2**31), stretch=st.floats(0.2, 3.0), sink=st.floats(0.05, 1.0),
    spread=st.floats(0.0, 5.0),
)  # fmt: skip
def test_the_head_stays_between_tail_and_pool_and_falls_away_from_it(seed, stretch, sink, spread):
    scene = dam()
    position = points_of(scene)
    noise = np.random.default_rng(seed).normal(0.0, spread, len(position))
    moved = np.stack(
        [30.0 + stretch * (position[:, 0] - 30.0) + noise, sink * position[:, 1]], axis=1
    )
    head = MovingFace.at_start(scene, position).head(PLACES, moved)
    assert (np.diff(head) <= 1e-12).all()
    assert head.max() <= POOL and head.min() >= TAIL - 1e-9


def run(scene, **chosen):
    """A run of 3 s with settings of the simulation."""
    options = {"duration_s": 3.0, "early_stop": False, **chosen}
    config = load_config(None, [])
    made = type(config.simulation).model_validate({**config.simulation.model_dump(), **options})
    (done,) = simulate([scene], made, threads=1)
    assert done.status == "finished", done.reason
    return done


def test_on_a_level_table_nothing_depends_on_the_form():
    scene = dam(phreatic_line=None)
    assert not MovingFace.at_start(scene, points_of(scene)).holds_back
    buoyant = run(scene, water="buoyant")
    for face in ("fixed", "moving"):
        other = run(scene, water="pore_pressure", water_face=face)
        assert other.positions.tobytes() == buoyant.positions.tobytes()


def test_frames_do_not_depend_on_how_many_are_computed_at_once():
    scene = dam(phreatic_line=[[0.0, -2.0], [60.0, -3.0]], water_level=-2.0)  # below the base
    fixed, moving = (
        run(scene, water="pore_pressure", water_face=face) for face in ("fixed", "moving")
    )
    assert len(moving.time) == len(fixed.time)
    assert moving.stress.tobytes() == fixed.stress.tobytes()
    # An open domain grows at other frames, and positions are stored from its grid's first node.
    np.testing.assert_allclose(moving.positions, fixed.positions, rtol=0, atol=1e-5)


def test_a_moving_face_changes_a_slide_and_closes_its_account():
    materials = dam().model_dump()["materials"]
    materials["clay"]["cohesion_kpa"] = 12.0
    weak = dam(materials=materials)
    fixed, moving = (
        run(weak, water="pore_pressure", water_face=face) for face in ("fixed", "moving")
    )
    assert np.abs(fixed.positions[-1] - moving.positions[-1]).max() > 0.1
    assert abs(moving.audit["numerical_share"]) < 0.05
