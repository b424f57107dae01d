"""Cases in three dimensions as the server knows them: listed, read, copied for jobs."""

from __future__ import annotations

import os

import pytest
from starlette.testclient import TestClient

from flowslide.commands.studio import workspace_of
from flowslide.studio.app import studio
from flowslide.studio.bodies import Bodies, files_of, lacking
from flowslide.studio.jobs import Jobs
from flowslide.studio.live import Live
from flowslide.studio.workspace import Workspace
from geometry.scenes3d.scene3d import load_scene_3d
from mpm_taichi.solver3d.problem import problem_of
from pipeline.cli import InputError
from pipeline.files import read_json
from pipeline.places import CASES, shipped
from tests.studio.bodies import write_bank, write_gully
from tests.studio.messages import unpack

PORT, TOKEN = 8321, "the-token"
OURS = {"origin": f"http://127.0.0.1:{PORT}"}


@pytest.fixture
def bodies(tmp_path):
    write_bank(tmp_path / "bank")
    return Bodies(Workspace(tmp_path))


@pytest.fixture
def gully(tmp_path):
    write_gully(tmp_path / "gully")
    return Bodies(Workspace(tmp_path))


@pytest.fixture
def browser(bodies):
    """A client that opened the address that was printed."""
    live = Live(threads=1)
    app = studio(bodies.workspace, live, token=TOKEN)
    client = TestClient(app, base_url=f"http://127.0.0.1:{PORT}", follow_redirects=False)
    client.get("/", params={"token": TOKEN})
    yield client
    live.close()


def test_those_of_the_folder_come_first_and_then_those_that_ship(bodies, tmp_path):
    write_bank(tmp_path / "no case's name")
    listed = bodies.listed()
    assert listed[0] == {"name": "bank", "shipped": False}
    assert {"name": "lower_san_fernando", "shipped": True} in listed
    assert bodies.left_out() == ["no case's name"]
    assert not bodies.is_shipped("bank") and bodies.is_shipped("lower_san_fernando")
    with pytest.raises(InputError, match="no scene3d.yaml in .*none ships"):
        bodies.source("nobody")


def test_what_follows_from_one_is_what_the_solver_takes(bodies, tmp_path):
    found = bodies.read("bank")
    problem = problem_of(load_scene_3d(tmp_path / "bank"))
    derived = found["derived"]
    assert found["faults"] == [] and derived["kind"] == "section"
    assert derived["points"] == len(problem.position)
    assert derived["volume_m3"] == pytest.approx(problem.volume.sum())
    assert derived["size_m"] == [60.0, 16.0] and derived["duration_s"] == 3.0
    assert found["scene"]["zones"] == [{"name": "bank", "material": "soil"}]
    assert derived["paths"]["middle"][0][1] == 8.0 and list(derived["lines"]) == ["road"]
    assert "needs what was measured" in found["asks"]["back_analyse"]
    assert found["asks"]["simulate"] == found["asks"]["predict"] == ""
    finer = bodies.filled("bank", 1.0)
    assert len(finer.problem.position) > 4 * derived["points"]


def test_what_was_measured_has_its_places(gully):
    found = gully.read("gully")
    surface, way = found["marks"]
    assert surface["kind"] == "squares" and surface["every_m"] == 5.0
    assert len(surface["places"]) > 4 and way == {
        "name": "way", "held_out": True, "places": [], "kind": "number", "value": 6.0, "unit": "m",
    }  # fmt: skip
    assert set(found["asks"].values()) == {""} and found["derived"]["origin"] == [1000.0, 500.0]


def test_what_is_wrong_is_said_and_the_rest_is_shown(gully, tmp_path):
    survey = tmp_path / "gully" / "measurements3d.yaml"
    survey.write_text(survey.read_text().replace("path: down", "path: up"))
    found = gully.read("gully")
    (fault,) = found["faults"]
    assert fault["document"] == "measurements3d.yaml" and "no path 'up'" in fault["message"]
    assert found["derived"] is not None and gully.ground("gully")
    scene = tmp_path / "gully" / "scene3d.yaml"
    scene.write_text(scene.read_text().replace("spacing: 1.0", "spacing: -1.0"))
    (fault,) = gully.read("gully")["faults"]
    assert fault["message"].startswith("scene3d.yaml: spacing: ")
    assert str(tmp_path) not in fault["message"]


@pytest.mark.parametrize("way", ["../surface.tif", "link.tif"])
def test_files_lie_in_the_folder(gully, tmp_path, way):
    """A scene from a stranger leads nowhere else."""
    folder = tmp_path / "gully"
    (folder / "surface.tif").rename(tmp_path / "surface.tif")
    (folder / "link.tif").symlink_to(tmp_path / "surface.tif")
    scene = folder / "scene3d.yaml"
    scene.write_text(scene.read_text().replace("surface: surface.tif", f"surface: {way}"))
    (fault,) = gully.read("gully")["faults"]
    assert "leads out of the folder" in fault["message"]
    with pytest.raises(InputError, match="leads out of the folder"):
        gully.snapshot("gully", tmp_path / "copy")


def test_the_revision_follows_documents_and_rasters(gully, tmp_path):
    folder, seen = tmp_path / "gully", {gully.revision("gully")}
    os.utime(folder / "base.tif", ns=(1, 1))
    seen.add(gully.revision("gully"))
    (folder / "inversion.yaml").write_text("{}")
    seen.add(gully.revision("gully"))
    assert len(seen) == 3
    (folder / "notes.txt").write_text("of no concern")
    assert gully.revision("gully") in seen


def test_a_job_gets_the_files_that_are_named_and_no_other(gully, tmp_path):
    (tmp_path / "gully" / "old results.tif").write_text("large")
    copy = gully.snapshot("gully", tmp_path / "job")
    names = sorted(path.name for path in copy.iterdir())
    assert names == ["after.tif", "base.tif", "inversion.yaml", "measurements3d.yaml",
                     "scene3d.yaml", "surface.tif"]  # fmt: skip
    assert Bodies(Workspace(tmp_path / "job")).revision("gully") == gully.revision("gully")
    assert gully.snapshot("lower_san_fernando", tmp_path).parent == shipped(CASES)
    (tmp_path / "gully" / "base.tif").unlink()
    with pytest.raises(InputError, match="base.tif: no such file"):
        gully.snapshot("gully", tmp_path / "other")


def test_a_section_may_lie_in_a_folder_of_its_own(bodies, tmp_path):
    assert bodies.snapshot("bank", tmp_path / "job") / "part" / "bank.yaml" in files_of(
        tmp_path / "job" / "bank"
    )


def test_too_many_points_are_refused_before_they_are_made(bodies):
    with pytest.raises(InputError, match="points at a spacing of 0.01 m: the page takes"):
        bodies.filled("bank", 0.01)


def test_a_spacing_at_which_a_zone_is_too_thin_is_refused_without_the_folder(bodies):
    with pytest.raises(InputError, match="^scene.yaml at 5 m spacing: zones: .* is a sliver"):
        bodies.filled("lower_san_fernando", 5.0)


def test_a_case_with_a_section_is_asked_over_its_width(root):
    folder = root / "case_histories" / "lower_san_fernando"
    assert lacking(folder, "back_analyse") == lacking(folder, "posterior") == ""


def test_jobs_of_a_body_are_refused_in_one_line(gully, tmp_path):
    write_bank(tmp_path / "bank")
    jobs = Jobs(gully.workspace, 1)
    for kind, case, options, words in (
        ("classical", "gully", {}, "not in three dimensions"),
        ("back_analyse", "bank", {}, "needs what was measured"),
        ("simulate", "gully", {"strengths_kpa": {"clay": 5.0}}, "has no material 'clay'"),
        ("simulate", "gully", {"strengths_kpa": {"slimes": -5.0}}, "cohesion_kpa"),
        ("simulate", "gully", {"spacing_m": 1e-3}, "the page takes"),
        ("simulate", "nobody", {}, "none ships"),
    ):
        with pytest.raises(InputError, match=words):
            jobs.start(kind, case, options, body=True)
    for options in ({"strengths_kpa": {"fill": 5.0}}, {"thicker_than_m": [1.0]}):
        with pytest.raises(InputError, match="only in three dimensions"):
            jobs.start("simulate", "lower_san_fernando", options)
    assert jobs.all() == []


def test_the_command_opens_what_is_named(tmp_path, root):
    bank = write_bank(tmp_path / "bank")
    for text in (bank, bank / "scene3d.yaml"):
        workspace, first = workspace_of(str(text))
        assert (workspace.folder, first) == (tmp_path, "3d/bank")
    assert workspace_of("lower_san_fernando")[1] == "lower_san_fernando"
    assert workspace_of("lower_san_fernando/scene3d.yaml")[1] == "3d/lower_san_fernando"
    with pytest.raises(InputError, match="no such case"):
        workspace_of("nobody/scene3d.yaml")


def test_the_server_tells_of_them(browser):
    overview = browser.get("/api/workspace").json()
    assert overview["bodies"][0] == {"name": "bank", "shipped": False}
    assert "bank" not in [one["name"] for one in overview["cases"]]
    found = browser.get("/api/bodies/bank").json()
    revision = browser.get("/api/bodies/bank/revision").json()["revision"]
    assert found["revision"] == revision
    header, arrays = unpack(browser.get("/api/bodies/bank/ground?spacing_m=2").content)
    assert header["shape"] == list(arrays["base"].shape) and header["spacing_m"] == 2.0
    for spacing in ("x", "-1", "nan", "0"):
        answer = browser.get(f"/api/bodies/bank/ground?spacing_m={spacing}")
        assert answer.status_code == 400 and "spacing_m" in answer.json()["message"]
    assert browser.get("/api/bodies/..%2f..").status_code in (400, 404)
    assert browser.get("/api/bodies/nobody").status_code == 400
    for part in ("body/body.js", "body/relief.js", "body/body.css"):
        assert browser.get(f"/{part}").status_code == 200


def test_a_body_has_a_name_that_no_new_case_gets(browser):
    answer = browser.post("/api/cases", json={"name": "bank"}, headers=OURS)
    assert answer.status_code == 400 and "is there already" in answer.json()["message"]


def test_a_job_says_that_it_is_of_a_body(bodies, monkeypatch):
    jobs = Jobs(bodies.workspace, 1)
    monkeypatch.setattr(jobs, "_submit", lambda folder, number: None)
    job = jobs.start("simulate", "bank", {"strengths_kpa": {"soil": 9.0}}, body=True)
    assert job["body"] and job["revision"] == bodies.revision("bank")
    asked = read_json(bodies.workspace.hidden("bank", "jobs", job["id"], "job.json"))
    assert asked["options"]["strengths_kpa"] == {"soil": 9.0} and asked["body"] is True
