"""One simulated run, and the HDF5 file that holds many of them.

In: a `Run`, the result of one simulated scene. Out: the group `run_NNNNN` of a trajectory file
(`batch_BBB.h5`), and back. Big arrays are datasets; all that describes them (scene, settings,
energy and mass audit, versions, wall time) is an attribute of the group. The bytes of the datasets
depend on the scene, the settings and the physics alone, never on the clock or on a restart.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.effects import changes_volume
from pipeline.cli import InputError
from pipeline.files import atomic_path
from pipeline.manifest import code_version

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

FORMAT_VERSION = 2

# Point fields in addition to the positions: (shape after the point axis, dtype). Meanings, units:
# `Run`.
POINT_FIELDS: dict[str, tuple[tuple[int, ...], type]] = {
    "material": ((), np.int32),
    "zone": ((), np.int32),
    "kinematic": ((), np.bool_),
    "velocity": ((2,), np.float32),
    "stress": ((4,), np.float32),
    "initial_stress": ((4,), np.float32),
    "plastic_shear_strain": ((), np.float32),
    "initial_volume": ((), np.float32),
    "volume": ((), np.float32),
}
FIELDS = ("positions", "time", *POINT_FIELDS, "energy")

# Measured on a run of the Lower San Fernando section, 176 frames of 6,242 points, 8.8 MB raw:
# chunks (32, 512, 1) with shuffle and gzip 1 give 4.1 MB, 0.1 s to write, 0.04 s to read, 5 ms for
# a window of 6 frames. x and y in one chunk: 4.8 MB; no shuffle: 7.0 MB; one frame a chunk: 6.0 MB;
# gzip 4: 3 % smaller, half as slow again; all frames in a chunk: 4.0 MB, but 30 ms for a window.
COMPRESSION_LEVEL = 1
POSITION_CHUNK = (32, 512, 1)

_GROUP = re.compile(r"run_(\d{5,})")
# What h5py raises on a file that is cut short or damaged, depending on where the damage is.
_DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError)


@dataclass
class Run:
    """The result of one scene. T frames, N material points, SI units, stress tension positive.

    A failed run keeps its frames up to the failure (possibly none); `reason` says what happened.
    """

    scene: Scene
    settings: SimulationSettings
    positions: np.ndarray  # (T, N, 2) float32 [m]
    time: np.ndarray  # (T,) float64 [s]
    material: np.ndarray  # (N,) int32, index into scene.material_names
    zone: np.ndarray  # (N,) int32, index into scene.zones
    kinematic: np.ndarray  # (N,) bool
    velocity: np.ndarray  # (N, 2) float32 [m/s], final
    stress: np.ndarray  # (N, 4) float32 [Pa] xx, yy, zz, xy, final
    initial_stress: np.ndarray  # (N, 4) float32 [Pa], after settling, at t = 0
    plastic_shear_strain: np.ndarray  # (N,) float32 [-], final
    initial_volume: np.ndarray  # (N,) float32 [m2 per metre of width]
    volume: np.ndarray  # (N,) float32 [m2 per metre of width], final
    energy: dict[str, np.ndarray] = field(default_factory=dict)  # name -> (T,) float64 [J/m]
    audit: dict[str, float | int | str] = field(default_factory=dict)
    status: str = "finished"  # "finished" | "failed"
    reason: str = ""
    wall_contact: dict[str, Any] = field(default_factory=dict)  # "left"/"right" -> since when [s]
    wall_time_s: float = 0.0
    steps: int = 0
    # Name -> (N,) float32, final, of effects with a part on the host; not kept in files.
    effect_fields: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def empty(cls, scene: Scene, settings: SimulationSettings, *, reason: str) -> Run:
        """A failed run with no frames and no points: the scene could not even be started."""
        arrays = {
            name: np.zeros((0, *trailing), dtype)
            for name, (trailing, dtype) in POINT_FIELDS.items()
        }
        return cls(
            scene=scene,
            settings=settings,
            positions=np.zeros((0, 0, 2), np.float32),
            time=np.zeros(0),
            **arrays,
            status="failed",
            reason=reason,
        )

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return self.positions.shape[0]

    @property
    def points(self) -> int:
        """Number of material points N."""
        return self.positions.shape[1]

    @property
    def failed(self) -> bool:
        """True when a guard stopped the run or it could not be run."""
        return self.status == "failed"

    @property
    def came_to_rest(self) -> bool:
        """True where the run ended by itself: neither failed nor cut off by `duration_s` in motion.

        A run is cut off at the frame nearest to its duration, which may lie half a frame before it.
        """
        if self.failed or len(self.time) < 2:
            return False
        frame_time = float(self.time[1] - self.time[0])
        return bool(self.time[-1] < self.settings.duration_s - 0.501 * frame_time)

    @property
    def bulk_volume(self) -> np.ndarray:
        """Volume of the points as a survey of the deposit sees it, (N,) float64 [m2].

        The volume they began with, since a point's elastic expansion is not soil; where an effect
        lets soil dilate or contract, what each has at the end.
        """
        if changes_volume(self.scene):
            return self.volume.astype(float)
        return self.initial_volume.astype(float)

    @property
    def end_time_s(self) -> float:
        """Time of the failure if there was one and it was noted, else of the last frame [s]."""
        if "failed_at_s" in self.audit:
            return float(self.audit["failed_at_s"])
        return float(self.time[-1]) if len(self.time) else 0.0


@dataclass(frozen=True)
class RunSummary:
    """One line about a run in a file, read from attributes alone (no array is loaded)."""

    index: int
    scene: str
    template: str  # letter of the random template; empty for a scene made by hand
    seed: int
    points: int
    frames: int
    steps: int
    duration_s: float
    wall_time_s: float
    point_steps_per_s: float
    status: str
    reason: str
    wall_contact: str
    travel_left_m: float
    travel_right_m: float
    key: str


def outward_travel(
    first: np.ndarray, last: np.ndarray, share: float = 0.005
) -> tuple[float, float]:
    """How far the mass spread to the left and to the right [m], for lists and statistics.

    The outer edges are the quantiles `share` and 1 - share of the points' x, so that no single
    stray point decides. The measured toe runout is `geometry.survey.toe_runout`, not
    this.

    Args:
        first: positions of the points before (N, 2) [m].
        last: positions of the same points after (N, 2) [m].
        share: share of the points beyond the edge.
    """
    if len(first) == 0:
        return 0.0, 0.0
    left_before, right_before = np.quantile(first[:, 0], [share, 1.0 - share])
    left_after, right_after = np.quantile(last[:, 0], [share, 1.0 - share])
    return float(left_before - left_after), float(right_after - right_before)


_code_version = cache(code_version)  # asks git: once per process is enough


def group_name(index: int) -> str:
    """Name of the group of run `index`."""
    return f"run_{index:05d}"


def write_run(file: h5py.File, index: int, run: Run, *, key: str = "") -> None:
    """Write one run as the group `run_NNNNN` of an open HDF5 file.

    Args:
        file: open for writing.
        index: the run's number; for generated scenes the number of the scene.
        run: what to write.
        key: hash of what the run was made from; a restarted batch uses it to recognise its runs.
    """
    _check_shapes(run)
    group = file.create_group(group_name(index))
    frames, points = run.frames, run.points
    _write_array(
        group,
        "positions",
        run.positions.astype(np.float32, copy=False),
        chunks=tuple(map(min, zip(POSITION_CHUNK, run.positions.shape, strict=True))),
    )
    _write_array(group, "time", run.time.astype(np.float64, copy=False))
    for name, (_, dtype) in POINT_FIELDS.items():
        _write_array(group, name, getattr(run, name).astype(dtype, copy=False))
    energy = group.create_group("energy")
    for name, values in sorted(run.energy.items()):
        _write_array(energy, name, np.asarray(values, np.float64))

    travel = outward_travel(run.positions[0], run.positions[-1]) if frames else (0.0, 0.0)
    finite_travel = [value if np.isfinite(value) else 0.0 for value in travel]
    group.attrs.update(
        {
            "format_version": FORMAT_VERSION,
            "physics_version": PHYSICS_VERSION,
            "code_version": _code_version(),
            "key": key,
            "scene": run.scene.model_dump_json(),
            "settings": run.settings.model_dump_json(),
            "audit": json.dumps(run.audit, sort_keys=True, default=_plain),
            "wall_contact": json.dumps(run.wall_contact, sort_keys=True, default=_plain),
            "status": run.status,
            "reason": run.reason,
            "name": run.scene.name,
            "template": run.scene.origin.template if run.scene.origin else "",
            "seed": int(run.scene.seed),
            "points": points,
            "frames": frames,
            "steps": int(run.steps),
            "duration_s": run.end_time_s,
            "travel_left_m": finite_travel[0],
            "travel_right_m": finite_travel[1],
            "wall_time_s": float(run.wall_time_s),
        }
    )


def write_runs(path: str | Path, runs: Mapping[int, Run]) -> None:
    """Write a whole trajectory file at once, under a temporary name until it is complete."""
    with atomic_path(Path(path)) as temporary, h5py.File(temporary, "w") as file:
        for index in sorted(runs):
            write_run(file, index, runs[index])


def read_run(path: str | Path, index: int, fields: Sequence[str] | None = None) -> Run:
    """Read one run of a trajectory file.

    Args:
        path: trajectory file.
        index: number of the run, as in its group's name.
        fields: arrays to load, of `FIELDS`; None for all. The others are left empty (no points).

    Raises:
        InputError: no such file or run, an unknown field, or a damaged file.
    """
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

    wanted = set(FIELDS if fields is None else fields)
    if unknown := wanted - set(FIELDS):
        raise InputError(f"field {sorted(unknown)[0]!r} is unknown; allowed: {', '.join(FIELDS)}")
    with _reading(path) as file:
        group = _find(file, path, index)
        attributes = group.attrs
        scene = Scene.model_validate_json(attributes["scene"])
        settings = SimulationSettings.model_validate_json(attributes["settings"])
        run = Run.empty(scene, settings, reason=attributes["reason"])
        for name in wanted - {"energy"}:
            setattr(run, name, _array(group, name, scene))
        if "energy" in wanted:
            run.energy = {name: values[...] for name, values in group["energy"].items()}
        run.status = attributes["status"]
        run.audit = json.loads(attributes["audit"])
        run.wall_contact = json.loads(attributes["wall_contact"])
        run.wall_time_s = float(attributes["wall_time_s"])
        run.steps = int(attributes["steps"])
        frames, points = int(attributes["frames"]), int(attributes["points"])
        _check_read(run, wanted, frames, points, f"{path}: {group_name(index)}")
    return run


def _array(group: h5py.Group, name: str, scene: Scene) -> np.ndarray:
    """An array of a run; in files of format 1 every point had the volume of a square."""
    if name == "initial_volume" and int(group.attrs["format_version"]) < 2:
        return np.full(int(group.attrs["points"]), scene.spacing**2, np.float32)
    return group[name][...]


def _check_read(run: Run, wanted: Collection[str], frames: int, points: int, where: str) -> None:
    """Refuse arrays that are not of the size that the run states, or that name no zone."""
    expected = {"positions": (frames, points, 2), "time": (frames,)}
    expected |= {name: (points, *trailing) for name, (trailing, _) in POINT_FIELDS.items()}
    found = {name: getattr(run, name) for name in expected if name in wanted}
    found |= {f"energy/{name}": values for name, values in run.energy.items()}
    for name, values in found.items():
        shape = expected.get(name, (frames,))
        if values.shape != shape or values.dtype.kind not in "fiub":
            raise InputError(
                f"{where}: {name}: {values.dtype} {values.shape}, but the run says numbers "
                f"{shape}; the file is cut short or damaged"
            )
    for name, known in (("material", run.scene.materials), ("zone", run.scene.zones)):
        values = found.get(name, np.zeros(0))
        if values.size and not (values.min() >= 0 and values.max() < len(known)):
            raise InputError(
                f"{where}: {name}: {values.min()} to {values.max()}; its scene has 0 to "
                f"{len(known) - 1}"
            )
    for name in ("audit", "wall_contact"):
        if not isinstance(getattr(run, name), dict):
            raise InputError(f"{where}: {name}: is not a mapping; the file is damaged")


def list_runs(path: str | Path) -> list[RunSummary]:
    """All runs of a trajectory file in order of their numbers, without loading an array.

    Raises:
        InputError: no such file, or not a whole trajectory file.
    """
    with _reading(path) as file:
        return [summary(file[group_name(index)], index) for index in run_indices(file)]


def run_indices(file: h5py.File) -> list[int]:
    """Numbers of the runs in an open trajectory file, ascending."""
    return sorted(int(found[1]) for name in file if (found := _GROUP.fullmatch(name)))


def summary(group: h5py.Group, index: int) -> RunSummary:
    """The one-line description of a run's group."""
    attributes = group.attrs
    points, steps = int(attributes["points"]), int(attributes["steps"])
    wall_time = float(attributes["wall_time_s"])
    contact = json.loads(attributes["wall_contact"])
    return RunSummary(
        index=index,
        scene=attributes["name"],
        template=attributes["template"],
        seed=int(attributes["seed"]),
        points=points,
        frames=int(attributes["frames"]),
        steps=steps,
        duration_s=float(attributes["duration_s"]),
        wall_time_s=wall_time,
        point_steps_per_s=points * steps / wall_time if wall_time > 0 else 0.0,
        status=attributes["status"],
        reason=attributes["reason"],
        wall_contact="+".join(
            sorted(
                side for side, since in contact.items() if since is not None and since is not False
            )
        ),
        travel_left_m=float(attributes["travel_left_m"]),
        travel_right_m=float(attributes["travel_right_m"]),
        key=attributes["key"],
    )


@contextmanager
def _reading(path: str | Path) -> Iterator[h5py.File]:
    """Open a trajectory file for reading; whatever is wrong with it becomes one line."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            if not run_indices(file):
                raise InputError(f"{path}: holds no run_NNNNN group; is it a trajectory file?")
            yield file
    except InputError:
        raise
    except _DAMAGE as error:
        detail = " ".join(str(error).split())[:160]
        raise InputError(
            f"{path}: cannot be read, damaged or not a trajectory file ({detail})"
        ) from error


def _find(file: h5py.File, path: str | Path, index: int) -> h5py.Group:
    """The group of run `index`, or an error that says which runs there are."""
    name = group_name(index)
    if name not in file:
        indices = run_indices(file)
        raise InputError(
            f"{path}: no run {index}; it holds {len(indices)} runs, {indices[0]} to {indices[-1]}"
        )
    return file[name]


def _check_shapes(run: Run) -> None:
    """Refuse to write arrays that contradict each other (a defect of the caller)."""
    expected = {"positions": (len(run.time), run.points, 2)}
    for name, (trailing, _) in POINT_FIELDS.items():
        expected[name] = (run.points, *trailing)
    for name, shape in expected.items():
        if getattr(run, name).shape != shape:
            raise ValueError(f"run.{name} has shape {getattr(run, name).shape}, expected {shape}")
    for name, values in run.energy.items():
        if len(values) != run.frames:
            raise ValueError(
                f"run.energy[{name!r}] has {len(values)} values for {run.frames} frames"
            )


def _write_array(
    group: h5py.Group, name: str, values: np.ndarray, chunks: tuple[int, ...] | None = None
) -> None:
    """One dataset, chunked and compressed; HDF5 wants neither for an empty array."""
    if values.size == 0:
        group.create_dataset(name, data=values)
        return
    group.create_dataset(
        name,
        data=values,
        chunks=chunks or values.shape,
        shuffle=True,
        compression="gzip",
        compression_opts=COMPRESSION_LEVEL,
    )


def _plain(value: Any) -> Any:
    """NumPy scalars and arrays as JSON values."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be stored in a trajectory's attributes")


def refuse_empty(run: Run) -> None:
    """Raise an `InputError` for a run that has nothing to draw."""
    if run.frames == 0 or run.points == 0:
        raise InputError(f"{run.scene.name}: the run has no frames to draw ({run.reason})")


def nearest_frame(run: Run, time: float) -> int:
    """Number of the frame nearest to `time` [s]; after a run has ended, the last.

    Raises:
        InputError: before the slide, or after the time that was to be simulated.
    """
    refuse_empty(run)
    end = max(float(run.time[-1]), run.settings.duration_s)
    if not 0.0 <= time <= end:
        raise InputError(f"{run.scene.name}: no frame at {time:g} s; allowed are 0 to {end:g} s")
    return int(np.argmin(np.abs(run.time - time)))


def file_and_run(text: str) -> tuple[str, int | None]:
    """`FILE:12` -> ("FILE", 12); `FILE` -> ("FILE", None)."""
    found = re.fullmatch(r"(.+):(?:run_)?(\d+)", text)
    return (found[1], int(found[2])) if found else (text, None)


def run_named(text: str) -> tuple[str, int]:
    """The run that `FILE[:RUN]` names; the number may be left out if there is one run only."""
    path, index = file_and_run(text)
    if index is not None:
        return path, index
    indices = [run.index for run in list_runs(path)]
    if len(indices) > 1:
        raise InputError(
            f"{path}: holds {len(indices)} runs; name one of {indices[0]} to {indices[-1]}, "
            f"for instance {path}:{indices[0]}"
        )
    return path, indices[0]
