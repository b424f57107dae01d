"""Soil 1, Soil 2 and Soil 3: the ranges from which strengths are drawn (paper, Table 1).

Soil 1 is frictional, Soil 2 has friction and cohesion, Soil 3 has cohesion alone: it stands for
liquefied soil with its S_r, and for soft clay. `paper` are the ranges as printed. `wide` goes on to
lower strengths: the paper's answer for its first dam, 18.9 kPa, lies below its large-scale range;
the shells of its case histories (c = 0-1 kPa with friction) fit none of its soils.

The column `any` is for a learned simulator that is to serve every spacing d: cohesions are in units
of rho g d, evenly spread over their logarithm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from geometry.scenes.scene import Material
from pipeline.random_numbers import Stream

Soil = Literal[1, 2, 3]
SOILS: tuple[Soil, ...] = (1, 2, 3)

DENSITY = 1800.0
YOUNGS_MODULUS_MPA = 30.0
POISSON_RATIO = 0.3
GRAVITY = 9.81
"""In the unit of cohesion of the column `any` [m/s2]."""


@dataclass(frozen=True)
class StrengthRange:
    """Uniform ranges of one soil."""

    friction_deg: tuple[float, float]
    cohesion_kpa: tuple[float, float]


_FRICTION = (20.0, 47.0)
_NONE = (0.0, 0.0)
ANY_COHESION = (0.1, 7.0)
"""Of Soil 2 and 3 in the column `any`, in rho g d: from 1 % of the stress under 10 spacings of soil
to what stands 45 spacings high."""
ANY_FRICTION_COHESION = (0.0, 0.14)
"""Of Soil 1 there: 0 to 5 kPa at a spacing of 2 m, as in `wide`."""

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


def draw_material(
    stream: Stream, soil: Soil, *, option: str, column: str, spacing: float
) -> Material:
    """Draw one material.

    Args:
        stream: two numbers are taken from it, whatever the soil.
        soil: 1, 2 or 3.
        option: "paper" or "wide"; the column "any" has no options.
        column: "large", "small" or "any".
        spacing: between material points [m]; the unit of the column "any".
    """
    if column == "any":
        friction, cohesion = _draw_any(stream, soil, DENSITY * GRAVITY * spacing / 1000.0)
    else:
        strength = RANGES[option, column][soil]
        friction = stream.uniform(*strength.friction_deg)
        cohesion = stream.uniform(*strength.cohesion_kpa)
    return Material(
        friction_deg=round(friction, 3),
        cohesion_kpa=round(cohesion, 3),
        density=DENSITY,
        youngs_modulus_mpa=YOUNGS_MODULUS_MPA,
        poisson_ratio=POISSON_RATIO,
        liquefied=soil == 3,
    )


def _draw_any(stream: Stream, soil: Soil, unit_kpa: float) -> tuple[float, float]:
    """Friction angle [deg] and cohesion [kPa] of the column `any`."""
    friction, share = stream.uniform(*_FRICTION), stream.unit()
    if soil == 1:
        low, high = ANY_FRICTION_COHESION
        return friction, unit_kpa * (low + (high - low) * share)
    low, high = map(math.log, ANY_COHESION)
    cohesion = unit_kpa * math.exp(low + (high - low) * share)
    return (friction if soil == 2 else 0.0), cohesion
