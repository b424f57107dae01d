"""A residual strength that is known as the draws of a posterior.

Several strengths of one posterior keep what ties them: their draws are sampled together. Their
normal scores, by which everything random is drawn here, are those of their ranks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtr, ndtri

from inversion.posterior.document import load_posterior
from inversion.posterior.draws import key, load_draws
from inversion.prediction.known_strength import KnownStrength
from inversion.problem.question import RESIDUAL_STRENGTH
from pipeline.cli import InputError


@dataclass(frozen=True)
class DrawnStrength(KnownStrength):
    """One strength; `draws` are s values [kPa] of equal weight."""

    draws: tuple[float, ...] = ()

    def at(self, score: np.ndarray | float) -> np.ndarray:
        """Strength [kPa] of standard normal scores, any shape: the quantile of the draws."""
        places = (np.arange(len(self.draws)) + 0.5) / len(self.draws)
        return np.interp(ndtr(np.asarray(score, dtype=float)), places, np.sort(self.draws))

    @property
    def scores(self) -> np.ndarray:
        """Normal scores of the draws, (s,)."""
        ranks = np.argsort(np.argsort(self.draws, kind="stable"), kind="stable")
        return ndtri((ranks + 0.5) / len(self.draws))


def drawn_strengths(path: str | Path) -> list[DrawnStrength]:
    """The residual strengths of a posterior, with their zones.

    Args:
        path: folder of `posterior.json` and `posterior.nc`, or one of the two files.

    Raises:
        InputError: no posterior, or none of a residual strength.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    document, draws = load_posterior(folder), load_draws(folder)
    found = []
    for one in document.parameters:
        if one.property != RESIDUAL_STRENGTH:
            continue
        values = draws.posterior[:, draws.unknowns.index(key(one.name))]
        found.append(
            DrawnStrength(
                tuple(one.zones), float(values.mean()), float(values.std()), "posterior",
                tuple(map(float, values)),
            )
        )  # fmt: skip
    if not found:
        raise InputError(f"{folder}: a posterior without a residual strength")
    return found


def sampled_scores(
    strengths: Sequence[KnownStrength], samples: int, random: np.random.Generator
) -> np.ndarray:
    """Standard normal scores (samples, p): of draws together, of anything else independent."""
    if not all(isinstance(strength, DrawnStrength) for strength in strengths):
        return random.standard_normal((samples, len(strengths)))
    together = np.stack([strength.scores for strength in strengths], axis=1)
    return together[random.integers(len(together), size=samples)]
