"""Parameters: from the numbers people use to those that are fitted, and into a scene.

Strengths and densities are fitted as logarithms, friction angles as they are. Every fitted number
is then divided by what was known of it beforehand, so that a step of one means the same for each:
the prior's standard deviation, or the width of the bounds / sqrt(12) (all values between them
equally likely) where no prior is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.scenes.scene import Scene
from inversion.problem.question import ParameterSpec
from inversion.problem.water_level import pool_at

#: Properties that are fitted as logarithms.
LOGARITHMIC = ("cohesion_kpa", "density")


@dataclass(frozen=True)
class Parameters:
    """The sought numbers, p of them, and their transform.

    `values` are in outside units, (p,); `fitted` are the scaled numbers of the fit, (p,).
    """

    specs: list[ParameterSpec]

    @property
    def names(self) -> list[str]:
        """Names in the question's order."""
        return [spec.name for spec in self.specs]

    @property
    def logarithmic(self) -> np.ndarray:
        """(p,) bool: fitted as logarithms."""
        return np.array([spec.property in LOGARITHMIC for spec in self.specs])

    @property
    def strengths(self) -> np.ndarray:
        """(p,) bool: cohesions, S_r where friction is 0."""
        return np.array([spec.property == "cohesion_kpa" for spec in self.specs])

    @property
    def has_prior(self) -> np.ndarray:
        """(p,) bool: the question gives a prior."""
        return np.array([spec.prior is not None for spec in self.specs])

    @property
    def start(self) -> np.ndarray:
        """First guess, values (p,)."""
        return np.array([spec.start for spec in self.specs])

    @property
    def low(self) -> np.ndarray:
        """Lower bounds, values (p,)."""
        return np.array([spec.low for spec in self.specs])

    @property
    def high(self) -> np.ndarray:
        """Upper bounds, values (p,)."""
        return np.array([spec.high for spec in self.specs])

    @property
    def prior_std(self) -> np.ndarray:
        """Standard deviation before the data, in the logarithm or the unit of the fit, (p,)."""
        wide = (self._plain(self.high) - self._plain(self.low)) / np.sqrt(12.0)
        given = [
            np.nan if spec.prior is None
            else spec.prior.std / (spec.prior.mean if spec.property in LOGARITHMIC else 1.0)
            for spec in self.specs
        ]  # fmt: skip
        return np.where(self.has_prior, given, wide)

    @property
    def prior_mean(self) -> np.ndarray:
        """Most likely values before the data (p,): of the prior, else the first guess."""
        return np.array(
            [spec.start if spec.prior is None else spec.prior.mean for spec in self.specs]
        )

    @property
    def fitted_low(self) -> np.ndarray:
        """Lower bounds, fitted (p,)."""
        return self.to_fitted(self.low)

    @property
    def fitted_high(self) -> np.ndarray:
        """Upper bounds, fitted (p,)."""
        return self.to_fitted(self.high)

    def to_fitted(self, values: np.ndarray) -> np.ndarray:
        """Fitted numbers (p,) of values (p,)."""
        return self._plain(np.asarray(values, dtype=float)) / self.prior_std

    def to_values(self, fitted: np.ndarray) -> np.ndarray:
        """Values (p,) of fitted numbers (p,), kept within the bounds against rounding."""
        plain = np.asarray(fitted, dtype=float) * self.prior_std
        with np.errstate(over="ignore"):
            values = np.where(self.logarithmic, np.exp(np.minimum(plain, 700.0)), plain)
        return np.clip(values, self.low, self.high)

    def value_per_fitted(self, values: np.ndarray) -> np.ndarray:
        """Derivative of the values by the fitted numbers, at `values`, (p,)."""
        return self.prior_std * np.where(self.logarithmic, values, 1.0)

    def clipped(self, values: np.ndarray) -> np.ndarray:
        """Values (p,) moved into the bounds."""
        return np.clip(np.asarray(values, dtype=float), self.low, self.high)

    def at_bound(self, values: np.ndarray, share: float = 1e-3) -> list[str | None]:
        """For each parameter "low", "high" or None: nearer to it than `share` of the width."""
        fitted, low, high = self.to_fitted(values), self.fitted_low, self.fitted_high
        near = share * (high - low)
        return [
            "low" if at - bottom <= room else "high" if top - at <= room else None
            for at, bottom, top, room in zip(fitted, low, high, near, strict=True)
        ]

    def as_mapping(self, values: np.ndarray) -> dict[str, float]:
        """Values by name."""
        return {name: float(value) for name, value in zip(self.names, values, strict=True)}

    def scene(self, base: Scene, values: np.ndarray) -> Scene:
        """The scene with the values put in; see `with_properties` and `pool.pool_at`."""
        for spec, value in zip(self.specs, values, strict=True):
            if spec.property == "water_level":
                base = Scene.model_validate(pool_at(base, float(value)))
        changes = [
            (zone, spec.property, float(value))
            for spec, value in zip(self.specs, values, strict=True)
            for zone in spec.zones
        ]
        return with_properties(base, changes)

    def _plain(self, values: np.ndarray) -> np.ndarray:
        """Logarithm where it is fitted as one; values (p,) must be positive there."""
        positive = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(positive), values)


def with_properties(base: Scene, changes: Sequence[tuple[str, str, float]]) -> Scene:
    """A scene in which some zones have other properties.

    Where zones that share a material come to differ, each changed group gets a material of its own,
    so that a zone that is not named keeps its soil. Equal changes keep equal materials, so the
    scene, and with it the key of its run, does not depend on the order of the changes.

    Args:
        base: the scene.
        changes: (zone, property, value), the property a key of a scene's material.
    """
    document = base.model_dump()
    wanted: dict[str, dict[str, float]] = {zone.name: {} for zone in base.zones}
    for zone, name, value in changes:
        wanted[zone][name] = value
    materials: dict[str, dict] = {}
    for zone in document["zones"]:
        old = zone["material"]
        soil = {**document["materials"][old], **wanted[zone["name"]]}
        extra = soil["density"] - document["materials"][old]["density"]
        if extra and soil["saturated_density"] is not None:
            soil["saturated_density"] += extra
        name = old
        while materials.setdefault(name, soil) != soil:
            name = f"{name}_{zone['name']}"
        zone["material"] = name
    document["materials"] = materials
    return Scene.model_validate(document)
