"""A block on a layer, against the balance of forces on a wedge by hand."""

from __future__ import annotations

import math

import pytest

from geometry.scenes.scene import Scene, scene_from_mapping
from inversion.classical.block import BEHIND, ENDS, VERTICALS, block_factor
from inversion.classical.section import section_of

GAMMA, HEIGHT, LENGTH = 18.0, 10.0, 60.0


def cliff(layer_kpa: float, fill_kpa: float, *, side: str = "left", friction: float = 0.0) -> Scene:
    """A fill with a steep face on a liquefied layer of half a metre; the ground goes on behind."""

    def outline(low: float, high: float) -> list[tuple[float, float]]:
        ring = [(0.0, low), (LENGTH, low), (LENGTH, high), (0.0, high)]
        return ring if side == "left" else [(-x, y) for x, y in ring]

    density = 1000.0 * GAMMA / 9.81
    return scene_from_mapping(
        {
            "name": "cliff",
            "domain": {"x_min": -90, "x_max": 90, "y_max": 20, "walls": "open",
                       "left": "free", "right": "free"},
            "ground": {"points": [[-90, 0], [90, 0]]},
            "zones": [
                {"name": "layer", "polygon": outline(0.0, 0.5), "material": "layer"},
                {"name": "fill", "polygon": outline(0.5, HEIGHT), "material": "fill"},
            ],
            "materials": {
                "layer": {"friction_deg": 0, "cohesion_kpa": layer_kpa, "density": density,
                          "liquefied": True},
                "fill": {"friction_deg": friction, "cohesion_kpa": fill_kpa, "density": density},
            },
            "spacing": 0.25,
        }
    )  # fmt: skip


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wedge_of_soil_without_friction(side):
    """c (L + H (1 + m2) / m) = F gamma H2 / 2 on a level base of length L and a ramp of slope m."""
    strength = 20.0
    length = LENGTH * (VERTICALS - 1) / (VERTICALS + 1) / (ENDS - 1)
    ramp = min(HEIGHT * (1.0 + m * m) / m for m in BEHIND)
    expected = strength * (length + ramp) / (0.5 * GAMMA * HEIGHT**2)
    found = block_factor(section_of(cliff(strength, strength, side=side)), side, "buoyant")
    assert found == pytest.approx(expected, rel=0.05)


def test_a_weak_layer_counts_where_a_circle_does_not_go():
    strong, weak = (
        block_factor(section_of(cliff(strength, 5.0, friction=35.0)), "left", "buoyant")
        for strength in (40.0, 4.0)
    )
    assert weak < 0.7 * strong


def test_without_liquefied_soil_there_is_no_block():
    scene = cliff(10.0, 10.0)
    document = scene.model_dump()
    document["materials"]["layer"]["liquefied"] = False
    assert math.isnan(block_factor(section_of(scene_from_mapping(document)), "left", "buoyant"))
