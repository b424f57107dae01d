from __future__ import annotations

import csv

import numpy as np
import pytest

from flowslide.command_line import main
from mpm_taichi.export import export_csv, export_vtkhdf
from mpm_taichi.trajectory import Run
from mpm_taichi.trajectory3d import Run3d, is_run_3d, read_run_3d, write_run_3d
from pipeline.cli import InputError
from tests.mpm_taichi.ballistic import FAST, fly, make_scene


@pytest.fixture
def run() -> Run:
    return fly(make_scene(1), FAST)


def test_vtk_reads_every_step_back(tmp_path, run):
    io = pytest.importorskip("vtkmodules.vtkIOHDF", reason="needs vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    export_vtkhdf(run, tmp_path / "run.vtkhdf")
    reader = io.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "run.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == run.frames

    for frame in (0, 3, run.frames - 1):
        reader.SetStep(frame)
        reader.Update()
        assert reader.GetTimeValue() == pytest.approx(run.time[frame])
        grid = reader.GetOutput()
        assert grid.GetNumberOfPoints() == grid.GetNumberOfCells() == run.points
        assert grid.GetCellType(5) == 1  # a vertex ...
        assert grid.GetCell(5).GetPointId(0) == 5  # ... on its own point
        points = vtk_to_numpy(grid.GetPoints().GetData())
        assert np.array_equal(points[:, :2], run.positions[frame])
        assert not points[:, 2].any()

        def array(name, grid=grid):
            return vtk_to_numpy(grid.GetPointData().GetArray(name))

        moved = run.positions[frame] - run.positions[0]
        assert np.array_equal(array("displacement")[:, :2], moved)
        assert np.array_equal(array("material"), run.material)
        assert np.array_equal(array("zone"), run.zone)
        assert np.array_equal(array("velocity_final")[:, :2], run.velocity)
        assert np.array_equal(array("plastic_shear_strain_final"), run.plastic_shear_strain)
        assert np.array_equal(array("stress_final")[:, :4], run.stress)
        assert np.array_equal(array("stress_initial")[:, :4], run.initial_stress)


def read_csv(path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_the_table_of_the_end(tmp_path, run):
    export_csv(run, tmp_path / "end.csv")
    rows = read_csv(tmp_path / "end.csv")
    assert len(rows) == run.points
    last = rows[-1]
    assert (last["zone"], last["material"]) == ("block", "shell")
    x = np.array([float(row["x_m"]) for row in rows], np.float32)
    assert np.allclose(x, run.positions[-1, :, 0], rtol=1e-6)
    assert float(last["stress_xy_pa"]) == pytest.approx(run.stress[-1, 3], rel=1e-6)


def test_the_table_of_moments(tmp_path, run):
    export_csv(run, tmp_path / "moments.csv", times=[0.0, 0.001, 1.0])
    rows = read_csv(tmp_path / "moments.csv")
    times = sorted({float(row["time_s"]) for row in rows})
    assert len(rows) == 2 * run.points  # 0.0 and 0.001 s are the same frame
    assert times[0] == 0.0 and times[1] == pytest.approx(1.0, abs=0.1)
    frame = int(np.argmin(abs(run.time - 1.0)))
    moved = run.positions[frame, -1] - run.positions[0, -1]
    assert float(rows[-1]["displacement_x_m"]) == pytest.approx(moved[0], rel=1e-5)


@pytest.mark.parametrize("export", [export_csv, export_vtkhdf])
def test_a_run_without_frames_is_refused(tmp_path, export):
    run = Run.empty(make_scene(1), FAST, reason="it burnt")
    with pytest.raises(InputError, match="no frames to export .it burnt"):
        export(run, tmp_path / "x")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def solid() -> Run3d:
    """A run of 7 points and 4 frames in three dimensions, all its numbers different."""
    numbers = np.random.default_rng(3)

    def drawn(*shape: int) -> np.ndarray:
        return numbers.normal(size=shape).astype(np.float32)

    return Run3d(
        name="cloud", positions=drawn(4, 7, 3), time=0.5 * np.arange(4.0),
        material=np.arange(7, dtype=np.int32) % 2, zone=np.arange(7, dtype=np.int32) % 3,
        top_speed=drawn(7), velocity=drawn(7, 3), stress=drawn(7, 6), initial_stress=drawn(7, 6),
        plastic_shear_strain=drawn(7), volume=drawn(7), energy={"kinetic": np.arange(4.0)},
    )  # fmt: skip


def test_vtk_reads_a_run_in_three_dimensions_back(tmp_path, solid):
    io = pytest.importorskip("vtkmodules.vtkIOHDF", reason="needs vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    write_run_3d(tmp_path / "run.h5", solid)
    path = tmp_path / "run.vtkhdf"
    main(["runs", "export", str(tmp_path / "run.h5"), "--format", "vtkhdf", "--out", str(path)])
    reader = io.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 4
    for frame in range(4):
        reader.SetStep(frame)
        reader.Update()
        grid = reader.GetOutput()
        assert np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), solid.positions[frame])
        for name, values in {
            "displacement": solid.positions[frame] - solid.positions[0],
            "top_speed": solid.top_speed,
            "velocity_final": solid.velocity,
            "stress_initial": solid.initial_stress,
            "stress_final": solid.stress,
            "volume_final": solid.volume,
        }.items():
            assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray(name)), values), name


def test_the_table_of_a_run_in_three_dimensions(tmp_path, solid):
    write_run_3d(tmp_path / "run.h5", solid)
    assert is_run_3d(tmp_path / "run.h5") and not is_run_3d(tmp_path / "none.h5")
    export_csv(read_run_3d(tmp_path / "run.h5"), tmp_path / "end.csv")
    rows = read_csv(tmp_path / "end.csv")
    assert len(rows) == 7 and rows[4]["zone"] == "1"
    for name, values in {
        "z_initial_m": solid.positions[0, :, 2],
        "z_m": solid.positions[-1, :, 2],
        "velocity_z_m_per_s": solid.velocity[:, 2],
        "stress_xz_pa": solid.stress[:, 5],
        "volume_m3": solid.volume,
    }.items():
        assert [float(row[name]) for row in rows] == pytest.approx(values, rel=1e-6)
    with pytest.raises(InputError, match="in three dimensions"):
        export_csv(solid, tmp_path / "moments.csv", times=[0.5])
