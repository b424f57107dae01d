"""What varies in a posterior: the parameters of the question, and its sensitivities as nuisances.

Each has a prior and a coordinate of mean 0 and standard deviation 1: of a parameter without a prior
the bounds hold all that is known (evenly, of the logarithm for strengths); one with a prior is
normal within its bounds; a nuisance is normal, in its own standard deviations, within `REACHES`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import ValidationError
from scipy.special import ndtr, ndtri

from geometry.scenes.scene import Scene, document_error
from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.variants import moved
from inversion.engines.setup import Setup
from inversion.problem.question import (
    FixedProperty,
    MovedVertex,
    OtherSetting,
    Sensitivity,
    TimeStep,
    WaterLevel,
    ZoneBoundary,
    material_key,
)
from inversion.problem.scene_changes import with_properties
from inversion.problem.water_level import SAME_PLACE_M, pool_at
from pipeline.cli import InputError

REACHES = (3.0, 2.5, 2.0, 1.5, 1.0)
"""How far a nuisance is tried, in standard deviations; a boundary as far as zones stay apart."""

Nuisance = ZoneBoundary | WaterLevel | FixedProperty
Alternative = TimeStep | OtherSetting


@dataclass(frozen=True)
class Unknown:
    """One coordinate of the posterior.

    Attributes:
        name: unique.
        words: for tables.
        unit: of its value; "std" for a boundary, which has none of its own.
        role: parameter or nuisance.
        low: bound of the coordinate.
        high: the same.
        even: the prior is even between the bounds; else standard normal within them.
    """

    name: str
    words: str
    unit: str
    role: Literal["parameter", "nuisance"]
    low: float
    high: float
    even: bool


@dataclass(frozen=True)
class PriorSpace:
    """All that varies, d coordinates x: the p parameters first, then the nuisances."""

    case: InversionCase
    nuisances: tuple[Nuisance, ...]
    alternatives: tuple[Alternative, ...]

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.case.parameters.specs)

    @property
    def d(self) -> int:
        """Number of coordinates."""
        return self.p + len(self.nuisances)

    @cached_property
    def unknowns(self) -> list[Unknown]:
        """The coordinates in order."""
        parameters = self.case.parameters
        low = parameters.fitted_low - self._centre
        high = parameters.fitted_high - self._centre
        found = [
            Unknown(spec.name, spec.words, spec.unit, "parameter", float(low[i]), float(high[i]),
                    spec.prior is None)
            for i, spec in enumerate(parameters.specs)
        ]  # fmt: skip
        for one in self.nuisances:
            bottom, top = -self._reach(one, -1.0), self._reach(one, 1.0)
            found.append(Unknown(one.name, one.name, "std", "nuisance", bottom, top, False))
        return found

    def _reach(self, one: Nuisance, sense: float) -> float:
        """How far a nuisance goes in one sense, in standard deviations."""
        if not isinstance(one, ZoneBoundary):
            return REACHES[0]
        if one.sides == ("minus" if sense > 0.0 else "plus"):
            return 0.0
        for reach in REACHES:
            try:
                moved(self.case.setup.scene, one.vertices, sense * reach, self.case.source)
                return reach
            except InputError:
                continue
        return 0.0

    @cached_property
    def _centre(self) -> np.ndarray:
        """Fitted parameters at coordinate 0, (p,)."""
        parameters = self.case.parameters
        middle = 0.5 * (parameters.fitted_low + parameters.fitted_high)
        return np.where(parameters.has_prior, parameters.to_fitted(parameters.prior_mean), middle)

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, ...]:
        low = np.array([one.low for one in self.unknowns])
        high = np.array([one.high for one in self.unknowns])
        even = np.array([one.even for one in self.unknowns])
        return low, high, even, ndtr(low), ndtr(high)

    def from_shares(self, shares: np.ndarray) -> np.ndarray:
        """Coordinates (..., d) of shares of the prior's probability (..., d), each 0 to 1."""
        low, high, even, below, up_to = self._bounds
        normal = ndtri(np.clip(below + shares * (up_to - below), 1e-12, 1.0 - 1e-12))
        return np.where(even, low + shares * (high - low), np.clip(normal, low, high))

    def clipped(self, x: np.ndarray) -> np.ndarray:
        """Coordinates (..., d) moved into the bounds."""
        low, high, *_ = self._bounds
        return np.clip(x, low, high)

    def values(self, x: np.ndarray) -> np.ndarray:
        """Parameters in outside units (..., p) of coordinates (..., d)."""
        parameters = self.case.parameters
        fitted = np.asarray(x)[..., : self.p] + self._centre
        plain = fitted * parameters.prior_std
        values = np.where(parameters.logarithmic, np.exp(plain), plain)
        return np.clip(values, parameters.low, parameters.high)

    def setup(self, x: np.ndarray, spacing_m: float | None = None) -> Setup:
        """The reading of the question at one point (d,), parameters not yet put in.

        Raises:
            InputError: boundaries moved so far that zones overlap or vanish.
        """
        setup = self.case.setup
        try:
            scene = self._section(np.asarray(x)[self.p :], spacing_m)
        except ValidationError as error:
            raise InputError(document_error(error, self.case.source)) from None
        foot = {side: at + scene.foot(side) - setup.scene.foot(side)
                for side, at in setup.foot.items()}  # fmt: skip
        return replace(setup, scene=scene, foot=foot)

    def _section(self, amplitudes: np.ndarray, spacing_m: float | None) -> Scene:
        """The section with nuisances of these amplitudes."""
        scene = self.case.setup.scene
        if spacing_m is not None:
            scene = scene.changed(spacing=spacing_m)
        moves = list(zip(self.nuisances, amplitudes, strict=True))
        vertices = _joint_moves([(one, a) for one, a in moves if isinstance(one, ZoneBoundary)])
        if vertices:
            scene = moved(scene, vertices, 1.0, self.case.source)
        for one, a in moves:
            if isinstance(one, WaterLevel):
                level = scene.water_level + a * one.std_m
                scene = type(scene).model_validate(pool_at(scene, level))
        changes = [
            change
            for one, a in moves
            if isinstance(one, FixedProperty)
            for change in self._property_changes(one, a)
        ]
        return with_properties(scene, changes)

    def _property_changes(
        self, one: FixedProperty, amplitude: float
    ) -> list[tuple[str, str, float]]:
        """Changes as `with_properties` takes them; no soil has less than no strength."""
        key, scene = material_key(one.property), self.case.setup.scene
        soil = {zone.name: scene.materials[zone.material] for zone in scene.zones}
        values = [getattr(soil[name], key) + amplitude * one.std for name in one.zones]
        if one.property != "density":
            values = [max(value, 0.0) for value in values]
        return [(name, key, float(value)) for name, value in zip(one.zones, values, strict=True)]


def prior_space(case: InversionCase) -> PriorSpace:
    """The unknowns of a case: its parameters, and what its sensitivities say of the rest.

    Constructed measurements are left out. Other time steps and ways to simulate are alternatives,
    not coordinates; the cell size is dealt with by fine runs, and a measurement's stated range by
    its standard deviation.
    """

    def those(*kinds: type) -> tuple[Sensitivity, ...]:
        return tuple(one for one, _ in case.sensitivities[0] if isinstance(one, kinds))

    return PriorSpace(
        replace(case, setup=replace(case.setup, targets=case.setup.targets.unconstructed())),
        those(ZoneBoundary, WaterLevel, FixedProperty),
        those(TimeStep, OtherSetting),
    )


def _joint_moves(boundaries: Sequence[tuple[ZoneBoundary, float]]) -> list[MovedVertex]:
    """Moves of all vertices together; one that two boundaries move goes by the sum."""
    total: list[tuple[tuple[float, float], np.ndarray]] = []
    for one, amplitude in boundaries:
        for vertex in one.vertices:
            move = amplitude * np.asarray(vertex.move)
            for at, sum_of_moves in total:
                if np.hypot(at[0] - vertex.at[0], at[1] - vertex.at[1]) <= SAME_PLACE_M:
                    sum_of_moves += move
                    break
            else:
                total.append((vertex.at, move))
    return [MovedVertex(at=at, move=tuple(map(float, move))) for at, move in total]
