"""Runs for other programs: VTKHDF for ParaView and VTK, CSV for anything that reads tables.

In: a `Run` or a `Run3d`. Out: a file. VTKHDF is written with h5py alone, as an unstructured grid
of one vertex a material point with one step a frame (file format of Kitware, version 2.2). What is
known at the end only (velocity, stress, plastic strain, volume) is stored once for all steps; its
name says so.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import h5py
import numpy as np

from mpm_taichi.trajectory import COMPRESSION_LEVEL, Run, nearest_frame
from mpm_taichi.trajectory3d import Run3d
from pipeline.cli import InputError
from pipeline.files import atomic_path

_VERSION = (2, 2)
_VTK_VERTEX = 1


def export_vtkhdf(run: Run | Run3d, path: str | Path) -> None:
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
        frames, count, axes = run.positions.shape
        _write_vertices(root, count)
        _write_steps(root, run)
        points = _moving_dataset(root, "Points", run)
        data = root.create_group("PointData")
        displacement = _moving_dataset(data, "displacement", run)
        for frame in range(frames):
            rows = slice(frame * count, (frame + 1) * count)
            points[rows, :axes] = run.positions[frame]
            displacement[rows, :axes] = run.positions[frame] - run.positions[0]
        for name, values in _constants(run).items():
            _write(data, name, values)


def export_csv(run: Run | Run3d, path: str | Path, *, times: Sequence[float] | None = None) -> None:
    """Write a run as a table with one row a material point.

    Args:
        run: the run, with at least one frame.
        path: usually ends in .csv.
        times: None: one row a point, the state at the end; else one row a point and moment [s]
            (nearest frame), positions and displacements alone; two dimensions only.

    Raises:
        InputError: a run without frames, a moment outside it, or moments in three dimensions.
    """
    _refuse_empty(run)
    if times is None:
        blocks = [_final_columns(run)]
    elif isinstance(run, Run3d):
        raise InputError("moments: in three dimensions a table holds the state at the end")
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


def _write_steps(root: h5py.Group, run: Run | Run3d) -> None:
    """Where each step finds its points and data; everything constant starts at 0 in every step."""
    frames, count, _ = run.positions.shape
    nothing = np.zeros(frames, "i8")
    begin = np.arange(frames, dtype="i8") * count
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(frames)
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


def _constants(run: Run | Run3d) -> dict[str, np.ndarray]:
    """Fields that do not change with the step, by name in ParaView."""

    def filled(values: np.ndarray, columns: int) -> np.ndarray:
        full = np.zeros((len(values), columns), np.float32)
        full[:, : values.shape[1]] = values
        return full

    own = (
        {"top_speed": run.top_speed}
        if isinstance(run, Run3d)
        else {"kinematic": run.kinematic.astype(np.uint8)}
    )
    return {
        "material": run.material,
        "zone": run.zone,
        **own,
        "velocity_final": filled(run.velocity, 3),
        "stress_initial": filled(run.initial_stress, 6),  # VTK's order: xx, yy, zz, xy, yz, xz
        "stress_final": filled(run.stress, 6),
        "plastic_shear_strain_final": run.plastic_shear_strain,
        "volume_final": run.volume,
    }


def _moving_dataset(group: h5py.Group, name: str, run: Run | Run3d) -> h5py.Dataset:
    """An empty (T N, 3) dataset, one chunk a frame; z stays 0 in two dimensions."""
    frames, count, _ = run.positions.shape
    return group.create_dataset(
        name,
        shape=(frames * count, 3),
        dtype=np.float32,
        chunks=(count, 3),
        shuffle=True,
        compression="gzip",
        compression_opts=COMPRESSION_LEVEL,
    )


def _write(group: h5py.Group, name: str, values: np.ndarray) -> None:
    group.create_dataset(name, data=values)


def _final_columns(run: Run | Run3d) -> dict[str, Iterable]:
    before, after = run.positions[0], run.positions[-1]
    axes = "xyz"[: after.shape[1]]
    columns = {**_names(run)}
    columns |= {f"{axis}_initial_m": before[:, k] for k, axis in enumerate(axes)}
    columns |= {f"{axis}_m": after[:, k] for k, axis in enumerate(axes)}
    columns |= {f"velocity_{axis}_m_per_s": run.velocity[:, k] for k, axis in enumerate(axes)}
    for place, component in enumerate(("xx", "yy", "zz", "xy", "yz", "xz")[: run.stress.shape[1]]):
        columns[f"stress_{component}_pa"] = run.stress[:, place]
    columns["plastic_shear_strain"] = run.plastic_shear_strain
    columns[f"volume_m{len(axes)}"] = run.volume
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


def _names(run: Run | Run3d) -> dict[str, Iterable]:
    """Number of each point, and its zone and material: names, in three dimensions numbers."""
    numbers = np.arange(run.positions.shape[1])
    if isinstance(run, Run3d):
        return {"point": numbers, "zone": run.zone, "material": run.material}
    materials = np.array(run.scene.material_names, dtype=object)
    zones = np.array([zone.name for zone in run.scene.zones], dtype=object)
    return {"point": numbers, "zone": zones[run.zone], "material": materials[run.material]}


def _texts(values: np.ndarray) -> Iterable:
    """Numbers with the digits that single precision has."""
    return (f"{value:.7g}" for value in values) if values.dtype.kind == "f" else values.tolist()


def _refuse_empty(run: Run | Run3d) -> None:
    if 0 in run.positions.shape:
        name = run.name if isinstance(run, Run3d) else run.scene.name
        raise InputError(f"{name}: the run has no frames to export ({run.reason})")
