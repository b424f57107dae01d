"""What jobs find is what the command line finds, to the last digit, and the page shows it."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
import yaml
from starlette.testclient import TestClient

from diagnosis.verdict.verdict import CompareDocument, FittedModelSummary
from flowslide.command_line import main
from flowslide.studio import job_process
from flowslide.studio.app import studio
from flowslide.studio.job_answers import back_analysis
from flowslide.studio.job_process import Told
from flowslide.studio.jobs import Job, JobOptions
from flowslide.studio.live import Live
from inversion.back_analysis.result import load_result
from inversion.joint.build import document_of
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import read_json, write_json
from report.sentences.finding import headline
from report.table import plain
from tests.dams import dam_with_pool
from tests.inversion.slides import FEW, dams

PORT, TOKEN = 8321, "the-token"
OURS = {"origin": f"http://127.0.0.1:{PORT}"}
SPACING = 2.0
STRENGTH = "loose=8+-2"
CREST = """
    - {name: crest, type: crest_settlement, at: initial_crest_x, x_m: 70.0, value_m: 3.0,
       std_m: 0.5, std_is: assumed, confidence: published, source: test}
"""


@pytest.fixture
def browser(workspace):
    live = Live(threads=1)
    app = studio(workspace, live, token=TOKEN)
    client = TestClient(app, base_url=f"http://127.0.0.1:{PORT}", follow_redirects=False)
    client.get("/", params={"token": TOKEN})
    yield client
    live.close()


def ask(browser, kind, case="small", **options) -> dict:
    """A job that is done."""
    body = {"kind": kind, "case": case, "options": options}
    answer = browser.post("/api/jobs", json=body, headers=OURS)
    assert answer.status_code == 201, answer.text
    number = answer.json()["id"]
    for _ in range(600):
        found = browser.get(f"/api/jobs/{number}").json()
        if found["state"] != "running":
            assert found["state"] == "done", found.get("message", found)
            return found
        time.sleep(0.1)
    raise AssertionError(found)


def left(browser, job, name) -> dict:
    return browser.get(f"/api/jobs/{job['id']}/files/{name}").json()


def command(capsys, *words) -> str:
    capsys.readouterr()
    assert main([*map(str, words), "--quiet"]) in (0, None)
    return capsys.readouterr().out


@pytest.mark.slow
def test_strength_and_runout_are_those_of_the_command_line(browser, workspace, tmp_path, capsys):
    case = workspace.folder / "small"
    job = ask(browser, "back_analyse", spacing_m=SPACING, quick=True)
    asked = read_json(workspace.hidden("small", "jobs", job["id"], "job.json"))
    assert asked["threads"] == 1, "as the studio was started"
    out = tmp_path / "inversion"
    shared = ["--spacing", SPACING, "--threads", 1]
    command(capsys, "invert", case, "--out", out, "--quick", "--report", "none", *shared)
    own = load_result(out)
    names = ("answer", "strengths", "values", "implied", "ratios")
    assert {name: job[name] for name in names} == back_analysis(own)
    assert job["answer"][0].startswith("S_r: ") and "95 %" in job["answer"][0]
    assert any("the full back-analysis has the rest" in line for line in job["answer"])
    (found,) = job["strengths"]
    (p,) = own.answer.parameters
    assert (found["value"], found["std"]) == (p.value, p.std_total)
    assert (found["low"], found["high"]) == p.interval_95
    tried = [(one["runs"], one["values"], one["loss"]) for one in job["history"]]
    assert tried == [(line.runs_so_far, line.values, line.loss) for line in own.iterations]
    assert job["page"] == "report.html"

    job = ask(browser, "predict", spacing_m=SPACING, strengths=[STRENGTH])
    said = command(capsys, "predict", case, "--residual-strength", STRENGTH, "--out",
                   tmp_path / "prediction", *shared)  # fmt: skip
    document = json.loads((tmp_path / "prediction" / "prediction.json").read_text())
    assert left(browser, job, "prediction.json") == document
    assert job["answer"][0].startswith("S_r ") and job["answer"][0].count("S_r") == 1
    (toe,) = [line for line in job["answer"] if line.startswith("toe")]
    (row,) = [line for line in said.splitlines() if line.startswith("toe (m)")]
    for digits in toe.replace("±", " ").split(":")[1].split("5 to 95 %")[0].split()[:2]:
        assert digits.strip(",") in row.split(), (digits, row)
    page = browser.get(f"/api/jobs/{job['id']}/files/{job['page']}").text.replace("\xa0", " ")
    assert "How far it would run" in page and "8 ± 2 kPa in zone loose" in page


@pytest.mark.slow
def test_the_comparison_is_that_of_the_command_line(browser, workspace, tmp_path, capsys):
    with (workspace.folder / "small" / "measurements.yaml").open("a") as file:
        file.write(CREST)
    job = ask(browser, "compare", spacing_m=SPACING)
    said = command(capsys, "diagnose", "compare", workspace.folder / "small", "--out",
                   tmp_path / "diagnosis", "--spacing", SPACING, "--threads", 1)  # fmt: skip
    own = json.loads((tmp_path / "diagnosis" / "compare.json").read_text())
    found = left(browser, job, "compare.json")
    assert found == own and set(found["base"]) == set(FittedModelSummary.model_fields)
    assert headline(CompareDocument.model_validate(found)) == job["answer"][0]
    assert said.startswith(plain(job["answer"][0]))
    assert job["page"] == "compare.html"


@pytest.mark.slow
def test_the_classical_methods_are_those_of_the_command_line(browser, workspace, tmp_path, capsys):
    folder = dam_with_pool(workspace.folder / "dam")
    path = folder / "classical.yaml"
    calls = yaml.safe_load(path.read_text())
    calls["analyses"][0].update(sections=5, alternatives={
        "unit_weight_factors": [], "zif_shares": [0.4], "sections": [], "slip_surfaces": [],
    })  # fmt: skip
    path.write_text(yaml.safe_dump(calls))
    job = ask(browser, "classical", "dam")
    said = command(capsys, "classical", folder, "--out", tmp_path / "classical")
    own = json.loads((tmp_path / "classical" / "classical.json").read_text())
    assert left(browser, job, "classical.json") == own
    methods = own["analyses"][0]["methods"]
    assert [one["value"] for one in job["strengths"]] == [one["value_kpa"] for one in methods]
    for one in methods:
        assert f"{one['title']} {one['value_kpa']:.1f} kPa" in job["answer"][0]
        assert f"{one['value_kpa']:.1f}" in said
    assert job["page"] == "classical.html" and "upstream.png" in job["files"]


def _job(workspace, number, kind, revision, state="done") -> tuple[Job, Path]:
    """A job that was asked for, and left a file."""
    folder = workspace.hidden("small", "jobs", number)
    job = Job(id=number, kind=kind, case="small", folder="x", revision=revision,
              options=JobOptions())  # fmt: skip
    write_json(folder / "job.json", job.model_dump(mode="json"))
    write_json(folder / "state.json", {"state": state})
    if kind == "classical":
        write_json(folder / "classical" / "classical.json", {"of": number})
    return job, folder


def test_a_report_finds_the_newest_classical_methods_on_the_same_files(workspace, monkeypatch):
    _job(workspace, "1-a", "classical", "now")
    _job(workspace, "2-b", "classical", "now")
    _job(workspace, "3-c", "classical", "now", state="failed")
    _job(workspace, "4-d", "classical", "before")
    asked: list[Path] = []

    def classical(case, *, out, progress):
        asked.append(out)
        raise InputError("no surface after the slide")

    monkeypatch.setattr("flowslide.api.classical", classical)
    job, folder = _job(workspace, "5-e", "back_analyse", "now")
    for _ in range(2):  # a job that goes on finds it again
        job_process._classical(job, folder, Told(folder))
        assert read_json(folder / "classical" / "classical.json") == {"of": "2-b"}
    assert not asked
    # Where there are none on these files they are asked for; a case need not have them.
    job, folder = _job(workspace, "6-f", "back_analyse", "other")
    job_process._classical(job, folder, Told(folder))
    assert asked == [folder / "classical"] and not (folder / "classical").exists()


def test_a_prediction_is_asked_for_with_strengths(browser):
    for options, words in (
        ({}, "strengths, a posterior or joint"),
        ({"strengths": ["loose=8"]}, "MEAN+-STD"),
        ({"strengths": ["loose=8+-"]}, "MEAN+-STD"),
        ({"strengths": ["loose=8+-9"]}, "exceeds the mean"),
        ({"strengths": [STRENGTH], "posterior": "x"}, "one of them"),
        ({"strengths": [STRENGTH], "joint": True}, "one of them"),
        ({"joint": True}, "no such file"),
        ({"posterior": "20260101-000000-abcdef"}, "there is none"),
        ({"posterior": "../../x"}, "there is none"),
        ({"strengths": [STRENGTH], "distribution": "flat"}, "distribution"),
    ):
        body = {"kind": "predict", "case": "small", "options": options}
        answer = browser.post("/api/jobs", json=body, headers=OURS)
        assert answer.status_code == 400 and words in answer.json()["message"], answer.text
    assert browser.get("/api/jobs").json() == []


@pytest.fixture
def others(workspace):
    """What other slides say, in the workspace."""
    document = document_of(dams(), load_config(None, FEW))
    write_json(workspace.joint / "joint.json", document.model_dump(mode="json"))
    return document


def test_the_page_offers_what_other_slides_tell(browser, others):
    told = browser.get("/api/cases/small").json()["derived"]["joint"]
    low, high = others.ratio.interval_95
    assert told == f"{others.ratio.median:.3f} ({low:.3f} to {high:.3f})"


@pytest.mark.slow
def test_a_prediction_takes_the_ratio_of_other_slides(browser, workspace, others, tmp_path, capsys):
    job = ask(browser, "predict", spacing_m=1.5, joint=True)
    command(capsys, "predict", workspace.source("small"), "--joint", workspace.joint,
            "--out", tmp_path / "own", "--spacing", 1.5, "--threads", 1)  # fmt: skip
    own = json.loads((tmp_path / "own" / "prediction.json").read_text())
    assert left(browser, job, "prediction.json") == own
    assert own["strengths"][0]["property"] == "strength_ratio"
    assert own["strengths"][0]["mean"] == pytest.approx(others.ratio.mean)


def test_a_job_says_how_long_it_will_take(tmp_path, monkeypatch):
    clock = [1000.0]
    monkeypatch.setattr(job_process.time, "time", lambda: clock[0])
    told = Told(tmp_path)
    told.report(0, 100, "starting")
    for done in range(1, 60):
        clock[0] += 0.001 if done < 20 else 2.0  # the first are in the store
        told.report(done, 100, "")
        said = read_json(tmp_path / "state.json")
        assert done > 2 or said["left_s"] is None
    assert said["left_s"] == pytest.approx(2.0 * 41, rel=0.01)
    told.end({"state": "done"})
    assert "left_s" not in read_json(tmp_path / "state.json")


@pytest.mark.slow
def test_a_simulation_leaves_its_film(browser, workspace):
    job = ask(browser, "simulate", spacing_m=SPACING)
    films = [name for name in job["files"] if name.endswith(".gif")]
    assert len(films) == 1
    film = browser.get(f"/api/jobs/{job['id']}/files/{films[0]}")
    assert film.content[:6] == b"GIF89a" and film.headers["content-type"] == "image/gif"
    assert any(line.startswith("toe") for line in job["answer"]), job["answer"]


@pytest.mark.slow
def test_blow_counts_say_what_they_say_to_the_command_line(browser, tmp_path, capsys):
    dam = "lower_san_fernando"
    job = ask(browser, "from_blow_counts", dam, spacing_m=3.0)
    command(capsys, "predict", dam, "--from-blow-counts", "--out", tmp_path / "own",
            "--spacing", 3.0, "--threads", 1)  # fmt: skip
    own = json.loads((tmp_path / "own" / "from_blow_counts.json").read_text())
    assert left(browser, job, "from_blow_counts.json") == own
    assert job["page"] == "from_blow_counts.html" and job["answer"]
