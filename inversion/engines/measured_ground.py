"""What was measured in plan as the numbers that a simulated slide predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from geometry.scenes3d.scene3d import Scene3d
from geometry.survey3d.measured import DepositMap
from inversion.engines.ground_engine import KeptMaps, OnGround
from inversion.estimation.data import Targets
from inversion.estimation.forward import Prediction
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import RESIDUAL_STRENGTH, material_key
from inversion.problem.scene_changes import with_properties
from inversion.problem.state import simulated

if TYPE_CHECKING:
    from mpm_taichi.solver3d.problem import Problem3d


@dataclass(frozen=True)
class MeasuredGround(OnGround):
    """A reading of the question "which strengths made the deposit that was measured?".

    Attributes:
        parameters: what is calibrated.
        targets: what was measured; its entries are of `geometry.survey3d`.
        jitter: points move by up to this times the spacing / 2, each way.
        seed: of the jitter.
    """

    parameters: Parameters
    targets: Targets
    jitter: float = 0.0
    seed: int = 0

    def scene_at(self, values: np.ndarray) -> Scene3d:
        """The scene with values of the parameters, in outside units."""
        changes = [
            (zone, material_key(spec.property), simulated(value))
            for spec, value in zip(self.parameters.specs, values, strict=True)
            for zone in spec.zones
        ]
        return self.scene.with_soil(with_properties(self.scene.soil, changes))

    def problem_at(self, values: np.ndarray) -> tuple[Scene3d, Problem3d]:
        """What a run simulates: the scene with the values, and its points, jittered."""
        scene, problem = super().problem_at(values)
        if not self.jitter:
            return scene, problem
        step = 0.5 * self.jitter * problem.spacing
        drawn = np.random.default_rng(self.seed).uniform(-step, step, problem.position.shape)
        position = problem.position + drawn
        sunk = position[:, 2] <= problem.base.at(position[:, 0], position[:, 1])
        position[sunk] = problem.position[sunk]  # it would lie in the ground and stays in place
        return scene, replace(problem, position=position)

    def prediction(self, values: np.ndarray, kept: KeptMaps) -> Prediction:
        """What was measured, as a run with these values has it."""
        deposit = self.deposit_map(values, kept)
        found = self._read(deposit)
        lacking = [
            name for name, value in zip(self.targets.names, found, strict=True) if np.isnan(value)
        ]
        reason = kept.reason or (f"{lacking[0]}: cannot be read" if lacking else "")
        if kept.reason:
            found[:] = np.nan
        broken = not np.all(np.isfinite(found[self.targets.fitted]))
        mean, spread = self._stress(kept)
        return Prediction(
            found, self._read(deposit.at_start), status="failed" if broken else "finished",
            reason=reason, sigma_v0_kpa=mean, sigma_v0_std_kpa=spread,
            run_time_s=kept.wall_time_s, at_rest=kept.at_rest or bool(kept.reason),
            spacing_m=self.scene.spacing,
        )  # fmt: skip

    def deposit_map(self, values: np.ndarray, kept: KeptMaps) -> DepositMap:
        """A run with these values in plan."""
        from mpm_taichi.readings3d import maps_of

        scene, problem = self.problem_at(values)
        maps = maps_of(scene, problem)
        ground = scene.ground
        return DepositMap(
            surface=None if ground is None else ground.surface,
            base=maps.base,
            before=maps.before,
            after=replace(maps.before, values=np.asarray(kept.thickness, float)),
            least=maps.least,
            readings=kept.readings,
        )

    def _read(self, deposit: DepositMap) -> np.ndarray:
        return np.concatenate([entry.read(deposit) for entry in self.targets.entries])

    def _stress(self, kept: KeptMaps) -> tuple[np.ndarray, np.ndarray]:
        """Mean and spread of the vertical effective stress over each S_r's zones, (p,) [kPa]."""
        found = np.full((2, len(self.parameters.specs)), np.nan)
        for place, spec in enumerate(self.parameters.specs):
            own = [kept.stress_kpa[name] for name in spec.zones if name in kept.stress_kpa]
            if spec.property != RESIDUAL_STRENGTH or not own:
                continue
            count, mean, std = np.array(own).T
            middle = np.average(mean, weights=count)
            square = np.average(std**2 + (mean - middle) ** 2, weights=count)
            found[:, place] = middle, np.sqrt(square)
        return found[0], found[1]
