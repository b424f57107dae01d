"""Runs for other programs: VTKHDF for ParaView and VTK, CSV for anything that reads tables.

In: a `Run`. Out: a file. VTKHDF is written with h5py alone, as an unstructured grid of one vertex a
material point with one step a frame (file format of Kitware, version 2.2). What is known at the end
only (velocity, stress, plastic strain, volume) is stored once for all steps; its name says so.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import h5py
import numpy as np

from mpm_taichi.trajectory import COMPRESSION_LEVEL, Run, nearest_frame
from pipeline.cli import InputError
from pipeline.files import atomic_path

_VERSION = (2, 2)
_VTK_VERTEX = 1


def export_vtkhdf(run: Run, path: str | Path) -> None:
    """Write a run for ParaView: positions and displacement by frame, the rest as constants.

    Args:
        run: the run, with at least one frame.
        path: usually ends in .vtkhdf.

    Raises:
        InputError: a run without frames.
    """
    _refuse_empty(run)
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        root = file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = np.array(_VERSION, "i8")
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
        _write_vertices(root, run.points)
        _write_steps(root, run)
        points = _moving_dataset(root, "Points", run)
        data = root.create_group("PointData")
        displacement = _moving_dataset(data, "displacement", run)
        for frame in range(run.frames):
            rows = slice(frame * run.points, (frame + 1) * run.points)
            points[rows, :2] = run.positions[frame]
            displacement[rows, :2] = run.positions[frame] - run.positions[0]
        for name, values in _constants(run).items():
            _write(data, name, values)


def export_csv(run: Run, path: str | Path, *, times: Sequence[float] | None = None) -> None:
    """Write a run as a table with one row a material point.

    Args:
        run: the run, with at least one frame.
        path: usually ends in .csv.
        times: None: one row a point, the state at the end; else one row a point and moment [s]
            (nearest frame), positions and displacements alone.

    Raises:
        InputError: a run without frames, or a moment outside it.
    """
    _refuse_empty(run)
    if times is None:
        blocks = [_final_columns(run)]
    else:
        frames = dict.fromkeys(nearest_frame(run, time) for time in times)
        blocks = [_frame_columns(run, frame) for frame in frames]
    with atomic_path(path) as temporary:
        with temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(blocks[0])
            for columns in blocks:
                writer.writerows(zip(*map(_texts, columns.values()), strict=True))


def _write_vertices(root: h5py.Group, points: int) -> None:
    """One vertex a point, the same in all steps."""
    for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
        _write(root, name, np.array([points], "i8"))
    _write(root, "Connectivity", np.arange(points, dtype="i8"))
    _write(root, "Offsets", np.arange(points + 1, dtype="i8"))
    _write(root, "Types", np.full(points, _VTK_VERTEX, "u1"))


def _write_steps(root: h5py.Group, run: Run) -> None:
    """Where each step finds its points and data; everything constant starts at 0 in every step."""
    nothing = np.zeros(run.frames, "i8")
    begin = np.arange(run.frames, dtype="i8") * run.points
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(run.frames)
    _write(steps, "Values", run.time)
    _write(steps, "PartOffsets", nothing)
    _write(steps, "NumberOfParts", nothing + 1)
    _write(steps, "PointOffsets", begin)
    _write(steps, "CellOffsets", nothing[:, None])
    _write(steps, "ConnectivityIdOffsets", nothing[:, None])
    offsets = steps.create_group("PointDataOffsets")
    _write(offsets, "displacement", begin)
    for name in _constants(run):
        _write(offsets, name, nothing)


def _constants(run: Run) -> dict[str, np.ndarray]:
    """Fields that do not change with the step, by name in ParaView."""

    def tensor(stress: np.ndarray) -> np.ndarray:
        full = np.zeros((run.points, 6), np.float32)  # VTK's order: xx, yy, zz, xy, yz, xz
        full[:, :4] = stress
        return full

    velocity = np.zeros((run.points, 3), np.float32)
    velocity[:, :2] = run.velocity
    return {
        "material": run.material,
        "zone": run.zone,
        "kinematic": run.kinematic.astype(np.uint8),
        "velocity_final": velocity,
        "stress_initial": tensor(run.initial_stress),
        "stress_final": tensor(run.stress),
        "plastic_shear_strain_final": run.plastic_shear_strain,
        "volume_final": run.volume,
    }


def _moving_dataset(group: h5py.Group, name: str, run: Run) -> h5py.Dataset:
    """An empty (T N, 3) dataset, one chunk a frame; z stays 0."""
    return group.create_dataset(
        name,
        shape=(run.frames * run.points, 3),
        dtype=np.float32,
        chunks=(run.points, 3),
        shuffle=True,
        compression="gzip",
        compression_opts=COMPRESSION_LEVEL,
    )


def _write(group: h5py.Group, name: str, values: np.ndarray) -> None:
    group.create_dataset(name, data=values)


def _final_columns(run: Run) -> dict[str, Iterable]:
    before, after = run.positions[0], run.positions[-1]
    columns = {
        **_names(run),
        "x_initial_m": before[:, 0],
        "y_initial_m": before[:, 1],
        "x_m": after[:, 0],
        "y_m": after[:, 1],
        "velocity_x_m_per_s": run.velocity[:, 0],
        "velocity_y_m_per_s": run.velocity[:, 1],
    }
    for place, component in enumerate(("xx", "yy", "zz", "xy")):
        columns[f"stress_{component}_pa"] = run.stress[:, place]
    columns["plastic_shear_strain"] = run.plastic_shear_strain
    columns["volume_m2"] = run.volume
    return columns


def _frame_columns(run: Run, frame: int) -> dict[str, Iterable]:
    position = run.positions[frame]
    moved = position - run.positions[0]
    return {
        "time_s": np.full(run.points, run.time[frame]),
        **_names(run),
        "x_m": position[:, 0],
        "y_m": position[:, 1],
        "displacement_x_m": moved[:, 0],
        "displacement_y_m": moved[:, 1],
    }


def _names(run: Run) -> dict[str, Iterable]:
    materials = np.array(run.scene.material_names, dtype=object)
    zones = np.array([zone.name for zone in run.scene.zones], dtype=object)
    return {
        "point": np.arange(run.points),
        "zone": zones[run.zone],
        "material": materials[run.material],
    }


def _texts(values: np.ndarray) -> Iterable:
    """Numbers with the digits that single precision has."""
    return (f"{value:.7g}" for value in values) if values.dtype.kind == "f" else values.tolist()


def _refuse_empty(run: Run) -> None:
    if run.frames == 0 or run.points == 0:
        raise InputError(f"{run.scene.name}: the run has no frames to export ({run.reason})")
