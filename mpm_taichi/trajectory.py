"""One simulated run, and the HDF5 file that holds many of them.

In: a `Run`, the result of one simulated scene. Out: the group `run_NNNNN` of a trajectory file
(`batch_BBB.h5`), and back. The layout is fixed in `docs/files.md`: big arrays are datasets, everything
that describes them (scene, settings, audit, versions, wall time) is an attribute. The bytes of the
datasets depend on the scene, the settings and the physics alone, never on the machine's clock.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from mpm_taichi import PHYSICS_VERSION
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scene import Scene
    from pipeline.config import SimulationSettings

FORMAT_VERSION = 1

# name: (trailing shape after the point axis, dtype); the meaning stands in `Run`.
POINT_FIELDS: dict[str, tuple[tuple[int, ...], type]] = {
    "material": ((), np.int32),
    "zone": ((), np.int32),
    "kinematic": ((), np.bool_),
    "velocity": ((2,), np.float32),
    "stress": ((4,), np.float32),
    "initial_stress": ((4,), np.float32),
    "plastic_shear_strain": ((), np.float32),
    "volume": ((), np.float32),
}
FIELDS = ("positions", "time", *POINT_FIELDS, "energy")


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
    volume: np.ndarray  # (N,) float32 [m2 per metre of width], final
    energy: dict[str, np.ndarray] = field(default_factory=dict)  # name -> (T,) float64 [J/m]
    audit: dict[str, float | int | str] = field(default_factory=dict)
    status: str = "finished"  # "finished" | "failed"
    reason: str = ""
    wall_contact: dict[str, Any] = field(default_factory=dict)
    wall_time_s: float = 0.0
    steps: int = 0

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
        """True when the run was stopped by a guard or could not be run."""
        return self.status == "failed"
