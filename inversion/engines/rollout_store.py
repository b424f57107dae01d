"""Rollouts of a learned simulator kept by content, with the derivatives of what was read on them.

What decides their numbers are scene, settings, the weights and the versions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import geometry
import gns
from inversion.engines.content_store import ContentStore
from inversion.engines.run_store import KeptRun, arrays_of_run, run_of_arrays
from inversion.estimation.data import Targets
from inversion.estimation.forward import HistoryReader
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import material_key
from pipeline.files import content_hash

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from geometry.sides import Side
    from geometry.survey.measured import Measured
    from pipeline.config import SimulationSettings

#: Settings of a simulation that a rollout knows of; no other changes its numbers.
KNOWN_SETTINGS = (
    "duration_s",
    "frame_interval",
    "water",
    "early_stop",
    "early_stop_energy_fraction",
    "early_stop_hold_s",
    "gravity_m_per_s2",
    "wall_contact",
)


class RolloutStore:
    """Rollouts and derivatives by content.

    Args:
        folder: of the files; None: in memory alone.
    """

    def __init__(self, folder: str | Path | None) -> None:
        self.computed = 0
        self.differentiated = 0
        self._runs = ContentStore(folder, run_of_arrays, arrays_of_run)
        self._rows: ContentStore[dict[str, np.ndarray]] = ContentStore(
            folder, dict, lambda rows: dict(sorted(rows.items()))
        )

    def run(self, key: str, reader: HistoryReader) -> KeptRun | None:
        """A rollout with the readings that are wanted of it; None: not there, or without them."""
        found = self._runs.get(key)
        if found is None or any(name not in found.readings for name in reader.wanted):
            return None
        return found

    def keep_run(self, key: str, run: KeptRun) -> None:
        """Keep a rollout that has just been computed."""
        self.computed += 1
        self._runs.put(key, run)

    def rows(self, key: str, names: Iterable[str]) -> dict[str, np.ndarray] | None:
        """Derivatives by `entry_keys` of measurements; None: not there, or not all of them."""
        found = self._rows.get(key)
        return found if found is not None and all(name in found for name in names) else None

    def keep_rows(self, key: str, rows: Mapping[str, np.ndarray]) -> None:
        """Keep derivatives that have just been worked out, in addition to those that are there."""
        self.differentiated += 1
        self._rows.put(key, dict(rows), join=lambda old, new: {**old, **new})


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


def entry_keys(targets: Targets[Measured], foot: Mapping[Side, float]) -> list[str]:
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
