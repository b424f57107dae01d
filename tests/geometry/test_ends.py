"""A slide that reaches ground that goes on beyond the drawing: said, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.ends import MOVED, ends_reached


def dam_on_a_layer(**ends: str) -> Scene:
    """A dam on a weak layer that is drawn from -20 to 40 m."""
    return scene_from_mapping(
        {
            "name": "dam",
            "domain": {"x_min": -20.0, "x_max": 40.0, "y_max": 12.0, "walls": "open", **ends},
            "ground": {"points": [[-100, 0], [100, 0]]},
            "zones": [
                {"name": "layer", "material": "w",
                 "polygon": [[-20, 0], [40, 0], [40, 2], [-20, 2]]},
                {"name": "dam", "material": "w",
                 "polygon": [[0, 2], [20, 2], [12, 8], [8, 8]]},
            ],
            "materials": {"w": {"friction_deg": 0, "cohesion_kpa": 4, "liquefied": True}},
            "spacing": 0.5,
        }
    )  # fmt: skip


def pushed(before: np.ndarray, by: float, *, beyond: float) -> np.ndarray:
    """Soil to the right of `beyond` lifted."""
    return before + np.where(before[:, :1] > beyond, [0.0, by], 0.0)


BEFORE = np.stack([np.arange(-19.75, 40.0, 0.5), np.full(120, 0.25)], axis=1)


def test_a_wave_that_piles_up_at_the_end_of_the_drawing_is_said():
    (line,) = ends_reached(dam_on_a_layer(), BEFORE, pushed(BEFORE, 2.0, beyond=30.0))
    assert "right end of the section (x = 40 m)" in line and "moves by 2.0 m" in line


@pytest.mark.parametrize(
    "by, beyond, ends",
    [
        (0.9 * MOVED * 0.5, 30.0, {}),  # it settles
        (2.0, 60.0, {}),  # nothing moved
        (2.0, 30.0, {"right": "free"}),  # it runs out there, in a domain that grows
    ],
)
def test_an_end_that_is_not_reached_is_not(by, beyond, ends):
    assert ends_reached(dam_on_a_layer(**ends), BEFORE, pushed(BEFORE, by, beyond=beyond)) == ()


def test_a_slide_that_stops_before_the_end_does_not_reach_it():
    after = BEFORE + np.where((BEFORE[:, :1] > 10.0) & (BEFORE[:, :1] < 37.0), [0.0, 2.0], 0.0)
    assert ends_reached(dam_on_a_layer(), BEFORE, after) == ()
