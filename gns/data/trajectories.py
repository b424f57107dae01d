"""The trajectory files that are packed: which runs they hold, and whether they belong together.

In: `batch_BBB.h5` files. Out: one `Source` a run, read from attributes alone, and those to leave
out, each with its reason. Runs of different scales, spacings, gravity or frame intervals are
refused in one line, and so is what is damaged or written by another version.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gns.data.scene_facts import start_of
from gns.data.shard import PackedRun
from gns.data.statistics import run_moments
from mpm_taichi.trajectory import FORMAT_VERSION, group_name, read_run, run_indices
from pipeline.cli import InputError
from pipeline.files import content_hash

LEAST_FRAMES = 2
"""A run with fewer shows no motion."""

FARTHEST_START = 0.1
"""Farthest a point may start from where the scene has it [spacings]."""

_ALIKE = {
    "scale": "scale",
    "spacing_m": "spacing",
    "gravity_m_per_s2": "simulation.gravity_m_per_s2",
    "frame_interval": "simulation.frame_interval",
    "water": "simulation.water",
    "physics_version": "physics_version",
}
"""Properties shared by all runs of a data set, and its name."""


@dataclass(frozen=True)
class Source:
    """One run in a trajectory file.

    Attributes:
        number: of the run, as in its group's name.
        path: of the file.
        template: letter; "" for a scene made by hand.
        frames, points: T, N.
        key: hash of all that the numbers of the run depend on.
        failed: why it is not usable, "" where it is.
        alike: the values of `_ALIKE`.
    """

    number: int
    path: Path
    template: str
    frames: int
    points: int
    key: str
    failed: str
    alike: Mapping[str, Any]


def list_sources(paths: Sequence[str | Path]) -> list[Source]:
    """The runs of trajectory files in the order of their numbers.

    Raises:
        InputError: a file that cannot be read, another version, a run that is there twice, or runs
            that do not belong together.
    """
    if not paths:
        raise InputError("no trajectory files; name them, or give --scale")
    sources: dict[int, Source] = {}
    for path in paths:
        for source in _sources_of(Path(path)):
            if source.number in sources:
                raise InputError(
                    f"{path}: run {source.number} is also in {sources[source.number].path}; "
                    "a run has one number in a data set"
                )
            sources[source.number] = source
    ordered = [sources[number] for number in sorted(sources)]
    _check_alike(ordered)
    return ordered


def read_left_out(path: str | Path) -> dict[int, str]:
    """Runs to leave out, from a list like `failed.txt`: number, and after a tab the reason.

    Raises:
        InputError: no such file, or a line that does not begin with a number.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    reasons = {}
    for place, line in enumerate(lines, start=1):
        number, _, reason = line.partition("\t")
        if not line.strip():
            continue
        if not number.strip().isdecimal():
            raise InputError(
                f"{path}: line {place}: {number[:40]!r} is not the number of a run; a line is "
                "NUMBER, a tab, the reason"
            )
        reasons[int(number)] = reason.strip() or "left out by hand"
    return reasons


def read_source(source: Source) -> PackedRun:
    """Read one run and turn it into what is packed.

    Raises:
        InputError: the run is damaged, or contradicts its own scene.
    """
    run = read_run(source.path, source.number, ("positions", "time", "kinematic"))
    where = f"{source.path}: {group_name(source.number)}"
    _check_whole(run.positions, run.time, run.kinematic, source, where)
    facts, start = start_of(run.scene, run.settings)
    if facts.points != run.points:
        raise InputError(
            f"{where}: positions: {run.points} points, but its scene holds {facts.points}"
        )
    off = float(np.max(np.abs(run.positions[0] - start))) / facts.spacing
    if off > FARTHEST_START:
        raise InputError(
            f"{where}: positions: a point starts {off:.2g} spacings from where the scene has it; "
            f"allowed is {FARTHEST_START:g}"
        )
    steps = np.diff(run.time) / facts.frame_time
    if np.any(np.abs(steps - 1.0) > 1e-3):
        raise InputError(
            f"{where}: time: frames are {steps.min() * facts.frame_time:.4g} to "
            f"{steps.max() * facts.frame_time:.4g} s apart; its settings say "
            f"{facts.frame_time:.4g} s"
        )
    velocity, acceleration = run_moments(run.positions, facts)
    return PackedRun(
        positions=run.positions,
        facts=facts,
        moments=np.stack([velocity.stored(), acceleration.stored()]),
        scene=run.scene.model_dump_json(),
    )


def _sources_of(path: Path) -> Iterable[Source]:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            numbers = run_indices(file)
            if not numbers:
                raise InputError(f"{path}: holds no run_NNNNN group; is it a trajectory file?")
            return [_source(path, number, file[group_name(number)]) for number in numbers]
    except InputError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        detail = " ".join(str(error).split())[:160]
        raise InputError(
            f"{path}: cannot be read, damaged or not a trajectory file ({detail})"
        ) from None


def _source(path: Path, number: int, group: h5py.Group) -> Source:
    attributes = group.attrs
    version = int(attributes["format_version"])
    if version != FORMAT_VERSION:
        raise InputError(
            f"{path}: {group_name(number)}: format_version: {version}; this program reads "
            f"{FORMAT_VERSION}: simulate again"
        )
    scene, settings = json.loads(attributes["scene"]), json.loads(attributes["settings"])
    origin = scene.get("origin") or {}
    frames = int(attributes["frames"])
    failed = ""
    if attributes["status"] != "finished":
        failed = str(attributes["reason"]) or "failed"
    elif frames < LEAST_FRAMES:
        failed = f"{frames} frames, at least {LEAST_FRAMES} are needed"
    return Source(
        number=number,
        path=path,
        template=str(attributes["template"]),
        frames=frames,
        points=int(attributes["points"]),
        key=str(attributes["key"]) or content_hash([scene, settings]),
        failed=failed,
        alike={
            "scale": origin.get("scale", ""),
            "spacing_m": float(scene["spacing"]),
            "gravity_m_per_s2": float(settings["gravity_m_per_s2"]),
            "frame_interval": float(settings["frame_interval"]),
            "water": settings["water"],
            "physics_version": int(attributes["physics_version"]),
        },
    )


def _check_alike(sources: Sequence[Source]) -> None:
    first = sources[0]
    for source in sources[1:]:
        for name, words in _ALIKE.items():
            if source.alike[name] != first.alike[name]:
                raise InputError(
                    f"{source.path}: run {source.number}: {words}: {source.alike[name] or 'none'}, "
                    f"but run {first.number} of {first.path} has {first.alike[name] or 'none'}; "
                    "runs of one data set share it"
                )


def _check_whole(
    positions: np.ndarray, time: np.ndarray, kinematic: np.ndarray, source: Source, where: str
) -> None:
    expected = (source.frames, source.points, 2)
    if positions.shape != expected or len(time) != source.frames:
        raise InputError(
            f"{where}: positions: {positions.shape} and {len(time)} times, but the run says "
            f"{expected}; the file is cut short"
        )
    if len(kinematic) != source.points:
        raise InputError(f"{where}: kinematic: {len(kinematic)} values, {source.points} points")
    if not np.all(np.isfinite(positions)):
        frame = int(np.argmin(np.isfinite(positions).all(axis=(1, 2))))
        raise InputError(f"{where}: positions: frame {frame} holds a value that is not finite")
