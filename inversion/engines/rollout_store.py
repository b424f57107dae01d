"""Rollouts of a learned simulator kept by content, with the derivatives of what was read on them.

A finished rollout, and the derivative worked out on one, go at once into small files whose names
are the hashes of all that decides their numbers: scene, settings, the weights, versions. So a
back-analysis that was killed goes on, and a question asked again costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import geometry
import gns
from inversion.engines.run_store import DAMAGE, KeptRun, load_kept, save_kept, write_arrays
from inversion.estimation.data import Targets
from inversion.estimation.forward import HistoryReader
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import material_key
from pipeline.files import content_hash

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from pipeline.config import SimulationSettings

#: Settings of a simulation that a rollout knows of; no other changes its numbers.
KNOWN_SETTINGS = (
    "duration_s", "frame_interval", "water", "early_stop", "early_stop_energy_fraction",
    "early_stop_hold_s", "gravity_m_per_s2", "wall_contact",
)  # fmt: skip


class RolloutStore:
    """Rollouts and derivatives by content, in memory and in a folder.

    Args:
        folder: of the files; None: in memory alone.
    """

    def __init__(self, folder: str | Path | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self.computed = 0
        self.differentiated = 0
        self._runs: dict[str, KeptRun] = {}
        self._rows: dict[str, dict[str, np.ndarray]] = {}

    def run(self, key: str, reader: HistoryReader) -> KeptRun | None:
        """A rollout with the readings that are wanted of it; None: not there, or without them."""
        if key not in self._runs and self.folder is not None:
            found = load_kept(self.folder / f"{key}.npz")
            if found is not None:
                self._runs[key] = found
        found = self._runs.get(key)
        if found is None or any(name not in found.readings for name in reader.wanted):
            return None
        return found

    def keep_run(self, key: str, run: KeptRun) -> None:
        """Keep a rollout that has just been computed."""
        self.computed += 1
        self._runs[key] = run
        if self.folder is not None:
            save_kept(self.folder / f"{key}.npz", run)

    def rows(self, key: str, names: Iterable[str]) -> dict[str, np.ndarray] | None:
        """Derivatives by `entry_keys` of measurements; None: not there, or not all of them."""
        if key not in self._rows and self.folder is not None:
            found = _load(self.folder / f"{key}.npz")
            if found is not None:
                self._rows[key] = found
        found = self._rows.get(key)
        return found if found is not None and all(name in found for name in names) else None

    def keep_rows(self, key: str, rows: Mapping[str, np.ndarray]) -> None:
        """Keep derivatives that have just been worked out, in addition to those that are there."""
        self.differentiated += 1
        self._rows[key] = {**self._rows.get(key, {}), **rows}
        if self.folder is not None:
            write_arrays(self.folder / f"{key}.npz", dict(sorted(self._rows[key].items())))


def rollout_key(scene: Scene, settings: SimulationSettings, model_hash: str) -> str:
    """Hash of everything the numbers of a rollout depend on.

    Args:
        scene: with all values put in.
        settings: with the model's frame interval.
        model_hash: of the file of the weights, with the type of number and device.
    """
    return content_hash(
        {
            "scene": scene,
            "settings": {name: getattr(settings, name) for name in KNOWN_SETTINGS},
            "model": model_hash,
            "gns": gns.PHYSICS_VERSION,
            "geometry": geometry.PHYSICS_VERSION,
        }
    )


def derivative_key(run_key: str, parameters: Parameters, way: str) -> str:
    """Hash of a rollout and of what it is differentiated by.

    Args:
        run_key: `rollout_key`.
        parameters: their zones and properties, in order.
        way: of the derivative; with that through a part of the numbers, which.
    """
    unknowns = [[material_key(spec.property), list(spec.zones)] for spec in parameters.specs]
    return content_hash({"run": run_key, "by": unknowns, "way": way})


def entry_keys(targets: Targets, foot: Mapping[str, float]) -> list[str]:
    """A name for each measurement by content: its document, its places, the feet."""
    return [
        content_hash(
            {
                "type": type(entry).__name__,
                "entry": entry,
                "parts": entry.parts,
                "foot": {side: float(x) for side, x in sorted(foot.items())},
            }
        )
        for entry in targets.entries
    ]


def _load(path: Path) -> dict[str, np.ndarray] | None:
    """Derivatives of a file; None where there is none, or where it is damaged."""
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except DAMAGE:
        return None
