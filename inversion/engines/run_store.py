"""Simulations kept by content: the same scene and settings are computed once.

Measurements are read on a kept run by `inversion.engines.read_run`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from geometry.scenes.polygon_checks import area
from geometry.survey.measured import Reading
from inversion.engines.content_store import ContentStore
from inversion.engines.workers import Job, Workers
from mpm_taichi.batch import run_key
from mpm_taichi.effects import has_own_code

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from inversion.estimation.forward import HistoryReader, Request, Setup
    from mpm_taichi.simulate import Wanted
    from mpm_taichi.trajectory import Run
    from pipeline.config import SimulationSettings

#: Area of the points over that of the section, as far off as it can be by where points are put.
AREA_OFF = 0.3

_ARRAYS = {
    "initial",
    "final",
    "zone",
    "initial_volume",
    "vertical_stress",
    "volume",
    "status",
    "reason",
    "numbers",
}
# Names of the arrays of a reading begin so.
_READ, _TROUBLE = "reading_", "trouble_"

OnRun = Callable[[int, int], None]
"""Called with (runs done, runs of the batch)."""


@dataclass(frozen=True)
class KeptRun:
    """Results of a run that a back-analysis needs; N points.

    Attributes:
        initial: positions before the slide (N, 2) float32 [m].
        final: positions after it, (N, 2) float32 [m].
        zone: (N,) int32, place in the scene's zones.
        initial_volume: of the points before the slide, (N,) float32 [m2].
        vertical_stress: effective, before failure, compression positive, (N,) float32 [Pa].
        volume: of the points after the slide, (N,) float64 [m2]; None: as it was.
        status: "finished" or "failed"; reason: why.
        end_s: simulated motion [s]; at_rest: it stopped by itself.
        wall_time_s: computing time when it was computed [s].
        readings: of measurements that need the whole history, by `Measured.reading_key`.
    """

    initial: np.ndarray
    final: np.ndarray
    zone: np.ndarray
    initial_volume: np.ndarray
    vertical_stress: np.ndarray
    status: str
    reason: str
    end_s: float
    at_rest: bool
    wall_time_s: float
    readings: dict[str, Reading] = field(default_factory=dict)
    volume: np.ndarray | None = None

    @property
    def moved(self) -> tuple[np.ndarray, np.ndarray]:
        """Places (N, 2) [m] and volumes (N,) [m2] of the points after the slide."""
        return self.final, self.initial_volume if self.volume is None else self.volume


@runtime_checkable
class KeepsRuns(Protocol):
    """A forward engine that has whole runs, for pictures and for the stress before failure."""

    def kept_run(self, request: Request) -> KeptRun:
        """The whole run of a request."""
        ...


class Store:
    """What the runs of every engine share: where they are kept, and by what they are computed.

    Args:
        folder: of the files; None: in memory alone.
        device: "cpu" or "cuda".
        threads: CPU threads; None: all.
        on_run: called for each run of a batch.
        on_frame: called with (seconds of motion, of at most) at every frame of a run of minutes; it
            may raise to stop.
    """

    def __init__(
        self,
        folder: str | Path | None,
        *,
        device: str = "cpu",
        threads: int | None = None,
        on_run: OnRun | None = None,
        on_frame: OnRun | None = None,
    ) -> None:
        self.folder = None if folder is None else Path(folder)
        self.device = device
        self.threads = threads
        self.on_run = on_run
        self.on_frame = on_frame
        self.computed = 0

    @property
    def options(self) -> dict[str, Any]:
        """Device, threads and reports, as another store takes them."""
        names = ("device", "threads", "on_run", "on_frame")
        return {name: getattr(self, name) for name in names}

    @property
    def of_cells(self) -> Store:
        """The store of the runs that tell what the cells make of a strength."""
        return self

    def refused(self, setup: Setup) -> str:
        """Why it does not simulate a setup; empty: it does."""
        return ""

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """Do jobs that do not wait for each other, one after the other."""
        for job in jobs:
            job()

    @contextmanager
    def workers(self) -> Iterator[None]:
        """Processes for the simulations of a `with` block, where they are of use."""
        yield


class RunStore(Store):
    """Runs of sections by content, in memory and in a folder; arguments as of `Store`."""

    def __init__(self, folder: str | Path | None, **options: Any) -> None:
        super().__init__(folder, **options)
        self._kept = ContentStore(self.folder, run_of_arrays, arrays_of_run)
        self._counting = Lock()
        self._workers: Workers | None = None

    def fetch(
        self,
        wanted: Sequence[tuple[Scene, SimulationSettings]],
        readers: Sequence[HistoryReader] | None = None,
    ) -> list[KeptRun]:
        """The runs of scenes with their settings, in their order; the missing ones are computed.

        Args:
            wanted: scenes and settings; equal ones are computed once.
            readers: evaluated on each of them as it ends; None: nothing.
        """
        keys = [self.key(scene, settings) for scene, settings in wanted]
        to_read: dict[str, list[HistoryReader]] = {key: [] for key in keys}
        for key, reader in zip(keys, readers or (), strict=bool(readers)):
            to_read[key].append(reader)
        missing: dict[str, tuple[Scene, SimulationSettings]] = {}
        for key, pair in zip(keys, wanted, strict=True):
            if key not in missing and not self._is_there(key, pair[0], to_read[key]):
                missing[key] = pair
        if missing:
            self._compute(missing, to_read)
        return [self._kept[key] for key in keys]

    @contextmanager
    def workers(self) -> Iterator[None]:
        """Processes for the simulations of a `with` block, where there is more than one core."""
        number = self.threads or len(os.sched_getaffinity(0))
        if number < 2 or self.device != "cpu" or has_own_code():
            yield
            return
        self._workers = Workers(number)
        try:
            yield
            self._workers.close()
        except BaseException:
            self._workers.stop()
            raise
        finally:
            self._workers = None

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """Do jobs that do not wait for each other: with `workers` at the same time.

        Raises:
            BaseException: what a job has raised; the others end at their next simulation.
        """
        if self._workers is None:
            super().side_by_side(jobs)
        else:
            self._workers.side_by_side(jobs)

    def key(self, scene: Scene, settings: SimulationSettings) -> str:
        """Hash of everything the numbers of a run depend on."""
        return run_key(scene, settings, self.device)

    def write_run(self, scene: Scene, settings: SimulationSettings, path: Path) -> None:
        """Simulate once more with all frames, for films and other tools."""
        from mpm_taichi.batch import run_batch

        solver = None if self._workers is None else self._by_workers
        run_batch(
            {0: scene}, settings, path, device=self.device, threads=self.threads, simulate=solver
        )

    def _by_workers(
        self, scenes: Sequence[Scene], settings: SimulationSettings, **options: Any
    ) -> list[Run]:
        """As `mpm_taichi.simulate.simulate`."""
        assert self._workers is not None
        ((_, run),) = self._workers.simulate([(scene, settings) for scene in scenes])
        return [run]

    def _is_there(self, key: str, scene: Scene, readers: Iterable[HistoryReader]) -> bool:
        run = self._kept.get(key, holds=lambda kept: is_of(kept, scene))
        return run is not None and all(
            name in run.readings for reader in readers for name in reader.wanted
        )

    def _compute(
        self,
        missing: dict[str, tuple[Scene, SimulationSettings]],
        readers: Mapping[str, Sequence[HistoryReader]],
    ) -> None:
        """Simulate; keep each run as it ends."""
        keys = list(missing)
        for done, (place, run) in enumerate(self._simulated(list(missing.values())), start=1):
            self._keep(keys[place], kept_run(run, readers[keys[place]]))
            if self.on_run is not None:
                self.on_run(done, len(missing))

    def _simulated(self, wanted: Sequence[Wanted]) -> Iterator[tuple[int, Run]]:
        """(place, run) as runs end."""
        from mpm_taichi.simulate import simulate_each

        if self._workers is not None:
            yield from self._workers.simulate(wanted)
            return
        # Taichi reports its start on the standard output, where results alone belong.
        with redirect_stdout(sys.stderr):
            yield from simulate_each(wanted, device=self.device, threads=self.threads)

    def _keep(self, key: str, run: KeptRun) -> None:
        with self._counting:
            self.computed += 1
        self._kept.put(key, run, join=_with_readings)  # one that was there lacked some reading


def _with_readings(old: KeptRun, new: KeptRun) -> KeptRun:
    return replace(new, readings={**old.readings, **new.readings})


def kept_run(run: Run, readers: Iterable[HistoryReader] = ()) -> KeptRun:
    """The stored part of a run, with the readings of `readers`."""
    end = float(run.time[-1]) if len(run.time) else 0.0
    volume = run.bulk_volume
    return KeptRun(
        initial=run.positions[0].copy(),
        final=run.positions[-1].copy(),
        zone=run.zone,
        initial_volume=run.initial_volume,
        vertical_stress=-run.initial_stress[:, 1],
        status=run.status,
        reason=run.reason,
        end_s=end,
        at_rest=run.came_to_rest,
        wall_time_s=run.wall_time_s,
        readings={name: found for reader in readers for name, found in reader.read(run).items()},
        # Of soil that dilates, and of the middle of a body that spreads sideways.
        volume=None if np.array_equal(volume, run.initial_volume) else volume,
    )


def arrays_of_run(run: KeptRun) -> dict[str, np.ndarray]:
    """A run as it is kept in a file."""
    arrays = {
        "initial": run.initial,
        "final": run.final,
        "zone": run.zone,
        "initial_volume": run.initial_volume,
        "vertical_stress": run.vertical_stress,
        "status": np.array(run.status),
        "reason": np.array(run.reason),
        "numbers": np.array([run.end_s, float(run.at_rest), run.wall_time_s]),
    }
    if run.volume is not None:
        arrays["volume"] = run.volume
    for name in sorted(run.readings):
        arrays[f"{_READ}{name}"] = run.readings[name].values
        arrays[f"{_TROUBLE}{name}"] = np.array(run.readings[name].trouble)
    return arrays


def run_of_arrays(arrays: dict[str, np.ndarray]) -> KeptRun:
    """A run from the arrays of its file.

    Raises:
        KeyError: one is missing.
        ValueError: there is one that no run has.
    """
    if any(not name.startswith((_READ, _TROUBLE)) for name in set(arrays) - _ARRAYS):
        raise ValueError("not a run")
    end, at_rest, wall_time = (float(value) for value in arrays["numbers"])
    return KeptRun(
        initial=arrays["initial"],
        final=arrays["final"],
        zone=arrays["zone"],
        initial_volume=arrays["initial_volume"],
        vertical_stress=arrays["vertical_stress"],
        status=str(arrays["status"]),
        reason=str(arrays["reason"]),
        end_s=end,
        at_rest=bool(at_rest),
        wall_time_s=wall_time,
        volume=arrays.get("volume"),
        readings={
            name.removeprefix(_READ): Reading(
                values, str(arrays[_TROUBLE + name.removeprefix(_READ)])
            )
            for name, values in arrays.items()
            if name.startswith(_READ)
        },
    )


def is_of(run: KeptRun, scene: Scene) -> bool:
    """The arrays are as long as each other, and their points cover the section.

    A file that is whole may still be another program's, or have been cut and sealed again.
    """
    arrays = (run.initial, run.final, run.zone, run.initial_volume, run.vertical_stress)
    lengths = {len(values) for values in arrays}
    covered = float(run.initial_volume.sum())
    section = sum(area(zone.polygon) for zone in scene.zones)
    return len(lengths) == 1 and abs(covered - section) <= AREA_OFF * section
