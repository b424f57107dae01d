"""Published relations of residual strength with blow count: what practice reads from a boring.

In: blow counts N1,60 and vertical effective stress. Out: strengths. For comparison with a
back-analysis, as its prior where a question asks for one, and for predictions without a fit.
Constants: read in public function references and in the input files of the published models of both
San Fernando dams (Montgomery 2025). `RELATIONS` lists them by the names that files use.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

#: One atmosphere [kPa].
ATMOSPHERE_KPA = 101.325
#: Largest blow counts of Olson and Stark's and of Kramer and Wang's data.
OLSON_STARK_LARGEST, KRAMER_WANG_LARGEST = 12.0, 15.0
#: Half the width of Olson and Stark's band, in strength ratio.
OLSON_STARK_BAND = 0.03
#: Largest strength ratio after Weber.
WEBER_LARGEST_RATIO = 0.29
#: Scatter of the logarithm of a strength where none is at hand: about that of Olson and Stark's
#: band at the blow counts of most flow slides (0.03 of 0.06 to 0.12). Assumed.
ASSUMED_LOG_STD = 0.4


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


def idriss_boulanger_2008(
    n1_60: np.ndarray | float, *, friction_deg: float = 33.0, redistribution: bool = True
) -> np.ndarray:
    """Strength ratio S_r/sigma'_v0 after Idriss and Boulanger (2008), EERI monograph MNO-12.

    exp(N/16 + ((N - 16)/21.2)^3 - 3), at most tan(phi'); N is the clean-sand equivalent blow count.
    Where pore water cannot redistribute, times 1 + exp(N/2.4 - 6.6).

    Args:
        n1_60: blow count (N1)60cs-Sr, any shape.
        friction_deg: friction angle phi' of the soil, of the upper limit [degrees].
        redistribution: voids may redistribute during and after shaking.

    Returns:
        S_r/sigma'_v0, in the shape of `n1_60`.
    """
    count = np.asarray(n1_60, dtype=float)
    ratio = np.exp(count / 16.0 + ((count - 16.0) / 21.2) ** 3 - 3.0)
    if not redistribution:
        ratio = ratio * (1.0 + np.exp(count / 2.4 - 6.6))
    return np.minimum(ratio, math.tan(math.radians(friction_deg)))


def kramer_wang_2015(n1_60: np.ndarray | float, sigma_v0_kpa: np.ndarray | float) -> np.ndarray:
    """Mean strength S_r [kPa] after Kramer and Wang (2015).

    exp(-8.444 + 0.109 N + 5.379 sigma'^0.1), strength and stress in atmospheres, N up to 15.

    Args:
        n1_60: blow count (N1)60, any shape.
        sigma_v0_kpa: vertical effective stress before failure [kPa], broadcast with `n1_60`.

    Returns:
        S_r [kPa].
    """
    stress = np.asarray(sigma_v0_kpa, dtype=float) / ATMOSPHERE_KPA
    exponent = -8.444 + 0.109 * np.asarray(n1_60, dtype=float) + 5.379 * stress**0.1
    return ATMOSPHERE_KPA * np.exp(exponent)


def weber_2015(n1_60: np.ndarray | float, sigma_v0_kpa: np.ndarray | float) -> np.ndarray:
    """Median strength S_r [kPa] after Weber (2015), at most 0.29 sigma'_v0.

    0.048 (exp(0.1407 N + 4.2399 s^0.12) - 0.43991 (N^1.45 + 0.2 N s^2.48 + 41.13)) with s the
    stress in atmospheres; 0.048 turns pounds per square foot into kPa.

    Args:
        n1_60: clean-sand equivalent blow count (N1)60cs, any shape.
        sigma_v0_kpa: vertical effective stress before failure [kPa], broadcast with `n1_60`.

    Returns:
        S_r [kPa].
    """
    count, stress = np.asarray(n1_60, dtype=float), np.asarray(sigma_v0_kpa, dtype=float)
    s = stress / ATMOSPHERE_KPA
    growth = np.exp(0.1407 * count + 4.2399 * s**0.12)
    strength = 0.048 * (growth - 0.43991 * (count**1.45 + 0.2 * count * s**2.48 + 41.13))
    return np.clip(strength, 0.0, WEBER_LARGEST_RATIO * stress)


RelationName = Literal[
    "olson_stark_2002",
    "idriss_boulanger_2008",
    "idriss_boulanger_2008_no_redistribution",
    "kramer_wang_2015",
    "weber_2015",
]


@dataclass(frozen=True)
class Relation:
    """A relation as files, tables and the figure use it.

    Attributes:
        name: in files.
        label: in words, with its source.
        ratio: (blow counts, sigma'_v0 [kPa]) -> S_r/sigma'_v0, at counts within its data.
        clean_sand: the blow count is the clean-sand equivalent N1,60cs.
        largest: blow count of its data; a greater one counts as this. None: its own limit of the
            strength ratio holds instead.
        band: half the width of its published scatter in strength ratio; None: none is at hand, and
            `ASSUMED_LOG_STD` is taken.
        by_stress: the ratio differs with the stress level.
    """

    name: RelationName
    label: str
    ratio: Callable[[np.ndarray | float, np.ndarray | float], np.ndarray]
    clean_sand: bool
    largest: float | None = None
    band: float | None = None
    by_stress: bool = False

    def strength(self, count: float, sigma_v0_kpa: float) -> float:
        """Median S_r [kPa] at a blow count and a vertical effective stress [kPa] above 0."""
        inside = count if self.largest is None else min(count, self.largest)
        return float(self.ratio(inside, sigma_v0_kpa) * sigma_v0_kpa)

    def log_std(self, count: float, sigma_v0_kpa: float) -> float:
        """Standard deviation of the logarithm of S_r."""
        if self.band is None:
            return ASSUMED_LOG_STD
        return self.band * sigma_v0_kpa / self.strength(count, sigma_v0_kpa)

    def beyond(self, count: float) -> bool:
        """The blow count lies beyond the data."""
        return self.largest is not None and count > self.largest

    @property
    def scatter_words(self) -> str:
        """Its scatter and where that comes from."""
        if self.band is None:
            return f"ln S_r ± {ASSUMED_LOG_STD:g}, assumed"
        return f"S_r/σ'_v0 ± {self.band:g}, published; read as one standard deviation"


RELATIONS: dict[str, Relation] = {
    one.name: one
    for one in (
        Relation(
            "olson_stark_2002",
            "Olson and Stark (2002)",
            lambda count, _: olson_stark_2002(count),
            clean_sand=False,
            largest=OLSON_STARK_LARGEST,
            band=OLSON_STARK_BAND,
        ),
        Relation(
            "idriss_boulanger_2008",
            "Idriss and Boulanger (2008), with redistribution",
            lambda count, _: idriss_boulanger_2008(count),
            clean_sand=True,
        ),
        Relation(
            "idriss_boulanger_2008_no_redistribution",
            "Idriss and Boulanger (2008), without redistribution",
            lambda count, _: idriss_boulanger_2008(count, redistribution=False),
            clean_sand=True,
        ),
        Relation(
            "kramer_wang_2015",
            "Kramer and Wang (2015)",
            lambda count, stress: kramer_wang_2015(count, stress) / stress,
            clean_sand=False,
            largest=KRAMER_WANG_LARGEST,
            by_stress=True,
        ),
        Relation(
            "weber_2015",
            "Weber (2015), median",
            lambda count, stress: weber_2015(count, stress) / stress,
            clean_sand=True,
            by_stress=True,
        ),
    )
}
