"""Our data in the layout of the public GNS codes (`flowslide gns pack --format geoelements`).

One NPZ file a split, `train.npz`, `valid.npz`, `test.npz`, each with the one key `gns_data`: an
array of objects, one a run, each a tuple

    positions          (T, N, 2) float32 [m]
    particle_type      (N,) int32: 6 soil, 3 stationary
    material_property  (N, 2) float32: tan phi, c / 100 kPa; or (N,) with `friction` alone

and a `metadata.json` with the keys those codes read. Arrays of objects are pickles: they are read
with `allow_pickle=True`, which runs whatever the file says, so only files of one's own should be.
Our own programs never read this layout.

It has no place for the ground, for water, for a body-force factor or for initial velocities. The
ground is written as a row of stationary points; the rest is lost.
"""

from __future__ import annotations

import pickle
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.lib import format as npy

from gns.data.metadata import METADATA_FILE
from gns.data.pack import PackingPlan
from gns.data.scene_facts import SOIL, SceneFacts
from gns.data.shard import SPLITS, open_member
from gns.data.statistics import Moments, merge
from gns.data.trajectories import Source, read_source
from pipeline.cli import InputError
from pipeline.files import atomic_path, make_folder, read_json, write_json

SOIL_TYPE, STATIONARY_TYPE = 6, 3
COHESION_UNIT = 100e3
"""Cohesions are divided by this [Pa]."""
RADIUS_IN_CELLS = 1.5
"""Connectivity radius of the paper."""

Properties = Literal["both", "friction"]


@dataclass
class _Gathered:
    """Metadata of the runs, filled while they are written."""

    low: np.ndarray
    high: np.ndarray
    shortest: int
    velocities: list[Moments]
    accelerations: list[Moments]


def write_geoelements(
    plan: PackingPlan,
    folder: str | Path,
    *,
    properties: Properties = "both",
    on_run: Callable[[int, str], None] | None = None,
) -> dict[str, Any]:
    """Write all splits and the metadata; return the metadata.

    Args:
        plan: what goes where; the shards of a split make one file.
        folder: made if missing.
        properties: "both" tan phi and c / 100 kPa; "friction" tan phi alone, which is what the
            published reader can take.
        on_run: called for each run.

    Raises:
        InputError: the folder holds data of our own layout, or a run is damaged.
    """
    folder = make_folder(folder)
    _refuse_our_own(folder)
    (folder / METADATA_FILE).unlink(missing_ok=True)
    gathered = _Gathered(np.full(2, np.inf), np.full(2, -np.inf), 2**31, [], [])
    facts: SceneFacts | None = None
    for split in SPLITS:
        sources = [
            source
            for name, runs in plan.shards.items()
            if name.startswith(f"{split}_")
            for source in runs
        ]
        if not sources:
            (folder / f"{split}.npz").unlink(missing_ok=True)
            continue
        lazy = np.empty(len(sources), dtype=object)
        for place, source in enumerate(sources):
            lazy[place] = _Lazy(source, properties, gathered, split == "train", on_run)
        _write_objects(folder / f"{split}.npz", lazy)
        facts = facts or read_source(sources[0]).facts
    document = _document(gathered, facts)
    write_json(folder / METADATA_FILE, document)
    return document


class _Lazy:
    """Stands for a run; read when it is pickled, as the plain tuple that a reader finds."""

    def __init__(
        self,
        source: Source,
        properties: Properties,
        gathered: _Gathered,
        counts: bool,
        on_run: Callable[[int, str], None] | None,
    ) -> None:
        self.source, self.properties, self.gathered = source, properties, gathered
        self.counts, self.on_run = counts, on_run

    def __reduce__(self) -> tuple:
        run = read_source(self.source)
        values = as_tuple(run.positions, run.facts, self.properties)
        gathered = self.gathered
        gathered.low = np.minimum(gathered.low, values[0].min(axis=(0, 1)))
        gathered.high = np.maximum(gathered.high, values[0].max(axis=(0, 1)))
        gathered.shortest = min(gathered.shortest, len(values[0]))
        if self.counts:
            velocity, acceleration = map(Moments.from_stored, run.moments)
            gathered.velocities.append(velocity)
            gathered.accelerations.append(acceleration)
        box = np.array([[run.facts.numbers[f"x_{end}"] for end in ("min", "max")]])
        gathered.low[0] = min(gathered.low[0], box.min())
        gathered.high[0] = max(gathered.high[0], box.max())
        gathered.high[1] = max(gathered.high[1], run.facts.numbers["y_max"])
        if self.on_run is not None:
            self.on_run(1, "geoelements")
        return tuple, (list(values),)


def as_tuple(
    positions: np.ndarray, facts: SceneFacts, properties: Properties = "both"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One run as such tools want it, the ground in points behind its own.

    Args:
        positions: (T, N, 2) [m].
        facts: of its scene.
        properties: see `write_geoelements`.

    Returns:
        positions (T, N + G, 2) float32, types (N + G,) int32, properties (N + G, 2) or (N + G,)
        float32.
    """
    ground = ground_points(facts)
    still = np.broadcast_to(ground, (len(positions), *ground.shape))
    both = np.zeros((facts.points + len(ground), 2), np.float32)
    both[: facts.points, 0] = facts.properties[:, 0]
    both[: facts.points, 1] = facts.properties[:, 1] / COHESION_UNIT
    types = np.full(len(both), STATIONARY_TYPE, np.int32)
    types[: facts.points][facts.type == SOIL] = SOIL_TYPE
    return (
        np.concatenate([positions, still], axis=1, dtype=np.float32),
        types,
        both if properties == "both" else both[:, 0].copy(),
    )


def ground_points(facts: SceneFacts) -> np.ndarray:
    """Points half a spacing below the ground, one spacing apart along it, (G, 2) float32 [m]."""
    fine = np.linspace(facts.numbers["x_min"], facts.numbers["x_max"], 4096)
    height = facts.ground_height(fine)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(fine), np.diff(height)))])
    count = max(int(length[-1] / facts.spacing), 1)
    x = np.interp((np.arange(count) + 0.5) * length[-1] / count, length, fine)
    return np.stack([x, facts.ground_height(x) - 0.5 * facts.spacing], axis=1).astype(np.float32)


def _write_objects(path: Path, objects: np.ndarray) -> None:
    """Write the file; the runs are read and forgotten one by one."""
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        with open_member(archive, "gns_data") as file:
            npy.write_array_header_1_0(
                file, {"descr": "|O", "fortran_order": False, "shape": objects.shape}
            )
            pickler = pickle.Pickler(file, protocol=4)
            pickler.fast = True  # no memo, which would keep every run in memory
            pickler.dump(objects)


def _document(gathered: _Gathered, facts: SceneFacts) -> dict[str, Any]:
    """The metadata: velocities and accelerations in metres per frame and frame^2."""
    step = facts.spacing * facts.frame_interval
    change = step * facts.frame_interval
    velocity, acceleration = merge(gathered.velocities), merge(gathered.accelerations)
    return {
        "bounds": [
            [float(low), float(high)] for low, high in zip(gathered.low, gathered.high, strict=True)
        ],
        "sequence_length": gathered.shortest,
        "default_connectivity_radius": RADIUS_IN_CELLS * facts.numbers["cell"],
        "dim": 2,
        "dt": facts.frame_time,
        "vel_mean": (velocity.mean * step).tolist(),
        "vel_std": (velocity.std * step).tolist(),
        "acc_mean": (acceleration.mean * change).tolist(),
        "acc_std": (acceleration.std * change).tolist(),
    }


def _refuse_our_own(folder: Path) -> None:
    path = folder / METADATA_FILE
    if path.is_file() and "layout_version" in read_json(path):
        raise InputError(
            f"{folder}: holds packed data of our own layout; --format geoelements needs another "
            "--out"
        )
