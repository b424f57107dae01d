"""A residual strength or a strength ratio that is known: mean and standard deviation, or draws.

`18+-5` or `18±5` is 18 kPa with a standard deviation of 5; `1,6=4+-1` is the strength that
zones 1 and 6 share. A ratio S_r / sigma'_v0 is written alike, `0.12+-0.03`. Everything random is
drawn as standard normal scores z; a strength is a rising function of its z. Lognormal: mean and
standard deviation are those of the strength itself. Normal: cut at a tenth of the mean, since a
strength is positive.

A strength may also be known as the draws of a posterior. Several of one posterior keep what ties
them: their draws are sampled together. Their normal scores are those of their ranks.
"""

from __future__ import annotations

import builtins
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from geometry.scenes.scene import MOST_STRENGTH_RATIO, Scene
from geometry.scenes3d.scene3d import Terrain
from inversion.estimation.unknowns import Parameters
from inversion.joint.document import load_joint
from inversion.posterior.document import load_posterior
from inversion.posterior.draws import key, load_draws
from inversion.prediction.response import FARTHEST
from inversion.problem.question import (
    RESIDUAL_STRENGTH,
    STRENGTH_RATIO,
    SYMBOLS,
    UNITS,
    ParameterSpec,
)
from pipeline.cli import InputError

Kind = Literal["lognormal", "normal", "posterior", "relation of other slides"]
#: Of strengths that are given as text.
KINDS: tuple[Kind, ...] = ("lognormal", "normal")

Property = Literal["residual_strength_kpa", "strength_ratio"]
#: Options by which each is given.
OPTIONS: dict[Property, str] = {
    RESIDUAL_STRENGTH: "--residual-strength",
    STRENGTH_RATIO: "--strength-ratio",
}
#: What a message shows: a strength, and that of some zones.
EXAMPLES: dict[Property, tuple[str, str]] = {
    RESIDUAL_STRENGTH: ("18+-5", "1,6=4+-1"),
    STRENGTH_RATIO: ("0.12+-0.03", "1,6=0.1+-0.02"),
}
_NUMBER = r"[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?"
_FORM = re.compile(rf"(?:([^=]*)=)?\s*({_NUMBER})\s*(?:\+-|\+/-|±)\s*({_NUMBER})\s*")
#: A normal distribution is cut below this share of the mean.
LEAST_SHARE = 0.1
#: Errors of a logarithm that each draw is given.
SCORES = 41


@dataclass(frozen=True)
class KnownStrength:
    """One strength.

    Attributes:
        zones: names of the zones that share it; empty: not said yet.
        mean: of it, in `unit`.
        std: standard deviation, in `unit`.
        kind: of the distribution; the last two: `DrawnStrength`.
        property: residual strength, or ratio to the vertical effective stress before failure.
    """

    zones: tuple[str, ...]
    mean: float
    std: float
    kind: Kind
    property: Property = RESIDUAL_STRENGTH

    def at(self, score: np.ndarray | float) -> np.ndarray:
        """Strength of standard normal scores, any shape, in `unit`."""
        score = np.asarray(score, dtype=float)
        if self.kind == "lognormal":
            variance = np.log1p((self.std / self.mean) ** 2)
            return self.mean * np.exp(np.sqrt(variance) * score - 0.5 * variance)
        cut = ndtr((LEAST_SHARE - 1.0) * self.mean / self.std)
        return self.mean + self.std * ndtri(cut + (1.0 - cut) * ndtr(score))

    @builtins.property  # the field of that name hides it here
    def unit(self) -> str:
        """Its unit: kPa; empty for a ratio."""
        return UNITS[self.property]

    @builtins.property
    def symbol(self) -> str:
        """S_r, or S_r over the stress, as pages write it."""
        return SYMBOLS[self.property].replace("sigma", "σ")

    @builtins.property
    def words(self) -> str:
        """For tables: symbol, mean and standard deviation, zones."""
        zones = f"zone{'s'[: len(self.zones) > 1]} {', '.join(self.zones)}"
        value = f"{self.mean:.4g} ± {self.std:.4g} {self.unit}".rstrip()
        return f"{self.symbol} {value} in {zones} ({self.kind})"


def parse_strength(text: str, kind: Kind, what: Property = RESIDUAL_STRENGTH) -> KnownStrength:
    """Read one value of `--residual-strength` or `--strength-ratio`.

    Raises:
        InputError: not of the form, not positive, or a ratio that is beyond any soil's.
    """
    option, unit = OPTIONS[what], UNITS[what]
    match = _FORM.fullmatch(text.strip())
    if match is None:
        one, of_zones = EXAMPLES[what]
        raise InputError(
            f"{option} {text!r}: must be MEAN+-STD{f' in {unit}' if unit else ''}, such as {one}, "
            f"or ZONES=MEAN+-STD, such as {of_zones}; a decimal point, no comma"
        )
    zones = None if match[1] is None else [name.strip() for name in match[1].split(",")]
    if zones is not None and not all(zones):
        raise InputError(f"{option} {text!r}: a zone before `=` has no name")
    mean, std = float(match[2]), float(match[3])
    if not (0.0 < std < np.inf and 0.0 < mean < np.inf):
        raise InputError(f"{option} {text!r}: mean and standard deviation must be greater than 0")
    if std > mean:
        raise InputError(
            f"{option} {text!r}: a standard deviation of {f'{std:g} {unit}'.rstrip()} exceeds the "
            f"mean; at most {mean:g}"
        )
    found = KnownStrength(tuple(zones or ()), mean, std, kind, what)
    if what == STRENGTH_RATIO and (most := float(found.at(FARTHEST))) > MOST_STRENGTH_RATIO:
        raise InputError(
            f"{option} {text!r}: reaches {most:.3g}, three standard deviations up; a ratio of a "
            f"strength to the stress is at most {MOST_STRENGTH_RATIO:g} (kPa: "
            f"{OPTIONS[RESIDUAL_STRENGTH]})"
        )
    return found


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
        raise InputError(
            f"{OPTIONS[strengths[0].property]}: of several, each must name its zones, such as "
            f"{EXAMPLES[strengths[0].property][1]}"
        )
    known = [zone.name for zone in scene.zones]
    found: list[KnownStrength] = []
    taken: list[str] = []
    for strength in strengths:
        own = strength.zones or tuple(zones)
        if not own:
            raise InputError(
                "--zones: no zone of the scene is liquefied; name those of "
                f"{OPTIONS[strength.property]}: {', '.join(known)}"
            )
        for name in own:
            _check_zone(name, strength.property, scene, taken)
            taken.append(name)
        found.append(replace(strength, zones=own))
    return found


def _check_zone(name: str, what: Property, scene: Scene | Terrain, taken: Sequence[str]) -> None:
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
    if what == STRENGTH_RATIO and not soils[name].liquefied:
        raise InputError(
            f"zone {name!r}: its material is not liquefied: true, and {OPTIONS[what]} belongs to "
            "soil that liquefies"
        )


@dataclass(frozen=True)
class DrawnStrength(KnownStrength):
    """One strength; `draws` are s values of equal weight, in `unit`."""

    draws: tuple[float, ...] = ()

    def at(self, score: np.ndarray | float) -> np.ndarray:
        """Strength of standard normal scores, any shape: the quantile of the draws."""
        places = (np.arange(len(self.draws)) + 0.5) / len(self.draws)
        return np.interp(ndtr(np.asarray(score, dtype=float)), places, np.sort(self.draws))

    @property
    def scores(self) -> np.ndarray:
        """Normal scores of the draws, (s,)."""
        ranks = np.argsort(np.argsort(self.draws, kind="stable"), kind="stable")
        return ndtri((ranks + 0.5) / len(self.draws))


def widened(strength: KnownStrength, log_std: float) -> KnownStrength:
    """A strength whose logarithm may be off by more; draws of a posterior have that in them.

    What other slides tell has their errors in it and not that of this dam's runs.
    """
    if isinstance(strength, DrawnStrength):
        return strength if strength.kind == "posterior" else _redrawn(strength, log_std)
    more = strength.mean * log_std
    return replace(strength, std=float(np.hypot(strength.std, more)))


def _redrawn(strength: DrawnStrength, log_std: float) -> DrawnStrength:
    """As many draws, whose logarithm scatters by more."""
    count = len(strength.draws)
    scores = ndtri((np.arange(SCORES) + 0.5) / SCORES)
    logs = np.add.outer(np.log(strength.draws), log_std * scores)
    values = np.quantile(np.exp(logs), (np.arange(count) + 0.5) / count)
    mean, std = float(values.mean()), float(values.std())
    return replace(strength, mean=mean, std=std, draws=tuple(map(float, values)))


def drawn_strengths(path: str | Path) -> list[DrawnStrength]:
    """The residual strengths and strength ratios of a posterior, with their zones.

    Args:
        path: folder of `posterior.json` and `posterior.nc`, or one of the two files.

    Raises:
        InputError: no posterior, or one of no strength.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    draws, document = load_draws(folder), load_posterior(folder)
    found = []
    for one in document.parameters:
        what = next((known for known in OPTIONS if known == one.property), None)
        if what is None:
            continue
        values = draws.posterior[:, draws.unknowns.index(key(one.name))]
        found.append(
            DrawnStrength(
                tuple(one.zones),
                float(values.mean()),
                float(values.std()),
                "posterior",
                what,
                tuple(map(float, values)),
            )
        )
    if not found:
        raise InputError(f"{folder}: a posterior without a residual strength or ratio")
    return found


def ratio_of_relation(path: str | Path) -> DrawnStrength:
    """The ratio of a dam without a slide, as other slides tell it.

    Args:
        path: folder of `joint.json`, or the file.

    Raises:
        InputError: no such document.
    """
    document = load_joint(path)
    return DrawnStrength(
        (),
        document.ratio.mean,
        document.ratio.std,
        "relation of other slides",
        STRENGTH_RATIO,
        tuple(document.ratio_quantiles),
    )


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
                name=f"{one.property.removesuffix('_kpa')}_{place}",
                zones=list(one.zones),
                property=one.property,
                start=one.mean,
                low=1e-6 * one.mean,
                high=MOST_STRENGTH_RATIO if one.property == STRENGTH_RATIO else 1e6 * one.mean,
            )
            for place, one in enumerate(strengths, start=1)
        ]
    )
