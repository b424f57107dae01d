"""Slides in three dimensions as a user meets them: check, show, simulate; what they leave."""

from __future__ import annotations

import csv
import runpy

import numpy as np
import pytest
from PIL import Image

import flowslide
from benchmarks.verification.three_dimensions import slab_scene
from flowslide.command_line import main
from geometry.scenes3d.fill3d import drawn_volume
from geometry.scenes3d.scene3d import is_body, load_scene_3d
from geometry.terrain.raster import Raster, write_raster
from mpm_taichi.solver3d.problem import problem_of
from mpm_taichi.trajectory3d import read_run_3d
from pipeline.cli import InputError
from pipeline.files import write_text, yaml_text
from report.pictures.body_film import chosen_frames
from report.prediction3d import doubts
from report.simulation3d import warning

SHORT = ["--set", "simulation.duration_s=2", "--threads", "1", "--quiet"]


@pytest.fixture
def slab(tmp_path):
    """A bank of clay over 8 m, at 1 m."""
    folder = tmp_path / "slab"
    folder.mkdir()
    write_text(folder / "section.yaml", yaml_text(slab_scene(spacing=1.0)))
    section = {"file": "section.yaml", "width_m": 8.0}
    lines = {"gauge": [[25.0, 0.0], [25.0, 8.0]]}
    document = {"name": "slab", "section": section, "flanks": "smooth", "lines": lines}
    write_text(folder / "scene3d.yaml", yaml_text(document))
    return folder


def test_check_and_show(slab, tmp_path, capsys):
    main(["check", str(slab)])
    said = capsys.readouterr().out
    assert "slab: three-dimensional" in said and "x 8 m in plan" in said
    main(["show", str(slab / "scene3d.yaml"), "--out", str(tmp_path / "a.png")])
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_a_case_with_a_section_is_that_unless_the_file_is_named(root, tmp_path):
    case = root / "case_histories/lower_san_fernando"
    assert not is_body(case) and is_body(case / "scene3d.yaml")
    for file in ("scene3d.yaml", "scene.yaml"):  # without measurements it is the same
        (tmp_path / file).write_text((case / file).read_text())
        assert is_body(tmp_path) == (file == "scene3d.yaml")
    wide = load_scene_3d(case)
    assert (wide.document.section.width_m, wide.section.domain.walls) == (550.0, "closed")


def test_a_valley_with_sloping_sides_holds_the_section_within_them(slab):
    upright = problem_of(load_scene_3d(slab))
    text = (
        (slab / "scene3d.yaml")
        .read_text()
        .replace("width_m: 8.0", "width_m: 8.0\n  flank_slope: 0.5")
    )
    write_text(slab / "scene3d.yaml", text)
    valley = problem_of(load_scene_3d(slab))
    y = valley.position[:, 1] - 0.5 * (valley.domain[2] + valley.domain[3])
    height = valley.position[:, 2] - upright.position[:, 2].min() + 0.5
    assert np.all(np.abs(y) < 4.0 + height / 0.5)
    assert np.ptp(y[height < 1.0]) < np.ptp(y[height > height.max() - 1.0])
    middle = np.abs(y) < 4.0
    assert valley.volume[middle].sum() == pytest.approx(upright.volume.sum(), rel=0.01)


def test_simulate_leaves_a_run_readings_rasters_and_a_page(slab, tmp_path, capsys):
    out = tmp_path / "out"
    main(["simulate", str(slab), "--out", str(out), "--film", "gif", *SHORT])
    said = capsys.readouterr().out
    assert "toe runout" in said and "report.html" in said
    with (out / "readings.csv").open() as file:
        readings = {row["quantity"]: float(row["value"]) for row in csv.DictReader(file)}
    run = read_run_3d(out / "run.h5")
    assert readings["duration_s"] == pytest.approx(run.time[-1], rel=1e-4)
    # Smooth flanks: every row of the toe is the same, and the map holds the run's volume.
    toe = np.loadtxt(out / "toe_line.csv", delimiter=",", skiprows=1)
    assert np.ptp(toe[:, 2]) < 0.05
    assert toe[0, 2] - toe[0, 1] == pytest.approx(readings["toe_runout_m"], abs=0.01)
    assert readings["toe_runout_m"] > 1.0
    assert readings["runout_middle_m"] == pytest.approx(readings["toe_runout_m"], abs=0.5)
    moved = np.linalg.norm(run.positions[-1] - run.positions[0], axis=1) > 1.0
    assert readings["volume_moved_m3"] == pytest.approx(moved.sum())
    foot = toe[0, 1]
    beyond = [(frame[:, 0] > foot).sum() for frame in (run.positions[0], run.positions[-1])]
    assert readings["volume_beyond_foot_m3"] == pytest.approx(beyond[1] - beyond[0], rel=0.02)
    across = (run.positions[-1][:, 0] > 25.0).sum()  # of 1 m3 each; none was there before
    assert readings["volume_across_gauge_m3"] == pytest.approx(across) and across > 50
    assert not (out / "checkpoint.npz").exists()
    page = (out / "report.html").read_text()
    assert page.count("data:image/png") == 2 and "inundated area" in page
    assert page.count("data:image/gif") == 1
    with Image.open(out / "slide.gif") as film:
        assert film.n_frames == len(chosen_frames(len(run.time)))
        shown = [np.asarray(film.convert("RGB"))]
        film.seek(film.n_frames - 1)
        shown.append(np.asarray(film.convert("RGB")))
    assert np.abs(shown[0].astype(int) - shown[1]).max() > 50  # it moves
    rasterio = pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    with rasterio.open(out / "thickness_after.tif") as file:
        assert file.read(1).sum() * file.res[0] ** 2 == pytest.approx(run.volume.sum(), rel=0.01)


def test_a_line_the_wrong_way_round_is_told():
    said = "crossed gauge to the left, seen from the first end"
    assert said in warning([], {"volume_across_gauge_m3": -3.0, "volume_across_road_m3": 2.0})
    assert warning([], {"volume_across_road_m3": 2.0, "toe_runout_m": -1.0}) == ""
    assert warning([], {"volume_across_road_m3": -2.0, "volume_moved_m3": 300.0}) == ""
    moments = {"mean": -3.0, "std": 0.0}
    quantity = {"name": "volume across gauge", "type": "reading", "censored": False, **moments}
    document = {"inundation": [], "quantities": [{**quantity, "first_order": moments}],
                "failed_runs": 0, "runs_cut_off": 0}  # fmt: skip
    assert said in doubts(document)[-1]


def test_what_three_dimensions_lack_is_refused_before_any_work(slab, tmp_path):
    for option in (["--device", "cuda"], ["--set-of-measurements", "a"]):
        with pytest.raises(InputError, match=f"{option[0]}.*not in three dimensions"):
            main(["simulate", str(slab), "--out", str(tmp_path / "out"), *option])
    with pytest.raises(InputError, match="has no material 'sand'"):
        flowslide.simulate_3d(slab, strengths_kpa={"sand": 5.0})
    assert not (tmp_path / "out").exists()


def test_the_example_of_the_page_holds_its_tailings_behind_its_dam(root, tmp_path, capsys):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    example = runpy.run_path(str(root / "docs/examples/tailings_valley.py"))
    example["write_example"](tmp_path)
    scene = load_scene_3d(tmp_path)
    problem = problem_of(scene)
    x, y = problem.position[:, 0], problem.position[:, 1]
    dam, sand, slimes = (problem.zone == number for number in range(3))
    assert x[dam].min() > 200.0 and x[sand | slimes].max() < 200.0
    assert problem.position[sand, 2].min() > problem.position[slimes, 2].max() - 3.0
    # Soil lies between base and surface, and fills what is between them.
    base, surface = scene.ground.base, scene.ground.surface
    assert np.all(problem.position[:, 2] > base.at(x, y))
    thickness = np.trapezoid(surface.values - base.values, dx=base.spacing, axis=0)
    integral = np.trapezoid(thickness, dx=base.spacing)
    assert problem.volume.sum() == pytest.approx(integral, rel=0.002)
    assert drawn_volume(scene) == pytest.approx(integral, rel=0.0005)
    main(["check", str(tmp_path)])
    apart = 100.0 * (problem.volume.sum() / drawn_volume(scene) - 1.0)
    assert f"m³ between the rasters; the points hold {apart:+.1f} %" in capsys.readouterr().out


def test_a_slide_on_rasters_stops_at_the_wall_and_says_so(tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    x, y = np.meshgrid(np.arange(0.0, 31.0), np.arange(0.0, 9.0), indexing="ij")
    base = -0.3 * x + 0.02 * (y - 4.0) ** 2
    body = np.where((x > 4.0) & (x < 20.0), 4.0, 0.0)
    for name, values in (("base", base), ("surface", base + body), ("after", base)):
        write_raster(Raster((0.0, 0.0), 1.0, values), tmp_path / f"{name}.tif")
    terrain = {
        "surface": "surface.tif", "base": "base.tif", "after": "after.tif",
        "zones": [{"name": "body", "material": "slimes"}],
        "materials": {"slimes": {"friction_deg": 0, "cohesion_kpa": 1, "liquefied": True}},
    }  # fmt: skip
    document = {"name": "gully", "spacing": 1.0, "duration_s": 8.0, "terrain": terrain}
    write_text(tmp_path / "scene3d.yaml", yaml_text(document))
    done = flowslide.simulate_3d(tmp_path, threads=1)
    assert "x_max" in done.walls
    # Soil ends where the survey found none: the distance is that of the deposit from bare ground.
    thick = done.maps.after.values
    assert done.readings["rms_to_measured_surface_m"] == pytest.approx(
        np.sqrt(np.mean(thick**2)), rel=0.1
    )
    strong = flowslide.simulate_3d(tmp_path, threads=1, strengths_kpa={"slimes": 200.0})
    assert strong.walls == []
    assert strong.readings["toe_runout_m"] < 1.0 < done.readings["toe_runout_m"]
