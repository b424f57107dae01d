"""Simulations kept by content: the same scene and settings are computed once.

A finished run goes at once into a small file whose name is the hash of all that decides its
numbers, so a back-analysis that was killed continues where it stopped, and a question that is asked
again costs nothing. Measurements are read on a kept run by `prediction_of`.
"""

from __future__ import annotations

import os
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib import format as npy

from geometry.scenes.overburden import stress_by_zone
from geometry.scenes.polygon_checks import area
from geometry.survey.measured import Deposit, Reading
from inversion.engines.workers import Job, Workers
from inversion.estimation.data import read, toes_by_eye
from inversion.estimation.forward import Prediction, Setup
from inversion.problem.question import RESIDUAL_STRENGTH
from mpm_taichi.batch import run_key
from mpm_taichi.effects import has_own_code
from pipeline.files import atomic_path

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from inversion.estimation.forward import HistoryReader, Setup
    from mpm_taichi.simulate import Wanted
    from mpm_taichi.trajectory import Run
    from pipeline.config import SimulationSettings


# What zipfile and numpy raise on a file that is cut short or damaged, depending on where. Of memory
# where a header claims more than there is.
DAMAGE = (
    OSError, KeyError, ValueError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
#: Area of the points over that of the section, as far off as it can be by where points are put.
AREA_OFF = 0.3

_ARRAYS = {
    "initial", "final", "zone", "vertical_stress", "volume", "status", "reason", "numbers"
}  # fmt: skip
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
    vertical_stress: np.ndarray
    status: str
    reason: str
    end_s: float
    at_rest: bool
    wall_time_s: float
    readings: dict[str, Reading] = field(default_factory=dict)
    volume: np.ndarray | None = None


class RunStore:
    """Runs by content, in memory and in a folder.

    Args:
        folder: of the files; None: in memory alone.
        device: "cpu" or "cuda".
        threads: CPU threads; None: all.
        on_run: called for each run of a batch.
    """

    def __init__(
        self,
        folder: str | Path | None,
        *,
        device: str = "cpu",
        threads: int | None = None,
        on_run: OnRun | None = None,
    ) -> None:
        self.folder = None if folder is None else Path(folder)
        self.device = device
        self.threads = threads
        self.on_run = on_run
        self.computed = 0
        self._kept: dict[str, KeptRun] = {}
        self._workers: Workers | None = None
        self._keeping = Lock()

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
        if self._workers is not None:
            self._workers.side_by_side(jobs)
            return
        for job in jobs:
            job()

    def refused(self, setup: Setup) -> str:
        """Why it does not simulate a setup; empty: it does."""
        return ""

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
        ((_, run),) = self._workers.simulate([(scene, settings) for scene in scenes])
        return [run]

    def _is_there(self, key: str, scene: Scene, readers: Iterable[HistoryReader]) -> bool:
        run = self._kept.get(key)
        if run is None and self.folder is not None:
            run = load_kept(self._path(key))
            if run is not None and is_of(run, scene):
                self._kept[key] = run
            else:
                run = None
        return run is not None and all(
            name in run.readings for reader in readers for name in reader.wanted
        )

    def _compute(
        self,
        missing: dict[str, tuple[Scene, SimulationSettings]],
        readers: dict[str, list[HistoryReader]],
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
        with self._keeping:
            self.computed += 1
            if key in self._kept:  # it was there, but without some reading
                run = replace(run, readings={**self._kept[key].readings, **run.readings})
            self._kept[key] = run
        if self.folder is not None:
            save_kept(self._path(key), run)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"


def kept_run(run: Run, readers: Iterable[HistoryReader] = ()) -> KeptRun:
    """The stored part of a run, with the readings of `readers`."""
    end = float(run.time[-1]) if len(run.time) else 0.0
    volume = run.bulk_volume
    return KeptRun(
        initial=run.positions[0].copy(),
        final=run.positions[-1].copy(),
        zone=run.zone,
        vertical_stress=-run.initial_stress[:, 1],
        status=run.status,
        reason=run.reason,
        end_s=end,
        at_rest=run.came_to_rest,
        wall_time_s=run.wall_time_s,
        readings={name: found for reader in readers for name, found in reader.read(run).items()},
        volume=volume if isinstance(volume, np.ndarray) else None,
    )


def save_kept(path: Path, run: KeptRun) -> None:
    """Write a run; the file appears when whole."""
    arrays = {
        "initial": run.initial,
        "final": run.final,
        "zone": run.zone,
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
    write_arrays(path, arrays)


def load_kept(path: Path) -> KeptRun | None:
    """Read a run; None where there is none, or where the file is damaged."""
    try:
        # Opened here: numpy leaves a damaged file open.
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        if any(not name.startswith((_READ, _TROUBLE)) for name in set(arrays) - _ARRAYS):
            return None
        end, at_rest, wall_time = (float(value) for value in arrays.pop("numbers"))
        return KeptRun(
            **{name: arrays.pop(name) for name in ("initial", "final", "zone", "vertical_stress")},
            status=str(arrays.pop("status")),
            reason=str(arrays.pop("reason")),
            end_s=end,
            at_rest=bool(at_rest),
            wall_time_s=wall_time,
            volume=arrays.pop("volume", None),
            readings={
                name.removeprefix(_READ): Reading(
                    values, str(arrays[_TROUBLE + name.removeprefix(_READ)])
                )
                for name, values in arrays.items()
                if name.startswith(_READ)
            },
        )
    except DAMAGE:
        return None


def is_of(run: KeptRun, scene: Scene) -> bool:
    """The arrays are as long as each other, and their points cover the section.

    A file that is whole may still be another program's, or have been cut and sealed again.
    """
    lengths = {len(run.initial), len(run.final), len(run.zone), len(run.vertical_stress)}
    covered = len(run.initial) * scene.spacing**2
    section = sum(area(zone.polygon) for zone in scene.zones)
    return len(lengths) == 1 and abs(covered - section) <= AREA_OFF * section


def write_arrays(path: str | Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an NPZ file, atomically, whose bytes depend on the arrays alone.

    `numpy.savez` puts the time of day into the file; a killed and continued back-analysis must
    leave the same bytes.
    """
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, values in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w", force_zip64=True) as file:
                npy.write_array(file, np.asanyarray(values), allow_pickle=False)


def read_start(setup: Setup, run: KeptRun) -> np.ndarray:
    """The measurements read on the section before anything moved, (m,)."""
    return read(setup.targets, deposit_of(setup, run, last=False))[0]


def prediction_of(setup: Setup, run: KeptRun, at_start: np.ndarray | None = None) -> Prediction:
    """Read the measurements on a run; `at_start` is `read_start` where that is known."""
    end = deposit_of(setup, run)
    failed = run.status == "failed"
    values, trouble = read(setup.targets, end, run.readings)
    if failed:
        values = np.full(len(values), np.nan)
    if at_start is None:
        at_start = read_start(setup, run)
    mean, spread = _sigma_v0(setup, run)
    broken = failed or not np.all(np.isfinite(values[setup.targets.fitted]))
    return Prediction(
        values=values,
        at_start=at_start,
        by_eye={} if failed else toes_by_eye(setup.targets, end),
        positions=run.final,
        status="failed" if broken else "finished",
        reason=run.reason or trouble,
        sigma_v0_kpa=mean,
        sigma_v0_std_kpa=spread,
        run_time_s=run.wall_time_s,
        at_rest=run.at_rest or failed,
        spacing_m=setup.scene.spacing,
    )


def deposit_of(setup: Setup, run: KeptRun, *, last: bool = True) -> Deposit:
    """The points of a run as measurements see them: after the slide, or before it."""
    return Deposit.on(
        setup.scene,
        setup.foot,
        (run.final if last else run.initial).astype(float),
        run.initial.astype(float),
        volume=run.volume if last else None,
        at_rest=run.at_rest or not last,
    )


def _sigma_v0(setup: Setup, run: KeptRun) -> tuple[np.ndarray, np.ndarray]:
    """Mean and spread of the vertical effective stress over each S_r's zones, (p,) [kPa]."""
    gravity = setup.settings.gravity_m_per_s2
    stress = stress_by_zone(setup.scene, run.initial.astype(float), run.zone, gravity)
    mean, spread = [], []
    for spec in setup.parameters.specs:
        own = [stress[name] for name in spec.zones if name in stress]
        known = spec.property == RESIDUAL_STRENGTH and own
        mean.append(float(np.concatenate(own).mean()) if known else np.nan)
        spread.append(float(np.concatenate(own).std()) if known else np.nan)
    return np.array(mean), np.array(spread)
