"""Published correlations of residual strength with blow count: what practice reads from a boring.

In: blow counts (N1)60 and vertical effective stress. Out: strengths or strength ratios. For
comparison with a back-analysis, never an input of one. Each function says where it comes from and
how far it may be trusted; `CORRELATIONS` lists them for the figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

#: One atmosphere [kPa].
ATMOSPHERE_KPA = 101.325
#: Largest blow count of Olson and Stark's data.
OLSON_STARK_LARGEST = 12.0
#: Half the width of Olson and Stark's band, in strength ratio.
OLSON_STARK_BAND = 0.03


def olson_stark_2002(n1_60: np.ndarray | float) -> np.ndarray:
    """Strength ratio S_r/sigma'_v0 after Olson and Stark (2002), +-0.03.

    Canadian Geotechnical Journal 39: 0.03 + 0.0075 (N1)60, for (N1)60 up to 12.

    Args:
        n1_60: blow count (N1)60, any shape.

    Returns:
        S_r/sigma'_v0, in the shape of `n1_60`; NaN beyond 12, where there are no data.
    """
    count = np.asarray(n1_60, dtype=float)
    inside = (count >= 0.0) & (count <= OLSON_STARK_LARGEST)
    return np.where(inside, 0.03 + 0.0075 * count, np.nan)


def idriss_boulanger(n1_60: np.ndarray | float, *, friction_deg: float = 33.0) -> np.ndarray:
    """Strength ratio S_r/sigma'_v0 after Idriss and Boulanger, where pore water can redistribute.

    exp(N/16 + ((N - 16)/21.2)^3 - 3), at most tan(phi'); N is the clean-sand equivalent blow count.

    Args:
        n1_60: blow count (N1)60cs-Sr, any shape.
        friction_deg: friction angle phi' of the soil, of the upper limit [degrees].

    Returns:
        S_r/sigma'_v0, in the shape of `n1_60`.
    """
    count = np.asarray(n1_60, dtype=float)
    ratio = np.exp(count / 16.0 + ((count - 16.0) / 21.2) ** 3 - 3.0)
    return np.minimum(ratio, math.tan(math.radians(friction_deg)))


def kramer_wang_2015(n1_60: np.ndarray | float, sigma_v0_kpa: np.ndarray | float) -> np.ndarray:
    """Mean strength S_r [kPa] after Kramer and Wang (2015); constants recalled, unverified.

    exp(-8.444 + 0.109 N + 5.379 sigma'^0.1), strength and stress in atmospheres.

    Args:
        n1_60: blow count (N1)60, any shape.
        sigma_v0_kpa: vertical effective stress before failure [kPa], broadcast with `n1_60`.

    Returns:
        S_r [kPa].
    """
    stress = np.asarray(sigma_v0_kpa, dtype=float) / ATMOSPHERE_KPA
    exponent = -8.444 + 0.109 * np.asarray(n1_60, dtype=float) + 5.379 * stress**0.1
    return ATMOSPHERE_KPA * np.exp(exponent)


@dataclass(frozen=True)
class Correlation:
    """A correlation as it is drawn.

    Attributes:
        label: in words, with its source.
        ratio: (blow counts, sigma'_v0 [kPa]) -> S_r/sigma'_v0.
        band: half the width of its scatter in strength ratio; None: none is stated.
        by_stress: differs with the stress level, so it is drawn for several.
        confidence: how far the constants may be trusted.
    """

    label: str
    ratio: Callable[[np.ndarray, float], np.ndarray]
    band: float | None
    by_stress: bool
    confidence: Literal["published", "recalled"]


CORRELATIONS = (
    Correlation(
        "Olson and Stark (2002), ±0.03",
        lambda count, _: olson_stark_2002(count),
        OLSON_STARK_BAND,
        False,
        "published",
    ),
    Correlation(
        "Idriss and Boulanger, with redistribution of pore water",
        lambda count, _: idriss_boulanger(count),
        None,
        False,
        "published",
    ),
    Correlation(
        "Kramer and Wang (2015)",
        lambda count, stress: kramer_wang_2015(count, stress) / stress,
        None,
        True,
        "recalled",
    ),
)
