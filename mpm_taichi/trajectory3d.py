"""The run of a three-dimensional problem, and its HDF5 file."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from mpm_taichi import PHYSICS_VERSION
from pipeline.cli import InputError
from pipeline.files import atomic_path
from pipeline.manifest import code_version

RUN_ARRAYS = (
    "positions",
    "time",
    "material",
    "zone",
    "top_speed",
    "velocity",
    "stress",
    "initial_stress",
    "plastic_shear_strain",
    "volume",
)


@dataclass
class Run3d:
    """The result of a problem. T frames, N points in the problem's order, SI units.

    A failed run keeps its frames up to the failure; `reason` says what happened.
    """

    name: str
    positions: np.ndarray  # (T, N, 3) float32 [m]
    time: np.ndarray  # (T,) [s]
    material: np.ndarray  # (N,)
    zone: np.ndarray  # (N,)
    top_speed: np.ndarray  # (N,) float32, largest speed at the end of a frame [m/s]
    velocity: np.ndarray  # (N, 3) float32 [m/s], final
    stress: np.ndarray  # (N, 6) float32 [Pa] xx, yy, zz, xy, yz, xz, final
    initial_stress: np.ndarray  # (N, 6) float32 [Pa], after settling
    plastic_shear_strain: np.ndarray  # (N,) float32 [-], final
    volume: np.ndarray  # (N,) float32 [m3], final
    energy: dict[str, np.ndarray]  # name -> (T,) [J]
    status: str = "finished"
    reason: str = ""
    steps: int = 0
    wall_time_s: float = 0.0
    audit: dict[str, float | int | str] = field(default_factory=dict)

    @property
    def point_steps_per_s(self) -> float:
        """Points x steps of the motion, per second of computing."""
        return self.positions.shape[1] * self.steps / max(self.wall_time_s, 1e-9)


def write_run_3d(path: Path, run: Run3d) -> None:
    """Write a run as an HDF5 file: arrays as datasets, what describes them as attributes."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        for name in RUN_ARRAYS:
            values = getattr(run, name)
            packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
            if name == "positions":
                packed["chunks"] = (min(8, len(values)), min(4096, values.shape[1]), 1)
            file.create_dataset(name, data=values, **packed)
        energy = file.create_group("energy")
        for name, values in run.energy.items():
            energy.create_dataset(name, data=values)
        file.attrs.update(
            {
                "dimensions": 3,
                "physics_version": PHYSICS_VERSION,
                "code_version": code_version(),
                "name": run.name,
                "status": run.status,
                "reason": run.reason,
                "steps": run.steps,
                "wall_time_s": run.wall_time_s,
                "audit": json.dumps(run.audit, sort_keys=True),
            }
        )


def read_run_3d(path: Path) -> Run3d:
    """Read the run of a file of `write_run_3d`.

    Raises:
        InputError: no such file, or not a three-dimensional run.
    """
    try:
        with h5py.File(path, "r") as file:
            attributes = file.attrs
            return Run3d(
                **{name: file[name][...] for name in RUN_ARRAYS},
                energy={name: values[...] for name, values in file["energy"].items()},
                name=attributes["name"],
                status=attributes["status"],
                reason=attributes["reason"],
                steps=int(attributes["steps"]),
                wall_time_s=float(attributes["wall_time_s"]),
                audit=json.loads(attributes["audit"]),
            )
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not a three-dimensional run ({error})") from error


def is_run_3d(path: str | Path) -> bool:
    """True for a file of `write_run_3d`."""
    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get("dimensions") == 3
    except OSError:
        return False
