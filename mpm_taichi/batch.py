"""Many scenes into one trajectory file; a kill at any moment costs only the runs under way.

In: scenes with their numbers, settings. Out: `batch_BBB.h5` with one group per scene. Each finished
run goes at once into a small file of its own under `.batch_BBB.parts/`; when all are there they are
merged in the order of their numbers and the folder is removed. A part is used again only if it was
made from the same scene, settings, device and physics, so the merged data do not depend on
interruptions.
"""

from __future__ import annotations

import json
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import h5py

import geometry
from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.effects import key_of_effects
from mpm_taichi.materials.registry import key_of_law
from mpm_taichi.trajectory import Run, RunSummary, group_name, list_runs, run_indices, summary
from mpm_taichi.trajectory import write_run as _write_run
from pipeline.cli import InputError, WorkFailed
from pipeline.files import atomic_path, content_hash, only_one

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

RAISED = "the solver raised"

Simulate = Callable[..., Sequence[Run]]
"""The solver: `simulate(scenes, settings, *, device, threads, on_finished) -> runs`."""


@dataclass(frozen=True)
class BatchResult:
    """Result of a batch."""

    path: Path
    runs: list[RunSummary]
    reused: int  # runs that were already there

    @property
    def failures(self) -> list[RunSummary]:
        """The runs that failed, in the order of their numbers."""
        return [run for run in self.runs if run.status == "failed"]


def run_key(scene: Scene, settings: SimulationSettings, device: str) -> str:
    """Hash of everything the numbers of a run depend on (16 hexadecimal digits).

    Effects that are off leave no trace in it, and other ways to write the same effects none either.

    Raises:
        InputError: the scene has an effect or a law that does not exist, or a number out of range.
    """
    effects = key_of_effects(scene)
    return content_hash(
        {
            "scene": scene.model_copy(update={"effects": {}}) if scene.effects else scene,
            "settings": settings,
            "device": device,
            "physics": PHYSICS_VERSION,
            "geometry": geometry.PHYSICS_VERSION,
            **effects,
            **key_of_law(scene),
        }
    )


def parts_folder(path: str | Path) -> Path:
    """Where the finished runs of the unfinished batch `path` are kept."""
    path = Path(path)
    return path.with_name(f".{path.stem}.parts")


def run_batch(
    scenes: Mapping[int, Scene],
    settings: SimulationSettings,
    path: str | Path,
    *,
    device: str = "cpu",
    threads: int | None = None,
    group_size: int | None = None,
    simulate: Simulate | None = None,
    on_run: Callable[[RunSummary], None] | None = None,
) -> BatchResult:
    """Simulate `scenes` into the trajectory file `path`, continuing what an earlier start left.

    A run that fails is recorded with its reason and does not stop the others; neither does a scene
    on which the solver raises (such a scene is tried again at the next start).

    Args:
        scenes: number of the run -> scene.
        settings: the same for all of them.
        path: the trajectory file; complete when it exists.
        device: "cpu" or "cuda".
        threads: CPU threads; None for all.
        group_size: scenes handed to the solver at once; bounds the memory, not the result.
        simulate: the solver; None for `mpm_taichi.simulate.simulate`.
        on_run: called with every run once it is on the disk, also with those found there.

    Raises:
        InputError: the solver refuses the settings or a scene.
        WorkFailed: stopped by SIGTERM, or no scene at all could be run.
    """
    path = Path(path)
    if not scenes:
        raise InputError(f"{path}: no scenes to simulate")
    if simulate is None:
        from mpm_taichi.simulate import simulate
    keys = {index: run_key(scenes[index], settings, device) for index in sorted(scenes)}
    parts = parts_folder(path)
    busy = f"{parts}: another process is working on this batch"
    with only_one(parts, busy), _StopRequest() as stop:
        store = _Store(path, keys, stop)
        for kept in store.found.values():
            _tell(on_run, kept)
        reused = len(store.found)
        waiting = iter([index for index in keys if index not in store.found])
        try:
            while group := list(islice(waiting, group_size or default_group_size(device))):
                _run_group(
                    {index: scenes[index] for index in group},
                    lambda some, done: simulate(
                        some, settings, device=device, threads=threads, on_finished=done
                    ),
                    lambda index, run: _tell(on_run, store.save(index, run)),
                    lambda scene, reason: Run.empty(scene, settings, reason=reason),
                )
            store.merge()
        except Stopped:
            raise WorkFailed(
                f"stopped; {len(store.found)} of {len(keys)} runs are kept, start again to continue"
            ) from None
    runs = list_runs(path)
    return BatchResult(path=path, runs=runs, reused=reused)


def default_group_size(device: str) -> int:
    """Scenes per group: enough to keep every thread busy, few enough to hold in memory."""
    return 64 if device == "cpu" else 256


def _run_group(
    scenes: dict[int, Scene],
    simulate: Callable[[list[Scene], Callable[[int, Run], None]], Sequence[Run]],
    save: Callable[[int, Run], None],
    failed_run: Callable[[Scene, str], Run],
) -> None:
    """Simulate a group; if the solver raises, do the rest one by one to find out on which scene."""
    indices = list(scenes)
    saved: set[int] = set()

    def finished(position: int, run: Run) -> None:
        if indices[position] not in saved:
            save(indices[position], run)
            saved.add(indices[position])

    try:
        runs = simulate([scenes[index] for index in indices], finished)
        for position, run in enumerate(runs):
            finished(position, run)
        if missing := [index for index in indices if index not in saved]:
            raise RuntimeError(f"no result for run {missing[0]}")
    except InputError:
        raise
    except Exception as error:
        if len(indices) == 1:
            run = failed_run(
                scenes[indices[0]], f"{RAISED} {type(error).__name__}: {_brief(error)}"
            )
            run.audit["raised"] = 1
            finished(0, run)
            return
        for index in indices:
            if index not in saved:
                _run_group({index: scenes[index]}, simulate, save, failed_run)


def _brief(error: Exception) -> str:
    """The message in one line: without the marks below source lines, and of a long one the end."""
    words = [word for word in str(error).split() if set(word) - set("^~")]
    text = " ".join(words)
    return text if len(text) <= 300 else f"... {text[-300:]}"


class _Store:
    """The runs of one batch on the disk: parts, an earlier merged file, and the merge."""

    def __init__(self, path: Path, keys: dict[int, str], stop: _StopRequest) -> None:
        self.path = path
        self.parts = parts_folder(path)
        self.keys = keys
        self.stop = stop
        self.found: dict[int, RunSummary] = {}
        self.sources: dict[int, Path] = {}
        self.parts.mkdir(parents=True, exist_ok=True)
        for source in (path, *sorted(self.parts.glob("run_*.h5"))):
            self._take(source)

    def save(self, index: int, run: Run) -> RunSummary:
        """Put one finished run on the disk; a stop request waits until that is done."""
        part = self.parts / f"{group_name(index)}.h5"
        with self.stop.held():
            with atomic_path(part) as temporary, h5py.File(temporary, "w") as file:
                _write_run(file, index, run, key=self.keys[index])
                self.found[index] = summary(file[group_name(index)], index)
            self.sources[index] = part
        return self.found[index]

    def merge(self) -> None:
        """All parts into the final file in the order of their numbers; then the parts go."""
        if all(run.reason.startswith(RAISED) for run in self.found.values()):
            first = next(iter(self.found.values()))
            raise WorkFailed(f"none of the {len(self.found)} scenes could be run: {first.reason}")
        with self.stop.held():
            if set(self.sources.values()) != {self.path} or not self._is_exactly_ours():
                with atomic_path(self.path) as temporary, h5py.File(temporary, "w") as merged:
                    for index in self.keys:
                        with h5py.File(self.sources[index], "r") as part:
                            # Compressed chunks are copied as they are.
                            part.copy(group_name(index), merged)
            shutil.rmtree(self.parts, ignore_errors=True)

    def _take(self, source: Path) -> None:
        """Note the runs of `source` made from exactly our input; a damaged file has none."""
        if not source.exists():
            return
        with suppress(OSError, KeyError, RuntimeError, ValueError), h5py.File(source, "r") as file:
            for index in run_indices(file):
                group = file[group_name(index)]
                run = summary(group, index)
                raised = json.loads(group.attrs["audit"]).get("raised")
                if index not in self.found and run.key == self.keys.get(index) and not raised:
                    self.found[index] = run
                    self.sources[index] = source

    def _is_exactly_ours(self) -> bool:
        with h5py.File(self.path, "r") as file:
            return run_indices(file) == list(self.keys)


class Stopped(BaseException):
    """SIGTERM arrived. Not an Exception: nothing on the way up may take it for a failed scene."""


class _StopRequest:
    """Turns SIGTERM into `Stopped`, but not in the middle of writing a file."""

    def __init__(self) -> None:
        self._held = False
        self._wanted = False
        self._previous: object = None
        self._active = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> _StopRequest:
        if self._active:
            self._previous = signal.signal(signal.SIGTERM, self._receive)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._active:
            signal.signal(signal.SIGTERM, self._previous)

    @contextmanager
    def held(self) -> Iterator[None]:
        """A stretch that is finished before a stop takes effect."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
        if self._wanted:
            raise Stopped

    def _receive(self, number: int, frame: object) -> None:
        self._wanted = True
        if not self._held:
            self._stop()

    def _stop(self) -> NoReturn:
        raise Stopped


def _tell(on_run: Callable[[RunSummary], None] | None, run: RunSummary) -> None:
    if on_run is not None:
        on_run(run)
