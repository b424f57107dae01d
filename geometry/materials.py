"""Soil 1, Soil 2 and Soil 3: the ranges from which strengths are drawn (paper, Table 1).

Soil 1 is frictional, Soil 2 has friction and cohesion, Soil 3 has cohesion alone: it stands for
liquefied soil with its S_r, and for soft clay. `paper` are the ranges as printed. `wide` goes on to
lower strengths: the paper's answer for its first dam, 18.9 kPa, lies below its large-scale range;
the shells of its case histories (c = 0-1 kPa with friction) fit none of its soils.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from geometry.random_numbers import Stream
from geometry.scene import Material

Soil = Literal[1, 2, 3]

DENSITY = 1800.0
YOUNGS_MODULUS_MPA = 30.0
POISSON_RATIO = 0.3


@dataclass(frozen=True)
class StrengthRange:
    """Uniform ranges of one soil."""

    friction_deg: tuple[float, float]
    cohesion_kpa: tuple[float, float]


_FRICTION = (20.0, 47.0)
_NONE = (0.0, 0.0)

#: (option, column of Table 1) -> soil -> range.
RANGES: dict[tuple[str, str], dict[int, StrengthRange]] = {
    ("paper", "large"): {
        1: StrengthRange(_FRICTION, _NONE),
        2: StrengthRange(_FRICTION, (20.0, 50.0)),
        3: StrengthRange(_NONE, (20.0, 50.0)),
    },
    ("paper", "small"): {
        1: StrengthRange(_FRICTION, _NONE),
        2: StrengthRange(_FRICTION, (1.0, 40.0)),
        3: StrengthRange(_NONE, (1.0, 40.0)),
    },
    ("wide", "large"): {
        1: StrengthRange(_FRICTION, (0.0, 5.0)),
        2: StrengthRange(_FRICTION, (1.0, 60.0)),
        3: StrengthRange(_NONE, (1.0, 60.0)),
    },
    ("wide", "small"): {
        1: StrengthRange(_FRICTION, (0.0, 5.0)),
        2: StrengthRange(_FRICTION, (1.0, 40.0)),
        3: StrengthRange(_NONE, (1.0, 40.0)),
    },
}


def draw_material(stream: Stream, soil: Soil, *, option: str, column: str) -> Material:
    """Draw one material.

    Args:
        stream: two numbers are taken from it, whatever the soil.
        soil: 1, 2 or 3.
        option: "paper" or "wide".
        column: "large" or "small".
    """
    strength = RANGES[option, column][soil]
    return Material(
        friction_deg=round(stream.uniform(*strength.friction_deg), 3),
        cohesion_kpa=round(stream.uniform(*strength.cohesion_kpa), 3),
        density=DENSITY,
        youngs_modulus_mpa=YOUNGS_MODULUS_MPA,
        poisson_ratio=POISSON_RATIO,
        liquefied=soil == 3,
    )
