"""Slides in three dimensions as a forward engine: strengths in, what is read in plan out.

A `GroundSetup` asks for the readings of a deposit; what was measured is asked for by a
`inversion.engines.measured_ground.MeasuredGround`.

A run is kept by content, as maps and readings: a prediction that was stopped goes on where it was,
within a run from its last checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry import PHYSICS_VERSION as GEOMETRY_VERSION
from geometry.scenes3d.scene3d import Scene3d
from inversion.engines.run_store import DAMAGE, OnRun
from inversion.estimation.data import Targets
from inversion.estimation.forward import Forward, Prediction, Request
from inversion.problem.scene_changes import with_properties
from inversion.problem.state import simulated
from mpm_taichi import PHYSICS_VERSION
from pipeline.files import atomic_path

if TYPE_CHECKING:
    from mpm_taichi.readings3d import Maps
    from mpm_taichi.solver3d.problem import Problem3d
    from mpm_taichi.trajectory3d import Run3d
    from pipeline.config import SimulationSettings


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
    """

    thickness: np.ndarray
    readings: dict[str, float]
    walls: list[str]
    at_rest: bool
    reason: str
    wall_time_s: float
    stress_kpa: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class OnGround(ABC):
    """A reading of a question on a three-dimensional scene.

    Attributes:
        scene: before the slide.
        settings: of the simulations.
    """

    scene: Scene3d
    settings: SimulationSettings

    @abstractmethod
    def scene_at(self, values: np.ndarray) -> Scene3d:
        """The scene with values (p,) of the unknowns put in."""

    @abstractmethod
    def prediction(self, values: np.ndarray, kept: KeptMaps) -> Prediction:
        """What is read of a run with these values."""

    def at(self, values: np.ndarray) -> Request:
        """The run with these values."""
        return Request(self, np.asarray(values, dtype=float))

    def problem_at(self, values: np.ndarray) -> tuple[Scene3d, Problem3d]:
        """What a run simulates: the scene with the values, and its points."""
        from mpm_taichi.solver3d.problem import problem_of

        scene = self.scene_at(values)
        return scene, problem_of(scene)

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


@dataclass(frozen=True)
class GroundSetup(OnGround):
    """The question "how far does it run?"; nothing has been measured.

    Attributes:
        zones: of each strength.
    """

    zones: tuple[tuple[str, ...], ...]

    def scene_at(self, values: np.ndarray) -> Scene3d:
        """The scene with these strengths [kPa] in their zones."""
        changes = [
            (zone, "cohesion_kpa", simulated(value))
            for zones, value in zip(self.zones, values, strict=True)
            for zone in zones
        ]
        return self.scene.with_soil(with_properties(self.scene.soil, changes))

    @cached_property
    def targets(self) -> Targets:
        """The readings as numbers to predict."""
        document = self.scene.document
        paths = document.paths or ("middle",)
        names = [
            "toe_runout_m", *(f"runout_{name}_m" for name in paths), "inundated_area_m2",
            "volume_beyond_foot_m3", "volume_moved_m3",
            *(f"volume_across_{name}_m3" for name in document.lines), "largest_speed_m_per_s",
        ]  # fmt: skip
        count = len(names)
        return Targets([], names, np.zeros(count), np.eye(count), ["fitted"] * count)

    def prediction(self, values: np.ndarray, kept: KeptMaps) -> Prediction:
        """The readings of a run with these strengths."""
        names = self.targets.names
        found = np.array([kept.readings.get(name, np.nan) for name in names])
        # A path on which nothing came to lie has been run zero metres along.
        along = np.array([name.startswith("runout_") for name in names])
        found[along & np.isnan(found) & (not kept.reason)] = 0.0
        return Prediction(
            found, np.zeros(len(found)), status="failed" if kept.reason else "finished",
            reason=kept.reason, run_time_s=kept.wall_time_s, at_rest=kept.at_rest,
            spacing_m=self.scene.spacing,
        )  # fmt: skip


class GroundEngine(Forward):
    """`inversion.estimation.forward.Forward` on three-dimensional scenes.

    Requests are of an `OnGround`.

    Args:
        folder: of the kept runs.
        threads: CPU threads; None: all.
        on_run: called for each run of a batch.
        on_frame: called with (seconds of motion, of at most) at every frame; it may raise to stop.
    """

    def __init__(
        self,
        folder: Path,
        *,
        threads: int | None = None,
        on_run: OnRun | None = None,
        on_frame: Callable[[int, int], None] | None = None,
    ) -> None:
        super().__init__()
        self.folder, self.threads = folder, threads
        self.on_run, self.on_frame = on_run, on_frame
        self.computed = 0

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Readings of all requests, one run after another."""
        self.runs += len(requests)
        found = []
        for done, request in enumerate(requests, start=1):
            kept = self.kept_maps(request)
            found.append(request.setup.prediction(request.values, kept))
            if self.on_run is not None:
                self.on_run(done, len(requests))
        return found

    def kept_maps(self, request: Request) -> KeptMaps:
        """Maps and readings of a request, simulated unless they are kept."""
        setup: OnGround = request.setup
        scene, problem = setup.problem_at(request.values)
        key = _key(scene, problem, setup.settings)
        path = self.folder / f"{key}.npz"
        if (kept := _load(path)) is None:
            kept = self._simulate(scene, problem, setup.settings, path)
            self.computed += 1
        return kept

    def _simulate(
        self, scene: Scene3d, problem: Problem3d, settings: SimulationSettings, path: Path
    ) -> KeptMaps:
        from mpm_taichi.readings3d import maps_of, readings_3d, walls_reached
        from mpm_taichi.simulate3d import simulate_3d

        seconds = int(settings.duration_s)

        def on_frame(time: float, _: float) -> None:
            if self.on_frame is not None:
                self.on_frame(min(int(time), seconds), seconds)

        path.parent.mkdir(parents=True, exist_ok=True)
        with redirect_stdout(sys.stderr):
            run = simulate_3d(
                problem, settings, threads=self.threads,
                checkpoint=path.with_suffix(".checkpoint"), on_frame=on_frame,
            )  # fmt: skip
        maps = maps_of(scene, problem, run)
        assert maps.after is not None
        frame = run.time[1] - run.time[0] if len(run.time) > 1 else 0.0
        kept = KeptMaps(
            maps.after.values,
            {} if run.reason else readings_3d(scene, problem, run, maps),
            walls_reached(scene, maps),
            bool(run.time[-1] < settings.duration_s - 0.5 * frame),
            run.reason,
            run.wall_time_s,
            _stress_by_zone(scene, run),
        )
        said = {"readings": kept.readings, "walls": kept.walls, "at_rest": kept.at_rest,
                "reason": kept.reason, "wall_time_s": kept.wall_time_s,
                "stress_kpa": kept.stress_kpa}  # fmt: skip
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, thickness=kept.thickness, said=json.dumps(said))
        return kept


def _stress_by_zone(scene: Scene3d, run: Run3d) -> dict[str, list[float]]:
    """Zone -> number of points, mean and standard deviation of the vertical stress [kPa]."""
    vertical = -1e-3 * run.initial_stress[:, 2].astype(float)
    found = {}
    for number, zone in enumerate(scene.soil.zones):
        own = vertical[run.zone == number]
        if len(own):
            found[zone.name] = [float(len(own)), float(own.mean()), float(own.std())]
    return found


def _load(path: Path) -> KeptMaps | None:
    """The maps of a file; None: there is none, or it is damaged."""
    try:
        with np.load(path) as file:
            return KeptMaps(file["thickness"], **json.loads(str(file["said"])))
    except DAMAGE:
        return None


def _key(scene: Scene3d, problem: Problem3d, settings: SimulationSettings) -> str:
    """Hash of everything that the maps and readings depend on."""
    plain = {
        "physics": [PHYSICS_VERSION, GEOMETRY_VERSION],  # readings are kept, not positions
        "settings": settings.model_dump(mode="json"),
        "document": scene.document.model_dump(mode="json"),
        "materials": [material.model_dump(mode="json") for material in problem.materials],
        "domain": problem.domain,
        "spacing": [problem.spacing, problem.cells_per_spacing],
        "edges": [problem.contact, problem.friction_coefficient, problem.flanks],
    }
    digest = hashlib.sha256(json.dumps(plain, sort_keys=True).encode())
    rasters = [problem.base, *([problem.water] if problem.water else [])]
    if scene.ground is not None and scene.ground.after is not None:
        rasters.append(scene.ground.after)
    arrays = [problem.position, problem.volume, problem.material, problem.zone]
    arrays += [] if problem.velocity is None else [problem.velocity]
    arrays += [np.array([*raster.origin, raster.spacing]) for raster in rasters]
    for array in (*arrays, *(raster.values for raster in rasters)):
        digest.update(np.ascontiguousarray(array))
    return digest.hexdigest()[:32]
