"""Packing: trajectory files -> shards and metadata that a training reads window by window.

In: `batch_BBB.h5` files. Out: `{train,valid,test}_SSS.npz` (`gns.data.shard`) and, last of all,
`metadata.json` (`gns.data.metadata`). One run is in memory at a time. A shard has a key, the hash
of all that decides its bytes: a start after a kill keeps the shards that are whole and still the
same, and leaves the same bytes as a start that was never killed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import gns
from gns.data.metadata import METADATA_FILE, LeftOut, Metadata, RunEntry, ShardEntry, Statistics
from gns.data.metadata import data_hash as hash_of
from gns.data.ranges import Range, run_ranges, widest
from gns.data.shard import LAYOUT_VERSION, SPLITS, Shard, shard_name, write_shard
from gns.data.splits import split_runs
from gns.data.statistics import Moments, merge
from gns.data.trajectories import Source, list_sources, read_source
from pipeline.cli import InputError
from pipeline.files import content_hash, file_hash, make_folder

if TYPE_CHECKING:
    from pipeline.config import PackSettings

OnRun = Callable[[int, str], None]
"""Called with (runs done since the last call, a few words)."""


@dataclass(frozen=True)
class PackingPlan:
    """Assignment of runs to shards, decided before anything is read."""

    sources: list[Source]
    left_out: dict[int, str]
    shards: dict[str, list[Source]]  # by file name
    keys: dict[str, str]  # by file name
    inputs: list[dict[str, str]]

    @property
    def runs(self) -> int:
        """Number of runs that are packed."""
        return sum(len(runs) for runs in self.shards.values())


@dataclass(frozen=True)
class PackResult:
    """Result of packing."""

    metadata: Metadata
    reused: int  # shards that were already there
    written: int


def plan_packing(
    paths: Sequence[str | Path],
    settings: PackSettings,
    left_out: dict[int, str] | None = None,
) -> PackingPlan:
    """Decide which run goes where.

    Args:
        paths: trajectory files.
        settings: shares of the splits, seed, runs per shard.
        left_out: runs to leave out in addition to those that failed, with their reasons.

    Raises:
        InputError: files that cannot be packed together (`gns.data.trajectories.list_sources`).
    """
    sources = list_sources(paths)
    reasons = dict(left_out or {})
    reasons |= {source.number: source.failed for source in sources if source.failed}
    known = {source.number for source in sources}
    kept = {source.number: source for source in sources if source.number not in reasons}
    if not kept:
        raise InputError(f"{paths[0]}: no run is left to pack; {len(sources)} failed or left out")
    splits = split_runs(
        {source.number: source.template for source in sources},
        valid_share=settings.valid_share,
        test_share=settings.test_share,
        seed=settings.seed,
        without=reasons,
    )
    shards = {}
    for split in SPLITS:
        for place, first in enumerate(range(0, len(splits[split]), settings.runs_per_shard)):
            numbers = splits[split][first : first + settings.runs_per_shard]
            shards[shard_name(split, place)] = [kept[number] for number in numbers]
    hashes = {path: file_hash(path) for path in sorted({source.path for source in sources})}
    return PackingPlan(
        sources=sources,
        left_out={number: reasons[number] for number in sorted(reasons) if number in known},
        shards=shards,
        keys={name: _key(runs, hashes) for name, runs in shards.items()},
        inputs=[{"file": path.name, "sha256": hashes[path]} for path in hashes],
    )


def pack(
    plan: PackingPlan, folder: str | Path, manifest: dict[str, Any], on_run: OnRun | None = None
) -> PackResult:
    """Write the shards that are missing, then the metadata.

    Args:
        plan: what goes where.
        folder: made if missing; shards of an earlier plan are removed.
        manifest: settings and versions, to be kept with the data.
        on_run: called for each run.

    Raises:
        InputError: a run that is damaged or contradicts its scene.
    """
    folder = make_folder(folder)
    tell = on_run or (lambda count, note: None)
    missing = [name for name in plan.shards if not _is_there(folder / name, plan.keys[name])]
    others = _others(folder, plan)
    if missing or others:
        # No metadata may describe shards that are about to change.
        (folder / METADATA_FILE).unlink(missing_ok=True)
    for path in others:
        path.unlink()
    for name, sources in plan.shards.items():
        if name not in missing:
            tell(len(sources), f"{name} was there")
            continue
        numbers = [source.number for source in sources]
        write_shard(folder / name, plan.keys[name], numbers, _reporting(sources, name, tell))
    metadata = _describe(plan, folder, manifest)
    metadata.write(folder)
    return PackResult(metadata, reused=len(plan.shards) - len(missing), written=len(missing))


def _reporting(sources: Sequence[Source], name: str, tell: OnRun) -> Iterable:
    for source in sources:
        yield read_source(source)
        tell(1, name)


def _key(sources: Sequence[Source], hashes: dict[Path, str]) -> str:
    """Hash of all that decides the bytes of a shard."""
    files = sorted({source.path for source in sources})
    return content_hash(
        {
            "layout": LAYOUT_VERSION,
            "gns": gns.PHYSICS_VERSION,
            "runs": [[source.number, source.key] for source in sources],
            "files": [hashes[path] for path in files],
        }
    )


def _is_there(path: Path, key: str) -> bool:
    """A whole shard made from exactly our input lies there."""
    if not path.is_file():
        return False
    try:
        shard = Shard(path)
        if shard.key != key:
            return False
        shard.check()
    except InputError:
        return False  # of another layout, or damaged by others: written again
    return True


def _others(folder: Path, plan: PackingPlan) -> list[Path]:
    """Shards of an earlier plan: nothing may lie here that the metadata does not name."""
    found = [path for split in SPLITS for path in folder.glob(f"{split}_[0-9][0-9][0-9]*.npz")]
    return [path for path in found if path.name not in plan.shards]


def _describe(plan: PackingPlan, folder: Path, manifest: dict[str, Any]) -> Metadata:
    """The metadata, from the shards as they lie in the folder."""
    splits: dict[str, list[ShardEntry]] = {split: [] for split in SPLITS}
    velocities: list[Moments] = []
    accelerations: list[Moments] = []
    ranges: dict[str, Range] = {}
    for name, sources in plan.shards.items():
        split = name.rpartition("_")[0]
        shard = Shard(folder / name)
        if split == "train":
            for source in sources:
                velocity, acceleration = map(
                    Moments.from_stored, shard.array(source.number, "moments")
                )
                velocities.append(velocity)
                accelerations.append(acceleration)
                ranges = widest([ranges, _ranges_of(shard, source, velocity)])
        shard.close()
        splits[split].append(
            ShardEntry(
                file=name,
                key=plan.keys[name],
                runs=[
                    RunEntry(
                        run=source.number,
                        template=source.template,
                        points=source.points,
                        frames=source.frames,
                    )
                    for source in sources
                ],
            )
        )
    alike = plan.sources[0].alike
    shards = [entry for entries in splits.values() for entry in entries]
    return Metadata(
        scale=alike["scale"],
        spacing_m=alike["spacing_m"],
        gravity_m_per_s2=alike["gravity_m_per_s2"],
        frame_interval=alike["frame_interval"],
        frame_time_s=alike["frame_interval"]
        * float(np.sqrt(alike["spacing_m"] / alike["gravity_m_per_s2"])),
        water=alike["water"],
        splits=splits,
        left_out=[LeftOut(run=run, reason=reason) for run, reason in plan.left_out.items()],
        statistics=Statistics.of(merge(velocities), merge(accelerations)),
        ranges=ranges,
        inputs=plan.inputs,
        data_hash=hash_of(shards),
        manifest=manifest,
    )


def _ranges_of(shard: Shard, source: Source, velocity: Moments) -> dict[str, Range]:
    number, frames = source.number, source.frames
    first = shard.positions(number, 0, 1)[0]
    last = shard.positions(number, frames - 1, frames)[0]
    return run_ranges(first, last, frames, shard.facts(number), velocity)
