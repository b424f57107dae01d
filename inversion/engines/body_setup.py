"""A reading of the question on a body in three dimensions: strengths in, numbers in plan out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.scenes3d.scene3d import Scene3d, Terrain
from geometry.survey3d.measured import DepositMap, MapMeasured
from inversion.estimation.data import Targets
from inversion.estimation.forward import Prediction, Setup
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO, STRENGTHS
from inversion.problem.scene_changes import with_properties
from inversion.problem.state import simulated
from pipeline.cli import InputError

if TYPE_CHECKING:
    from mpm_taichi.readings3d import Maps
    from mpm_taichi.solver3d.problem import Problem3d


#: Between the times at which the volume across a line is kept [s].
STEP_S = 1.0


@dataclass(frozen=True)
class KeptMaps:
    """What is kept of a run.

    Attributes:
        thickness: of the deposit, (nx, ny) [m]; zeros where the run failed.
        readings: by name with unit; NaN where nothing is read.
        walls: of the domain that soil reached.
        at_rest: the slide came to rest.
        reason: why the run failed, else empty.
        wall_time_s: computing time [s].
        stress_kpa: zone -> number of its points, mean vertical effective stress before failure, and
            its standard deviation within the zone [kPa].
        across: line -> volume that has crossed it, every `STEP_S` from the start of the slide to
            the longest motion that was asked for [m3]; empty: nobody asked for it.
    """

    thickness: np.ndarray
    readings: Mapping[str, float]
    walls: list[str]
    at_rest: bool
    reason: str
    wall_time_s: float
    stress_kpa: dict[str, list[float]] = field(default_factory=dict)
    across: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class BodySetup(Setup):
    """A reading of the question on a body.

    Attributes:
        scene: the body.
        targets: their entries are of `geometry.survey3d`.
        jitter: points move by up to this times the spacing / 2, each way.
        jitter_seed: of the jitter.
        over_time: the volume across each line is kept over time.
        factors: zone -> by how much more strength it has than its parameter says.
    """

    scene: Scene3d
    targets: Targets[MapMeasured]
    jitter: float = 0.0
    jitter_seed: int = 0
    over_time: bool = False
    factors: Mapping[str, float] = field(default_factory=dict)

    #: A map is many numbers, each with its own noise.
    widest_log = 0.4
    kind = "body"

    @property
    def soil(self) -> Scene | Terrain:
        """See `Setup`."""
        return self.scene.soil

    def with_soil(self, soil: Scene | Terrain) -> Self:
        """See `Setup`."""
        return replace(self, scene=self.scene.with_soil(soil))

    @property
    def seed(self) -> int:
        """See `Setup`."""
        return self.jitter_seed

    @property
    def least_move_m(self) -> float:
        """A quarter of the spacing [m, m2 or m3]: a surface moves by less than a toe does."""
        return 0.25 * self.scene.spacing

    def scene_at(self, values: np.ndarray) -> Scene3d:
        """The body with values (p,) of the parameters put in."""
        changes = [
            (zone, key, value * self.factors.get(zone, 1.0) if key in STRENGTHS else value)
            for spec, own in zip(self.parameters.specs, values, strict=True)
            for zone, key, value in spec.changes(simulated(own))
        ]
        return self.scene.with_soil(with_properties(self.scene.soil, changes))

    def at_spacing(self, spacing: float, source: str) -> Self:
        """See `Setup`."""
        changed = replace(self, scene=body_at_spacing(self.scene, spacing, source))
        try:
            _ = changed.problem
        except InputError as error:
            raise InputError(f"{source}: at {spacing:.3g} m spacing: {error}") from None
        return changed

    def jittered(self, jitter: float, seed: int) -> Self:
        """See `Setup`."""
        return replace(self, jitter=jitter, jitter_seed=seed)

    # --- what is simulated ---

    @property
    def times(self) -> np.ndarray:
        """When the volume across a line is kept, (k,) [s]."""
        return STEP_S * np.arange(int(np.ceil(self.settings.duration_s / STEP_S)) + 1)

    def is_whole(self, kept: KeptMaps) -> bool:
        """What is kept of a run has all that this setup reads."""
        lines = self.scene.document.lines if self.over_time else {}
        return bool(kept.reason) or all(name in kept.across for name in lines)

    @cached_property
    def problem(self) -> Problem3d:
        """The scene as it is, filled."""
        from mpm_taichi.solver3d.problem import problem_of

        return problem_of(self.scene)

    @cached_property
    def before(self) -> Maps:
        """Maps before anything moved."""
        from mpm_taichi.readings3d import maps_of

        return maps_of(self.scene, self.problem)

    def problem_at(self, values: np.ndarray) -> tuple[Scene3d, Problem3d]:
        """What a run simulates: the scene with the values, and its points, jittered."""
        from mpm_taichi.solver3d.problem import problem_of

        scene = self.scene_at(values)
        problem = problem_of(scene)
        if not self.jitter:
            return scene, problem
        step = 0.5 * self.jitter * problem.spacing
        drawn = np.random.default_rng(self.seed).uniform(-step, step, problem.position.shape)
        position = problem.position + drawn
        sunk = position[:, 2] <= problem.base.at(position[:, 0], position[:, 1])
        position[sunk] = problem.position[sunk]  # it would lie in the ground and stays in place
        return scene, replace(problem, position=position)

    # --- what is read of it ---

    def prediction(self, values: np.ndarray, kept: KeptMaps) -> Prediction:
        """The targets on a run with these values."""
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
        walls = ", ".join(kept.walls)
        remark = f"soil reached the wall at {walls}: the domain is too small for its map"
        return Prediction(
            found,
            self._read(deposit.at_start),
            status="failed" if broken else "finished",
            reason=reason,
            sigma_v0_kpa=mean,
            sigma_v0_std_kpa=spread,
            run_time_s=kept.wall_time_s,
            at_rest=kept.at_rest or bool(kept.reason),
            spacing_m=self.scene.spacing,
            remarks=(remark,) if kept.walls else (),
        )

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
            across=kept.across,
        )

    def _read(self, deposit: DepositMap) -> np.ndarray:
        return np.concatenate([entry.read(deposit) for entry in self.targets.entries])

    def _stress(self, kept: KeptMaps) -> tuple[np.ndarray, np.ndarray]:
        """Mean and spread of the vertical effective stress over the zones of each S_r or ratio.

        Returns:
            (p,) and (p,) [kPa]; NaN for other parameters.
        """
        found = np.full((2, len(self.parameters.specs)), np.nan)
        for place, spec in enumerate(self.parameters.specs):
            own = [kept.stress_kpa[name] for name in spec.zones if name in kept.stress_kpa]
            if spec.property not in (RESIDUAL_STRENGTH, STRENGTH_RATIO) or not own:
                continue
            count, mean, std = np.array(own).T
            middle = np.average(mean, weights=count)
            square = np.average(std**2 + (mean - middle) ** 2, weights=count)
            found[:, place] = middle, np.sqrt(square)
        return found[0], found[1]


def body_at_spacing(scene: Scene3d, spacing: float, source: str) -> Scene3d:
    """The same body with points at another spacing [m].

    Raises:
        InputError: beginning with `source`: no such spacing, or a zone would be too thin.
    """
    if spacing == scene.spacing:
        return scene
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise InputError(f"{source}: a spacing of {spacing:g} m: must be greater than 0")
    section = scene.section
    if section is not None:
        document = {**section.model_dump(), "spacing": spacing}
        section = scene_from_mapping(document, f"{source} at {spacing:g} m spacing")
    return replace(scene, spacing=spacing, section=section)
