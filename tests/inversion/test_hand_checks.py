"""What a hand calculation says of an answer, against closed forms."""

from __future__ import annotations

import re

import pytest

from geometry.scenes.scene import scene_from_mapping
from inversion.back_analysis.hand_checks import FLOW_SLIDES, ratio_check, stability_check
from inversion.back_analysis.result import ParameterAnswer

GAMMA = 18.0
"""Unit weight [kN/m3]."""


def slope(strength_kpa: float, *, side: str = "left", height: float = 10.0):
    """A slope of 45 degrees on a base at its toe; the ground goes on behind it."""
    outline = [[0, 0], [height, height], [6 * height, height], [6 * height, 0]]
    if side == "right":
        outline = [[-x, y] for x, y in outline]
    return scene_from_mapping(
        {
            "name": "slope",
            "domain": {"x_min": -80, "x_max": 80, "y_max": 2 * height, "walls": "open"},
            "ground": {"points": [[-80, 0], [80, 0]]},
            "zones": [{"name": "soil", "polygon": outline, "material": "soil"}],
            "materials": {"soil": {"friction_deg": 0, "cohesion_kpa": strength_kpa,
                                   "density": 1000 * GAMMA / 9.81, "liquefied": True}},
            "spacing": 0.5,
        }
    )  # fmt: skip


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_factor_of_safety_is_taylors(side):
    """Taylor (1937): c / (gamma H FS) = 0.164 at 45 degrees with a firm base at the toe."""
    found = stability_check(slope(25.0, side=side), side, "buoyant")
    assert found.value == pytest.approx(25.0 / (0.164 * GAMMA * 10.0), rel=0.04)
    assert found.agrees and found.words.endswith("it slides")


def test_a_strength_with_which_the_section_stands_is_doubted():
    found = stability_check(slope(40.0), "left", "buoyant")
    assert not found.agrees and found.words.endswith("it would have stood")


@pytest.mark.parametrize(
    ("ratio", "std", "agrees", "words"),
    [
        (0.09, 0.01, True, "0.090 is within the 0.05 to 0.12"),
        (0.13, 0.02, True, "0.130 is above the 0.05 to 0.12 of published flow slides .*, within"),
        (0.19, 0.02, False, "0.190 is above"),
        (0.014, 0.001, False, "0.014 is below"),
    ],
)
def test_ratios_are_held_against_published_ones(ratio, std, agrees, words):
    parameter = ParameterAnswer.model_construct(
        name="a", label="S_r of a", ratio=ratio, ratio_std=std
    )
    found = ratio_check(parameter)
    assert found.agrees is agrees and (found.low, found.high) == FLOW_SLIDES
    assert re.search(words, found.words)


def test_what_has_no_ratio_is_not_checked():
    parameter = ParameterAnswer.model_construct(name="phi", label="phi", ratio=None, ratio_std=None)
    assert ratio_check(parameter) is None
