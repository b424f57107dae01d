"""A residual strength that is known: a mean and a standard deviation, or draws.

`18+-5` or `18±5` is 18 kPa with a standard deviation of 5; `1,6=4+-1` is the strength that
zones 1 and 6 share. Everything random is drawn as standard normal scores z; a strength is a rising
function of its z. Lognormal: mean and standard deviation are those of the strength itself. Normal:
cut at a tenth of the mean, since a strength is positive.

A strength may also be known as the draws of a posterior. Several of one posterior keep what ties
them: their draws are sampled together. Their normal scores are those of their ranks.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import Terrain
from inversion.estimation.unknowns import Parameters
from inversion.posterior.document import load_posterior
from inversion.posterior.draws import key, load_draws
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO, ParameterSpec
from pipeline.cli import InputError

Kind = Literal["lognormal", "normal", "posterior"]
#: Of strengths that are given as text.
KINDS: tuple[Kind, ...] = ("lognormal", "normal")

OPTION = "--residual-strength"
_NUMBER = r"[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?"
_FORM = re.compile(rf"(?:([^=]*)=)?\s*({_NUMBER})\s*(?:\+-|\+/-|±)\s*({_NUMBER})\s*")
#: A normal distribution is cut below this share of the mean.
LEAST_SHARE = 0.1


@dataclass(frozen=True)
class KnownStrength:
    """One strength.

    Attributes:
        zones: names of the zones that share it; empty: not said yet.
        mean_kpa: mean.
        std_kpa: standard deviation.
        kind: of the distribution; posterior: `inversion.prediction.known_strength`.
    """

    zones: tuple[str, ...]
    mean_kpa: float
    std_kpa: float
    kind: Kind

    def at(self, score: np.ndarray | float) -> np.ndarray:
        """Strength [kPa] of standard normal scores, any shape."""
        score = np.asarray(score, dtype=float)
        if self.kind == "lognormal":
            variance = np.log1p((self.std_kpa / self.mean_kpa) ** 2)
            return self.mean_kpa * np.exp(np.sqrt(variance) * score - 0.5 * variance)
        cut = ndtr((LEAST_SHARE - 1.0) * self.mean_kpa / self.std_kpa)
        return self.mean_kpa + self.std_kpa * ndtri(cut + (1.0 - cut) * ndtr(score))

    @property
    def words(self) -> str:
        """For tables: zones, mean and standard deviation."""
        zones = f"zone{'s'[: len(self.zones) > 1]} {', '.join(self.zones)}"
        return f"{self.mean_kpa:.4g} ± {self.std_kpa:.4g} kPa in {zones} ({self.kind})"


def parse_strength(text: str, kind: Kind) -> KnownStrength:
    """Read one value of `--residual-strength`.

    Raises:
        InputError: not of the form, or not positive.
    """
    match = _FORM.fullmatch(text.strip())
    if match is None:
        raise InputError(
            f"{OPTION} {text!r}: must be MEAN+-STD in kPa, such as 18+-5, or ZONES=MEAN+-STD, "
            "such as 1,6=4+-1; a decimal point, no comma"
        )
    zones = None if match[1] is None else [name.strip() for name in match[1].split(",")]
    if zones is not None and not all(zones):
        raise InputError(f"{OPTION} {text!r}: a zone before `=` has no name")
    mean, std = float(match[2]), float(match[3])
    if not (0.0 < std < np.inf and 0.0 < mean < np.inf):
        raise InputError(f"{OPTION} {text!r}: mean and standard deviation must be greater than 0")
    if std > mean:
        raise InputError(
            f"{OPTION} {text!r}: a standard deviation of {std:g} kPa exceeds the mean; at most "
            f"{mean:g}"
        )
    return KnownStrength(tuple(zones or ()), mean, std, kind)


def placed(
    strengths: Sequence[KnownStrength], zones: Sequence[str], scene: Scene | Terrain
) -> list[KnownStrength]:
    """Give a strength without zones its zones, and check all of them against the scene.

    Args:
        strengths: as read; one without zones must be the only one.
        zones: for the one without.
        scene: with these zones.

    Raises:
        InputError: no zones, an unknown zone, a zone named twice, or a zone with friction.
    """
    if any(not strength.zones for strength in strengths) and len(strengths) > 1:
        raise InputError(f"{OPTION}: of several, each must name its zones, such as 1=4+-1")
    known = [zone.name for zone in scene.zones]
    found: list[KnownStrength] = []
    taken: list[str] = []
    for strength in strengths:
        own = strength.zones or tuple(zones)
        if not own:
            raise InputError(
                f"--zones: no zone of the scene is liquefied; name those of {OPTION}: "
                f"{', '.join(known)}"
            )
        for name in own:
            _check_zone(name, scene, taken)
            taken.append(name)
        found.append(replace(strength, zones=own))
    return found


def _check_zone(name: str, scene: Scene | Terrain, taken: Sequence[str]) -> None:
    soils = {zone.name: scene.materials[zone.material] for zone in scene.zones}
    if name not in soils:
        raise InputError(f"zone {name!r} is not in the scene; known are {', '.join(soils)}")
    if name in taken:
        raise InputError(f"zone {name!r} is given two strengths")
    if soils[name].friction_deg > 0:
        raise InputError(
            f"zone {name!r}: its material has friction_deg {soils[name].friction_deg:g}; a "
            "residual strength belongs to a zone with friction_deg 0"
        )


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


def widened(strength: KnownStrength, log_std: float) -> KnownStrength:
    """A strength whose logarithm may be off by more; draws of a posterior have that in them."""
    if isinstance(strength, DrawnStrength):
        return strength
    more = strength.mean_kpa * log_std
    return replace(strength, std_kpa=float(np.hypot(strength.std_kpa, more)))


def drawn_strengths(path: str | Path) -> list[DrawnStrength]:
    """The residual strengths of a posterior, with their zones.

    Args:
        path: folder of `posterior.json` and `posterior.nc`, or one of the two files.

    Raises:
        InputError: no posterior, or none of a residual strength.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    draws, document = load_draws(folder), load_posterior(folder)
    found = []
    ratios = [one.name for one in document.parameters if one.property == STRENGTH_RATIO]
    if ratios:
        raise InputError(
            f"{folder}: {ratios[0]} is a {STRENGTH_RATIO}; a prediction takes residual strengths "
            f"in kPa: state them with {OPTION}, or infer {RESIDUAL_STRENGTH}"
        )
    for one in document.parameters:
        if one.property != RESIDUAL_STRENGTH:
            continue
        values = draws.posterior[:, draws.unknowns.index(key(one.name))]
        found.append(
            DrawnStrength(
                tuple(one.zones),
                float(values.mean()),
                float(values.std()),
                "posterior",
                tuple(map(float, values)),
            )
        )
    if not found:
        raise InputError(f"{folder}: a posterior without a residual strength")
    return found


def sampled_scores(
    strengths: Sequence[KnownStrength], samples: int, random: np.random.Generator
) -> np.ndarray:
    """Standard normal scores (samples, p): of draws together, of anything else independent."""
    drawn = [strength for strength in strengths if isinstance(strength, DrawnStrength)]
    if len(drawn) < len(strengths):
        return random.standard_normal((samples, len(strengths)))
    together = np.stack([strength.scores for strength in drawn], axis=1)
    return together[random.integers(len(together), size=samples)]


def strength_parameters(strengths: Sequence[KnownStrength]) -> Parameters:
    """Known strengths as the parameters of a reading of the question, in their order."""
    return Parameters(
        [
            ParameterSpec(
                name=f"residual_strength_{place}",
                zones=list(one.zones),
                property=RESIDUAL_STRENGTH,
                start=one.mean_kpa,
                low=1e-6 * one.mean_kpa,
                high=1e6 * one.mean_kpa,
            )
            for place, one in enumerate(strengths, start=1)
        ]
    )
