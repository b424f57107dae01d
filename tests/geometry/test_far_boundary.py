"""A section whose ground goes on: its ends, its toes, its points."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.measured import Deposit
from geometry.survey.measurements import Measurements, check_places
from pipeline.cli import InputError

SOIL = {"friction_deg": 30, "cohesion_kpa": 1}
FILL = [[0, 0], [12, 6], [24, 6], [36, 0]]
FOUNDATION = [[-25.3, -4], [66, -4], [66, 0], [36, 0], [0, 0], [-25.3, 0]]


def road(foundation=FOUNDATION, spacing=0.5, **domain):
    """A fill on a layer that goes on to both sides."""
    return scene_from_mapping(
        {
            "name": "road",
            "domain": {"x_min": -60, "x_max": 100, "y_max": 10, "walls": "open", **domain},
            "ground": {"points": [[-60, -4], [100, -4]]},
            "zones": [
                {"name": "fill", "polygon": FILL, "material": "fill"},
                {"name": "foundation", "polygon": foundation, "material": "sand"},
            ],
            "materials": {"fill": SOIL, "sand": {"friction_deg": 0, "cohesion_kpa": 8}},
            "spacing": spacing,
        }
    )


def toe(side="left", value=5.0, kind="toe_runout"):
    entry = {"name": "toe", "type": kind, "side": side, "confidence": "assumed", "source": "-"}
    size = {"limit_m": value} if kind == "no_flow" else {"value_m": value}
    return Measurements.model_validate(
        {
            "case": "road",
            "upstream": "right",
            "initial": {},
            "default_set": "field",
            "sets": {"field": [{**entry, **size, "std_m": 0.5}]},
        }
    )


def test_a_face_is_taken_for_ground_that_goes_on_unless_somebody_says_it_ends():
    assert [road().domain.goes_on(side) for side in ("left", "right")] == [True, True]
    told = road(left="free")
    assert not told.domain.goes_on("left") and told.domain.is_open("left")
    assert told.domain.goes_on("right") and not told.domain.is_open("right")
    assert not road(walls="closed").domain.goes_on("left"), "closed walls are as they are drawn"
    assert road(walls="closed", left="far").domain.x_min == -25.3


def test_a_foot_is_no_face():
    gentle = [[-25, -4], [66, -4], [66, 0], [36, 0], [0, 0], [-5, 0]]  # 1 : 5
    assert not road(gentle).domain.goes_on("left")


def test_a_scene_keeps_its_ends_when_it_is_written_and_read():
    once = road()
    again = scene_from_mapping(once.model_dump(mode="json"))
    assert again == once and again.domain.left == "far"
    assert "left" not in road(walls="closed").model_dump()["domain"]


@pytest.mark.parametrize("ends", [{}, {"left": "free"}, {"right": "free"}])
@pytest.mark.parametrize("spacing", [0.5, 1.0])
def test_points_reach_the_wall(ends, spacing):
    """Whatever the spacing, no gap of soil is left at a far boundary, and walls lie on cells."""
    scene = road(spacing=spacing, **ends)
    x = fill(scene).position[:, 0]
    for side, first in (("left", x.min()), ("right", x.max())):
        if scene.domain.goes_on(side):
            wall = scene.domain.wall(side)
            assert abs(wall - first) == pytest.approx(0.5 * spacing)
            assert abs(wall - scene.end(side)) < scene.cell_size
    cells = scene.domain.width / scene.cell_size
    assert cells == pytest.approx(round(cells))


def test_the_toe_is_that_of_the_fill():
    scene = road()
    assert scene.front_zones("left") == [0] == scene.front_zones("right")
    assert (scene.foot("left"), scene.end("left")) == (0.0, -25.3)
    points = fill(scene)
    moved = points.position.copy()
    moved[points.zone == 0, 0] -= 3.0
    (entry,) = toe().chosen()
    at_start, after = (
        Deposit.on(scene, {"left": 0.0, "right": 36.0}, now, points.position, points.volume)
        for now in (points.position, moved)
    )
    assert entry.observe(after) - entry.observe(at_start) == pytest.approx([3.0])
    assert entry.by_eye(after) - entry.by_eye(at_start) == pytest.approx(3.0)
    seen = entry.observe_with_derivative(after)
    outside = points.zone == 1
    assert seen.change[0, 0].shape == points.position.shape and not seen.change[0, 0][outside].any()
    # All of the front moved outward by 1 m: the toe moves by 1 m.
    assert seen.change[0, 0][:, 0].sum() == pytest.approx(-1.0)
    (stood,) = toe(value=1.0, kind="no_flow").chosen()
    assert stood.observe(after) == pytest.approx([3.0])


def test_a_side_without_a_toe_has_no_runout():
    cut = scene_from_mapping(
        {**road().model_dump(), "zones": [{"name": "a", "polygon": FOUNDATION, "material": "sand"}],
         "materials": {"sand": SOIL}}
    )  # fmt: skip
    with pytest.raises(InputError, match="the ground goes on to the left, and so does every zone"):
        check_places(toe(), cut, "m.yaml")
    with pytest.raises(InputError, match="beyond the end of the drawn ground at x = -25.3 m"):
        check_places(toe(value=30.0), road(), "m.yaml")
    check_places(toe(value=20.0), road(), "m.yaml")


def test_a_dam_that_is_buried_on_one_side_has_no_toe_there():
    scene = scene_from_mapping(
        {
            **road().model_dump(),
            "domain": {"x_min": -60, "x_max": 100, "y_max": 10, "walls": "open"},
            "zones": [
                {"name": "shell", "polygon": [[0, -4], [20, 6], [30, 6], [10, -4]],
                 "material": "fill"},
                {"name": "tailings", "polygon": [[10, -4], [30, 6], [80, 5.5], [80, -4]],
                 "material": "sand"},
            ],
        }
    )  # fmt: skip
    assert scene.front_zones("right") == [] and scene.foot("right") == 80.0
    assert scene.front_zones("left") == [0, 1]
    assert np.isclose(scene.surface(55.0), 5.75)


def test_a_wall_on_ground_that_goes_on_has_its_toe_at_its_foot():
    quay = road().model_dump()
    caisson = [[0, 0], [9, 0], [9, 6], [0, 6]]
    behind = [[9, 0], [66, 0], [66, 6], [9, 6]]
    layer = [[-25.3, -4], [66, -4], [66, 0], [9, 0], [0, 0], [-25.3, 0]]
    quay["zones"] = [
        {"name": name, "polygon": polygon, "material": soil}
        for name, polygon, soil in (
            ("caisson", caisson, "fill"), ("behind", behind, "fill"), ("layer", layer, "sand"),
        )
    ]  # fmt: skip
    scene = scene_from_mapping(quay)
    assert [scene.zones[k].name for k in scene.front_zones("left")] == ["caisson", "behind"]
    assert scene.foot("left") == 0.0 and scene.front_zones("right") == []
