"""Maps of a body as the page gets them: the solver's own, frame by frame, next to the survey."""

from __future__ import annotations

import numpy as np
import pytest

from flowslide.studio.body_maps import (
    MOST_CELLS,
    NO_ZONE,
    chosen_frames,
    exceedance_message,
    ground_message,
    measured_surface,
    reading_rows,
    slide_message,
)
from geometry.scenes3d.scene3d import load_scene_3d
from geometry.survey3d.survey import load_survey
from geometry.terrain.raster import Raster, hillshade
from mpm_taichi.readings3d import maps_of, readings_3d
from mpm_taichi.solver3d.problem import problem_of
from mpm_taichi.trajectory3d import Run3d
from report.simulation3d import warning
from tests.studio.bodies import write_bank, write_gully
from tests.studio.messages import unpack


def pushed(problem, frames: int = 70) -> Run3d:
    """A run in which all soil moves along x by 10 m, evenly, without a solver."""
    position = problem.position.astype(np.float32)
    way = np.linspace(0.0, 10.0, frames)[:, None, None] * np.array([1.0, 0.0, 0.0])
    count = len(position)
    return Run3d(
        name=problem.name, positions=position[None] + way.astype(np.float32),
        time=0.1 * np.arange(frames), material=problem.material, zone=problem.zone,
        top_speed=np.full(count, 1.5, np.float32), velocity=np.zeros((count, 3), np.float32),
        stress=np.zeros((count, 6)), initial_stress=np.zeros((count, 6)),
        plastic_shear_strain=np.zeros(count), volume=problem.volume, energy={}, wall_time_s=2.0,
    )  # fmt: skip


@pytest.fixture
def bank(tmp_path):
    scene = load_scene_3d(write_bank(tmp_path / "bank"))
    return scene, problem_of(scene)


def test_the_ground_is_that_of_the_commands(bank):
    scene, problem = bank
    header, arrays = unpack(ground_message(scene, problem, None))
    maps = maps_of(scene, problem)
    assert header["times"] == [0.0] and header["cell_m"] == maps.before.spacing == 4.0
    assert header["first"] == list(maps.before.origin) and header["strengths_kpa"] == {"soil": 15.0}
    assert arrays["thickness"].shape == (1, *header["shape"])
    np.testing.assert_allclose(arrays["thickness"][0], maps.before.values, rtol=1e-6)
    np.testing.assert_array_equal(arrays["shade"][0], np.rint(255 * hillshade(maps.surface)))
    # There is a zone where there is a point: nowhere beyond the bank, which ends at x = 22 m.
    assert (arrays["zone"][0, :4] == 0).all() and (arrays["zone"][0, 7:] == NO_ZONE).all()


def test_a_run_is_shown_from_its_first_to_its_last_frame(bank):
    scene, problem = bank
    run = pushed(problem)
    header, arrays = unpack(
        slide_message(
            scene,
            problem,
            run,
            [],
            warning(["x_max"], {}),
            None,
            duration_s=8.0,
            job="20261128-090000-abcdef",
        )
    )
    assert len(header["times"]) == 60 and header["frames_of_run"] == 70
    assert header["times"][0] == 0.0 and header["times"][-1] == pytest.approx(6.9)
    assert "Soil reached the wall at x_max" in header["warning"]
    assert header["came_to_rest"]
    short = slide_message(scene, problem, run, [], "", None, duration_s=6.9)
    assert not unpack(short)[0]["came_to_rest"] and unpack(short)[0]["warning"] == ""
    assert header["job"] == "20261128-090000-abcdef"
    volume = arrays["thickness"].sum(axis=(1, 2)) * header["cell_m"] ** 2
    np.testing.assert_allclose(volume, problem.volume.sum(), rtol=1e-4)
    end = maps_of(scene, problem, run)
    np.testing.assert_allclose(arrays["thickness"][-1], end.after.values, atol=1e-5)
    assert np.nanmax(arrays["speed"]) == 1.5 and np.isnan(arrays["speed"]).any()
    assert arrays["zone"][-1, 0, 0] == NO_ZONE  # the soil that was there has gone


def test_a_large_map_has_fewer_frames():
    assert list(chosen_frames(5, 100)) == [0, 1, 2, 3, 4]
    for cells in (1000, 400_000, 10_000_000):
        chosen = chosen_frames(500, cells)
        assert chosen[0] == 0 and chosen[-1] == 499
        assert len(chosen) == 2 or len(chosen) * cells <= MOST_CELLS


def test_the_highest_point_gives_a_cell_its_zone(tmp_path):
    scene = load_scene_3d(write_gully(tmp_path / "gully"))
    problem = problem_of(scene)
    header, arrays = unpack(ground_message(scene, problem, None))
    shown = arrays["zone"][0]
    for i, j in ((4, 4), (8, 2)):
        x, y = (header["first"][k] + n * header["cell_m"] for k, n in enumerate((i, j)))
        near = np.hypot(*(problem.position[:, :2] - (x, y)).T) < 0.5 * header["cell_m"]
        top = near.nonzero()[0][problem.position[near, 2].argmax()]
        assert shown[i, j] == problem.zone[top]
    assert set(np.unique(shown)) == {0, 1, NO_ZONE}


def test_what_was_surveyed_is_shown_as_far_as_it_reaches(tmp_path):
    folder = write_gully(tmp_path / "gully")
    scene = load_scene_3d(folder)
    problem, entries = problem_of(scene), load_survey(folder, scene).chosen()
    surveyed = measured_surface(scene, entries)
    header, arrays = unpack(ground_message(scene, problem, surveyed))
    x = header["first"][0] + header["cell_m"] * np.arange(header["shape"][0])
    known = ~np.isnan(arrays["measured"])
    assert known[x <= 30.0].all() and not known[x > 30.0].any()  # its raster ends there
    assert measured_surface(scene, []) is None
    assert not {"measured", "water"} & set(unpack(ground_message(scene, problem, None))[1])


def test_water_has_its_level(tmp_path):
    scene = load_scene_3d(write_gully(tmp_path / "gully", water_level=-3.0))
    _, arrays = unpack(ground_message(scene, problem_of(scene), None))
    assert (arrays["water"] == -3.0).all()


def test_readings_stand_next_to_what_was_measured(tmp_path):
    folder = write_gully(tmp_path / "gully")
    scene = load_scene_3d(folder)
    problem, entries = problem_of(scene), load_survey(folder, scene).chosen()
    run = pushed(problem)
    maps = maps_of(scene, problem, run)
    readings = readings_3d(scene, problem, run, maps)
    rows = reading_rows(scene, maps, readings, entries)
    by_name = {row["name"]: row for row in rows}
    way, runout = by_name["way"], readings["runout_down_m"]
    assert way["measured"] == 6.0 and way["held_out"] and way["label"] == "runout down"
    assert way["in_std"] == pytest.approx((runout - 6.0) / 2.0)
    assert by_name["inundated area"]["unit"] == "m²" and by_name["volume moved"]["measured"] is None
    surface = by_name["surface"]
    assert surface["label"].endswith("places: rms off") and surface["unit"] == "m"
    assert surface["in_std"] == pytest.approx(surface["simulated"] / 0.5)
    lost = reading_rows(scene, maps, {"toe_runout_m": float("nan")}, [])[0]
    assert lost["simulated"] is None and lost["trouble"] == "nothing to read"


def test_probabilities_lie_over_the_ground(bank):
    scene, problem = bank
    before = maps_of(scene, problem).before
    chance = {
        t: Raster(before.origin, before.spacing, np.full(before.values.shape, 1.0 / t))
        for t in (2.0, 4.0)
    }
    header, arrays = unpack(exceedance_message(scene, problem, chance, job="x"))
    assert header["thicker_than_m"] == [2.0, 4.0] and header["type"] == "exceedance"
    assert arrays["exceedance"].shape == (2, *header["shape"])
    assert arrays["exceedance"][:, 0, 0].tolist() == [0.5, 0.25]
