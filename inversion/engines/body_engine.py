"""Bodies in three dimensions as a forward engine: strengths in, what is read in plan out.

A run is kept by content, as maps and readings: work that was stopped goes on where it was, within a
run from its last checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry import PHYSICS_VERSION as GEOMETRY_VERSION
from geometry.scenes3d.scene3d import Scene3d
from inversion.engines.body_setup import BodySetup, KeptMaps
from inversion.engines.content_store import ContentStore
from inversion.engines.run_store import Store
from inversion.estimation.forward import Forward, Prediction, Request, Setup
from mpm_taichi import PHYSICS_VERSION
from pipeline.cli import InputError

if TYPE_CHECKING:
    from mpm_taichi.solver3d.problem import Problem3d
    from mpm_taichi.trajectory3d import Run3d
    from pipeline.config import SimulationSettings


class BodyStore(Store):
    """Runs of bodies by content, as maps; arguments as of `Store`.

    Raises:
        InputError: another device than the CPU.
    """

    def __init__(self, folder: str | Path | None, **options: Any) -> None:
        super().__init__(folder, **options)
        if self.device != "cpu":
            raise InputError(f"device {self.device}: three dimensions run on the CPU alone")
        self._kept = ContentStore(self.folder, _maps_of_arrays, _arrays_of_maps)

    def refused(self, setup: Setup) -> str:
        """Why the solver does not simulate a setup; empty: it does."""
        from mpm_taichi.simulate3d import refuse_problem

        assert isinstance(setup, BodySetup)
        try:
            refuse_problem(setup.problem, setup.settings)
        except InputError as error:
            return str(error)
        return ""

    def fetch(self, setup: BodySetup, values: np.ndarray) -> KeptMaps:
        """The run of a setup with values of its parameters, simulated unless it is kept."""
        scene, problem = setup.problem_at(values)
        key = run_key_3d(scene, problem, setup.settings)
        found = self._kept.get(key)
        if found is None or not setup.is_whole(found):
            found = self._kept.put(key, self._simulated(setup, scene, problem, key))
            self.computed += 1
        return found

    def _simulated(
        self, setup: BodySetup, scene: Scene3d, problem: Problem3d, key: str
    ) -> KeptMaps:
        from mpm_taichi.readings3d import maps_of, readings_3d, volumes_across, walls_reached
        from mpm_taichi.simulate3d import simulate_3d

        settings = setup.settings
        seconds, checkpoint = int(settings.duration_s), None

        def on_frame(time: float, _: float) -> None:
            if self.on_frame is not None:
                self.on_frame(min(int(time), seconds), seconds)

        if (path := self._kept.path(key)) is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            checkpoint = path.with_suffix(".checkpoint")
        with redirect_stdout(sys.stderr):
            run = simulate_3d(
                problem, settings, threads=self.threads, checkpoint=checkpoint, on_frame=on_frame
            )
        maps = maps_of(scene, problem, run)
        frame = run.time[1] - run.time[0] if len(run.time) > 1 else 0.0
        return KeptMaps(
            maps.deposit.values,
            {} if run.reason else readings_3d(scene, problem, run, maps),
            walls_reached(scene, maps),
            bool(run.time[-1] < settings.duration_s - 0.5 * frame),
            run.reason,
            run.wall_time_s,
            _stress_by_zone(scene, run),
            {}
            if run.reason
            else {
                name: volumes.tolist()
                for name, volumes in volumes_across(scene, problem, run, setup.times).items()
            },
        )


def body_store(setup: Setup, store: Store) -> BodyStore:
    """The store of the runs of a body.

    Args:
        setup: what will be simulated, at least.
        store: whose folder, threads and reports it takes over.

    Raises:
        InputError: the solver refuses the setup, or there is no such device.
    """
    found = BodyStore(store.folder, **store.options)
    if reason := found.refused(setup):
        raise InputError(reason)
    return found


class BodyEngine(Forward):
    """`inversion.estimation.forward.Forward` of bodies by the material point method.

    Args:
        store: of the runs.
    """

    def __init__(self, store: BodyStore) -> None:
        super().__init__()
        self.store = store

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """What is read in plan of all requests, one run after another."""
        self.runs += len(requests)
        found = []
        for done, request in enumerate(requests, start=1):
            setup = body_of(request)
            found.append(setup.prediction(request.values, self.kept_maps(request)))
            if self.store.on_run is not None:
                self.store.on_run(done, len(requests))
        return found

    def kept_maps(self, request: Request) -> KeptMaps:
        """Maps and readings of a request, simulated unless they are kept."""
        return self.store.fetch(body_of(request), request.values)


def body_of(request: Request) -> BodySetup:
    """The setup of a request, for an engine that simulates bodies.

    Raises:
        TypeError: it is a section's.
    """
    if not isinstance(request.setup, BodySetup):
        raise TypeError("this engine simulates bodies in three dimensions")
    return request.setup


def _stress_by_zone(scene: Scene3d, run: Run3d) -> dict[str, list[float]]:
    """Zone -> number of points, mean and standard deviation of the vertical stress [kPa]."""
    vertical = -1e-3 * run.initial_stress[:, 2].astype(float)
    found = {}
    for number, name in enumerate(zone.name for zone in scene.soil.zones):
        own = vertical[run.zone == number]
        if len(own):
            found[name] = [float(len(own)), float(own.mean()), float(own.std())]
    return found


def _arrays_of_maps(kept: KeptMaps) -> dict[str, np.ndarray]:
    told = {
        "readings": dict(kept.readings),
        "walls": kept.walls,
        "at_rest": kept.at_rest,
        "reason": kept.reason,
        "wall_time_s": kept.wall_time_s,
        "stress_kpa": kept.stress_kpa,
        "across": kept.across,
    }
    return {"thickness": kept.thickness, "told": np.array(json.dumps(told))}


def _maps_of_arrays(arrays: dict[str, np.ndarray]) -> KeptMaps:
    return KeptMaps(arrays["thickness"], **json.loads(str(arrays["told"])))


def run_key_3d(scene: Scene3d, problem: Problem3d, settings: SimulationSettings) -> str:
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
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]
